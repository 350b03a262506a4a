"""How far in a motion a performer is, how fast and how large: a forward filter over the moments of the library.

The filter holds how probable each moment of each recording of the class is (a hidden Markov model whose states are the
moments; Bevilacqua et al. 2010 follow one recording so). At each step it moves every probability on along its
recording, lets some change to other recordings at the same phase, and weighs all by how alike the live body is.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.progress.phase_table import (
    MOMENTS_PER_SECOND,
    SWING_SECONDS,
    VELOCITY_SECONDS,
    moving_point,
    swing_of,
)
from kinespace.stream.recognition import Progress

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.library.progress.phase_table import Moments, PhaseTable

#: Seconds between two steps of the filter: two steps a moment at the library's speed.
STEP = 0.5 / MOMENTS_PER_SECOND
#: How probable it is that a step goes on by 0, 1, 2 moments: standing still to four times the library's speed.
_GOES_ON = (0.55, 0.36, 0.09)
#: How probable a step changes to another recording at the same phase, and begins anew.
_CHANGES, _BEGINS = 0.01, 1e-5
#: Of what begins, how much begins in the first phases, and which phases those are.
_AT_START, _FIRST_PHASES = 0.8, 0.12
#: How much a vector's squared distance counts, spread over its numbers.
_SHARPNESS = 4.0
#: At the end of a cyclic recording, how probable a step that would go beyond begins the next round.
_NEXT_ROUND = 0.5
#: Bins in which phases are alike.
_BINS = 40
#: Phases this near count as the same when the filter says how sure it is.
_NEAR = 0.1
#: A scrubbed phase goes back when the phase is this much behind it.
_BACK = 0.15
#: Seconds over which speed and amplitude are smoothed.
_SMOOTHED = 0.25
#: How many of the class's mean squared velocity speak for the library's speed before the body is seen.
_PRIOR_SPEED = 0.3
#: Points of the past that are replayed when a class is named, half a second, and points that are kept.
_REPLAYED = round(0.5 / STEP)
_PAST = round(2 * SWING_SECONDS / STEP) + 1
#: Tolerance, as a share of a step, because times are rounded.
_ROUNDING = 1e-3
#: Points that a velocity needs.
_SPAN = round(VELOCITY_SECONDS / STEP) + 1


class ProgressFollower:
    """Follows one performer through the motions that are named.

    Parameters
    ----------
    table
        The moments of the library's motions.
    """

    def __init__(self, table: PhaseTable) -> None:
        self._table = table
        self._points = np.empty((8 * _PAST, table.basis.directions.shape[1]))
        self.clear()

    def clear(self) -> None:
        """Forget the body's past and the motion."""
        self._count = 0
        self._time = math.nan
        self._filter: _Filter | None = None
        self._class_name: str | None = None
        self.progress: Progress | None = None

    def exchange(self, table: PhaseTable) -> None:
        """Follow by another library; in the same basis the motion that goes on is found again at once."""
        if table.basis is not self._table.basis:
            self._points = np.empty((len(self._points), table.basis.directions.shape[1]))
            self.clear()
        self._table, name, self._class_name = table, self._class_name, None
        self._begin(name)

    def push(self, time: float, point: NDArray[np.float64], class_name: str | None) -> Progress | None:
        """Take in where the body is.

        Parameters
        ----------
        time
            Seconds, on the clock of the frames; later than before.
        point
            The body in the library's basis, relative to its size, shape (directions,).
        class_name
            The motion that goes on; None for none, and then there is no progress.

        Returns
        -------
        The progress of the motion that goes on, as of the filter's last step; None without one.
        """
        steps = self._steps_until(time)
        if steps:
            self._extend(point, steps)
        if class_name != self._class_name:
            self._begin(class_name)
        elif self._filter and steps:
            self.progress = self._filter.step(self._past(self._count), steps)
        return self.progress

    def _steps_until(self, time: float) -> int:
        """Count the steps that are due, and keep them on a grid; after a long gap there is one."""
        steps = 1 if math.isnan(self._time) else int((time - self._time) / STEP + _ROUNDING)
        if math.isnan(self._time) or steps > _PAST:
            self._time, steps = time, 1
        else:
            self._time += steps * STEP
        return steps

    def _extend(self, point: NDArray[np.float64], steps: int) -> None:
        """Keep the newest point; between two hops the body is taken to have moved in a straight line."""
        if self._count + steps > len(self._points):
            self._points[:_PAST] = self._points[self._count - _PAST : self._count]
            self._count = _PAST
        before = self._points[self._count - 1] if self._count else point
        shares = np.arange(1, steps + 1)[:, None] / steps
        self._points[self._count : self._count + steps] = before + (point - before) * shares
        self._count += steps

    def _past(self, end: int) -> NDArray[np.float64]:
        return self._points[max(0, end - _PAST) : end]

    def _begin(self, class_name: str | None) -> None:
        """Begin to follow another class, by replaying the last half second into a new filter."""
        self._class_name, self.progress, self._filter = class_name, None, None
        moments = self._table.classes.get(class_name) if class_name else None
        if moments is None:
            return
        self._filter = _Filter(str(class_name), moments, self._table.whitening)
        for end in range(max(1, self._count - _REPLAYED), self._count + 1):
            self.progress = self._filter.step(self._past(end), 1)


