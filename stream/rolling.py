"""What is kept of a sliding window's rows: brought up to date by what entered and what left, not computed anew."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.float64]

#: Rounding, relative to the total variance, at which everything is computed afresh: well inside the promised 1e-9.
DRIFT_TOLERANCE = 1e-11
#: Rounding of a number, relative to it.
EPSILON = float(np.finfo(np.float64).eps)


@lru_cache(256)
def signs(entered: int, left: int) -> Rows:
    """Give 1 for each row that entered and then -1 for each that left, shape (entered + left,)."""
    weights = np.repeat((1.0, -1.0), (entered, left))
    weights.flags.writeable = False
    return weights


def side_by_side(rows: Rows) -> bool:
    """Whether the numbers of each row are, as the compiled loops need them; a sliding window's are."""
    return rows.strides[1] == rows.itemsize


class Rolling(ABC):
    """Numbers that follow a sliding window's rows.

    Attributes
    ----------
    refreshes
        How often they were computed afresh, from the window's rows alone.
    """

    def __init__(self) -> None:
        self._count = 0
        self.refreshes = 0

    def __len__(self) -> int:
        """Rows counted."""
        return self._count

    def clear(self) -> None:
        """Forget all rows."""
        self._count = 0

    def update(self, entered: Rows, left: Rows, window: Rows) -> None:
        """Follow the window.

        Parameters
        ----------
        entered, left
            Rows that came into the window at its end, and went out at its front, shape (rows, width), metres. A row
            that did both is in neither.
        window
            All rows now in it, shape (rows, width).

        Raises
        ------
        ValueError
            The window does not hold as many rows as were added and not removed.
        """
        count, new = len(window), len(entered)
        expected = self._count + new - len(left)
        if count != expected:
            raise ValueError(f"window: expected {expected} rows, got {count}")
        self._count = count
        if count > new:
            self._follow(entered, left, window)
        elif count:
            self._refresh(window)

    def _refresh(self, window: Rows) -> None:
        self.refreshes += 1
        self._compute(window)

    @abstractmethod
    def _compute(self, window: Rows) -> None:
        """Compute everything from the window's rows, one at least."""

    @abstractmethod
    def _follow(self, entered: Rows, left: Rows, window: Rows) -> None:
        """Take in what changed, when some rows that were there before still are; `_refresh` where that is not exact."""
