"""A show's feed: recordings put on one performer's own bones, and joined to one walk without jumps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

#: Seconds in which one posture becomes the next.
JOINED = 0.4


def lengths_of(positions: NDArray[np.floating], parents: Sequence[int]) -> NDArray[np.float64]:
    """Measure a body's segments: the mean distance of each joint from its parent, metres, 0 for the root.

    Parameters
    ----------
    positions
        Shape (frames, joints, 3), metres.
    parents
        The parent of each joint, -1 for the root.
    """
    bones = positions - positions[:, parents]
    bones[:, [parent < 0 for parent in parents]] = 0.0
    lengths: NDArray[np.float64] = np.linalg.norm(bones, axis=2).mean(axis=0)
    return lengths


def on_bones(
    positions: NDArray[np.floating], parents: Sequence[int], lengths: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Put a movement on another body: each segment keeps its direction and gets the body's length.

    The root's way is as much longer as the segments are together.

    Parameters
    ----------
    positions
        Shape (frames, joints, 3), metres.
    parents, lengths
        As in `lengths_of`.
    """
    laid: NDArray[np.float64] = positions * (lengths.sum() / lengths_of(positions, parents).sum())
    left = [joint for joint, parent in enumerate(parents) if parent >= 0]
    while left:
        # A parent is laid before its children, in whatever order the joints come.
        joint = next(each for each in left if parents[each] not in left)
        left.remove(joint)
        bone = positions[:, joint] - positions[:, parents[joint]]
        away = np.maximum(np.linalg.norm(bone, axis=1, keepdims=True), 1e-9)
        laid[:, joint] = laid[:, parents[joint]] + lengths[joint] * bone / away
    return laid


def facing(before: NDArray[np.floating], positions: NDArray[np.floating], root: int) -> NDArray[np.float64]:
    """Turn and move a piece about the vertical axis, y, so that it begins where a posture stands, facing as it does.

    Parameters
    ----------
    before
        The posture, shape (joints, 3), metres.
    positions
        The piece, shape (frames, joints, 3), metres.
    root
        The joint that stays where it is; its height is the piece's own.
    """
    (ax, _, az), (bx, _, bz) = (before - before[root]).T, (positions[0] - positions[0, root]).T
    angle = np.arctan2((ax * bz - az * bx).sum(), (ax * bx + az * bz).sum())
    cos, sin = np.cos(angle), np.sin(angle)
    turned = (positions - positions[0, root]) @ np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]])
    moved: NDArray[np.float64] = turned + np.array([before[root, 0], positions[0, root, 1], before[root, 2]])
    return moved


def joined(pieces: Sequence[NDArray[np.floating]], root: int, rate: float) -> tuple[NDArray[np.float64], list[int]]:
    """Join pieces to one walk; between two of them one posture becomes the next, slowly first and last.

    Parameters
    ----------
    pieces
        Each of shape (frames, joints, 3), metres.
    root
        As in `facing`.
    rate
        Frames per second.

    Returns
    -------
    The walk, shape (frames, joints, 3), metres, and the frame at which each piece begins.
    """
    between = round(JOINED * rate)
    share = (np.arange(1, between + 1) / (between + 1))[:, None, None]
    share = share * share * (3 - 2 * share)
    walk, begins, frames = [np.asarray(pieces[0], dtype=np.float64)], [0], len(pieces[0])
    for piece in pieces[1:]:
        last = walk[-1][-1]
        placed = facing(last, piece, root)
        walk += [last + share * (placed[0] - last), placed]
        begins.append(frames + between)
        frames += between + len(piece)
    return np.concatenate(walk), begins
