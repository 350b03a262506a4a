"""The window: rows like a plain list's, and moments and covariances like the textbook's after every change."""

from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive_stream import NaiveWindow
from synthetic import plain_index

from kinespace.stream.recognizer import window as recognizer_window
from kinespace.stream.recognizer.window import Window

#: Everything holds of the compiled functions and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

#: Times are counted in these, so that the twin's are whole numbers.
TICKS = 960
#: Pairs of four joints.
JOINTS, WIDTH = 4, 6


def _rows(*marks: float) -> np.ndarray:
    return np.array([mark + np.arange(WIDTH) for mark in marks]).reshape(len(marks), WIDTH)


@pytest.mark.slow
@given(
    seed=st.integers(0, 2**32 - 1),
    ticks=st.integers(1, 2 * TICKS),
    largest_step=st.sampled_from([1, 8, 40, 3 * TICKS]),
    fastest=st.sampled_from([1.0, 20.0, 960.0]),
    largest_batch=st.sampled_from([1, 2, 5, 200]),
)
@settings(max_examples=30)
def test_the_window_equals_a_plain_list(
    seed: int, ticks: int, largest_step: int, fastest: float, largest_batch: int
) -> None:
    """In batches of any size, with gaps inside, cleared at any moment, it is a plain list's row by row."""
    generator = np.random.default_rng(seed)
    with mock.patch.object(recognizer_window, "MAX_FEED_RATE", fastest):
        window = Window(plain_index(ticks / TICKS, JOINTS))
    twin = NaiveWindow(ticks, max(2, int(np.ceil(ticks / TICKS * fastest))))
    time, mark = int(generator.integers(-1000, 1000)), 0
    while mark < 700:
        count = int(generator.integers(1, largest_batch + 1))
        steps = generator.integers(1, largest_step + 1, size=count)
        steps[generator.random(count) < 0.03] += 5 * TICKS
        times, marks = (time + steps.cumsum()).tolist(), range(mark, mark + count)
        window.push([each / TICKS for each in times], _rows(*marks))
        for each, index in zip(times, marks, strict=True):
            twin.push(each, index)
        time, mark = times[-1], mark + count
        seconds, rows = window.recent()
        assert rows.tolist() == _rows(*[kept for _, kept in twin.rows]).tolist()
        assert window.place() == pytest.approx(rows[-1] / rows[-1].mean())
        assert seconds.tolist() == [each / TICKS for each, _ in twin.rows]
        if generator.random() < 0.2:
            found = window.moments(ticks / TICKS)
            assert found.mean[0] == pytest.approx(rows.mean(axis=0))
            assert found.deviation[0] == pytest.approx(rows.std(axis=0), abs=1e-6)
        if generator.random() < 0.01:
            window.clear()
            twin.rows.clear()
            time -= int(generator.integers(0, 2000))
