"""The sliding window: always exactly the rows of the last seconds, for any feed."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive_stream import NaiveWindow

from kinespace.stream.recognizer.windows.sliding_window import MAX_FEED_RATE, MAX_PENDING, SlidingWindow, Span

if TYPE_CHECKING:
    from collections.abc import Iterable

#: Times are counted in these, so that the twin's are whole numbers.
TICKS = 960


def _rows(*marks: float) -> np.ndarray:
    return np.array([[mark, -mark] for mark in marks])


def _assert_alike(window: SlidingWindow, twin: NaiveWindow) -> None:
    """Hold contents and times against the plain list."""
    assert len(window) == len(twin.rows)
    assert window.rows[:, 0].tolist() == [mark for _, mark in twin.rows]
    assert window.rows[:, 1].tolist() == [-mark for _, mark in twin.rows]
    assert window.times.tolist() == [time / TICKS for time, _ in twin.rows]


def _taken(window: SlidingWindow, span: Span) -> list[np.ndarray]:
    """Give the rows that entered and left, with their times, (rows, 3), and let the window go on."""
    kept = np.column_stack([window.rows_kept, window.times_kept])
    changes = [kept[each] for each in span.take_change()]
    assert len(span) == len(window)
    assert kept[span.rows, 2].tolist() == window.times.tolist()
    window.pass_over()
    return changes


def _assert_change_alike(window: SlidingWindow, span: Span, twin: NaiveWindow) -> None:
    """Compare the rows that entered and left with the plain list, oldest first."""
    changes = _taken(window, span)
    marks, times = (tuple(each[:, column].tolist() for each in changes) for column in (0, 2))
    expected = twin.take_change()
    assert marks == tuple([mark for _, mark in each] for each in expected)
    assert times == tuple([time / TICKS for time, _ in each] for each in expected)


def _push(window: SlidingWindow, times: Iterable[float]) -> None:
    for time in times:
        window.push([time], _rows(time))
        window.pass_over()


@pytest.mark.slow
@given(
    seed=st.integers(0, 2**32 - 1),
    ticks=st.integers(1, 2 * TICKS),
    largest_step=st.sampled_from([1, 8, 40, 3 * TICKS]),
    fastest=st.sampled_from([1.0, 20.0, 960.0]),
    taken_every=st.integers(1, MAX_PENDING),
)
@settings(max_examples=30)
def test_the_window_equals_a_plain_list(
    seed: int, ticks: int, largest_step: int, fastest: float, taken_every: int
) -> None:
    """At random times, over many moves of the memory, rows, times and changes equal a plain list's after every push."""
    generator = np.random.default_rng(seed)
    window = SlidingWindow(ticks / TICKS, 2, fastest)
    span = Span(window)
    twin = NaiveWindow(ticks, max(2, int(np.ceil(ticks / TICKS * fastest))))
    time = int(generator.integers(-1000, 1000))
    for index in range(700):
        time += int(generator.integers(1, largest_step + 1))
        window.push([time / TICKS], _rows(index))
        twin.push(time, index)
        _assert_alike(window, twin)
        assert window.pending == index % taken_every + 1
        if index % taken_every == taken_every - 1:
            _assert_change_alike(window, span, twin)
            assert window.pending == 0


