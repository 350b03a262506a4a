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
from kinespace.stream.recognizer.windows.sliding_window import Change, SlidingWindow, Span

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Rows = NDArray[np.float64]

#: Rounding, relative to the total variance, from which on sums are computed afresh: well inside the promised 1e-9.
DRIFT_TOLERANCE = 1e-11
#: Rounding of a number, relative to it.
EPSILON = float(np.finfo(np.float64).eps)
#: Movement, relative to the distance, below which lost digits do not matter.
_NO_MOVEMENT = 1e-6
#: No rows.
_NONE = slice(0, 0)


class Rolling(ABC):
    """Sums that follow the rows, or points, in the last seconds of a window.

    Parameters
    ----------
    window
        The window that is followed. After all its sums are updated, its `pass_over` must be called.
    seconds
        The seconds that are followed; the window's when not given.

    Attributes
    ----------
    span
        The rows that are followed.
    drift
        The bound of the sums' rounding, and the variance below which lost digits do not matter, shape (2,).
    refreshes
        How often the sums were computed afresh from the window's rows.
    """

    #: The rows or points that are followed, as the window keeps them.
    _rows: Rows
    #: The compiled loop that follows them, up to a window's end and moved rows; None without.
    _follow: Callable[[int, int], bool] | None

    def __init__(self, window: SlidingWindow, seconds: float | None = None) -> None:
        self._window = window
        self.span = Span(window, seconds)
        self.drift = np.zeros(2)
        self.refreshes = 0

    def _compiled(self, name: str, *sums: Rows) -> Callable[[int, int], bool] | None:
        """Bind the arrays of a compiled loop: handing them out costs as much as adding up. None without loops."""
        if compiled.loops is None:
            return None
        kept = self._rows, self._window.times_kept, self.span.places, self.drift
        return compiled.loops.Bound(name, *kept, *sums, self.span.seconds, self.span.most, 0, 0).run

    @property
    def count(self) -> int:
        """Rows in the span."""
        return len(self.span)

    def clear(self) -> None:
        """Forget all rows."""
        self.span.clear()

    def update(self) -> None:
        """Follow the window up to its newest row."""
        if self._follow:
            self.refreshes += self._follow(self._window.end, self._window.moved)
            return
        change = self.span.take_change()
        new, gone = (each.stop - each.start for each in change)
        if not new:
            return
        if new == self.count:
            self._refresh()
            return
        self._add(change)
        largest, scatter = self._bounds()
        self.drift[0] += EPSILON * (new + gone) * largest
        if self.drift[0] > DRIFT_TOLERANCE * scatter:
            self._refresh()

    def _refresh(self) -> None:
        self.refreshes += 1
        rows = self.span.rows
        self._begin(self._rows[rows], self._window.times_kept[rows])
        self._add(Change(rows, _NONE))
        self.drift[0] = EPSILON * self.count * self._bounds()[0]

    @abstractmethod
    def _begin(self, rows: Rows, times: Rows) -> None:
        """Forget all sums, and choose the reference row."""

    @abstractmethod
    def _add(self, change: Change) -> None:
        """Add the rows that entered, and subtract the rows that left."""

    @abstractmethod
    def _bounds(self) -> tuple[float, float]:
        """Give the largest sum of squares, which bounds the rounding of all sums, and the scatter that is left in it.

        The scatter is not below the one under which lost digits do not matter.
        """

    def _weighed(self, change: Change) -> tuple[Rows, Rows]:
        """Copy the rows that entered and left to one array, and give their signs, 1 and -1."""
        entered, left = self._rows[change.entered], self._rows[change.left]
        return np.concatenate([entered, left]), _signs(len(entered), len(left))


class RollingMoments(Rolling):
    """Mean, variance and trend of each distance.

    Parameters
    ----------
    window
        The window of distance rows.
    seconds
        As of `Rolling`.

    Attributes
    ----------
    sums
        The reference row; and of the rows relative to it the sum, the sum of products with time, and the sum of
        squares, shape (4, width).
    clock
        The reference time; and of the times relative to it the sum, and the sum of squares, shape (3,).
    """

    def __init__(self, window: SlidingWindow, seconds: float | None = None) -> None:
        super().__init__(window, seconds)
        self._rows = window.rows_kept
        self.sums, self.clock = np.zeros((4, self._rows.shape[1])), np.zeros(3)
        self._follow = self._compiled("follow", self.sums, self.clock)

    def _begin(self, rows: Rows, times: Rows) -> None:
        self.sums[1:] = self.clock[:] = 0.0
        np.mean(rows, axis=0, out=self.sums[0])
        self.clock[0] = times[-1]
        self.drift[1] = (_NO_MOVEMENT * float(self.sums[0].mean())) ** 2

    def _add(self, change: Change) -> None:
        rows, weights = self._weighed(change)
        rows -= self.sums[0]
        kept = self._window.times_kept
        times = np.concatenate([kept[change.entered], kept[change.left]]) - self.clock[0]
        factors = np.array([weights, weights * times])
        sums = self.sums
        sums[1:3] += factors @ rows
        rows *= rows
        sums[3] += weights @ rows
        self.clock[1:] += factors @ times if len(times) else 0.0

    def _bounds(self) -> tuple[float, float]:
        # The largest sum and its own scatter: a distance that stood still while others moved must not be lost.
        place, count = int(self.sums[3].argmax()), self.count
        squares, total = self.sums.item(3, place), self.sums.item(1, place)
        return squares, max(squares - total * total / count, count * self.drift.item(1))

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
        The window, with points.
    seconds
        As of `Rolling`.

    Attributes
    ----------
    reference, total, products
        The reference; of the points relative to it the sum, both of shape (width,), and the sum of their products,
        shape (width, width).
    """

    def __init__(self, window: SlidingWindow, seconds: float | None = None) -> None:
        super().__init__(window, seconds)
        self._rows = window.points_kept
        width = self._rows.shape[1]
        # Arrays of their own, so that the compiled loops may write one and read another.
        self.reference, self.total, self.products = np.zeros(width), np.zeros(width), np.zeros((width, width))
        sums = self.reference, self.total, self.products
        loops = compiled.loops
        self._follow = self._compiled("follow_products", *sums) if loops and width <= loops.MAX_DIRECTIONS else None

    def _begin(self, rows: Rows, times: Rows) -> None:  # noqa: ARG002 - a covariance needs no times
        np.mean(rows, axis=0, out=self.reference)
        self.drift[1] = _NO_MOVEMENT**2 * float(self.reference @ self.reference)
        self.total[:] = 0.0
        self.products[:] = 0.0

    def _add(self, change: Change) -> None:
        rows, weights = self._weighed(change)
        rows -= self.reference
        self.total += weights @ rows
        self.products += (rows.T * weights) @ rows

    def _bounds(self) -> tuple[float, float]:
        trace, count = float(self.products.trace()), self.count
        return trace, max(trace - float(self.total @ self.total) / count, count * self.drift.item(1))

    def read(self) -> Rows:
        """Give the covariance, shape (width, width); needs a row. For a body that does not move it is 0."""
        count = self.count
        mean = self.total / count
        covariance: Rows = self.products / count
        covariance -= mean[:, None] * mean
        if covariance.trace() <= self.drift[1]:
            covariance[:] = 0.0
        return covariance


@lru_cache(256)
def _signs(entered: int, left: int) -> Rows:
    weights = np.repeat((1.0, -1.0), (entered, left))
    weights.flags.writeable = False
    return weights
