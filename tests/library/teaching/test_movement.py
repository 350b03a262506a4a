from dataclasses import replace

import numpy as np
import pytest
from synthetic import gesture

from kinespace.library import Clip, MotionLibrary, distance_rows
from kinespace.library.teaching.movement import (
    Movement,
    MovementMeter,
    Stretch,
    StretchFinder,
    limb_speed,
    moved_at_all,
    moved_in,
    relative_movement,
    stillness_of,
    stretches_of,
)


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
    """Movement is measured alike at any frame rate, thirty times a second over a fifth of a second."""
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
    assert np.median([abs(values[1][time].body - values[2][time].body) for time in shared]) < 1e-6
    at = next(time for time in shared if time > moving[0].start + 0.5)
    rows = distance_rows(take.positions[round(at * 60) - 12 : round(at * 60) + 1 : 2], take.skeleton)
    assert values[1][at].body == relative_movement(rows)
    assert np.diff(sorted(values[1])) == pytest.approx(1 / 30, abs=2e-3)


def test_hysteresis() -> None:
    """Between the two thresholds no motion begins and none ends; too short a movement or stillness changes nothing."""
    finder, found, began = StretchFinder(0.01), {}, {}
    shown = ((30, 0.0199), (3, 0.02), (3, 0.0), (30, 0.02), (30, 0.0101), (14, 0.01), (1, 0.0101), (20, 0.01))
    for step, movement in enumerate(movement for count, movement in shown for _ in range(count)):
        found[step], began[step] = finder.push(step / 30, Movement(movement)), finder.began
    assert {step: each for step, each in found.items() if each} == {125: pytest.approx((1.1, 110 / 30 - 0.1))}
    assert {step for step, each in began.items() if each == 1.2} == set(range(39, 125))
    assert set(began.values()) == {None, 1.2}


def test_a_limb_begins_a_motion_that_the_whole_body_does_not() -> None:
    """The nod of a head moves the whole body by less than it trembles; the head alone begins it."""
    nod = gesture("nod")
    found = moved_at_all(nod)
    assert found
    assert found == (pytest.approx(1.0, abs=0.35), pytest.approx(3.0, abs=0.2))
    meter = MovementMeter(nod.skeleton)
    movements = [each for time, body in zip(nod.times, nod.positions, strict=True) if (each := meter.push(time, body))]
    assert max(each.body for each in movements) < 0.01 < max(each.limb for each in movements)


@pytest.mark.parametrize(("speed", "begins"), [(0.1, False), (0.3, True), (0.6, True)])
def test_a_slow_limb_begins_a_motion(speed: float, begins: bool) -> None:  # noqa: FBT001 - a parameter of the test
    """A hand that goes against the body, in body sizes a second, begins a motion after three fifths of a second."""
    standing = gesture("nod")
    bodies = np.repeat(standing.positions[:1], 150, axis=0)
    hand = np.zeros(150)
    hand[60:90] = np.arange(1, 31) / 30
    hand[90:] = 1.0
    size = np.sqrt(np.square(distance_rows(bodies[:1], standing.skeleton)).mean())
    bodies[:, 18, 1] += speed * size * hand * (30 / standing.frame_rate)
    found = [*moved_in(replace(standing, positions=bodies))]
    assert bool(found) == begins
    if found:
        moved = 60 / standing.frame_rate, 90 / standing.frame_rate
        assert moved[0] - 0.2 < found[0].start < moved[0] + 0.6
        assert moved[1] - 0.3 < found[0].end < moved[1] + 0.7


@pytest.mark.parametrize("name", ["nod", "hand wave", "bow"])
@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_a_small_gesture_begins_after_standing(name: str, noise: float) -> None:
    """The trembling of the second before says how little is needed; a feed that trembles by 2 mm is still quiet."""
    shown = gesture(name)
    trembling = noise * np.random.default_rng(0).normal(size=shown.positions.shape)
    meter, standing, began = MovementMeter(shown.skeleton), list[tuple[float, Movement]](), list[float]()
    finder = StretchFinder()
    for time, body in zip(shown.times.tolist(), shown.positions + trembling, strict=True):
        movement = meter.push(time, body)
        if movement and time < 1:
            standing.append((time, movement))
            finder = StretchFinder(stillness_of(standing))
        elif movement:
            finder.push(time, movement)
            began += [finder.began] if finder.began is not None else []
    assert began
    assert 1.0 < began[0] < 1.5


def test_the_limb_speed_is_that_of_its_joint() -> None:
    """One of four joints goes at a steady speed against the others; the joint not seen does not matter."""
    corners = np.array([[0, 0, 0], [0, 2, 0], [1, 0, 0], [1, 2, 0], [9, 9, 9]], dtype=float)
    times = np.arange(7) / 30
    bodies = np.repeat(corners[None], 7, axis=0)
    bodies[:, 0, 2] = 0.3 * times
    bodies[3, 4] = np.nan
    # The centre goes along with a quarter of the speed; in such a body the mean squared distance is 10/3.
    assert limb_speed(times, bodies) == pytest.approx(0.3 * 0.75 / (10 / 3) ** 0.5, rel=1e-3)


def test_a_joint_that_jumps_begins_no_motion() -> None:
    """A depth sensor's joints jump for a moment; a limb counts after a tenth of a second."""
    nod = gesture("nod")
    standing = np.repeat(nod.positions[:1], 120, axis=0)
    standing[60:64, 18] += 0.1
    assert [*moved_in(replace(nod, positions=standing))] == []
