"""Whole motions: a window that ends now is compared with the library's motions from their beginning to their end.

This is the paper's own comparison (Le Naour et al. 2012): the window is as long as the motion. Two numbers are read off
the points of a window in the basis, for windows of several lengths:

- course: what moved in which order, as the cosine coefficients of each direction over the window (its discrete cosine
  transform; the coefficient of order 1 is the trend), of unit length together, so that the motion's size drops out. In
  a metric learned from people (`library.windows.metric`) half a motion is as far from it as another motion;
- spread: how far each direction swings, in logarithms relative to the body's size.

A motion is trimmed to the part in which the body moves. A motion that repeats itself is cut into its rounds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from kinespace.library.distances import distance_rows
from kinespace.library.motion_library import NOTHING
from kinespace.library.progress.phase_table import MOMENTS_PER_SECOND, points_of
from kinespace.library.signature.parts import LEVEL_REMOVED, NOISE_FLOOR
from kinespace.library.windows.metric import Lessons, Metric, learned_metric

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kinespace.library.clip import Clip
    from kinespace.library.signature.basis import Basis
    from kinespace.library.signature.body import Body

    Numbers = NDArray[np.float64]

#: Seconds between two points of a course.
STEP = 1 / MOMENTS_PER_SECOND
#: Orders of the cosines; 0 is the mean, which is the person's posture and is left out.
_ORDERS = np.arange(1, 8)
#: Seconds of the shortest course, and how much longer the next window is than the one before.
SHORTEST, _LONGER = 0.45, 1.25
#: A window is compared with motions at most so much shorter or longer.
_MAX_SPEED = 1.6
#: The share of a motion's way, at either end, that is left out: still ends.
_STILL_WAY = 0.04
#: The least mean squared difference of a motion from itself a round later, relative to unrelated postures, at which the
#: motion repeats itself; seconds of a round, at least; rounds in a motion, at least, and in other motions of its class.
_SAME, _MIN_ROUND, _ROUNDS, _ROUNDS_OF_CLASS = 0.6, 0.3, 1.7, 1.3
#: Rounds begin at so many moments of a round, because a stranger may begin anywhere.
_BEGINNINGS = 4
#: Deviation of the distances, relative to their size, below which a motion is one posture, and moments that show it.
_MIN_MOVEMENT, _SHOWN = 0.02, 16
_SHRINKAGE, _AXES = 0.3, 64
#: The mean squared distance of courses from their mean below which they teach no metric, and the squared distance of
#: two people's nearest courses of one class in HDM05, which counts as 1 then.
_ALIKE, _USUAL = 0.05, 0.42
#: Added to squared distances of courses and of spreads before the logarithm.
_NEAREST_COURSE, _NEAREST_SPREAD = 0.02, 0.5
_MAX_LEAD = 2.0
#: Logarithms of speed and amplitude count no more than this.
_MAX_SIZE = 2.0


class Weights(NamedTuple):
    """The evidence that a motion was done is the sum of these times its numbers.

    Fitted as a logistic function: motions of three persons of HDM05 by a library of the others, against all windows
    that were nearest to a class while the class was not performed, also in takes of nine subjects of CMU's and of three
    persons of UI-PRMD.
    """

    offset: float = 8.27
    #: Log distance of the nearest course, and of the nearest spread; log distance by which other spreads are farther.
    course: float = -2.81
    spread: float = -2.41
    lead: float = 1.48
    #: Absolute logarithms of speed and of amplitude.
    speed: float = -1.32
    amplitude: float = -1.31


WEIGHTS = Weights()
#: False alarms an hour, and the evidence above which so many happen.
_PROMISED, _LIMITS = (1.0, 6.0, 60.0, 600.0), (3.4, 2.7, 1.65, -0.3)


#: The share of a library's own motions whose evidence for another class than theirs lies below this in the built-in
#: library, for which the limits were chosen; and how far a library's limits may lie from those, either way.
_SHARE, _OF_BUILTIN, _MAX_RAISED = 0.8, -1.5, (-1.0, 2.0)


def has_course(clip: Clip) -> bool:
    """Say whether a motion has a course: it is long enough, and more than one posture."""
    if clip.duration < SHORTEST:
        return False
    rows = distance_rows(clip.positions[:: max(clip.frames // _SHOWN, 1)], clip.skeleton)
    return bool(rows.var(axis=0).sum() >= _MIN_MOVEMENT**2 * np.square(rows.mean(axis=0)).sum())


def without_course(motions: Sequence[Clip]) -> list[str]:
    """Give the classes of which no motion has a course: they have starts and ends, and are never done."""
    names = {clip.class_name for clip in motions} - {NOTHING}
    return sorted(names - {clip.class_name for clip in motions if has_course(clip)})


class Judged(NamedTuple):
    """The evidence that a motion was done, and its speed and amplitude relative to the nearest motion's."""

    evidence: float
    speed: float
    amplitude: float


