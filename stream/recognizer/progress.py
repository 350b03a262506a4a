"""A performer's progress in a motion, its speed and its size: a forward filter over the keyframes of the library.

The filter holds the probability of each keyframe of each recording of the class (a hidden Markov model whose states are
the keyframes; Bevilacqua et al. 2010 follow one recording in this way). Each step moves every probability on along its
recording, lets some change to other recordings at the same phase, and weighs all by their likeness to the live body.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinespace.library import phases
from kinespace.library.phases import Keyframes, PhaseTable
from kinespace.stream.recognition import Progress

#: Seconds between two steps of the filter: two steps a keyframe at the library's speed.
STEP = 0.5 / phases.KEYFRAMES_PER_SECOND
#: Probabilities that a step goes on by 0, 1, 2 keyframes: standing still to four times the library's speed.
_GOES_ON = (0.55, 0.36, 0.09)
#: Probabilities that a step changes to another recording at the same phase, and that it begins again.
_CHANGES, _BEGINS = 0.1, 1e-6
#: The share that begins in the first phases, and these phases. The rest begins later, with a probability that falls
#: towards the end, because before a motion a body often stands as it does after it.
_AT_START, _FIRST_PHASES, _FALLING = 0.9, 0.12, 4
#: Weight of a vector's squared distance; a number of numpy's own asks for double precision.
_SHARPNESS = np.float64(1 / 16)
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
_PAST = round(2 * phases.SWING_SECONDS / STEP) + 1
#: Tolerance, as a share of a step, because times are rounded.
_ROUNDING = 1e-3
#: Points before the newest at which a velocity begins.
_BACK_POINTS = round(phases.VELOCITY_SECONDS / STEP)


class ProgressFollower:
    """Follows one performer through the motions that are named.

    Parameters
    ----------
    table
        The keyframes of the library's motions.
    """

    def __init__(self, table: PhaseTable) -> None:
        self._table = table
        self.clear()

    def clear(self) -> None:
        """Forget the body's past and the motion."""
        self._points = np.empty((0, self._table.basis.directions.shape[1]))
        self._time = math.nan
        self._filter: _Filter | None = None
        self._class_name: str | None = None
        self.progress: Progress | None = None

    def exchange(self, table: PhaseTable) -> None:
        """Follow by another library; in the same basis the motion that goes on is found again at once."""
        before, self._table = self._table, table
        if table.basis is not before.basis:
            self.clear()
        self._begin(self._class_name)

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
        else:
            self._step_through(steps)
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
        before = self._points[-1] if len(self._points) else point
        new = before + (point - before) * (np.arange(1, steps + 1)[:, None] / steps)
        new[-1] = point
        self._points = np.concatenate([self._points, new])[-_PAST - _REPLAYED :]

    def _begin(self, class_name: str | None) -> None:
        """Begin to follow another class, by replaying the last half second into a new filter."""
        self._class_name, self.progress, self._filter = class_name, None, None
        keyframes = self._table.classes.get(class_name) if class_name else None
        if keyframes:
            self._filter = _Filter(str(class_name), keyframes, self._table.whitening)
            self._step_through(_REPLAYED + 1)

    def _step_through(self, most: int) -> None:
        """Let the filter go on by the last points, by so many at most."""
        if self._filter is None:
            return
        for end in range(max(len(self._points) - most, 0) + 1, len(self._points) + 1):
            self.progress = self._filter.step(self._points[max(0, end - _PAST) : end])


