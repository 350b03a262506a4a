"""From joint positions to distance rows: the space the whole method works in."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from library.skeleton import Skeleton


#: Frames measured at once of a long recording: more would not stay in the cache.
_BLOCK = 16


def distance_rows(
    positions: NDArray[np.floating], skeleton: Skeleton, *, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Measure every joint pair of one or many frames (Le Naour et al. 2012, section 2, equation 1).

    Parameters
    ----------
    positions
        Joint positions, shape (..., joints, 3), metres.
    skeleton
        Whose pairs are measured.
    out
        Where to write them, if not into memory of their own: contiguous, of their shape. Given back.

    Returns
    -------
    Distances, shape (..., pairs), metres, in the order of `skeleton.pairs`. The same numbers come out wherever
    the body stands and whichever way it faces, and one frame gives bit for bit what it gives among many.

    Raises
    ------
    ValueError
        The last two axes are not (joints, 3), or what to write into is not contiguous or of another shape.
    """
    joints = len(skeleton.joints)
    if positions.shape[-2:] != (joints, 3):
        raise ValueError(f"positions: expected (..., {joints}, 3), got {positions.shape}")
    shape = (*positions.shape[:-2], len(skeleton.pairs))
    if out is not None and (out.shape != shape or not out.flags.c_contiguous):
        raise ValueError(f"out: expected a contiguous array of shape {shape}, got shape {out.shape}")
    rows = np.empty(shape) if out is None else out
    if positions.ndim == 3 and len(positions) <= _BLOCK:
        _measure(positions, skeleton.pairs, rows)
        return rows
    frames, each = positions.reshape(-1, joints, 3), rows.reshape(-1, len(skeleton.pairs))
    for begin in range(0, len(frames), _BLOCK):
        some = slice(begin, begin + _BLOCK)
        _measure(frames[some], skeleton.pairs, each[some])
    return rows


def _measure(positions: NDArray[np.floating], pairs: NDArray[np.intp], rows: NDArray[np.float64]) -> None:
    """Write into rows what is measured of some frames, shape (frames, joints, 3).

    Two or four frames lie side by side, number by number: to pick out a pair's joints is then to copy 16 or 32 bytes
    at once, for which numpy has a quick way. One coordinate at a time, because a strided (pairs, 3) difference costs
    twice as much.
    """
    frames, joints, _ = positions.shape
    together = math.gcd(frames, 4)
    grouped = positions.reshape(frames // together, together, joints, 3)
    coordinates = np.empty((3, frames // together, joints, together))
    coordinates[...] = grouped.transpose(3, 0, 2, 1)
    difference = coordinates.take(pairs[:, 0], axis=2)
    difference -= coordinates.take(pairs[:, 1], axis=2)
    difference *= difference
    squared = difference[0]
    squared += difference[1]
    squared += difference[2]
    np.sqrt(squared, out=squared)
    rows.reshape(frames // together, together, len(pairs))[...] = squared.transpose(0, 2, 1)
