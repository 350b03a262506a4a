"""Leading eigenvectors of symmetric matrices."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np
from scipy.linalg import eigh
from scipy.linalg.lapack import dsyevr

from kinespace.library.kernels import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: One in so many eigenvectors is many.
_MANY = 4

_Number = TypeVar("_Number", np.float32, np.float64)


def leading_eigenvectors(matrix: NDArray[_Number], most: int) -> tuple[NDArray[_Number], NDArray[_Number]]:
    """Find the leading eigenvalues of a symmetric matrix and their eigenvectors, the largest first.

    Parameters
    ----------
    matrix
        Shape (size, size).
    most
        How many to find, at most.

    Returns
    -------
    The values (found,), and the vectors (size, found), unit length.
    """
    size = len(matrix)
    if most < 1:
        return matrix[0, :0], matrix[:, :0]
    first = max(size - most, 0)
    if _MANY * most >= size:
        # Divide and conquer finds them all in less time than it takes to find that many one by one.
        values, vectors = (each[..., first:] for each in eigh(matrix, driver="evd", check_finite=False))
    else:
        values, vectors = eigh(matrix, subset_by_index=(first, size - 1), check_finite=False)
    return values[::-1].astype(matrix.dtype), vectors[:, ::-1].astype(matrix.dtype)


def eigenpairs(matrices: NDArray[np.float64], most: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the leading eigenvalues of small symmetric matrices and their eigenvectors, the largest first.

    Parameters
    ----------
    matrices
        Shape (matrices, size, size).
    most
        How many to find of each, four at most.

    Returns
    -------
    The values (matrices, found), and the vectors (matrices, found, size), unit length.
    """
    count, size, _ = matrices.shape
    found, loops = min(most, size), compiled.loops
    values, vectors = np.empty((count, found)), np.empty((count, found, size))
    if loops and size <= loops.MOST_DIRECTIONS and loops.eigenpairs(matrices, values, vectors):
        return values, vectors
    for matrix, own_values, own_vectors in zip(matrices, values, vectors, strict=True):
        few, columns, *_ = dsyevr(matrix, range="I", il=size - found + 1, iu=size)
        own_values[:], own_vectors[:] = few[found - 1 :: -1], columns.T[::-1]
    return values, vectors
