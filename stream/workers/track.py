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
class Move:
    """A performer's way to a new worker, while the former one answers.

    The new one gets the last seconds first, piece by piece. Then new frames wait until the former one has answered
    those before, and the new one goes on with them.

    Attributes
    ----------
    to
        The new worker.
    waiting
        The frames that it has not been sent; None before it knows of the performer.
    came
        How many of them came since the last piece.
    asked, question
        Who must have dealt with what was sent before the next step, and the number of the question; 0 for nobody.
    is_last
        Whether the new worker has all frames that the former one must answer.
    """

    to: str
    waiting: deque[SentFrame] | None = None
    came: int = 0
    asked: str = ""
    question: int = 0
    is_last: bool = False


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
    move
        The way to another worker.
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
    move: Move | None = None
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
        recognition = answer.recognition
        if self._pause and answer.seq >= self._pause[0]:
            # A worker that took the performer over has perhaps not seen the pause.
            if recognition.ended_at is None:
                recognition = replace(recognition, ended_at=self._pause[1])
            self._pause = None
        return self.decision.events(recognition) if recognition.classes == classes else self.decision.ends(recognition)

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

    def recent(self, joints: tuple[str, ...] | None) -> tuple[list[SentFrame], list[SentFrame]]:
        """Give the last frames that need no answer any more, and those that need one, for a worker that takes over."""
        since = self._answer.at - HISTORY if self._answer else 0.0
        recent = [frame for frame in self._recent if frame.at >= since]
        if recent:
            recent[0] = msgspec.structs.replace(recent[0], begins=True, joints=joints, take_over=self.past)
        done = sum(frame.seq <= self.number for frame in recent)
        return recent[:done], recent[done:]
