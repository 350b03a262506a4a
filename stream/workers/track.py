"""One performer as the gateway knows it: the frames of the last seconds, which another worker may need."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import msgspec

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Event, Recognition
from kinespace.stream.recognizer.decision import Decision
from kinespace.stream.workers.wire import SentFrame

#: Seconds of frames that another worker is shown before those that it answers: the longest window.
HISTORY = 2.0
#: Seconds after which a frame that nobody has answered is only shown: it took so long until the worker was missed.
DUE = 1.5
#: Seconds after which the joints are sent again: a message may be lost.
_JOINTS_EVERY = 1.0


class Kept(NamedTuple):
    """A frame that was sent: its number among the performer's frames, when its packet came, and its message."""

    number: int
    arrival: float
    sent: SentFrame


@dataclass(slots=True)
class Track:
    """The frames of a performer that were sent to workers, and the answers that came back.

    Attributes
    ----------
    newest, heard
        When the newest frame came, and when an answer; before the first answer when the performer came.
    decision
        Gives the events: only the gateway knows of all answers, so that each motion starts and ends once.
    worker
        The worker that answers; empty for none.
    number, answered
        The numbers of the newest frame and of the last one answered; 0 for none.
    """

    newest: float
    heard: float
    decision: Decision
    worker: str = ""
    number: int = 0
    answered: int = 0
    _answered_at: float = 0.0
    _joints: tuple[str, ...] | None = None
    _joints_due: float = 0.0
    _kept: deque[Kept] = field(default_factory=deque)

    def send(self, frame: Frame, joints: tuple[str, ...] | None) -> SentFrame:
        """Make the message of the newest frame; it has the joints from time to time."""
        sent, now = SentFrame.of(frame), self.newest
        if joints != self._joints or now >= self._joints_due:
            sent.joints, self._joints, self._joints_due = joints, joints, now + _JOINTS_EVERY
        sent.begins = not self.number
        self.number += 1
        self._kept.append(Kept(self.number, now, sent))
        while self._kept[0].arrival < now - HISTORY - DUE:
            self._kept.popleft()
        return sent

    def accept(self, answer: Recognition, classes: Sequence[str]) -> tuple[Recognition, float] | None:
        """Take in an answer; give it with its events, and the arrival of its frame.

        Parameters
        ----------
        answer
            The answer of the performer's worker.
        classes
            The classes now; an answer by others, after an exchange, starts no motion.

        Returns
        -------
        None for an answer that is no news: its frame was answered before, or is unknown.
        """
        for kept in reversed(self._kept):
            if kept.number <= self.answered:
                return None
            if kept.sent.time == answer.time:
                break
        else:
            return None
        self.answered, self._answered_at, self.heard = kept.number, kept.arrival, self.newest
        decide = self.decision.events if answer.classes == classes else self.decision.ends
        return replace(answer, events=decide(answer)), kept.arrival

    def is_owed(self, hop: float) -> bool:
        """Whether a frame that was sent will still be answered."""
        return bool(self.answered) and self.newest - self._answered_at >= hop

    def end(self) -> Event | None:
        """End the motion that goes on."""
        return self.decision.end(self._kept[-1].sent.time) if self._kept else None

    def exchange(self, classes: Sequence[str], lead: float) -> Event | None:
        """Go on with other classes, and the lead that they need; end the motion that goes on if its class is gone."""
        begun = self.decision.going_on
        ended = self.end() if begun and begun.label not in classes else None
        begun = self.decision.going_on
        self.decision = Decision(lead, begun and replace(begun, index=classes.index(begun.label)))
        return ended

    def past(self, joints: tuple[str, ...] | None, now: float) -> tuple[list[SentFrame], list[SentFrame]]:
        """Give the frames that another worker is shown, and those that it answers."""
        since = self._answered_at - HISTORY if self.answered else 0.0
        kept = [each for each in self._kept if each.arrival >= since]
        seen = [each.sent for each in kept if each.number <= self.answered or each.arrival < now - DUE]
        due = [each.sent for each in kept[len(seen) :]]
        for first in (seen or due)[:1]:
            (seen or due)[0] = msgspec.structs.replace(first, begins=True, joints=joints)
        return seen, due
