from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinespace.library import Clip, MotionLibrary, distance_rows
from kinespace.library.teaching.movement import MovementMeter, Stretch, StretchFinder, relative_movement, stretches_of


def _take(seconds_still: float, noise: float = 0.0) -> tuple[Clip, list[Stretch]]:
    """Put some built-in motions one after another, standing still between; give when each moves."""
    library = MotionLibrary.builtin()
    frames, moving, generator = list[np.ndarray](), list[Stretch](), np.random.default_rng(0)
    still = round(seconds_still * 60)
    for motion in (library.motions[0], library.motions[40], library.motions[130]):
        frames.append(np.repeat(motion.positions[:1], still, axis=0))
        begin = sum(map(len, frames)) / 60
        frames.append(motion.positions)
        moving.append(Stretch(begin, begin + motion.frames / 60))
        frames.append(np.repeat(motion.positions[-1:], still, axis=0))
    positions = np.concatenate(frames)
    positions = positions + noise * generator.standard_normal(positions.shape)
    return Clip(library.skeleton, positions, 60.0), moving


@pytest.mark.parametrize("noise", [0.0, 0.008])
def test_motions_between_stillnesses_are_found(noise: float) -> None:
    """Each stretch lies in its motion but for the margins, and holds most of it."""
    take, moving = _take(1.0, noise)
    found = stretches_of(take)
    assert len(found) == len(moving)
    for stretch, motion in zip(found, moving, strict=True):
        assert motion.start - 0.2 <= stretch.start
        assert stretch.end <= motion.end + 0.35
        assert stretch.duration > 0.6 * motion.duration


def test_stretches_end_at_gaps() -> None:
    """A gap in the middle of a motion divides it, because nobody knows the movement in the gap."""
    take, moving = _take(1.0)
    middle = (moving[0].start + moving[0].end) / 2
    parted = replace(take, gaps=((middle, middle + 0.6),))
    assert all(found.end <= middle or found.start >= middle + 0.6 for found in stretches_of(parted))


def test_relative_movement_is_the_textbook_formula() -> None:
    """Deviation over distance, less the noise that second differences tell, row by row."""
    rows = 1 + np.random.default_rng(2).normal(0, 0.1, (7, 5))
    mean = [sum(rows[:, pair]) / 7 for pair in range(5)]
    swing = sum((rows[frame, pair] - mean[pair]) ** 2 for frame in range(7) for pair in range(5)) / 7
    bends = sum(
        (rows[frame + 1, pair] - 2 * rows[frame, pair] + rows[frame - 1, pair]) ** 2
        for frame in range(1, 6)
        for pair in range(5)
    )
    expected = max(swing - bends / 5 / 6, 0) / sum(each**2 for each in mean)
    assert relative_movement(rows) == pytest.approx(expected**0.5)


def test_the_meter_measures_as_fast_a_feed_as_a_slow_one() -> None:
    """Movement is measured alike at any frame rate."""
    take, moving = _take(1.0)
    values = {}
    for every in (1, 2):
        meter = MovementMeter(take.skeleton)
        measured = {
            round(time, 3): value
            for time, frame in list(zip(take.times.tolist(), take.positions, strict=True))[::every]
            if (value := meter.push(time, frame)) is not None
        }
        values[every] = measured
    shared = sorted(set(values[1]) & set(values[2]))
    assert len(shared) > 100
    assert np.median([abs(values[1][time] - values[2][time]) for time in shared]) < 1e-6
    at = next(time for time in shared if time > moving[0].start + 0.5)
    rows = distance_rows(take.positions[[round((at - back / 30) * 60) for back in range(5, -1, -1)]], take.skeleton)
    assert values[1][at] == pytest.approx(relative_movement(rows), rel=0.5)


def test_hysteresis() -> None:
    """Movement between the two thresholds neither begins a motion nor ends one."""
    finder = StretchFinder(0.01)
    for step in range(30):
        assert finder.push(step / 30, 0.015) is None
    assert finder.began is None
    for step in range(30, 60):
        finder.push(step / 30, 0.05)
    assert finder.began == pytest.approx(1.0)
    for step in range(60, 90):
        assert finder.push(step / 30, 0.015) is None
    found = [each for step in range(90, 120) if (each := finder.push(step / 30, 0.005))]
    assert found == [pytest.approx((0.9, 89 / 30 - 0.1))]
