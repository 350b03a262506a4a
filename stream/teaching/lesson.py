"""One lesson: countdown, waiting for movement, recording, stopped by stillness, trimmed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kinespace.library.teaching.movement import ENDS_AFTER, MIN_SECONDS, STILLNESS, Stretch, StretchFinder
from kinespace.stream.teaching.notices import State, Step

if TYPE_CHECKING:
    from kinespace.stream.teaching.commands import Teach

#: Seconds of a recording, and of standing still before it, at most.
MAX_RECORDING, MAX_WAITING = 15.0, 15.0
#: Seconds that rounding may add to a countdown.
_TIE = 1e-6
#: Seconds kept before the movement, so that undoing the trim shows them.
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

    Attributes
    ----------
    step
        The lesson's state.
    left
        Examples that are still to be recorded.
    """

    def __init__(self, asked: Teach, performer: str, now: float) -> None:
        self.class_name, self.performer = asked.class_name, performer
        self.left = asked.repetitions
        self.step = Step.COUNTDOWN
        self._go = now + asked.countdown
        self._told = math.inf
        self._finder = StretchFinder(STILLNESS)
        self._armed = self._began = self._newest = math.nan

    def tick(self, now: float) -> State | None:
        """Count down; give the notices."""
        if self.step is not Step.COUNTDOWN:
            return None
        if now >= self._go:
            self.step = Step.WAITING
            return State(self.performer, Step.WAITING)
        seconds = max(math.ceil(self._go - now - _TIE), 1)
        if seconds == self._told:
            return None
        self._told = seconds
        return State(self.performer, Step.COUNTDOWN, float(seconds))

    def push(self, time: float, movement: float | None) -> State | Recorded | None:
        """Take in a frame's time on the sender's clock, and the movement if it was measured.

        Returns
        -------
        A change of state; the recording, when it ended; a refusal; else None.
        """
        self._newest = time
        if self.step is Step.COUNTDOWN:
            # A performer who is already moving is recorded from now on.
            if movement is not None:
                self._finder.push(time, movement)
            return None
        if math.isnan(self._armed):
            self._armed = time
        found = None if movement is None else self._finder.push(time, movement)
        if self.step is Step.WAITING:
            return self._waited(time)
        if found:
            return self._recorded(found, by_hand=False)
        return self.stop(by_hand=True) if time - self._began >= MAX_RECORDING else None

    def _waited(self, time: float) -> State | None:
        if self._finder.began is not None:
            self.step = Step.RECORDING
            self._began = max(self._finder.began, self._armed)
            return State(self.performer, Step.RECORDING)
        if time - self._armed >= MAX_WAITING:
            return State(self.performer, Step.REFUSED, MAX_WAITING, f"stood still for {MAX_WAITING:g} s")
        return None

    def stop(self, *, by_hand: bool) -> State | Recorded:
        """End the recording by a command, because it has its maximal length, or because no frames come for now."""
        if self.step is not Step.RECORDING:
            return State(self.performer, Step.REFUSED, 0.0, "nothing was recorded")
        return self._recorded(self._finder.end() or Stretch(self._began, self._newest), by_hand=by_hand)

    def _recorded(self, found: Stretch, *, by_hand: bool) -> State | Recorded:
        begin = max(found.start, self._armed)
        kept = Stretch(begin, min(found.end, self._newest, begin + MAX_RECORDING))
        whole = Stretch(begin - BEFORE, min(kept.end + ENDS_AFTER, self._newest))
        self._armed = math.nan
        self._finder.clear()
        self.step = Step.WAITING
        if kept.duration < MIN_SECONDS:
            told = f"expected {MIN_SECONDS:g} s or more of movement"
            # A performer who takes up their place moves for a moment: this is no example.
            # A sender's clock that begins anew gives a time below 0.
            return State(self.performer, Step.REFUSED if by_hand else Step.WAITING, max(kept.duration, 0.0), told)
        self.left -= 1
        return Recorded(whole, kept)
