"""From joint positions to distance rows: the space the whole method works in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from library.skeleton import Skeleton


def distance_rows(positions: NDArray[np.floating], skeleton: Skeleton) -> NDArray[np.float64]:
    """Measure every joint pair of one or many frames (Le Naour et al. 2012, section 2, equation 1).

    Parameters
    ----------
    positions
        Joint positions, shape (..., joints, 3), metres.
    skeleton
        Whose pairs are measured.

    Returns
    -------
    Distances, shape (..., pairs), metres, in the order of `skeleton.pairs`. The same numbers come out wherever
    the body stands and whichever way it faces, and one frame gives bit for bit what it gives among many.

    Raises
    ------
    ValueError
        The last two axes are not (joints, 3).
    """
    joints = len(skeleton.joints)
    if positions.shape[-2:] != (joints, 3):
        raise ValueError(f"positions: expected (..., {joints}, 3), got {positions.shape}")
    # One coordinate at a time: a strided (pairs, 3) difference costs twice as much and reads no better. Written out
    # because numpy's moveaxis takes longer than all the rest of one frame.
    coordinates = np.empty((3, *positions.shape[:-1]))
    coordinates[...] = positions.transpose(-1, *range(positions.ndim - 1))
    first, second = skeleton.pairs[:, 0], skeleton.pairs[:, 1]
    difference = coordinates.take(first, axis=-1)
    difference -= coordinates.take(second, axis=-1)
    difference *= difference
    squared: NDArray[np.float64] = difference[0]
    squared += difference[1]
    squared += difference[2]
    np.sqrt(squared, out=squared)
    return squared
