"""Moments of a sliding window, updated by the rows that enter and leave.

Sums of values of a metre that move by a millimetre lose digits. The loss shows when a performer stands still right
after moving: the rows that left had large values, and their rounding stays in the sums. Two habits keep the sums exact.
Values are taken relative to a reference row near the window's mean, so that they are as small as the movement. And a
bound of the rounding grows with every row; when the bound is no longer small against the variance that is left, the
sums are computed afresh from the window's rows. That happens every ten seconds or so while a performer moves, and right
after a stop.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kinespace.library.kernels import compiled
from kinespace.library.windows.parts import Moments
from kinespace.stream.recognizer.windows.sliding_window import Change

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.recognizer.windows.sliding_window import Window

Rows = NDArray[np.float64]

#: Rounding, relative to the total variance, from which on sums are computed afresh: well inside the promised 1e-9.
DRIFT_TOLERANCE = 1e-11
#: Rounding of a number, relative to it.
EPSILON = float(np.finfo(np.float64).eps)
#: Movement, relative to the distance, below which lost digits do not matter.
_NO_MOVEMENT = 1e-6


class Rolling(ABC):
    """Sums that follow a sliding window's rows.

    Parameters
    ----------
    window
        The window whose changes are followed; no other object may take its changes.

    Attributes
    ----------
    count
        Rows in the window.
    refreshes
        How often the sums were computed afresh from the window's rows.
    """

    def __init__(self, window: Window) -> None:
        self._window = window
        self.count = 0
        self._rounding = 0.0
        self.refreshes = 0

    def clear(self) -> None:
        """Forget all rows."""
        self.count = 0

    def update(self) -> None:
        """Follow the window up to its newest row."""
        if not self._window.pending:
            return
        change = self._window.take_change()
        gone, count, before = len(change.left), len(self._window), self.count
        new = len(change.entered)
        self.count = count
        if before + new - gone != count or count <= new:
            self._refresh()
            return
        self._follow(change)
        self._rounding += EPSILON * (new + gone) * self._largest()
        if self._rounding > DRIFT_TOLERANCE * self._scatter():
            self._refresh()

    def _refresh(self) -> None:
        self.refreshes += 1
        rows, times = self._window.rows, self._window.times
        self._begin(rows, times)
        self._follow(Change(rows, rows[:0], times, times[:0]))
        self._rounding = EPSILON * self.count * self._largest()

    @abstractmethod
    def _begin(self, rows: Rows, times: Rows) -> None:
        """Forget all sums, and choose the reference row."""

    @abstractmethod
    def _follow(self, change: Change) -> None:
        """Add the rows that entered, and subtract the rows that left."""

    @abstractmethod
    def _largest(self) -> float:
        """Give the largest sum of squares, which bounds the rounding of all sums."""

    @abstractmethod
    def _scatter(self) -> float:
        """Give the variance that is left in that sum, or the variance below which lost digits do not matter."""


class RollingMoments(Rolling):
    """Mean, variance and trend of each distance.

    Parameters
    ----------
    window
        The window of distance rows.
    width
        Distances in a row.

    Attributes
    ----------
    sums
        The reference row; and of the rows relative to it the sum, the sum of products with time, and the sum of
        squares, shape (4, width).
    clock
        The reference time; and of the times relative to it the sum, and the sum of squares, shape (3,).
    """

    def __init__(self, window: Window, width: int) -> None:
        super().__init__(window)
        self.sums, self.clock = np.zeros((4, width)), np.zeros(3)
        self._no_movement = 0.0
        # The largest sum of squares, and its sum: a distance that stood still while others moved must not be lost.
        self._squares = self._sum = 0.0

    def _begin(self, rows: Rows, times: Rows) -> None:
        self.sums[1:] = self.clock[:] = 0.0
        np.mean(rows, axis=0, out=self.sums[0])
        self.clock[0] = times[-1]
        self._no_movement = (_NO_MOVEMENT * float(self.sums[0].mean())) ** 2

    def _follow(self, change: Change) -> None:
        if compiled.loops:
            self._squares, self._sum = compiled.loops.follow(self.sums, self.clock, *change)
            return
        rows, weights = _weighed(change)
        rows -= self.sums[0]
        times = np.concatenate([change.entered_times, change.left_times]) - self.clock[0]
        factors = np.array([weights, weights * times])
        sums = self.sums
        sums[1:3] += factors @ rows
        rows *= rows
        sums[3] += weights @ rows
        self.clock[1:] += factors @ times if len(times) else 0.0
        largest = int(sums[3].argmax())
        self._squares, self._sum = sums.item(3, largest), sums.item(1, largest)

    def _largest(self) -> float:
        return self._squares

    def _scatter(self) -> float:
        return max(self._squares - self._sum * self._sum / self.count, self.count * self._no_movement)

    def read(self) -> Moments:
        """Give the moments of the window's rows, each of shape (1, width); needs a row."""
        return moments_of((self,))


