"""A performer's progress in a motion, its speed and its size: a forward filter over the moments of the library.

The filter holds the probability of each moment of each recording of the class (a hidden Markov model whose states are
the moments; Bevilacqua et al. 2010 follow one recording in this way). Each step moves every probability on along its
recording, lets some change to other recordings at the same phase, and weighs all by their likeness to the live body
(`library.progress.filtering`).
"""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from kinespace.library.progress import phase_table
from kinespace.library.progress.filtering import follow_phase, moving
from kinespace.library.progress.phase_table import Moments, PhaseTable
from kinespace.stream.recognition import Progress

#: Seconds between two steps of the filter: two steps a moment at the library's speed.
STEP = 0.5 / phase_table.MOMENTS_PER_SECOND
#: Probabilities that a step goes on by 0, 1, 2 moments: standing still to four times the library's speed.
_GOES_ON = (0.55, 0.36, 0.09)
#: Probabilities that a step changes to another recording at the same phase, and that it begins again.
_CHANGES, _BEGINS = 0.1, 1e-6
#: The share that begins in the first phases, and these phases. The rest begins later, with a probability that falls
#: towards the end, because before a motion a body often stands as it does after it.
_AT_START, _FIRST_PHASES, _FALLING = 0.9, 0.12, 4
#: Weight of a vector's squared distance.
_SHARPNESS = 1 / 16
#: Probability that a step beyond the end of a recording begins the next round: of a cyclic motion, and of another.
_NEXT_ROUND, _ONCE_MORE = 0.5, 0.02
#: Phases this near count as the same for `sure`.
_NEAR = 0.1
#: A scrubbed phase goes back when the phase is this much behind it.
_BACK = 0.15
#: Seconds over which speed and amplitude are smoothed.
_SPEED_SMOOTHED, _SIZE_SMOOTHED = 0.15, 0.4
#: Weight of the library's speed before the body is seen, relative to the class's mean squared velocity.
_PRIOR_SPEED = 0.1
#: Points of the past that are replayed when a class is named, half a second, and points that are kept.
_REPLAYED = round(0.5 / STEP)
_PAST = round(2 * phase_table.SWING_SECONDS / STEP) + 1
#: Tolerance, as a share of a step, because times are rounded.
_ROUNDING = 1e-3
#: Points before the newest at which a velocity begins.
_BACK_POINTS = round(phase_table.VELOCITY_SECONDS / STEP)


class ProgressFollower:
    """Follows one performer through the motions that are named.

    Parameters
    ----------
    table
        The moments of the library's motions.
    """

    def __init__(self, table: PhaseTable) -> None:
        self._table = table
        self._courses: dict[str, _Course] = {}
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
        self._courses = {}
        self._begin(name)

    def push(self, time: float, point: NDArray[np.float64], class_name: str | None) -> Progress | None:
        """Take in the body's position.

        Parameters
        ----------
        time
            Seconds, on the clock of the frames; later than before.
        point
            The body in the library's basis, relative to its size, shape (directions,).
        class_name
            The motion that goes on; None for none, which gives no progress.

        Returns
        -------
        The progress of the motion that goes on, at the filter's last step; None without a motion.
        """
        steps = self._steps_until(time)
        if steps:
            self._extend(point, steps)
        if class_name != self._class_name:
            self._begin(class_name)
        elif self._filter:
            for end in range(self._count - steps + 1, self._count + 1):
                self.progress = self._filter.step(max(0, end - _PAST), end)
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
        """Keep the newest point; between two hops the body is assumed to move in a straight line."""
        if self._count + steps > len(self._points):
            self._points[:_PAST] = self._points[self._count - _PAST : self._count]
            self._count = _PAST
        if steps == 1 or not self._count:
            self._points[self._count : self._count + steps] = point
        else:
            before = self._points[self._count - 1]
            shares = np.arange(1, steps + 1)[:, None] / steps
            self._points[self._count : self._count + steps] = before + (point - before) * shares
        self._count += steps

    def _begin(self, class_name: str | None) -> None:
        """Begin to follow another class, by replaying the last half second into a new filter."""
        self._class_name, self.progress, self._filter = class_name, None, None
        moments = self._table.classes.get(class_name) if class_name else None
        if moments is None:
            return
        name = str(class_name)
        course = self._courses.get(name) or self._courses.setdefault(name, _Course.of(moments))
        self._filter = _Filter(name, moments, course, self._table.whitening, self._points)
        for end in range(max(1, self._count - _REPLAYED), self._count + 1):
            self.progress = self._filter.step(max(0, end - _PAST), end)


