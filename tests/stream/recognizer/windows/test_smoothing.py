from __future__ import annotations

import numpy as np
import pytest

from kinespace.library import MotionLibrary, distance_rows
from kinespace.library.windows.body import Body
from kinespace.stream.recognizer.windows.smoothing import NOISY, RowSmoother


def _rows(noise: float, rate: float = 30.0) -> tuple[list[float], np.ndarray, np.ndarray]:
    """Give times, clean rows and noisy rows of a real motion; noise in metres on every coordinate."""
    clip = max(MotionLibrary.builtin().motions, key=lambda each: each.frames)
    step = max(1, round(clip.frame_rate / rate))
    positions = clip.positions[::step]
    shaken = positions + np.random.default_rng(3).normal(0, noise, positions.shape)
    times = (np.arange(len(positions)) * step / clip.frame_rate).tolist()
    return times, distance_rows(positions, clip.skeleton), distance_rows(shaken, clip.skeleton)


def _smoother() -> RowSmoother:
    skeleton = MotionLibrary.builtin().skeleton
    return RowSmoother(Body.of(skeleton).segments, len(skeleton.pairs))


def test_a_clean_feed_is_unchanged() -> None:
    """A recording's own rows pass through, number for number."""
    times, clean, _ = _rows(0.0)
    smoother = _smoother()
    for time, row in zip(times, clean, strict=True):
        passed = row[None].copy()
        smoother.smooth([time], passed)
        assert np.array_equal(passed[0], row)
    assert smoother.noise < NOISY / 4


@pytest.mark.parametrize("noise", [0.01, 0.02, 0.03])
def test_the_noise_is_estimated(noise: float) -> None:
    """The noise of a distance between two shaken joints is √2 times the noise of a coordinate."""
    times, _, shaken = _rows(noise)
    smoother = _smoother()
    smoother.smooth(times[:60], shaken[:60].copy())
    assert smoother.noise == pytest.approx(noise * np.sqrt(2), rel=0.2)


def test_a_noisy_feed_comes_nearer_to_the_clean_one() -> None:
    """Averaged rows are nearer to the motion, and each is the mean of the last tenth of a second."""
    times, clean, shaken = _rows(0.03)
    smoother = _smoother()
    smooth = []
    for time, row in zip(times, shaken, strict=True):
        passed = row[None].copy()
        smoother.smooth([time], passed)
        smooth.append(passed[0])
    later = slice(10, None)
    before, after = (np.abs(each - clean)[later].mean() for each in (shaken, np.array(smooth)))
    assert after < 0.8 * before
    assert np.allclose(smooth[-1], shaken[-3:].mean(axis=0))


def test_rows_that_come_together_are_smoothed_as_one_by_one() -> None:
    """How many rows come at once changes nothing once the noise is known."""
    times, _, shaken = _rows(0.03)
    one, four = _smoother(), _smoother()
    one.smooth(times[:40], shaken[:40].copy())
    four.smooth(times[:40], shaken[:40].copy())
    together = shaken[40:44].copy()
    four.smooth(times[40:44], together)
    for index in range(40, 44):
        single = shaken[index : index + 1].copy()
        one.smooth(times[index : index + 1], single)
        assert np.allclose(single[0], together[index - 40])


def test_clear_forgets_the_noise() -> None:
    """After a restart a feed counts as clean until it has shown otherwise."""
    times, _, shaken = _rows(0.03)
    smoother = _smoother()
    smoother.smooth(times[:40], shaken[:40].copy())
    smoother.clear()
    row = shaken[40:41].copy()
    smoother.smooth(times[40:41], row)
    assert smoother.noise == 0
    assert np.array_equal(row, shaken[40:41])


def test_without_segments_all_pairs_tell_the_noise() -> None:
    """Markers whose parents are not known are smoothed too."""
    times, _, shaken = _rows(0.03)
    smoother = RowSmoother(np.empty(0, dtype=np.intp), shaken.shape[1])
    smoother.smooth(times[:60], shaken[:60].copy())
    assert smoother.noise > NOISY
