"""The Gram matrix of a sliding window's frames, kept up to date by what enters and what leaves.

A covariance compares pairs with pairs, a Gram matrix frames with frames; the one's eigenvectors give the other's. With
fewer frames than pairs it is the smaller, and it follows the window by the new frames' inner products alone: each is
computed once and nothing is ever added up or taken away again, so that nothing drifts.

Frames are held relative to a reference row near the window's mean, or a performer who stands still right after moving
would be lost in the digits: products then are as small as the movement. When the window has moved so far away from the
reference that the digits left would be too few, they are all computed afresh, as happens right after a stop.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dgemm

from stream.covariance import DRIFT_TOLERANCE

Rows = NDArray[np.float64]

#: Movement, relative to the body's size, below which lost digits are of no interest to anyone.
_NO_MOVEMENT = 1e-7
_EPSILON = float(np.finfo(np.float64).eps)
#: Frames there is room for at first.
_FIRST_ROOM = 64


class RollingGram:
    """Inner products of a window's rows, as the window moves on.

    Parameters
    ----------
    width
        Numbers in a row.

    Attributes
    ----------
    refreshes
        How often all products were computed afresh.
    """

    def __init__(self, width: int) -> None:
        self._reference = np.zeros(width)
        self._still = 0.0
        # The window's products are a square on the diagonal, which wanders down and is moved back at the end.
        self._products = np.empty((_FIRST_ROOM, _FIRST_ROOM))
        self._start = self._end = 0
        self._memory = np.empty(0)
        self._centred = np.empty((0, 0))
        self._weights = np.empty(0)
        self._means = np.empty((3, 0))
        self.refreshes = 0

    def __len__(self) -> int:
        return self._end - self._start

    def clear(self) -> None:
        """Forget all rows."""
        self._start = self._end = 0

    def update(self, entered: Rows, left: Rows, window: Rows) -> None:
        """Compute what is new.

        Parameters
        ----------
        entered, left
            Rows that came into the window at its end, and went out at its front, shape (rows, width), metres.
        window
            All rows now in it, shape (rows, width).

        Raises
        ------
        ValueError
            The window does not hold as many rows as were added and not removed.
        """
        count, new = len(window), len(entered)
        if len(self) + new - len(left) != count:
            raise ValueError(f"window: expected {len(self) + new - len(left)} rows, got {count}")
        if count == new:
            self._refresh(window)
            return
        self._start += len(left)
        if self._end + new > len(self._products):
            self._make_room(count)
        start, end = self._start, self._end
        self._end = end + new
        relative = entered - self._reference
        # One factor alone needs to be relative to the reference: what the other has too much is the same for all.
        across = relative @ window[:-new].T
        across -= (relative @ self._reference)[:, None]
        self._products[end : self._end, start:end] = across
        self._products[start:end, end : self._end] = across.T
        self._products[end : self._end, end : self._end] = relative @ relative.T

    def _make_room(self, count: int) -> None:
        """Move the window's products back to the front, into a larger square if they would soon be at the end again."""
        kept = self._products[self._start : self._end, self._start : self._end]
        size = len(kept)
        if 2 * count > len(self._products):
            larger = np.empty((3 * count, 3 * count))
            larger[:size, :size] = kept
            self._products = larger
        else:
            self._products[:size, :size] = kept.copy()
        self._start, self._end = 0, size

    def _refresh(self, window: Rows) -> None:
        """Compute all products, relative to the window's own mean."""
        self._start = self._end = 0
        if not len(window):
            return
        if len(window) > len(self._products):
            self._products = np.empty((3 * len(window), 3 * len(window)))
        np.mean(window, axis=0, out=self._reference)
        self._still = float(self._reference @ self._reference) * _NO_MOVEMENT**2
        self._end = len(window)
        relative = window - self._reference
        np.matmul(relative, relative.T, out=self._products[: self._end, : self._end])
        self.refreshes += 1

    def centred(self, window: Rows) -> NDArray[np.float64]:
        """Give the inner products of the rows' deviations from their mean, in the order of the rows.

        A body that does not move, to seven digits of its size, has none: what is left then is rounding.

        Parameters
        ----------
        window
            The rows given to the last update: read only when the products must be computed afresh.

        Returns
        -------
        Gram matrix, shape (rows, rows), square metres; this object's memory, good until the next call.

        Raises
        ------
        ValueError
            There is no row.
        """
        if not len(self):
            raise ValueError("centred: expected at least one row, got none")
        centred, total = self._centre()
        scatter = float(centred.trace())
        still = len(self) * self._still
        if _EPSILON * total > DRIFT_TOLERANCE * max(scatter, still):
            self._refresh(window)
            centred, _ = self._centre()
            scatter, still = float(centred.trace()), len(self) * self._still
        if scatter <= still:
            centred[:] = 0.0
        return centred

    def _centre(self) -> tuple[NDArray[np.float64], float]:
        """Take the mean out of the products; give what is left, and their trace before."""
        if len(self._centred) != len(self):
            self._fit(len(self))
        products = self._products[self._start : self._end, self._start : self._end]
        means = products @ self._weights
        np.subtract(means, 0.5 * float(means @ self._weights), out=self._means[1])
        np.copyto(self._centred, products)
        # Less the means of row and column, plus the mean of all, is less 1aᵀ + a1ᵀ: with [1 a 1] in memory one product
        # of two columns with two others. BLAS counts column by column, but the matrix is its own transpose.
        ones_and_means, means_and_ones = self._means[:2].T, self._means[1:].T
        dgemm(-1.0, ones_and_means, means_and_ones, beta=1.0, c=self._centred.T, trans_b=True, overwrite_c=True)
        return self._centred, float(products.trace())

    def _fit(self, count: int) -> None:
        if count * count > len(self._memory):
            self._memory = np.empty(count * count)
        self._centred = self._memory[: count * count].reshape(count, count)
        self._weights = np.full(count, 1.0 / count)
        self._means = np.ones((3, count))
