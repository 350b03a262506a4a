"""The one hysteresis of guess and event: a class must gather a lead before it takes over.

Each hop the class in front gains its lead over the others, in log distance times thirtieths of a second; when another
class comes to the front the count begins anew. A clear lead takes over at once, a doubtful one takes a moment. The
guess needs little (`LEAD`), a start event more (`Settings.lead`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

#: The lead after which a class becomes the guess.
LEAD = 0.6
#: Seconds over which the evidence for a known motion is averaged.
_KNOWN_OVER = 0.3
#: The evidence for a named motion may fall this much below the threshold; without this margin a motion at the threshold
#: would flicker.
_HELD = 1.5
#: The unit of leads: log distance times a thirtieth of a second.
PER_SECOND = 30.0


class Hysteresis:
    """Follows which of several indices has been in front for long enough.

    Parameters
    ----------
    needed
        Lead after which an index takes over.

    Attributes
    ----------
    current
        The index that took over last; None before the first.
    """

    def __init__(self, needed: float) -> None:
        self._needed = needed
        self.clear()

    def clear(self) -> None:
        """Forget everything, as at the start."""
        self.current: int | None = None
        self._leader: int | None = None
        self._lead = 0.0

    def exchange(self, places: Mapping[int, int], needed: float | None = None) -> None:
        """Go on with indices at other places, and perhaps another lead; forget indices without a place."""
        self._needed = self._needed if needed is None else needed
        self.current = None if self.current is None else places.get(self.current)
        leader = None if self._leader is None else places.get(self._leader)
        self._leader, self._lead = leader, 0.0 if leader is None else self._lead

    def push(self, leader: int, pace: float, elapsed: float) -> bool:
        """Take in which index is in front.

        Parameters
        ----------
        leader
            The index in front.
        pace
            Its lead in log distance.
        elapsed
            Seconds for which the lead counts.

        Returns
        -------
        Whether the index took over now.
        """
        if leader != self._leader:
            self._leader, self._lead = leader, 0.0
        self._lead += pace * elapsed * PER_SECOND
        if leader == self.current or self._lead < self._needed:
            return False
        self.current = leader
        return True


class Judgement:
    """Whether the guess is known: averaged evidence against a threshold, which is lower for a named motion.

    Parameters
    ----------
    threshold
        Evidence, as a logit (`library.windows.rejection`), from which a guess is known.

    Attributes
    ----------
    average
        The averaged evidence; NaN before the first.
    """

    def __init__(self, threshold: float) -> None:
        self._threshold = threshold
        self.clear()

    def clear(self) -> None:
        """Forget everything, as at the start."""
        self.average = math.nan
        self._known = False

    def exchange(self, threshold: float) -> None:
        """Go on with another threshold."""
        self._threshold = threshold

    def push(self, logit: float, elapsed: float) -> bool:
        """Take in the evidence of the newest window, so many seconds after the last; say whether the guess is known."""
        if math.isnan(self.average):
            self.average = logit
        self.average -= math.expm1(-elapsed / _KNOWN_OVER) * (logit - self.average)
        self._known = self.average >= self._threshold - (_HELD if self._known else 0.0)
        return self._known
