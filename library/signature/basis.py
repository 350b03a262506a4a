"""Leading eigenvectors, and the basis in which covariances are kept: directions that hold nearly all movement."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from kinespace.library.signature.body import Body

#: Directions in the basis. With HDM05's 31 joints they hold 98.6 % of the weighted variance (`Basis.share`).
MAX_DIRECTIONS = 32
#: A pair whose variance is below this share of the mean pair's is rigid: its variance is only noise.
_RIGID = 1e-3


@dataclass(frozen=True, slots=True, weakref_slot=True, eq=False)
class Basis:
    """Directions of distance space in which motions vary most, when every moving pair weighs alike.

    Attributes
    ----------
    directions
        A distance row times these is a point in the basis, shape (pairs, directions).
    weights
        The factor of each pair that makes all pairs vary alike, 0 for rigid pairs, shape (pairs,): directions divided
        by weights are orthonormal.
    share
        Share of the weighted variance that the directions hold, 0 to 1.
    """

    directions: NDArray[np.float64] = field(repr=False)
    weights: NDArray[np.float64] = field(repr=False)
    share: float

    @classmethod
    def learned(
        cls, rows_by_class: Iterable[Iterable[NDArray[np.float64]]], body: Body, *, weighted: bool = True
    ) -> "Basis":
        """Learn the directions in which the distances of many motions vary most.

        Each class counts alike, whatever its number of motions, and each pair counts alike, whatever its variance.
        Rigid pairs do not count.

        Parameters
        ----------
        rows_by_class
            For each class the distance rows of its motions, each (frames, pairs), metres; iterated once.
        body
            Gives the size of the body that performs each motion.
        weighted
            Whether all pairs weigh alike; if not, each pair weighs as much as it varies.
        """
        covariance = np.mean([_mean_covariance(motions, body) for motions in rows_by_class], axis=0)
        variances = covariance.diagonal()
        moving = variances > _RIGID * variances.mean()
        if not weighted:
            moving, variances = np.ones_like(moving), np.ones_like(variances)
        weights = np.where(moving, 1 / np.sqrt(np.where(moving, variances, 1.0)), 0.0)
        weighed = covariance * weights[:, None] * weights
        values, kept = leading_eigenvectors(weighed, min(MAX_DIRECTIONS, int(moving.sum())))
        total = float(weighed.trace())
        share = float(values.sum()) / total if total > 0 else 0.0
        return cls.of(kept * weights[:, None], weights, share)

    @classmethod
    def of(cls, directions: NDArray[np.floating], weights: NDArray[np.floating], share: float) -> "Basis":
        """Make a basis of its attributes, rounded to the single precision in which a library's file keeps them."""
        directions, weights = (each.astype(np.float32).astype(np.float64) for each in (directions, weights))
        return cls(directions, weights, share)


def _mean_covariance(motions: Iterable[NDArray[np.float64]], body: Body) -> NDArray[np.float64]:
    """Average the covariances of motions relative to the body's size, shape (pairs, pairs)."""
    scatter = []
    for rows in motions:
        mean = rows.mean(axis=0)
        if not body.size(mean) > 0:
            raise ValueError("positions: expected a body, got a motion with all joints in one place")
        scatter.append(((rows - mean) / (body.size(mean) * np.sqrt(len(rows)))).astype(np.float32))
    stacked = np.concatenate(scatter)
    covariance: NDArray[np.float64] = (stacked.T @ stacked).astype(np.float64) / len(scatter)
    return covariance


_Number = TypeVar("_Number", np.float32, np.float64)


def leading_eigenvectors(matrix: NDArray[_Number], most: int) -> tuple[NDArray[_Number], NDArray[_Number]]:
    """Find the leading eigenvalues of a symmetric matrix and their eigenvectors, the largest first.

    Parameters
    ----------
    matrix
        Shape (size, size).
    most
        How many to find at most.

    Returns
    -------
    The values (found,), and the vectors (size, found), unit length.
    """
    size = len(matrix)
    if most < 1:
        return matrix[0, :0], matrix[:, :0]
    values, vectors = (each[..., max(size - most, 0) :] for each in np.linalg.eigh(matrix))
    return values[::-1].astype(matrix.dtype), vectors[:, ::-1].astype(matrix.dtype)
