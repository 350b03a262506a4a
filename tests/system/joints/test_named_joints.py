"""The joints that a convention names lie where HDM05's do, on real bodies: a joint that a sensor lacks has no name."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.library import Reading
from kinespace.library.naming import Naming
from kinespace.library.naming.convention import convention_named
from kinespace.library.windows.segments import Segments
from kinespace.tools.evaluation.takes import Sources, read_takes

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from kinespace.library.motion_library import MotionLibrary

pytestmark = pytest.mark.slow

#: Some takes of several persons, for each convention of which there are recordings.
RECORDED = {
    "plugingait": "uiprmd/takes/s0*_m01*.npz",
    "kinect1": "kindergator/takes/*_0[1-4].npz",
    "mediapipe": "camera/*_squat_1.npz",
}
#: Metres, on a body of HDM05's size, by which a joint's distance from the joint above it may differ. Marker sets and
#: sensors differ by up to 12 cm: hip markers lie above the joint, a camera's thumb is near the wrist.
WITHIN = 0.15


@pytest.mark.parametrize("convention", RECORDED)
def test_joints_lie_where_hdm05s_do(convention: str, data_folder: Path, builtin: MotionLibrary) -> None:
    """Each named joint is about as far from the one above as HDM05's, once bodies have one size."""
    differences = _differences(data_folder, convention, Naming(convention_named(convention)), builtin)
    assert {joint: by for joint, by in differences.items() if by > WITHIN} == {}


def test_kinect_1_has_no_upper_back(data_folder: Path, builtin: MotionLibrary) -> None:
    """Its spine lies just above the hips: called the upper back it would lie far from HDM05's."""
    kinect = convention_named("kinect1")
    wrong = replace(kinect, targets={**kinect.targets, "spine": "upperback"})
    assert _differences(data_folder, "kinect1", Naming(wrong), builtin)["upperback"] > WITHIN


def _differences(data: Path, convention: str, naming: Naming, builtin: MotionLibrary) -> Mapping[str, float]:
    """Say by how many metres each joint's distance from the one above differs from HDM05's, at HDM05's size."""
    takes = read_takes(Sources(unknown=sorted(data.glob(RECORDED[convention]))), Reading(naming=naming))
    joints = [name for name in builtin.skeleton.joints if name in takes[0].clip.skeleton.joints]
    own = builtin.restricted_to(joints)
    body, lengths = Segments.of(own), list[np.ndarray]()
    for take in takes:
        found = np.median(body.lengths(take.clip.restricted_to(joints).as_of(own.skeleton).positions), axis=0)
        lengths.append(found * body.mean.sum() / found.sum())
    by = np.abs(np.median(lengths, axis=0) - body.mean)
    return {own.skeleton.joints[child]: round(float(each), 3) for child, each in zip(body.children, by, strict=True)}
