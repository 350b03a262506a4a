"""Missing frames, and single missing joints, put on straight lines between the frames that a recording has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

#: Seconds a marker may be out of sight. Over a longer time a straight line would be an invented movement.
MAX_GAP = 0.5


def with_missing_frames(frame_numbers: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put straight lines where frame numbers are missing, so that a frame's index tells its time; (frames, n)."""
    wanted = np.arange(frame_numbers[0], frame_numbers[-1] + 1)
    if len(wanted) == len(frame_numbers):
        return values
    return np.stack([np.interp(wanted, frame_numbers, column) for column in values.T], axis=1)


def with_missing_joints(
    positions: NDArray[np.float64], missing: NDArray[np.bool_], joints: Sequence[str], frame_rate: float
) -> NDArray[np.float64]:
    """Put straight lines where single joints are missing; before its first and after its last position a joint rests.

    Parameters
    ----------
    positions
        Shape (frames, joints, 3); numbers at missing joints are ignored.
    missing
        Where joints are missing, shape (frames, joints).
    joints
        Their names.
    frame_rate
        Frames per second.

    Raises
    ------
    ValueError
        A joint is missing for longer than `MAX_GAP`; the message says which, when and how long.
    """
    if not missing.any():
        return positions
    for joint, name in enumerate(joints):
        first, length = _longest_run(missing[:, joint])
        if length > MAX_GAP * frame_rate or length == len(missing):
            raise ValueError(
                f"{name!r} is missing for {length / frame_rate:.2f} s from frame {first + 1} of {len(missing)} on, "
                f"longer than {MAX_GAP} s: cut the recording, or choose other joints"
            )
    filled = positions.copy()
    frames = np.arange(len(positions))
    for joint in np.flatnonzero(missing.any(axis=0)).tolist():
        gone = missing[:, joint]
        for axis in range(3):
            filled[gone, joint, axis] = np.interp(frames[gone], frames[~gone], positions[~gone, joint, axis])
    return filled


def _longest_run(flags: NDArray[np.bool_]) -> tuple[int, int]:
    """Find the longest run of true flags: its beginning and its length."""
    edges = np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    if not begins.size:
        return 0, 0
    longest = int(np.argmax(ends - begins))
    return int(begins[longest]), int(ends[longest] - begins[longest])
