"""One performer as the gateway knows it: enough for another worker to take over without a gap."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import msgspec

from kinespace.stream.recognizer.decision import Decision
from kinespace.stream.recognizer.recognizer import MAX_PAUSE
from kinespace.stream.workers.wire import Past, SentFrame

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.frame import Frame
    from kinespace.stream.recognition import Event
    from kinespace.stream.recognizer.joints.carried import Carried
    from kinespace.stream.workers.wire import Answered

#: Seconds of frames with which a performer is taken over. The longest window is two seconds; then the averages must
#: forget the first, short windows (`kinespace bench scale` counts the events that differ).
HISTORY = 2.5
#: Seconds of frames that are kept: a worker may have hung unnoticed for a while since its last answer.
KEPT = HISTORY + 1.5
#: Seconds after which the joints are sent again, so that they are among the frames of the last seconds.
_JOINTS_EVERY = 1.0
#: Answers that may come at once: the times of hops are rounded to frames.
_MAX_OWED = 2.5


@dataclass(slots=True)
class Track:
    """The frames that were sent to workers, and the answers that came back.

    Attributes
    ----------
    begun, newest
        When the first and the newest frame came.
    number
        The number of the last frame answered, or before the first answer a number below all frames.
    decision
        Gives the events: only the gateway knows of all answers, so that each motion starts and ends once.
    worker
        The worker that answers; empty for none.
    to
        The worker that answers soon in its place; empty for none.
    taken_over
        Whether the next frame is the first that the worker answers in another one's place.
    carried
        The joints that carried the last answer that was asked about.
    asks
        Whether the next answer must say these joints.
    """

    begun: float
    newest: float
    number: int
    decision: Decision
    worker: str = ""
    to: str = ""
    taken_over: bool = False
    carried: Carried | None = None
    asks: bool = False
    #: Seconds between two answers, and how many may come now.
    hop: float = 0.0
    _owed: float = 0.0
    #: The last answer.
    _answer: Answered | None = None
    #: The time of the last frame on the sender's clock, and how many frames were sent.
    _time: float = 0.0
    _frames: int = 0
    #: The first frame after a pause that ends motions, and the time of the last frame before it.
    _pause: tuple[int, float] | None = None
    #: The joints that were sent last, and when.
    _joints: tuple[str, ...] | None = None
    _joints_at: float = 0.0
    #: The frames of the last seconds.
    _recent: deque[SentFrame] = field(default_factory=deque)

    @property
    def frames_and_answers(self) -> tuple[int, int]:
        """How many frames were sent, and 0 before the first answer."""
        return self._frames, int(self._answer is not None)

    def send(self, frame: Frame, seq: int, now: float, joints: tuple[str, ...] | None) -> SentFrame:
        """Make the message of a frame that came now; it has the joints from time to time."""
        sent = SentFrame.of(frame, seq, now)
        if joints is not None and not (joints == self._joints and 0 <= now - self._joints_at < _JOINTS_EVERY):
            sent.joints = self._joints = joints
            self._joints_at = now
        sent.asks, self.asks = self.asks, False
        sent.begins = not self._frames
        if self._frames and frame.time - self._time > MAX_PAUSE:
            self._pause = seq, self._time
        self._time = frame.time
        self._frames += 1
        self._recent.append(sent)
        while self._recent[0].at < now - KEPT:
            self._recent.popleft()
        if self.taken_over:
            sent, self.taken_over = msgspec.structs.replace(sent, go_on=self.past), False
        return sent

    def accept(self, answer: Answered, classes: Sequence[str]) -> tuple[Event, ...] | None:
        """Take in an answer; give its events.

        Parameters
        ----------
        answer
            The answer.
        classes
            The classes now; an answer by others, after an exchange, has no events.

        Returns
        -------
        None for an answer that is no news: its frame was answered before, or was another performer's of this name; or
        answers came more often than hops.
        """
        time, hop = answer.recognition.time, self.hop
        sent = next((each for each in reversed(self._recent) if each.seq <= answer.seq), None)
        if self.number >= answer.seq or not sent or (sent.seq, sent.time, sent.at) != (answer.seq, time, answer.at):
            return None
        # An answer a hop; one that was late may be followed at once by the next.
        elapsed = time - self._answer.recognition.time if self._answer else math.inf
        owed = min(self._owed + elapsed / hop, _MAX_OWED) if hop and elapsed >= 0 else _MAX_OWED
        if owed < 1:
            return None
        self.number, self._answer, self._owed = answer.seq, answer, owed - 1
        self.carried = answer.carried or self.carried
        ended = None
        if self._pause and answer.seq >= self._pause[0]:
            ended, self._pause = self.decision.end(self._pause[1]), None
        events = self.decision.events(answer.recognition) if answer.recognition.classes == classes else ()
        return (ended, *events) if ended else events

    def end(self) -> Event | None:
        """End the motion that goes on."""
        return self.decision.end(self._time)

    def exchange(self, classes: Sequence[str], lead: float) -> Event | None:
        """Go on with other classes, and the lead that they need; end the motion that goes on if its class is gone."""
        begun = self.decision.going_on
        ended = self.end() if begun and begun.label not in classes else None
        begun = self.decision.going_on
        self.decision = Decision(lead, begun and replace(begun, index=classes.index(begun.label)))
        return ended

    @property
    def past(self) -> Past:
        """What the last seconds need not show."""
        return Past(self._answer.recognition.time, self._answer.long_ago) if self._answer else Past()

    def give_to(self, worker: str, joints: tuple[str, ...] | None) -> list[SentFrame]:
        """Let a worker answer from now on; give the frames of the last seconds, answered or not, for it."""
        since = self._answer.at - HISTORY if self._answer else 0.0
        recent = [frame for frame in self._recent if frame.at >= since]
        if recent:
            recent[0] = msgspec.structs.replace(recent[0], begins=True, joints=joints, take_over=self.past)
        answered = sum(frame.seq <= self.number for frame in recent)
        self.worker, self.to, self.taken_over = worker, "", answered == len(recent)
        if not self.taken_over:
            recent[answered] = msgspec.structs.replace(recent[answered], go_on=self.past)
        return recent
