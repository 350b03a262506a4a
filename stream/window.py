"""The sliding window: the distance rows of the last seconds, however many frames that is."""

from __future__ import annotations

import math
import mmap
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from library.aligned import numbers_per_row

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

#: Frames per second up to which a window holds all its seconds. A faster feed shortens the window.
FASTEST_FEED = 500.0
#: Rows that may enter before the changes must be taken.
MOST_PENDING = 64
#: Seconds within which two spans are as long. A feed's times are multiples of a frame with rounding, a quarter of a
#: microsecond when they count from 1970; so ties are decided alike at every rate.
_TIE = 1e-6


class Change(NamedTuple):
    """What a window took in and let go since it was last asked, each of shape (rows, pairs), oldest first.

    Both are views into the window's memory: good until the next push.
    """

    entered: NDArray[np.float64]
    left: NDArray[np.float64]


class SlidingWindow:
    """Distance rows of the last seconds, ending with the newest frame.

    A row at time t is in the window while the newest time is less than t + seconds; the newest always is. Rows lie
    one after another in time order in memory allocated once. Before they reach its end they move back to the front, one
    row's copy per row on average, which is what makes every read a plain slice.

    Parameters
    ----------
    seconds
        Length of the window.
    width
        Numbers in a row.
    fastest
        Frames per second up to which the window keeps its length.

    Raises
    ------
    ValueError
        Seconds, width or fastest is not positive, or seconds not finite.
    """

    def __init__(self, seconds: float, width: int, fastest: float = FASTEST_FEED) -> None:
        if not (math.isfinite(seconds) and seconds > 0):
            raise ValueError(f"seconds: expected a positive number, got {seconds}")
        if width < 1 or fastest <= 0:
            raise ValueError(f"width, fastest: expected positive numbers, got {width}, {fastest}")
        self.seconds = seconds
        self._most = max(2, math.ceil(seconds * fastest))
        # Twice what may have to be kept, so that moving back never overlaps. The system commits only what is touched:
        # a slow feed does not pay for a fast one's room.
        room = 2 * (self._most + 2 * MOST_PENDING)
        self._rows = _reserved(room, width)
        self._times = np.empty(room)
        self.clear()

    def clear(self) -> None:
        """Forget all rows, as at the start; what had left or entered is forgotten with them."""
        self._kept = self._start = self._fresh = self._end = 0
        # Plain numbers beside the array: to look one up in it takes as long as all the rest of a push.
        self._since = self._oldest = math.nan
        self._newest = -math.inf

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in rows, all at once as if one by one, and let go of those that are `seconds` old.

        Parameters
        ----------
        times
            When each was, seconds; every one later than the one before.
        rows
            Shape (rows, width).

        Raises
        ------
        ValueError
            A time is not later than the one before, or there are more rows or fewer than times. None is taken in.
        RuntimeError
            More than `MOST_PENDING` rows would have entered since `take_change` was last called. None is taken in.
        """
        count = len(times)
        if len(rows) != count:
            raise ValueError(f"rows: expected {count}, as many as times, got {len(rows)}")
        newest = self._newest
        for time in times:
            if time <= newest:
                raise ValueError(f"time: expected later than {newest}, got {time}")
            newest = time
        if self._end - self._fresh + count > MOST_PENDING:
            raise RuntimeError(f"take_change() must be called at least once in {MOST_PENDING} rows")
        if not count:
            return
        if self._kept >= self._end - self._kept + MOST_PENDING:
            self._move_back()
        begin, self._end = self._end, self._end + count
        if begin == self._start:
            self._since = self._oldest = times[0]
        self._rows[begin : self._end] = rows
        self._times[begin : self._end] = times
        self._newest = newest
        self._let_go(newest - (self.seconds - _TIE))

    def _let_go(self, too_old: float) -> None:
        start, oldest, last = self._start, self._oldest, self._end - 1
        # Times in other units may be so large that even the newest is not above `too_old`.
        while start < last and (oldest <= too_old or last - start >= self._most):
            start += 1
            oldest = self._times.item(start)
        self._start, self._oldest = start, oldest

    def _move_back(self) -> None:
        count, shift = self._end - self._kept, self._kept
        self._rows[:count] = self._rows[shift : self._end]
        self._times[:count] = self._times[shift : self._end]
        self._kept, self._start, self._fresh, self._end = (
            place - shift for place in (self._kept, self._start, self._fresh, self._end)
        )

    @property
    def pending(self) -> int:
        """How many rows entered since the changes were last taken."""
        return self._end - self._fresh

    def take_change(self) -> Change:
        """Say what entered and what left since the last call; a row that did both is in neither."""
        fresh = max(self._fresh, self._start)
        change = Change(self._rows[fresh : self._end], self._rows[self._kept : min(self._start, self._fresh)])
        self.pass_over_change()
        return change

    def pass_over_change(self) -> None:
        """Go on as if the change had been taken, for who looks at the rows alone."""
        self._kept, self._fresh = self._start, self._end

    @property
    def rows(self) -> NDArray[np.float64]:
        """The rows in the window, shape (rows, width), oldest first; a view, good until the next push.

        Each row is contiguous and begins with a cache line.
        """
        return self._rows[self._start : self._end]

    def last(self, seconds: float) -> NDArray[np.float64]:
        """Give the rows that a window of fewer seconds would hold, shape (rows, width): a view likewise."""
        if seconds >= self.seconds:
            return self.rows
        times = self._times[self._start : self._end]
        begin = int(times.searchsorted(self._newest - (seconds - _TIE), side="right"))
        return self._rows[self._start + min(begin, len(times) - 1) : self._end]

    @property
    def times(self) -> NDArray[np.float64]:
        """Their times, shape (rows,), seconds; a view, good until the next push."""
        return self._times[self._start : self._end]

    @property
    def full(self) -> bool:
        """Whether rows have come for the window's whole length since it was last empty."""
        return self._newest - self._since >= self.seconds - _TIE

    def __len__(self) -> int:
        return self._end - self._start


def _reserved(rows: int, width: int) -> NDArray[np.float64]:
    """Reserve memory of which only the pages that are touched are ever committed.

    An array of numpy's own above 4 MB asks for pages of 2 MB on Linux, and for a hundred performers the difference to
    small ones is 70 MB.
    """
    stride = numbers_per_row(width)
    size = rows * stride * np.dtype(np.float64).itemsize
    try:
        memory = mmap.mmap(-1, size)
    except (OSError, OverflowError) as error:
        raise MemoryError(f"expected room for {rows} rows of {width} numbers, {size} bytes") from error
    if hasattr(mmap, "MADV_NOHUGEPAGE"):
        # A kernel built without large pages refuses, and has no need of it.
        with suppress(OSError):
            memory.madvise(mmap.MADV_NOHUGEPAGE)
    # Memory of the system's begins with a page, so that every row begins with a cache line.
    return np.frombuffer(memory, dtype=np.float64).reshape(rows, stride)[:, :width]
