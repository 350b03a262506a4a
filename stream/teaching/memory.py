"""The last minutes of one performer, at 30 frames per second: examples are cut from them and tried on them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library.recordings.formats.timed_frames import evened
from kinespace.library.teaching.movement import MovementMeter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.library.clip import Clip
    from kinespace.library.skeleton import Skeleton

#: Seconds that are remembered, and frames per second.
REMEMBERED = 300.0
FRAME_RATE = 30.0
#: Share of a frame's time by which a frame may come early and still be kept.
_EARLY = 0.2
#: Frames remembered at first; there is room for more as they come.
_ROOM = 512
#: Seconds after which the next frame belongs to another time: the sender began anew.
_BACKWARDS = 1.0


class Remembered(NamedTuple):
    """Some remembered frames; quick to copy, and made a clip where nobody waits.

    Attributes
    ----------
    times
        Seconds on the sender's clock, shape (frames,).
    positions
        Shape (frames, joints, 3), metres.
    skeleton
        The skeleton of the positions.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float32]
    skeleton: Skeleton

    def clip(self) -> Clip:
        """Give the frames at even times."""
        often = (len(self.times) - 1) / (self.times[-1] - self.times[0])
        # A slower feed keeps its rate; a faster one was thinned unevenly and is resampled at even times.
        rate = FRAME_RATE if often > 0.9 * FRAME_RATE else None
        return evened(self.times, self.positions.astype(np.float64), rate=rate).clip(self.skeleton)


class Memory:
    """Remembers a performer's frames, thinned, and measures their movement.

    Parameters
    ----------
    skeleton
        The skeleton of the positions.

    Attributes
    ----------
    heard
        When the last frame arrived, seconds on our clock.
    newest
        The last frame's own time, seconds on the sender's.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._most = round(REMEMBERED * FRAME_RATE)
        self._clear()
        self.heard = self.newest = -np.inf

    def _clear(self) -> None:
        self._times = np.empty(_ROOM)
        self._positions = np.empty((_ROOM, len(self._skeleton.joints), 3), dtype=np.float32)
        self._count, self._due = 0, -np.inf
        self._meter = MovementMeter(self._skeleton)

    def push(self, time: float, positions: NDArray[np.floating], now: float) -> float | None:
        """Take in a frame; give the movement when it is measured, else None (`library.teaching.movement`)."""
        self.heard = now
        if time <= self.newest:
            if self.newest - time < _BACKWARDS:
                return None
            self._clear()
        self.newest = time
        if time >= self._due - _EARLY / FRAME_RATE:
            self._due = (
                max(self._due, time) + 1 / FRAME_RATE if self._due >= time - 1 / FRAME_RATE else time + 1 / FRAME_RATE
            )
            self._keep(time, positions)
            return self._meter.push(time, positions)
        return None

    def _keep(self, time: float, positions: NDArray[np.floating]) -> None:
        if self._count == len(self._times):
            if self._count >= 2 * self._most:
                half = self._most
                self._times[:half] = self._times[self._count - half : self._count].copy()
                self._positions[:half] = self._positions[self._count - half : self._count].copy()
                self._count = half
            else:
                room = min(2 * len(self._times), 2 * self._most)
                self._times = np.resize(self._times, room)
                self._positions = np.concatenate(
                    [self._positions, np.empty((room - len(self._positions), *self._positions.shape[1:]), np.float32)]
                )
        self._times[self._count], self._positions[self._count] = time, positions
        self._count += 1

    def between(self, begin: float, end: float) -> Clip | None:
        """Give the frames between two moments on the sender's clock; None for less than three frames."""
        remembered = self._copied(begin, end)
        return remembered.clip() if remembered else None

    def before(self, end: float) -> Remembered | None:
        """Give all frames that are remembered before a moment; None for less than three frames."""
        return self._copied(max(end - REMEMBERED, float(self._times[0])), end) if self._count else None

    def _copied(self, begin: float, end: float) -> Remembered | None:
        first, last = np.searchsorted(self._times[: self._count], [begin - 1e-6, end + 1e-6]).tolist()
        if last - first < 3:
            return None
        return Remembered(self._times[first:last].copy(), self._positions[first:last].copy(), self._skeleton)