class _Filter:
    """The forward filter of one class: it believes in each keyframe of each recording, (recordings, keyframes)."""

    def __init__(self, class_name: str, keyframes: Keyframes, whitening: NDArray[np.float64]) -> None:
        self._class_name, self._keyframes, self._whitening = class_name, keyframes, whitening
        recordings, count = keyframes.speeds.shape
        self._phases = np.linspace(0.0, 1.0, count)
        first = self._phases < _FIRST_PHASES
        later = np.where(first, 0.0, (1 - self._phases) ** _FALLING)
        #: How probably it begins at each keyframe, shape (keyframes,).
        self._beginning = (_AT_START * first / first.sum() + (1 - _AT_START) * later / later.sum()) / recordings
        self._belief = np.tile(self._beginning, (recordings, 1))
        self._lengths = np.square(keyframes.vectors).sum(axis=2)
        self._squares = self._expected = self._usual = self._weight = 0.0
        self._swing = self._swings = 0.0
        self._speed, self._floor = 1.0, _PRIOR_SPEED * float(keyframes.speeds.mean())
        self._scrub = 0.0
        self._cycles, self._last = 0, 0.0

    def step(self, points: NDArray[np.float64]) -> Progress:
        """Go on by a step, and weigh by the newest of the points, shape (points, directions)."""
        some = points[-max(2, round(phases.SWING_SECONDS / STEP / min(max(self._speed, 0.5), 1.5))) :]
        velocity = phases.VELOCITY * (some[-1] - some[max(len(some) - 1 - _BACK_POINTS, 0)])
        live = (np.concatenate([some[-1], velocity]) @ self._whitening).astype(np.float32)
        self._belief = belief = self._weighed(self._goes_on(), live)
        at, keyframes = belief.sum(axis=0), self._keyframes
        self._measure(
            float(velocity @ velocity), float((belief * keyframes.speeds).sum()), float(at @ keyframes.usual_speeds)
        )
        swing = phases.log_swing(float(some.var(axis=0).sum())) - float(at @ keyframes.usual_swings)
        self._swing = _SIZE_KEPT * self._swing + swing
        self._swings = _SIZE_KEPT * self._swings + 1
        # Half the probability lies below the phase. The first keyframe's counts as below, the last one's as above.
        phase = float(np.interp(0.5, at.cumsum() - self._phases * at, self._phases))
        return self._answer(phase, float(at[np.abs(self._phases - phase) <= _NEAR].sum()))

    def _goes_on(self) -> NDArray[np.float64]:
        """Move the probability of every keyframe on by a step."""
        belief, (stay, one, two) = self._belief, _GOES_ON
        after: NDArray[np.float64] = stay * belief
        after[:, 1:] += one * belief[:, :-1]
        after[:, 2:] += two * belief[:, :-2]
        beyond = (one + two) * belief[:, -1] + two * belief[:, -2]
        again = _NEXT_ROUND if self._keyframes.cyclic else _ONCE_MORE
        after[:, -1] += (1 - again) * beyond
        after[:, 0] += again * beyond.mean()
        others: NDArray[np.float64] = _CHANGES * after.mean(axis=0) + _BEGINS * self._beginning
        return (1 - _CHANGES - _BEGINS) * after + others

    def _weighed(self, belief: NDArray[np.float64], live: NDArray[np.float32]) -> NDArray[np.float64]:
        """Weigh the probability of every keyframe by its likeness to the live body's vector, shape (axes,)."""
        squares = self._lengths - 2 * (self._keyframes.vectors @ live)
        weighed: NDArray[np.float64] = belief * np.exp(-0.5 * _SHARPNESS * (squares - squares.min()))
        total = float(weighed.sum())
        return weighed / total if total > 0 else np.tile(self._beginning, (len(belief), 1))

    def _measure(self, square: float, expected: float, usual: float) -> None:
        """Follow the body's speed relative to its likely keyframes, and relative to its class at that phase."""
        self._squares = _SPEED_KEPT * self._squares + square
        self._expected = _SPEED_KEPT * self._expected + expected
        self._usual = _SPEED_KEPT * self._usual + usual
        self._weight = _SPEED_KEPT * self._weight + 1
        floor = self._floor * self._weight
        likely = math.sqrt((self._expected + floor) * (self._usual + floor))
        self._speed = math.sqrt((self._squares + floor) / likely) if likely > 0 else 1.0

    def _answer(self, phase: float, sure: float) -> Progress:
        if self._keyframes.cyclic and phase < self._last - 0.5:
            self._cycles += 1
            self._scrub = phase
        self._last = phase
        if not self._scrub - _BACK <= phase <= self._scrub:
            self._scrub = phase
        amplitude = math.exp(self._swing / self._swings)
        return Progress(self._class_name, phase, self._scrub, self._speed, amplitude, sure, self._cycles)


#: Share of a smoothed number that a step keeps.
_SPEED_KEPT, _SIZE_KEPT = math.exp(-STEP / _SPEED_SMOOTHED), math.exp(-STEP / _SIZE_SMOOTHED)
