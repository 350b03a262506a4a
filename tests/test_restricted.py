"""A library restricted to fewer joints: the shared pairs, cut and renormalised, compared with a library built so."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic import STICK, stick_clips

from library import MotionLibrary
from library.skeleton import Skeleton, SkeletonMismatchError
from stream.feeds import builtin_names, builtin_preset

if TYPE_CHECKING:
    from collections.abc import Sequence

    from library import Clip

LIBRARY = MotionLibrary.of_clips(stick_clips())


def naive_cut(library: MotionLibrary, joints: Sequence[str]) -> dict[str, np.ndarray]:
    """Pick the shared pairs one by one, by their joints' names."""
    names = library.skeleton.joints
    columns = [
        column
        for column, (first, second) in enumerate(library.skeleton.pairs)
        if names[first] in joints and names[second] in joints
    ]
    axes = np.array([[axis[column] for column in columns] for axis in library.axes], dtype=np.float64)
    return {
        "means": np.array([[row[column] for column in columns] for row in library.means]),
        "deviations": np.array([[row[column] for column in columns] for row in library.deviations]),
        "axes": np.array([axis / np.sqrt(axis @ axis) for axis in axes]),
    }


@pytest.mark.parametrize("with_segments", [True, False])
def test_the_shared_pairs_are_kept(with_segments: bool) -> None:  # noqa: FBT001 - a parametrised test's argument
    """Means and deviations are those of the shared pairs, axes too, of unit length; joints in the library's order."""
    skeleton = STICK if with_segments else STICK.without_segments()
    clips = stick_clips() if with_segments else [_of(clip, skeleton) for clip in stick_clips()]
    library = MotionLibrary.of_clips(clips)
    wanted = (STICK.joints[4], STICK.joints[0], STICK.joints[2], STICK.joints[5], "tail")
    restricted = library.restricted_to(wanted)
    assert restricted.skeleton.joints == tuple(STICK.joints[index] for index in (0, 2, 4, 5))
    assert restricted.skeleton.with_segments is with_segments
    for name, expected in naive_cut(library, wanted).items():
        kept = [
            tuple(sorted((restricted.skeleton.joints[a], restricted.skeleton.joints[b])))
            for a, b in restricted.skeleton.pairs
        ]
        every = [
            tuple(sorted((library.skeleton.joints[a], library.skeleton.joints[b])))
            for a, b in library.skeleton.pairs
            if library.skeleton.joints[a] in wanted and library.skeleton.joints[b] in wanted
        ]
        ours = getattr(restricted, name)
        columns = [every.index(pair) for pair in kept]
        if name == "axes" and len(columns) < len(every):
            expected = expected[:, columns] / np.linalg.norm(expected[:, columns], axis=1, keepdims=True)  # noqa: PLW2901
            columns = list(range(len(columns)))
        np.testing.assert_allclose(ours, expected[:, columns], atol=1e-6)
    assert (restricted.classes, len(restricted)) == (library.classes, len(library))
    assert restricted.windows is None


def _of(clip: Clip, skeleton: Skeleton) -> Clip:

    return replace(clip, skeleton=skeleton)


def test_all_joints_are_the_library_itself() -> None:
    """A feed that has every joint, and more, needs no other library."""
    assert LIBRARY.restricted_to([*reversed(STICK.joints), "tail"]) is LIBRARY


def test_two_joints_must_be_shared() -> None:
    """With one joint, or none, there is no distance, and that is said."""
    with pytest.raises(SkeletonMismatchError, match=r"joints: expected at least 2 of the library's 6 .*, got 1"):
        LIBRARY.restricted_to([STICK.joints[0], "tail"])


def test_motions_keep_what_is_said_of_them() -> None:
    """Class, actor and take stay; eigenvalue and share are those of what is left, both still possible."""
    restricted = LIBRARY.restricted_to(STICK.joints[:4])
    for ours, theirs in zip(restricted.motions, LIBRARY.motions, strict=True):
        assert (ours.class_name, ours.actor, ours.take) == (theirs.class_name, theirs.actor, theirs.take)
        assert 0 < ours.eigenvalue < theirs.eigenvalue
        assert 0 < ours.share <= 1


@pytest.mark.parametrize("name", builtin_names())
def test_the_built_in_library_fits_every_preset(name: str) -> None:
    """The built-in library has at least nine joints in common with each preset, and parents that make a tree."""
    preset = builtin_preset(name)
    restricted = MotionLibrary.builtin().restricted_to(preset.joints)
    assert set(restricted.skeleton.joints) == set(preset.joints)
    np.testing.assert_allclose(np.linalg.norm(restricted.axes, axis=1), 1.0, atol=1e-6)
    for joint, parent in enumerate(restricted.skeleton.parents):
        assert -1 <= parent < len(preset.joints)
        assert parent != joint


def test_an_axis_cut_is_near_the_axis_of_the_fewer_distances() -> None:
    """On motions whose variance lies along one axis the cut axis is the one a library of fewer joints would have."""
    joints = STICK.joints[:5]
    smaller = Skeleton.of_joints(joints)
    clips = stick_clips()
    built = MotionLibrary.of_clips([_narrowed(clip, smaller) for clip in clips])
    products = np.abs(np.sum(built.axes * LIBRARY.restricted_to(joints).axes, axis=1))
    assert products.min() > 0.99


def _narrowed(clip: Clip, skeleton: Skeleton) -> Clip:

    return replace(clip, skeleton=skeleton, positions=clip.positions[:, : len(skeleton.joints)])
