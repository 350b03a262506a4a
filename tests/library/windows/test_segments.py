"""Oddities of a body: honest recordings have none, and each fault gets its remark."""

from dataclasses import replace

import numpy as np
import pytest
from naive_courses import build_and_stretch, unlike

from kinespace.library import Clip, MotionLibrary, Skeleton, WindowIndex
from kinespace.library.recordings.remarks import remarks
from kinespace.library.windows import segments as bodies
from kinespace.library.windows.segments import DISORDER, FLAT, Segments, mirrored
from kinespace.tools.feeding.feed import resampled


def test_a_library_of_stretched_bodies_is_in_order(sticks: MotionLibrary) -> None:
    """Segments count as too long only when they are longer than any in the library; without parents none do."""
    body = Segments.of(sticks)
    largest = max(bodies.shares_of_size(each.positions[::4], body.segments).max() for each in sticks.motions)
    assert body.disorder == pytest.approx(max(DISORDER, bodies.BEYOND_LIBRARY * largest))
    bare = Skeleton(sticks.skeleton.joints)
    none = Segments.of(MotionLibrary(bare, tuple(each.as_of(bare) for each in sticks.motions)))
    assert (len(none.children), none.disorder) == (0, DISORDER)
    assert none.unlike(np.zeros(0), 0.0) == 0.0
    assert bodies.shares_of_size(np.zeros((1, 6, 3)), body.segments).tolist() == [0.0]


def test_a_body_is_compared_as_the_slow_twin_does(small_index: WindowIndex) -> None:
    """The nearest person counts, size does not, and only stretch beyond that person's adds to the difference."""
    body, library = small_index.segments, small_index.library
    parents = library.skeleton.parents
    own = {actor: [m for m in library.motions if m.actor == actor] for actor in library.actors}
    measured = [[build_and_stretch(each.positions[::4].tolist(), parents) for each in some] for some in own.values()]
    builds = [np.mean([build for build, _ in each], axis=0) for each in measured]
    stretches = [np.mean([stretch for _, stretch in each]) for each in measured]
    assert body.builds == pytest.approx(np.array(builds))
    assert body.stretches == pytest.approx(stretches, abs=1e-12)
    generator = np.random.default_rng(7)
    for stretch in (0.0, 0.1):
        build = builds[0] + 0.2 * generator.standard_normal(len(builds[0]))
        expected = min(
            unlike(build.tolist(), each.tolist()) + max(stretch - own, 0.0)
            for each, own in zip(builds, stretches, strict=True)
        )
        assert body.unlike(build, stretch) == pytest.approx(expected)
        assert body.unlike(build + np.log(1.5), stretch) == pytest.approx(expected)
    assert body.unlike(builds[1], 0.0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("joints", "others"),
    [
        (("root", "lowerback", "lwrist", "rwrist"), (0, 1, 3, 2)),
        (("Hips", "LeftHand", "RightHand"), (0, 2, 1)),
        (("hand.L", "hand.R", "knee_r", "knee_l"), (1, 0, 3, 2)),
        (("LEFT knee", "RIGHT knee", "leftover"), (1, 0, 2)),
        (("Bip01 L Foot", "Bip01 R Foot", "lowerArm_left", "lowerArm_right"), (1, 0, 3, 2)),
        (("root", "a", "b"), None),
        (("lr", "rl", "handl", "handr"), None),
    ],
)
def test_names_tell_the_other_side(joints: tuple[str, ...], others: tuple[int, ...] | None) -> None:
    """The joint on the other side has the same name but for the side; markers without sides have none."""
    found = bodies.mirrored_places(joints)
    assert (found is None) == (others is None)
    assert found is None or tuple(found.tolist()) == others


def test_a_motion_of_the_other_side(builtin: MotionLibrary) -> None:
    """Joint by joint: the left one is where the right one was, with x negated; twice mirrored it is itself."""
    motion = next(each for each in builtin.motions if each.class_name == "kickLFront1Reps")
    joints, other = motion.skeleton.joints, mirrored(motion)
    for place, name in enumerate(joints):
        turned = {"l": "r", "r": "l"}.get(name[0], "") + name[1:]
        twin = turned if turned in joints else name
        np.testing.assert_array_equal(other.positions[:, place] * [-1, 1, 1], motion.positions[:, joints.index(twin)])
    np.testing.assert_array_equal(mirrored(other).positions, motion.positions)
    assert (other.class_name, other.actor, other.take) == (motion.class_name, motion.actor, f"{motion.take} mirrored")
    with pytest.raises(ValueError, match="either side: expected joints of two sides, got a, b"):
        mirrored(Clip(Skeleton(("a", "b")), np.zeros((2, 2, 3)), 30.0))


MOTIONS = MotionLibrary.builtin().motions


def _kinds(clip: Clip) -> list[str]:
    return [each.partition(":")[0] for each in remarks(clip)]


def test_the_built_in_motions_have_no_oddity() -> None:
    """Every tenth motion is a body of usual size, depth and rate, with known names."""
    assert [_kinds(motion) for motion in MOTIONS[::10]] == [[]] * len(MOTIONS[::10])


def test_each_fault_has_its_remark() -> None:
    """Angles, a flat body, other names, another unit, a picture and a slow recording are said, and nothing else."""
    clip, draw = MOTIONS[0], np.random.default_rng(1)
    joints = clip.skeleton.joints
    names = replace(clip.skeleton, joints=tuple(f"bone_{place}" for place in range(len(joints))))
    faults = {
        "joints": clip.moved_to(draw.uniform(-1, 1, clip.positions.shape)),
        "flat": clip.moved_to(clip.positions * (1.0, 1.0, 0.0)),
        "names not known": replace(clip, skeleton=names),
        "size": clip.moved_to(clip.positions / 100),
        "positions": clip.moved_to((clip.positions - clip.positions.min(axis=(0, 1))) * (0.5, 0.5, 0.4)),
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
    assert bodies.is_flat(flat)
    assert bodies.is_flat(turned)
    turned[0] = MOTIONS[0].positions[0]
    assert not bodies.is_flat(turned)
    # Three joints always lie in a plane.
    assert not bodies.is_flat(flat[:, :3])
    assert "2-D" in FLAT
