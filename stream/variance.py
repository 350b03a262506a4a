"""The mean and variance of each distance in a sliding window, kept up to date like the covariance is.

This is `stream.covariance` for the diagonal alone, with its two habits: values are held relative to a reference row,
and the rounding that may have gathered is bounded and, when it no longer is small, everything is computed afresh.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from library import compiled
from library.measures import LEVEL_REMOVED, SPREAD_FLOOR
from stream.rolling import DRIFT_TOLERANCE, EPSILON, Rolling, Rows, side_by_side, signs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from library.measures import Body

#: Movement, relative to the distance, below which lost digits are of no interest to anyone.
_NO_MOVEMENT = 1e-6


class RollingVariance(Rolling):
    """Mean and variance of a window's rows by adding what entered and removing what left.

    Parameters
    ----------
    width
        Numbers in a row.

    Attributes
    ----------
    sums
        The reference row, and of the rows relative to it the sum and the sum of squares, shape (3, width): side by
        side, so that those of several windows are gathered in one copy each.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.sums = np.zeros((3, width))
        self._reference, self._sum, self._squares = self.sums
        self._rounding = 0.0
        self._no_movement = 0.0

    def _follow(self, entered: Rows, left: Rows, window: Rows) -> None:
        count = self._count
        # The largest sum bounds the rounding of all: one distance that stood still while others moved must not be lost.
        if compiled.loops and side_by_side(window):
            squares, total = compiled.loops.follow(self.sums, entered, left)
        else:
            squares, total = self._follow_by_numpy(entered, left)
        self._rounding += EPSILON * (len(entered) + len(left)) * squares
        if self._rounding > DRIFT_TOLERANCE * max(squares - total * total / count, count * self._no_movement):
            self._refresh(window)

    def _follow_by_numpy(self, entered: Rows, left: Rows) -> tuple[float, float]:
        """Add what entered, take away what left; give the largest sum of squares and the sum that belongs to it."""
        self._add(np.concatenate([entered, left]), signs(len(entered), len(left)))
        largest = int(self._squares.argmax())
        return self._squares.item(largest), self._sum.item(largest)

    def _add(self, rows: Rows, weights: Rows) -> None:
        """Add rows (rows, width) times their weights (rows,); the rows are overwritten."""
        rows -= self._reference
        self._sum += weights @ rows
        rows *= rows
        self._squares += weights @ rows

    def _compute(self, window: Rows) -> None:
        np.mean(window, axis=0, out=self._reference)
        self._no_movement = (_NO_MOVEMENT * float(self._reference.mean())) ** 2
        self._sum[:] = 0.0
        self._squares[:] = 0.0
        self._add(window.copy(), np.ones(self._count))
        self._rounding = EPSILON * self._count * float(self._squares.max())

    def mean(self) -> Rows:
        """Mean of each distance, shape (width,), metres; needs a row."""
        return self._reference + self._sum / self._count

    def deviation(self) -> Rows:
        """Sample standard deviation of each distance, shape (width,), metres; needs a row, 0 for a single one."""
        scatter = self._sum * self._sum
        scatter /= -self._count
        scatter += self._squares
        np.maximum(scatter, 0.0, out=scatter)
        scatter /= max(self._count - 1, 1)
        return np.sqrt(scatter, out=scatter)

    def spread(self, body: Body) -> tuple[Rows, float]:
        """Measure the rows' spread, as `Body.spread` does, and their movement; needs a row.

        Returns
        -------
        The spread, shape (width,), and the movement, as `movements` has it.
        """
        if compiled.loops:
            numbers = np.empty(self.sums.shape[1])
            movement = compiled.loops.read_spread(
                self.sums, self._count, body.sizing, SPREAD_FLOOR, LEVEL_REMOVED, numbers
            )
            return numbers, movement
        mean, deviation = self.mean(), self.deviation()
        return body.spread(mean, deviation), float(movements(mean, deviation))


def movements(mean: Rows, deviation: Rows) -> Rows:
    """Give root mean square deviations of a distance, relative to the root mean square distance.

    Parameters
    ----------
    mean, deviation
        Of each distance, shape (..., width), metres.

    Returns
    -------
    Shape (...); 0 where all distances are 0: all joints in one point are a body that does not move.
    """
    lengths = np.square(mean).sum(axis=-1)
    moved: Rows = np.sqrt(np.square(deviation).sum(axis=-1) / np.where(lengths > 0, lengths, np.inf))
    return moved


def means_and_deviations(windows: Sequence[RollingVariance]) -> tuple[Rows, Rows]:
    """Give mean and deviation of several windows at once, both (windows, width), metres; each needs a row."""
    reference, total, squares = np.array([each.sums for each in windows]).transpose(1, 0, 2)
    counts = np.array([[len(each)] for each in windows], dtype=np.float64)
    mean = total / counts
    total *= mean
    squares -= total
    np.maximum(squares, 0.0, out=squares)
    squares /= np.maximum(counts - 1, 1)
    mean += reference
    return mean, np.sqrt(squares)
