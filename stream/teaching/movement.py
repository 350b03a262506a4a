"""When a body moves and when it stands still: the motions between two stillnesses of a take or a live feed."""

import math
from collections import deque
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Clip, Skeleton, distance_rows

#: Movement, relative to the body's size, below which a body stands still: some 8 mm for an adult.
STILLNESS = 0.01
#: A motion begins with so many times the movement with which it may end.
_BEGINS = 2.0
#: Seconds that movement must last to begin a motion, and stillness to end one.
BEGINS_AFTER, ENDS_AFTER = 0.1, 0.5
#: The movement of a joint that crosses a body's size in a second; and for how many seconds it must go on, because a
#: depth sensor's joints jump.
_LIMB, _LASTS = 0.0465, 0.1
#: The movement of a joint that goes as far in three fifths of a second as it would at a body's size a second: 0.15 m/s
#: begin a motion, which nobody who stands reaches, by a depth sensor either.
_SLOW_LIMB, _SLOW_WINDOW = 0.1, 0.6
#: A motion begins with so many times the movement of a performer who stands, but not below this share of the usual.
_TREMBLINGS, _LEAST = 4.0, 0.3
#: Seconds for which a performer must have stood before the trembling counts.
_STOOD = 0.5
#: Seconds of stillness kept before and after a motion.
MARGIN = 0.1
#: Seconds that a motion lasts at least.
MIN_SECONDS = 0.4
#: Seconds over which movement is measured, and how often a second it is measured.
WINDOW = 0.2
_MEASURED_AT = 30.0
#: Seconds without a frame after which the meter begins again.
_MAX_PAUSE = 0.5
#: The variance of second differences of white noise, relative to the noise's variance.
_SECOND_DIFFERENCE = 6.0
#: Seconds within which two spans count as equal, because frame times are rounded.
_TIE = 1e-6


class Movement(NamedTuple):
    """How much a body moves.

    Attributes
    ----------
    body
        Of the whole body (`relative_movement`).
    limb
        Of the joint that moves most against the centre of the body (`limb_speed`), as far as it goes on for a tenth of
        a second; scaled so that it begins a motion with the same number.
    slow
        As `limb`, over three fifths of a second: slow gestures begin a motion, too.
    """

    body: float
    limb: float = 0.0
    slow: float = 0.0


class _MeasuredFrame(NamedTuple):
    """A frame: its distance row, each joint relative to the centre of the body, and the sum of their squares."""

    time: float
    positions: NDArray[np.float64]
    row: NDArray[np.float64]
    own: NDArray[np.float64]
    #: NaN where a joint is not seen.
    square: float


