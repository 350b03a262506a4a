"""Motions that were really done: windows that end now against whole motions of the library.

Five times a second the body's last points are compared, by windows of several lengths, with every whole motion
(`library.windows.whole_motions`). The most evident class and length gain evidence where the recogniser guessed, or
named, the class meanwhile: its windows are shorter than most motions and see other things in them. They wait for a
moment: when nothing more evident follows, the motion was done. The next motion may begin where this one ended.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import defaultdict, deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library.motion_library import NOTHING
from kinespace.library.windows.whole_motions import STEP

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.library.windows.whole_motions import Judged, WholeMotions
    from kinespace.stream.recognizer.windows.live_windows import Sizes

#: Steps from one look to the next: looking at every step finds no more motions at the same false alarms.
_LOOKS_EVERY = 3
#: Seconds for which a motion waits for one that is more evident.
_WAITS = 0.2
#: The share of a motion that may overlap with the motion before: with more, one round is counted twice.
_OVERLAPS = 0.15
#: The share of a motion, at its beginning, whose guesses do not count: the recogniser's windows hold the motion before.
_UNSURE = 0.3
#: Tolerance, as a share of a step, because times are rounded.
_ROUNDING = 1e-3
#: The memory is moved back each time so many windows' points have come.
_ROOM = 4


class Found(NamedTuple):
    """A motion that was done: its class, begin and end in seconds, the judgement, and how far above the limit it is."""

    class_name: str
    start: float
    end: float
    judged: Judged
    above: float


class DoneFollower:
    """Finds the motions that one performer has done.

    Parameters
    ----------
    whole
        The library's whole motions.
    false_alarms
        Motions an hour that may be found though they were not done.

    Attributes
    ----------
    time
        The time of the newest step, seconds; NaN before the first.
    """

    def __init__(self, whole: WholeMotions, false_alarms: float) -> None:
        self._false_alarms = false_alarms
        self.exchange(whole)

    def exchange(self, whole: WholeMotions) -> None:
        """Find the motions of another library from now on."""
        self._whole, self._limit = whole, whole.limit_at(self._false_alarms)
        self._longest = whole.lengths[-1] if whole.lengths else 0
        room = _ROOM * self._longest
        self._points, self._sizes = np.zeros((room, len(whole.spreads))), np.zeros(room)
        if self._longest:
            self._judge, self._judgements = whole.judging(self._points, self._sizes)
        self._seconds = [(count - 1) * STEP for count in whole.lengths]
        self._waiting: Found | None = None
        self.clear()

    def clear(self) -> None:
        """Forget the body's past; a motion that waits is said when the body is seen again."""
        self._count, self.time, self._over = 0, math.nan, -math.inf
        # What the latest looks guessed, and the evidence that it gains.
        self._guesses = deque[tuple[str, float]](maxlen=max(self._longest, 1))

    def is_due(self, time: float) -> bool:
        """Whether a look is due at a time, seconds."""
        return not time - self.time < (_LOOKS_EVERY - _ROUNDING) * STEP

    def guessed(self, class_name: str, *, is_named: bool) -> None:
        """Take in the recogniser's guess, and whether it is known, for the positions that come next."""
        guessed, named = self._whole.support
        self._guesses.append((class_name, guessed + named * is_named))

    def push_all(self, times: NDArray[np.float64], points: NDArray[np.float64], size_of: Sizes) -> Found | None:
        """Take in the body's positions.

        Parameters
        ----------
        times
            Seconds, on the clock of the frames, from `time` on where that is known; shape (points,).
        points, size_of
            The body in the library's basis, shape (points, directions), and a function from places to its size there.

        Returns
        -------
        The motion that was done; None where none is found now.
        """
        if not self._longest:
            return None
        newest = times.item(-1)
        if not newest - self.time < self._longest * STEP:
            # At the beginning, and after a gap.
            self.clear()
            self.time = max(times.item(-min(self._longest, len(times))), newest - self._longest * STEP) - STEP
        steps = int((newest - self.time) / STEP + _ROUNDING)
        if steps < 1:
            return None
        # The first frame from each step on.
        at = self.time + STEP * (np.arange(1, steps + 1) - _ROUNDING)
        places = np.minimum(times.searchsorted(at), len(times) - 1)
        self._extend(points[places], size_of(places))
        self.time += steps * STEP
        return self._look()

    def look_back(self, times: NDArray[np.float64], points: NDArray[np.float64], size_of: Sizes) -> None:
        """Look at the last positions before a gap; a motion that was done waits. The arguments are as in `push_all`."""
        if len(times) and not math.isnan(self.time):
            self._waiting = self.push_all(times, points, size_of) or self._waiting

    def _extend(self, points: NDArray[np.float64], sizes: NDArray[np.float64]) -> None:
        """Keep some more points."""
        if self._count + len(points) > len(self._points):
            for kept in (self._points, self._sizes):
                kept[: self._longest] = kept[self._count - self._longest : self._count]
            self._count = self._longest
        some = slice(self._count, self._count + len(points))
        self._points[some], self._sizes[some], self._count = points, sizes, some.stop

    def _look(self) -> Found | None:
        """Compare the windows that end now."""
        now = self.time
        if self._waiting and not 0 <= now - self._waiting.end < 2 * _WAITS:
            # The body is seen again after a gap, or the sender's clock began again.
            return self._said()
        self._judge(self._count)
        waiting = self._waiting
        least = waiting.above if waiting else 0.0
        # A window must lie behind the motion before.
        free = bisect_right(self._seconds, (now - self._over) / (1 - _OVERLAPS) + _ROUNDING)
        without = self._judgements[0, :free] - self._limit
        length, place = divmod(int(without.argmax()) if free else 0, len(self._limit))
        # Guesses are counted only where they may decide.
        if free and without.item(length, place) > least - sum(self._whole.support):
            name = self._whole.classes[place]
            above = without.item(length, place) + self._support(name, length)
            if above > least:
                judged = self._whole.judged(self._judgements, length, place)
                waiting = Found(name, now - self._seconds[length], now, judged, above)
        self._waiting = waiting
        return self._said() if waiting and now - waiting.end >= _WAITS - _ROUNDING else None

    def _support(self, class_name: str, length: int) -> float:
        """Give what a class gains by the guesses in a window, the mean over its looks."""
        looks = math.ceil((self._whole.lengths[length] - 1) * (1 - _UNSURE) / _LOOKS_EVERY)
        counting, gains = list(self._guesses)[-looks:], defaultdict[str, float](float)
        for guess, gain in counting:
            gains[guess] += gain
        # The recogniser never guesses `nothing`: it takes the place of any class.
        gained = max(gains.values(), default=0.0) if class_name == NOTHING else gains[class_name]
        return gained / max(len(counting), 1)

    def _said(self) -> Found | None:
        """Give the motion that waits, unless it is like an example of nothing."""
        said, self._waiting = self._waiting, None
        self._over = min(said.end, self.time) if said else self._over
        return said if said and said.class_name != NOTHING else None