def moments_of(windows: Sequence[RollingMoments]) -> Moments:
    """Give the moments of several windows, each of shape (windows, width); all need a row."""
    counts = np.array([[each.count] for each in windows])
    sums = np.array([each.sums for each in windows])
    clocks = np.array([each.clock for each in windows])[:, 1:] / counts
    middle = clocks[:, :1]
    swing = clocks[:, 1:] - middle * middle
    sums[:, 1:] /= counts[:, :, None]
    reference, mean, trend, variance = sums.transpose(1, 0, 2)
    trend -= mean * middle
    trend /= np.sqrt(np.where(swing > 0, swing, np.inf))
    variance -= mean * mean
    np.maximum(variance, 0.0, out=variance)
    mean += reference
    return Moments(mean, np.sqrt(variance, out=variance), trend)


class RollingCovariance(Rolling):
    """The covariance of a window's points in the basis.

    Parameters
    ----------
    window
        The window of points in the basis.
    width
        Directions of the basis.

    Attributes
    ----------
    total, products
        The sum of the points relative to a reference, shape (width,), and the sum of their products, shape (width,
        width).
    no_scatter
        Trace of a covariance below which nothing moves.
    """

    def __init__(self, window: Window, width: int) -> None:
        super().__init__(window)
        self._reference, self.total = np.zeros((2, width))
        self.products = np.zeros((width, width))
        self.no_scatter = 0.0
        # The trace of the products, and the squared length of the sum.
        self._trace = self._square = 0.0

    def _begin(self, rows: Rows, times: Rows) -> None:  # noqa: ARG002 - a covariance needs no times
        np.mean(rows, axis=0, out=self._reference)
        self.no_scatter = _NO_MOVEMENT**2 * float(self._reference @ self._reference)
        self.total[:] = 0.0
        self.products[:] = 0.0

    def _follow(self, change: Change) -> None:
        if compiled.loops and len(self.total) <= compiled.loops.MAX_DIRECTIONS:
            self._trace, self._square = compiled.loops.follow_products(
                self._reference, self.total, self.products, change.entered, change.left
            )
            return
        rows, weights = _weighed(change)
        rows -= self._reference
        self.total += weights @ rows
        self.products += (rows.T * weights) @ rows
        self._trace, self._square = float(self.products.trace()), float(self.total @ self.total)

    def _largest(self) -> float:
        return self._trace

    def _scatter(self) -> float:
        return max(self._trace - self._square / self.count, self.count * self.no_scatter)

    def read(self) -> Rows:
        """Give the covariance, shape (width, width); needs a row. For a body that does not move it is 0."""
        mean = self.total / self.count
        covariance: Rows = self.products / self.count
        covariance -= mean[:, None] * mean
        if covariance.trace() <= self.no_scatter:
            covariance[:] = 0.0
        return covariance


def _weighed(change: Change) -> tuple[Rows, Rows]:
    """Copy the rows that entered and left to one array, and give their signs, 1 and -1."""
    rows = np.concatenate([change.entered, change.left])
    return rows, _signs(len(change.entered), len(change.left))


@lru_cache(256)
def _signs(entered: int, left: int) -> Rows:
    weights = np.repeat((1.0, -1.0), (entered, left))
    weights.flags.writeable = False
    return weights
