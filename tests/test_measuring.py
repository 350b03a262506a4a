"""Measures of live windows: those of the same frames measured at rest, at every hop."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from naive_live import last_rows

from library.comparison import MEASURES
from library.distances import distance_rows
from library.measures import FEWEST_FRAMES, Basis, Body, Kind, Measure, measured
from library.motionlibrary import MotionLibrary
from stream.measuring import WindowMeasurer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from library.clip import Clip
    from library.skeleton import Skeleton

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

#: Frames between two hops; at 30 Hz every frame is one.
HOPS = {120: 12, 60: 6, 30: 3}


@pytest.fixture(scope="module")
def basis() -> Basis:
    windows = MotionLibrary.builtin().windows
    assert windows is not None
    return windows.comparison.basis


def _fed(clips: Sequence[Clip], rate: int) -> tuple[np.ndarray, np.ndarray]:
    """Give the times and distance rows of clips one after another at a rate that divides 120."""
    positions = np.concatenate([clip.positions for clip in clips])[:: 120 // rate]
    return 50.0 + np.arange(len(positions)) / rate, distance_rows(positions, clips[0].skeleton)


def _assert_at_rest(
    measurer: WindowMeasurer, skeleton: Skeleton, basis: Basis, times: np.ndarray, rows: np.ndarray
) -> None:
    """Hold every measure against the library's, of just the rows that are in its window."""
    body = Body.of(skeleton)
    live = measurer.read().numbers
    assert set(live) == set(MEASURES)
    for measure, numbers in live.items():
        window = last_rows(times, rows, times[-1], measure.seconds)
        ends = np.array([len(window)])
        # Counted in frames, the measure must reach over all of them.
        exact = measured(window, 1e6, ends, measure, body=body, basis=basis)[0]
        assert numbers == pytest.approx(exact, abs=2e-5 if measure.kind is Kind.SHAPE else 1e-6), measure.name


@pytest.mark.parametrize("rate", [120, 60, 30])
def test_at_every_hop_and_rate_they_are_those_at_rest(some_clips: tuple[Clip, ...], basis: Basis, rate: int) -> None:
    """Over real clips, one after another, each measure is the library's of the same frames, from the first on."""
    times, rows = _fed(some_clips[2:6], rate)
    measurer = WindowMeasurer(MEASURES, Body.of(some_clips[0].skeleton), basis)
    hops = 0
    for index, (time, row) in enumerate(zip(times.tolist(), rows, strict=True), start=1):
        measurer.push([time], row[None])
        if measurer.ready and index % HOPS[rate] == 0:
            _assert_at_rest(measurer, some_clips[0].skeleton, basis, times[:index], rows[:index])
            hops += 1
    assert hops > 40


def test_of_several_performers_they_are_those_of_each(some_clips: tuple[Clip, ...], basis: Basis) -> None:
    """Measured in one go, the windows of several performers, of any age, measure what each measures alone."""
    body = Body.of(some_clips[0].skeleton)
    measurers = [WindowMeasurer(MEASURES, body, basis) for _ in range(4)]
    for measurer, clip, frames in zip(measurers, some_clips, (8, 30, 100, 170), strict=False):
        rows = distance_rows(clip.positions[:frames], clip.skeleton)
        for index, row in enumerate(rows):
            measurer.push([5.0 + index / 120], row[None])
    for count in (1, 2, 4):
        numbers, movements = measurers[0].read_with(measurers[1:count])
        assert set(numbers) == set(MEASURES)
        for place, measurer in enumerate(measurers[:count]):
            alone = measurer.read()
            assert movements[place] == pytest.approx(alone.movement, rel=1e-9)
            for measure in MEASURES:
                assert numbers[measure].shape == (count, len(alone.numbers[measure]))
                assert numbers[measure][place] == pytest.approx(alone.numbers[measure], abs=1e-9)


def test_lost_frames_leave_what_is_there(some_clips: tuple[Clip, ...], basis: Basis) -> None:
    """With a third of the frames lost, measures are those of the frames that came, by their times."""
    times, rows = _fed(some_clips[5:8], 120)
    kept = np.random.default_rng(12).random(len(times)) > 1 / 3
    times, rows = times[kept], rows[kept]
    measurer = WindowMeasurer(MEASURES, Body.of(some_clips[0].skeleton), basis)
    for index, (time, row) in enumerate(zip(times.tolist(), rows, strict=True), start=1):
        measurer.push([time], row[None])
        if index % 20 == 0:
            _assert_at_rest(measurer, some_clips[0].skeleton, basis, times[:index], rows[:index])


