"""Sums that follow a window: the textbook's after every change, begun afresh only where that is due."""

from __future__ import annotations

from typing import NamedTuple, Self

import naive_windows
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinespace.stream.recognizer.windows.sliding_window import SlidingWindow
from kinespace.stream.recognizer.windows.sums import MomentSums, ProductSums

#: Everything holds of the compiled kernels and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

WIDTH = 6
ROWS = 1.0 + 0.1 * np.random.default_rng(8).normal(size=(90, WIDTH))
#: Error of a mean, deviation, trend or covariance, relative to the largest.
SAME = 1e-9


class _Followed(NamedTuple):
    """A window, the sums of its rows, and how often each of them was computed afresh."""

    window: SlidingWindow
    moments: MomentSums
    products: ProductSums
    refreshes: np.ndarray

    @classmethod
    def of(cls, seconds: float, longest: float) -> Self:
        window = SlidingWindow(longest, WIDTH, point_width=WIDTH)
        return cls(window, MomentSums(window, seconds), ProductSums(window, seconds), np.zeros(2))

    def push(self, times: list[float], rows: np.ndarray) -> None:
        """Take in rows, which are points as well, and follow them."""
        self.window.push(times, rows, rows)
        for place, each in enumerate((self.moments, self.products)):
            self.refreshes[place] += each.follow(self.window.end, self.window.moved)
        self.window.pass_over()

    def assert_by_definition(self, times: np.ndarray, rows: np.ndarray) -> None:
        """Compare mean, variance, trend and covariance with the textbook's."""
        count, (reference, total, along, squares) = len(rows), self.moments.sums
        assert np.diff(self.moments.places).tolist() == np.diff(self.products.places).tolist() == [count]
        expected, middle = naive_windows.moments(times, rows), self.moments.clock[1] / count
        largest = max(float(expected.deviation.max()), 1e-12)
        variance = np.maximum(squares / count - (total / count) ** 2, 0.0)
        assert reference + total / count == pytest.approx(expected.mean, rel=SAME)
        assert np.abs(variance - expected.deviation**2).max() <= SAME * largest**2
        swing = np.sqrt(max(self.moments.clock[2] / count - middle**2, 0.0)) or np.inf
        assert np.abs((along - total * middle) / count / swing - expected.trend).max() <= 10 * SAME * largest
        mean = self.products.sums[1] / count
        covariance = self.products.products / count - np.outer(mean, mean)
        assert np.abs(covariance - np.cov(rows.T, bias=True)).max() <= SAME * largest**2
        assert np.array_equal(self.products.products, self.products.products.T)


@given(
    seed=st.integers(0, 2**32 - 1),
    seconds=st.sampled_from([0.1, 0.25, 1.0]),
    start=st.sampled_from([0.0, 1.7e9]),
    loud=st.booleans(),
)
@settings(max_examples=20)
def test_moments_and_covariance_equal_the_textbooks(seed: int, seconds: float, start: float, *, loud: bool) -> None:
    """After batches of any size at uneven times, over the last of a longer window's seconds, they equal the rows'."""
    generator = np.random.default_rng(seed)
    rows = 1.0 + generator.normal(scale=0.1 if loud else 1e-3, size=(120, WIDTH)) * generator.uniform(0, 1, WIDTH)
    times = start + np.cumsum(generator.choice([1 / 120, 1 / 30, 0.2], size=len(rows)))
    followed, end = _Followed.of(seconds, 1.0), 0
    while end < len(rows):
        begin, end = end, min(end + int(generator.integers(1, 9)), len(rows))
        followed.push(times[begin:end].tolist(), rows[begin:end])
        inside = followed.window.times > times[end - 1] - seconds + 1e-6
        followed.assert_by_definition(followed.window.times[inside], followed.window.rows[inside])


def test_only_rows_all_new_are_computed_afresh() -> None:
    """Sums are computed afresh at the start, after a clear and after a gap, and not otherwise."""
    followed, counted = _Followed.of(1.0, 1.0), []
    for begin, end in ((0, 10), (10, 12), (12, 30), (30, 31), (31, 31)):
        followed.push((np.arange(begin, end) / 120).tolist(), ROWS[begin:end])
        counted.append(followed.refreshes.tolist())
    for each in (followed.window, followed.moments, followed.products):
        each.clear()
    followed.push([5.0, 5.1], ROWS[:2])
    followed.push([9.0], ROWS[2:3])
    assert [*counted, followed.refreshes.tolist()] == [*[[1, 1]] * 5, [3, 3]]


@pytest.mark.parametrize("place", [0.0, 3.0])
def test_a_point_that_stays_has_no_scatter(place: float) -> None:
    """Of rows that are all the same, the origin too, and of one row, nothing is left, not even rounding."""
    followed = _Followed.of(0.2, 0.2)
    for index in range(80):
        followed.push([index / 120], ROWS[index : index + 1] if index < 40 else np.full((1, WIDTH), place))
        if index == 0:
            assert not followed.moments.sums[1:].any()
    count = followed.products.places[1] - followed.products.places[0]
    scatter = followed.products.products.trace() - np.square(followed.products.sums[1]).sum() / count
    assert scatter <= count * followed.products.drift[1]
