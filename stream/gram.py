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

from stream.covariance import DRIFT_TOLERANCE

Rows = NDArray[np.float64]

#: Movement, relative to the body's size, below which lost digits are of no interest to anyone.
_NO_MOVEMENT = 1e-7
_EPSILON = float(np.finfo(np.float64).eps)
#: Frames there is room for at first.
_FIRST_ROOM = 64


class CentredGram:
    """Inner products of rows' deviations from their mean, as `library.eigen.SymmetricMatrix` has it.

    Parameters
    ----------
    products
        Inner products of the rows, relative to any one row, shape (rows, rows).
    weights
        1 / rows for each row.
    squares
        The products' trace.

    Attributes
    ----------
    total
        Sum of the squared deviations: the trace.
    """

    def __init__(self, products: Rows, weights: Rows, squares: float) -> None:
        self._products = products
        self._weights = weights
        self.total = squares - len(products) * float(weights @ products @ weights)

    def __len__(self) -> int:
        return len(self._products)

    def times(self, rows: Rows) -> Rows:
        """Multiply with vectors whose numbers add up to 0, shape (vectors, rows); others are taken as if they did."""
        # Centred on both sides. What is left of the first centring, once done, is rounding.
        image = rows @ self._products
        image -= (image @ self._weights)[:, None]
        return image

    def dense(self) -> Rows:
        """Write the matrix out, shape (rows, rows)."""
        means = self._products @ self._weights
        means -= 0.5 * float(means @ self._weights)
        centred: Rows = self._products - np.add.outer(means, means)
        return centred


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
        self._squares = np.empty(_FIRST_ROOM)
        self._start = self._end = 0
        self._weights = np.empty(0)
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
        if not new:
            return
        if self._end + new > len(self._products):
            self._make_room(count)
        start, end = self._start, self._end
        self._end = end + new
        relative = entered - self._reference
        # One factor alone needs to be relative to the reference: what the other has too much is the same for all.
        across = relative @ window.T
        across -= (relative @ self._reference)[:, None]
        among = across[:, -new:]
        among += among.T.copy()
        among *= 0.5
        self._products[end : self._end, start : self._end] = across
        self._products[start : self._end, end : self._end] = across.T
        self._squares[end : self._end] = among.diagonal()

    def _make_room(self, count: int) -> None:
        """Move the window's products back to the front, into a larger square if they would soon be at the end again."""
        held, squares = self._held, self._squares[self._start : self._end].copy()
        size = len(held)
        if 3 * count > 2 * len(self._products):
            self._allocate(2 * count)
        self._products[:size, :size] = held.copy()
        self._squares[:size] = squares
        self._start, self._end = 0, size

    def _allocate(self, room: int) -> None:
        self._products = np.empty((room, room))
        self._squares = np.empty(room)

    def _refresh(self, window: Rows) -> None:
        """Compute all products, relative to the window's own mean."""
        self._start = self._end = 0
        if not len(window):
            return
        if len(window) > len(self._products):
            self._allocate(2 * len(window))
        np.mean(window, axis=0, out=self._reference)
        self._still = float(self._reference @ self._reference) * _NO_MOVEMENT**2
        self._end = len(window)
        relative = window - self._reference
        np.matmul(relative, relative.T, out=self._held)
        self._squares[: self._end] = self._held.diagonal()
        self.refreshes += 1

    def centred(self, window: Rows) -> CentredGram:
        """Give the inner products of the rows' deviations from their mean, in the order of the rows.

        A body that does not move, to seven digits of its size, has a total of 0: what is left then is rounding.

        Parameters
        ----------
        window
            The rows given to the last update: read only when the products must be computed afresh.

        Returns
        -------
        The Gram matrix, square metres; this object's memory, good until the next update.

        Raises
        ------
        ValueError
            There is no row.
        """
        if not len(self):
            raise ValueError("centred: expected at least one row, got none")
        squares, still = self._sum_of_squares(), len(self) * self._still
        centred = self._centred(squares)
        if _EPSILON * squares > DRIFT_TOLERANCE * max(centred.total, still):
            self._refresh(window)
            centred, still = self._centred(self._sum_of_squares()), len(self) * self._still
        if centred.total <= still:
            centred.total = 0.0
        return centred

    @property
    def _held(self) -> Rows:
        return self._products[self._start : self._end, self._start : self._end]

    def _sum_of_squares(self) -> float:
        # Kept beside, for on the diagonal every number lies in another line of the cache.
        return float(self._squares[self._start : self._end].sum())

    def _centred(self, squares: float) -> CentredGram:
        if len(self._weights) != len(self):
            self._weights = np.full(len(self), 1.0 / len(self))
        return CentredGram(self._held, self._weights, squares)
