"""From joint positions to distance rows, the numbers by which motions are compared."""

import numpy as np
from numpy.typing import NDArray

from kinespace.library.skeleton import Skeleton

#: Frames whose distances are measured at once: more would not fit into the processor's cache.
_FRAMES = 16


def distance_rows(positions: NDArray[np.floating], skeleton: Skeleton) -> NDArray[np.float64]:
    """Measure every joint pair of one or many frames (Le Naour et al. 2012, section 2, equation 1).

    Parameters
    ----------
    positions
        Joint positions, shape (..., joints, 3), metres.
    skeleton
        The skeleton whose pairs are measured.

    Returns
    -------
    Distances, shape (..., pairs), metres, in the order of `skeleton.pairs`. They do not change with the body's place
    and heading, and one frame gives bit for bit the same numbers alone and among many.

    Raises
    ------
    ValueError
        The last two axes are not (joints, 3).
    """
    joints = len(skeleton.joints)
    if positions.shape[-2:] != (joints, 3):
        raise ValueError(f"positions: expected (..., {joints}, 3), got {positions.shape}")
    frames = np.ascontiguousarray(positions, dtype=np.float64).reshape(-1, joints, 3)
    return pair_distances(frames, skeleton.pairs.T).reshape(*positions.shape[:-2], len(skeleton.pairs))


def pair_distances(positions: NDArray[np.float64], ends: NDArray[np.intp]) -> NDArray[np.float64]:
    """Measure between the ends (2, pairs) of pairs of joints, in frames (frames, joints, 3): shape (frames, pairs)."""
    rows, (first, second) = np.empty((len(positions), ends.shape[1])), ends
    for begin in range(0, len(positions), _FRAMES):
        # Joint by joint, because whole axes are copied at once: (3, frames, joints).
        axes = np.ascontiguousarray(positions[begin : begin + _FRAMES].transpose(2, 0, 1))
        apart = axes.take(first, axis=2)
        apart -= axes.take(second, axis=2)
        apart *= apart
        squares, y, z = apart
        squares += y
        squares += z
        np.sqrt(squares, out=rows[begin : begin + _FRAMES])
    return rows
