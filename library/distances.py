"""From joint positions to distance rows, the numbers by which motions are compared."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library.kernels import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.library.skeleton import Skeleton


#: Frames of a long recording that are measured at once: more would not fit into the processor's cache.
_BLOCK = 16


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
    frames, each = positions.reshape(-1, joints, 3), rows.reshape(-1, len(skeleton.pairs))
    measurer = DistanceMeasurer(skeleton, min(len(frames), _BLOCK))
    for begin in range(0, len(frames), _BLOCK):
        some = slice(begin, begin + _BLOCK)
        measurer.measure(frames[some], each[some])
    return rows


class DistanceMeasurer:
    """Measures some frames at a time, as `distance_rows` does, and reuses its memory.

    Parameters
    ----------
    skeleton
        The skeleton whose pairs are measured.
    most
        Frames at a time, at most.
    """

    def __init__(self, skeleton: Skeleton, most: int) -> None:
        self._skeleton = skeleton
        self._pairs = np.ascontiguousarray(skeleton.pairs)
        self._numbers = np.empty(3 * most * (len(skeleton.joints) + 2 * len(skeleton.pairs)))
        self._by_frames: dict[int, _Memory] = {}

    def measure(self, positions: NDArray[np.floating], rows: NDArray[np.float64]) -> None:
        """Measure frames.

        Parameters
        ----------
        positions
            Shape (frames, joints, 3), metres; at most `most` frames.
        rows
            Where to write the distances: contiguous, shape (frames, pairs), metres.
        """
        loops = compiled.loops
        if loops and len(self._skeleton.joints) <= loops.MAX_JOINTS:
            loops.measure_distances(np.ascontiguousarray(positions, dtype=np.float64), self._pairs, rows)
            return
        frames, joints, _ = positions.shape
        # Two or four frames lie side by side, number by number, so that picking out a pair's joints copies 16 or 32
        # bytes at once, for which numpy has a fast path.
        together = math.gcd(frames, 4)
        coordinates, difference, second = self._by_frames.get(frames) or self._memory(frames, together)
        coordinates[...] = positions.reshape(frames // together, together, joints, 3).transpose(3, 0, 2, 1)
        pairs = self._skeleton.pairs
        # One coordinate at a time, because a strided (pairs, 3) difference is slower. No index is out of range; numpy
        # writes straight into `out` only when the mode says so.
        coordinates.take(pairs[:, 0], axis=2, out=difference, mode="clip")
        coordinates.take(pairs[:, 1], axis=2, out=second, mode="clip")
        difference -= second
        difference *= difference
        squared = difference[0]
        squared += difference[1]
        squared += difference[2]
        np.sqrt(squared, out=squared)
        rows.reshape(frames // together, together, len(pairs))[...] = squared.transpose(0, 2, 1)

    def _memory(self, frames: int, together: int) -> _Memory:
        """Lay out the memory for a number of frames."""
        joints, pairs = len(self._skeleton.joints), len(self._skeleton.pairs)
        shape, begin, half = (3, frames // together, -1, together), 3 * frames * joints, 3 * frames * pairs
        memory = _Memory(
            self._numbers[:begin].reshape(shape),
            self._numbers[begin : begin + half].reshape(shape),
            self._numbers[begin + half : begin + 2 * half].reshape(shape),
        )
        self._by_frames[frames] = memory
        return memory


class _Memory(NamedTuple):
    """Joints' coordinates and pairs' differences, shape (3, groups of frames, joints or pairs, frames of a group)."""

    coordinates: NDArray[np.float64]
    difference: NDArray[np.float64]
    second: NDArray[np.float64]
