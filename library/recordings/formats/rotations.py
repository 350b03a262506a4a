"""Rotations about several axes, and joints placed by them, for many frames at once."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

#: Frames whose matrices are held at once.
_BLOCK = 4096


def turns(order: str, angles: Sequence[NDArray[np.float64]], frames: int = 1) -> NDArray[np.float64]:
    """Give rotation matrices (frames, 3, 3) for the angles (frames,) about each axis in radians.

    The axes of `order` are those of the room, like "xyz", or in capitals those that turn with the body.
    """
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to load

    if not order:
        return np.broadcast_to(np.eye(3), (frames, 3, 3))
    matrices: NDArray[np.float64] = Rotation.from_euler(order, np.stack(angles, axis=-1)).as_matrix()
    return matrices


def placed(
    parents: Sequence[int],
    frames: int,
    bones: Callable[[slice], Iterable[tuple[NDArray[np.float64], NDArray[np.float64]]]],
) -> NDArray[np.float64]:
    """Place the joints of a hierarchy: p = p_parent + M_parent · offset, and M = M_parent · R.

    Parameters
    ----------
    parents
        The index of each joint's parent, below its own; -1 for a root, which stands at its offset.
    frames
        The number of frames.
    bones
        Gives for some of the frames each joint's offset, (frames, 3), and its rotation R, (frames, 3, 3).

    Returns
    -------
    Positions, shape (frames, joints, 3), in the unit of the offsets.
    """
    positions = np.empty((frames, len(parents), 3))
    for start in range(0, frames, _BLOCK):
        block, turned = slice(start, start + _BLOCK), list[NDArray[np.float64]]()
        for joint, (parent, (offset, turn)) in enumerate(zip(parents, bones(block), strict=True)):
            if parent < 0:
                positions[block, joint] = offset
                turned.append(turn)
            else:
                positions[block, joint] = positions[block, parent] + (turned[parent] @ offset[:, :, None])[:, :, 0]
                turned.append(turned[parent] @ turn)
    return positions