@pytest.mark.slow
@given(
    seed=st.integers(0, 2**32 - 1),
    ticks=st.integers(1, 2 * TICKS),
    largest_step=st.sampled_from([1, 8, 40, 3 * TICKS]),
    fastest=st.sampled_from([1.0, 20.0, 960.0]),
    largest_batch=st.sampled_from([2, 5, MAX_PENDING]),
)
@settings(max_examples=30)
def test_rows_that_come_together_are_as_if_one_by_one(
    seed: int, ticks: int, largest_step: int, fastest: float, largest_batch: int
) -> None:
    """In batches of any size, longer than the window or with gaps inside, the window is a plain list's row by row."""
    generator = np.random.default_rng(seed)
    window = SlidingWindow(ticks / TICKS, 2, fastest)
    span = Span(window)
    twin = NaiveWindow(ticks, max(2, int(np.ceil(ticks / TICKS * fastest))))
    time = mark = 0
    while mark < 1200:
        count = int(generator.integers(0, largest_batch + 1))
        steps = generator.integers(1, largest_step + 1, size=count)
        # Now and then a gap far longer than the window, wherever it falls in the batch.
        steps[generator.random(count) < 0.03] += 5 * TICKS
        times, marks = (time + steps.cumsum()).tolist(), range(mark, mark + count)
        if window.pending + count > MAX_PENDING:
            _assert_change_alike(window, span, twin)
        window.push([each / TICKS for each in times], _rows(*marks).reshape(count, 2))
        for each, index in zip(times, marks, strict=True):
            twin.push(each, index)
        time, mark = [time, *times][-1], mark + count
        if mark:
            _assert_alike(window, twin)
    _assert_change_alike(window, span, twin)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_clearing_at_any_moment_is_a_new_beginning(seed: int) -> None:
    """Cleared at random, before or after changes were taken, the window goes on as one that was never used."""
    generator = np.random.default_rng(seed)
    window, twin = SlidingWindow(0.1, 2), NaiveWindow(TICKS // 10, 1000)
    span = Span(window)
    time = 0
    for index in range(400):
        time += int(generator.integers(1, 20))
        window.push([time / TICKS], _rows(index))
        twin.push(time, index)
        if generator.random() < 0.1:
            _assert_change_alike(window, span, twin)
        if generator.random() < 0.03 or window.pending == MAX_PENDING:
            window.clear()
            span.clear()
            twin.clear()
            assert (len(window), len(span), window.pending) == (0, 0, 0)
            time -= int(generator.integers(0, 2000))
        else:
            _assert_alike(window, twin)


@pytest.mark.parametrize("rate", [30, 60, 120, 240])
@pytest.mark.parametrize("seconds", [0.5, 1.0, 1.1])
@pytest.mark.parametrize("start", [0.0, 0.1, 1.7e9])
def test_every_rate_fills_the_same_seconds(rate: int, seconds: float, start: float) -> None:
    """At any rate the window holds its seconds' frames, whatever frame it began with."""
    window = SlidingWindow(seconds, 2)
    frames = round(seconds * rate)
    for index in range(3 * frames):
        window.push([start + index / rate], _rows(index))
        window.pass_over()
        assert window.rows[:, 0].tolist() == list(range(max(0, index - frames + 1), index + 1))


def test_dropped_frames_leave_the_seconds_alone() -> None:
    """With half of the frames lost the window still holds the same seconds."""
    kept = np.flatnonzero(np.random.default_rng(1).random(600) < 0.5)
    window = SlidingWindow(1.0, 2)
    for index in kept.tolist():
        window.push([index / 120], _rows(index))
        window.pass_over()
        expected = kept[(kept <= index) & (kept > index - 120)]
        assert window.rows[:, 0].tolist() == expected.tolist()


def test_a_gap_longer_than_the_window_leaves_the_newest_row() -> None:
    """After a gap only the newest row is in the window; rows that entered and left are in no change."""
    window = SlidingWindow(1.0, 2)
    span = Span(window)
    _push(window, [0.0, 0.1, 0.2])
    span.take_change()
    window.push([0.3], _rows(0.3))
    window.push([9.0], _rows(9.0))
    assert window.times.tolist() == [9.0]
    entered, left = _taken(window, span)
    assert entered[:, 2].tolist() == [9.0]
    assert left[:, 2].tolist() == [0.0, 0.1, 0.2]


def test_a_feed_too_fast_shortens_the_window() -> None:
    """Above the fastest feed foreseen the window keeps the newest rows that it has room for."""
    window = SlidingWindow(1.0, 2)
    _push(window, np.arange(3000) / (4 * MAX_FEED_RATE))
    assert len(window) == MAX_FEED_RATE
    assert window.times[-1] - window.times[0] == pytest.approx(0.25, rel=0.01)


def test_the_memory_is_allocated_once() -> None:
    """For a feed of any length, the rows are slices of one array in time order."""
    window = SlidingWindow(0.5, 2, fastest=240.0)
    _push(window, [0.0])
    memory = window.rows.base
    for index in range(1, 5000):
        _push(window, [index / 240])
        assert window.rows.base is memory
    assert window.rows.strides[1] == window.rows.itemsize
    assert window.rows.ctypes.data % 64 == window.rows.strides[0] % 64 == 0
    assert np.all(np.diff(window.times) > 0)


def test_changes_must_be_taken_in_time() -> None:
    """One pending row too many raises; the pending rows stay, and taking them makes room again."""
    window = SlidingWindow(10.0, 2)
    for index in range(MAX_PENDING):
        window.push([float(index) / 100], _rows(index))
    with pytest.raises(RuntimeError, match=f"at least once in {MAX_PENDING} rows"):
        window.push([1.0], _rows(99))
    with pytest.raises(RuntimeError, match=f"at least once in {MAX_PENDING} rows"):
        window.push([1.0, 1.1], _rows(99, 100))
    assert len(window) == window.pending == MAX_PENDING
    span = Span(window)
    assert _taken(window, span)[0][:, 0].tolist() == list(range(MAX_PENDING))
    window.push([1.0], _rows(99))
    assert _taken(window, span)[0][:, 0].tolist() == [99]


@pytest.mark.parametrize("time", [1.0, 0.999, -5.0])
def test_time_runs_forward(time: float) -> None:
    """A row that is not later than the newest is the caller's mistake and does not change the window."""
    window = SlidingWindow(1.0, 2)
    _push(window, [0.5, 1.0])
    with pytest.raises(ValueError, match=r"time: expected later than 1\.0"):
        window.push([time], _rows(7))
    assert window.times.tolist() == [0.5, 1.0]
    assert window.pending == 0


@pytest.mark.parametrize("times", [[1.1, 1.2, 1.2], [1.1, 1.3, 1.2], [1.0, 1.1], [0.9, 1.1]])
def test_a_batch_is_taken_in_whole_or_not_at_all(times: list[float]) -> None:
    """A time that stands still or runs back anywhere in a batch leaves the window unchanged."""
    window = SlidingWindow(1.0, 2)
    _push(window, [0.5, 1.0])
    with pytest.raises(ValueError, match="time: expected later than"):
        window.push(times, _rows(*times))
    assert window.times.tolist() == window.rows[:, 0].tolist() == [0.5, 1.0]
    assert window.pending == 0
    window.push([1.05], _rows(1.05))
    assert window.times.tolist() == [0.5, 1.0, 1.05]


@pytest.mark.parametrize("count", [0, 1, 3])
def test_every_row_has_its_time(count: int) -> None:
    """Different numbers of rows and times are refused, and the window stays unchanged."""
    window = SlidingWindow(1.0, 2)
    _push(window, [0.5])
    with pytest.raises(ValueError, match=f"rows: expected 2, as many as times, got {count}"):
        window.push([1.0, 1.1], np.zeros((count, 2)))
    assert window.times.tolist() == [0.5]


@pytest.mark.parametrize("start", [1.7e18, -1.7e18, 1e300])
def test_the_newest_row_always_stays(start: float) -> None:
    """With times so large that a window is lost in their rounding (a sender's nanoseconds) the newest row is held."""
    window = SlidingWindow(1.0, 2)
    for index in range(300):
        time = start + index * abs(start) * 1e-6
        window.push([time], _rows(index))
        window.pass_over()
        assert window.times.tolist() == [time]
        assert window.rows[:, 0].tolist() == [index]


def test_nothing_is_in_an_empty_window() -> None:
    """Before the first row the window is empty and has no changes."""
    window = SlidingWindow(1.0, 3)
    assert (len(window), window.pending) == (0, 0)
    assert window.rows.shape == (0, 3)
    assert window.times.shape == (0,)
    assert Span(window).take_change() == (slice(0, 0), slice(0, 0))


@pytest.mark.parametrize(
    ("seconds", "width", "fastest", "named"),
    [
        (0.0, 1, 500.0, "seconds"),
        (-1.0, 1, 500.0, "seconds"),
        (np.inf, 1, 500.0, "seconds"),
        (np.nan, 1, 500.0, "seconds"),
        (1.0, 0, 500.0, "width"),
        (1.0, 1, 0.0, "fastest"),
    ],
)
def test_windows_that_make_no_sense_are_refused(seconds: float, width: int, fastest: float, named: str) -> None:
    """Seconds, width and fastest are positive, seconds finite."""
    with pytest.raises(ValueError, match=named):
        SlidingWindow(seconds, width, fastest)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes do not fork here")
def test_a_child_process_has_windows_of_its_own() -> None:
    """Rows that a forked child pushes do not appear in its parent's window."""
    code = (
        "import os, numpy as np\n"
        "from kinespace.stream.recognizer.windows.sliding_window import SlidingWindow\n"
        "window = SlidingWindow(1.0, 2)\n"
        "window.push([0.0], np.zeros((1, 2)))\n"
        "if child := os.fork():\n"
        "    print(os.waitpid(child, 0)[1], window.rows.tolist())\n"
        "else:\n"
        "    window.rows[:] = 7.0\n"
        "    os._exit(0)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "0 [[0.0, 0.0]]\n"
