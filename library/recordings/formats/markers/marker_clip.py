"""Markers or joint centres over time, as in C3D and TRC, made into a clip."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.clip import Clip
from kinespace.library.naming import hdm05
from kinespace.library.recordings.formats.gap_filling import with_missing_joints
from kinespace.library.recordings.formats.joint_choice import chosen, short_names
from kinespace.library.skeleton import Skeleton

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray


def clip_of_markers(
    path: Path, labels: Sequence[str], positions: NDArray[np.float64], frame_rate: float, joints: Sequence[str]
) -> Clip:
    """Make a clip of the markers that are wanted.

    A marker that is at exactly 0, 0, 0 in some frames and elsewhere in others is missing in the frames with zeros: some
    programs write missing markers so. Missing markers are put on straight lines (`library.formats.gap_filling`).

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
