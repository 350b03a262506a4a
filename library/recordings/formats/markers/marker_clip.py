"""Markers or joint centres over time, as in C3D and TRC, made into a clip."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.naming import hdm05
from kinespace.library.recordings.formats.joint_choice import chosen, short_names
from kinespace.library.recordings.formats.timed_frames import MAX_GAP
from kinespace.library.skeleton import Skeleton


def clip_of_markers(
    path: Path, labels: Sequence[str], positions: NDArray[np.float64], frame_rate: float, joints: Sequence[str]
) -> Clip:
    """Make a clip of the markers that are wanted.

    A marker that is at exactly 0, 0, 0 in some frames and elsewhere in others is missing in the frames with zeros: some
    programs write missing markers so. Missing markers are put on straight lines.

    Parameters
    ----------
    path
        The clip is named after this file.
    labels
        The markers' names; how markers are connected is not known.
    positions
        Shape (frames, markers, 3), metres, NaN where a marker is missing.
    frame_rate
        Frames per second.
    joints
        Which markers, by name (`library.formats.joint_choice.chosen`); all when none are given.

    Raises
    ------
    ValueError
        A wanted marker is missing, two have the same name, one is missing for too long, or fewer than two are left.
    """
    kept = chosen(labels, joints)
    skeleton = Skeleton(short_names([labels[index] for index in kept]))
    positions = positions[:, kept]
    nowhere = (positions == 0).all(axis=2)
    missing = ~np.isfinite(positions).all(axis=2) | (nowhere & ~nowhere.all(axis=0))
    clip = Clip(
        skeleton=skeleton,
        positions=with_missing_joints(positions, missing, skeleton.joints, frame_rate),
        frame_rate=frame_rate,
        name=path.stem,
        filled=int(missing.sum()),
    )
    return hdm05.titled(clip, path)


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
