"""The last minutes of one performer, at 30 frames per second: examples are cut from them and tried on them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.recordings.formats.timed_frames import MAX_GAP, evened
from kinespace.library.skeleton import Skeleton
from kinespace.library.teaching.movement import Movement, MovementMeter, Stretch
from kinespace.stream.recognition import Event, EventKind
from kinespace.stream.teaching.commands import MAX_LAST

#: Seconds that are remembered, and frames per second.
REMEMBERED = 300.0
FRAME_RATE = 30.0
#: Frames per second below which an example has too few for a window: straight lines give it more.
_TOO_FEW = 9.5
#: Share of a frame's time by which a frame may come early and still be kept.
_EARLY = 0.2
#: Seconds by which a frame may be older than the one before; an older one is of a sender that began again.
_BACKWARDS = 1.0
#: Seconds by which rounding may move a frame out of a span.
_TIE = 1e-6


class Remembered(NamedTuple):
    """Some remembered frames; quick to gather, and made a clip where nobody waits.

    Attributes
    ----------
    frames
        Times in seconds on the sender's clock, and positions (joints, 3), metres.
    skeleton
        The skeleton of the positions.
    shown
        When examples of the class that is to be tried on them were shown, on the same clock.
    """

    frames: Sequence[tuple[float, NDArray[np.float32]]]
    skeleton: Skeleton
    shown: Sequence[Stretch] = ()

    def clip(self) -> Clip:
        """Give the frames at even times."""
        times = np.array([time for time, _ in self.frames])
        positions = np.array([positions for _, positions in self.frames], dtype=np.float64)
        often = (len(times) - 1) / (times[-1] - times[0])
        # A slower feed keeps its rate; a faster one was thinned unevenly and is resampled at even times.
        rate = None if _TOO_FEW <= often <= 0.9 * FRAME_RATE else FRAME_RATE
        return evened(times, positions, rate=rate).clip(self.skeleton)


class Memory:
    """Remembers a performer's frames, thinned, and measures their movement.

    Parameters
    ----------
    skeleton
        The skeleton of the positions.

    Attributes
    ----------
    arrived
        When the last frame arrived, seconds on our clock.
    newest
        The last frame's own time, seconds on the sender's.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._clear()
        self.arrived = self.newest = -np.inf

    def _clear(self) -> None:
        self._frames: deque[tuple[float, NDArray[np.float32]]] = deque(maxlen=round(REMEMBERED * FRAME_RATE))
        self._due = -np.inf
        self._meter = MovementMeter(self._skeleton)

    def push(self, time: float, positions: NDArray[np.floating], now: float) -> Movement | None:
        """Take in a frame; give the movement when it is measured, else None (`library.teaching.movement`)."""
        self.arrived = now
        if time <= self.newest:
            if self.newest - time < _BACKWARDS:
                return None
            self._clear()
        self.newest = time
        if time < self._due - _EARLY / FRAME_RATE:
            return None
        # After a pause the next frame is due from now on.
        self._due = (max(self._due, time) if self._due >= time - 1 / FRAME_RATE else time) + 1 / FRAME_RATE
        self._frames.append((time, positions.astype(np.float32)))
        while self._frames[0][0] < time - REMEMBERED:
            self._frames.popleft()
        return self._meter.push(time, positions)

    def between(self, begin: float, end: float) -> Clip | None:
        """Give the frames between two moments on the sender's clock; None for less than three frames."""
        gathered = self.gathered(begin, end)
        return gathered.clip() if gathered else None

    def unbroken(self, span: Stretch, moment: float) -> Stretch:
        """Narrow a span to the part around a moment in which no frame is missing for long."""
        for before, after in pairwise(time for time, _ in self._frames if span.start <= time <= span.end):
            if after - before > MAX_GAP and before >= moment:
                return Stretch(span.start, before)
            if after - before > MAX_GAP:
                span = Stretch(after, span.end)
        return span

    def gathered(self, begin: float, end: float) -> Remembered | None:
        """Gather what `between` makes a clip of, which takes its time."""
        frames = [each for each in self._frames if begin - _TIE <= each[0] <= end + _TIE]
        return Remembered(frames, self._skeleton) if len(frames) > 2 else None


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
