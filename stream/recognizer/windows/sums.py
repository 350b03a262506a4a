"""Sums that follow a sliding window: rows that enter are added, rows that leave are subtracted.

Sums of values of a metre that move by a millimetre lose digits. The loss shows when a performer stands still right
after moving: the rows that left had large values, and their rounding stays in the sums. Two habits keep the sums exact.
Values are taken relative to a reference row near the window's mean, so that they are as small as the movement. And a
bound of the rounding grows with every row; when the bound is no longer small against the variance that is left, the
sums are computed afresh from the window's rows. That happens every ten seconds or so while a performer moves, and right
after a stop. `library.kernels.plain.follow` shows the arithmetic.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.kernels import bind
from kinespace.stream.recognizer.windows.sliding_window import TIE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.stream.recognizer.windows.sliding_window import SlidingWindow

#: Rounding, relative to the total variance, from which on sums are computed afresh: well inside the promised 1e-9.
DRIFT_TOLERANCE = 1e-11
#: Movement, relative to the distance, below which lost digits do not matter.
NO_MOVEMENT = 1e-6


class Sums:
    """Sums over the rows, or points, in the last seconds of a window.

    Attributes
    ----------
    places
        Where these seconds begin and end, counted as if no row had moved back, shape (2,).
    drift
        The bound of the sums' rounding, and the variance below which lost digits do not matter, shape (2,).
    follow
        Follows the window up to its newest row, from where that row ends in the window's memory, and by how many places
        rows have moved back in all; gives whether the sums were computed afresh. After it on all sums the window needs
        `pass_over`.
    """

    def __init__(
        self,
        window: SlidingWindow,
        seconds: float,
        kernel: str,
        rows: NDArray[np.float64],
        *sums: NDArray[np.float64],
    ) -> None:
        self.places, self.drift = np.zeros(2, dtype=np.intp), np.zeros(2)
        limits = seconds - TIE, window.most_in(seconds), DRIFT_TOLERANCE, NO_MOVEMENT
        self.follow = bind(kernel, rows, window.times_kept, self.places, self.drift, *sums, *limits)

    def clear(self) -> None:
        """Forget all rows."""
        self.places[:] = 0


class MomentSums(Sums):
    """Sums of distance rows.

    Parameters
    ----------
    window
        The window.
    seconds
        The seconds that are followed.

    Attributes
    ----------
    sums
        The reference row; and of the rows relative to it the sum, the sum of products with time, and the sum of
        squares, shape (4, width).
    clock
        The reference time; and of the times relative to it the sum, and the sum of squares, shape (3,).
    """

    def __init__(self, window: SlidingWindow, seconds: float) -> None:
        self.sums, self.clock = np.zeros((4, window.rows_kept.shape[1])), np.zeros(3)
        super().__init__(window, seconds, "follow", window.rows_kept, self.sums, self.clock)


class ProductSums(Sums):
    """Sums of a window's points in the basis.

    Parameters
    ----------
    window, seconds
        As in `MomentSums`; the window has points.

    Attributes
    ----------
    sums, products
        The reference and the sum of the points relative to it, shape (2, width); and the sum of their products, shape
        (width, width).
    """

    def __init__(self, window: SlidingWindow, seconds: float) -> None:
        width = window.points_kept.shape[1]
        self.sums, self.products = np.zeros((2, width)), np.zeros((width, width))
        super().__init__(window, seconds, "follow_products", window.points_kept, self.sums, self.products)
