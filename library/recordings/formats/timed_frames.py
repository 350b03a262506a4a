"""Frames that came at uneven times, or are missing, put on an even grid: a frame's index then gives its time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.skeleton import Skeleton

#: Seconds a marker may be out of sight. Over a longer time a straight line would be an invented movement.
MAX_GAP = 0.5
#: Rates that senders usually have; a feed that comes almost as often is taken to have such a rate.
_USUAL = np.array([10.0, 12.5, 15.0, 20.0, 24.0, 25.0, 30.0, 50.0, 60.0, 72.0, 75.0, 90.0, 100.0, 120.0, 144.0, 240.0])
#: Share by which frames may come more or less often than a usual rate.
_ABOUT = 0.03
#: Two times are the same when they differ by less than this share of a frame's time, or by less than these seconds.
_TIE = 1e-6
#: Frames of the grid, at most: a day at 60 frames per second.
MAX_FRAMES = 24 * 3600 * 60


class Evened(NamedTuple):
    """Frames on an even grid.

    Attributes
    ----------
    positions
        Shape (frames, joints, 3), metres.
    rate
        Frames per second.
    missing
        Frames that stand on straight lines, because no frame came near their time.
    gaps
        Times between which no frame came for longer than straight lines may last, seconds from the grid's beginning.
    """

    positions: NDArray[np.float64]
    rate: float
    missing: int
    gaps: tuple[tuple[float, float], ...]

    def clip(self, skeleton: Skeleton) -> Clip:
        """Make a clip of them; ValueError where a position is not finite."""
        return Clip(skeleton, self.positions, self.rate, filled=self.missing * len(skeleton.joints), gaps=self.gaps)


def evened(
    times: NDArray[np.float64],
    positions: NDArray[np.float64],
    *,
    rate: float | None = None,
    begin: float | None = None,
) -> Evened:
    """Put frames on an even grid: straight lines between two frames, standing still where no frame came for long.

    Parameters
    ----------
    times
        Seconds on any clock, shape (frames,), not falling; of frames at the same time the last one counts.
    positions
        Shape (frames, joints, 3), metres.
    rate
        Frames per second of the grid; the rate at which the frames came when not given.
    begin
        The time at which the grid begins; the first frame's when not given. The body stands still until the first
        frame.

    Raises
    ------
    ValueError
        Fewer than two frames, times that fall or are not finite, or more than a day of frames.
    """
    if len(times) < 2 or not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise ValueError("time: expected at least 2 finite times that do not fall")
    last = np.append(np.diff(times) > 0, True)
    times, positions = times[last], positions[last]
    if len(times) < 2:
        raise ValueError("time: expected at least 2 different times, got 1")
    rate = rate or _usual_rate(times)
    begin = float(times[0]) if begin is None else begin
    frames = int(np.floor((times[-1] - begin) * rate + 1e-6)) + 1
    if frames > MAX_FRAMES:
        raise ValueError(f"time: expected at most {MAX_FRAMES} frames at {rate:g} per second, got {frames}")
    memory.require_numbers(max(frames, len(times)) * positions[0].size)
    grid = begin + np.arange(frames) / rate
    after = np.clip(np.searchsorted(times, grid - _TIE), 1, len(times) - 1)
    before = after - 1
    apart = times[after] - times[before]
    share = np.clip((grid - times[before]) / apart, 0.0, 1.0)
    # A straight line over a long time would be an invented movement: the body stays where it was last seen.
    share[(apart > MAX_GAP) & (share < 1 - _TIE)] = 0.0
    share[share < _TIE] = 0.0
    nearest = np.minimum(np.abs(grid - times[before]), np.abs(times[after] - grid))
    missing = int(((nearest > 1 / rate) & (apart <= MAX_GAP) & (grid >= times[0])).sum())
    return Evened(_between(positions, before, after, share), rate, missing, tuple(_gaps(times, begin)))


def _gaps(times: NDArray[np.float64], begin: float) -> Iterator[tuple[float, float]]:
    if times[0] - begin > MAX_GAP:
        yield 0.0, float(times[0]) - begin
    for place in np.flatnonzero(np.diff(times) > MAX_GAP).tolist():
        yield float(times[place]) - begin, float(times[place + 1]) - begin


def _between(
    positions: NDArray[np.float64], before: NDArray[np.intp], after: NDArray[np.intp], share: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Weigh two frames; at a frame's own time the frame itself is given, even if its neighbour lacks joints."""
    weighed = positions[before]
    moved = np.flatnonzero(share > 0)
    # A few frames at a time: all at once take the memory of two further recordings.
    for some in np.array_split(moved, 1 + len(moved) // 4096):
        weighed[some] += share[some, None, None] * (positions[after[some]] - positions[before[some]])
    exact = share > 1 - _TIE
    weighed[exact] = positions[after[exact]]
    return weighed


def _usual_rate(times: NDArray[np.float64]) -> float:
    """Give how often frames came: the median, or the usual rate that lies near the median."""
    rate = 1 / float(np.median(np.diff(times)))
    nearest = float(_USUAL[np.abs(_USUAL / rate - 1).argmin()])
    # The mean of the frames that follow closely is more exact than the median, which rounded arrival times spoil.
    close = np.diff(times)[np.diff(times) < 2 / rate]
    mean = 1 / float(close.mean())
    return nearest if abs(nearest / mean - 1) <= _ABOUT else round(mean, 3)


def with_missing_frames(frame_numbers: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put straight lines where frame numbers are missing, so that a frame's index gives its time; (frames, n)."""
    wanted = np.arange(frame_numbers[0], frame_numbers[-1] + 1)
    if len(wanted) == len(frame_numbers):
        return values
    return np.stack([np.interp(wanted, frame_numbers, column) for column in values.T], axis=1)
