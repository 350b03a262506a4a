"""The leading eigenvector of a covariance matrix, with a certificate.

A clip's covariance is solved once and exactly. A live window's changes a little from hop to hop, so the last
hop's leading subspace is nearly right already: a step or two of subspace iteration (Golub and Van Loan, Matrix
Computations, section 8.2) brings it up to date at a hundredth of the exact solver's cost. What such a step returns is
trusted only with proof; without it the exact solver answers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Largest ‖Cv − λv‖ / λ with which an eigenvector is handed out.
RESIDUAL_TOLERANCE = 1e-6
#: Eigenvectors iterated together. More converge in fewer steps but make each dearer; four also leave so little
#: variance outside the block that the proof of "leading" nearly always succeeds at once.
BLOCK = 4
#: Subspace steps tried before the exact solver is cheaper.
STEPS = 12


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
    total = float(np.trace(covariance))
    warm = _iterated(covariance, total, start.block) if start is not None and total > 0 else None
    return warm or _solved(covariance, total)


def _solved(covariance: NDArray[np.float64], total: float) -> LeadingAxis:
    size = len(covariance)
    block = min(BLOCK, size)
    values, vectors = eigh(covariance, subset_by_index=(size - block, size - 1), check_finite=False)
    vector, value = np.ascontiguousarray(vectors[:, -1]), max(float(values[-1]), 0.0)
    residual = float(np.linalg.norm(covariance @ vector - value * vector)) / value if value > 0 else 0.0
    runner_up = max(float(values[-2]), 0.0) if block > 1 else 0.0
    return LeadingAxis(vector, value, runner_up, total, residual, exact=True, block=vectors[:, ::-1])


def _iterated(covariance: NDArray[np.float64], total: float, block: NDArray[np.float64]) -> LeadingAxis | None:
    """Iterate from the last block; None when no step brought the proof."""
    for _ in range(STEPS):
        image = covariance @ block
        values, turn = np.linalg.eigh(block.T @ image)
        block, image, values = block @ turn[:, ::-1], image @ turn[:, ::-1], values[::-1]
        value = float(values[0])
        if value <= 0:
            return None
        residual = float(np.linalg.norm(image[:, 0] - value * block[:, 0])) / value
        if residual <= RESIDUAL_TOLERANCE:
            # A small residual proves an eigenvector, not the leading one: after a sudden change the old axis may
            # still be exact. Beside it the matrix is [[A, Xᵀ], [X, D]] with A the rest of the block, whose largest
            # eigenvalue is the runner-up's, and D what lies outside, with no more than what is left of the trace.
            # All its eigenvalues are below λ if (λ − runner-up)(λ − rest) > ‖X‖².
            runner_up = max(float(values[1]), 0.0) if len(values) > 1 else 0.0
            rest = max(total - float(values.sum()), 0.0)
            coupling = float(np.linalg.norm(image[:, 1:] - block[:, 1:] * values[1:]))
            if rest >= value or (value - runner_up) * (value - rest) <= coupling**2:
                return None
            # The largest eigenvalue that [[runner-up, ‖X‖], [‖X‖, rest]] allows for: no gap is ever overstated by it.
            middle, half = (runner_up + rest) / 2, (runner_up - rest) / 2
            runner_up = middle + float(np.hypot(half, coupling))
            vector = np.ascontiguousarray(block[:, 0])
            return LeadingAxis(vector, value, runner_up, total, residual, exact=False, block=block)
        block, _ = np.linalg.qr(image)
    return None
