"""When a body moves and when it stands still: the motions between two stillnesses of a take or a live feed."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library.distances import distance_rows

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from kinespace.library.clip import Clip
    from kinespace.library.skeleton import Skeleton

#: Movement, relative to the body's size, below which a body stands still: some 8 mm for an adult.
STILLNESS = 0.01
#: A motion begins with so many times the movement with which it may end.
_BEGINS = 2.0
#: Seconds that movement must last to begin a motion, and stillness to end one.
BEGINS_AFTER, ENDS_AFTER = 0.1, 0.5
#: Seconds of stillness kept before and after a motion.
MARGIN = 0.1
#: Seconds that a motion lasts at least.
MIN_SECONDS = 0.4
#: Seconds over which movement is measured, and how often a second it is measured.
WINDOW = 0.2
_MEASURED_AT = 30.0
#: Seconds without a frame after which the meter begins anew.
_MAX_PAUSE = 0.5
#: The variance of second differences of white noise, relative to the noise's variance.
_SECOND_DIFFERENCE = 6.0
#: Seconds within which two spans count as equal, because frame times are rounded.
_TIE = 1e-6


class MovementMeter:
    """Measures how much a body moves, frame by frame.

    The movement is the root mean square deviation of the distances over the last fifth of a second, relative to their
    root mean square (as `windows.parts.movement`). The variance of white noise, estimated from the second differences
    of the distances, is subtracted: a sensor's trembling is no movement.

    Parameters
    ----------
    skeleton
        The skeleton of the positions.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._rows: deque[tuple[float, NDArray[np.float64]]] = deque()
        self._due = -math.inf

    def push(self, time: float, positions: NDArray[np.floating]) -> float | None:
        """Take in a frame.

        Parameters
        ----------
        time
            Seconds, later than the frames before.
        positions
            Shape (joints, 3), metres.

        Returns
        -------
        The movement of the window that ends now; None for a frame between two measurements, and while the window fills.
        """
        if time < self._due - _TIE:
            return None
        if self._rows and time - self._rows[-1][0] > _MAX_PAUSE:
            self._rows.clear()
        self._due = time + 1 / _MEASURED_AT if time - self._due > 1 / _MEASURED_AT else self._due + 1 / _MEASURED_AT
        self._rows.append((time, distance_rows(positions, self._skeleton)))
        while time - self._rows[1][0] >= WINDOW - _TIE if len(self._rows) > 1 else False:
            self._rows.popleft()
        if len(self._rows) < 3 or time - self._rows[0][0] < WINDOW / 2:
            return None
        return relative_movement(np.array([row for _, row in self._rows]))


def relative_movement(rows: NDArray[np.float64]) -> float:
    """Measure the movement in evenly spaced distance rows (frames, pairs), at least three."""
    mean = rows.mean(axis=0)
    bends = rows[2:] - 2 * rows[1:-1] + rows[:-2]
    noise = float(np.square(bends).sum()) / (len(bends) * _SECOND_DIFFERENCE)
    swing = float(np.square(rows - mean).sum()) / len(rows)
    length = float(np.square(mean).sum())
    return math.sqrt(max(swing - noise, 0.0) / length) if length > 0 else 0.0


class Stretch(NamedTuple):
    """The time from `start` to `end`, seconds."""

    start: float
    end: float

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.end - self.start


class StretchFinder:
    """Finds where a motion begins and ends, by hysteresis: it begins with twice the movement that ends it.

    Parameters
    ----------
    stillness
        Movement below which the body stands still.

    Attributes
    ----------
    began
        When the motion that goes on began, seconds; None while the body stands still.
    """

    def __init__(self, stillness: float = STILLNESS) -> None:
        self._stillness = stillness
        self.clear()

    def clear(self) -> None:
        """Forget all movements."""
        self.began: float | None = None
        self._rising = self._moved = math.nan

    def push(self, time: float, movement: float) -> Stretch | None:
        """Take in the movement at a time; give a motion, with its margins, when it has ended."""
        if self.began is None:
            if movement < _BEGINS * self._stillness:
                self._rising = math.nan
            elif math.isnan(self._rising):
                self._rising = time
            elif time - self._rising >= BEGINS_AFTER - _TIE:
                self.began, self._moved = self._rising, time
            return None
        if movement > self._stillness:
            self._moved = time
            return None
        return self.end() if time - self._moved >= ENDS_AFTER - _TIE else None

    def end(self) -> Stretch | None:
        """End the motion that goes on; None when no motion goes on."""
        if self.began is None:
            return None
        # The window contains the last movement for as long as it lasts.
        found = Stretch(self.began - MARGIN, max(self._moved - WINDOW, self.began) + MARGIN)
        self.clear()
        return found


def stretches_of(clip: Clip, stillness: float = STILLNESS) -> list[Stretch]:
    """Find the motions of a take that lie between stillnesses, in seconds from its beginning; none in its gaps."""
    return [found for found in _stretches(clip, stillness) if found.duration >= MIN_SECONDS]


def _stretches(clip: Clip, stillness: float) -> Iterator[Stretch]:
    edges = [0.0, *(edge for gap in clip.gaps for edge in gap), clip.duration]
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        meter, finder = MovementMeter(clip.skeleton), StretchFinder(stillness)
        first, last = round(begin * clip.frame_rate), round(end * clip.frame_rate)
        for frame in range(first, min(last + 1, clip.frames)):
            time = frame / clip.frame_rate
            movement = meter.push(time, clip.positions[frame])
            if movement is not None and (found := finder.push(time, movement)):
                yield _within(found, begin, end)
        if found := finder.end():
            yield _within(found, begin, end)


def _within(found: Stretch, begin: float, end: float) -> Stretch:
    return Stretch(max(found.start, begin), min(found.end, end))
