"""Rotations about one axis, for many frames at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Frames whose matrices are held at once.
BLOCK = 4096


def turn_about(axis: str, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the rotation matrices about one axis, right-handed, for angles (frames,) in radians: (frames, 3, 3)."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to load

    matrices: NDArray[np.float64] = Rotation.from_euler(axis, angles[:, None]).as_matrix()
    return matrices
