"""What is measured of a window besides its leading eigenvector, all from its mean and covariance.

Three kinds of numbers, each compared by inner products:

- spread: how far each distance swings (the covariance's diagonal), in logarithms relative to the body's size;
- shape: in which directions the distances swing together. The covariance is taken in a fixed basis of some 24
  directions, divided by its trace, and its Cholesky factor written as a vector. The distance of two such vectors is the
  Cholesky distance of the covariances (Dryden, Koloydenko and Zhou, Annals of Applied Statistics 2009, section 3.2):
  a comparison of the subspaces in which they swing, without signs or near-equal eigenvalues to trouble it, and a tenth
  of the work of an eigendecomposition. It depends on the order of the directions: the clearest come first;
- posture: where the joints are on average, each distance relative to the length of the segments between its joints, so
  that proportions drop out.

Spread and shape carry over from one person to another; posture tells the motions of one person apart at once, before
anything has had time to swing, but is as much the person's as the motion's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg.blas import dgemm

from library import compiled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from library.skeleton import Skeleton

#: Added to each standard deviation, relative to the body's size, before the logarithm: a marker's noise.
SPREAD_FLOOR = 1 / 60
#: How much of the mean logarithm is taken out. All of it would make a large motion and a small one the same.
LEVEL_REMOVED = 0.5
#: Added to the variance in each direction, relative to the sum of all: what swings less is noise.
SHAPE_FLOOR = 1e-3
#: Directions in which shapes are measured.
BASIS_SIZE = 24
#: A pair whose variance is below this share of the mean pair's is rigid: what it shows is noise.
_RIGID = 1e-3
#: How much of a direction, relative to the clearest, fewer pairs must show for it to be measured by them.
_SEEN = 0.2
#: Movement, relative to where a course is, below which lost digits are of no interest to anyone.
_NO_MOVEMENT = 1e-7
#: Frames below which a window has no covariance worth measuring.
FEWEST_FRAMES = 8


class Kind(StrEnum):
    """Which numbers are taken from a window."""

    SPREAD = "spread"
    SHAPE = "shape"
    POSTURE = "posture"


#: How much of their mean numbers of each kind have been freed from.
LEVELS_REMOVED = {Kind.SPREAD: LEVEL_REMOVED, Kind.POSTURE: 0.0}


class Measure(NamedTuple):
    """Numbers of one kind, of a window of so many seconds."""

    kind: Kind
    seconds: float

    @property
    def name(self) -> str:
        """A name for files: kind and milliseconds."""
        return f"{self.kind}{round(self.seconds * 1000)}"


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """What measures need to know of a skeleton.

    Attributes
    ----------
    segments
        Index of each segment (joint and parent) among the pairs, shape (segments,).
    paths
        Which segments lie between the joints of each pair, shape (pairs, segments), 0 or 1.
    scale
        By how much the mean segment of the body that measures were learned on is longer; 1 for that body itself.
    stretches
        By how much that body's paths are longer, shape (pairs,).
    parents
        The skeleton's.
    sizing
        A distance row times these is the body's size, shape (pairs,).

    Raises
    ------
    ValueError
        The skeleton's parents are not known or do not make one tree, or it leaves its segments out; or a scale or
        stretch is not a positive number.
    """

    segments: NDArray[np.intp] = field(repr=False)
    paths: NDArray[np.float64] = field(repr=False)
    scale: float
    stretches: NDArray[np.float64] = field(repr=False)
    parents: tuple[int, ...] = field(repr=False)
    sizing: NDArray[np.float64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0 < self.scale < np.inf:
            raise ValueError(f"scale: expected a positive number, got {self.scale}")
        if self.stretches.shape != (len(self.paths),):
            raise ValueError(f"stretches: expected one for each of {len(self.paths)} pairs, got {self.stretches.shape}")
        if not (np.isfinite(self.stretches) & (self.stretches > 0)).all():
            raise ValueError("stretches: expected positive numbers")
        # One product costs a fifth of picking the segments and taking their mean.
        sizing = np.zeros(len(self.paths))
        np.add.at(sizing, self.segments, self.scale / len(self.segments))
        object.__setattr__(self, "sizing", sizing)

    @classmethod
    def of(cls, skeleton: Skeleton, scale: float = 1.0, stretches: NDArray[np.float64] | None = None) -> Body:
        """Work out segments and paths; every joint must hang together with every other."""
        if not skeleton.parents or not skeleton.with_segments:
            raise ValueError("skeleton: expected parents and segments among the pairs, got none")
        places = {(int(a), int(b)): index for index, (a, b) in enumerate(skeleton.pairs)}
        children = [joint for joint, parent in enumerate(skeleton.parents) if parent >= 0]
        segments = [places[min(j, skeleton.parents[j]), max(j, skeleton.parents[j])] for j in children]
        above = np.zeros((len(skeleton.joints), len(children)), dtype=bool)
        for joint in range(len(skeleton.joints)):
            step = joint
            while skeleton.parents[step] >= 0 and not above[joint, children.index(step)]:
                above[joint, children.index(step)] = True
                step = skeleton.parents[step]
            if skeleton.parents[step] >= 0 or len(children) != len(skeleton.joints) - 1:
                raise ValueError(f"skeleton: expected parents that make one tree, got {skeleton.parents}")
        first, second = skeleton.pairs.T
        paths = (above[first] ^ above[second]).astype(np.float64)
        stretches = np.ones(len(paths)) if stretches is None else stretches
        return cls(np.array(segments), paths, scale, stretches, skeleton.parents)

    def restricted_to(self, skeleton: Skeleton, pairs: NDArray[np.intp], rows: NDArray[np.floating]) -> Body:
        """Give the body as fewer joints show it: what its segments lack in length is made up for.

        Parameters
        ----------
        skeleton
            Of the fewer joints.
        pairs
            Where its pairs stand among this body's, shape (fewer pairs,).
        rows
            Distance rows of some people, shape (rows, pairs), metres.
        """
        fewer = Body.of(skeleton)
        scale = float(np.mean(self.size(rows) / fewer.size(rows[:, pairs])))
        stretches = self.lengths(rows)[:, pairs] / fewer.lengths(rows[:, pairs])
        # Rounded as files keep them, so that saving and loading changes nothing.
        kept = stretches.mean(axis=0).astype(np.float32).astype(np.float64)
        return Body(fewer.segments, fewer.paths, scale, kept, fewer.parents)

    def size(self, rows: NDArray[np.floating]) -> NDArray[np.float64]:
        """Mean length of the segments in distance rows (..., pairs), metres: shape (...)."""
        size: NDArray[np.float64] = rows @ self.sizing
        return size

    def lengths(self, rows: NDArray[np.floating]) -> NDArray[np.float64]:
        """Length of the segments between the joints of each pair in distance rows (..., pairs), metres, likewise."""
        lengths: NDArray[np.float64] = (rows[..., self.segments] @ self.paths.T) * self.stretches
        return lengths

    def spread(self, mean: NDArray[np.float64], deviation: NDArray[np.float64]) -> NDArray[np.float64]:
        """Measure spreads from mean rows and standard deviations, both (..., pairs), metres.

        A body without size, all joints in one point as some trackers send who see nobody, does not swing.
        """
        size = self.size(mean)[..., None]
        logs: NDArray[np.float64] = np.log(deviation / np.where(size > 0, size, np.inf) + SPREAD_FLOOR)
        logs -= LEVEL_REMOVED * logs.mean(axis=-1, keepdims=True)
        return logs

    def posture(self, mean: NDArray[np.float64]) -> NDArray[np.float64]:
        """Measure postures from mean rows (..., pairs), metres; 0 where there is no length between two joints."""
        lengths = self.lengths(mean)
        return mean / np.where(lengths > 0, lengths, np.inf)


def shapes_in(courses: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Measure the shapes of windows, of one at least, by their courses in the basis, each (frames, n).

    Returns
    -------
    As `shape_of` has them, shape (windows, n (n + 1) / 2).
    """
    size, loops = courses[0].shape[1], compiled.loops
    if loops is None or size > loops.MOST_DIRECTIONS:
        return shape_of(np.array([covariance_in(each) for each in courses]))
    shapes = np.empty((len(courses), size * (size + 1) // 2))
    for each, shape in zip(courses, shapes, strict=True):
        loops.read_shape(each, SHAPE_FLOOR, _NO_MOVEMENT, shape)
    return shapes


def covariance_in(courses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Take the covariance of one window's courses in the basis, (frames, n) to (n, n).

    A body that does not move, to seven digits, has none: what would be left is rounding.
    """
    count = len(courses)
    mean = _even(count) @ courses
    centred = courses - mean
    # dgemm takes its operands column by column: the transposed views are that without a copy. It takes half as long as
    # the matrix product of numpy, which fills in the other half of a symmetric matrix afterwards.
    covariance: NDArray[np.float64] = dgemm(1 / max(count - 1, 1), centred.T, centred.T, trans_b=True)
    if float(covariance.trace()) <= float(mean @ mean) * _NO_MOVEMENT**2:
        covariance[:] = 0.0
    return covariance


@lru_cache(256)
def _even(count: int) -> NDArray[np.float64]:
    """Give weights with which so many rows add up to their mean, shape (count,)."""
    return np.full(count, 1 / count)


def shape_of(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Measure shapes from covariances in the basis, (..., n, n): vectors of n (n + 1) / 2, about unit length.

    The vector holds the lower triangle of the Cholesky factor of C / tr C + `SHAPE_FLOOR`. A window without variance
    has the zero vector.
    """
    size = covariance.shape[-1]
    floor, lower = _square(size)
    total = covariance.trace(axis1=-2, axis2=-1)[..., None]
    moves = total > 0
    relative: NDArray[np.float64] = covariance / np.where(moves, total, 1.0)[..., None]
    relative += floor
    factor = np.asarray(np.linalg.cholesky(relative), dtype=np.float64)
    shape: NDArray[np.float64] = factor.reshape(*factor.shape[:-2], size * size).take(lower, axis=-1)
    shape *= moves
    return shape


def covariance_of(shape: NDArray[np.floating]) -> NDArray[np.float64]:
    """Give covariances of these shapes, (..., n (n + 1) / 2): (..., n, n), of trace 1 and what `SHAPE_FLOOR` added."""
    size = math.isqrt(2 * shape.shape[-1])
    factor = np.zeros((*shape.shape[:-1], size * size))
    factor[..., _square(size)[1]] = shape
    factor = factor.reshape(*shape.shape[:-1], size, size)
    covariance: NDArray[np.float64] = factor @ np.swapaxes(factor, -1, -2)
    return covariance


@cache
def _square(size: int) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Give what is added to a square matrix, and where its lower triangle, row by row, lies in memory."""
    rows, columns = np.tril_indices(size)
    return SHAPE_FLOOR * np.eye(size), rows * size + columns


@dataclass(frozen=True, slots=True, eq=False)
class Basis:
    """The directions in which shapes are measured.

    Attributes
    ----------
    directions
        Distance rows times these are a window's course in the basis, shape (pairs, directions).
    weights
        What each pair is multiplied by so that all swing alike, 0 for rigid ones, shape (pairs,): directions divided
        by weights are orthonormal.

    Raises
    ------
    ValueError
        Shapes do not fit, or a number is not finite.
    """

    directions: NDArray[np.float64] = field(repr=False)
    weights: NDArray[np.float64] = field(repr=False)

    def __post_init__(self) -> None:
        if self.directions.ndim != 2 or not np.isfinite(self.directions).all():
            raise ValueError(f"basis: expected finite (pairs, directions), got {self.directions.shape}")
        if self.weights.shape != (len(self.directions),) or not (np.isfinite(self.weights) & (self.weights >= 0)).all():
            raise ValueError(
                f"weights: expected one for each of {len(self.directions)} pairs, got {self.weights.shape}"
            )

    def restricted_to(self, pairs: NDArray[np.intp]) -> Basis:
        """Find the course in the same directions from fewer pairs, (fewer pairs,), by least squares."""
        weights = self.weights[pairs]
        return Basis(np.linalg.pinv(self._seen(pairs).T, rcond=_SEEN) * weights[:, None], weights)

    def shown_by(self, pairs: NDArray[np.intp]) -> NDArray[np.float64]:
        """Say which course is found from fewer pairs, (fewer pairs,): a projector, (directions, directions)."""
        seen = self._seen(pairs).T
        projector: NDArray[np.float64] = seen @ np.linalg.pinv(seen, rcond=_SEEN)
        return projector

    def _seen(self, pairs: NDArray[np.intp]) -> NDArray[np.float64]:
        """Give what these pairs have of the orthonormal directions, (fewer pairs, directions)."""
        weights = self.weights[pairs]
        seen: NDArray[np.float64] = self.directions[pairs] / np.where(weights > 0, weights, 1.0)[:, None]
        return seen


def learned_basis(rows_by_class: Sequence[Sequence[NDArray[np.float64]]], body: Body) -> Basis:
    """Learn the directions in which the distances of many motions swing.

    Each pair counts alike however far it swings, each class however many motions it has. Rigid pairs count nothing.

    Parameters
    ----------
    rows_by_class
        For each class the distance rows of its motions, each (frames, pairs), metres.
    body
        For the bodies' sizes.
    """
    classes = []
    for motions in rows_by_class:
        relative = [rows / body.size(rows.mean(axis=0)) for rows in motions]
        classes.append(np.mean([np.cov(rows.T, bias=True) for rows in relative], axis=0))
    covariance = np.mean(classes, axis=0)
    variances = covariance.diagonal()
    moving = variances > _RIGID * variances.mean()
    weights = np.where(moving, 1 / np.sqrt(np.where(moving, variances, 1.0)), 0.0)
    _, vectors = np.linalg.eigh(covariance * weights[:, None] * weights)
    return Basis(vectors[:, ::-1][:, :BASIS_SIZE] * weights[:, None], weights)


def measured(  # noqa: PLR0913 - a recording, its windows, and all that measures need
    rows: NDArray[np.float64],
    frame_rate: float,
    ends: NDArray[np.intp],
    measure: Measure,
    *,
    body: Body,
    basis: Basis,
) -> NDArray[np.float64]:
    """Measure many windows of one recording.

    Parameters
    ----------
    rows
        Distance rows, shape (frames, pairs), metres.
    frame_rate
        Frames per second.
    ends
        For each window the index after its last frame; at least `FEWEST_FRAMES`. A window reaches back as far as the
        recording does, at most the measure's seconds (two frames where those are fewer).
    measure
        What.
    body, basis
        As learned.

    Returns
    -------
    Shape (windows, numbers).
    """
    if not len(ends):
        directions = basis.directions.shape[1]
        return np.zeros((0, directions * (directions + 1) // 2 if measure.kind is Kind.SHAPE else rows.shape[1]))
    starts = np.maximum(ends - max(round(measure.seconds * frame_rate), 2), 0)
    if measure.kind is Kind.SHAPE:
        seen = rows @ basis.directions
        return shapes_in([seen[a:b] for a, b in zip(starts, ends, strict=True)])
    means = np.array([rows[a:b].mean(axis=0) for a, b in zip(starts, ends, strict=True)])
    if measure.kind is Kind.POSTURE:
        return body.posture(means)
    deviations = np.array([rows[a:b].std(axis=0, ddof=1) for a, b in zip(starts, ends, strict=True)])
    return body.spread(means, deviations)
