"""How windows are measured and compared: which measures, and the metrics that several people's clips teach.

Which measures a library is compared by depends on for whom it is: `FOR_ANYBODY` or `FOR_ONE_PERSON`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from library.distances import distance_rows
from library.measures import FEWEST_FRAMES, LEVELS_REMOVED, Basis, Body, Kind, Measure, learned_basis, measured
from library.metric import Metric, halved, learned_metric

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from library.clip import Clip
    from library.skeleton import Skeleton

#: Measures added up before the logarithm, with their weights; over the groups the logarithms are averaged.
Group = tuple[tuple[Measure, float], ...]

SPREAD_QUARTER, SPREAD_ONE = Measure(Kind.SPREAD, 0.25), Measure(Kind.SPREAD, 1.0)
SHAPE_ONE, SHAPE_TWO = Measure(Kind.SHAPE, 1.0), Measure(Kind.SHAPE, 2.0)
POSTURE = Measure(Kind.POSTURE, 0.125)
MEASURES = (SPREAD_QUARTER, SPREAD_ONE, SHAPE_ONE, SHAPE_TWO, POSTURE)

FOR_ANYBODY: tuple[Group, ...] = (((SPREAD_ONE, 1.0),), ((SHAPE_ONE, 1.0),), ((SHAPE_TWO, 1.0),))
FOR_ONE_PERSON: tuple[Group, ...] = (((SPREAD_QUARTER, 1.0), (POSTURE, 2.0)),)

#: Windows learned from: one in so many seconds of a motion.
_LEARN_EVERY = 2 / 15
#: Frames from a short clip's end at which its first window ends, so that it has one.
_SPARE_FRAMES = 3
_KEPT_AXES = {Kind.SPREAD: 64, Kind.POSTURE: 64, Kind.SHAPE: 96}
#: Whitening carries over between laboratories for spread and posture, and not for shape.
_SHRINKAGE = {Kind.SPREAD: 0.3, Kind.POSTURE: 0.3, Kind.SHAPE: 1.0}


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """How windows are measured and compared: learned once, from several people, and shared by libraries.

    Attributes
    ----------
    body
        Whose rows are measured.
    basis
        Directions in which shapes are measured.
    metrics
        By measure.

    Raises
    ------
    ValueError
        Shapes do not fit, or a number is not finite.
    """

    body: Body = field(repr=False)
    basis: Basis = field(repr=False)
    metrics: Mapping[Measure, Metric] = field(repr=False)

    def __post_init__(self) -> None:
        pairs, directions = self.basis.directions.shape
        if len(self.body.paths) != pairs:
            raise ValueError(f"body: expected one of {pairs} pairs, got {len(self.body.paths)}")
        for measure, metric in self.metrics.items():
            numbers = directions * (directions + 1) // 2 if measure.kind is Kind.SHAPE else pairs
            if metric.origin.shape != (numbers,) or metric.axes.ndim != 2 or len(metric.axes) != numbers:
                raise ValueError(f"{measure.name}: expected {numbers} numbers, got {metric.axes.shape}")
            if not (finite(metric.origin, metric.axes) and 0 <= metric.outside < np.inf):
                raise ValueError(f"{measure.name}: expected finite numbers, got NaN or infinity")
            if metric.together.size or metric.spare.size:
                if metric.together.shape != metric.axes.T.shape or metric.spare.shape != (numbers,):
                    raise ValueError(f"{measure.name}: expected what varies together of {numbers} numbers")
                if not (finite(metric.together, metric.spare) and (metric.spare > 0).all()):
                    raise ValueError(f"{measure.name}: expected finite variances above 0")

    @property
    def pairs(self) -> int:
        """How many distances a row has."""
        return len(self.basis.weights)

    def is_same(self, other: Comparison) -> bool:
        """Whether another comparison maps every window to the same vectors."""
        same_body = np.array_equal(self.body.paths, other.body.paths) and self.body.scale == other.body.scale
        return (
            same_body
            and np.array_equal(self.body.stretches, other.body.stretches)
            and np.array_equal(self.basis.directions, other.basis.directions)
            and all(
                np.array_equal(metric.origin, other.metrics[measure].origin)
                and np.array_equal(metric.axes, other.metrics[measure].axes)
                and metric.outside == other.metrics[measure].outside
                for measure, metric in self.metrics.items()
            )
        )

    @property
    def can_be_restricted(self) -> bool:
        """Whether it was learned, not itself made from another one for fewer joints."""
        return all(metric.together.size for measure, metric in self.metrics.items() if measure.kind is not Kind.SHAPE)

    def restricted_to(self, skeleton: Skeleton, pairs: NDArray[np.intp], rows: NDArray[np.floating]) -> Comparison:
        """Give the comparison that finds the same vectors from fewer joints, as nearly as those tell.

        Parameters
        ----------
        skeleton
            Of the fewer joints.
        pairs
            Where its pairs stand among this comparison's, shape (fewer pairs,).
        rows
            Distance rows of some people, shape (rows, pairs), metres.

        Raises
        ------
        ValueError
            It was itself made from another one so.
        """
        return Comparison(
            body=self.body.restricted_to(skeleton, pairs, rows),
            basis=kept_in_files(self.basis.restricted_to(pairs)),
            metrics={
                measure: metric
                if measure.kind is Kind.SHAPE
                else metric.restricted_to(pairs, LEVELS_REMOVED[measure.kind])
                for measure, metric in self.metrics.items()
            },
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
        windows = [window_ends(clip, _LEARN_EVERY, FEWEST_FRAMES / clip.frame_rate) for clip in clips]
        classes = np.concatenate(
            [np.full(len(ends), names.index(clip.class_name)) for clip, ends in zip(clips, windows, strict=True)]
        )
        actors = np.concatenate([np.full(len(ends), clip.actor) for clip, ends in zip(clips, windows, strict=True)])
        metrics = {}
        for measure in MEASURES:
            numbers = np.concatenate(
                [windows_measured(clip, ends, measure, body, basis) for clip, ends in zip(clips, windows, strict=True)]
            )
            metrics[measure] = learned_metric(
                numbers,
                classes,
                actors,
                shrinkage=_SHRINKAGE[measure.kind],
                kept=_KEPT_AXES[measure.kind],
                together=measure.kind is not Kind.SHAPE,
            )
        return cls(body, kept_in_files(basis), metrics)


def kept_in_files(basis: Basis) -> Basis:
    """Round as files keep it, so that saving and loading changes nothing."""
    return Basis(halved(basis.directions).astype(np.float64), halved(basis.weights).astype(np.float64))


def finite(*arrays: NDArray[np.floating]) -> bool:
    """Whether there is neither NaN nor infinity in any array."""
    return all(np.isfinite(array).all() for array in arrays)


def window_ends(clip: Clip, every: float, first: float) -> NDArray[np.intp]:
    """Windows end every so many seconds, the first when so many have been seen, or with the clip."""
    earliest = max(FEWEST_FRAMES, min(round(first * clip.frame_rate), clip.frames - _SPARE_FRAMES))
    return np.arange(earliest, clip.frames + 1, max(1, round(every * clip.frame_rate)))


def windows_measured(
    clip: Clip, ends: NDArray[np.intp], measure: Measure, body: Body, basis: Basis
) -> NDArray[np.float64]:
    """Measure the windows of a clip that end before some indices, shape (windows, numbers)."""
    rows = distance_rows(clip.positions, clip.skeleton)
    return measured(rows, clip.frame_rate, ends, measure, body=body, basis=basis)
