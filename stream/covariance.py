"""The covariance of a sliding window, kept up to date by what enters and what leaves.

Sums of products of values of a metre that move by a millimetre lose their digits, and the loss bites when a
performer stands still right after moving: what left took large products along, and their rounding stays behind. Two
habits keep it exact. Values are held relative to a reference row near the window's mean, so that the products are as
small as the movement. And the rounding that may have gathered is bounded as it gathers; when the bound is no longer
small against the variance that is left, everything is computed afresh from the window's rows. While a performer
moves that happens every ten seconds or so, right after a stop at once.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg.blas import dgemm, dger

from library.signature import Moments
from stream.rolling import DRIFT_TOLERANCE, EPSILON, Rolling, Rows, signs

#: Movement, relative to the body's size, below which lost digits are of no interest to anyone.
_NO_MOVEMENT = 1e-7


class RollingCovariance(Rolling):
    """Mean and covariance of a window's rows by adding what entered and removing what left.

    Parameters
    ----------
    width
        Numbers in a row.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self._reference = np.zeros(width)
        self._sum = np.zeros(width)
        # Column-major, because BLAS then adds to it in place.
        self._products = np.zeros((width, width), order="F")
        self._diagonal = self._products.ravel(order="K")[:: width + 1]
        self._covariance = np.zeros((width, width))
        self._rounding = 0.0
        self._length = 0.0

    def _follow(self, entered: Rows, left: Rows, window: Rows) -> None:
        self._add(np.concatenate([entered, left]), signs(len(entered), len(left)))
        self._rounding += EPSILON * (len(entered) + len(left)) * self._trace()
        if self._rounding > DRIFT_TOLERANCE * max(self._scatter(), self._no_scatter()):
            self._refresh(window)

    def _add(self, rows: Rows, weights: Rows) -> None:
        """Add rows (rows, width) times their weights (rows,); the rows are overwritten."""
        rows -= self._reference
        self._sum += weights @ rows
        # dgemm takes its operands column by column: the transposed views are that without a copy.
        dgemm(1.0, (rows * weights[:, None]).T, rows.T, beta=1.0, c=self._products, trans_b=True, overwrite_c=True)

    def _compute(self, window: Rows) -> None:
        np.mean(window, axis=0, out=self._reference)
        self._sum[:] = 0.0
        self._products[:] = 0.0
        self._add(window.copy(), np.ones(self._count))
        self._length = math.sqrt(float(self._reference @ self._reference))
        self._rounding = EPSILON * self._count * self._trace()

    def _trace(self) -> float:
        return float(self._diagonal.sum())

    def _scatter(self) -> float:
        """Total scatter about the mean."""
        return self._trace() - float(self._sum @ self._sum) / self._count

    def _no_scatter(self) -> float:
        """Total scatter of a body that does not move, at most: its mean row is no longer than its two parts."""
        length = self._length + math.sqrt(float(self._sum @ self._sum)) / self._count
        return self._count * (length * _NO_MOVEMENT) ** 2

    def _mean(self) -> Rows:
        return self._reference + self._sum / self._count

    def moments(self) -> Moments:
        """Give count, mean and covariance of the window's rows.

        A body that does not move, to seven digits of its size, has no covariance: what is left in the sums then is
        rounding, which has neither a sign nor symmetry to rely on.

        Returns
        -------
        The moments; the covariance is this object's memory, good until the next call.

        Raises
        ------
        ValueError
            There is no row.
        """
        if not self._count:
            raise ValueError("moments: expected at least one row, got none")
        if self._scatter() <= self._no_scatter():
            self._covariance[:] = 0.0
        else:
            weight = 1.0 / max(self._count - 1, 1)
            # Symmetric, so that its transpose, which BLAS writes to in place, is itself.
            np.multiply(self._products.T, weight, out=self._covariance)
            dger(-weight / self._count, self._sum, self._sum, a=self._covariance.T, overwrite_a=True)
        return Moments(self._count, self._mean(), self._covariance)
