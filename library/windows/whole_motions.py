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
from collections import defaultdict
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple, Self, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from kinespace.library.distances import distance_rows
from kinespace.library.kernels import bind, plain
from kinespace.library.kernels.table import LANE, REGISTER
from kinespace.library.motion_library import NOTHING
from kinespace.library.progress.phase_table import MOMENTS_PER_SECOND, points_of
from kinespace.library.signature.parts import LEVEL_REMOVED, NOISE_FLOOR
from kinespace.library.windows.metric import Lessons, Metric, learned_metric

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kinespace.library.clip import Clip
    from kinespace.library.kernels.plain import Call
    from kinespace.library.signature.basis import Basis
    from kinespace.library.signature.body import Body

    Numbers = NDArray[np.float64]

_Number = TypeVar("_Number", np.float32, np.float64)

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
#: The logarithm of the amplitude counts no more than this.
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


class Support(NamedTuple):
    """What a class gains in evidence where all looks at a window's later part guess it, and where all name it."""

    guessed: float = 1.5
    named: float = 1.5


SUPPORT = Support()
#: False alarms an hour, and the evidence, with support, above which so many happen: the mean of three laboratories'
#: feeds, CMU's, and UI-PRMD's by markers and by a Kinect.
_PROMISED, _LIMITS = (1.0, 6.0, 60.0, 600.0), (7.6, 5.2, 2.9, -0.5)
#: A class's limit is raised by the evidence that this share of the other classes' motions do not exceed for it, over
#: the usual; by how much, either way; and the least evidence that counts.
_SHARE, _USUAL_EVIDENCE, _MAX_RAISED, _LEAST = 0.95, -2.5, (-1.0, 2.0), -9.0


