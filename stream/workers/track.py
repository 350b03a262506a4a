"""One performer as the gateway knows it: enough for another worker to take over without a gap."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from kinespace.stream.recognition import Event, EventKind
from kinespace.stream.workers.wire import Entry, SentFrame, sent_frame
from kinespace.stream.workers.worker import HISTORY, KEPT

if TYPE_CHECKING:
    from collections.abc import Collection

    from kinespace.stream.frame import Frame
    from kinespace.stream.recognizer.joints.carried import Carried
    from kinespace.stream.recognizer.joints.mending import LongAgo
    from kinespace.stream.workers.wire import Answered

#: Seconds after which the joints are sent again, so that they are among the frames of the last seconds.
_JOINTS_EVERY = 1.0


@dataclass(slots=True)
class Track:
    """The frames that were sent to workers, and the answers that came back.

    Attributes
    ----------
    begun, newest
        When the first and the newest frame came.
    partition
        The performer's partition.
    carried
        The joints that carried the last answer that was asked about.
    asks
        Whether the next answer must say these joints.
    """

    begun: float
    newest: float
    partition: int
    carried: Carried | None = None
    asks: bool = False
    #: Time of the last frame on the sender's clock, seconds.
    _time: float = 0.0
    #: The numbers of the first and the last frame sent, and of the last frame answered.
    _first: int = 0
    _sent: int = 0
    _answered: int = 0
    #: How many frames were sent.
    _frames: int = 0
    #: The arrival of the last answered frame, and its time on the sender's clock.
    _answered_at: float = 0.0
    _answered_time: float = 0.0
    #: The start of the motion that listeners believe to go on.
    _going_on: Event | None = None
    #: The worker's knowledge of the feed at its last answer.
    _long_ago: LongAgo | None = None
    #: The joints that were sent last, and when.
    _joints: tuple[str, ...] | None = None
    _joints_at: float = 0.0
    #: The frames of the last seconds.
    _recent: deque[SentFrame] = field(default_factory=deque)

    @property
    def frames_and_answers(self) -> tuple[int, int]:
        """How many frames were sent, and the number of the last one answered: 0 before the first answer."""
        return self._frames, self._answered

    def send(self, frame: Frame, number: int, now: float, joints: tuple[str, ...] | None) -> SentFrame:
        """Make the message of a frame that came now; it has the joints from time to time."""
        if joints == self._joints and 0 <= now - self._joints_at < _JOINTS_EVERY:
            joints = None
        elif joints is not None:
            self._joints, self._joints_at = joints, now
        sent = sent_frame(frame, number, now, joints, begins=not self._frames)
        sent.asks, self.asks = self.asks, False
        self._time, self._sent, self._first = frame.time, number, self._first or number
        self._frames += 1
        self._recent.append(sent)
        while self._recent[0].at < now - KEPT:
            self._recent.popleft()
        return sent

    def accept(self, answer: Answered, classes: Collection[str]) -> tuple[Event, ...] | None:
        """Take in an answer; give its events so that each motion starts and ends once.

        Parameters
        ----------
        answer
            The answer.
        classes
            No other motions start: the worker may not know yet that the library was exchanged.

        Returns
        -------
        None for an answer that is no news: its frame was answered before, or was another performer's of this name.
        """
        if not max(self._answered, self._first - 1) < answer.seq <= self._sent:
            return None
        self._answered, self._answered_at = answer.seq, answer.at
        self._answered_time, self._long_ago = answer.time, answer.long_ago
        self.carried = answer.carried or self.carried
        return tuple(each for event in answer.events for each in self._follow(event, classes))

    def _follow(self, event: Event, classes: Collection[str]) -> list[Event]:
        """Take in a worker's event; give the events that listeners must get."""
        before, same = self._going_on, self._going_on is not None and self._going_on.label == event.label
        if event.kind is EventKind.END:
            self._going_on = None if same else before
            return [event] if same else []
        if same or event.label not in classes:
            return []
        ended = self._ended(event.time)
        self._going_on = event
        return [ended, event] if ended else [event]

    def _ended(self, time: float) -> Event | None:
        return self._going_on and replace(self._going_on, kind=EventKind.END, time=time)

    def end(self) -> Event | None:
        """End the motion that goes on; `accept` does not give its end again."""
        ended, self._going_on = self._ended(self._time), None
        return ended

    def end_unless(self, classes: Collection[str]) -> Event | None:
        """End the motion that goes on, unless it is of one of these classes."""
        return self.end() if self._going_on and self._going_on.label not in classes else None

    def entry(self, name: str, joints: tuple[str, ...] | None) -> Entry:
        """Give what the worker that takes the performer over must know, beside the `recent` frames."""
        return Entry(
            performer=name,
            answered=self._answered > 0,
            going_on=self._going_on,
            joints=joints,
            time=self._answered_time,
            long_ago=self._long_ago,
        )

    def recent(self) -> tuple[list[SentFrame], list[SentFrame]]:
        """Give the last frames that need no answer any more, and the frames that need one, in order."""
        recent = [frame for frame in self._recent if frame.at >= self._answered_at - HISTORY]
        done = sum((frame.seq or 0) <= self._answered for frame in recent)
        return recent[:done], recent[done:]
