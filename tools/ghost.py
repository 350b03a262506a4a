"""A stored motion made visible again: distance rows from a signature, joint positions from distance rows.

A library keeps no recording, but a mean row and the axis along which the distances swing. Swinging along it gives rows
that have this motion's signature again, and classical multidimensional scaling (Torgerson 1952) gives joint positions
with these distances, as nearly as three dimensions hold them. It moves like the motion and looks like nobody.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from library import MotionLibrary
    from library.skeleton import Skeleton


def representative(library: MotionLibrary, class_name: str) -> int:
    """Find the motion most like all others of its class: the index of the class's medoid.

    Raises
    ------
    ValueError
        The library has no such class.
    """
    members = [index for index, motion in enumerate(library.motions) if motion.class_name == class_name]
    if not members:
        raise ValueError(f"class_name: expected one of {', '.join(library.classes)}, got {class_name!r}")
    axes = library.axes[members]
    return members[int(np.abs(axes @ axes.T).sum(axis=1).argmax())]


def swinging_rows(library: MotionLibrary, motion: int, times: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Let the distances swing along the motion's leading eigenvector around their mean.

    Parameters
    ----------
    library, motion
        Which motion of which library, by index.
    times
        Shape (frames,), seconds.
    rate
        Swings per second.

    Returns
    -------
    Distance rows, shape (frames, pairs), metres, with the motion's variance along its axis; never below zero.
    """
    amplitude = np.sqrt(2 * library.motions[motion].eigenvalue)
    swing = amplitude * np.sin(2 * np.pi * rate * times)
    rows: NDArray[np.float64] = np.maximum(library.means[motion] + np.outer(swing, library.axes[motion]), 0.0)
    return rows


def embedded(rows: NDArray[np.float64], skeleton: Skeleton) -> NDArray[np.float64]:
    """Find joint positions with given distances (classical multidimensional scaling).

    Parameters
    ----------
    rows
        Distances, shape (frames, pairs), metres.
    skeleton
        Whose pairs they are; all pairs must be measured.

    Returns
    -------
    Positions, shape (frames, joints, 3), metres, centred. Each frame is turned (or mirrored, which no distance sees)
    to lie as close to the one before as it can, so that the body does not flip from frame to frame.

    Raises
    ------
    ValueError
        The skeleton leaves pairs out.
    """
    joints = len(skeleton.joints)
    if len(skeleton.pairs) != joints * (joints - 1) // 2:
        raise ValueError(f"skeleton: expected all pairs measured, got {len(skeleton.pairs)} for {joints} joints")
    squares = np.zeros((len(rows), joints, joints))
    first, second = skeleton.pairs.T
    squares[:, first, second] = squares[:, second, first] = np.square(rows)
    centring = np.eye(joints) - 1 / joints
    values, vectors = np.linalg.eigh(-0.5 * centring @ squares @ centring)
    positions: NDArray[np.float64] = vectors[:, :, -3:] * np.sqrt(np.maximum(values[:, None, -3:], 0.0))
    for index in range(1, len(positions)):
        left, _, right = np.linalg.svd(positions[index].T @ positions[index - 1])
        positions[index] = positions[index] @ left @ right
    return positions


def ghost(
    library: MotionLibrary, motion: int, *, seconds: float, frame_rate: float, rate: float
) -> NDArray[np.float64]:
    """Play a stored motion: positions, shape (frames, joints, 3), metres."""
    times = np.arange(round(seconds * frame_rate)) / frame_rate
    return embedded(swinging_rows(library, motion, times, rate), library.skeleton)