def has_course(clip: Clip) -> bool:
    """Say whether a motion has a course: it is long enough, and more than one posture."""
    rows = distance_rows(clip.positions[:: max(clip.frames // _SHOWN, 1)], clip.skeleton)
    moves = rows.var(axis=0).sum() >= _MIN_MOVEMENT**2 * np.square(rows.mean(axis=0)).sum()
    return bool(clip.duration >= SHORTEST and moves)


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
        Where each class begins, and the end, shape (classes + 1,); the motions of a class lie by their length.
    metric
        Maps a course's numbers to its vector.
    courses, spreads
        Shape (axes, motions) and (directions, motions), with room for a register behind the motions.
    facts
        Logarithms of each motion's length, seconds, and of its swing, shape (2, motions), with room as well.
    lengths
        Points in the windows that are compared, ascending.
    curves
        The cosines of each window, behind zeros, shape (lengths, orders, points of the longest).
    ranges
        Which motions of each class are about as long as each window, from one to another, (lengths, classes, 2).
    raised
        How much more evidence each class needs because other classes' motions resemble it, shape (classes,).
    crossed
        The evidence of each motion for its class by other people's motions, by the class's other motions where one
        person does them all, without those of `nothing`; shape (motions,).
    weights
        The weights of the evidence, in the order of `Weights`.
    support
        What the recogniser's guesses and names add to the evidence.
    limits
        The evidence, with support, from which 1, 6, 60 and 600 false alarms an hour happen.
    """

    classes: tuple[str, ...]
    starts: NDArray[np.intp] = field(repr=False)
    metric: Metric = field(repr=False)
    courses: NDArray[np.float32] = field(repr=False)
    spreads: NDArray[np.float32] = field(repr=False)
    facts: Numbers = field(repr=False)
    lengths: tuple[int, ...]
    curves: NDArray[np.float32] = field(repr=False)
    ranges: NDArray[np.intp] = field(repr=False)
    raised: Numbers = field(repr=False)
    crossed: Numbers = field(repr=False)
    weights: tuple[float, ...] = WEIGHTS
    support: Support = SUPPORT
    limits: tuple[float, ...] = _LIMITS

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
        cut = sorted(_cut(motions, body, basis), key=lambda each: (each.class_name, len(each.points)))
        metric, width = _metric(tuple(teachers), body, basis), basis.directions.shape[1]
        names = [each.class_name for each in cut]
        classes = tuple(sorted(set(names)))
        starts = np.searchsorted(names, [*classes, "\U0010ffff"])
        seconds = np.log([(len(each.points) - 1) * STEP for each in cut])
        within = _compared_seconds(cut)
        lengths = _between(*within) if within else ()
        behind = [np.pad(_cosines(count), ((0, 0), (lengths[-1] - count, 0))) for count in lengths]
        curves = np.array(behind, dtype=np.float32).reshape(len(lengths), len(_ORDERS), max(lengths, default=0))
        courses = metric.place(_courses(cut, width))
        variances = np.array([each.points.var(axis=0) for each in cut]).reshape(-1, width)
        logs = np.log(np.sqrt(variances) + NOISE_FLOOR)
        spreads = (logs - LEVEL_REMOVED * logs.mean(axis=1, keepdims=True)).astype(np.float32)
        facts = np.column_stack([seconds, 0.5 * np.log(variances.sum(axis=1) + plain.SMALLEST)])
        laid, ranges = (_laid(courses), _laid(spreads), _laid(facts)), _ranges(seconds, starts, lengths)
        return cls(classes, starts, metric, *laid, lengths, curves, ranges, *_compared(courses, spreads, seconds, cut))

    def limit_at(self, false_alarms: float) -> Numbers:
        """Give the evidence from which each class is done, for false alarms an hour that are accepted, (classes,)."""
        limits: Numbers = self.raised + np.interp(math.log(false_alarms), np.log(_PROMISED), self.limits)
        return limits

    def missed_at(self, false_alarms: float) -> float:
        """Give the share of the library's own motions that others' do not find; NaN where there are no others.

        As if each were guessed and named all the time.
        """
        known = np.isfinite(self.crossed)
        needed = np.repeat(self.limit_at(false_alarms), np.diff(self.starts))[known] - sum(self.support)
        return float(np.mean(self.crossed[known] < needed)) if known.any() else math.nan

    def by_distance(self, most: float) -> Self:
        """Judge by the nearest course alone, at most so far (squared) whatever is promised: to compare."""
        weights, limits = Weights(*np.zeros(6))._replace(course=-1.0), (-math.log(most + _NEAREST_COURSE),) * 4
        return replace(self, weights=weights, raised=0.0 * self.raised, limits=limits, support=Support(0.0, 0.0))

    def judging(self, points: Numbers, sizes: Numbers) -> tuple[Call, Numbers]:
        """Bind the comparison of windows to the memory of the points that will come.

        Parameters
        ----------
        points, sizes
            A body in the basis, `STEP` after `STEP`, and its size, metres: shape (points, directions) and (points,).

        Returns
        -------
        A call that takes the number of points which have come, and its result, shape (4, lengths, classes): for each
        window that ends with the newest point and for each class the evidence, -inf where the window is longer than
        what was seen or no motion of the class is about as long; the log distance of the nearest spread; the motion
        of the nearest course; and the logarithm of the amplitude relative to this motion's.
        """
        width = len(self.spreads)
        axes = self.metric.axes.reshape(len(_ORDERS), width, -1)
        room = np.zeros((self.lengths[-1], width)), np.zeros(axes.shape[:2]), np.zeros(axes.shape[2])
        found = np.zeros((4, len(self.lengths), len(self.classes)))
        call = bind(
            "whole",
            *(points, sizes, np.array(self.lengths), self.curves, self.metric.origin.reshape(axes.shape[:2]), axes),
            *(self.courses, self.spreads, self.facts, self.ranges, np.array(self.weights)),
            *(each.astype(np.float32) for each in room),
            found,
            *(_NEAREST_COURSE, _NEAREST_SPREAD, _MAX_LEAD, _MAX_SIZE, NOISE_FLOOR, LEVEL_REMOVED, STEP),
        )
        return call, found

    def judged(self, found: Numbers, length: int, place: int) -> Judged:
        """Read what was found of a window and a class off a result of `judging`."""
        evidence, _, nearest, larger = found[:, length, place].tolist()
        seconds = (self.lengths[length] - 1) * STEP
        return Judged(evidence, math.exp(self.facts[0, int(nearest)]) / seconds, math.exp(larger))


#: What clips show in a basis, while they live: an example that is taught comes to hundreds of motions.
_SHOWN_BY = WeakKeyDictionary["Clip", "tuple[Basis, tuple[Numbers, int] | None]"]()


class _Cut(NamedTuple):
    class_name: str
    actor: str
    #: The place of its clip.
    clip: int
    points: Numbers


@lru_cache(maxsize=2)
def _metric(teachers: tuple[Clip, ...], body: Body, basis: Basis) -> Metric:
    """Learn the metric of courses; the same teachers are asked at each example that is taught."""
    taught = _cut(teachers, body, basis)
    numbers = _courses(taught, basis.directions.shape[1])
    if len(taught) > 1 and numbers.var(axis=0).sum() > _ALIKE:
        whose = zip(*((each.class_name, each.actor) for each in taught), strict=True)
        lessons = Lessons(*(np.unique(each, return_inverse=True)[1] for each in whose))
        metric = learned_metric(numbers, lessons, shrinkage=_SHRINKAGE, kept=_AXES)
    else:
        origin = np.zeros(numbers.shape[1], dtype=np.float32)
        metric = Metric(origin, np.eye(len(origin), dtype=np.float32) / np.float32(math.sqrt(_USUAL)))
    # The compiled loops take whole lanes of axes.
    return replace(metric, axes=np.pad(metric.axes, ((0, 0), (0, -metric.axes.shape[1] % LANE))))


def _courses(cut: Sequence[_Cut], width: int) -> Numbers:
    """Give the courses of pieces in so many directions, shape (pieces, orders × directions)."""
    return np.array([_course(each.points) for each in cut]).reshape(-1, len(_ORDERS) * width)


def _cut(motions: Sequence[Clip], body: Body, basis: Basis) -> list[_Cut]:
    """Cut motions into courses: trimmed, or in rounds; without those too short or of one posture."""
    pieces, of_class = list[_Cut](), defaultdict[str, list[int]](list)
    shown = [(clip, *each) for clip in motions if (each := _shown(clip, body, basis))]
    for clip, _, count in shown:
        of_class[clip.class_name].append(count)
    # Classes of which most motions repeat themselves.
    repeating = {name: own for name, own in of_class.items() if 2 * np.count_nonzero(own) >= len(own)}
    usual = {name: int(np.median([count for count in own if count])) for name, own in repeating.items()}
    # Last come the parts of `nothing`: as long as windows that may be a motion, or an hour would give 150,000 parts.
    shown.sort(key=lambda each: each[0].class_name == NOTHING)
    within: tuple[float, float] | None = None
    for place, (clip, points, count) in enumerate(shown):
        often = count or usual.get(clip.class_name, 0)
        if clip.class_name == NOTHING:
            within = within or _compared_seconds(pieces)
            some = _everywhere(points, *within) if within else []
        elif often and len(points) >= (_ROUNDS if count else _ROUNDS_OF_CLASS) * often:
            begins = range(0, len(points) - often, max(1, round(often / _BEGINNINGS)))
            some = [points[begin : begin + often + 1] for begin in begins]
        else:
            some = [_trimmed(points)]
        pieces += [_Cut(clip.class_name, clip.actor, place, each) for each in some]
    return pieces


def _shown(clip: Clip, body: Body, basis: Basis) -> tuple[Numbers, int] | None:
    """Give a motion's points, and after how many it repeats itself; None without a course."""
    known = _SHOWN_BY.get(clip)
    if known is None or known[0] is not basis:
        found = None
        if has_course(clip):
            points = points_of(clip, body, basis)
            found = points, _round_of(points) if clip.class_name != NOTHING else 0
        known = _SHOWN_BY[clip] = basis, found
    return known[1]


def _round_of(points: Numbers) -> int:
    """Find after how many points a motion repeats itself; 0 for a motion that does not."""
    lag = 2
    moving = np.hstack([points[lag:], 3.0 * (points[lag:] - points[:-lag])])
    moving /= math.sqrt(moving.var(axis=0).sum()) or 1.0
    first, last = round(_MIN_ROUND / STEP), int(len(points) / _ROUNDS)
    away = [moving[each:] - moving[:-each] for each in range(first, last + 1)]
    squares = np.array([np.square(each).sum(axis=1).mean() / 2 for each in away])
    inner = squares[1:-1]
    least = np.flatnonzero((inner < _SAME) & (inner <= np.minimum(squares[:-2], squares[2:])))
    return first + 1 + least.item(0) if len(least) else 0


def _trimmed(points: Numbers) -> Numbers:
    """Leave out still ends, unless little is left."""
    way = np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))
    begin, end = np.searchsorted(way, (_STILL_WAY * way[-1], (1 - _STILL_WAY) * way[-1]))
    some = points[begin : end + 2]
    return some if (len(some) - 1) * STEP > SHORTEST else points


def _compared_seconds(cut: Sequence[_Cut]) -> tuple[float, float] | None:
    """Give the lengths of the shortest and the longest window that may be a motion with a name, seconds; or None."""
    seconds = [(len(each.points) - 1) * STEP for each in cut if each.class_name != NOTHING]
    return (0.75 * min(seconds), 1.3 * max(seconds)) if seconds else None


def _everywhere(points: Numbers, least: float, most: float) -> list[Numbers]:
    """Cut a motion that must not be named into windows of several lengths, seconds."""
    longest = min(most, (len(points) - 1) * STEP)
    steps = {each: max(1, each // _BEGINNINGS) for each in _between(min(least, longest), longest)}
    return [
        points[begin : begin + each] for each, step in steps.items() for begin in range(0, len(points) - each + 1, step)
    ]


def _between(shortest: float, longest: float) -> tuple[int, ...]:
    """Give the points of windows from one length to another, seconds, each longer than the one before."""
    shortest = max(SHORTEST, shortest)
    count = math.floor(math.log(longest / shortest) / math.log(_LONGER)) + 1
    return tuple(sorted({round(shortest * _LONGER**each / STEP) + 1 for each in range(count)}))


def _laid(rows: NDArray[_Number]) -> NDArray[_Number]:
    """Lay rows out as columns, with room for a register behind them."""
    return np.ascontiguousarray(np.pad(rows, ((0, REGISTER), (0, 0))).T)


def _compared(
    courses: NDArray[np.float32], spreads: NDArray[np.float32], seconds: Numbers, cut: Sequence[_Cut]
) -> tuple[Numbers, Numbers]:
    """Compare each motion with other people's: give the classes' `raised`, and the motions' `crossed`."""
    classes, starts, of_class = np.unique([each.class_name for each in cut], return_index=True, return_inverse=True)
    if len(classes) < 2:
        return np.zeros(len(classes)), np.full(len(cut), np.nan)
    people = {name: {each.actor for each in cut if each.class_name == name} for name in classes}
    whose = [f"{each.class_name}/{each.actor if len(people[each.class_name]) > 1 else each.clip}" for each in cut]
    _, whose_of = np.unique(whose, return_inverse=True)
    # The parts of `nothing` are too many to ask, too.
    known = np.flatnonzero(classes[of_class] != NOTHING)
    others = (np.abs(seconds[known, None] - seconds) < math.log(_MAX_SPEED)) & (whose_of[known, None] != whose_of)
    away, apart = (
        np.log(
            plain.least_of(each[known], each.T, np.where(others, np.square(each).sum(axis=1), np.inf), starts) + least
        )
        for each, least in ((courses, _NEAREST_COURSE), (spreads, _NEAREST_SPREAD))
    )
    own, crossed = (np.arange(len(known)), of_class[known]), np.full(len(cut), np.nan)
    crossed[known] = _evidence(away, apart)[own]
    away[own] = apart[own] = np.inf
    evidence = np.maximum(_evidence(away, apart), _LEAST)
    resembling = [evidence[of_class[known] != place, place] for place in range(len(classes))]
    shares = [np.quantile(each, _SHARE) if len(each) else _USUAL_EVIDENCE for each in resembling]
    raised = np.clip(np.array(shares) - _USUAL_EVIDENCE, *_MAX_RAISED)
    # An example of nothing takes the place of any class.
    raised[classes == NOTHING] = raised.min()
    return raised, crossed


def _evidence(away: Numbers, apart: Numbers) -> Numbers:
    """Weigh log distances of the nearest course and spread of each class, (motions, classes)."""
    weighed: Numbers = WEIGHTS.offset + WEIGHTS.course * away + WEIGHTS.spread * apart
    return weighed + WEIGHTS.lead * plain.leads(apart, apart, _MAX_LEAD)


def _ranges(seconds: Numbers, starts: NDArray[np.intp], lengths: Sequence[int]) -> NDArray[np.intp]:
    """Say which motions of each class are about as long as windows; logarithms of seconds, ascending in each class."""
    ranges, most = np.empty((len(lengths), len(starts) - 1, 2), dtype=np.intp), math.log(_MAX_SPEED)
    for length, place in np.ndindex(*ranges.shape[:2]):
        usual, some = math.log((lengths[length] - 1) * STEP), seconds[starts[place] : starts[place + 1]]
        ranges[length, place] = starts[place] + np.searchsorted(some, (usual - most, usual + most))
    return ranges


def _cosines(count: int) -> Numbers:
    """Give the curves whose products with points are their coefficients, shape (orders, count)."""
    places = (np.arange(count) + 0.5) / count
    curves: Numbers = math.sqrt(2) * np.cos(math.pi * _ORDERS[:, None] * places) / count
    return curves


def _course(points: NDArray[np.floating]) -> Numbers:
    """Give the cosine coefficients of points (points, directions), of unit length, shape (orders × directions,)."""
    numbers = (_cosines(len(points)) @ points).ravel()
    numbers /= max(float(np.linalg.norm(numbers)), plain.TINY)
    return numbers
