"""Leading eigenvectors of symmetric matrices."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

from kinespace.library.kernels import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

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


def eigenpairs(matrices: NDArray[np.float64], most: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the leading eigenvalues of small symmetric matrices and their eigenvectors, the largest first.

    Parameters
    ----------
    matrices
        Shape (matrices, size, size).
    most
        How many to find of each matrix, four at most.

    Returns
    -------
    The values (matrices, found), and the vectors (matrices, found, size), unit length.
    """
    count, size, _ = matrices.shape
    found, loops = min(most, size), compiled.loops
    values, vectors = np.empty((count, found)), np.empty((count, found, size))
    if loops and size <= loops.MAX_DIRECTIONS and loops.eigenpairs(matrices, values, vectors):
        return values, vectors
    from scipy.linalg.lapack import dsyevr  # noqa: PLC0415 - slow to load, and the compiled loops do not need it

    for matrix, own_values, own_vectors in zip(matrices, values, vectors, strict=True):
        few, columns, *_ = dsyevr(matrix, range="I", il=size - found + 1, iu=size, lower=1)
        own_values[:], own_vectors[:] = few[found - 1 :: -1], columns.T[::-1]
    return values, vectors
