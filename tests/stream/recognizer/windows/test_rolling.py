"""Sums that follow a window: the textbook's after every change, begun afresh only where that is due."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive_windows
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinespace.stream.recognizer.windows.rolling import RollingCovariance, RollingMoments
from kinespace.stream.recognizer.windows.sliding_window import SlidingWindow

if TYPE_CHECKING:
    from kinespace.library.windows.parts import Moments
    from kinespace.stream.recognizer.windows.rolling import Rolling

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

BOTH = pytest.mark.parametrize("kind", [RollingMoments, RollingCovariance])
WIDTH = 6
ROWS = 1.0 + 0.1 * np.random.default_rng(8).normal(size=(90, WIDTH))
#: Error of a mean, deviation, trend or covariance, relative to the largest.
SAME = 1e-9


def _assert_moments(read: Moments, times: np.ndarray, rows: np.ndarray) -> None:
    expected = naive_windows.moments(times, rows)
    largest = max(float(expected.deviation.max()), 1e-12)
    assert read.mean[0] == pytest.approx(expected.mean, rel=SAME)
    assert np.abs(read.deviation[0] - expected.deviation).max() <= SAME * largest
    assert np.abs(read.trend[0] - expected.trend).max() <= SAME * largest


@given(
    seed=st.integers(0, 2**32 - 1),
    seconds=st.sampled_from([0.1, 0.25, 1.0]),
    start=st.sampled_from([0.0, 1.7e9]),
    loud=st.booleans(),
)
@settings(max_examples=30)
def test_moments_and_covariance_equal_the_textbooks(seed: int, seconds: float, start: float, *, loud: bool) -> None:
    """At every read, after batches of any size at uneven times, both equal those of the window's rows."""
    generator = np.random.default_rng(seed)
    rows = 1.0 + generator.normal(scale=0.1 if loud else 1e-3, size=(120, WIDTH)) * generator.uniform(0, 1, WIDTH)
    times = start + np.cumsum(generator.choice([1 / 120, 1 / 30, 0.2], size=len(rows)))
    window = SlidingWindow(seconds, WIDTH, beside=WIDTH)
    moments, covariance = RollingMoments(window), RollingCovariance(window)
    end = 0
    while end < len(rows):
        begin, end = end, min(end + int(generator.integers(1, 9)), len(rows))
        window.push(times[begin:end].tolist(), rows[begin:end], rows[begin:end])
        moments.update()
        covariance.update()
        window.pass_over()
        _assert_moments(moments.read(), window.times, window.rows)
        if len(window) > 1:
            expected = naive_windows.covariance(window.rows)
            assert np.abs(covariance.read() - expected).max() <= SAME * np.abs(expected).max()


@BOTH
def test_a_single_row_does_not_move(kind: type[RollingMoments | RollingCovariance]) -> None:
    """Of one row the deviation, the trend and the covariance are 0."""
    window = SlidingWindow(1.0, WIDTH, beside=WIDTH)
    rolling = kind(window)
    window.push([1.0], ROWS[:1], ROWS[:1])
    rolling.update()
    read = rolling.read()
    numbers = read if isinstance(read, np.ndarray) else np.array([read.deviation, read.trend])
    assert np.array_equal(numbers, np.zeros_like(numbers))


@BOTH
def test_only_rows_all_new_are_computed_afresh(kind: type[Rolling]) -> None:
    """Sums are computed afresh at the start, after a clear and after a gap, and not otherwise."""
    window = SlidingWindow(1.0, WIDTH, beside=WIDTH)
    rolling, counted = kind(window), []
    for begin, end in ((0, 10), (10, 12), (12, 30), (30, 31)):
        window.push((np.arange(begin, end) / 120).tolist(), ROWS[begin:end], ROWS[begin:end])
        rolling.update()
        counted.append(rolling.refreshes)
    rolling.update()
    counted.append(rolling.refreshes)
    window.clear()
    rolling.clear()
    window.push([5.0, 5.1], ROWS[:2], ROWS[:2])
    rolling.update()
    window.push([9.0], ROWS[2:3], ROWS[2:3])
    rolling.update()
    assert [*counted, rolling.refreshes] == [1, 1, 1, 1, 1, 3]


@pytest.mark.parametrize("place", [0.0, 3.0])
def test_a_point_that_stays_has_no_covariance(place: float) -> None:
    """Rows that are all the same, the origin too, have the covariance 0, to the last digit."""
    window = SlidingWindow(0.2, WIDTH, beside=WIDTH)
    rolling = RollingCovariance(window)
    for index in range(80):
        row = ROWS[index : index + 1] if index < 40 else np.full((1, WIDTH), place)
        window.push([index / 120], row, row)
        rolling.update()
        window.pass_over()
    assert not rolling.read().any()