class _Course(NamedTuple):
    """The arrays of one class that a step of the filter reads (`library.progress.filtering`)."""

    course: NDArray[np.float64]
    indices: NDArray[np.intp]
    expected: NDArray[np.float64]
    constants: NDArray[np.float64]
    lengths: NDArray[np.float32]

    @classmethod
    def of(cls, moments: Moments) -> Self:
        phases = moments.phases
        first = phases < _FIRST_PHASES
        later = np.where(first, 0.0, (1 - phases) ** _FALLING)
        beginning = _AT_START * first / first.sum() + (1 - _AT_START) * later / max(later.sum(), 1e-9)
        rounds = np.where(phases < 1 / phase_table.BINS, 1.0, 0.0)
        bins = np.minimum((phases * phase_table.BINS).astype(np.intp), phase_table.BINS - 1)
        alike = 1 / np.bincount(bins, minlength=phase_table.BINS).clip(1)[bins]
        again = _NEXT_ROUND if moments.cyclic else _ONCE_MORE
        return cls(
            np.array([phases, beginning / beginning.sum(), rounds / max(rounds.sum(), 1.0), alike]),
            np.array([bins, phases.argsort(kind="stable")]),
            np.array([moments.speeds, moments.usual_speeds, moments.usual_swings]),
            np.array([*_GOES_ON, _CHANGES, _BEGINS, again, _SHARPNESS, _NEAR]),
            np.square(moments.vectors).sum(axis=0),
        )


class _Filter:
    """The forward filter of one class."""

    def __init__(
        self,
        class_name: str,
        moments: Moments,
        course: _Course,
        whitening: NDArray[np.float64],
        points: NDArray[np.float64],
    ) -> None:
        self._class_name, self._cyclic = class_name, moments.cyclic
        count = len(moments.phases)
        live = np.zeros(len(moments.vectors), dtype=np.float32)
        self._moved, self._found = np.zeros(2), np.zeros(2 + len(course.expected))
        self._move = moving(points, whitening, live, self._moved, phase_table.VELOCITY)
        self._follow = follow_phase(
            *(course.course, course.indices, moments.starts, moments.vectors, course.lengths, course.expected),
            *(course.constants, live, course.course[1].copy(), np.zeros(count), self._found),
        )
        self._squares = self._expected = self._usual = self._weight = 0.0
        self._swing = self._swings = 0.0
        self._speed, self._floor = 1.0, _PRIOR_SPEED * float(moments.speeds.mean())
        self._scrub = 0.0
        self._cycles, self._last = 0, 0.0

    def step(self, begin: int, end: int) -> Progress:
        """Go on by a step, and weigh by the newest of the points from one place to another."""
        span = max(2, round(phase_table.SWING_SECONDS / STEP / min(max(self._speed, 0.5), 1.5)))
        self._move(max(begin, end - span), end, _BACK_POINTS)
        square, variance = self._moved.tolist()
        self._follow()
        phase, sure, expected, usual, usual_swing = self._found.tolist()
        self._measure(square, expected, usual)
        self._swing = _SIZE_KEPT * self._swing + phase_table.log_swing(variance) - usual_swing
        self._swings = _SIZE_KEPT * self._swings + 1
        return self._answer(phase, sure)

    def _measure(self, square: float, expected: float, usual: float) -> None:
        """Follow the body's speed relative to its likely moments, and relative to its class at that phase."""
        self._squares = _SPEED_KEPT * self._squares + square
        self._expected = _SPEED_KEPT * self._expected + expected
        self._usual = _SPEED_KEPT * self._usual + usual
        self._weight = _SPEED_KEPT * self._weight + 1
        floor = self._floor * self._weight
        likely = math.sqrt((self._expected + floor) * (self._usual + floor))
        self._speed = math.sqrt((self._squares + floor) / likely) if likely > 0 else 1.0

    def _answer(self, phase: float, sure: float) -> Progress:
        if self._cyclic and phase < self._last - 0.5:
            self._cycles += 1
            self._scrub = phase
        self._last = phase
        if not self._scrub - _BACK <= phase <= self._scrub:
            self._scrub = phase
        amplitude = math.exp(self._swing / self._swings)
        return Progress(self._class_name, phase, self._scrub, self._speed, amplitude, sure, self._cycles)


#: Share of a smoothed number that a step keeps.
_SPEED_KEPT, _SIZE_KEPT = math.exp(-STEP / _SPEED_SMOOTHED), math.exp(-STEP / _SIZE_SMOOTHED)
