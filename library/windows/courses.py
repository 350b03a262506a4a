"""Courses: whole motions, from their beginning to their end, compared by one inner product.

This is the paper's own comparison (Le Naour et al. 2012): the window is as long as the motion. The body's points
(`library.signature.own_frame`) are a path. A course reads it at points of equal way, so that stillness and speed drop
out, and keeps the unit directions from each point to the next: one vector of unit length. Every direction is averaged
with its neighbours, so that a bend may come a little sooner or later (a band of time warping would allow the same).

    cost(a, b) = (1 − ⟨course a, course b⟩) / (⟨way a, way b⟩ ⟨width a, width b⟩ min(1, ⟨tilt a, tilt b⟩ / .9)³)

way and width say how far each number goes and how far it swings, as unit vectors: the spread beside the directions.
tilt says where the trunk pointed at first, as the body sees it at each point: who lies down crouches as in a squat, but
falls over.

A motion is said where a live window costs less than the motion's limit (`stream.recognizer.done`). The limit comes from
what must not be said: everyday movement (`everyday`, and the motions called `nothing`), and other classes' motions.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from pathlib import Path as FilePath
from typing import NamedTuple, Self
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.distances import distance_rows
from kinespace.library.motion_library import NOTHING
from kinespace.library.naming import hdm05
from kinespace.library.signature.own_frame import AXES, STEP, at_steps, corners_of, own_path
from kinespace.library.skeleton import Skeleton
from kinespace.library.windows.comparison import whitened

Numbers = NDArray[np.float64]
Floats = NDArray[np.float32]

#: Points of a course, at equal way.
POINTS = 12
_PLACES = np.linspace(0.0, 1.0, POINTS)
#: Points along a path by which neighbouring directions are averaged: the standard deviation of their weights.
_BLUR = 0.8
#: Inner products of ways, of widths and of tilts divide by no less.
_LEAST_PRODUCT = 0.01
#: The inner product of tilts from which on they are alike: an angle of 26°.
_ALIKE = 0.9
#: A window's way is at most so much longer or shorter than the motion's.
MAX_WAY = 1 / 0.6
#: Seconds of the shortest motion with a course, and of the shortest window; how much longer the next window is.
SHORTEST, _SHORTEST_WINDOW, _LONGER = 0.45, 0.3, 1.4
#: The share of a motion's way, at either end, that is left out: still ends.
_STILL_WAY = 0.02
#: The share of a motion's way by which its start is known.
BEGUN = 0.5
#: The least mean squared difference of a motion from itself a round later, relative to unrelated postures, at which the
#: motion repeats itself; seconds of a round, at least; rounds in a motion, at least, and in other motions of its class.
_SAME, _MIN_ROUND, _ROUNDS, _ROUNDS_OF_CLASS = 0.3, 0.3, 1.9, 1.3
#: Rounds begin at so many moments of a round, because a stranger may begin anywhere.
_BEGINNINGS = 4
#: Deviation of the distances, relative to their size, below which a motion is one posture, and moments that show it.
_MIN_MOVEMENT, _SHOWN = 0.02, 16
#: Limits of whole motions, and of their first parts, are at most this share of what everyday movement costs a motion's
#: parts.
_OF_EVERYDAY = 0.75, 0.6
#: A limit is this share of the least cost of a motion called `nothing`, or of another class; of a whole motion whose
#: class has several motions less.
_OF_OTHERS, _OF_OTHERS_CROSSED = 0.85, (0.72, 0.85)
#: Limits of whole motions, and of their first parts, are at most this; limits of classes with several motions less.
_MOST, _MOST_CROSSED = (0.55, 0.45), 0.4
#: Persons of a class, and classes of so many persons (or most), at least, by whom it is learned how people differ in
#: one motion; the share of equal scatter.
_PERSONS, _CLASSES, _SHRINKAGE = 3, 5, 0.4
#: Limits of these classes' whole motions are such shares of what other classes and everyday movement cost, and at most
#: this; but at most so many times what this share of a class's motions cost each other, unless that is below the last.
_OF_STRANGE, _MOST_STRANGE, _OF_CROSSED, _CROSSED, _LEAST_CROSSED = (0.82, 0.92), 0.62, 1.8, 0.8, 0.65
#: The limit of a whole motion of few people's class is multiplied by e^(−.2 log² r) for a window r times as long.
_OF_TIME = 0.2
#: Parts of a motion that are compared with everyday movement: a long motion may be made of usual steps.
_PARTS = 3
#: Directions by which pieces are screened, and pieces from which the directions are computed, at most.
_SCREENS, _SPANNING = 32, 256
#: Windows of a motion called `nothing`, and of all other classes, that set limits, at most.
_MAX_WINDOWS, _MAX_OTHERS = 4000, 6000
#: False alarms an hour, and the share of the limits at which so many are said.
_PROMISED, _SHARES = (1.0, 6.0, 60.0, 600.0), (0.85, 1.0, 1.25, 1.6)
#: Motions, at least, of which it is told how many others' do not find.
_TOLD_OF = 5


class Pieces(NamedTuple):
    """Some pieces of paths as they are compared.

    Attributes
    ----------
    courses
        Shape (pieces, (POINTS − 1) × numbers), of unit length.
    ways, widths
        How far each number goes, and how far it swings: shape (pieces, numbers), of unit length.
    lengths
        The way of each piece, relative to the body's size where its points are; shape (pieces,).
    tilts
        Where the trunk pointed at first, as the body sees it: shape (pieces, POINTS × 3), of unit length.
    """

    courses: Floats
    ways: Floats
    widths: Floats
    lengths: Floats
    tilts: Floats

    @classmethod
    def of(cls, points: NDArray[np.floating], whitening: Floats | None = None) -> Self:
        """Take pieces at equal way, (pieces, POINTS, numbers + AXES), their directions times (numbers, numbers)."""
        tilts = _unit(turned(points)[:, :, 1].reshape(-1, 3)).reshape(len(points), POINTS * 3) / math.sqrt(POINTS)
        points = points[..., :-AXES]
        # All pieces' first points come first: sums and products along the path are then over whole rows.
        along = np.ascontiguousarray(points.transpose(1, 0, 2), dtype=np.float32)
        steps = along[1:] - along[:-1]
        lengths = np.sqrt(np.einsum("spn,spn->sp", steps, steps))
        directions = (steps / np.maximum(lengths, np.float32(_TINY))[:, :, None]).reshape(-1, points.shape[2])
        directions = directions if whitening is None else directions @ whitening
        # Piece by piece, so that the same pieces give the same numbers to the last digit.
        blurred = np.matmul(_blur(), directions.reshape(steps.shape).transpose(1, 0, 2))
        courses = blurred.reshape(len(points), len(steps) * points.shape[2])
        ways, widths = np.abs(steps).sum(axis=0), along.max(axis=0) - along.min(axis=0)
        return cls(_unit(courses), _unit(ways), _unit(widths), lengths.sum(axis=0), tilts)

    def costs(self, others: "Pieces") -> Floats:
        """Compare with other pieces: shape (pieces, others)."""
        costs: Floats = (1 - self.courses @ others.courses.T) / self.shared(others)
        return costs

    def shared(self, others: "Pieces") -> Floats:
        """Give the products of ways, of widths and of tilts, by which costs are divided: shape (pieces, others)."""
        ways, widths = self.ways @ others.ways.T, self.widths @ others.widths.T
        tilts = np.minimum(np.maximum(self.tilts @ others.tilts.T / _ALIKE, _LEAST_PRODUCT), 1.0)
        shared: Floats = np.maximum(ways, _LEAST_PRODUCT) * np.maximum(widths, _LEAST_PRODUCT)
        # numpy's power takes ten times as long.
        shared *= tilts * tilts * tilts
        return shared

    def as_far(self, others: "Pieces", most: float = MAX_WAY) -> NDArray[np.bool_]:
        """Say which pieces go at most so much farther or less far than which others, shape (pieces, others)."""
        shares = np.maximum(self.lengths, _TINY)[:, None] / np.maximum(others.lengths, _TINY)
        return (shares < most) & (shares > 1 / most)


class Screen(NamedTuple):
    """Says quickly which pieces cost too much, by some directions of courses.

    Two courses' inner product is at most the product within these directions, and what lies beside them.

    Attributes
    ----------
    axes
        The directions, shape (numbers of a course, directions), orthonormal.
    within, beside
        The pieces' courses along the directions, shape (pieces, directions), and how long they are beside them.
    """

    axes: Floats
    within: Floats
    beside: Floats

    @classmethod
    def of(cls, courses: Floats) -> Self:
        """Take the directions along which most of the pieces' courses lie."""
        some = np.linspace(0, len(courses) - 1, min(len(courses), _SPANNING)).astype(np.intp)
        axes = np.ascontiguousarray(np.linalg.svd(courses[some], full_matrices=False)[2][:_SCREENS].T)
        return cls(axes, *cls._split(courses, axes))

    @staticmethod
    def _split(courses: Floats, axes: Floats) -> tuple[Floats, Floats]:
        within = courses @ axes
        beside = np.sqrt(np.maximum(1 - np.einsum("pa,pa->p", within, within), 0))
        return within, beside

    def costs_at_least(self, courses: Floats) -> Floats:
        """Give one less the inner product of courses, at least: shape (others, pieces)."""
        within, beside = self._split(courses, self.axes)
        least: Floats = 1 - within @ self.within.T - beside[:, None] * self.beside
        return least


