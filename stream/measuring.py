"""The measures of a live window: several lengths at once, each kept up to date by what enters and leaves it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from library.measures import FEWEST_FRAMES, Kind, Measure, shape_of
from stream.covariance import RollingCovariance
from stream.variance import RollingVariance
from stream.window import MOST_PENDING, SlidingWindow

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from library.measures import Basis, Body

_Rolling = TypeVar("_Rolling", RollingVariance, RollingCovariance)


class _Length(Generic[_Rolling]):
    """The rows of one length of time, and the statistic that is kept of them."""

    def __init__(self, seconds: float, width: int, rolling: _Rolling) -> None:
        self._window = SlidingWindow(seconds, width)
        self.rolling: _Rolling = rolling

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        if self._window.pending + len(times) > MOST_PENDING:
            self.settle()
        self._window.push(times, rows)

    def settle(self) -> None:
        if self._window.pending:
            self.rolling.update(*self._window.take_change(), self._window.rows)

    def clear(self) -> None:
        self._window.clear()
        self.rolling.clear()


class WindowMeasurer:
    """Measures the last seconds of one performer.

    A window reaches back as far as the feed has been followed, at most its measure's seconds.

    Parameters
    ----------
    measures
        What to measure.
    body, basis
        As learned.
    """

    def __init__(self, measures: Iterable[Measure], body: Body, basis: Basis) -> None:
        self._measures = tuple(measures)
        self._body = body
        self._directions = basis.directions
        pairs, directions = basis.directions.shape
        shapes = {measure.seconds for measure in self._measures if measure.kind is Kind.SHAPE}
        others = {measure.seconds for measure in self._measures if measure.kind is not Kind.SHAPE}
        self._distances = {seconds: _Length(seconds, pairs, RollingVariance(pairs)) for seconds in others}
        self._shapes = {seconds: _Length(seconds, directions, RollingCovariance(directions)) for seconds in shapes}
        self._frames = 0

    def clear(self) -> None:
        """Forget all rows."""
        for distances in self._distances.values():
            distances.clear()
        for shape in self._shapes.values():
            shape.clear()
        self._frames = 0

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows, shape (frames, pairs), metres; `MOST_PENDING` at most."""
        self._frames += len(times)
        for distances in self._distances.values():
            distances.push(times, rows)
        if self._shapes:
            seen = rows @ self._directions
            for shape in self._shapes.values():
                shape.push(times, seen)

    @property
    def ready(self) -> bool:
        """Whether there are frames enough to measure."""
        return self._frames >= FEWEST_FRAMES

    @property
    def longest(self) -> float:
        """Length of the longest window over which distances are measured, seconds."""
        return max(self._distances)

    @property
    def movement(self) -> float:
        """Root mean square deviation of a distance over the longest window, relative to the body's size."""
        longest = self._distances[self.longest]
        longest.settle()
        deviation, mean = longest.rolling.deviation(), longest.rolling.mean()
        return math.sqrt(float(deviation @ deviation) / float(mean @ mean))

    def measures(self) -> dict[Measure, NDArray[np.float64]]:
        """Measure the windows that end with the newest row."""
        shapes = self._measured_shapes()
        return {
            measure: shapes[measure.seconds] if measure.kind is Kind.SHAPE else self._measured(measure)
            for measure in self._measures
        }

    def _measured_shapes(self) -> dict[float, NDArray[np.float64]]:
        """Measure the shapes of all lengths in one go: to ask for an eigendecomposition costs as much as to make it."""
        if not self._shapes:
            return {}
        for shape in self._shapes.values():
            shape.settle()
        covariances = np.stack([shape.rolling.moments().covariance for shape in self._shapes.values()])
        return dict(zip(self._shapes, shape_of(covariances), strict=True))

    def _measured(self, measure: Measure) -> NDArray[np.float64]:
        distances = self._distances[measure.seconds]
        distances.settle()
        mean = distances.rolling.mean()
        if measure.kind is Kind.POSTURE:
            return self._body.posture(mean)
        return self._body.spread(mean, distances.rolling.deviation())
