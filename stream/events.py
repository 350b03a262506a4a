"""From the moment's guess to events: a motion starts, a motion ends, once each, without flicker.

The guess changes with every doubtful window, above all at a change of motion. An event waits until one class has led
without a break for long enough: its lead, in the logarithm of the distance, is added up hop by hop, so that a clear
lead is believed soon and a doubtful one late. Having no class to name, for stillness or an unknown movement, adds up
likewise, at a steady pace, slower for the unknown: a motion that goes on may look strange for a moment, and nobody
stands still by chance.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from stream.recognition import Event, EventKind, Outcome

if TYPE_CHECKING:
    from stream.recognition import Recognition

#: Added to distances before the logarithm: how near two windows are once they are alike is no matter here.
_ALIKE = 0.3
#: Seconds of stillness, and of what is unknown or ambiguous, after which a motion has ended.
_ENDED_AFTER = {Outcome.STILL: 0.4, Outcome.UNKNOWN: 0.8, Outcome.AMBIGUOUS: 0.4}
#: Longest time between two recognitions that counts, seconds: who was away has not led meanwhile.
_LONGEST_HOP = 0.1
_PER_SECOND = 30.0


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
        self._active: Event | None = None
        self._leader = -1
        self._lead = 0.0
        self._last = math.nan

    @property
    def active(self) -> Event | None:
        """The start of the motion now going on; None when there is none."""
        return self._active

    def push(self, recognition: Recognition) -> tuple[Event, ...]:
        """Take in the next recognition; give what it made happen: nothing, an end, a start, or an end and a start."""
        elapsed = recognition.time - self._last
        self._last = recognition.time
        if not 0 <= elapsed <= _LONGEST_HOP:
            elapsed = _LONGEST_HOP if elapsed > 0 else 0.0
        leader = recognition.class_index
        if leader != self._leader:
            self._leader, self._lead = leader, 0.0
        self._lead += self._gained(recognition, leader) * elapsed
        current = self._active.index if self._active else -1
        return self._changed(recognition) if leader != current and self._lead >= self._needed else ()

    def end(self, time: float) -> Event | None:
        """End the motion that is going on, at a time in seconds; None when none is."""
        begun, self._active = self._active, None
        self._leader, self._lead, self._last = -1, 0.0, math.nan
        return replace(begun, kind=EventKind.END, time=time) if begun else None

    def _gained(self, recognition: Recognition, named: int) -> float:
        """Say how much lead a second like this one, with this class named, gathers."""
        if named < 0:
            return self._needed / _ENDED_AFTER[recognition.outcome]
        others = recognition.scores.tolist()
        # A library's only class has no other to lead: it starts at the pace at which stillness ends it.
        if len(others) == 1:
            return self._needed / _ENDED_AFTER[Outcome.STILL]
        score = others.pop(named)
        lead = _distance(max(others)) - _distance(score)
        return _PER_SECOND * max(lead, 0.0)

    def _changed(self, recognition: Recognition) -> tuple[Event, ...]:
        events = [self._event(EventKind.END, recognition, self._active.index)] if self._active else []
        self._active = None
        if recognition.class_index >= 0:
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


def _distance(score: float) -> float:
    """Logarithm of the distance that a score stands for."""
    return math.log(1 / max(score, 1e-9) - 1 + _ALIKE)
