"""The leading eigenvector of a covariance matrix, with a certificate.

A clip's covariance is solved once and exactly. A live window's changes a little from hop to hop, so the last
hop's leading subspace is nearly right already: a step or two of subspace iteration (Golub and Van Loan, Matrix
Computations, section 8.2) brings it up to date at a hundredth of the exact solver's cost. What such a step returns is
trusted only with proof; without it the exact solver answers. A window's Gram matrix, frames by frames, is solved by
the same functions as its covariance, pairs by pairs: both have the same eigenvalues.

LAPACK is called directly: on four vectors numpy's own functions take longer to check their arguments than to compute.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from scipy.linalg import eigh
from scipy.linalg.lapack import dgeqrf, dorgqr, dsyev

from library import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Largest ‖Cv − λv‖ / λ with which an eigenvector is handed out.
RESIDUAL_TOLERANCE = 1e-6
#: Eigenvectors iterated together. More converge in fewer steps but make each dearer; four also leave so little
#: variance outside the block that the proof of "leading" nearly always succeeds at once.
BLOCK = 4
#: Subspace steps tried before the exact solver is cheaper.
STEPS = 12
#: How far the bound on the second eigenvalue may lie above it, as a share of the first, where more steps would tell.
GAP_TOLERANCE = 1e-4
#: Rounding of a matrix's sum of squares, relative to it, with room to spare.
_SQUARES_ROUNDING = 1e-13


@dataclass(frozen=True, slots=True, eq=False)
class LeadingAxis:
    """The leading eigenvector of one covariance matrix.

    Attributes
    ----------
    vector
        Unit eigenvector, shape (n,). An eigenvector has no sign: whoever compares two takes the absolute value of
        their inner product.
    value
        Its eigenvalue λ, in the covariance's unit; 0 for a matrix without variance.
    runner_up
        The second largest eigenvalue; after a warm start a bound it does not exceed.
    total
        Sum of all eigenvalues, the trace.
    residual
        ‖Cv − λv‖ / λ; at most `RESIDUAL_TOLERANCE`, and 0 for a matrix without variance.
    exact
        Whether the exact solver was used.
    block
        Leading eigenvectors found on the way, shape (n, k): the start for a matrix slightly changed.
    """

    vector: NDArray[np.float64]
    value: float
    runner_up: float
    total: float
    residual: float
    exact: bool
    block: NDArray[np.float64] = field(repr=False)

    @property
    def share(self) -> float:
        """Share of the variance along the axis, 0 to 1; 0 for a matrix without variance."""
        return self.value / self.total if self.total > 0 else 0.0

    @property
    def gap(self) -> float:
        """How far the second eigenvalue stays below the first, (λ₁ − λ₂) / λ₁; 0 when the axis is arbitrary."""
        return 1.0 - self.runner_up / self.value if self.value > 0 else 0.0


def leading_axis(covariance: NDArray[np.float64], start: LeadingAxis | None = None) -> LeadingAxis:
    """Find the leading eigenvector of a covariance matrix (Le Naour et al. 2012, section 3).

    Parameters
    ----------
    covariance
        Symmetric, positive semidefinite up to rounding, shape (n, n).
    start
        The answer for a matrix close to this one; a poor start costs time, never correctness.

    Returns
    -------
    The leading axis, its residual certified.

    Raises
    ------
    ValueError
        The matrix is not square, or the start belongs to another size.
    """
    size = len(covariance)
    if covariance.shape != (size, size):
        raise ValueError(f"covariance: expected a square matrix, got {covariance.shape}")
    if start is not None and len(start.vector) != size:
        raise ValueError(f"start: expected a vector of {size}, got {len(start.vector)}")
    return LeadingAxis(*leading_axis_from(DenseMatrix(covariance), None if start is None else start.block))


class Leading(NamedTuple):
    """What `leading_axis_from` finds of any symmetric matrix: the fields are `LeadingAxis`'s."""

    vector: NDArray[np.float64]
    value: float
    runner_up: float
    total: float
    residual: float
    exact: bool
    block: NDArray[np.float64]


