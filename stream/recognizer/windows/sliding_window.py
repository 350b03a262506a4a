"""The sliding window: the distance rows of the last seconds, at any frame rate."""

from __future__ import annotations

import math
import mmap
import os
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

#: Bytes of a line of the processor's cache.
_LINE = 64
#: Frames per second up to which a window holds all its seconds. A faster feed shortens the window.
MAX_FEED_RATE = 500.0
#: After a fork the child has windows of its own; on systems without fork the flag means something else.
_PRIVATE = mmap.ACCESS_COPY if hasattr(os, "fork") else mmap.ACCESS_DEFAULT
#: Rows that may enter before the sums must follow.
MAX_PENDING = 64
#: Seconds within which two spans count as equal. A feed's times are multiples of a frame with rounding, a quarter of a
#: microsecond for times since 1970; so ties are decided alike at every rate.
TIE = 1e-6


class SlidingWindow:
    """Distance rows of the last seconds, ending with the newest frame, and perhaps a point for each.

    A row at time t is in the window while the newest time is less than t + seconds; the newest row always is. Rows lie
    one after another in time order in memory that is allocated once. Before they reach its end they move back to the
    front, on average one copy of each row; so every read is a plain slice.

    Parameters
    ----------
    seconds
        Length of the window.
    width
        Numbers in a row.
    fastest
        Frames per second up to which the window keeps its length.
    point_width
        Numbers of the point that is kept for each row.

    Attributes
    ----------
    rows_kept, points_kept, times_kept
        The memory: rows (places, width), points (places, point_width), and times (places,), seconds.
    end, moved
        Where the newest row ends in the memory, and by how many places rows have moved back in all.
    """

    def __init__(self, seconds: float, width: int, fastest: float = MAX_FEED_RATE, point_width: int = 0) -> None:
        self.seconds, self._fastest = seconds, fastest
        self._most = self.most_in(seconds)
        # Twice the rows that may have to be kept, so that moving back never overlaps. The system commits only pages
        # that are used: a slow feed does not pay for the room of a fast one.
        room = 2 * (self._most + 2 * MAX_PENDING)
        self.rows_kept, self.times_kept = _reserved(room, width), np.empty(room)
        self.points_kept = _reserved(room, point_width) if point_width else np.empty((room, 0))
        self._all = (self.rows_kept, self.points_kept, self.times_kept)
        self.clear()

    def most_in(self, seconds: float) -> int:
        """Say how many rows there are at most in so many seconds."""
        return max(2, math.ceil(seconds * self._fastest))

    def clear(self) -> None:
        """Forget all rows, as at the start."""
        self._kept = self._start = self._fresh = self.end = 0
        self.moved = 0
        # A plain number in addition to the array, because looking one up in an array is slow.
        self._oldest = math.nan

    def push(
        self, times: Sequence[float], rows: NDArray[np.float64], points: NDArray[np.float64] | None = None
    ) -> None:
        """Take in rows, all at once as if one by one, and drop the rows that are `seconds` old.

        Parameters
        ----------
        times
            The time of each row, seconds, later than the row before.
        rows
            Shape (rows, width).
        points
            Shape (rows, point_width), when points are kept.

        Raises
        ------
        RuntimeError
            More than `MAX_PENDING` rows would have entered since `pass_over` was last called. No row is taken in.
        """
        count = len(times)
        if self.end - self._fresh + count > MAX_PENDING:
            raise RuntimeError(f"pass_over() must be called at least once in {MAX_PENDING} rows")
        if not count:
            return
        if self._kept >= self.end - self._kept + MAX_PENDING:
            self._move_back()
        begin, self.end = self.end, self.end + count
        if begin == self._start:
            self._oldest = times[0]
        self.rows_kept[begin : self.end] = rows
        self.times_kept[begin : self.end] = times
        if points is not None:
            self.points_kept[begin : self.end] = points
        too_old = times[-1] - (self.seconds - TIE)
        start, oldest, last = self._start, self._oldest, self.end - 1
        # Times in other units may be so large that even the newest time is not above `too_old`.
        while start < last and (oldest <= too_old or last - start >= self._most):
            start += 1
            oldest = self.times_kept.item(start)
        self._start, self._oldest = start, oldest

    def _move_back(self) -> None:
        count, shift = self.end - self._kept, self._kept
        self.moved += shift
        for each in self._all:
            each[:count] = each[shift : self.end]
        self._kept, self._start, self._fresh, self.end = (
            place - shift for place in (self._kept, self._start, self._fresh, self.end)
        )

    @property
    def pending(self) -> int:
        """How many rows entered since `pass_over` was last called."""
        return self.end - self._fresh

    def pass_over(self) -> None:
        """Let go of the rows that left, because all spans have taken their changes."""
        self._kept, self._fresh = self._start, self.end

    @property
    def rows(self) -> NDArray[np.float64]:
        """The rows in the window, shape (rows, width), oldest first; a view, valid until the next push.

        Each row is contiguous and begins with a cache line.
        """
        return self.rows_kept[self._start : self.end]

    @property
    def points(self) -> NDArray[np.float64]:
        """The points of the rows, shape (rows, point_width); a view, as of `rows`."""
        return self.points_kept[self._start : self.end]

    @property
    def times(self) -> NDArray[np.float64]:
        """The times of the rows, shape (rows,), seconds; a view, valid until the next push."""
        return self.times_kept[self._start : self.end]

    def __len__(self) -> int:
        return self.end - self._start


def _reserved(rows: int, width: int) -> NDArray[np.float64]:
    """Reserve memory of which only the used pages are committed.

    numpy asks for pages of 2 MB on Linux for arrays above 4 MB, which wastes memory for many performers.
    """
    number = np.dtype(np.float64).itemsize
    stride = -(-width * number // _LINE) * _LINE // number
    size = rows * stride * number
    try:
        memory = mmap.mmap(-1, size, access=_PRIVATE)
    except (OSError, OverflowError) as error:
        raise MemoryError(f"expected room for {rows} rows of {width} numbers, {size} bytes") from error
    if hasattr(mmap, "MADV_NOHUGEPAGE"):
        # A kernel built without large pages refuses, and does not need the advice.
        with suppress(OSError):
            memory.madvise(mmap.MADV_NOHUGEPAGE)
    # The system's memory begins with a page, so that every row begins with a cache line.
    return np.frombuffer(memory, dtype=np.float64).reshape(rows, stride)[:, :width]
