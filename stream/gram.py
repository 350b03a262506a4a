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

from library import compiled
from library.aligned import aligned_zeros
from stream.rolling import DRIFT_TOLERANCE, EPSILON, Rolling, Rows, side_by_side

#: Movement, relative to the body's size, below which lost digits are of no interest to anyone.
_NO_MOVEMENT = 1e-7
#: Frames there is room for at first, in the window and among those that enter at once.
_FIRST_ROOM, _FIRST_ENTERED = 64, 16


class CentredGram:
    """Inner products of rows' deviations from their mean, as `library.eigen.SymmetricMatrix` has it.

    Parameters
    ----------
    products
        Inner products of the rows, relative to some row, shape (rows, rows).
    weights
        1 / rows for each row.
    square
        The products' trace / rows.
    beyond
        What the squared length of the rows' mean has more than its squared distance from that row.

    Attributes
    ----------
    total
        Sum of the squared deviations: the trace.
    mean_square
        Squared length of the rows' mean.
    """

    def __init__(self, products: Rows, weights: Rows, square: float, beyond: float) -> None:
        self._products = products
        self._weights = weights
        #: Mean of each row of the products, and of all.
        self._means = products @ weights
        self._mean = float(weights.dot(self._means))
        self.total = len(products) * (square - self._mean)
        self.mean_square = self._mean + beyond

    def __len__(self) -> int:
        return len(self._products)

    def times(self, rows: Rows) -> Rows:
        """Multiply with vectors whose numbers add up to 0, shape (vectors, rows); others are taken as if they did."""
        # Centred on both sides. What is left of the first centring, once done, is rounding.
        loops = compiled.loops
        if loops and len(rows) == loops.TOGETHER:
            image = np.empty(rows.shape)
            loops.times_centred(np.ascontiguousarray(rows), self._products, image)
            return image
        image = rows @ self._products
        self.centre(image)
        return image

    def centre(self, rows: Rows) -> None:
        """Change vectors, shape (vectors, rows), so that the numbers of each add up to 0."""
        rows -= rows.dot(self._weights)[:, None]

    def dense(self) -> Rows:
        """Write the matrix out, shape (rows, rows)."""
        means = self._means - 0.5 * self._mean
        centred: Rows = self._products - np.add.outer(means, means)
        return centred


class RollingGram(Rolling):
    """Inner products of a window's rows, as the window moves on.

    Parameters
    ----------
    width
        Numbers in a row.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        #: Where the compiled loops hold some rows relative to the reference.
        self._some = np.empty((compiled.loops.TOGETHER if compiled.loops else 0, width))
        self._reference: Rows = aligned_zeros(1, width)[0]
        self._relative: Rows = aligned_zeros(_FIRST_ENTERED, width)
        self._reference_square = self._still = 0.0
        # The window's products are a square on the diagonal, which wanders down and is moved back at the end.
        self._allocate(_FIRST_ROOM)
        self._start = self._end = 0
        self._weights = np.empty(0)

    def _follow(self, entered: Rows, left: Rows, window: Rows) -> None:
        new = len(entered)
        self._start += len(left)
        if not new:
            return
        if self._end + new > len(self._products):
            self._make_room(len(window))
        start, end = self._start, self._end
        self._end = end + new
        if compiled.loops and len(self._some) and side_by_side(window):
            of_each = self._of_each[:, start : self._end]
            compiled.loops.add_frames(window, new, self._reference, self._some, self._held, of_each)
            return
        relative = self._relative_to_reference(entered)
        # One factor alone needs to be relative to the reference: what the other has too much is the same for all.
        along = relative @ self._reference
        across = np.matmul(relative, window[:-new].T, out=self._products[end : self._end, start:end])
        across -= along[:, None]
        self._products[start:end, end : self._end] = across.T
        # Written as a matrix times its own transpose, symmetric to the last bit.
        among = np.matmul(relative, relative.T, out=self._products[end : self._end, end : self._end])
        self._of_each[0, end : self._end] = among.diagonal()
        self._of_each[1, end : self._end] = along

    def _relative_to_reference(self, rows: Rows) -> Rows:
        """Give rows less the reference; this object's memory, good until the next call."""
        if len(rows) > len(self._relative):
            self._relative = aligned_zeros(2 * len(rows), rows.shape[1])
        relative: Rows = np.subtract(rows, self._reference, out=self._relative[: len(rows)])
        return relative

    def _make_room(self, count: int) -> None:
        """Move the window's products back to the front, into a larger square if they would soon be at the end again."""
        held, of_each = self._held.copy(), self._of_each[:, self._start : self._end].copy()
        size = len(held)
        if 3 * count > 2 * len(self._products):
            self._allocate(2 * count)
        self._products[:size, :size] = held
        self._of_each[:, :size] = of_each
        self._start, self._end = 0, size

    def _allocate(self, room: int) -> None:
        self._products: Rows = aligned_zeros(room, room)
        #: The products of each row with itself and with the reference.
        self._of_each = np.empty((2, room))

    def _compute(self, window: Rows) -> None:
        if len(window) > len(self._products):
            self._allocate(2 * len(window))
        np.mean(window, axis=0, out=self._reference)
        self._reference_square = float(self._reference @ self._reference)
        self._still = self._reference_square * _NO_MOVEMENT**2
        self._start, self._end = 0, len(window)
        relative = window - self._reference
        np.matmul(relative, relative.T, out=self._held)
        self._of_each[0, : self._end] = self._held.diagonal()
        self._of_each[1, : self._end] = relative @ self._reference

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
        count = self._count
        if not count:
            raise ValueError("centred: expected at least one row, got none")
        centred, squares = self._centred()
        if EPSILON * squares > DRIFT_TOLERANCE * max(centred.total, count * self._still):
            self._refresh(window)
            centred, _ = self._centred()
        if centred.total <= count * self._still:
            centred.total = 0.0
        return centred

    @property
    def _held(self) -> Rows:
        return self._products[self._start : self._end, self._start : self._end]

    def _centred(self) -> tuple[CentredGram, float]:
        """Give the centred products, and the trace they had before."""
        count = self._count
        if len(self._weights) != count:
            self._weights = np.full(count, 1.0 / count)
        square, along = (self._of_each[:, self._start : self._end] @ self._weights).tolist()
        return CentredGram(self._held, self._weights, square, self._reference_square + 2.0 * along), count * square