_TINY = 1e-9


def _unit(rows: Floats) -> Floats:
    unit: Floats = rows / np.maximum(np.sqrt(np.einsum("pn,pn->p", rows, rows)), np.float32(_TINY))[:, None]
    return unit


@cache
def _blur() -> Floats:
    """Give the weights by which each direction is averaged with its neighbours, shape (POINTS − 1, POINTS − 1)."""
    places = np.arange(POINTS - 1)
    weights: Floats = np.exp(-0.5 * ((places[:, None] - places) / _BLUR) ** 2).astype(np.float32)
    return weights


def turned(points: NDArray[np.floating]) -> Floats:
    """Give the axes of the body's frame in pieces, as the body saw them at first: shape (pieces, POINTS, 3, 3).

    Parameters
    ----------
    points
        The pieces at equal way, shape (pieces, POINTS, numbers + `AXES`).
    """
    axes = points[..., -AXES:].reshape(*points.shape[:2], 3, 3).astype(np.float32)
    axes /= np.maximum(np.sqrt(np.einsum("pnca,pnca->pna", axes, axes)), np.float32(_TINY))[:, :, None]
    seen: Floats = np.matmul(axes[:, :1].swapaxes(2, 3), axes)
    return seen


def ways_of(points: NDArray[np.floating]) -> Numbers:
    """Give the way up to each point of a path (points, numbers): shape (points,), 0 first."""
    ways, steps = np.zeros(len(points)), points[1:] - points[:-1]
    np.cumsum(np.sqrt(np.einsum("pn,pn->p", steps, steps)), out=ways[1:])
    return ways


