"""Oddities of a body: honest recordings have none, and each fault gets its remark."""

from dataclasses import replace

import numpy as np
import pytest

from kinespace.library import Clip, MotionLibrary
from kinespace.library.windows.segments import FLAT, is_flat, remarks
from kinespace.tools.feeding.feed import resampled

MOTIONS = MotionLibrary.builtin().motions


def test_few_joints_are_said() -> None:
    """Two joints of known names make no body."""
    few = MOTIONS[0].restricted_to(MOTIONS[0].skeleton.joints[:2])
    assert "joints: 2, expected 5 at least" in remarks(few)


def _kinds(clip: Clip) -> list[str]:
    return [each.partition(":")[0] for each in remarks(clip)]


def test_the_built_in_motions_have_no_oddity() -> None:
    """Every tenth motion is a body of usual size, depth and rate, with known names."""
    assert [_kinds(motion) for motion in MOTIONS[::10]] == [[]] * len(MOTIONS[::10])


def test_each_fault_has_its_remark() -> None:
    """Angles, a flat body, other names, another unit and a slow recording are said, and nothing else."""
    clip, draw = MOTIONS[0], np.random.default_rng(1)
    joints = clip.skeleton.joints
    names = replace(clip.skeleton, joints=tuple(f"bone_{place}" for place in range(len(joints))))
    faults = {
        "joints": clip.moved_to(draw.uniform(-1, 1, clip.positions.shape)),
        "flat": clip.moved_to(clip.positions * (1.0, 1.0, 0.0)),
        "names not known": replace(clip, skeleton=names),
        "size": clip.moved_to(clip.positions / 100),
        "frame rate": resampled(clip, 8.0),
    }
    assert {kind: _kinds(fault) for kind, fault in faults.items()} == {kind: [kind] for kind in faults}
    assert "bone_0, bone_1, bone_2, bone_3, bone_4, bone_5, bone_6, bone_7 ...; no table knows them" in next(
        remarks(faults["names not known"])
    )


@pytest.mark.parametrize("axis", range(3))
def test_a_plane_may_stand_anywhere(axis: int) -> None:
    """Flat is flat in any direction and anywhere; one frame with depth is enough for a body."""
    flat = MOTIONS[0].positions.copy()
    flat[..., axis] = 0.5
    turned = flat @ np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0] + 3.0
    assert is_flat(flat)
    assert is_flat(turned)
    turned[0] = MOTIONS[0].positions[0]
    assert not is_flat(turned)
    assert "2-D" in FLAT
