"""One lesson: countdown, waiting for movement, recording, stopped by stillness, trimmed; or recorded while held.

A lesson of `nothing` waits for no movement and for no stillness: the performer moves at will for some seconds.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from kinespace.library.motion_library import NOTHING
from kinespace.library.teaching.movement import (
    ENDS_AFTER,
    MIN_SECONDS,
    STILLNESS,
    Movement,
    Stretch,
    StretchFinder,
    stillness_of,
)
from kinespace.stream.teaching.commands import Hold, State, Step, Teach

#: Seconds of a recording, and of standing still before it, at most.
MAX_RECORDING, MAX_WAITING = 15.0, 15.0
#: Seconds of movement at will that a lesson of `nothing` records.
AT_WILL = 20.0
#: Seconds at the end of a countdown that show how much the performer trembles while standing.
_STANDING = 1.0
#: Seconds between two notices of how much a performer moves who is waited for, and after which a way out is said.
_SAID_EVERY, _WAY_OUT = 1.0, 5.0
#: Frames a second that show movement, also where they come a little unevenly.
_LEAST_RATE = 8
#: Frames a second below which a camera is said to be slow; in a countdown a few frames may be late.
_GOOD_RATE = 10
#: Seconds that rounding may add to a countdown.
_TIE = 1e-6
#: Seconds of the recording that are kept before the movement.
BEFORE = 0.3


@dataclass(frozen=True, slots=True)
class Recorded:
    """A lesson's recording on the sender's clock: its whole span, and the span that is kept after trimming."""

    whole: Stretch
    kept: Stretch


class Lesson:
    """One performer shows examples of one class.

    Parameters
    ----------
    asked
        The command with the class to record.
    performer
        The performer's name.
    now
        Seconds on our clock.
    stillness
        Movement below which the performer stands still (`library.teaching.movement`); a performer who trembles less
        in the countdown begins with less.

    Attributes
    ----------
    step
        The lesson's state.
    left
        Examples that are still to be recorded.
    """

    def __init__(self, asked: Teach, performer: str, now: float, stillness: float = STILLNESS) -> None:
        self.class_name, self.performer = asked.class_name, performer
        self.left = asked.repetitions
        self._at_will = asked.class_name == NOTHING
        self._longest = AT_WILL if self._at_will else MAX_RECORDING
        self.step = Step.COUNTDOWN
        self._go = now + asked.countdown
        self._counted = math.inf
        self._stillness, self._finder = stillness, StretchFinder(stillness)
        #: The movement at the end of the countdown; the most since the last notice, and when that was.
        self._standing: deque[tuple[float, Movement]] = deque()
        self._most, self._said, self._came = -1.0, math.nan, 0
        self._armed = self._began = self._newest = math.nan

    def tick(self, now: float) -> State | None:
        """Count down; give the notices."""
        if self.step is not Step.COUNTDOWN:
            return None
        if now >= self._go:
            self.step = Step.WAITING
            return State(self.performer, Step.WAITING)
        seconds = max(math.ceil(self._go - now - _TIE), 1)
        if seconds == self._counted:
            return None
        self._counted = seconds
        return State(self.performer, Step.COUNTDOWN, float(seconds), self._too_slow() if seconds == 1 else "")

    def _too_slow(self) -> str:
        """Say before the lesson that frames come too rarely to show much of a movement."""
        rate = (self._came - 1) / (self._newest - self._said) if self._came > 1 else math.inf
        return f"{rate:.0f} frames a second, {_GOOD_RATE} are better: choose --size lite" if rate < _GOOD_RATE else ""

    def push(self, time: float, movement: Movement | None) -> State | Recorded | None:
        """Take in a frame's time on the sender's clock, and the movement if it was measured.

        Returns
        -------
        A change of state; the recording, when it ended; a refusal; else None.
        """
        self._newest = time
        if self.step is Step.COUNTDOWN:
            self._said, self._came = time if self._came == 0 else self._said, self._came + 1
            # A performer who is already moving is recorded from now on.
            if movement is not None:
                self._finder.push(time, movement)
                self._standing.append((time, movement))
                while time - self._standing[0][0] > _STANDING:
                    self._standing.popleft()
            return None
        if math.isnan(self._armed):
            self._arm(time)
        found = None if movement is None or self._at_will else self._finder.push(time, movement)
        if self.step is Step.WAITING:
            return self._waited(time, max(movement or (-1.0,)))
        if found:
            return self._recorded(found, by_hand=False)
        return self.stop(by_hand=True) if time - self._began >= self._longest else None

    def _arm(self, time: float) -> None:
        self._armed = self._said = time
        self._most, self._came = -1.0, 0
        still = stillness_of(self._standing, self._stillness)
        if still < self._stillness:
            self._finder = StretchFinder(still)

    def _waited(self, time: float, movement: float) -> State | None:
        if self._at_will:
            self.step, self._began = Step.RECORDING, self._armed
            return State(self.performer, Step.RECORDING, 0.0, f"move as you will for {AT_WILL:g} s")
        if self._finder.began is not None:
            self.step = Step.RECORDING
            self._began = max(self._finder.began, self._armed)
            return State(self.performer, Step.RECORDING)
        if time - self._armed >= MAX_WAITING:
            return State(self.performer, Step.REFUSED, MAX_WAITING, f"stood still for {MAX_WAITING:g} s")
        self._most, self._came = max(self._most, movement), self._came + 1
        if time - self._said < _SAID_EVERY - _TIE:
            return None
        reason = f"movement {self._most / self._finder.needed:.0%} of what is needed"
        if self._most < 0:
            rate = self._came / (time - self._said)
            reason = f"{rate:.0f} frames a second show no movement: send {_LEAST_RATE} or more"
        if time - self._armed >= _WAY_OUT - _TIE:
            reason += "; or show it and ask for /motion/teach/last"
        self._most, self._said, self._came = -1.0, time, 0
        return State(self.performer, Step.WAITING, 0.0, reason)

    def stop(self, *, by_hand: bool) -> State | Recorded:
        """End the recording by a command, because it has its maximal length, or because no frames come for now."""
        if self.step is not Step.RECORDING:
            return State(self.performer, Step.REFUSED, 0.0, "nothing was recorded")
        found = None if self._at_will else self._finder.end()
        return self._recorded(found or Stretch(self._began, self._newest), by_hand=by_hand)

    def _recorded(self, found: Stretch, *, by_hand: bool) -> State | Recorded:
        begin = max(found.start, self._armed)
        kept = Stretch(begin, min(found.end, self._newest, begin + self._longest))
        whole = Stretch(begin - BEFORE, min(kept.end + ENDS_AFTER, self._newest))
        self._armed = math.nan
        self._finder.clear()
        self.step = Step.WAITING
        if kept.duration < MIN_SECONDS:
            reason = f"expected {MIN_SECONDS:g} s or more of movement"
            # A performer who takes up their place moves for a moment: this is no example.
            # A sender's clock that begins again gives a time below 0.
            return State(self.performer, Step.REFUSED if by_hand else Step.WAITING, max(kept.duration, 0.0), reason)
        self.left -= 1
        return Recorded(whole, kept)


class HeldLesson:
    """One performer is recorded for as long as somebody holds a key, whatever moves; the attributes are a lesson's.

    Parameters
    ----------
    asked
        The command with the class to record.
    performer
        The performer's name.
    newest
        The time of the performer's last frame, seconds on the sender's clock.
    """

    def __init__(self, asked: Hold, performer: str, newest: float) -> None:
        self.class_name, self.performer = asked.class_name, performer
        self.left, self.step = 1, Step.RECORDING
        self._began = self._newest = newest

    def tick(self, now: float) -> None:
        """Nothing is due by the clock."""

    def push(self, time: float, movement: Movement | None) -> State | Recorded | None:  # noqa: ARG002 - as a lesson
        """Take in a frame's time; give the recording when it has its maximal length."""
        self._newest = time
        return self.stop(by_hand=True) if time - self._began >= MAX_RECORDING else None

    def stop(self, *, by_hand: bool) -> State | Recorded:  # noqa: ARG002 - as a lesson
        """End the recording: it is released, or no frames come for now."""
        held = Stretch(self._began, self._newest)
        if not held.duration >= MIN_SECONDS:
            # A sender's clock that begins again gives a time below 0.
            seconds = max(held.duration, 0.0)
            return State(self.performer, Step.REFUSED, seconds, f"expected it to be held for {MIN_SECONDS:g} s or more")
        self.left = 0
        return Recorded(held, held)
