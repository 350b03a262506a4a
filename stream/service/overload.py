"""Overload: while the service cannot keep up, frames wait for their performer's turn, and the oldest make room."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import islice
from typing import NamedTuple

from kinespace.stream.frame import Admitted, Frame
from kinespace.stream.inputs.source import APART

#: Seconds for which a packet may wait before it is taken in. When one waited longer, all that wait are taken in, and
#: performers are answered by turns, each by its newest frame.
LATE = 0.15
#: Seconds after which a frame is dropped unread then.
PATIENCE = 0.2
#: Packets that are all answered, even late: no more than wait when the machine has hesitated. And seconds after which
#: not even these are: listeners would take the past for the present.
MAX_HESITATION = 64
MAX_AGE = 1.0
#: Seconds for which turns go on after a late packet: else the loop would fall behind again at once.
CAUTION = 1.0
#: Frames of a performer that wait for its turn, at most: as many seconds as an answer needs.
MAX_WAITING = 24
#: Performers that wait for their turns, at most; only a program that makes up names reaches the limit.
MAX_PERFORMERS = 1024


class Taken(NamedTuple):
    """A frame or announcement; when its packet was looked at, and for how long it had waited then, seconds."""

    event: Admitted
    started: float
    waited: float


class Overload:
    """What waits for each performer's turn.

    Attributes
    ----------
    until
        Until when performers are answered by turns, seconds on the service's clock; inf while some wait.
    stale
        Frames that were dropped while they waited.
    """

    def __init__(self) -> None:
        self.until = self._cautious_until = -math.inf
        self.stale = 0
        #: The performer who is to be answered first stands first; for some nothing waits.
        self._waiting: dict[str, list[Taken]] = {}

    def keep(self, all_taken: Iterable[Taken], now: float, *, is_late: bool = False) -> None:
        """Keep frames and announcements until their performers' turns; `is_late`: one had waited for too long."""
        if is_late:
            self._cautious_until = now + CAUTION
        for taken in all_taken:
            name = taken.event.performer
            if name in self._waiting or len(self._waiting) < MAX_PERFORMERS:
                self._add(self._waiting.setdefault(name, []), taken)
            else:
                self.stale += 1
        self.until = math.inf if self._waiting else self._cautious_until

    def _add(self, waiting: list[Taken], taken: Taken) -> None:
        """Add to what waits for a performer; keep the newest frame, and of those before as many as windows need."""
        if len(waiting) > 1 and _apart(waiting[-2], taken) < APART and _apart(waiting[-1], taken) < APART:
            del waiting[-1]
            self.stale += 1
        waiting.append(taken)
        if len(waiting) > MAX_WAITING:
            del waiting[next((place for place, each in enumerate(waiting) if isinstance(each.event, Frame)), 0)]
            self.stale += 1

    def turns(self, most: int) -> list[Taken]:
        """Give all that waits for the performers who have waited for longest, in order; they wait no more."""
        names = [*islice((name for name, waiting in self._waiting.items() if waiting), most)]
        taken = [each for name in names for each in self._waiting.pop(name)]
        if len(self._waiting) + most >= MAX_PERFORMERS or not any(self._waiting.values()):
            self._waiting = {name: waiting for name, waiting in self._waiting.items() if waiting}
        # They keep their places: whoever had a turn comes behind all others, whose frames came earlier or later.
        self._waiting.update((name, []) for name in names if self._waiting)
        self.until = math.inf if self._waiting else self._cautious_until
        return taken


def _apart(before: Taken, after: Taken) -> float:
    """Give the seconds from one frame to another; inf where one is an announcement."""
    first, last = before.event, after.event
    return abs(last.time - first.time) if isinstance(first, Frame) and isinstance(last, Frame) else math.inf
