"""The measures of a live window: several lengths at once, each kept up to date by what enters and leaves it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Self

from library.measures import FEWEST_FRAMES, Kind, Measure, shapes_in
from stream.variance import RollingVariance, means_and_deviations, movements
from stream.window import MOST_PENDING, SlidingWindow

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from library.measures import Basis, Body


class _Length:
    """The rows of one length of time, and the mean and variance that are kept of them."""

    def __init__(self, seconds: float, width: int) -> None:
        self._window = SlidingWindow(seconds, width)
        self._rolling = RollingVariance(width)

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        if self._window.pending + len(times) > MOST_PENDING:
            self._settle()
        self._window.push(times, rows)

    def settled(self) -> RollingVariance:
        """Give the statistic of the rows up to the newest."""
        self._settle()
        return self._rolling

    def _settle(self) -> None:
        if self._window.pending:
            self._rolling.update(*self._window.take_change(), self._window.rows)

    def clear(self) -> None:
        self._window.clear()
        self._rolling.clear()


class Measured(NamedTuple):
    """What is measured of the windows that end with one row.

    Attributes
    ----------
    numbers
        By measure.
    movement
        Root mean square deviation of a distance over the longest window, relative to the body's size.
    """

    numbers: dict[Measure, NDArray[np.float64]]
    movement: float


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
        self._shapes, self._spreads, self._postures = (
            [measure for measure in self._measures if measure.kind is kind]
            for kind in (Kind.SHAPE, Kind.SPREAD, Kind.POSTURE)
        )
        self._body = body
        self._directions = basis.directions
        pairs, directions = basis.directions.shape
        #: Length of the longest window whose spread is measured, seconds.
        self.longest = max(measure.seconds for measure in self._spreads)
        lengths = {measure.seconds for measure in (*self._spreads, *self._postures)}
        self._distances = {seconds: _Length(seconds, pairs) for seconds in lengths}
        # Of so few numbers to take the covariance afresh costs less than to keep it, up to a thousand frames.
        longest = max((shape.seconds for shape in self._shapes), default=self.longest)
        self._courses = SlidingWindow(longest, directions)
        self._frames = 0

    def clear(self) -> None:
        """Forget all rows."""
        for distances in self._distances.values():
            distances.clear()
        self._courses.clear()
        self._frames = 0

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows, shape (frames, pairs), metres; `MOST_PENDING` at most."""
        self._frames += len(times)
        for distances in self._distances.values():
            distances.push(times, rows)
        if self._shapes:
            self._courses.push(times, rows @ self._directions)
            self._courses.pass_over_change()

    @property
    def ready(self) -> bool:
        """Whether there are frames enough to measure."""
        return self._frames >= FEWEST_FRAMES

    def read(self) -> Measured:
        """Measure the windows that end with the newest row."""
        numbers: dict[Measure, NDArray[np.float64]] = {}
        if self._shapes:
            numbers |= zip(self._shapes, shapes_in(self.courses()), strict=True)
        for measure in self._postures:
            numbers[measure] = self._body.posture(self.settled(measure.seconds).mean())
        moved: dict[float, float] = {}
        for measure in self._spreads:
            numbers[measure], moved[measure.seconds] = self.settled(measure.seconds).spread(self._body)
        return Measured(numbers, moved[self.longest])

    def read_with(self, others: Sequence[Self]) -> tuple[dict[Measure, NDArray[np.float64]], list[float]]:
        """Measure the windows of several performers, which takes little longer than those of one.

        Parameters
        ----------
        others
            Of the same measures, body and basis.

        Returns
        -------
        By measure the numbers, (performers, numbers), and each performer's movement: first one's own, then the others'.
        """
        everybody = (self, *others)
        numbers: dict[Measure, NDArray[np.float64]] = {}
        if self._shapes:
            shapes = shapes_in([course for each in everybody for course in each.courses()])
            by_performer = shapes.reshape(len(everybody), len(self._shapes), -1)
            numbers |= zip(self._shapes, by_performer.swapaxes(0, 1), strict=True)
        moved: list[float] = []
        for seconds in self._distances:
            mean, deviation = means_and_deviations([each.settled(seconds) for each in everybody])
            if seconds == self.longest:
                moved = movements(mean, deviation).tolist()
            numbers |= self._of_distances(seconds, mean, deviation)
        return numbers, moved

    def _of_distances(
        self, seconds: float, mean: NDArray[np.float64], deviation: NDArray[np.float64]
    ) -> dict[Measure, NDArray[np.float64]]:
        """Measure what is asked of one length, of one performer or of several: both (..., pairs), metres."""
        return {
            measure: self._body.spread(mean, deviation) if measure.kind is Kind.SPREAD else self._body.posture(mean)
            for measure in self._measures
            if measure.seconds == seconds and measure.kind is not Kind.SHAPE
        }

    def settled(self, seconds: float) -> RollingVariance:
        """Give mean and variance of the distances over one of the lengths, up to the newest row."""
        return self._distances[seconds].settled()

    def courses(self) -> list[NDArray[np.float64]]:
        """Give the courses in the basis over each length whose shape is measured, (frames, n): views."""
        return [self._courses.last(shape.seconds) for shape in self._shapes]
