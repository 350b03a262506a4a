"""The sliding window: the distance rows of the last seconds, at any frame rate."""

from __future__ import annotations

import math
import mmap
import os
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from kinespace.library.kernels.aligned import numbers_per_row

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

#: Frames per second up to which a window holds all its seconds. A faster feed shortens the window.
MAX_FEED_RATE = 500.0
#: After a fork the child has windows of its own; on systems without fork the flag means something else.
_PRIVATE = mmap.ACCESS_COPY if hasattr(os, "fork") else mmap.ACCESS_DEFAULT
#: Rows that may enter before the changes must be taken.
MAX_PENDING = 64
#: Seconds within which two spans count as equal. A feed's times are multiples of a frame with rounding, a quarter of a
#: microsecond for times since 1970; so ties are decided alike at every rate.
_TIE = 1e-6


class Change(NamedTuple):
    """Rows that entered and left a window since the last call, oldest first.

    All are views into the window's memory, valid until the next push.

    Attributes
    ----------
    entered, left
        Shape (rows, width).
    entered_times, left_times
        Shape (rows,), seconds.
    """

    entered: NDArray[np.float64]
    left: NDArray[np.float64]
    entered_times: NDArray[np.float64]
    left_times: NDArray[np.float64]


class Window(Protocol):
    """The part of a window that rolling sums need."""

    @property
    def pending(self) -> int:
        """How many rows entered since the changes were last taken."""

    @property
    def rows(self) -> NDArray[np.float64]:
        """The rows in the window, shape (rows, width), oldest first; a view, valid until the next push."""

    @property
    def times(self) -> NDArray[np.float64]:
        """The times of the rows, shape (rows,), seconds; a view, valid until the next push."""

    def __len__(self) -> int: ...

    def take_change(self) -> Change:
        """Give the rows that entered and left since the last call; a row that did both is in neither list."""


class SlidingWindow:
    """Distance rows of the last seconds, ending with the newest frame.

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

    Attributes
    ----------
    end, moved
        Where the newest row ends in the memory, and by how many places rows have moved back in all.

    Raises
    ------
    ValueError
        Seconds, width or fastest is not positive, or seconds not finite.
    """

    def __init__(self, seconds: float, width: int, fastest: float = MAX_FEED_RATE) -> None:
        if not (math.isfinite(seconds) and seconds > 0):
            raise ValueError(f"seconds: expected a positive number, got {seconds}")
        if width < 1 or fastest <= 0:
            raise ValueError(f"width, fastest: expected positive numbers, got {width}, {fastest}")
        self.seconds = seconds
        self._most = max(2, math.ceil(seconds * fastest))
        # Twice the rows that may have to be kept, so that moving back never overlaps. The system commits only pages
        # that are used: a slow feed does not pay for the room of a fast one.
        room = 2 * (self._most + 2 * MAX_PENDING)
        self._rows = _reserved(room, width)
        self._times = np.empty(room)
        self.clear()

    def clear(self) -> None:
        """Forget all rows, as at the start, and all changes."""
        self._kept = self._start = self._fresh = self.end = 0
        self.moved = 0
        # Plain numbers beside the array, because looking one up in an array is slow.
        self._since = self._oldest = math.nan
        self._newest = -math.inf

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in rows, all at once as if one by one, and drop the rows that are `seconds` old.

        Parameters
        ----------
        times
            The time of each row, seconds, later than the row before.
        rows
            Shape (rows, width).

        Raises
        ------
        ValueError
            A time is not later than the one before, or rows and times differ in number. No row is taken in.
        RuntimeError
            More than `MAX_PENDING` rows would have entered since `take_change` was last called. No row is taken in.
        """
        count = len(times)
        if len(rows) != count:
            raise ValueError(f"rows: expected {count}, as many as times, got {len(rows)}")
        newest = self._newest
        for time in times:
            if time <= newest:
                raise ValueError(f"time: expected later than {newest}, got {time}")
            newest = time
        if self.end - self._fresh + count > MAX_PENDING:
            raise RuntimeError(f"take_change() must be called at least once in {MAX_PENDING} rows")
        if not count:
            return
        if self._kept >= self.end - self._kept + MAX_PENDING:
            self._move_back()
        begin, self.end = self.end, self.end + count
        if begin == self._start:
            self._since = self._oldest = times[0]
        self._rows[begin : self.end] = rows
        self._times[begin : self.end] = times
        self._newest = newest
        self._let_go(newest - (self.seconds - _TIE))

    def _let_go(self, too_old: float) -> None:
        start, oldest, last = self._start, self._oldest, self.end - 1
        # Times in other units may be so large that even the newest time is not above `too_old`.
        while start < last and (oldest <= too_old or last - start >= self._most):
            start += 1
            oldest = self._times.item(start)
        self._start, self._oldest = start, oldest

    def _move_back(self) -> None:
        count, shift = self.end - self._kept, self._kept
        self.moved += shift
        self._rows[:count] = self._rows[shift : self.end]
        self._times[:count] = self._times[shift : self.end]
        self._kept, self._start, self._fresh, self.end = (
            place - shift for place in (self._kept, self._start, self._fresh, self.end)
        )

    @property
    def pending(self) -> int:
        """How many rows entered since the changes were last taken."""
        return self.end - self._fresh

    def take_change(self) -> Change:
        """Give the rows that entered and left since the last call; a row that did both is in neither list."""
        fresh = max(self._fresh, self._start)
        came, went = slice(fresh, self.end), slice(self._kept, min(self._start, self._fresh))
        self.pass_over()
        return Change(self._rows[came], self._rows[went], self._times[came], self._times[went])

    def pass_over(self) -> None:
        """Discard the changes, because no sums follow this window."""
        self._kept, self._fresh = self._start, self.end

    @property
    def rows(self) -> NDArray[np.float64]:
        """The rows in the window, shape (rows, width), oldest first; a view, valid until the next push.

        Each row is contiguous and begins with a cache line.
        """
        return self._rows[self._start : self.end]

    @property
    def times(self) -> NDArray[np.float64]:
        """The times of the rows, shape (rows,), seconds; a view, valid until the next push."""
        return self._times[self._start : self.end]

    @property
    def memory(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The memory of rows and times, for shorter windows of the same rows."""
        return self._rows, self._times

    @property
    def full(self) -> bool:
        """Whether rows have come for the window's whole length since it was last empty."""
        return self._newest - self._since >= self.seconds - _TIE

    def __len__(self) -> int:
        return self.end - self._start