class SymmetricMatrix(Protocol):
    """A symmetric, positive semidefinite matrix, known by what it does to vectors.

    Attributes
    ----------
    total
        Its trace; 0 for a matrix without variance.
    """

    total: float

    def __len__(self) -> int: ...

    def times(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Multiply it with vectors, the rows of an array of shape (k, n)."""

    def dense(self) -> NDArray[np.float64]:
        """Write it out, shape (n, n)."""


class DenseMatrix:
    """A symmetric matrix written out, shape (n, n)."""

    def __init__(self, matrix: NDArray[np.float64]) -> None:
        self._matrix = matrix
        self.total = float(matrix.trace())

    def __len__(self) -> int:
        return len(self._matrix)

    def times(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Multiply it with vectors."""
        return rows @ self._matrix

    def dense(self) -> NDArray[np.float64]:
        """Give it as it is."""
        return self._matrix


def leading_axis_from(matrix: SymmetricMatrix, block: NDArray[np.float64] | None) -> Leading:
    """Find the leading eigenvector as `leading_axis` does, from any vectors thought to be near the leading ones.

    Parameters
    ----------
    matrix
        Of size n.
    block
        Shape (n, k), independent of each other if possible, neither orthogonal nor of unit length; none to solve
        exactly.
    """
    columns = min(BLOCK, len(matrix))
    if matrix.total <= 0:
        # Nothing to solve: every direction is an eigenvector, and the last as good as any.
        block = np.eye(len(matrix), columns, columns - len(matrix))[:, ::-1]
        return Leading(block[:, 0], 0.0, 0.0, matrix.total, 0.0, exact=False, block=block)
    warm = _iterated(matrix, block.T) if block is not None and block.shape[1] == columns else None
    return warm or _solved(matrix, columns)


def _solved(matrix: SymmetricMatrix, columns: int) -> Leading:
    covariance = matrix.dense()
    size = len(covariance)
    values, vectors = eigh(covariance, subset_by_index=(size - columns, size - 1), check_finite=False)
    vector, value = np.ascontiguousarray(vectors[:, -1]), max(float(values[-1]), 0.0)
    residual = float(np.linalg.norm(covariance @ vector - value * vector)) / value if value > 0 else 0.0
    runner_up = max(float(values[-2]), 0.0) if columns > 1 else 0.0
    return Leading(vector, value, runner_up, matrix.total, residual, exact=True, block=vectors[:, ::-1])


def _iterated(matrix: SymmetricMatrix, rows: NDArray[np.float64]) -> Leading | None:
    """Iterate from the last block, its vectors as rows; None when no step brought the proof."""
    before = math.inf
    image = matrix.times(rows)
    for step in range(1, STEPS + 1):
        # Two products for one orthonormal basis: the block nearly leads already, so its vectors stay apart.
        rows = _orthonormal(matrix.times(image))
        image = matrix.times(rows)
        ascending, turn, _ = dsyev(image.dot(rows.T))
        values, turn = ascending[::-1], turn.T[::-1]
        value = float(values[0])
        if value <= 0:
            return None
        rows, image = turn.dot(rows), turn.dot(image)
        outside = image - values[:, None] * rows
        residual = math.sqrt(outside[0].dot(outside[0])) / value
        if residual <= RESIDUAL_TOLERANCE:
            runner_up, certain = _proven_runner_up(matrix, values.tolist(), outside)
            if certain and runner_up < value:
                return Leading(rows[0], value, runner_up, matrix.total, residual, exact=False, block=rows.T)
            if certain:
                return None
        elif residual * (residual / before) ** (STEPS - step) > RESIDUAL_TOLERANCE:
            return None  # at this pace it will never get there
        before = residual
    return None


def _orthonormal(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    if compiled.loops:
        found = np.empty(rows.shape)
        if compiled.loops.orthonormal(np.ascontiguousarray(rows), found):
            return found
    reflectors, scales, _, _ = dgeqrf(rows.T, overwrite_a=True)
    basis, _, _ = dorgqr(reflectors, scales, overwrite_a=True)
    orthonormal: NDArray[np.float64] = basis.T
    return orthonormal


def _proven_runner_up(matrix: SymmetricMatrix, values: list[float], outside: NDArray[np.float64]) -> tuple[float, bool]:
    """Bound all eigenvalues but the block's first; say whether the bound is as good as it gets.

    A small residual proves an eigenvector, not the leading one: after a sudden change the old axis may still be exact.
    Beside it the matrix is [[A, Xᵀ], [X, D]] with A the rest of the block, whose largest eigenvalue is the second of
    `values`, X what `outside` holds of the rest's images, and D what lies outside the block. No eigenvalue of it is
    above that of [[second, ‖X‖], [‖X‖, ‖D‖]]. D has no more than what is left of the trace, and no more than the root
    of what is left of the sum of squares, which is the smaller of the two when much is left in many directions.
    """
    second = max(values[1], 0.0) if len(values) > 1 else 0.0
    others = outside[1:].reshape(-1)
    beside = float(others.dot(others))
    coupling = math.sqrt(beside)
    rest = max(matrix.total - math.fsum(values), 0.0)
    if rest > second:
        dense = matrix.dense()
        whole = float(np.vdot(dense, dense))
        left = whole - math.fsum(value * value for value in values) - 2.0 * beside
        rest = min(rest, math.sqrt(max(left, 0.0) + _SQUARES_ROUNDING * whole))
    bound = (second + rest) / 2 + math.hypot((second - rest) / 2, coupling)
    certain = bound - max(second, rest) <= GAP_TOLERANCE * values[0] or coupling <= RESIDUAL_TOLERANCE * values[0]
    return bound, certain
