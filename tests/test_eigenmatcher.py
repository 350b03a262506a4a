"""Live recognition as the paper does it: one window's leading eigenvector, against the slow twin."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from synthetic import STICK_CLASSES, stick_clip, stick_clips

from library.motionlibrary import MotionLibrary
from stream.eigenmatcher import EigenvectorMatcher
from stream.recognition import Outcome
from stream.window import MOST_PENDING

if TYPE_CHECKING:
    from stream.matcher import Reading

PAIRS = list(combinations(range(6), 2))


@pytest.fixture(scope="module")
def library() -> MotionLibrary:
    return MotionLibrary.of_clips(stick_clips())


def _matcher(
    library: MotionLibrary, *, window: float = 0.5, stillness: float = 0.01, smallest_gap: float = 0.02
) -> EigenvectorMatcher:
    return EigenvectorMatcher(library, window=window, stillness=stillness, smallest_gap=smallest_gap)


def _rows(class_name: str, frames: int = 240) -> np.ndarray:
    return naive.distance_rows(stick_clip(class_name, seed=31, frames=frames).positions, PAIRS)


def _readings(matcher: EigenvectorMatcher, rows: np.ndarray, start: float = 0.0, every: int = 4) -> dict[int, Reading]:
    """Push rows at 120 frames per second; readings by the index of their newest row."""
    readings = {}
    for index, row in enumerate(rows):
        matcher.push([start + index / 120], row[None])
        if matcher.ready and index % every == 0:
            readings[index] = matcher.read()
    return readings


@pytest.mark.parametrize("every", [1, 7, 100])
def test_every_reading_is_the_textbooks(library: MotionLibrary, every: int) -> None:
    """Scores, movement, share and gap are those of the whole eigenproblem of the last half second's rows."""
    rows = np.concatenate([_rows(name, 150) for name in STICK_CLASSES])
    names = [motion.class_name for motion in library.motions]
    readings = _readings(_matcher(library), rows, every=every)
    assert readings
    for index, reading in readings.items():
        window = rows[index - 59 : index + 1]
        matrix = naive.covariance(window)
        value, axis = naive.leading_eigenvector(matrix)
        _, best = naive.match(library.axes, names, axis)
        assert reading.scores == pytest.approx([best[name] for name in library.classes], abs=1e-4)
        assert reading.best == int(reading.scores.argmax())
        size = np.sqrt(np.square(window.mean(axis=0)).mean())
        assert reading.movement == pytest.approx(np.sqrt(np.trace(matrix) / 15) / size, rel=1e-6)
        assert reading.axis is not None
        assert reading.axis.share == pytest.approx(value / np.trace(matrix), rel=1e-6)


@pytest.mark.parametrize("every", [2, 7, 60, MOST_PENDING])
def test_frames_that_come_together_are_read_as_if_one_by_one(library: MotionLibrary, every: int) -> None:
    """Pushed in batches, as many frames as the window holds or more among them, readings are those of single frames."""
    rows = np.concatenate([_rows(name, 150) for name in STICK_CLASSES])
    # A gap in the middle of some batch.
    times = np.arange(len(rows)) / 120 + 0.3 * (np.arange(len(rows)) > 301)
    single, batched, read = _matcher(library), _matcher(library), 0
    for begin in range(0, len(rows), every):
        some = slice(begin, begin + every)
        for time, row in zip(times[some].tolist(), rows[some], strict=True):
            single.push([time], row[None])
        batched.push(times[some].tolist(), rows[some])
        assert batched.ready == single.ready
        if not single.ready:
            continue
        one, other = single.read(), batched.read()
        assert other.scores == pytest.approx(one.scores, abs=1e-5)
        assert (other.best, other.outcome) == (one.best, one.outcome)
        assert other.movement == pytest.approx(one.movement, rel=1e-9)
        read += 1
    assert read > 4


@pytest.mark.parametrize("window", [0.25, 1.0])
def test_it_is_ready_after_one_whole_window(library: MotionLibrary, window: float) -> None:
    """Not before rows have come for the window's length is there a reading."""
    readings = _readings(_matcher(library, window=window), _rows("bow"), every=1)
    assert min(readings) == round(window * 120)


@pytest.mark.parametrize(
    ("smallest_gap", "outcome"), [(0.02, Outcome.NAMED), (0.5, Outcome.NAMED), (1.0, Outcome.AMBIGUOUS)]
)
def test_too_small_a_gap_is_ambiguous(library: MotionLibrary, smallest_gap: float, outcome: Outcome) -> None:
    """A gap below the smallest is ambiguous, above it named; the best guess is given all the same."""
    readings = _readings(_matcher(library, smallest_gap=smallest_gap), _rows("jump"))
    assert {reading.outcome for reading in readings.values()} == {outcome}
    assert {library.classes[reading.best] for reading in readings.values()} == {"jump"}


@pytest.mark.parametrize("smallest_gap", [0.02, 1.0])
def test_too_little_movement_is_still_whatever_the_gap(library: MotionLibrary, smallest_gap: float) -> None:
    """Below the stillness the outcome is still, whatever the axis; scores and movement are told as they are."""
    readings = _readings(_matcher(library, stillness=0.9, smallest_gap=smallest_gap), _rows("jump"))
    moving = _readings(_matcher(library), _rows("jump"))
    assert readings.keys() == moving.keys()
    for index, reading in readings.items():
        assert reading.outcome is Outcome.STILL
        assert np.array_equal(reading.scores, moving[index].scores)
        assert reading.movement == pytest.approx(moving[index].movement, rel=1e-9)


def test_after_clear_it_is_as_new(library: MotionLibrary) -> None:
    """Cleared, it is not ready, takes earlier times and gives what a new one gives, number for number."""
    used = _matcher(library)
    _readings(used, _rows("wave"), start=500.0)
    used.clear()
    assert not used.ready
    again, new = _readings(used, _rows("bow")), _readings(_matcher(library), _rows("bow"))
    assert list(again) == list(new)
    for one, other in zip(again.values(), new.values(), strict=True):
        assert np.array_equal(one.scores, other.scores)
        assert one.movement == other.movement
