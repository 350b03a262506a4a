"""From a moment's guess to events: a motion starts, a motion ends, once each, without flicker.

The moment's guess changes with every doubtful window, above all at a change of motion. An event waits until one class
has been named for most of the last moments, and lasts until another, or none, has.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stream.recognition import Recognition


class EventKind(StrEnum):
    """What happened."""

    START = "start"
    END = "end"


@dataclass(frozen=True, slots=True)
class Event:
    """A motion has started or ended.

    Attributes
    ----------
    performer
        Whose.
    kind
        Start or end.
    label, index
        Class name and index.
    score
        Of the recognition at which it was decided.
    time
        When it was decided, seconds, on the clock of the frames.
    """

    performer: str
    kind: EventKind
    label: str
    index: int
    score: float
    time: float


class EventDetector:
    """Turns one performer's recognitions into events.

    Parameters
    ----------
    dwell
        Seconds a class must prevail to start, and be missed to end.
    prevailing
        Share of the recognitions of those seconds that must agree, above a half.

    Raises
    ------
    ValueError
        The dwell is negative or not finite, or the share not above a half and at most 1.
    """

    def __init__(self, dwell: float = 0.3, prevailing: float = 0.7) -> None:
        if not (math.isfinite(dwell) and dwell >= 0):
            raise ValueError(f"dwell: expected seconds, not below 0, got {dwell}")
        if not 0.5 < prevailing <= 1:
            raise ValueError(f"prevailing: expected a share above 0.5, at most 1, got {prevailing}")
        self._dwell = dwell
        self._prevailing = prevailing
        self._recent = deque[tuple[float, int]]()
        self._active: Event | None = None

    @property
    def active(self) -> Event | None:
        """The start of the motion now going on; None when there is none."""
        return self._active

    def push(self, recognition: Recognition) -> tuple[Event, ...]:
        """Take in the next recognition and say what it made happen: nothing, an end, a start, or an end and a start."""
        now, named = recognition.time, recognition.class_index
        if self._recent and not now - self._recent[-1][0] >= 0:
            self._recent.clear()
        self._recent.append((now, named))
        while len(self._recent) > 1 and self._recent[1][0] <= now - self._dwell:
            self._recent.popleft()
        current = self._active.index if self._active else -1
        if named == current or now - self._recent[0][0] < self._dwell or not self._prevails(named):
            return ()
        return self._changed(recognition)

    def _prevails(self, index: int) -> bool:
        agreeing = sum(recent == index for _, recent in self._recent)
        return agreeing >= self._prevailing * len(self._recent)

    def _changed(self, recognition: Recognition) -> tuple[Event, ...]:
        ended = self._ended(recognition)
        self._active = None
        if recognition.class_name is not None:
            self._active = Event(
                performer=recognition.performer,
                kind=EventKind.START,
                label=recognition.class_name,
                index=recognition.class_index,
                score=recognition.score,
                time=recognition.time,
            )
        return (*ended, self._active) if self._active else ended

    def _ended(self, recognition: Recognition) -> tuple[Event, ...]:
        if self._active is None:
            return ()
        begun = self._active
        score = float(recognition.scores[begun.index])
        return (Event(begun.performer, EventKind.END, begun.label, begun.index, score, recognition.time),)
