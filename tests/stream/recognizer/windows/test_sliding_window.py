"""The sliding window: always exactly the rows of the last seconds, for any feed."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive_stream import NaiveWindow

from kinespace.stream.recognizer.windows.sliding_window import MAX_FEED_RATE, MAX_PENDING, SlidingWindow

#: Times are counted in these, so that the twin's are whole numbers.
TICKS = 960


def _rows(*marks: float) -> np.ndarray:
    return np.array([[mark, -mark] for mark in marks]).reshape(len(marks), 2)


def _assert_alike(window: SlidingWindow, twin: NaiveWindow) -> None:
    """Hold contents, points and times against the plain list."""
    marks = [mark for _, mark in twin.rows]
    assert len(window) == len(marks)
    assert window.rows.tolist() == _rows(*marks).tolist()
    assert window.points[:, 0].tolist() == [2 * mark for mark in marks]
    assert window.times.tolist() == [time / TICKS for time, _ in twin.rows]


@given(
    seed=st.integers(0, 2**32 - 1),
    ticks=st.integers(1, 2 * TICKS),
    largest_step=st.sampled_from([1, 8, 40, 3 * TICKS]),
    fastest=st.sampled_from([1.0, 20.0, 960.0]),
    largest_batch=st.sampled_from([1, 2, 5, MAX_PENDING]),
)
@settings(max_examples=30)
def test_the_window_equals_a_plain_list(
    seed: int, ticks: int, largest_step: int, fastest: float, largest_batch: int
) -> None:
    """In batches of any size, with gaps inside, cleared at any moment, it is a plain list's row by row."""
    generator = np.random.default_rng(seed)
    window = SlidingWindow(ticks / TICKS, 2, fastest, point_width=1)
    twin = NaiveWindow(ticks, max(2, int(np.ceil(ticks / TICKS * fastest))))
    time, mark, pending, memory = int(generator.integers(-1000, 1000)), 0, 0, window.rows_kept
    while mark < 700:
        count = int(generator.integers(0, largest_batch + 1))
        steps = generator.integers(1, largest_step + 1, size=count)
        steps[generator.random(count) < 0.03] += 5 * TICKS
        times, marks = (time + steps.cumsum()).tolist(), range(mark, mark + count)
        if pending + count > MAX_PENDING or generator.random() < 0.1:
            window.pass_over()
            pending = 0
        moved, newest = window.moved, window.end
        window.push([each / TICKS for each in times], _rows(*marks), 2.0 * np.array(marks).reshape(count, 1))
        for each, index in zip(times, marks, strict=True):
            twin.push(each, index)
        time, mark, pending = [time, *times][-1], mark + count, pending + count
        assert window.pending == pending
        assert window.end + window.moved == newest + moved + count
        assert window.rows_kept is memory
        _assert_alike(window, twin)
        if generator.random() < 0.01:
            window.clear()
            twin.rows.clear()
            pending, time = 0, time - int(generator.integers(0, 2000))
            _assert_alike(window, twin)


def test_a_feed_too_fast_shortens_the_window() -> None:
    """Above the fastest feed foreseen it keeps the newest rows that there is room for, each beginning a cache line."""
    window = SlidingWindow(1.0, 2)
    for time in np.arange(1500) / (4 * MAX_FEED_RATE):
        window.push([time], _rows(time))
        window.pass_over()
    assert len(window) == window.most_in(1.0) == MAX_FEED_RATE
    assert window.times[-1] - window.times[0] == pytest.approx(0.25, rel=0.01)
    assert window.rows.strides[1] == window.rows.itemsize
    assert window.rows.ctypes.data % 64 == window.rows.strides[0] % 64 == 0


def test_changes_must_be_taken_in_time() -> None:
    """One pending row too many raises; the pending rows stay, and passing over them makes room again."""
    window = SlidingWindow(10.0, 2)
    window.push((np.arange(MAX_PENDING) / 100).tolist(), np.zeros((MAX_PENDING, 2)))
    for times in ([1.0], [1.0, 1.1]):
        with pytest.raises(RuntimeError, match=f"at least once in {MAX_PENDING} rows"):
            window.push(times, _rows(*times))
    assert len(window) == window.pending == MAX_PENDING
    window.pass_over()
    window.push([1.0], _rows(99))
    assert window.rows[-1, 0] == 99


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
