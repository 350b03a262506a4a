"""The motions that performers were said to do: a person confirms the last one, or says that it was wrong."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from kinespace.library.teaching.movement import Stretch
from kinespace.stream.recognition import Event, EventKind
from kinespace.stream.teaching.commands import MAX_LAST

#: Seconds from a motion's first movement to its start event, at most: what lies before is another motion.
_BEFORE = 0.8
#: Seconds that a person needs to see a start event: what is said sooner is said about the motion before.
_REACTION = 0.4
#: Seconds before and after a motion that was named wrongly, which must not be named, either.
_AROUND = 1.5


@dataclass(slots=True)
class NamedMotion:
    """A motion that was named.

    Attributes
    ----------
    class_name
        Its class.
    started, ended
        The times of its events, seconds on the sender's clock; no end while it goes on.
    after, until
        The end of the motion before, and the beginning of the next one.
    number
        The number of the example that it became; 0 for none.
    is_right
        Whether it was right, while it is to be taken when it has ended.
    """

    class_name: str
    started: float
    ended: float | None = None
    after: float = -float("inf")
    until: float = float("inf")
    number: int = 0
    is_right: bool = False

    def span(self, newest: float) -> Stretch:
        """Give the time in which it was performed, `MAX_LAST` seconds at most; `newest` is the time of the last frame.

        A motion is named when a part of it was seen, so it began before. Stillness in the span is still to be trimmed.
        """
        end = newest if self.ended is None else self.ended
        return Stretch(max(self.started - _BEFORE, self.after, end - MAX_LAST), end)

    def around(self, newest: float) -> Stretch:
        """Give the time of a motion that nobody did, as far as it was seen, and what surrounds it; as `span`."""
        end = min(newest, self.until, math.inf if self.ended is None else self.ended + _AROUND)
        return Stretch(max(self.started - _AROUND, self.after, end - MAX_LAST), end)


class NamedMotions:
    """Keeps the last two named motions of each performer."""

    def __init__(self) -> None:
        self._motions: dict[str, list[NamedMotion]] = {}

    def push(self, event: Event) -> None:
        """Take in the start or the end of a motion."""
        # The performer whose motion was named last comes last.
        motions = self._motions.pop(event.performer, [])
        self._motions[event.performer] = motions
        if event.kind is EventKind.START:
            after = motions[-1].ended if motions else None
            for before in motions[-1:]:
                before.until = max(event.time - _BEFORE, before.started if after is None else after)
            begun = NamedMotion(event.label, event.time, after=-float("inf") if after is None else after)
            # A sender's clock that begins again knows no motion before.
            self._motions[event.performer] = [*motions[-1:], begun]
        elif motions and motions[-1].class_name == event.label:
            motions[-1].ended = event.time

    def last(self, performer: str, present: Collection[str]) -> str | None:
        """Give the performer who is meant: without a name the one, of those present, whose motion was named last."""
        if performer:
            return performer if performer in present else None
        return next((name for name in reversed(self._motions) if name in present), None)

    def meant(self, performer: str, newest: float) -> NamedMotion | None:
        """Give the motion of a performer that a person speaks of now; None where none was named."""
        motions = self._motions.get(performer, [])
        if len(motions) > 1 and newest - motions[-1].started < _REACTION:
            return motions[-2]
        return motions[-1] if motions else None

    def confirmed(self, performer: str, newest: float) -> NamedMotion | None:
        """Give a motion that was right and is over, or has gone on for as long as an example may last."""
        for motion in self._motions.get(performer, ()):
            is_over = motion.ended is not None or newest - motion.started >= MAX_LAST
            if motion.is_right and is_over:
                return motion
        return None

    def forget(self, performer: str) -> None:
        """Forget a performer."""
        self._motions.pop(performer, None)