@dataclass(frozen=True, slots=True, eq=False)
class WholeMotions:
    """The whole motions of a library, class by class.

    Attributes
    ----------
    classes
        The classes with a course, sorted; `nothing` among them where the library holds such motions.
    starts
        Where each class begins, and the end, shape (classes + 1,).
    metric
        Maps a course's numbers to its vector.
    courses, spreads
        Shape (axes, motions) and (directions, motions).
    seconds, swings
        Logarithms of each motion's length and swing, shape (motions,).
    lengths
        Points in the windows that are compared, ascending.
    raised
        How much more evidence is needed than in the built-in library.
    """

    classes: tuple[str, ...]
    starts: NDArray[np.intp] = field(repr=False)
    metric: Metric = field(repr=False)
    courses: NDArray[np.float32] = field(repr=False)
    spreads: NDArray[np.float32] = field(repr=False)
    seconds: Numbers = field(repr=False)
    swings: Numbers = field(repr=False)
    lengths: tuple[int, ...]
    _curves: NDArray[np.float32] = field(repr=False)
    _means: NDArray[np.float32] = field(repr=False)
    #: Squared lengths of courses and of spreads, infinite where a motion is much shorter or longer than a window:
    #: shape (2, lengths, motions).
    _squares: NDArray[np.float32] = field(repr=False)
    raised: float = 0.0

    @classmethod
    def of(cls, motions: Sequence[Clip], teachers: Sequence[Clip], body: Body, basis: Basis) -> Self:
        """Cut the courses out of motions.

        Parameters
        ----------
        motions
            The motions, over one skeleton.
        teachers
            The motions from which the metric is learned; of the same joints.
        body, basis
            The body and the basis of the skeleton.
        """
        cut = sorted(_cut(motions, body, basis), key=lambda each: each.class_name)
        taught = cut if teachers is motions else _cut(teachers, body, basis)
        width = basis.directions.shape[1]
        numbers = _stacked([_course(each.points) for each in taught], len(_ORDERS) * width)
        if len(taught) > 1 and numbers.var(axis=0).sum() > _ALIKE:
            metric = learned_metric(numbers, _lessons(taught), shrinkage=_SHRINKAGE, kept=_AXES)
        else:
            origin = np.zeros(numbers.shape[1], dtype=np.float32)
            metric = Metric(origin, np.eye(len(origin), dtype=np.float32) / np.float32(math.sqrt(_USUAL)))
        names = [each.class_name for each in cut]
        classes = tuple(sorted(set(names)))
        seconds = np.log([(len(each.points) - 1) * STEP for each in cut])
        lengths = _lengths(seconds)
        longest = lengths[-1] if lengths else 0
        curves, means = np.zeros((len(lengths), len(_ORDERS), longest)), np.zeros((len(lengths), longest))
        for place, count in enumerate(lengths):
            curves[place, :, longest - count :], means[place, longest - count :] = _cosines(count), 1 / count
        logs = np.log((np.array(lengths) - 1) * STEP)[:, None] - seconds
        too_far = np.where(np.abs(logs) < math.log(_MAX_SPEED), 0.0, np.inf)
        own = _stacked([_course(each.points) for each in cut], numbers.shape[1])
        courses = np.ascontiguousarray(metric.place(own).T)
        spreads = _stacked([_spread(each.points.var(axis=0)) for each in cut], width).T.astype(np.float32, order="C")
        squares = [np.square(each).sum(axis=0) + too_far for each in (courses, spreads)]
        return cls(
            classes,
            np.searchsorted(names, [*classes, "\U0010ffff"]),
            metric,
            courses,
            spreads,
            seconds,
            np.array([log_size(each.points.var(axis=0)) for each in cut]),
            lengths,
            curves.reshape(len(lengths) * len(_ORDERS), longest).astype(np.float32),
            means.astype(np.float32),
            np.array(squares, dtype=np.float32),
        ).calibrated()

    def limit_at(self, false_alarms: float) -> float:
        """Give the evidence from which a motion is done, for a number of false alarms an hour that is accepted.

        Where a library's classes are more alike than the built-in library's, unknown movement is so, too.
        """
        return self.raised + float(np.interp(math.log(false_alarms), np.log(_PROMISED), _LIMITS))

    def calibrated(self) -> Self:
        """Raise the limits by the evidence that most of the motions have for another class, their own left out."""
        if len(self.classes) < 2:
            return self
        own = np.arange(len(self.seconds)), np.repeat(np.arange(len(self.classes)), np.diff(self.starts))
        apart = np.abs(self.seconds[:, None] - self.seconds) < math.log(_MAX_SPEED)
        away, nearest = (
            self._nearest(motions.T, motions, np.where(apart, np.square(motions).sum(axis=0), np.inf), least)
            for motions, least in ((self.courses, _NEAREST_COURSE), (self.spreads, _NEAREST_SPREAD))
        )
        away[own] = nearest[own] = np.inf
        evidence = self._evidence(away, nearest, np.array([_others(each) for each in nearest]))
        most = float(np.quantile(np.maximum(evidence.max(axis=1), 2 * _OF_BUILTIN), _SHARE))
        return replace(self, raised=min(max(most - _OF_BUILTIN, _MAX_RAISED[0]), _MAX_RAISED[1]))

    def likely(self, points: NDArray[np.float32]) -> Numbers:
        """Give the evidence for each class by each window that ends now, as if speed and amplitude were as usual.

        Parameters
        ----------
        points
            The newest points, oldest first, shape (`lengths[-1]`, directions); zeros where there are none.

        Returns
        -------
        Shape (lengths, classes); -inf where no motion of the class is about as long.
        """
        # Near 0 single precision holds the variances.
        points = points - points[-1]
        numbers = (self._curves @ points).reshape(len(self.lengths), -1)
        numbers /= np.sqrt(np.square(numbers).sum(axis=1))[:, None] + _TINY
        vectors = self.metric.place(numbers)
        away = self._nearest(vectors, self.courses, self._squares[0], _NEAREST_COURSE)
        means = self._means @ points
        variances = self._means @ np.square(points) - np.square(means)
        spreads = _spread(np.maximum(variances, 0.0))
        apart = self._nearest(spreads, self.spreads, self._squares[1], _NEAREST_SPREAD)
        others = _others(apart.min(axis=0)) if len(self.classes) > 1 else apart
        return self._evidence(away, apart, others)

    @staticmethod
    def _evidence(away: Numbers, apart: Numbers, others: Numbers) -> Numbers:
        """Weigh log distances of the nearest course and spread, and of the nearest spread of other classes."""
        there = np.isfinite(away)
        away, apart = np.where(there, away, 0.0), np.where(there, apart, 0.0)
        lead = np.clip(others - apart, -_MAX_LEAD, _MAX_LEAD)
        evidence = WEIGHTS.offset + WEIGHTS.course * away + WEIGHTS.spread * apart + WEIGHTS.lead * lead
        return np.where(there, evidence, -np.inf)

    def _nearest(
        self, vectors: NDArray[np.float32], motions: NDArray[np.float32], squares: NDArray[np.floating], least: float
    ) -> Numbers:
        """Give the log distance of each class's nearest motion of about a window's length, (lengths, classes)."""
        away = (-2.0 * vectors) @ motions
        away += squares
        nearest: Numbers = np.minimum.reduceat(away, self.starts[:-1], axis=1).astype(np.float64)
        nearest += np.square(vectors).sum(axis=1)[:, None]
        return np.log(np.maximum(nearest, 0.0) + least)

    def judged(self, points: NDArray[np.float32], length: int, place: int, likely: float) -> Judged:
        """Judge one class by one window: `likely`'s evidence, with speed and amplitude relative to the nearest motion.

        Parameters
        ----------
        points
            As in `likely`.
        length, place
            Indices of the window's length and of the class.
        likely
            Their evidence.
        """
        count = self.lengths[length]
        some, own = points[-count:], slice(self.starts[place], self.starts[place + 1])
        vector = self.metric.place(_course(some))
        away = self._squares[0, length, own] - 2 * (vector @ self.courses[:, own])
        nearest = int(away.argmin()) + own.start
        speed = float(self.seconds[nearest]) - math.log((count - 1) * STEP)
        larger = log_size(some.var(axis=0)) - float(self.swings[nearest])
        evidence = likely + WEIGHTS.speed * abs(speed) + WEIGHTS.amplitude * min(abs(larger), _MAX_SIZE)
        return Judged(evidence, math.exp(speed), math.exp(larger))


