"""A worker: frames in, recognitions out, for the performers of its partitions. No socket, clock, thread or process.

With a performer whom it takes over, a worker gets the frames of the last seconds. The recogniser sees them first, so
that its windows and averages equal the former worker's. Then the worker answers the frames that nobody has answered.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from kinespace.stream.frame import Announcement, NewSender
from kinespace.stream.recognition import EventKind
from kinespace.stream.recognizer.decision import Decision
from kinespace.stream.recognizer.limits import needed_lead
from kinespace.stream.recognizer.recognizer import RecognizerCounts
from kinespace.stream.workers.wire import Answered, Entry, Report, answered

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.recognizer import Performers
    from kinespace.stream.workers.wire import SentFrame
    from kinespace.stream.zeromq.frames import NumberedFrame

#: Seconds of frames with which a performer is taken over. The longest window is two seconds; then the averages must
#: forget the first, short windows (`kinespace bench scale` counts the events that differ).
HISTORY = 2.5
#: Seconds of frames with which the recogniser of a performer who is taken over compares windows before it answers: the
#: windows before are shorter than the former worker's, and would only mislead its averages.
_COMPARED = 1.0
#: Seconds of frames that are kept: a worker may have hung unnoticed for a while since its last answer.
KEPT = HISTORY + 1.5


class Worker:
    """Recognises the performers that it is sent.

    Parameters
    ----------
    performers
        The recognisers.
    """

    def __init__(self, performers: Performers) -> None:
        self.performers = performers
        #: The number of the terms by which it answers.
        self.terms = 0
        self._newest: dict[str, int] = {}
        #: Performers whose frames are not answered yet.
        self._warming: set[str] = set()
        #: The start of the motion that a performer's recogniser follows.
        self._found: dict[str, Event] = {}
        #: Gives the events of a performer who was taken over, until the recogniser follows the motion that listeners
        #: believe to go on: its first windows were short, and may have shown motions of which no listener knows.
        self._decisions: dict[str, Decision] = {}
        #: Performers whose next answer must say which joints carry it.
        self._asked: set[str] = set()
        #: Counts of the frames of warming up, which the former worker has counted, too.
        self._warmed = RecognizerCounts()

    def take_over(self, entries: Sequence[Entry], now: float) -> None:
        """Begin with performers of another worker; their last frames come next, and are not answered."""
        for entry in entries:
            self._begin(entry.performer)
            self._warming.add(entry.performer)
            if entry.joints:
                self.performers.announce(Announcement(entry.performer, entry.joints), now)
            if entry.answered:
                self.performers.only_follow(entry.performer, entry.time - _COMPARED, now)
            if entry.long_ago:
                self.performers.go_on(entry.performer, entry.long_ago.of_the_body, now)

    def go_on(self, entries: Sequence[Entry], now: float) -> None:
        """Answer the frames of performers from now on, as their former worker would."""
        for entry in entries:
            name = entry.performer
            self._warming.discard(name)
            if entry.answered:
                self.performers.keep_time_with(name, entry.time)
                lead = needed_lead(self.performers.library, self.performers.settings)
                self._decisions[name] = Decision(lead, entry.going_on)
            if entry.long_ago:
                self.performers.go_on(name, entry.long_ago, now)

    def _begin(self, performer: str) -> None:
        self.performers.push_all([NewSender(performer)], 0.0)
        self._forget(performer)

    def _forget(self, performer: str) -> None:
        self._warming.discard(performer)
        for known in (self._newest, self._found, self._decisions):
            known.pop(performer, None)

    def push(self, frames: Sequence[tuple[SentFrame, NumberedFrame]], now: float) -> list[Answered]:
        """Take in frames in their order; give the answers to them. A frame that came before is passed over."""
        answers = []
        for sent, (frame, number, announced) in frames:
            name, seq = frame.performer, number or 0
            if sent.asks:
                self._asked.add(name)
            if sent.begins and (name not in self._warming or name in self._newest):
                self._begin(name)
            if seq <= self._newest.get(name, -1):
                continue
            self._newest[name] = seq
            if announced:
                self.performers.announce(announced, now)
            recognition = self.performers.push(frame, now)
            if name in self._warming:
                self._warmed.frames += 1
                self._warmed.hops += recognition is not None
            elif recognition:
                answers.append(self._answered(recognition, seq, sent.at))
            if recognition:
                self._follow(recognition)
        return answers

    def _follow(self, recognition: Recognition) -> None:
        for event in recognition.events:
            self._found.pop(recognition.performer, None)
            if event.kind is EventKind.START:
                self._found[recognition.performer] = event

    def _answered(self, recognition: Recognition, seq: int, at: float) -> Answered:
        name = recognition.performer
        answer = answered(recognition, seq, at, self.terms, self.performers.long_ago(name))
        if decision := self._decisions.get(name):
            if _label(decision.going_on) == _label(self._found.get(name)):
                del self._decisions[name]
            else:
                # Each motion starts and ends once.
                answer = msgspec.structs.replace(answer, events=decision.events(recognition))
        if name in self._asked:
            self._asked.discard(name)
            answer = msgspec.structs.replace(answer, carried=self.performers.carried(name))
        return answer

    def report(self, now: float) -> Report:
        """Forget silent performers, and give the counters."""
        performers = self.performers
        performers.drop_silent(now)
        for name in performers.take_gone():
            self._forget(name)
        counts = performers.counts
        counts.recognizers.add(self._warmed, -1)
        return Report(counts, performers.refused, performers.doubted, performers.compared)


def _label(event: Event | None) -> str:
    return event.label if event else ""
