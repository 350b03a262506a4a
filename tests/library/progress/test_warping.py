"""Time warping: phases that recordings agree on."""

from __future__ import annotations

import numpy as np
from naive_progress import warped_phase

from kinespace.library.progress.warping import agreed_phases, warped_phases


def curves(count: int, seed: int) -> list[np.ndarray]:
    """Draw the same path at several speeds, with a little noise."""
    generator = np.random.default_rng(seed)
    drawn = []
    for _ in range(count):
        times = np.linspace(0, 1, int(generator.integers(9, 17))) ** generator.uniform(0.7, 1.4)
        path = np.column_stack([np.sin(3 * times), np.cos(3 * times), times])
        drawn.append(path + generator.normal(0, 0.02, path.shape))
    return drawn


def test_many_pairs_together_equal_each_pair_alone() -> None:
    """Pairs of different lengths, warped in one batch, get the result that the recursion gives each by itself."""
    drawn = curves(6, 1)
    pairs = [(one, other) for one in drawn for other in drawn[::2]]
    for (one, other), phases in zip(pairs, warped_phases(pairs), strict=True):
        np.testing.assert_allclose(phases, warped_phase(one, other), atol=1e-12)


def test_a_pause_before_a_motion_does_not_count() -> None:
    """A recording that stands still at first has a phase near 0 until it moves; it never falls."""
    drawn = curves(6, 3)
    late = np.vstack([np.repeat(drawn[0][:1], 12, axis=0), drawn[0]])
    phases = agreed_phases([late, *drawn[1:]], ["a", "b", "b", "c", "c", "d"])[0]
    assert phases[11] < 0.1
    assert phases[-1] > 0.9
    assert (np.diff(phases) >= 0).all()


def test_alone_a_recordings_phase_is_its_time() -> None:
    """Without another recording of the class relative time stands in; recordings of one actor are warped together."""
    (alone,) = curves(1, 4)
    np.testing.assert_allclose(agreed_phases([alone], ["a"])[0], np.linspace(0, 1, len(alone)))
    both = agreed_phases(curves(2, 5), ["a", "a"])
    assert [(phases[0] < 0.2, phases[-1] > 0.8) for phases in both] == [(True, True)] * 2
