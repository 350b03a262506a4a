"""Rotations about several axes, for many frames at once."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

#: Frames whose matrices are held at once.
BLOCK = 4096


def turns(order: str, angles: Sequence[NDArray[np.float64]], frames: int = 1) -> NDArray[np.float64]:
    """Give rotation matrices (frames, 3, 3) for the angles (frames,) about each axis in radians.

    The axes of `order` are those of the room, like "xyz", or in capitals those that turn with the body.
    """
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to load

    if not order:
        return np.broadcast_to(np.eye(3), (frames, 3, 3))
    matrices: NDArray[np.float64] = Rotation.from_euler(order, np.stack(angles, axis=-1)).as_matrix()
    return matrices
