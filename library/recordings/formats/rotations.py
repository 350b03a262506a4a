"""Rotations about one axis, for many frames at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


#: Frames whose matrices are held at once.
BLOCK = 4096


def turn_about(axis: str, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the rotation matrices about one axis, right-handed, for angles (frames,) in radians: (frames, 3, 3)."""
    fixed = "xyz".index(axis)
    first, second = (fixed + 1) % 3, (fixed + 2) % 3
    matrices = np.zeros((len(angles), 3, 3))
    matrices[:, fixed, fixed] = 1.0
    matrices[:, first, first] = matrices[:, second, second] = np.cos(angles)
    matrices[:, second, first] = np.sin(angles)
    matrices[:, first, second] = -matrices[:, second, first]
    return matrices
