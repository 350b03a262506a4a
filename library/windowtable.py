"""Windows cut from a library's motions, embedded once, compared with a live window in one product per measure.

A performer's motions are told apart by where and how their own recordings went (posture, and the spread of a quarter
of a second); other people's by what carries over (spread and shape of one and two seconds). Which of the two a
library is for is in the library: one made from several people is for anybody, one made from a single person for that
person.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from library.distances import distance_rows
from library.measures import FEWEST_FRAMES, Body, Kind, Measure, learned_basis, measured
from library.metric import Metric, halved, learned_metric, squared_distances
from library.skeleton import SkeletonMismatchError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from library.clip import Clip

#: Measures added up before the logarithm, with their weights; over the groups the logarithms are averaged.
Group = tuple[tuple[Measure, float], ...]

SPREAD_QUARTER, SPREAD_ONE = Measure(Kind.SPREAD, 0.25), Measure(Kind.SPREAD, 1.0)
SHAPE_ONE, SHAPE_TWO = Measure(Kind.SHAPE, 1.0), Measure(Kind.SHAPE, 2.0)
POSTURE = Measure(Kind.POSTURE, 0.125)
MEASURES = (SPREAD_QUARTER, SPREAD_ONE, SHAPE_ONE, SHAPE_TWO, POSTURE)

FOR_ANYBODY: tuple[Group, ...] = (((SPREAD_ONE, 1.0),), ((SHAPE_ONE, 1.0),), ((SHAPE_TWO, 1.0),))
FOR_ONE_PERSON: tuple[Group, ...] = (((SPREAD_QUARTER, 1.0), (POSTURE, 2.0)),)

#: Added to squared distances before the logarithm: below it two windows are as good as the same.
NEAREST = 0.01
#: False-acceptance rates at which a library keeps thresholds.
RATES = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
#: How many impostors the common threshold counts for when a class's own is estimated.
_COMMON_WEIGHT = 50
#: Windows learned from and kept: one in so many seconds of a motion.
_LEARN_EVERY = 2 / 15
#: Frames from a short clip's end at which its first window ends, so that it has one.
_SPARE_FRAMES = 3
_KEEP_EVERY_ANYBODY, _KEEP_EVERY_ONE_PERSON = 0.1, 1 / 30
_KEPT_AXES = {Kind.SPREAD: 64, Kind.POSTURE: 64, Kind.SHAPE: 128}
#: Whitening carries over between laboratories for spread and posture, and not for shape.
_SHRINKAGE = {Kind.SPREAD: 0.3, Kind.POSTURE: 0.3, Kind.SHAPE: 1.0}


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """How windows are measured and compared: learned once, from several people, and shared by libraries.

    Attributes
    ----------
    basis
        Directions in which shapes are measured, shape (pairs, directions).
    metrics
        By measure.

    Raises
    ------
    ValueError
        Shapes do not fit, or a number is not finite.
    """

    basis: NDArray[np.float64] = field(repr=False)
    metrics: Mapping[Measure, Metric] = field(repr=False)

    def __post_init__(self) -> None:
        if self.basis.ndim != 2 or not _finite(self.basis):
            raise ValueError(f"basis: expected finite (pairs, directions), got {self.basis.shape}")
        pairs, directions = self.basis.shape
        for measure, metric in self.metrics.items():
            numbers = directions * (directions + 1) // 2 if measure.kind is Kind.SHAPE else pairs
            if metric.origin.shape != (numbers,) or metric.axes.ndim != 2 or len(metric.axes) != numbers:
                raise ValueError(f"{measure.name}: expected {numbers} numbers, got {metric.axes.shape}")
            if not (_finite(metric.origin, metric.axes) and 0 <= metric.outside < np.inf):
                raise ValueError(f"{measure.name}: expected finite numbers, got NaN or infinity")

    @property
    def pairs(self) -> int:
        """How many distances a row has."""
        return len(self.basis)

    def is_same(self, other: Comparison) -> bool:
        """Whether another comparison maps every window to the same vectors."""
        return np.array_equal(self.basis, other.basis) and all(
            np.array_equal(metric.origin, other.metrics[measure].origin)
            and np.array_equal(metric.axes, other.metrics[measure].axes)
            and metric.outside == other.metrics[measure].outside
            for measure, metric in self.metrics.items()
        )

    @classmethod
    def learned(cls, clips: Sequence[Clip]) -> Comparison:
        """Learn from clips of several people doing the same classes.

        Raises
        ------
        ValueError
            No class is performed by two people, or the skeleton's parents are not known.
        """
        body = Body.of(clips[0].skeleton)
        names = sorted({clip.class_name for clip in clips})
        by_class: dict[str, list[NDArray[np.float64]]] = {name: [] for name in names}
        for clip in clips:
            by_class[clip.class_name].append(distance_rows(clip.positions, clip.skeleton))
        basis = learned_basis([by_class[name] for name in names], body)
        windows = [_window_ends(clip, _LEARN_EVERY, FEWEST_FRAMES / clip.frame_rate) for clip in clips]
        classes = np.concatenate(
            [np.full(len(ends), names.index(clip.class_name)) for clip, ends in zip(clips, windows, strict=True)]
        )
        actors = np.concatenate([np.full(len(ends), clip.actor) for clip, ends in zip(clips, windows, strict=True)])
        metrics = {}
        for measure in MEASURES:
            numbers = np.concatenate(
                [_measured(clip, ends, measure, body, basis) for clip, ends in zip(clips, windows, strict=True)]
            )
            metrics[measure] = learned_metric(
                numbers, classes, actors, shrinkage=_SHRINKAGE[measure.kind], kept=_KEPT_AXES[measure.kind]
            )
        return cls(halved(basis).astype(np.float64), metrics)


def _finite(*arrays: NDArray[np.floating]) -> bool:
    return all(np.isfinite(array).all() for array in arrays)


def _ascending(indices: NDArray[np.intp]) -> bool:
    return bool((np.diff(indices) >= 0).all())


def _window_ends(clip: Clip, every: float, first: float) -> NDArray[np.intp]:
    """Windows end every so many seconds, the first when so many have been seen, or with the clip."""
    earliest = max(FEWEST_FRAMES, min(round(first * clip.frame_rate), clip.frames - _SPARE_FRAMES))
    return np.arange(earliest, clip.frames + 1, max(1, round(every * clip.frame_rate)))


def _measured(
    clip: Clip, ends: NDArray[np.intp], measure: Measure, body: Body, basis: NDArray[np.float64]
) -> NDArray[np.float64]:
    rows = distance_rows(clip.positions, clip.skeleton)
    return measured(rows, clip.frame_rate, ends, measure, body=body, basis=basis)


@dataclass(frozen=True, slots=True, eq=False)
class WindowTable:
    """Embedded windows of a library's motions, by class.

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
        Of each motion, shape (motions,).
    vectors
        For each group the windows' vectors, shape (windows, kept axes), float32.
    thresholds
        For each of `RATES` and each class the largest mean log distance that is answered, shape (rates, classes).

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
    thresholds: NDArray[np.float64] = field(init=False, repr=False)
    _starts: NDArray[np.intp] = field(init=False, repr=False)
    _squares: tuple[NDArray[np.float32], ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._check()
        of_window = self.classes[self.motions]
        starts = np.unique(of_window, return_index=True)[1]
        squares = tuple(np.square(each).sum(axis=1) for each in self.vectors)
        object.__setattr__(self, "_starts", starts)
        object.__setattr__(self, "_squares", squares)
        object.__setattr__(self, "thresholds", _thresholds(self.vectors, of_window, self.actors[self.motions], starts))

    def _check(self) -> None:
        if self.groups not in (FOR_ANYBODY, FOR_ONE_PERSON):
            raise ValueError(f"groups: expected those for anybody or for one person, got {self.groups}")
        kept = [sum(self.comparison.metrics[measure].axes.shape[1] for measure, _ in group) for group in self.groups]
        if [each.shape for each in self.vectors] != [(len(self.motions), axes) for axes in kept]:
            raise ValueError("vectors: expected as many windows in each group as there are, of as many numbers as axes")
        if not _finite(*self.vectors):
            raise ValueError("vectors: expected finite numbers, got NaN or infinity")
        indices = np.arange(len(self.classes))
        if self.motions.ndim != 1 or not np.isin(self.motions, indices).all() or not _ascending(self.motions):
            raise ValueError("motions: expected indices of the library's motions, ascending")
        if not _ascending(self.classes) or not np.isin(self.classes, self.classes[self.motions]).all():
            raise ValueError(f"motions: expected windows of every class in order, of {FEWEST_FRAMES} frames at least")

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
        body = Body.of(clips[0].skeleton)
        windows = [_window_ends(clip, every, first) for clip in clips]
        _, classes = np.unique([clip.class_name for clip in clips], return_inverse=True)
        return cls(
            comparison=comparison,
            groups=groups,
            motions=np.repeat(np.arange(len(clips)), [len(ends) for ends in windows]),
            classes=classes,
            actors=np.array([clip.actor for clip in clips]),
            vectors=tuple(halved(_embedded(clips, windows, group, body, comparison)) for group in groups),
        )

    def __len__(self) -> int:
        return len(self.vectors[0])

    @property
    def measures(self) -> tuple[Measure, ...]:
        """What must be measured of a live window."""
        return tuple(measure for group in self.groups for measure, _ in group)

    def log_distances(self, measures: Mapping[Measure, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Compare a live window with every window of the library.

        Parameters
        ----------
        measures
            Of the live window, each (numbers,).

        Returns
        -------
        For each class the logarithm of the squared distance to its nearest window, mean over the groups; (classes,).
        """
        total = np.zeros(len(self._starts))
        for group, vectors, squares in zip(self.groups, self.vectors, self._squares, strict=True):
            asked, outside = _embedded_live(measures, group, self.comparison)
            squared = squares - 2 * (vectors @ asked)
            nearest = np.minimum.reduceat(squared, self._starts) + float(asked @ asked) + outside
            total += np.log(np.maximum(nearest, 0.0) + NEAREST)
        return total / len(self.groups)

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
            raise ValueError("windows: expected them measured alike; build the libraries from recordings together")
        kept = np.isin(other.motions, new)
        count = len(self.classes)
        renumbered = count + np.searchsorted(np.asarray(new, dtype=np.intp), other.motions[kept])
        motions = place[np.concatenate([self.motions, renumbered])]
        order = np.argsort(motions, kind="stable")
        sources = np.empty(len(place), dtype=np.intp)
        sources[place] = np.arange(len(place))
        return WindowTable(
            comparison=self.comparison,
            groups=self.groups,
            motions=motions[order],
            classes=classes,
            actors=np.concatenate([self.actors, other.actors[np.asarray(new, dtype=np.intp)]])[sources],
            vectors=tuple(
                np.concatenate([mine, theirs[kept]])[order]
                for mine, theirs in zip(self.vectors, other.vectors, strict=True)
            ),
        )

    def thresholds_at(self, rate: float) -> NDArray[np.float64]:
        """Give each class's largest log distance that is answered, at a false-acceptance rate, shape (classes,)."""
        rates = np.log(RATES)
        at = np.log(min(max(rate, RATES[0]), RATES[-1]))
        return np.array([np.interp(at, rates, column) for column in self.thresholds.T])


def _embedded(
    clips: Sequence[Clip], windows: Sequence[NDArray[np.intp]], group: Group, body: Body, comparison: Comparison
) -> NDArray[np.float32]:
    parts = []
    for measure, weight in group:
        metric = comparison.metrics[measure]
        vectors = [
            metric.embedded(_measured(clip, ends, measure, body, comparison.basis))
            for clip, ends in zip(clips, windows, strict=True)
        ]
        parts.append(np.concatenate(vectors) * np.float32(np.sqrt(weight)))
    return np.concatenate(parts, axis=1)


def _embedded_live(
    measures: Mapping[Measure, NDArray[np.float64]], group: Group, comparison: Comparison
) -> tuple[NDArray[np.float32], float]:
    parts, outside = [], 0.0
    for measure, weight in group:
        metric = comparison.metrics[measure]
        vector = metric.embedded(measures[measure])
        outside += weight * metric.residual(measures[measure], vector)
        parts.append(vector * np.float32(np.sqrt(weight)))
    return np.concatenate(parts), outside


def _thresholds(
    vectors: Sequence[NDArray[np.float32]],
    indices: NDArray[np.intp],
    actors: NDArray[np.str_],
    starts: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Set thresholds by how near motions come to classes they are not of.

    Each window asks as if its class, and its actor when there are several, were not in the library: the nearest class
    it finds is a false one. A class's threshold at a rate is that quantile of its false finds, drawn towards the
    quantile of all the fewer it has.
    """
    several = len(np.unique(actors)) > 1
    total = np.zeros((len(indices), len(starts)))
    for each in vectors:
        squared = squared_distances(each, each)
        if several:
            squared[actors[:, None] == actors] = np.inf
        total += np.log(np.minimum.reduceat(squared, starts, axis=1) + NEAREST)
    total /= len(vectors)
    total[np.arange(len(indices)), indices] = np.inf
    found, nearest = total.argmin(axis=1), total.min(axis=1)
    nearest, found = nearest[np.isfinite(nearest)], found[np.isfinite(nearest)]
    if not nearest.size:
        return np.full((len(RATES), len(starts)), np.inf)
    common = np.quantile(nearest, RATES)
    thresholds = np.tile(common[:, None], len(starts))
    for index in range(len(starts)):
        own = nearest[found == index]
        if own.size:
            thresholds[:, index] = (np.quantile(own, RATES) * own.size + common * _COMMON_WEIGHT) / (
                own.size + _COMMON_WEIGHT
            )
    return thresholds


def described(table: WindowTable) -> dict[str, object]:
    """Say what a file's header must hold of a table, beside `arrays_of`."""
    return {
        "groups": [[[measure.kind, measure.seconds, weight] for measure, weight in group] for group in table.groups],
        "outside": {measure.name: metric.outside for measure, metric in table.comparison.metrics.items()},
    }


def arrays_of(table: WindowTable) -> dict[str, NDArray[np.floating]]:
    """Give the arrays that a file must hold of a table."""
    arrays: dict[str, NDArray[np.floating]] = {
        "window_motions": table.motions.astype(np.float32),
        "basis": table.comparison.basis.astype(np.float16),
    }
    for measure, metric in table.comparison.metrics.items():
        arrays[f"{measure.name}_origin"] = metric.origin.astype(np.float16)
        arrays[f"{measure.name}_axes"] = metric.axes.astype(np.float16)
    for index, vectors in enumerate(table.vectors):
        arrays[f"window_vectors{index}"] = vectors.astype(np.float16)
    return arrays


def restored(
    header: Mapping[str, Any],
    arrays: Mapping[str, NDArray[np.floating]],
    classes: NDArray[np.intp],
    actors: NDArray[np.str_],
) -> WindowTable:
    """Make a table of what `described` and `arrays_of` gave; else raise KeyError, TypeError or ValueError."""
    metrics = {
        measure: Metric(
            arrays[f"{measure.name}_origin"].astype(np.float32),
            arrays[f"{measure.name}_axes"].astype(np.float32),
            float(header["outside"][measure.name]),
        )
        for measure in MEASURES
    }
    groups = tuple(
        tuple((Measure(Kind(kind), float(seconds)), float(weight)) for kind, seconds, weight in group)
        for group in header["groups"]
    )
    motions = arrays["window_motions"]
    if not (_finite(motions) and np.array_equal(motions, np.rint(motions))):
        raise ValueError("window_motions: expected indices")
    return WindowTable(
        comparison=Comparison(arrays["basis"].astype(np.float64), metrics),
        groups=groups,
        motions=motions.astype(np.intp),
        classes=classes,
        actors=actors,
        vectors=tuple(arrays[f"window_vectors{index}"].astype(np.float32) for index in range(len(groups))),
    )