#: A length that divides nothing by 0.
_TINY = 1e-9


class _Cut(NamedTuple):
    class_name: str
    actor: str
    points: Numbers


def _cut(motions: Sequence[Clip], body: Body, basis: Basis) -> list[_Cut]:
    """Cut motions into courses: trimmed, or in rounds; without those too short or of one posture."""
    pieces = list[_Cut]()
    shown = [(clip, points_of(clip, body, basis)) for clip in motions if has_course(clip)]
    rounds = [_round_of(points) if clip.class_name != NOTHING else 0 for clip, points in shown]
    usual = {
        name: int(np.median(own))
        for name in {clip.class_name for clip, _ in shown}
        if (own := _repeating([each for (clip, _), each in zip(shown, rounds, strict=True) if clip.class_name == name]))
    }
    for (clip, points), count in zip(shown, rounds, strict=True):
        often = count or usual.get(clip.class_name, 0)
        if clip.class_name == NOTHING:
            some = _everywhere(points)
        elif often and len(points) >= (_ROUNDS if count else _ROUNDS_OF_CLASS) * often:
            begins = range(0, len(points) - often, max(1, round(often / _BEGINNINGS)))
            some = [points[begin : begin + often + 1] for begin in begins]
        else:
            some = [_trimmed(points)]
        pieces += [_Cut(clip.class_name, clip.actor, each) for each in some]
    return pieces


