"""Parents learned from markers: the least changing tree, held against trying every tree."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from synthetic import STICK, stick_clip

from kinespace.library import Clip, MotionLibrary, Skeleton, distance_rows
from kinespace.library.formats.markers.parents import most_rigid_parents, with_parents
from kinespace.library.skeleton import SkeletonMismatchError
from kinespace.library.windows.body import Body


def changing(clips: list[Clip], segments: list[tuple[int, int]]) -> float:
    """Add up how much segments change, relative to their length."""
    total = 0.0
    for clip in clips:
        for a, b in segments:
            lengths = np.linalg.norm(clip.positions[:, a] - clip.positions[:, b], axis=1)
            total += float(lengths.std() / lengths.mean())
    return total


def is_tree(segments: tuple[tuple[int, int], ...], joints: int) -> bool:
    """Tell whether segments, one less than joints, hold all joints together."""
    held = {0}
    for _ in segments:
        held |= {each for segment in segments if held & set(segment) for each in segment}
    return len(held) == joints


def test_no_tree_changes_less() -> None:
    """Of all trees over six joints none changes less than the one that is learned."""
    clips = [stick_clip(name, seed=seed) for seed, name in enumerate(("bow", "jump", "wave"))]
    parents = most_rigid_parents(clips)
    learned = changing(clips, [(joint, parent) for joint, parent in enumerate(parents) if parent >= 0])
    pairs = list(itertools.combinations(range(6), 2))
    least = min(changing(clips, list(tree)) for tree in itertools.combinations(pairs, 5) if is_tree(tree, 6))
    assert learned == pytest.approx(least)
    Body.of(Skeleton(STICK.joints, parents))


def test_an_arm_is_found_again() -> None:
    """Of an arm of rigid pieces the pieces are found, in whatever order its markers are listed."""
    generator = np.random.default_rng(4)
    turns = np.cumsum(generator.normal(0.0, 0.2, (200, 4, 3)), axis=0)
    steps = turns / np.linalg.norm(turns, axis=2, keepdims=True)
    chain = np.concatenate([np.zeros((200, 1, 3)), np.cumsum(steps, axis=1)], axis=1)
    order = [2, 0, 4, 1, 3]
    clip = Clip(Skeleton(tuple("cabde")), chain[:, order], 100.0)
    found = {frozenset((order[a], order[b])) for a, b in enumerate(most_rigid_parents([clip])) if b >= 0}
    assert found == {frozenset((a, a + 1)) for a in range(4)}


def test_known_parents_stay_and_orders_are_made_alike() -> None:
    """Clips with parents keep them; without, all get the same, and joints in another order are put into the first's."""
    known = [stick_clip("bow"), stick_clip("wave")]
    assert [clip.skeleton for clip in with_parents(known)] == [STICK, STICK]
    plain = Skeleton(STICK.joints)
    other = Skeleton(STICK.joints[::-1])
    mixed = [
        stick_clip("bow", skeleton=plain),
        Clip(other, known[1].positions[:, ::-1], 120.0, "wave_0", "wave", "aa", "000"),
    ]
    learned = with_parents(mixed)
    assert learned[0].skeleton == learned[1].skeleton
    assert learned[0].skeleton.joints == STICK.joints
    assert learned[0].skeleton.parents
    np.testing.assert_array_equal(distance_rows(learned[1].positions, STICK), distance_rows(known[1].positions, STICK))
    MotionLibrary.of_clips(learned)


def test_other_joints_are_refused() -> None:
    """A clip with a joint more, or one less, is refused by name."""
    clip = stick_clip("bow")
    fewer = Clip(STICK.restricted_to([0, 1, 2]), clip.positions[:, :3], 120.0, "less")
    with pytest.raises(SkeletonMismatchError, match="'bow_0': expected the other recordings' 3 joints, got left"):
        clip.as_of(fewer.skeleton)
    with pytest.raises(SkeletonMismatchError, match="without left, right, foot"):
        fewer.as_of(STICK)