def at_equal_way(points: NDArray[np.floating], ways: Numbers, begins: Numbers, ends: Numbers) -> Floats:
    """Read a path at `POINTS` points of equal way between ways: shape (pieces, POINTS, numbers).

    Parameters
    ----------
    points, ways
        The path, and the way up to each of its points (`ways_of`); two points or more.
    begins, ends
        The ways between which each piece lies, shape (pieces,).
    """
    asked = begins[:, None] + (ends - begins)[:, None] * _PLACES
    before = np.minimum(np.maximum(ways.searchsorted(asked, side="right") - 1, 0), len(points) - 2)
    start, steps = ways.take(before), ways.take(before + 1)
    steps -= start
    shares = np.minimum(np.maximum((asked - start) / np.maximum(steps, _TINY), 0.0), 1.0)
    # Whole rows are taken, because a place for each number would take three times as long.
    read: Floats = points.take(before + 1, axis=0).astype(np.float32, copy=False)
    begun = points.take(before, axis=0).astype(np.float32, copy=False)
    read -= begun
    read *= shares.astype(np.float32)[:, :, None]
    read += begun
    return read


@dataclass(frozen=True, slots=True, eq=False)
class Courses:
    """The courses of a library's motions, class by class.

    Attributes
    ----------
    classes
        The classes with a course, sorted; without `nothing`.
    starts
        Where the motions of each class begin, shape (classes,).
    pieces
        The motions, and behind them their first parts (`BEGUN`): a motion starts where such a part is seen.
    screen
        The screen of the pieces.
    limits
        The cost below which a whole motion is seen, and its first part: shape (2, motions).
    whitening
        What directions are multiplied by, shape (numbers, numbers): those in which people differ in one motion count
        less. None where too few classes are shown by several persons.
    persons
        How many persons show each class, shape (classes,).
    seconds
        How long each motion lasts, shape (motions,).
    crossed
        The cost of each motion by others' motions of its class, relative to their limit; NaN where there are no others.
    counts
        Steps of the windows that are compared, ascending.
    """

    classes: tuple[str, ...]
    starts: NDArray[np.intp] = field(repr=False)
    pieces: Pieces = field(repr=False)
    screen: Screen = field(repr=False)
    limits: Floats = field(repr=False)
    whitening: Floats | None = field(repr=False)
    persons: NDArray[np.intp] = field(repr=False)
    seconds: Numbers = field(repr=False)
    crossed: Numbers = field(repr=False)
    counts: tuple[int, ...]

    @classmethod
    def of(cls, motions: Sequence[Clip]) -> Self:
        """Cut the courses out of motions over one skeleton."""
        cut = sorted(_cut(motions), key=lambda each: (each.class_name, len(each.points)))
        if not cut:
            none, places, numbers = Pieces.of(np.zeros((0, POINTS, AXES + 1))), np.zeros(0, dtype=np.intp), np.zeros(0)
            screen, limits = Screen.of(none.courses), np.zeros((2, 0), np.float32)
            return cls((), places, none, screen, limits, None, places, numbers, numbers, ())
        names = [each.class_name for each in cut]
        classes, starts, of_class = np.unique(names, return_index=True, return_inverse=True)
        whole, begun = (np.concatenate([each.read(share) for each in cut]) for share in (1.0, BEGUN))
        people = [name for name, _ in {(each.class_name, each.actor) for each in cut}]
        persons = np.array([people.count(name) for name in classes])
        whitening = _whitening(whole, cut, of_class, persons)
        by_people = _by_people(persons, whitening)[of_class]
        pieces = Pieces.of(whole, whitening), Pieces.of(begun, whitening)
        seconds = np.array([(len(each.points) - 1) * STEP for each in cut])
        crossed, timed = _crossed(pieces[0], cut, of_class, seconds, by_people)
        several = np.isin(of_class, of_class[np.isfinite(crossed)])
        typical = _everyday_costs(cut, motions[0].skeleton, whitening)
        unlike = _least_costs(pieces, *_unwanted(cut, of_class, whitening))
        limits = np.zeros((2, len(cut)), dtype=np.float32)
        others = _shares(several) * unlike
        for limit, highest, share, other in zip(limits, _MOST, _OF_EVERYDAY, others, strict=True):
            limit[:] = np.minimum(np.minimum(np.where(several, _MOST_CROSSED, highest), other), share * typical)
        limits[0] = np.where(by_people, _of_persons(crossed, of_class, typical, unlike[0]), limits[0])
        counts, limits = _counts(float(seconds.max())), np.maximum(limits, np.float32(_TINY))
        both = Pieces(*map(np.concatenate, zip(*pieces, strict=True)))
        screen, crossed = Screen.of(both.courses), timed / limits[0]
        named = tuple(classes.tolist())
        known = cls(named, starts, both, screen, limits, whitening, persons, seconds, crossed, counts)
        return known.lowered([clip for clip in motions if clip.class_name == NOTHING])

    @property
    def of_class(self) -> NDArray[np.intp]:
        """The place of each motion's class, shape (motions,)."""
        return np.searchsorted(self.starts, np.arange(len(self.seconds)), side="right") - 1

    @property
    def by_people(self) -> NDArray[np.bool_]:
        """Whether several persons taught the limits of each class, shape (classes,)."""
        return _by_people(self.persons, self.whitening)

    @property
    def of_few(self) -> frozenset[str]:
        """The classes of whose courses few people show one."""
        return frozenset(name for name, persons in zip(self.classes, self.persons, strict=True) if persons < _PERSONS)

    @property
    def beside_others(self) -> frozenset[str]:
        """The classes of few people, where several persons show others."""
        return self.of_few if self.whitening is not None else frozenset()

    @property
    def whole(self) -> Pieces:
        """The whole motions."""
        return Pieces(*(each[: len(self.seconds)] for each in self.pieces))

    @property
    def begun(self) -> Pieces:
        """Their first parts."""
        return Pieces(*(each[len(self.seconds) :] for each in self.pieces))

    def lowered(self, unwanted: Sequence[Clip]) -> Self:
        """Lower the limits by motions that must not be said."""
        paths = [path_of(clip) for clip in unwanted if clip.frames > 1]
        if not self.counts or not paths:
            return self
        windows = Pieces.of(np.concatenate([windows_of(path, self.counts) for path in paths]), self.whitening)
        several = np.isin(self.of_class, self.of_class[np.isfinite(self.crossed)])
        least = _shares(several) * _least_costs((self.whole, self.begun), windows, np.ones((1, 1), dtype=bool))
        limits = np.maximum(np.minimum(self.limits, least.astype(np.float32)), np.float32(_TINY))
        return replace(self, limits=limits, crossed=self.crossed * self.limits[0] / limits[0])

    def missed_at(self, false_alarms: float) -> float:
        """Give the share of the library's own motions that others' do not find; NaN where few have others."""
        known = self.crossed[np.isfinite(self.crossed)]
        return float(np.mean(known > share_at(false_alarms))) if len(known) >= _TOLD_OF else math.nan


