"""A worker: frames in, recognitions out, for the performers of its partitions. No socket, clock, thread or process.

With a performer whom it takes over, a worker gets the frames of the last seconds. The recogniser sees them first, so
that its windows and averages equal the former worker's. It answers the frames that were not answered when the takeover
began; where the former worker goes on for a while, the receiving process keeps the first of two answers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec

from kinespace.stream.frame import NewSender
from kinespace.stream.recognition import EventKind
from kinespace.stream.recognizer.decision import needed_lead
from kinespace.stream.recognizer.event_detector import EventDetector
from kinespace.stream.recognizer.recognizer import RecognizerCounts
from kinespace.stream.workers.wire import Answered, Entry, Report, announcement, answered

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.frame import Frame
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.recognizer import Performers
    from kinespace.stream.recognizer.joints.doubts import LongAgo
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


class _Resumed(EventDetector):
    """A detector that begins with the motion that listeners believe to go on."""

    def __init__(self, lead: float, going_on: Event | None) -> None:
        super().__init__(lead)
        self._active = going_on
        self._hysteresis.current = going_on.index if going_on else None


@dataclass(slots=True)
class _TakenOver:
    """A performer until the new recogniser's events are those that listeners expect.

    The first windows of the frames that it takes over are short, and may show motions of which no listener was told.

    Attributes
    ----------
    answered, since
        The number of the last frame that was answered when the takeover began; frames that came before `since` are
        passed over.
    told
        The start of the last motion that listeners were told of.
    long_ago
        The former recogniser's knowledge of the feed; None if it had none, or once the new recogniser has it.
    found
        The start of the motion that the new recogniser follows.
    detector
        Gives the events, from the first answer that is sent.
    """

    answered: int
    since: float
    told: Event | None
    long_ago: LongAgo | None = None
    found: Event | None = None
    detector: _Resumed | None = None

    def follow(self, recognition: Recognition) -> None:
        """Take in an answer, whether it is sent or not."""
        for event in recognition.events:
            self.found = event if event.kind is EventKind.START else None

    def mend(self, recognition: Recognition, lead: float) -> tuple[Event, ...]:
        """Give the events that listeners must hear with an answer, so that each motion starts and ends once."""
        self.detector = self.detector or _Resumed(lead, self.told)
        self.follow(recognition)
        return self.detector.push(recognition)

    @property
    def agrees(self) -> bool:
        """Whether the recogniser follows the motion that listeners believe in."""
        told = self.detector.going_on if self.detector else self.told
        return (told and told.label) == (self.found and self.found.label)


class Worker:
    """Recognises the performers that it is sent.

    Parameters
    ----------
    performers
        The recognisers.
    """

    def __init__(self, performers: Performers) -> None:
        self.performers = performers
        #: The number of the list of classes with which it answers.
        self.book = 0
        self._newest: dict[str, int] = {}
        self._taken_over: dict[str, _TakenOver] = {}
        #: The start of the motion that goes on, of performers of whom one goes on.
        self._going_on: dict[str, Event] = {}
        #: Performers whose next answer must say which joints carry it, and which motion goes on.
        self._asked: set[str] = set()
        #: Counts of the frames of warming up, which the former worker has counted, too.
        self._warmed = RecognizerCounts()

    def take_over(self, entries: Sequence[Entry], now: float) -> None:
        """Begin with performers of another worker; their last frames come next."""
        for entry in entries:
            self._begin(entry.performer)
            if entry.answered:
                over = _TakenOver(entry.answered, entry.since, entry.going_on, entry.long_ago)
                self._taken_over[entry.performer] = over
                self._follow(entry.performer, (entry.going_on,) if entry.going_on else ())
            if announced := announcement(entry):
                self.performers.announce(announced, now)
            if entry.answered:
                self.performers.only_follow(entry.performer, entry.time - _COMPARED, now)
            if entry.long_ago:
                self.performers.go_on(entry.performer, entry.long_ago.of_the_body, now)

    def _begin(self, performer: str) -> None:
        self.performers.push_all([NewSender(performer)], 0.0)
        self._forget(performer)

    def _forget(self, performer: str) -> None:
        for known in (self._newest, self._taken_over, self._going_on):
            known.pop(performer, None)

    def _follow(self, performer: str, events: Sequence[Event]) -> None:
        for event in events:
            self._going_on.pop(performer, None)
            if event.kind is EventKind.START:
                self._going_on[performer] = event

    def push(self, frames: Sequence[tuple[SentFrame, NumberedFrame]], now: float) -> list[Answered]:
        """Take in frames in their order; give the answers to them. A frame that came before is passed over."""
        answers = []
        for sent, (frame, number, announced) in frames:
            name, seq = frame.performer, number or 0
            if sent.asks:
                self._asked.add(name)
            over = self._taken_over.get(name)
            known = over is not None and seq <= over.answered
            if sent.anew and not known:
                self._begin(name)
                over = None
            if seq <= self._newest.get(name, -1) or (over and known and sent.at < over.since):
                continue
            self._newest[name] = seq
            if announced:
                self.performers.announce(announced, now)
            if over and known:
                if seq == over.answered:
                    self.performers.keep_time_with(name, frame.time)
                self._warm_up(over, frame, now)
                continue
            if over and over.long_ago:
                self.performers.go_on(name, over.long_ago, now)
                over.long_ago = None
            if recognition := self.performers.push(frame, now):
                answers.append(self._answered(recognition, seq, sent.at))
        return answers

    def _warm_up(self, over: _TakenOver, frame: Frame, now: float) -> None:
        if recognition := self.performers.push(frame, now):
            self._warmed.hops += 1
            over.follow(recognition)
        self._warmed.frames += 1

    def _answered(self, recognition: Recognition, seq: int, at: float) -> Answered:
        name = recognition.performer
        answer = answered(recognition, seq, at, self.book, self.performers.long_ago(name))
        if over := self._taken_over.get(name):
            answer = msgspec.structs.replace(answer, events=self._events(over, recognition))
        self._follow(name, answer.events)
        if name in self._asked:
            self._asked.discard(name)
            going_on = (self._going_on[name],) if name in self._going_on else ()
            answer = msgspec.structs.replace(answer, carried=self.performers.carried(name), going_on=going_on)
        return answer

    def _events(self, over: _TakenOver, recognition: Recognition) -> tuple[Event, ...]:
        if over.agrees:
            del self._taken_over[recognition.performer]
            return recognition.events
        return over.mend(recognition, needed_lead(self.performers.library, self.performers.settings))

    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str], book: int) -> None:
        """Compare with another library from now on. The receiving process ends the motions whose class it lacks."""
        self.performers.exchange(library, order)
        self.book = book

    def report(self, now: float) -> Report:
        """Forget silent performers, and give the counters."""
        performers = self.performers
        performers.drop_silent(now)
        for name in performers.take_gone():
            self._forget(name)
        counts = performers.counts
        counts.recognizers.add(self._warmed, -1)
        return Report(counts, performers.refused, performers.doubted, performers.compared, len(performers))
