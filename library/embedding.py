"""Distance rows -> joint positions: classical multidimensional scaling (Torgerson 1952)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from library.skeleton import Skeleton


def embedded(rows: NDArray[np.float64], skeleton: Skeleton) -> NDArray[np.float64]:
    """Find joint positions with given distances.

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
