"""How far in its motion each moment is: recordings warped onto each other, and the tables made of them."""

import gc
import math
import weakref
from dataclasses import replace

import numpy as np
import pytest
from naive_courses import warped_phase
from naive_windows import body_of
from synthetic import STICK, stick_clip, stick_clips

from kinespace.library import MotionLibrary, WindowIndex, distance_rows
from kinespace.library.phases import PhaseTable, warped_phases

# --- warping ----------------------------------------------------------------------------------------------------------


def curves(count: int, seed: int) -> list[np.ndarray]:
    """Draw the same path at several speeds, with a little noise."""
    generator, drawn = np.random.default_rng(seed), []
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


# --- phase table ------------------------------------------------------------------------------------------------------


#: Moments a second, and how many of them a velocity and a swing go back.
RATE, BACK, SWING = 15.0, 2, 15


@pytest.fixture(scope="module")
def index() -> WindowIndex:
    """Give recordings of two classes that swing, of one that goes somewhere, and one too short to be followed."""
    clips = [
        replace(stick_clip(name, seed=seed, actor=actor, frames=frames, rate=rate), frame_rate=60.0)
        for name, frames, rate in (("bow", 121, 240.0), ("jump", 75, 60.0))
        for seed, actor in enumerate(("aa", "bb", "cc"))
    ]
    away = [replace(clip, class_name="away") for clip in clips[:3]]
    ways = np.linspace(0, 1, 121)[:, None, None] * np.random.default_rng(3).normal(size=(6, 3))
    away = [clip.moved_to(clip.positions[:1] + (1 + 0.05 * place) * ways) for place, clip in enumerate(away)]
    short = replace(stick_clip("wave", frames=15, rate=60.0), class_name="short")
    return WindowIndex.of(MotionLibrary.of_clips([*clips, *away, short]))


def _moving(index: WindowIndex, clip_positions: np.ndarray, frame_rate: float) -> np.ndarray:
    """Give points and velocities of the moments of a clip, one by one."""
    body, pairs = body_of(STICK), range(len(clip_positions))
    duration = len(pairs) / frame_rate
    places = [min(round(k / RATE * frame_rate), len(pairs) - 1) for k in range(round(duration * RATE) + 1)]
    rows = distance_rows(clip_positions[places], STICK)
    size = np.mean([body.size(row) for row in rows])
    points = [row @ index.basis.directions / size for row in rows]
    velocities = [
        points[min(max(k, BACK), len(points) - 1)] - points[max(min(max(k, BACK), len(points) - 1) - BACK, 0)]
        for k in range(len(points))
    ]
    return np.array([np.concatenate([one, 3 * other]) for one, other in zip(points, velocities, strict=True)])


def test_moments_by_definition(index: WindowIndex) -> None:
    """Vectors, phases, speeds and swings of each recording, and their means over moments at the same phase."""
    table, half = index.phases, index.basis.directions.shape[1]
    assert set(table.classes) == {"away", "bow", "jump"}
    assert table.whitening.shape == (2 * half, min(24, 2 * half))
    for moments in table.classes.values():
        own = [_moving(index, motion.positions, motion.frame_rate) for motion in moments.clips]
        lengths, count = [len(each) for each in own], moments.speeds.shape[1]
        assert count == round(np.mean(lengths))
        assert moments.seconds == pytest.approx((np.mean(lengths) - 1) / RATE)
        speeds, swings = [], []
        for moving, phases, vectors in zip(own, moments.phases, moments.vectors, strict=True):
            assert (phases[0], phases[-1]) == (pytest.approx(0.0, abs=0.2), pytest.approx(1.0, abs=0.2))
            assert (np.diff(phases) >= 0).all()
            past = [moving[max(0, k - SWING) : k + 1, :half] for k in range(len(moving))]
            swing = [0.5 * math.log(sum(np.var(axis) for axis in each.T) + 1e-6) for each in past]
            at = [np.interp(moment / (count - 1), phases, range(len(moving))) for moment in range(count)]
            read = np.array([[np.interp(each, range(len(moving)), axis) for axis in (*moving.T, swing)] for each in at])
            np.testing.assert_allclose(vectors, read[:, :-1] @ table.whitening, rtol=1e-4, atol=1e-3)
            speeds.append((read[:, half:-1] ** 2).sum(axis=1) * (len(moving) / np.mean(lengths)) ** 2)
            swings.append(read[:, -1])
        np.testing.assert_allclose(moments.speeds, speeds)
        np.testing.assert_allclose(moments.usual_speeds, np.mean(speeds, axis=0))
        np.testing.assert_allclose(moments.usual_swings, np.mean(swings, axis=0))


def test_a_class_that_stays_is_not_followed_again() -> None:
    """Its numbers are the same ones; those of a library that is gone are gone."""
    index = WindowIndex.of(MotionLibrary.of_clips(stick_clips()))
    more = index.with_motions([replace(stick_clip("jump", seed=9, frames=100), class_name="duck")])
    before, now = index.phases.classes, more.phases.classes
    assert now["wave"].moving is before["wave"].moving
    assert set(now) == {*before, "duck"}
    gone = weakref.ref(index.basis)
    del index, more, before, now
    gc.collect()
    assert gone() is None


def test_motions_that_end_as_they_begin_are_cyclic(index: WindowIndex) -> None:
    """A swing there and back is cyclic, a way to somewhere else is not."""
    assert [index.phases.classes[name].cyclic for name in ("away", "bow")] == [False, True]


def test_axes_are_whitened_by_the_differences_of_people(index: WindowIndex) -> None:
    """The more people differ along an axis, the less it counts; without several recordings nothing is learned."""
    some = [motion for motion in index.library.motions if motion.class_name == "bow"]
    alone = PhaseTable.of(some[:1], index.body, index.basis)
    kept = alone.whitening / np.linalg.norm(alone.whitening, axis=0)
    np.testing.assert_allclose(kept.T @ kept, np.eye(kept.shape[1]), atol=1e-9)
    assert np.ptp(np.linalg.norm(alone.whitening, axis=0)) < 1e-9
    assert np.ptp(np.linalg.norm(index.phases.whitening, axis=0)) > 0.1
    none = PhaseTable.of([], index.body, index.basis)
    assert (dict(none.classes), len(none.whitening)) == ({}, 2 * index.basis.directions.shape[1])
