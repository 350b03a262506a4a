"""What is kept of a motion, at rest or in flight: one function makes both, so they cannot drift apart."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from library.eigen import LeadingAxis, leading_axis

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Mean and covariance of some distance rows: all that a signature needs of them.

    Attributes
    ----------
    count
        How many rows.
    mean
        Mean row, shape (pairs,), metres.
    covariance
        Sample covariance (divided by count - 1), shape (pairs, pairs), square metres. All zeros for a single row.
    """

    count: int
    mean: NDArray[np.float64] = field(repr=False)
    covariance: NDArray[np.float64] = field(repr=False)

    @classmethod
    def of_rows(cls, rows: NDArray[np.float64]) -> Moments:
        """Take the moments of distance rows, shape (frames, pairs), metres.

        Raises
        ------
        ValueError
            There is no row, or the rows are not a matrix.
        """
        if rows.ndim != 2 or not len(rows):
            raise ValueError(f"rows: expected (frames, pairs) with at least one frame, got {rows.shape}")
        mean = rows.mean(axis=0)
        centred = rows - mean
        return cls(len(rows), mean, centred.T @ centred / max(len(rows) - 1, 1))


@dataclass(frozen=True, slots=True, eq=False)
class Signature:
    """What is kept of a motion.

    Attributes
    ----------
    mean
        Mean distance row, shape (pairs,), metres.
    deviation
        Standard deviation of each distance, shape (pairs,), metres.
    axis
        Leading eigenvector of the covariance, with its eigenvalue in square metres.
    """

    mean: NDArray[np.float64] = field(repr=False)
    deviation: NDArray[np.float64] = field(repr=False)
    axis: LeadingAxis

    @property
    def body_size(self) -> float:
        """Root mean square of the mean distances, metres: the scale against which movement is judged."""
        return body_size_of(self.mean)

    @property
    def movement(self) -> float:
        """Root mean square deviation of a distance in units of the body's size; 0 for a statue."""
        return movement_of(self.body_size, self.axis.total, len(self.mean))


def body_size_of(mean: NDArray[np.float64]) -> float:
    """Root mean square of mean distances, shape (pairs,), metres."""
    return math.sqrt(float(mean @ mean) / len(mean))


def movement_of(body_size: float, total: float, pairs: int) -> float:
    """Root mean square deviation of a distance in units of the body's size.

    Parameters
    ----------
    body_size
        Root mean square of the mean distances, metres.
    total
        Sum of all distances' variances, square metres.
    pairs
        How many distances.
    """
    return math.sqrt(total / pairs) / body_size if body_size > 0 else 0.0


def signature_of(moments: Moments, start: LeadingAxis | None = None) -> Signature:
    """Make the signature of a motion: the first principal axis of its centred distances (paper, section 3).

    Parameters
    ----------
    moments
        Of the clip's rows, or of the live window's.
    start
        The axis of the hop before, to start from; none for a clip.
    """
    deviation = np.sqrt(np.maximum(moments.covariance.diagonal(), 0.0))
    return Signature(moments.mean, deviation, leading_axis(moments.covariance, start))


def similarity(axes: NDArray[np.floating], axis: NDArray[np.floating]) -> NDArray[np.floating]:
    """Compare unit eigenvectors by the inner product (paper, section 3), as its absolute value.

    The sign of an eigenvector is arbitrary, so the sign of the product says nothing.

    Parameters
    ----------
    axes
        Shape (motions, pairs).
    axis
        Shape (pairs,), or (pairs, windows) for several at once.

    Returns
    -------
    0 (unlike) to 1 (the same axis), shape (motions,) or (motions, windows).
    """
    product: NDArray[np.floating] = np.abs(axes @ axis)
    return product
