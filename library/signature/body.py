"""The body behind the distances: its size, and the lengths of its segments, to which a posture is relative."""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from kinespace.library.skeleton import Skeleton


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Reads the body's size off a distance row, and the length of the segments between two joints.

    Attributes
    ----------
    sizing
        A distance row times these weights is the body's size, metres: the mean length of its segments. A skeleton
        without known parents has no segments, so the mean of all its distances is used. Shape (pairs,).
    segments
        Index of each segment among the pairs, shape (segments,); none without known parents.
    between
        The segments between the two joints of each pair, as flags, shape (segments, pairs), 0 or 1.
    """

    sizing: NDArray[np.float64] = field(repr=False)
    segments: NDArray[np.intp] = field(repr=False)
    between: NDArray[np.float64] = field(repr=False)

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, skeleton: Skeleton) -> "Body":
        """Find segments and paths by a skeleton's parents; equal skeletons share one body.

        Raises
        ------
        ValueError
            The parents do not make one tree.
        """
        pairs = len(skeleton.pairs)
        if not skeleton.parents:
            none = np.empty(0, dtype=np.intp)
            return cls(np.full(pairs, 1 / pairs), none, np.empty((0, pairs)))
        places = {(int(a), int(b)): index for index, (a, b) in enumerate(skeleton.pairs)}
        children = [joint for joint, parent in enumerate(skeleton.parents) if parent >= 0]
        segments = [places[min(j, skeleton.parents[j]), max(j, skeleton.parents[j])] for j in children]
        above = _segments_above(skeleton.parents, children)
        first, second = skeleton.pairs.T
        sizing = np.bincount(segments, minlength=pairs) / len(segments)
        between = (above[first] ^ above[second]).T.astype(np.float64, order="C")
        return cls(sizing, np.array(segments, dtype=np.intp), between)

    def size(self, rows: NDArray[np.floating]) -> NDArray[np.float64]:
        """Mean length of the segments in distance rows (..., pairs), metres: shape (...)."""
        size: NDArray[np.float64] = rows @ self.sizing
        return size

    def lengths(self, rows: NDArray[np.floating]) -> NDArray[np.float64]:
        """Length of the segments between the joints of each pair, in rows (..., pairs), metres: shape (..., pairs)."""
        if not len(self.segments):
            return np.broadcast_to(self.size(rows)[..., None], rows.shape)
        lengths: NDArray[np.float64] = rows.take(self.segments, axis=-1) @ self.between
        return lengths


def _segments_above(parents: tuple[int, ...], children: list[int]) -> NDArray[np.bool_]:
    """Find the segments between each joint and the root, as flags, shape (joints, segments)."""
    above = np.zeros((len(parents), len(children)), dtype=bool)
    if len(children) != len(parents) - 1:
        raise ValueError(f"skeleton: expected parents that make one tree, got {parents}")
    place = {joint: index for index, joint in enumerate(children)}
    for joint in range(len(parents)):
        step = joint
        while parents[step] >= 0:
            above[joint, place[step]] = True
            step = parents[step]
    return above
