"""Windows cut from a library's motions, embedded once, compared with a live window in one product per measure.

A performer's motions are told apart by where and how their own recordings went (posture, and the spread of a quarter
of a second); other people's by what carries over (spread and shape of one and two seconds). Which of the two a
library is for is in the library: one made from several people is for anybody, one made from a single person for that
person.

The nearest window is the one that is near in all measures at once. A class is as near as the two people nearest of
those who perform it: what only one of them does that way is theirs, not the motion's.

A body with fewer joints is compared twice: by its vectors as estimated with the library's (what is it?), and with what
the fewer joints show of the library's (is it known?); see `library.fewerjoints`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from library import compiled
from library.aligned import aligned
from library.comparison import (
    FOR_ANYBODY,
    FOR_ONE_PERSON,
    Comparison,
    Group,
    finite,
    kept_in_files,
    window_ends,
    windows_measured,
)
from library.distances import distance_rows
from library.fewerjoints import shown_by, some_of, turned
from library.measures import FEWEST_FRAMES, Basis, Kind, Measure
from library.metric import halved
from library.people import People
from library.skeleton import Skeleton, SkeletonMismatchError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from library.clip import Clip

#: Added to squared distances before the logarithm: below it two windows are as good as the same.
NEAREST = 0.01
#: False-acceptance rates at which a library keeps thresholds.
RATES = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
#: Squared distance beyond which windows are all as far: products of three stay finite.
_FARTHEST = 1e9
_NO_THRESHOLDS = np.full(len(RATES), np.inf, dtype=np.float32)
#: Windows kept: one in so many seconds of a motion.
_KEEP_EVERY_ANYBODY, _KEEP_EVERY_ONE_PERSON = 0.4, 1 / 30


def _ascending(indices: NDArray[np.intp]) -> bool:
    return bool((np.diff(indices) >= 0).all())


@dataclass(frozen=True, slots=True, eq=False)
class WindowTable:
    """Embedded windows of a library's motions, by class and person.

    Attributes
    ----------
    comparison
        How they were made.
    groups
        Which measures are compared: `FOR_ANYBODY` or `FOR_ONE_PERSON`.
    motions
        Index of each window's motion in the library, ascending, shape (windows,).
    classes
        Index of each motion's class, ascending, shape (motions,).
    actors
        Of each motion, ascending within its class, shape (motions,).
    vectors
        For each group the windows' vectors, shape (windows, kept axes), float32.
    thresholds
        For each of `RATES` the largest mean log distance that is answered, shape (rates,), float32.
    further
        Log distance by which windows of fewer joints are further than this table's own windows as those would show
        them, times the share of joints that they lack: what fewer joints see beside the kept axes.
    shown
        What fewer joints show of the windows, which says whether a motion is known; None in a table of all joints.
    directions_shown
        A course in this table's directions times these is one in the shown table's.

    Raises
    ------
    ValueError
        Groups are other than the two, shapes do not fit, a number is not finite, or a class has no window.
    """

    comparison: Comparison
    groups: tuple[Group, ...]
    motions: NDArray[np.intp] = field(repr=False)
    classes: NDArray[np.intp] = field(repr=False)
    actors: NDArray[np.str_] = field(repr=False)
    vectors: tuple[NDArray[np.float32], ...] = field(repr=False)
    thresholds: NDArray[np.float32] = field(repr=False)
    further: float = 0.0
    shown: WindowTable | None = field(default=None, repr=False)
    directions_shown: NDArray[np.float64] | None = field(default=None, repr=False)
    _people: People = field(init=False, repr=False)
    _factors: tuple[NDArray[np.float32], ...] = field(init=False, repr=False)
    _mixing: NDArray[np.float32] | None = field(init=False, repr=False)
    _compiled: compiled.Table | None = field(init=False, repr=False)
    #: What must be measured of a live window.
    measures: tuple[Measure, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._check()
        object.__setattr__(self, "measures", tuple(measure for group in self.groups for measure, _ in group))
        people = People.of(self.classes[self.motions], self.actors[self.motions])
        object.__setattr__(self, "_people", people)
        object.__setattr__(self, "_factors", tuple(_factor(each) for each in self.vectors))
        shown = self.directions_shown
        mixing = None if shown is None else _mixing(self.groups, shown.shape[1] / shown.shape[0])
        object.__setattr__(self, "_mixing", mixing)
        object.__setattr__(self, "_compiled", self._laid_out())

    def __reduce__(self) -> tuple[type[WindowTable], tuple[Any, ...]]:
        """Say how to make another: a copy, or one in another process, lays its own windows out."""
        return WindowTable, tuple(getattr(self, each.name) for each in fields(self) if each.init)

    def _laid_out(self) -> compiled.Table | None:
        """Lay the windows out for the compiled loops; None where those are not there."""
        people, metrics = self._people, self.comparison.metrics
        parts = [
            [
                (metrics[measure].origin, metrics[measure].axes, metrics[measure].outside, weight)
                for measure, weight in group
            ]
            for group in self.groups
        ]
        class_starts = np.flatnonzero(np.diff(people.classes, prepend=-1))
        return compiled.laid_out(parts, self.vectors, people.starts, class_starts, nearest=NEAREST, farthest=_FARTHEST)

    def _check(self) -> None:
        if self.groups not in (FOR_ANYBODY, FOR_ONE_PERSON):
            raise ValueError(f"groups: expected those for anybody or for one person, got {self.groups}")
        kept = [sum(self.comparison.metrics[measure].axes.shape[1] for measure, _ in group) for group in self.groups]
        if [each.shape for each in self.vectors] != [(len(self.motions), axes) for axes in kept]:
            raise ValueError("vectors: expected as many windows in each group as there are, of as many numbers as axes")
        if not finite(*self.vectors):
            raise ValueError("vectors: expected finite numbers, got NaN or infinity")
        indices = np.arange(len(self.classes))
        if self.motions.ndim != 1 or not np.isin(self.motions, indices).all() or not _ascending(self.motions):
            raise ValueError("motions: expected indices of the library's motions, ascending")
        if not _ascending(self.classes) or not np.isin(self.classes, self.classes[self.motions]).all():
            raise ValueError(f"motions: expected windows of every class in order, of {FEWEST_FRAMES} frames at least")
        if not np.array_equal(np.lexsort((self.actors, self.classes)), indices):
            raise ValueError("actors: expected motions by class and, within a class, by actor")
        all_or_none = np.isfinite(self.thresholds).all() or (self.thresholds == np.inf).all()
        if (
            self.thresholds.shape != (len(RATES),)
            or not all_or_none
            or (self.thresholds[1:] < self.thresholds[:-1]).any()
        ):
            raise ValueError(f"thresholds: expected {len(RATES)} ascending numbers, got {self.thresholds}")
        if not 0 <= self.further < np.inf:
            raise ValueError(f"further: expected a number not below 0, got {self.further}")
        self._check_shown()

    def _check_shown(self) -> None:
        if self.shown is None and self.directions_shown is None:
            return
        if self.shown is None or self.directions_shown is None:
            raise ValueError("shown: expected it with the directions shown, or neither")
        sizes = tuple(each.basis.directions.shape[1] for each in (self.comparison, self.shown.comparison))
        if self.directions_shown.shape != sizes or not finite(self.directions_shown):
            raise ValueError(f"directions_shown: expected {sizes} finite numbers, got {self.directions_shown.shape}")
        if self.shown.groups != self.groups or not np.array_equal(self.shown.motions, self.motions):
            raise ValueError("shown: expected the same windows, compared by the same measures")

    @classmethod
    def of_clips(cls, clips: Sequence[Clip], comparison: Comparison) -> WindowTable:
        """Cut, measure and embed the windows of some clips.

        Parameters
        ----------
        clips
            Of the skeleton the comparison was learned on, by class.
        comparison
            How to measure and compare.

        Raises
        ------
        ValueError
            A class has no clip long enough for a window, or the skeleton's parents are not known.
        SkeletonMismatchError
            The comparison was learned on another number of pairs.
        """
        pairs = len(clips[0].skeleton.pairs)
        if pairs != comparison.pairs:
            raise SkeletonMismatchError(f"comparison: expected one of {pairs} pairs, got {comparison.pairs}")
        people = {clip.actor for clip in clips if clip.actor}
        groups = FOR_ANYBODY if len(people) > 1 else FOR_ONE_PERSON
        every, first = (_KEEP_EVERY_ANYBODY, 1.0) if len(people) > 1 else (_KEEP_EVERY_ONE_PERSON, 0.1)
        windows = [window_ends(clip, every, first) for clip in clips]
        _, classes = np.unique([clip.class_name for clip in clips], return_inverse=True)
        table = cls._with_thresholds(
            comparison=comparison,
            groups=groups,
            motions=np.repeat(np.arange(len(clips)), [len(ends) for ends in windows]),
            classes=classes,
            actors=np.array([clip.actor for clip in clips]),
            vectors=tuple(halved(_embedded(clips, windows, group, comparison)) for group in groups),
        )
        return replace(table, further=table.further_measured(clips, windows))

    @classmethod
    def _with_thresholds(cls, **parts: Any) -> WindowTable:  # noqa: ANN401 - the other attributes, as they are
        """Make a table without thresholds, and set them by its windows."""
        table = cls(**parts, thresholds=_NO_THRESHOLDS)
        asked = [_asking_all(each) for each in table.vectors]
        return replace(table, thresholds=_thresholds(asked, table._factors, table._people))

    def further_measured(self, clips: Sequence[Clip], windows: Sequence[NDArray[np.intp]]) -> float:
        """Measure `further` by the clips' windows as some fewer joints really measure them.

        Thresholds are what it is for, so it is how much further those are; mean over sets of joints and over the rates.
        """
        if not (self.comparison.can_be_restricted and np.isfinite(self.thresholds).all()):
            return 0.0
        skeleton = Skeleton(clips[0].skeleton.joints, self.comparison.body.parents)
        rows = np.array([distance_rows(clip.positions, skeleton).mean(axis=0) for clip in clips])
        further = list[float]()
        for joints in some_of(len(skeleton.joints)):
            fewer = skeleton.restricted_to(joints)
            shown = replace(self, further=0.0).restricted_to(fewer, skeleton.places_of(fewer), rows).known_by
            seen = [clip.restricted_to(fewer.joints) for clip in clips]
            asked = [_asked(seen, windows, group, shown.comparison) for group in self.groups]
            really = _thresholds(asked, [_factor(each) for each in shown.vectors], self._people)
            further.append(float(np.mean(really - shown.thresholds)) / (1 - len(joints) / len(skeleton.joints)))
        return max(0.0, float(np.mean(further))) if further else 0.0

    @property
    def known_by(self) -> WindowTable:
        """The table by which a motion is known: what fewer joints show, or this one."""
        return self.shown or self

    def restricted_to(self, skeleton: Skeleton, pairs: NDArray[np.intp], rows: NDArray[np.floating]) -> WindowTable:
        """Give the table that compares windows of fewer joints; arguments and errors are `Comparison.restricted_to`'s.

        Vectors stay what they are. What the fewer joints show of them has thresholds of its own, set as a library's
        are, so that a rate means the same share of unknown motions with any joints.
        """
        comparison = self.comparison.restricted_to(skeleton, pairs, rows)
        vectors, metrics, directions = shown_by(
            pairs,
            self.groups,
            self.vectors,
            whole=self.comparison.metrics,
            basis=self.comparison.basis,
            estimating=comparison.metrics,
        )
        shown = WindowTable._with_thresholds(
            comparison=Comparison(
                body=comparison.body,
                basis=kept_in_files(Basis(comparison.basis.directions @ directions, comparison.basis.weights)),
                metrics=metrics,
            ),
            groups=self.groups,
            motions=self.motions,
            classes=self.classes,
            actors=self.actors,
            vectors=vectors,
        )
        missing = 1 - len(skeleton.joints) / len(self.comparison.body.parents)
        thresholds = shown.thresholds + np.float32(self.further * missing)
        return replace(
            self, comparison=comparison, shown=replace(shown, thresholds=thresholds), directions_shown=directions
        )

    def __len__(self) -> int:
        return len(self.vectors[0])

    def log_distances(self, measures: Mapping[Measure, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Compare a live window with every window of the library, or those of several performers at once.

        Parameters
        ----------
        measures
            Of the live window, each (numbers,); or of several, each (hops, numbers): where nothing is compiled they
            take a third of the time together.

        Returns
        -------
        For each class the logarithm of the squared distance, mean over the groups, to the window nearest in all of
        them, mean over the two nearest people: shape (classes,) or (hops, classes).
        """
        distances: NDArray[np.float64] = self.compared(measures)[..., 0, :]
        return distances

    def compared(self, measures: Mapping[Measure, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Compare live windows as `log_distances` does: by which they are named, and by which they are known.

        Returns
        -------
        Shape (1, classes) where both are the same, (2, classes) in a table restricted to fewer joints; of several
        windows (hops, 1 or 2, classes).
        """
        if self.shown is None or self.directions_shown is None or self._mixing is None:
            if compiled.loops and self._compiled and _is_one(measures):
                distances = np.empty((1, len(self._people.places)))
                self._compiled.compared(*(measures[measure] for measure in self.measures), distances[0])
                return distances
            return self.nearest(self.squared_distances(measures))[..., None, :]
        shapes = {measure: numbers for measure, numbers in measures.items() if measure.kind is Kind.SHAPE}
        cut = turned(np.stack(list(shapes.values())), self.directions_shown) if shapes else ()
        shown = self.shown.squared_distances({**measures, **dict(zip(shapes, cut, strict=True))})
        logs = np.log(np.array([*self.squared_distances(measures), *shown]))
        both = (self._mixing @ logs.reshape(len(logs), -1)).reshape(-1, *logs.shape[1:])
        return np.moveaxis(self._people.agreed(self._people.nearest(both)), 0, -2)

    def squared_distances(self, measures: Mapping[Measure, NDArray[np.float64]]) -> list[NDArray[np.float32]]:
        """For each group give live windows' squared distances to all windows, and a little more, ([hops,] windows)."""
        if compiled.loops and self._compiled and _is_one(measures):
            squares = np.empty((len(self.groups), len(self)), dtype=np.float32)
            self._compiled.squares(*(measures[measure] for measure in self.measures), squares)
            return list(squares)
        asking = _asking if _is_one(measures) else _asking_each
        squared = [
            (factor @ asking(measures, group, self.comparison, vectors.shape[1])).T
            for group, vectors, factor in zip(self.groups, self.vectors, self._factors, strict=True)
        ]
        return [np.maximum(each, NEAREST, out=each) for each in squared]

    def nearest(self, squared: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
        """Find for each class how near the window is that is near in all groups; overwrites the first group's."""
        product = squared[0]
        for other in squared[1:]:
            product *= other
        return self._people.agreed(np.log(self._people.nearest(product)) / len(self.groups))

    def merged_with(
        self, other: WindowTable, new: Sequence[int], place: NDArray[np.intp], classes: NDArray[np.intp]
    ) -> WindowTable:
        """Join the windows of two libraries.

        Parameters
        ----------
        other
            Measured in the same way.
        new
            Which of the other's motions are joined.
        place
            Where each motion, this table's and then the other's new ones, will stand in the joined library.
        classes
            Class index of each motion as it will stand there.

        Raises
        ------
        ValueError
            The other's windows are measured or compared differently.
        """
        if self.groups != other.groups or not self.comparison.is_same(other.comparison):
            raise ValueError(
                "libraries: expected all of one person each, or all of several and compared as the built-in one is; "
                "three people or more teach a comparison of their own. Build one library from all recordings instead"
            )
        kept = np.isin(other.motions, new)
        count = len(self.classes)
        renumbered = count + np.searchsorted(np.asarray(new, dtype=np.intp), other.motions[kept])
        motions = place[np.concatenate([self.motions, renumbered])]
        order = np.argsort(motions, kind="stable")
        sources = np.empty(len(place), dtype=np.intp)
        sources[place] = np.arange(len(place))
        return WindowTable._with_thresholds(
            comparison=self.comparison,
            groups=self.groups,
            motions=motions[order],
            classes=classes,
            actors=np.concatenate([self.actors, other.actors[np.asarray(new, dtype=np.intp)]])[sources],
            vectors=tuple(
                np.concatenate([mine, theirs[kept]])[order]
                for mine, theirs in zip(self.vectors, other.vectors, strict=True)
            ),
            further=(self.further * len(self) + other.further * len(other)) / (len(self) + len(other)),
        )

    def threshold_at(self, rate: float) -> float:
        """Give the largest log distance by which a motion is known that is answered at a false-acceptance rate."""
        rate = min(max(rate, RATES[0]), RATES[-1])
        return float(np.interp(np.log(rate), np.log(RATES), self.known_by.thresholds))


def _mixing(groups: Sequence[Group], told: float) -> NDArray[np.float32]:
    """Say what becomes of log distances, by estimates and then as shown: those for naming and for knowing, (2, both).

    Of a shape whole directions are missing, and nothing stands in for them: what is left of it counts as well.
    """
    estimated = np.array([told if group[0][0].kind is Kind.SHAPE else 1.0 for group in groups])
    named, known = np.append(estimated, 1 - estimated), np.append(0 * estimated, np.ones(len(groups)))
    return np.array([named, known], dtype=np.float32) / np.float32(len(groups))


def _is_one(measures: Mapping[Measure, NDArray[np.float64]]) -> bool:
    """Whether these are the measures of one live window, not of several."""
    return next(iter(measures.values())).ndim == 1


def _factor(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Make of vectors b, (n, axes), what gives |a - b|² + NEAREST when multiplied by `_asking(a)`, (n, axes + 2).

    Column by column, each beginning with a cache line: so the product costs two thirds of what it costs row by row.
    """
    squares = np.square(vectors).sum(axis=1)
    return aligned(np.vstack([-2 * vectors.T, squares + np.float32(NEAREST), np.ones_like(squares)])).T


def _asking(
    measures: Mapping[Measure, NDArray[np.float64]], group: Group, comparison: Comparison, axes: int
) -> NDArray[np.float32]:
    """Make of a live window's vector a, (axes,), what a `_factor` is multiplied by; far off, it is as far from all."""
    asking = np.empty(axes + 2, dtype=np.float32)
    begin, square = 0, 0.0
    for measure, weight in group:
        metric = comparison.metrics[measure]
        vector = asking[begin : begin + metric.axes.shape[1]]
        square += weight * metric.place(measures[measure], vector)
        vector *= math.sqrt(weight)
        begin += len(vector)
    asking[-2], asking[-1] = 1.0, square
    if not square <= _FARTHEST:
        asking[:-2], asking[-1] = 0.0, _FARTHEST
    return asking


def _asking_all(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Make of vectors, (n, axes), what each asks a `_factor` with, (n, axes + 2)."""
    squares = np.square(vectors).sum(axis=1, keepdims=True)
    return np.hstack([vectors, np.ones_like(squares), squares])


def _asking_each(
    measures: Mapping[Measure, NDArray[np.float64]], group: Group, comparison: Comparison, axes: int
) -> NDArray[np.float32]:
    """Do the same for several live windows: side by side, (axes + 2, hops), for rows are multiplied more slowly.

    It is not used for one: numpy takes half as long again for a matrix of one row as for a vector.
    """
    begin, asking = 0, np.empty((axes + 2, len(next(iter(measures.values())))), dtype=np.float32)
    asking[-2], asking[-1] = 1.0, 0.0
    for measure, weight in group:
        vectors, squares = comparison.metrics[measure].placed_each(measures[measure])
        end = begin + vectors.shape[1]
        np.multiply(vectors.T, math.sqrt(weight), out=asking[begin:end])
        asking[-1] += weight * squares
        begin = end
    far = ~(asking[-1] <= _FARTHEST)
    asking[:-2, far], asking[-1, far] = 0.0, _FARTHEST
    return asking


def _embedded(
    clips: Sequence[Clip], windows: Sequence[NDArray[np.intp]], group: Group, comparison: Comparison
) -> NDArray[np.float32]:
    parts = []
    for measure, weight in group:
        metric = comparison.metrics[measure]
        vectors = [
            metric.embedded(windows_measured(clip, ends, measure, comparison.body, comparison.basis))
            for clip, ends in zip(clips, windows, strict=True)
        ]
        parts.append(np.concatenate(vectors) * np.float32(np.sqrt(weight)))
    return np.concatenate(parts, axis=1)


def _thresholds(
    asked: Sequence[NDArray[np.float32]], factors: Sequence[NDArray[np.float32]], people: People
) -> NDArray[np.float32]:
    """Set thresholds by how near motions come to classes they are not of.

    Each window asks as if its class, and its actor when there are several, were not in the library: the nearest class
    it finds is a false one. The threshold at a rate is that quantile of the distances found, mean over the classes
    left out: a class of many windows weighs no more than one of few.

    Parameters
    ----------
    asked
        For each group what each window asks with, as `_asking` makes it, shape (windows, axes + 2).
    factors
        Whom they ask, for each group.
    people
        Whose windows these are.
    """
    several = len(np.unique(people.actors)) > 1
    ends = [*people.starts[1:].tolist(), len(factors[0])]
    found: dict[int, list[NDArray[np.float64]]] = {}
    for start, end, index, actor in zip(people.starts, ends, people.classes, people.actors, strict=True):
        product = np.ones((end - start, len(factors[0])), dtype=np.float32)
        for asking, factor in zip(asked, factors, strict=True):
            product *= np.clip(asking[start:end] @ factor.T, NEAREST, _FARTHEST)
        logs = np.log(people.nearest(product)) / len(factors)
        logs[:, people.classes == index] = np.nan
        if several:
            logs[:, people.actors == actor] = np.nan
        nearest = np.fmin.reduce(people.agreed(logs), axis=1)
        found.setdefault(int(index), []).append(nearest[np.isfinite(nearest)])
    impostors = [np.concatenate(each) for each in found.values()]
    impostors = [each for each in impostors if each.size]
    if not impostors:
        return _NO_THRESHOLDS
    quantiles = np.array([np.quantile(each, RATES) for each in impostors])
    return np.asarray(quantiles.mean(axis=0), dtype=np.float32)


def _asked(
    clips: Sequence[Clip], windows: Sequence[NDArray[np.intp]], group: Group, comparison: Comparison
) -> NDArray[np.float32]:
    """Measure windows, and make of each what asks a `_factor`, (windows, axes + 2)."""
    numbers = {
        measure: np.concatenate(
            [
                windows_measured(clip, ends, measure, comparison.body, comparison.basis)
                for clip, ends in zip(clips, windows, strict=True)
            ]
        )
        for measure, _ in group
    }
    count, axes = sum(map(len, windows)), sum(comparison.metrics[measure].axes.shape[1] for measure, _ in group)
    return np.array(
        [
            _asking({measure: each[k] for measure, each in numbers.items()}, group, comparison, axes)
            for k in range(count)
        ]
    )
