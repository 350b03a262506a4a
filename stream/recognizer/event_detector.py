"""From the moment's guess to events: a motion starts, a motion ends, once each, without flicker.

The guess changes with every doubtful window, above all at a change of motion. An event waits until one named class has
gathered its lead (`stream.recognizer.hysteresis`). While no class is named, because the body stands still or the
movement is unknown, "no class" gathers lead at a steady pace: slowly for the unknown, because a motion that goes on may
look strange for a moment, and faster for stillness, which never comes by chance. At a pause in the feed the recogniser
ends the motion.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from kinespace.stream.recognition import Event, EventKind, Outcome
from kinespace.stream.recognizer.hysteresis import PER_SECOND, Hysteresis

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kinespace.stream.recognition import Recognition

#: Seconds of stillness, and of unknown, ambiguous or implausible movement, after which a motion has ended.
_ENDED_AFTER = {Outcome.STILL: 0.4, Outcome.UNKNOWN: 0.8, Outcome.AMBIGUOUS: 0.4, Outcome.IMPLAUSIBLE: 0.8}
#: A pause between two recognitions that is longer counts as this long (seconds), so that a gap in the feed does not
#: add evidence.
_MAX_HOP = 0.1
#: Lead, in log distance, at which a class gathers fastest.
_MAX_PACE = 1.0
#: The index that stands for "no class".
_NONE = -1


class EventDetector:
    """Turns one performer's recognitions into events.

    Parameters
    ----------
    lead
        Lead in log distance, times thirtieths of a second, that a class must gather. More is later and surer.

    Raises
    ------
    ValueError
        The lead is negative or not finite.
    """

    def __init__(self, lead: float = 3.0) -> None:
        if not (math.isfinite(lead) and lead >= 0):
            raise ValueError(f"lead: expected a number not below 0, got {lead}")
        self._needed = lead
        self._hysteresis = Hysteresis(lead)
        self._active: Event | None = None
        self._last = math.nan

    @property
    def going_on(self) -> Event | None:
        """The start of the motion that goes on; None when no motion goes on."""
        return self._active

    def push(self, recognition: Recognition) -> tuple[Event, ...]:
        """Take in the next recognition; give the events it causes: none, an end, a start, or an end and a start."""
        elapsed = recognition.time - self._last
        self._last = recognition.time
        if not 0 <= elapsed <= _MAX_HOP:
            elapsed = _MAX_HOP if elapsed > 0 else 0.0
        named = recognition.class_index
        if not self._hysteresis.push(named, self._pace(recognition, named), elapsed):
            return ()
        return self._changed(recognition)

    def end(self, time: float) -> Event | None:
        """End the motion that is going on, at a time in seconds; None when none is."""
        begun, self._active = self._active, None
        self._hysteresis.clear()
        self._last = math.nan
        return replace(begun, kind=EventKind.END, time=time) if begun else None

    def exchange(self, places: Mapping[int, int], time: float, lead: float) -> Event | None:
        """Go on with classes at other indices and another lead; end the motion that goes on if its class is gone.

        Parameters
        ----------
        places
            The new index of each class that stays.
        time
            Seconds, the time of an end.
        lead
            As in the constructor.
        """
        self._needed = lead
        active = self._active
        if active and active.index not in places:
            return self.end(time)
        self._active = active and replace(active, index=places[active.index])
        self._hysteresis.exchange({**places, _NONE: _NONE}, lead)
        return None

    def _pace(self, recognition: Recognition, named: int) -> float:
        """Say how fast this recognition gathers lead, in log distance."""
        if named == _NONE:
            return self._needed / (_ENDED_AFTER[recognition.outcome] * PER_SECOND)
        return min(max(recognition.lead, 0.0), _MAX_PACE)

    def _changed(self, recognition: Recognition) -> tuple[Event, ...]:
        events = [self._event(EventKind.END, recognition, self._active.index)] if self._active else []
        self._active = None
        if recognition.class_index != _NONE:
            self._active = self._event(EventKind.START, recognition, recognition.class_index)
            events.append(self._active)
        return tuple(events)

    @staticmethod
    def _event(kind: EventKind, recognition: Recognition, index: int) -> Event:
        return Event(
            performer=recognition.performer,
            kind=kind,
            label=recognition.classes[index],
            index=index,
            score=float(recognition.scores[index]),
            time=recognition.time,
        )
