"""The parts of a window's signature: all are computed from the mean and the covariance of its distance rows.

- eigen: the leading eigenvectors of the covariance in the basis, the paper's vector first. k of them with their
  eigenvalues make a matrix of rank k, sum of √λᵢ uᵢ uᵢᵀ, of length 1. The inner product of two such matrices is
  Σᵢⱼ √λᵢ √μⱼ ⟨uᵢ, vⱼ⟩²: for k = 1 the square of the paper's measure (Le Naour et al. 2012, section 3);
- spread: how far each distance swings (the covariance's diagonal), in logarithms relative to the body's size;
- posture: where the joints are on average, each distance relative to the segments between its joints, so that
  proportions drop out;
- trend: the correlation of each distance with time (the covariance of the distance with time, over the deviations of
  both). It has a sign, so it distinguishes sitting down from standing up, which have the same covariance.

The same functions serve the windows of a library and a live window, so that both are computed alike.
"""

from collections.abc import Iterable, Mapping
from enum import StrEnum
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.signature.body import Body

#: Added to each deviation, relative to the body's size, before the logarithm: the noise of a marker.
NOISE_FLOOR = 1 / 60
#: The share of the mean logarithm that is subtracted. All of it would make a large and a small motion the same.
LEVEL_REMOVED = 0.5
#: Eigenvectors of the eigen part.
EIGENVECTORS = 4


class Kind(StrEnum):
    """The kinds of parts."""

    # A part is looked up at every hop, and an enumeration's own hash is slow.
    __hash__ = str.__hash__

    EIGEN = "eigen"
    SPREAD = "spread"
    POSTURE = "posture"
    TREND = "trend"


class Part(NamedTuple):
    """One part of a signature: its kind, and the seconds of its window."""

    kind: Kind
    seconds: float

    @property
    def name(self) -> str:
        """A name for tables, like `eigen 2 s`."""
        return f"{self.kind} {self.seconds:g} s"


EIGEN_LONG = Part(Kind.EIGEN, 2.0)
EIGEN_SHORT = Part(Kind.EIGEN, 0.5)
SPREAD_LONG = Part(Kind.SPREAD, 1.0)
SPREAD_SHORT = Part(Kind.SPREAD, 0.25)
POSTURE = Part(Kind.POSTURE, 0.25)
TREND_LONG = Part(Kind.TREND, 1.0)
TREND_SHORT = Part(Kind.TREND, 0.25)
PARTS = (EIGEN_LONG, EIGEN_SHORT, SPREAD_LONG, SPREAD_SHORT, POSTURE, TREND_LONG, TREND_SHORT)
#: The parts that no longer see the motion before after half a second.
SHORT_PARTS = (EIGEN_SHORT, SPREAD_SHORT, POSTURE, TREND_SHORT)