class _Filter:
    """The forward filter of one class."""

    def __init__(self, class_name: str, moments: Moments, whitening: NDArray[np.float64]) -> None:
        self._class_name = class_name
        self._moments, self._whitening = moments, whitening
        phases, count = moments.phases, len(moments.phases)
        first = phases < _FIRST_PHASES
        self._beginning = np.where(first, _AT_START / first.sum(), (1 - _AT_START) / max(count - first.sum(), 1))
        self._bins = np.minimum((phases * _BINS).astype(np.intp), _BINS - 1)
        self._alike = 1 / np.maximum(np.bincount(self._bins, minlength=_BINS), 1)
        self._ends = np.append(moments.starts[1:], count) - 1
        self._inside_one, self._inside_two = np.ones(count), np.ones(count)
        self._inside_one[moments.starts] = 0.0
        self._inside_two[moments.starts] = self._inside_two[np.minimum(moments.starts + 1, count - 1)] = 0.0
        self._order = phases.argsort(kind="stable")
        self._squares = (moments.vectors**2).sum(axis=1)
        self._sharpness = _SHARPNESS / moments.vectors.shape[1]
        self._rounds = np.where(phases < 1 / _BINS, 1.0, 0.0) if moments.cyclic else np.zeros(count)
        self._rounds /= max(self._rounds.sum(), 1.0)
        self._belief = self._beginning.copy()
        self._live = self._expected = self._swing = 0.0
        self._weight = 0.0
        self._scrub = 0.0
        self._cycles, self._last = 0, 0.0
        self._floor = _PRIOR_SPEED * float(moments.speeds.mean())

    def step(self, points: NDArray[np.float64], steps: int) -> Progress:
        """Go on by some steps, and weigh with the newest of the points, shape (points, directions)."""
        for _ in range(steps):
            self._go_on()
        vector = moving_point(points[max(0, len(points) - _SPAN)], points[-1])
        placed = vector @ self._whitening
        squares = self._squares - 2 * (self._moments.vectors @ placed)
        belief = self._belief * np.exp(-0.5 * self._sharpness * (squares - squares.min()))
        total = float(belief.sum())
        self._belief = belief / total if total > 0 else self._beginning.copy()
        self._measure(vector, points, steps)
        return self._told()

    def _go_on(self) -> None:
        stay, one, two = _GOES_ON
        before, ends = self._belief, self._ends
        after = stay * before
        after[1:] += one * before[:-1] * self._inside_one[1:]
        after[2:] += two * before[:-2] * self._inside_two[2:]
        beyond = (one + two) * before[ends] + two * before[ends - 1]
        if self._moments.cyclic:
            after += self._rounds * (_NEXT_ROUND * beyond.sum())
            beyond *= 1 - _NEXT_ROUND
        after[ends] += beyond
        mass = np.bincount(self._bins, weights=after, minlength=_BINS)
        after *= 1 - _CHANGES - _BEGINS
        after += _CHANGES * (mass * self._alike)[self._bins]
        after += _BEGINS * self._beginning
        self._belief = after

    def _measure(self, vector: NDArray[np.float64], points: NDArray[np.float64], steps: int) -> None:
        """Follow how fast and how large the body moves beside the moments it is likely at."""
        fading = math.exp(-steps * STEP / _SMOOTHED)
        velocity = vector[len(vector) // 2 :]
        self._live = fading * self._live + float(velocity @ velocity)
        self._expected = fading * self._expected + float(self._belief @ self._moments.speeds)
        self._weight = fading * self._weight + 1
        span = max(2, round(SWING_SECONDS / STEP / min(max(self._speed(), 0.5), 1.5)))
        swing = swing_of(points[-span:]) - float(self._belief @ self._moments.swings)
        self._swing = fading * self._swing + swing

    def _speed(self) -> float:
        floor = self._floor * self._weight
        return math.sqrt((self._live + floor) / (self._expected + floor))

    def _told(self) -> Progress:
        phases = self._moments.phases
        mass = np.cumsum(self._belief[self._order])
        phase = float(phases[self._order[min(int(np.searchsorted(mass, 0.5)), len(mass) - 1)]])
        sure = float(self._belief[np.abs(phases - phase) <= _NEAR].sum())
        if self._moments.cyclic and phase < self._last - 0.5:
            self._cycles += 1
            self._scrub = phase
        self._last = phase
        if not self._scrub - _BACK <= phase <= self._scrub:
            self._scrub = phase
        return Progress(
            self._class_name,
            phase,
            self._scrub,
            self._speed(),
            math.exp(self._swing / self._weight),
            sure,
            self._cycles,
        )