@pytest.mark.parametrize("frames", [200, 300])
def test_hops_far_apart_change_nothing(some_clips: tuple[Clip, ...], basis: Basis, frames: int) -> None:
    """When hundreds of frames come before the first question, the answer is the same."""
    times, rows = _fed(some_clips[:3], 120)
    measurer = WindowMeasurer(MEASURES, Body.of(some_clips[0].skeleton), basis)
    for time, row in zip(times[:frames].tolist(), rows, strict=False):
        measurer.push([time], row[None])
    _assert_at_rest(measurer, some_clips[0].skeleton, basis, times[:frames], rows[:frames])


@pytest.mark.parametrize("most", [3, 40, 64])
def test_frames_that_come_together_are_measured_as_if_one_by_one(
    some_clips: tuple[Clip, ...], basis: Basis, most: int
) -> None:
    """In batches longer and shorter than the windows, gaps inside them, measures are those of the frames at rest."""
    times, rows = _fed(some_clips[3:6], 120)
    generator = np.random.default_rng(most)
    times = times + np.cumsum(0.08 * (generator.random(len(times)) < 0.01))
    measurer = WindowMeasurer(MEASURES, Body.of(some_clips[0].skeleton), basis)
    ends = np.minimum(np.cumsum(generator.integers(0, most + 1, size=40)), len(times)).tolist()
    for begin, end in pairwise([0, *ends]):
        measurer.push(times[begin:end].tolist(), rows[begin:end])
        if measurer.ready:
            _assert_at_rest(measurer, some_clips[0].skeleton, basis, times[:end], rows[:end])
    assert measurer.ready


def test_a_start_is_measured_as_far_as_it_reaches(some_clips: tuple[Clip, ...], basis: Basis) -> None:
    """As soon as there are frames enough it is ready, and every window is all there is, as of a recording's start."""
    times, rows = _fed(some_clips[:1], 120)
    measurer = WindowMeasurer(MEASURES, Body.of(some_clips[0].skeleton), basis)
    for index in range(FEWEST_FRAMES):
        assert not measurer.ready
        measurer.push([float(times[index])], rows[index : index + 1])
    assert measurer.ready
    body, ends = Body.of(some_clips[0].skeleton), np.array([FEWEST_FRAMES])
    for measure, numbers in measurer.read().numbers.items():
        exact = measured(rows, 120.0, ends, measure, body=body, basis=basis)[0]
        assert numbers == pytest.approx(exact, abs=2e-5), measure.name


def test_after_clear_nothing_is_left(some_clips: tuple[Clip, ...], basis: Basis) -> None:
    """Cleared, it is not ready, may be given earlier times, and measures what comes next number for number as new."""
    times, rows = _fed(some_clips[:4], 120)
    used, fresh = (WindowMeasurer(MEASURES, Body.of(some_clips[0].skeleton), basis) for _ in range(2))
    for time, row in zip(times.tolist(), rows, strict=True):
        used.push([1000.0 + time], row[None])
    before = used.read().numbers
    used.clear()
    assert not used.ready
    for measurer in (used, fresh):
        for time, row in zip(times[:90].tolist(), rows, strict=False):
            measurer.push([time], row[None])
    after, new = used.read().numbers, fresh.read().numbers
    for measure in MEASURES:
        assert np.array_equal(after[measure], new[measure])
        assert not np.allclose(after[measure], before[measure], atol=1e-3)


def test_movement_is_the_deviation_over_the_longest_window(some_clips: tuple[Clip, ...], basis: Basis) -> None:
    """Movement is the root mean square deviation of the last second, relative to the body's root mean square."""
    times, rows = _fed(some_clips[:3], 120)
    measurer = WindowMeasurer(MEASURES, Body.of(some_clips[0].skeleton), basis)
    assert measurer.longest == 1.0
    for time, row in zip(times.tolist(), rows, strict=True):
        measurer.push([time], row[None])
    window = last_rows(times, rows, float(times[-1]), 1.0)
    exact = np.sqrt(np.var(window, axis=0, ddof=1).mean() / np.square(window.mean(axis=0)).mean())
    assert measurer.read().movement == pytest.approx(exact, rel=1e-9)
    assert exact > 0.01


def test_only_what_is_asked_is_measured(some_clips: tuple[Clip, ...], basis: Basis) -> None:
    """A measurer of one measure gives that one, of its own length."""
    times, rows = _fed(some_clips[:2], 120)
    measure = Measure(Kind.SPREAD, 0.5)
    measurer = WindowMeasurer([measure], Body.of(some_clips[0].skeleton), basis)
    for time, row in zip(times.tolist(), rows, strict=True):
        measurer.push([time], row[None])
    (numbers,) = measurer.read().numbers.values()
    body = Body.of(some_clips[0].skeleton)
    exact = measured(rows, 120.0, np.array([len(rows)]), measure, body=body, basis=basis)[0]
    assert numbers == pytest.approx(exact, abs=1e-6)