def lengths_of(parts: Iterable[Part]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Give the lengths of the windows of distances, and of the windows in the basis, seconds, each ascending.

    Where no eigen part is compared the leading eigenvector is still found, over two seconds.
    """
    every = tuple(parts)
    of_distances = {part.seconds for part in every if part.kind is not Kind.EIGEN}
    in_basis = {part.seconds for part in every if part.kind is Kind.EIGEN} or {EIGEN_LONG.seconds}
    return tuple(sorted(of_distances)), tuple(sorted(in_basis))


class Moments(NamedTuple):
    """The moments of some windows' distance rows.

    Attributes
    ----------
    mean, deviation
        Mean and standard deviation of each distance, shape (windows, pairs), metres.
    trend
        Covariance of each distance with time, over the standard deviation of the times, shape (windows, pairs),
        metres: at most the deviation.
    """

    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]
    trend: NDArray[np.float64]


class Signature(NamedTuple):
    """What a window shows.

    Attributes
    ----------
    parts
        The numbers of each part, (numbers,), or (eigenvectors, directions).
    leading
        The leading eigenvector of the longest window in the basis, shape (directions,).
    movement
        `movement` over the longest window of distances.
    share, gap
        Share of the variance of the longest window in the basis along its leading eigenvector, and (λ₁ − λ₂) / λ₁ of
        its two leading eigenvalues, 0 to 1.
    """

    parts: Mapping[Part, NDArray[np.float64]]
    leading: NDArray[np.float64]
    movement: float
    share: float
    gap: float


def spread(moments: Moments, body: Body) -> NDArray[np.float64]:
    """Compute spreads, shape (windows, pairs); 0 for a body without size, with all joints in one point."""
    relative = moments.deviation / _positive(body.size(moments.mean))[:, None]
    relative += NOISE_FLOOR
    logs: NDArray[np.float64] = np.log(relative, out=relative)
    logs -= (LEVEL_REMOVED / logs.shape[-1]) * np.add.reduce(logs, axis=-1, keepdims=True)
    return logs


def posture(moments: Moments, body: Body) -> NDArray[np.float64]:
    """Compute postures, shape (windows, pairs); 0 where there is no length between two joints."""
    return moments.mean / _positive(body.lengths(moments.mean))


def trend(moments: Moments, body: Body) -> NDArray[np.float64]:
    """Compute trends, shape (windows, pairs), between -1 and 1: 0 where a distance moves no more than noise."""
    floor = NOISE_FLOOR * body.size(moments.mean)[:, None]
    return moments.trend / _positive(moments.deviation + floor)


#: The function that computes each kind of part from moments.
FORMULAS = {Kind.SPREAD: spread, Kind.POSTURE: posture, Kind.TREND: trend}


def eigen(values: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale eigenvectors by the fourth root of their eigenvalue's share, shape (windows, k, directions).

    Eigenvalues are (windows, k), eigenvectors of unit length (windows, k, directions), the leading ones first.

    The squared inner products of two windows' scaled eigenvectors add up to the inner product of their matrices, Σᵢⱼ
    √λᵢ √μⱼ ⟨uᵢ, vⱼ⟩²: 1 for the same window, 0 for a window that moves in other directions. A window without movement
    has zero vectors.
    """
    values = np.maximum(values, 0.0)
    # The squared length of the matrix is the sum of its eigenvalues.
    shares = values / _positive(values.sum(axis=1))[:, None]
    scaled: NDArray[np.float64] = vectors * np.sqrt(np.sqrt(shares))[:, :, None]
    return scaled


def flattened(scaled: NDArray[np.floating]) -> NDArray[np.float64]:
    """Write the matrices Σᵢ sᵢ sᵢᵀ of scaled eigenvectors (..., k, directions) as vectors.

    Inner products of two vectors are inner products of the matrices: numbers off the diagonal appear once, times √2.

    Returns
    -------
    Shape (..., directions (directions + 1) / 2).
    """
    places, factors = upper_triangle(scaled.shape[-1])
    matrices = np.matmul(np.swapaxes(scaled, -1, -2), scaled)
    vectors: NDArray[np.float64] = matrices.reshape(*scaled.shape[:-2], -1)[..., places] * factors
    return vectors


def movement(moments: Moments) -> NDArray[np.float64]:
    """Give the root mean square deviation of a distance over the root mean square distance, shape (windows,)."""
    lengths = np.square(moments.mean).sum(axis=-1)
    moved: NDArray[np.float64] = np.sqrt(np.square(moments.deviation).sum(axis=-1) / _positive(lengths))
    return moved


def _positive(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Replace numbers that are not above 0 by infinity, so that a division by them gives 0."""
    return np.where(numbers > 0, numbers, np.inf)


@cache
def upper_triangle(size: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Give where the numbers of a symmetric matrix's upper triangle lie in its memory, and their factors."""
    rows, columns = np.triu_indices(size)
    return rows * size + columns, np.where(rows == columns, 1.0, np.sqrt(2.0))
