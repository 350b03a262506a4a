"""The receiving process's notes on each performer: enough for another worker to take over without a gap."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from kinespace.stream.recognition import Event, EventKind
from kinespace.stream.recognizer.recognizer import MAX_PAUSE
from kinespace.stream.workers.partition import partition_of
from kinespace.stream.workers.wire import Entry, SentFrame, sent_frame
from kinespace.stream.workers.worker import HISTORY, KEPT

if TYPE_CHECKING:
    from collections.abc import Collection

    from kinespace.stream.frame import Announcement, Frame
    from kinespace.stream.recognizer.joints.carried import Carried
    from kinespace.stream.recognizer.joints.doubts import LongAgo
    from kinespace.stream.workers.wire import Answered

#: Seconds after which the joints are sent again, so that they are among the frames of the last seconds.
_JOINTS_EVERY = 1.0
#: The ledger remembers the joints of so many times `most` performers.
_MAX_REMEMBERED = 4
#: Seconds after which two recognisers of a performer's frames follow the same motion.
_SETTLED = 1.0
#: Seconds after which a performer that was never answered makes room for another.
_STEADY_SECONDS = 1.0


@dataclass(slots=True)
class _Performer:
    partition: int
    begun: float
    heard: float
    #: Time of the last frame on the sender's clock, seconds.
    time: float = 0.0
    #: The numbers of the first and the last frame sent, and of the last frame answered.
    first: int = 0
    sent: int = 0
    answered: int = 0
    #: The arrival of the last answered frame, and its time on the sender's clock.
    answered_at: float = 0.0
    answered_time: float = 0.0
    #: The start of the motion that listeners believe to go on.
    going_on: Event | None = None
    #: The worker's knowledge of the feed at its last answer.
    long_ago: LongAgo | None = None
    #: When the joints were last sent.
    told_joints: float = 0.0
    anew: bool = True
    #: The joints that carried an answer, and whether the next answer must say them and the motion that goes on.
    carried: Carried | None = None
    asks: bool = False
    #: The answer to a frame that comes from then on decides which motion goes on, because two workers have answered.
    settles: float = math.inf
    #: The frames of the last seconds.
    recent: deque[SentFrame] = field(default_factory=deque)


class Ledger:
    """Numbers the frames, and notes the answers and the joints of each performer.

    Parameters
    ----------
    most, silence
        The same as for `Performers`.

    Attributes
    ----------
    no_room, dropped
        Frames of performers for whom there was no room, and performers dropped after silence.
    """

    def __init__(self, *, most: int, silence: float) -> None:
        self.most, self.silence = most, silence
        self.no_room = self.dropped = 0
        self._performers: dict[str, _Performer] = {}
        self._joints: dict[str, tuple[str, ...]] = {}
        self._gone: list[str] = []
        self._ended: list[Event] = []
        #: Numbers are never used twice, so that a performer who comes again is not taken for the former one.
        self._seq = 0

    @property
    def names(self) -> tuple[str, ...]:
        """The performers now followed, in the order of their first frames."""
        return tuple(self._performers)

    @property
    def sent(self) -> int:
        """The number of the last frame."""
        return self._seq

    def joints_of(self, performer: str) -> tuple[str, ...] | None:
        """Give the joints that a performer's sender announced; None without an announcement."""
        return self._joints.get(performer)

    def carried(self, name: str) -> Carried | None:
        """Give the joints that carried an answer, if they were asked for before; ask for them with the next frame."""
        if (performer := self._performers.get(name)) is None:
            return None
        performer.asks = True
        return performer.carried

    def announce(self, announcement: Announcement) -> None:
        """Note the joints of a performer; they travel with the next frame."""
        name = announcement.performer
        if self._joints.get(name) == announcement.joints:
            return
        if name not in self._joints and len(self._joints) >= _MAX_REMEMBERED * self.most:
            del self._joints[next(iter(self._joints))]
        self._joints[name] = announcement.joints
        if performer := self._performers.get(name):
            performer.told_joints = -1.0

    def change_sender(self, performer: str) -> None:
        """Forget the joints and the frames that a performer's former sender has sent."""
        self._joints.pop(performer, None)
        self._forget(performer)

    def send(self, frame: Frame, now: float) -> tuple[int, SentFrame] | None:
        """Give the partition of a frame that came now, and the frame to send; None when there is no room."""
        performer = self._performers.get(frame.performer) or self._begin(frame.performer, now)
        if performer is None:
            self.no_room += 1
            return None
        joints = self._joints.get(frame.performer)
        if joints is not None and not performer.anew and 0 <= now - performer.told_joints < _JOINTS_EVERY:
            joints = None
        elif joints is not None:
            performer.told_joints = now
        self._seq += 1
        performer.first = performer.first or self._seq
        sent = sent_frame(frame, self._seq, now, joints, anew=performer.anew)
        sent.asks = performer.asks or now >= performer.settles
        performer.anew = performer.asks = False
        performer.heard, performer.time, performer.sent = now, frame.time, self._seq
        recent = performer.recent
        recent.append(sent)
        while recent[0].at < now - KEPT:
            recent.popleft()
        return performer.partition, sent

    def _begin(self, name: str, now: float) -> _Performer | None:
        if len(self._performers) >= self.most:
            self._ended = self.drop_silent(now)
        if len(self._performers) >= self.most:
            # A made-up name gets no answer.
            others = self._performers.items()
            idle = (other for other, each in others if not each.answered and now - each.begun > _STEADY_SECONDS)
            if (other := next(idle, None)) is None:
                return None
            self._forget(other)
        performer = self._performers[name] = _Performer(partition_of(name), now, now)
        self._gone = [each for each in self._gone if each != name]
        return performer

    def note(self, answer: Answered, classes: Collection[str] | None = None) -> tuple[Event, ...] | None:
        """Note an answer; give its events so that each motion starts and ends once.

        Parameters
        ----------
        answer
            The answer.
        classes
            No other motions start: the worker may not know yet that the library was exchanged. None: any may start.

        Returns
        -------
        None for an answer that is no news: its performer has left, or its frame was answered before.
        """
        performer = self._performers.get(answer.performer)
        if performer is None or not max(performer.answered, performer.first - 1) < answer.seq <= performer.sent:
            return None
        performer.answered, performer.answered_at = answer.seq, answer.at
        performer.answered_time, performer.long_ago = answer.time, answer.long_ago
        performer.carried = answer.carried or performer.carried
        told: list[Event] = []
        for event in answer.events:
            told += _follow(performer, event, classes)
        if answer.going_on is not None and answer.at >= performer.settles:
            performer.settles = math.inf
            for event in _missed(performer, answer):
                told += _follow(performer, event, classes)
        return tuple(told)

    def settle(self, partition: int) -> None:
        """Ask which motions of a partition's performers go on, now that one worker answers alone again.

        Where two workers answered and told an event on different hops, each may have told it with the later of two
        answers to a frame. An event that the one worker only tells some hops after the other is told twice before the
        question, and heard once.
        """
        for performer in self._performers.values():
            if performer.partition == partition:
                performer.settles = performer.heard + _SETTLED

    def entries(self, partitions: Collection[int]) -> list[Entry]:
        """Give the entries of some partitions' performers, for the worker that takes the partitions over."""
        return [
            Entry(
                performer=name,
                answered=each.answered,
                since=each.answered_at - HISTORY,
                going_on=each.going_on,
                joints=self._joints.get(name),
                time=each.answered_time,
                long_ago=each.long_ago,
            )
            for name, each in self._performers.items()
            if each.partition in partitions
        ]

    def recent(self, partitions: Collection[int]) -> list[SentFrame]:
        """Give the last frames of some partitions' performers, each performer's in order."""
        taken = (each for each in self._performers.values() if each.partition in partitions)
        return [frame for each in taken for frame in each.recent if frame.at >= each.answered_at - HISTORY]

    def end_others(self, classes: Collection[str]) -> list[Event]:
        """Give the ends of the motions whose class is not among these."""
        others = [each for each in self._performers.values() if each.going_on and each.going_on.label not in classes]
        return [event for each in others if (event := _end(each))]

    def _forget(self, name: str) -> None:
        if performer := self._performers.pop(name, None):
            self.dropped += 1
            if ended := _end(performer):
                self._ended.append(ended)

    def drop_silent(self, now: float) -> list[Event]:
        """Forget performers that sent nothing for `silence` seconds; give the ends of their motions."""
        for name in [name for name, each in self._performers.items() if now - each.heard > self.silence]:
            self._forget(name)
            self._gone = [*self._gone[-_MAX_REMEMBERED * self.most :], name]
        ended, self._ended = self._ended, []
        return ended

    def end_paused(self, now: float) -> list[Event]:
        """Give the ends of the motions of performers who send nothing for now; `note` does not tell them again."""
        paused = (each for each in self._performers.values() if now - each.heard > MAX_PAUSE)
        return [event for each in paused if (event := _end(each))]

    def take_gone(self) -> list[str]:
        """Give the performers who were dropped since the last call."""
        gone, self._gone = self._gone, []
        return gone

    def end(self) -> list[Event]:
        """Give the ends of all motions going on, because no more frames will come."""
        ended, self._ended = self._ended, []
        return [*ended, *(event for each in self._performers.values() if (event := _end(each)))]


def _follow(performer: _Performer, event: Event, classes: Collection[str] | None) -> list[Event]:
    """Take in a worker's event; give the events that listeners must hear."""
    going_on = performer.going_on
    same = going_on is not None and going_on.label == event.label
    if event.kind is EventKind.END:
        performer.going_on = None if same else going_on
        return [event] if same else []
    if same or (classes is not None and event.label not in classes):
        return []
    performer.going_on = event
    return [replace(going_on, kind=EventKind.END, time=event.time), event] if going_on else [event]


def _missed(performer: _Performer, answer: Answered) -> list[Event]:
    """Give the event, at the answer's time, after which the motion goes on that the answer says."""
    if answer.going_on:
        return [replace(answer.going_on[0], time=answer.time)]
    return [replace(performer.going_on, kind=EventKind.END, time=answer.time)] if performer.going_on else []


def _end(performer: _Performer) -> Event | None:
    # A worker that has not heard of the pause yet must not start the motion again.
    performer.settles = math.inf
    going_on, performer.going_on = performer.going_on, None
    return replace(going_on, kind=EventKind.END, time=performer.time) if going_on else None