def _repeating(rounds: Sequence[int]) -> list[int]:
    """Give the rounds of a class whose motions repeat themselves, most of them; else nothing."""
    found = [each for each in rounds if each]
    return found if 2 * len(found) >= len(rounds) else []


def _round_of(points: Numbers) -> int:
    """Find after how many points a motion repeats itself; 0 for a motion that does not."""
    lag = 2
    moving = np.hstack([points[lag:], 3.0 * (points[lag:] - points[:-lag])])
    moving /= math.sqrt(moving.var(axis=0).sum()) or 1.0
    first, last = round(_MIN_ROUND / STEP), int(len(points) / _ROUNDS)
    squares = np.array(
        [np.square(moving[each:] - moving[:-each]).sum(axis=1).mean() / 2 for each in range(first, last + 1)]
    )
    for place in range(1, len(squares) - 1):
        if squares[place] < _SAME and squares[place] <= min(squares[place - 1], squares[place + 1]):
            return first + place
    return 0


def _trimmed(points: Numbers) -> Numbers:
    """Leave out still ends, unless little is left."""
    way = np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))
    begin, end = np.searchsorted(way, (_STILL_WAY * way[-1], (1 - _STILL_WAY) * way[-1]))
    some = points[begin : end + 2]
    return some if (len(some) - 1) * STEP > SHORTEST else points


def _everywhere(points: Numbers) -> list[Numbers]:
    """Cut a motion that must not be named into windows of several lengths."""
    steps = {each: max(1, each // _BEGINNINGS) for each in _between(SHORTEST, (len(points) - 1) * STEP)}
    return [
        points[begin : begin + each] for each, step in steps.items() for begin in range(0, len(points) - each + 1, step)
    ]


def _lengths(seconds: Numbers) -> tuple[int, ...]:
    """Choose the points of the windows that are compared with motions of these lengths (logarithms of seconds)."""
    if not len(seconds):
        return ()
    return _between(max(SHORTEST, 0.75 * math.exp(seconds.min())), 1.3 * math.exp(seconds.max()))


def _between(shortest: float, longest: float) -> tuple[int, ...]:
    """Give the points of windows from one length to another, seconds, each longer than the one before."""
    count = math.floor(math.log(longest / shortest) / math.log(_LONGER)) + 1
    return tuple(sorted({round(shortest * _LONGER**each / STEP) + 1 for each in range(count)}))


def _cosines(count: int) -> Numbers:
    """Give the curves whose products with points are their coefficients, shape (orders, count)."""
    places = (np.arange(count) + 0.5) / count
    curves: Numbers = math.sqrt(2) * np.cos(math.pi * _ORDERS[:, None] * places) / count
    return curves


def _course(points: NDArray[np.floating]) -> Numbers:
    """Give the cosine coefficients of points (points, directions), of unit length, shape (orders × directions,)."""
    numbers = (_cosines(len(points)) @ points).ravel()
    numbers /= max(float(np.linalg.norm(numbers)), _TINY)
    return numbers


def _stacked(rows: Sequence[NDArray[np.floating]], width: int) -> Numbers:
    return np.array(rows, dtype=np.float64).reshape(len(rows), width)


def _spread(variances: NDArray[np.floating]) -> NDArray[np.float32]:
    """Give the spreads of variances (..., directions)."""
    logs = np.log(np.sqrt(variances) + NOISE_FLOOR)
    logs -= LEVEL_REMOVED * logs.mean(axis=-1, keepdims=True)
    spreads: NDArray[np.float32] = logs.astype(np.float32)
    return spreads


def log_size(variances: NDArray[np.floating]) -> float:
    """Give the logarithm of the swing of points with these variances."""
    return 0.5 * math.log(float(variances.sum()) + 1e-6)


def _others(nearest: Numbers) -> Numbers:
    """Give for each class the least number of the other classes."""
    order = nearest.argsort()[:2]
    least: Numbers = np.full(len(nearest), nearest[order[0]])
    least[order[0]] = nearest[order[1]]
    return least


def _lessons(cut: Sequence[_Cut]) -> Lessons:
    _, classes = np.unique([each.class_name for each in cut], return_inverse=True)
    _, people = np.unique([each.actor for each in cut], return_inverse=True)
    return Lessons(classes, people)
