"""The skeleton: which pairs are measured, and how joints of another order are found again."""

from __future__ import annotations

import naive
import numpy as np
import pytest

from kinespace.library.skeleton import Skeleton, SkeletonMismatchError

JOINTS = ("root", "chest", "head", "left", "right")
PARENTS = (-1, 0, 1, 1, 1)


@pytest.mark.parametrize("count", [2, 3, 4, 31])
def test_every_pair_is_measured_once_in_order(count: int) -> None:
    """Pairs are all n(n-1)/2, the lower joint first, in lexicographic order, as counting them out gives."""
    skeleton = Skeleton(tuple(f"joint{index}" for index in range(count)))
    assert [tuple(pair) for pair in skeleton.pairs.tolist()] == naive.pairs(count)


def test_pairs_cannot_be_written() -> None:
    """The measured pairs are read-only: a library's columns cannot change their meaning."""
    with pytest.raises(ValueError, match="read-only"):
        Skeleton(JOINTS).pairs[0, 0] = 3


def test_order_from_finds_every_joint_again() -> None:
    """Positions taken in the order found are in the skeleton's own order, further joints being passed over."""
    skeleton = Skeleton(JOINTS)
    sent = [*JOINTS, "prop", "camera"]
    np.random.default_rng(5).shuffle(sent)
    assert tuple(sent[index] for index in skeleton.order_from(sent)) == JOINTS


@pytest.mark.parametrize(
    ("sent", "message"),
    [
        pytest.param(("root",), r"expected all 5 .*got 1 without chest, head, left, right$", id="four missing"),
        pytest.param(("Root", *JOINTS[1:]), r"without root$", id="another case is another joint"),
        pytest.param((), r"got 0 without root, chest, head, left, right$", id="nothing sent"),
    ],
)
def test_missing_joints_are_named(sent: tuple[str, ...], message: str) -> None:
    """A joint that is not in the list is refused by name."""
    with pytest.raises(SkeletonMismatchError, match=message):
        Skeleton(JOINTS).order_from(sent)


def test_a_missing_joint_is_where_the_nearest_is() -> None:
    """Along the bones, towards the root where two are as near; without bones the first joint stands for all."""
    chain = Skeleton(("root", "hip", "knee", "foot", "toe"), (-1, 0, 1, 2, 3))
    assert chain.nearest_from(["foot", "hip", "hat"]).tolist() == [1, 1, 1, 0, 0]
    assert chain.nearest_from(["toe"]).tolist() == [0] * 5
    assert Skeleton(JOINTS).nearest_from(["hat", *JOINTS[1:3]]).tolist() == [1, 1, 2, 1, 1]
    with pytest.raises(SkeletonMismatchError, match="expected some of the skeleton's, got hat"):
        chain.nearest_from(["hat"])


def test_the_same_joints_with_other_parents_are_accepted() -> None:
    """A feed that announces joint names alone is the same body: parents do not enter a distance."""
    Skeleton(JOINTS, PARENTS).require_same(Skeleton(JOINTS))


@pytest.mark.parametrize(
    "other",
    [
        pytest.param(Skeleton((*JOINTS[:-1], "tail")), id="another name"),
        pytest.param(Skeleton(JOINTS[::-1]), id="another order"),
        pytest.param(Skeleton((*JOINTS, "tail")), id="one joint more"),
    ],
)
def test_another_skeleton_is_refused(other: Skeleton) -> None:
    """Other joints or another order are refused, in either direction; the message describes both skeletons."""
    skeleton = Skeleton(JOINTS, PARENTS)
    with pytest.raises(SkeletonMismatchError, match=r"expected 5 joints and 10 pairs \(root \.\.\. right\), got"):
        skeleton.require_same(other)
    with pytest.raises(SkeletonMismatchError, match=r"got 5 joints and 10 pairs \(root \.\.\. right\)"):
        other.require_same(skeleton)


@pytest.mark.parametrize(
    ("joints", "parents", "message"),
    [
        pytest.param(("root",), (-1,), "joints: expected at least 2 names, got 1", id="one joint"),
        pytest.param(("root", ""), (), "joints: expected distinct, non-empty names", id="empty name"),
        pytest.param(("root", "root"), (), "joints: expected distinct, non-empty names", id="name twice"),
        pytest.param(JOINTS, (-1, 0), r"parents: expected one per joint \(5\), got 2", id="too few parents"),
        pytest.param(JOINTS, (-1, 0, 1, 1, 5), "parents: expected joint indices or -1", id="parent too high"),
        pytest.param(JOINTS, (-2, 0, 1, 1, 1), "parents: expected joint indices or -1", id="parent too low"),
        pytest.param(JOINTS, (-1, 1, 1, 1, 1), "parents: expected joint indices or -1", id="own parent"),
        pytest.param(JOINTS, (-1, 4, 1, 2, 3), "parents: expected no joint above itself", id="a ring beside the root"),
        pytest.param("abc", (), "joints: expected several names, got the text 'abc'", id="a text"),
    ],
)
def test_bad_skeletons_are_refused(joints: tuple[str, ...], parents: tuple[int, ...], message: str) -> None:
    """Joints and parents that cannot describe a body are refused, saying which and why."""
    with pytest.raises(ValueError, match=message):
        Skeleton(joints, parents)


def test_a_skeleton_of_lists_is_that_of_tuples() -> None:
    """Lists of joints and parents make the same skeleton, of any depth, which can be a key."""
    chain = Skeleton([*JOINTS], [-1, 0, 1, 2, 3])  # type: ignore[arg-type]
    assert {chain, Skeleton(JOINTS, (-1, 0, 1, 2, 3))} == {chain}


def test_a_part_of_a_skeleton_hangs_together() -> None:
    """A kept joint's parent is the nearest kept joint above it; the first kept joint is the root."""
    whole = Skeleton(("hip", "chest", "head", "arm", "hand"), (-1, 0, 1, 1, 3))
    assert whole.restricted_to([0, 2, 4]) == Skeleton(("hip", "head", "hand"), (-1, 0, 0))
    assert whole.restricted_to([4, 3, 1]) == Skeleton(("hand", "arm", "chest"), (1, 2, -1))
    assert whole.restricted_to([2, 4, 3]) == Skeleton(("head", "hand", "arm"), (-1, 2, 0))
    assert Skeleton(("a", "b", "c")).restricted_to([2, 0]) == Skeleton(("c", "a"))