def share_at(false_alarms: float) -> float:
    """Give the share of the limits below which a motion is said, for false alarms an hour that are accepted."""
    return float(np.interp(math.log(false_alarms), np.log(_PROMISED), _SHARES))


def of_time(seconds: Numbers, lasting: Numbers, by_people: NDArray[np.bool_]) -> Numbers:
    """Give what limits of whole motions are multiplied by for windows of so many seconds, shape (windows, motions).

    A person does a motion about as fast as before; limits that several persons taught know how speeds differ.

    Parameters
    ----------
    seconds
        Of the windows, shape (windows,).
    lasting, by_people
        How long each motion lasts, and whether several persons taught its limit, shape (motions,).
    """
    return np.where(by_people, 1.0, np.exp(-_OF_TIME * np.log(seconds[:, None] / lasting) ** 2))


def has_course(clip: Clip) -> bool:
    """Say whether a motion has a course: it is long enough, and more than one posture."""
    rows = distance_rows(clip.positions[:: max(clip.frames // _SHOWN, 1)], clip.skeleton)
    moves = rows.var(axis=0).sum() >= _MIN_MOVEMENT**2 * np.square(rows.mean(axis=0)).sum()
    return bool(clip.duration >= SHORTEST and moves)


def without_course(motions: Sequence[Clip]) -> list[str]:
    """Give the classes of which no motion has a course: they have starts and ends, and are never done."""
    names = {clip.class_name for clip in motions} - {NOTHING}
    return sorted(names - {clip.class_name for clip in motions if has_course(clip)})


# --- cutting ----------------------------------------------------------------------------------------------------------

#: The points of clips, and after how many they repeat themselves, while the clips live: an example that is taught comes
#: to hundreds of motions.
_SHOWN_BY = WeakKeyDictionary["Clip", "tuple[Numbers, int] | None"]()


class _Cut(NamedTuple):
    class_name: str
    actor: str
    #: The place of its clip.
    clip: int
    points: Numbers

    def read(self, share: float) -> Floats:
        """Read its first part at equal way, shape (1, POINTS, numbers + AXES)."""
        ways = ways_of(self.points)
        return at_equal_way(self.points, ways, np.zeros(1), np.array([share * ways[-1]]))


def _cut(motions: Sequence[Clip]) -> list[_Cut]:
    """Cut motions into pieces: trimmed, or in rounds; without those too short, of one posture, or called `nothing`."""
    shown = [
        (place, clip, *each)
        for place, clip in enumerate(motions)
        if clip.class_name != NOTHING and (each := _shown(clip))
    ]
    rounds: dict[str, list[int]] = {}
    for _, clip, _, count in shown:
        rounds.setdefault(clip.class_name, []).append(count)
    # Classes of which most motions repeat themselves.
    usual = {
        name: int(np.median([count for count in own if count]))
        for name, own in rounds.items()
        if 2 * np.count_nonzero(own) >= len(own)
    }
    pieces = list[_Cut]()
    for place, clip, points, count in shown:
        often = count or usual.get(clip.class_name, 0)
        if often and len(points) >= (_ROUNDS if count else _ROUNDS_OF_CLASS) * often:
            begins = range(0, len(points) - often, max(1, round(often / _BEGINNINGS)))
            some = [points[begin : begin + often + 1] for begin in begins]
        else:
            some = [_trimmed(points)]
        pieces += [_Cut(clip.class_name, clip.actor, place, each) for each in some]
    return pieces


def path_of(clip: Clip) -> Numbers:
    """Give the points of a clip's path, every `STEP`, relative to the body's size."""
    positions = clip.positions
    if clip.frames > 1:
        steps = np.arange(math.floor(clip.duration / STEP + 1e-6) + 1) * STEP
        positions = at_steps(clip.times, positions, np.minimum(steps, clip.times[-1]))
    points, size = own_path(positions, clip.skeleton)
    return points / size


def _shown(clip: Clip) -> tuple[Numbers, int] | None:
    """Give a motion's points, and after how many it repeats itself (0: never); None without a course."""
    if clip not in _SHOWN_BY:
        points = path_of(clip) if has_course(clip) else None
        _SHOWN_BY[clip] = None if points is None else (points, _round_of(points))
    return _SHOWN_BY[clip]


def _round_of(points: Numbers) -> int:
    """Find after how many points a motion repeats itself; 0 for a motion that does not."""
    every = 2
    some, lag = points[::every], 2
    moving = np.hstack([some[lag:], 3.0 * (some[lag:] - some[:-lag])])
    moving /= math.sqrt(moving.var(axis=0).sum()) or 1.0
    first, last = round(_MIN_ROUND / STEP / every), int(len(some) / _ROUNDS)
    away = [moving[each:] - moving[:-each] for each in range(first, last + 1)]
    squares = np.array([np.square(each).sum(axis=1).mean() / 2 for each in away])
    inner = squares[1:-1]
    least = np.flatnonzero((inner < _SAME) & (inner <= np.minimum(squares[:-2], squares[2:])))
    return every * (first + 1 + least.item(0)) if len(least) else 0


def _trimmed(points: Numbers) -> Numbers:
    """Leave out still ends, unless little is left."""
    ways = ways_of(points)
    begin, end = np.searchsorted(ways, (_STILL_WAY * ways[-1], (1 - _STILL_WAY) * ways[-1]))
    some = points[max(begin - 1, 0) : end + 1]
    return some if (len(some) - 1) * STEP > SHORTEST else points


def _counts(longest: float) -> tuple[int, ...]:
    """Give the steps of windows for the first parts of short motions, and for motions of so many seconds."""
    count = math.floor(math.log(1.3 * longest / _SHORTEST_WINDOW) / math.log(_LONGER)) + 1
    return tuple(round(_SHORTEST_WINDOW * _LONGER**each / STEP) for each in range(count))


# --- limits -----------------------------------------------------------------------------------------------------------


def _crossed(
    pieces: Pieces, cut: Sequence[_Cut], of_class: NDArray[np.intp], seconds: Numbers, by_people: NDArray[np.bool_]
) -> Numbers:
    """Give the least cost of each motion by others' of its class: other people's, else other clips; NaN for none.

    Shape (2, motions): the costs alone, and relative to what the others' time leaves of a limit (`of_time`).
    """
    crossed = np.full((2, len(cut)), np.nan)
    for place in np.unique(of_class):
        own = np.flatnonzero(of_class == place)
        pieces_of = [cut[each] for each in own.tolist()]
        several = len({each.actor for each in pieces_of}) > 1
        whose = np.array([each.actor if several else str(each.clip) for each in pieces_of])
        some = Pieces(*(each[own] for each in pieces))
        costs = np.where((whose[:, None] != whose) & some.as_far(some), some.costs(some), np.inf)
        timed = costs / of_time(seconds[own], seconds[own], by_people[own])
        least = np.array([costs.min(axis=1), timed.min(axis=1)])
        crossed[:, own] = np.where(np.isfinite(least), least, np.nan)
    return crossed


def _whitening(
    whole: Floats, cut: Sequence[_Cut], of_class: NDArray[np.intp], persons: NDArray[np.intp]
) -> Floats | None:
    """Learn how people differ in one motion, to weigh directions by it (within-class covariance, Hatch et al. 2006).

    Each motion differs from the nearest one of every other person. All classes that enough persons show count alike.

    Parameters
    ----------
    whole
        The motions at equal way, shape (motions, POINTS, numbers + `AXES`).
    cut, of_class, persons
        The motions, the class of each, and how many persons show each class.

    Returns
    -------
    Shape (numbers, numbers); None where too few classes could teach it.
    """
    shown = np.flatnonzero(persons >= _PERSONS)
    if len(shown) < min(_CLASSES, len(persons) // 2 + 1):
        return None
    actors, numbers, courses = np.array([each.actor for each in cut]), whole.shape[2] - AXES, Pieces.of(whole).courses
    scatter = np.zeros((numbers, numbers))
    for place in shown.tolist():
        own = of_class == place
        for person in np.unique(actors[own]):
            theirs, others = courses[own & (actors == person)], courses[own & (actors != person)]
            differ = (others - theirs[(others @ theirs.T).argmax(axis=1)]).reshape(-1, numbers)
            scatter += differ.T @ differ / (len(differ) * persons[place])
    return whitened(scatter, _SHRINKAGE).astype(np.float32)


def _by_people(persons: NDArray[np.intp], whitening: Floats | None) -> NDArray[np.bool_]:
    """Say which classes' limits several persons teach: where the whitening is learned, theirs."""
    return (persons >= _PERSONS) & (whitening is not None)


def _everyday_costs(cut: Sequence[_Cut], skeleton: Skeleton, whitening: Floats | None) -> Numbers:
    """Give what everyday movement costs the parts of each motion, the mean of their least; infinite for unknown."""
    typical, begins = everyday(skeleton), np.linspace(0.0, 1.0 - 1 / _PARTS, 2 * _PARTS - 1)
    if typical is None:
        return np.full(len(cut), np.inf)
    read = []
    for each in cut:
        ways = ways_of(each.points)
        read.append(at_equal_way(each.points, ways, begins * ways[-1], (begins + 1 / _PARTS) * ways[-1]))
    least = Pieces.of(np.concatenate(read), whitening).costs(Pieces.of(typical, whitening)).min(axis=1)
    costs: Numbers = least.reshape(len(cut), -1).mean(axis=1, dtype=np.float64)
    return costs


def _unwanted(
    cut: Sequence[_Cut], of_class: NDArray[np.intp], whitening: Floats | None
) -> tuple[Pieces, NDArray[np.bool_]]:
    """Give windows of all motions, and for which motions each must not be said: other classes', (motions, windows)."""
    counts, most = _counts(max(len(each.points) - 1 for each in cut) * STEP), -(-_MAX_OTHERS // len(cut))
    read = [windows_of(each.points, counts, most) for each in cut]
    return Pieces.of(np.concatenate(read), whitening), of_class[:, None] != np.repeat(
        of_class, [len(each) for each in read]
    )


def windows_of(points: Numbers, counts: Sequence[int], most: int = _MAX_WINDOWS) -> Floats:
    """Read windows everywhere in a path, of so many steps each, at equal way: (windows, POINTS, numbers + AXES)."""
    ways = ways_of(points)
    ends: list[Numbers] = []
    begins: list[Numbers] = []
    for count in counts:
        places = np.arange(count, len(points), max(1, count // 16))
        begins.append(ways[places - count])
        ends.append(ways[places])
    begin, end = np.concatenate(begins), np.concatenate(ends)
    some = np.flatnonzero(end > begin)[:: max(1, -(-len(begin) // max(most, 1)))]
    if len(points) < 2 or not len(some):
        return np.zeros((0, POINTS, points.shape[1]), dtype=np.float32)
    return at_equal_way(points, ways, begin[some], end[some])


def _least_costs(pieces: tuple[Pieces, Pieces], windows: Pieces, counts_for: NDArray[np.bool_]) -> Numbers:
    """Give the least cost of whole motions and of first parts by windows that must not be said, shape (2, motions).

    Parameters
    ----------
    pieces
        Whole motions, and first parts.
    windows, counts_for
        The windows, and for which motions each counts, (motions, windows).
    """
    # A live window may go a little farther, with the rest of a movement behind it.
    costs = [np.where(each.as_far(windows, 1.5 * MAX_WAY) & counts_for, each.costs(windows), np.inf) for each in pieces]
    return np.array([each.min(axis=1, initial=np.inf) for each in costs])


def _shares(several: NDArray[np.bool_]) -> Numbers:
    """Give the shares of what must not be said for motions whose class has several or not, shape (2, motions)."""
    return np.where(several, np.array(_OF_OTHERS_CROSSED)[:, None], _OF_OTHERS)


def _of_persons(crossed: Numbers, of_class: NDArray[np.intp], typical: Numbers, unlike: Numbers) -> Numbers:
    """Give the limits of whole motions that several persons show, shape (motions,)."""
    limits = np.minimum(_MOST_STRANGE, np.minimum(_OF_STRANGE[0] * unlike, _OF_STRANGE[1] * typical))
    for place in np.unique(of_class):
        own = of_class == place
        # Where nobody else goes as far, a motion resembles none.
        usual = _OF_CROSSED * np.quantile(np.nan_to_num(crossed[own], nan=1.0), _CROSSED)
        limits[own] = np.clip(usual, _LEAST_CROSSED * limits[own], limits[own])
    return limits


# --- everyday movement ------------------------------------------------------------------------------------------------


@cache
def _everyday() -> Floats:
    with np.load(FilePath(__file__).with_name("everyday.npz"), allow_pickle=False) as file:
        windows: Floats = file["windows"].astype(np.float32)
    return windows


@lru_cache(maxsize=8)
def everyday(skeleton: Skeleton) -> Numbers | None:
    """Give typical windows of everyday movement over a skeleton's joints; None without shoulders or hips.

    They are means of many people's windows (`kinespace learn`), over HDM05's joints. A joint that HDM05 does not have
    stays where it is.
    """
    if corners_of(skeleton) is None:
        return None
    places = {name: place for place, name in enumerate(hdm05.SKELETON.joints)}
    learned, axes = np.split(_everyday(), [-AXES], axis=2)
    windows = np.zeros((*learned.shape[:2], len(skeleton.joints), 3))
    for place, name in enumerate(skeleton.joints):
        if name in places:
            windows[:, :, place] = learned.reshape(*learned.shape[:2], -1, 3)[:, :, places[name]]
    return np.concatenate([windows.reshape(*learned.shape[:2], -1), axes], axis=2)
