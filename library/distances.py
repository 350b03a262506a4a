"""From joint positions to distance rows, the numbers by which motions are compared."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.kernels import bind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.library.kernels.plain import Call
    from kinespace.library.skeleton import Skeleton


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
    rows = np.empty((*positions.shape[:-2], len(skeleton.pairs)))
    frames = np.ascontiguousarray(positions, dtype=np.float64).reshape(-1, joints, 3)
    measure_into(frames, skeleton, rows.reshape(-1, len(skeleton.pairs)))(len(frames))
    return rows


def measure_into(positions: NDArray[np.float64], skeleton: Skeleton, rows: NDArray[np.float64]) -> Call:
    """Give a function that measures the first of some frames, as `distance_rows` does; it takes their number.

    Parameters
    ----------
    positions
        Where the frames lie at each call, shape (frames, joints, 3), metres.
    skeleton
        The skeleton whose pairs are measured.
    rows
        Where the function writes the distances, shape (frames, pairs), metres.
    """
    return bind("distances", positions, np.ascontiguousarray(skeleton.pairs), rows)
