"""Leading eigenvectors: of a motion's distances, which is the paper's signature, and of any symmetric matrix."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

_Number = TypeVar("_Number", np.float32, np.float64)


def signature_of(rows: NDArray[np.float64], *, centred: bool = True) -> NDArray[np.float64]:
    """Find the leading eigenvector of the rows' covariance (Le Naour et al. 2012, section 3).

    The paper says PCA, which centres the rows, and "the first eigen vector extracted through a singular value
    decomposition applied to" the rows, which does not: then it is the first right singular vector of the rows as they
    are, and says mostly how the body stands.

    Parameters
    ----------
    rows
        Distance rows of a motion, shape (frames, pairs), at least two frames; other numbers of each frame work as well.
    centred
        Whether the rows' mean is taken off first.

    Returns
    -------
    Unit vector, shape (pairs,). Its sign is arbitrary; `similarity` ignores signs. Where nothing moves, any unit
    vector.

    Raises
    ------
    ValueError
        The rows are not a matrix of at least two frames.
    """
    if rows.ndim != 2 or len(rows) < 2:
        raise ValueError(f"rows: expected (frames, pairs) with at least two frames, got {rows.shape}")
    about = rows - rows.mean(axis=0) if centred else rows
    frames, pairs = about.shape
    if pairs <= frames:
        return leading_eigenvectors(about.T @ about, 1)[1][:, 0]
    # X = UΣVᵀ: the leading row of Vᵀ is uᵀX up to its length. u is the leading eigenvector of X Xᵀ, the smaller matrix.
    axis: NDArray[np.float64] = leading_eigenvectors(about @ about.T, 1)[1][:, 0] @ about
    length = float(np.linalg.norm(axis))
    return axis / length if length > 0 else np.full(pairs, pairs**-0.5)


def similarity(axes: NDArray[np.floating], axis: NDArray[np.floating]) -> NDArray[np.floating]:
    """Compare unit eigenvectors by the inner product (Le Naour et al. 2012, section 3), as its absolute value.

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