class MovementMeter:
    """Measures how much a body moves in the last fifth of a second, frame by frame; joints not seen are left out.

    Parameters
    ----------
    skeleton
        The skeleton of the positions.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        #: The frames of the window, and of the longer one for slow limbs.
        self._frames: deque[_MeasuredFrame] = deque()
        self._longer: deque[_MeasuredFrame] = deque()
        self._limbs: deque[tuple[float, float]] = deque()
        self._due = -math.inf

    def push(self, time: float, positions: NDArray[np.floating]) -> Movement | None:
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
        if self._frames and time - self._frames[-1].time > _MAX_PAUSE:
            for each in (self._frames, self._longer, self._limbs):
                each.clear()
        self._due = time + 1 / _MEASURED_AT if time - self._due > 1 / _MEASURED_AT else self._due + 1 / _MEASURED_AT
        frame = self._measured(time, positions)
        for kept, window in ((self._frames, WINDOW), (self._longer, _SLOW_WINDOW)):
            kept.append(frame)
            while len(kept) > 1 and time - kept[1].time >= window - _TIE:
                kept.popleft()
        if len(self._frames) < 3 or time - self._frames[0].time < WINDOW / 2:
            return None
        rows = np.array([each.row for each in self._frames])
        seen = ~np.isnan(rows).any(axis=0)
        whole = relative_movement(rows if seen.all() else rows[:, seen])
        self._limbs.append((time, _limb_speed(self._frames)))
        while len(self._limbs) > 1 and time - self._limbs[1][0] >= _LASTS - _TIE:
            self._limbs.popleft()
        lasts = time - self._limbs[0][0] >= _LASTS - _TIE
        slow = 0.0
        if time - self._longer[0].time >= _SLOW_WINDOW - _TIE:
            slow = _SLOW_LIMB * _limb_speed(self._longer)
        return Movement(whole, _LIMB * min(speed for _, speed in self._limbs) if lasts else 0.0, slow)

    def _measured(self, time: float, positions: NDArray[np.floating]) -> _MeasuredFrame:
        seen = positions.astype(np.float64)
        own = seen - seen.mean(axis=0)
        return _MeasuredFrame(time, seen, distance_rows(seen, self._skeleton), own, float(np.vdot(own, own)))


def _limb_speed(frames: Sequence[_MeasuredFrame]) -> float:
    """Give `limb_speed` of frames, of which nothing is summed twice where all joints are seen."""
    square, count = sum(each.square for each in frames), len(frames[0].own)
    if math.isnan(square):
        return limb_speed(np.array([each.time for each in frames]), np.array([each.positions for each in frames]))
    if count < 2 or square <= 0:
        return 0.0
    first, second, before, last = frames[0], frames[1], frames[-2], frames[-1]
    went = before.own + last.own - first.own - second.own
    farthest = math.sqrt(float(np.einsum("jc,jc->j", went, went).max()))
    size = math.sqrt(2 * square / (len(frames) * (count - 1)))
    return farthest / (size * (before.time + last.time - first.time - second.time))


def limb_speed(times: NDArray[np.float64], positions: NDArray[np.float64]) -> float:
    """Measure the speed of the joint that is fastest against the centre of the body, in body sizes a second.

    From the mean of the first two frames to the mean of the last two. A body's size is the root mean square of its
    distances.

    Parameters
    ----------
    times
        Seconds, shape (frames,), at least three.
    positions
        Shape (frames, joints, 3), metres; joints that are not seen in every frame are left out.
    """
    bodies = positions[:, ~np.isnan(positions).any(axis=(0, 2))]
    if bodies.shape[1] < 2:
        return 0.0
    bodies = bodies - bodies.mean(axis=1, keepdims=True)
    size = math.sqrt(2 * float(np.square(bodies).sum()) / (len(bodies) * (bodies.shape[1] - 1)))
    went = np.linalg.norm(bodies[-2:].mean(axis=0) - bodies[:2].mean(axis=0), axis=1).max()
    took = float(times[-2:].mean() - times[:2].mean())
    return float(went) / (size * took) if size > 0 else 0.0


def relative_movement(rows: NDArray[np.float64]) -> float:
    """Measure the movement of a whole body in evenly spaced distance rows (frames, pairs), at least three.

    It is the root mean square deviation of the distances, relative to their root mean square. The variance of white
    noise, estimated from the second differences of the distances, is subtracted: a sensor's trembling is no movement.
    """
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


def stillness_of(standing: Sequence[tuple[float, Movement]], usual: float = STILLNESS) -> float:
    """Give the movement below which a performer stands still, from the movement while standing.

    Parameters
    ----------
    standing
        Times in seconds, and the movement at these times.
    usual
        The movement that counts where nobody stood for half a second; also the most.
    """
    if not standing or standing[-1][0] - standing[0][0] < _STOOD:
        return usual
    trembling = max(max(movement) for _, movement in standing)
    return min(max(trembling * _TREMBLINGS / _BEGINS, _LEAST * usual), usual)


class StretchFinder:
    """Finds where a motion begins and ends, by hysteresis: it begins with twice the movement that ends it.

    A motion begins with the movement of the body or of a limb, also a slow one. It ends with the stillness of the body
    if the body moved as much as usual motions do, for people fidget between motions; else the limbs must be still, too.

    Parameters
    ----------
    stillness
        Movement below which the body stands still.

    Attributes
    ----------
    began
        When the motion that goes on began, seconds; None while the body stands still.
    needed
        The movement that begins a motion.
    """

    def __init__(self, stillness: float = STILLNESS) -> None:
        self._stillness, self.needed = stillness, _BEGINS * stillness
        self.clear()

    def clear(self) -> None:
        """Forget all movements."""
        self.began: float | None = None
        self._rising = self._moved = math.nan
        self._is_large = self._is_fast = False

    def push(self, time: float, movement: Movement) -> Stretch | None:
        """Take in the movement at a time; give a motion, with its margins, when it has ended."""
        self._is_large |= movement.body >= _BEGINS * STILLNESS
        self._is_fast |= max(movement[:2]) >= self.needed
        if self.began is None:
            if max(movement) < self.needed:
                self._is_large = self._is_fast = False
                self._rising = math.nan
            elif math.isnan(self._rising):
                self._rising = time
            elif time - self._rising >= BEGINS_AFTER - _TIE:
                self.began, self._moved = self._rising, time
            return None
        moves = movement[: 1 if self._is_large else 2 if self._is_fast else 3]
        if max(moves) > self._stillness:
            self._moved = time
            return None
        return self.end() if time - self._moved >= ENDS_AFTER - _TIE else None

    def end(self) -> Stretch | None:
        """End the motion that goes on; None when no motion goes on."""
        if self.began is None:
            return None
        # The window contains the last movement for as long as it lasts.
        window = WINDOW if self._is_large or self._is_fast else _SLOW_WINDOW
        found = Stretch(self.began - MARGIN, max(self._moved - window, self.began) + MARGIN)
        self.clear()
        return found


def stretches_of(clip: Clip, stillness: float = STILLNESS) -> list[Stretch]:
    """Find the motions of a take that lie between stillnesses, in seconds from its beginning; none in its gaps."""
    return [found for found in moved_in(clip, stillness) if found.duration >= MIN_SECONDS]


def moved_in(clip: Clip, stillness: float = STILLNESS) -> Iterator[Stretch]:
    """Find all times at which the body of a take moves, also too short ones; as `stretches_of`."""
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


def moved_at_all(clip: Clip) -> Stretch | None:
    """Find the movement in a take, from its first to its last motion; None when it is too short.

    Where nothing moves by the usual measure, a small gesture before a quiet feed may: it is looked for, too.
    """
    for still in (STILLNESS, _LEAST * STILLNESS):
        if found := [*moved_in(clip, still)]:
            kept = Stretch(found[0].start, found[-1].end)
            if kept.duration >= MIN_SECONDS:
                return kept
    return None


def _within(found: Stretch, begin: float, end: float) -> Stretch:
    return Stretch(max(found.start, begin), min(found.end, end))
