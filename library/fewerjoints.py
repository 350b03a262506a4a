"""What fewer joints show of windows that were measured with all.

Vectors of a live window can be estimated from fewer distances and compared with the library's: so a motion is named.
But an estimate lacks what the distances do not tell, and is far from everything by that alone. Whether a motion is
known is therefore asked where both lack the same: the library's vectors are taken through the estimate as well, and
shapes are measured in the directions that the fewer distances show.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from library import compiled
from library.measures import LEVELS_REMOVED, SHAPE_FLOOR, Basis, Kind, covariance_of, shape_of
from library.metric import halved, principal_metric

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from library.measures import Measure
    from library.metric import Metric

#: Joints below which a body has no segments between which anything could be missing.
_FEWEST_JOINTS = 3


class Shown(NamedTuple):
    """Windows as fewer joints show them.

    Attributes
    ----------
    vectors
        The windows', for each group, (windows, kept axes).
    metrics
        How measures become such vectors, those of shapes in `directions`.
    directions
        A course in the library's directions times these is one in the directions shown, (directions, shown).
    """

    vectors: tuple[NDArray[np.float32], ...]
    metrics: dict[Measure, Metric]
    directions: NDArray[np.float64]


def shown_by(  # noqa: PLR0913 - windows, how they were made, and how they are seen
    pairs: NDArray[np.intp],
    groups: Sequence[Sequence[tuple[Measure, float]]],
    vectors: Sequence[NDArray[np.float32]],
    *,
    whole: Mapping[Measure, Metric],
    basis: Basis,
    estimating: Mapping[Measure, Metric],
) -> Shown:
    """Give what fewer pairs show of windows.

    Parameters
    ----------
    pairs
        Where the fewer pairs stand, shape (fewer pairs,).
    groups
        Measures with their weights, as vectors hold them one after the other.
    vectors
        The windows', for each group, shape (windows, kept axes).
    whole, basis
        How they were made.
    estimating
        How vectors of spread and posture are estimated from the fewer pairs.
    """
    parts = _parts(groups, vectors, whole)
    covariances = {
        measure: covariance_of(part @ np.linalg.pinv(whole[measure].axes.astype(np.float64)) + whole[measure].origin)
        for measure, part in parts.items()
        if measure.kind is Kind.SHAPE
    }
    directions = _shown_directions(basis.shown_by(pairs), list(covariances.values()))
    metrics: dict[Measure, Metric] = {}
    shown: list[NDArray[np.float32]] = []
    for group in groups:
        found = []
        for measure, weight in group:
            if measure.kind is Kind.SHAPE:
                shapes = shape_of(directions.T @ covariances[measure] @ directions)
                metrics[measure] = principal_metric(shapes, whole[measure].outside, parts[measure].shape[1])
                part = metrics[measure].embedded(shapes).astype(np.float64)
            else:
                metrics[measure] = estimating[measure]
                part = whole[measure].shown_by(parts[measure], pairs, LEVELS_REMOVED[measure.kind])
            found.append(part * np.sqrt(weight))
        shown.append(halved(np.concatenate(found, axis=1)))
    return Shown(tuple(shown), metrics, directions)


def _parts(
    groups: Sequence[Sequence[tuple[Measure, float]]],
    vectors: Sequence[NDArray[np.float32]],
    metrics: Mapping[Measure, Metric],
) -> dict[Measure, NDArray[np.float64]]:
    """Take the vectors of each measure out of those of the groups, (windows, kept axes), and their weight off them."""
    parts: dict[Measure, NDArray[np.float64]] = {}
    for group, each in zip(groups, vectors, strict=True):
        start = 0
        for measure, weight in group:
            end = start + metrics[measure].axes.shape[1]
            parts[measure] = each[:, start:end].astype(np.float64) / np.sqrt(weight)
            start = end
    return parts


def _shown_directions(
    projector: NDArray[np.float64], covariances: Sequence[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Choose orthonormal directions among those shown, where windows swing most first: the order matters to shapes."""
    mean = np.mean([each.mean(axis=0) for each in covariances], axis=0) if covariances else np.eye(len(projector))
    _, principal = np.linalg.eigh(projector @ mean @ projector)
    directions = principal[:, ::-1][:, : round(float(projector.trace()))]
    # Rounded as files keep them, so that saving and loading changes nothing.
    return directions.astype(np.float32).astype(np.float64)


def turned(shapes: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give shapes, (..., n (n + 1) / 2), in other directions, (n, fewer): as many numbers as those make."""
    loops, size = compiled.loops, len(directions)
    if loops is None or size > loops.MOST_DIRECTIONS or shapes.ndim != 2:
        return shape_of(directions.T @ covariance_of(shapes) @ directions)
    fewer = directions.shape[1]
    others = np.empty((len(shapes), fewer * (fewer + 1) // 2))
    # Those of a file lie as they lie there.
    directions = np.ascontiguousarray(directions)
    for shape, numbers in zip(shapes, others, strict=True):
        loops.turn_shape(shape, directions, SHAPE_FLOOR, numbers)
    return others


def some_of(joints: int) -> tuple[tuple[int, ...], ...]:
    """Choose fewer of so many joints in some ways, to see what a library lacks by it.

    Returns
    -------
    Indices, ascending: a third, half and two thirds of them, each joint as often as any other; without sets too small.
    """
    sets = [tuple(range(first, joints, step)) for step in (3, 2) for first in range(step)]
    sets += [tuple(joint for joint in range(joints) if joint % 3 != first) for first in range(3)]
    return tuple(kept for kept in sets if _FEWEST_JOINTS <= len(kept) < joints)