class ShorterWindow:
    """The last seconds of a longer window, in the same memory; it moves on when its changes are taken.

    Parameters
    ----------
    window
        The longer window. Its changes must be taken after this window's, and both windows must be cleared together.
    seconds
        Length of the shorter window.
    fastest
        Frames per second up to which the window keeps its length.
    """

    def __init__(self, window: SlidingWindow, seconds: float, fastest: float = MAX_FEED_RATE) -> None:
        self._window, self.seconds = window, seconds
        self._rows, self._times = window.memory
        self._most = max(2, math.ceil(seconds * fastest))
        self.clear()

    def clear(self) -> None:
        """Forget all rows."""
        # Places as if no row had moved back.
        self._start = self._end = 0

    @property
    def pending(self) -> int:
        """How many rows entered since the changes were last taken."""
        return self._window.end + self._window.moved - self._end

    def take_change(self) -> Change:
        """Give the rows that entered and left since the last call; a row that did both is in neither list."""
        moved, end = self._window.moved, self._window.end
        kept, fresh, last = self._start - moved, self._end - moved, end - 1
        start, too_old = kept, self._times.item(last) - (self.seconds - _TIE)
        while start < last and (self._times.item(start) <= too_old or last - start >= self._most):
            start += 1
        self._start, self._end = start + moved, end + moved
        came, went = slice(max(fresh, start), end), slice(kept, min(start, fresh))
        return Change(self._rows[came], self._rows[went], self._times[came], self._times[went])

    @property
    def rows(self) -> NDArray[np.float64]:
        """The rows in the window when its changes were last taken, shape (rows, width), oldest first; a view."""
        moved = self._window.moved
        return self._rows[self._start - moved : self._end - moved]

    @property
    def times(self) -> NDArray[np.float64]:
        """The times of the rows, shape (rows,), seconds; a view."""
        moved = self._window.moved
        return self._times[self._start - moved : self._end - moved]

    def __len__(self) -> int:
        return self._end - self._start


def _reserved(rows: int, width: int) -> NDArray[np.float64]:
    """Reserve memory of which only the used pages are committed.

    numpy asks for pages of 2 MB on Linux for arrays above 4 MB, which wastes memory for many performers.
    """
    stride = numbers_per_row(width)
    size = rows * stride * np.dtype(np.float64).itemsize
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
