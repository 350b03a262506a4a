"""Skeletons, clips, and the distances between all joints."""

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from synthetic import STICK

from kinespace.library import Clip, Skeleton, SkeletonMismatchError, distance_rows
from kinespace.library.naming import hdm05

# --- skeleton ---------------------------------------------------------------------------------------------------------


JOINTS = ("root", "chest", "head", "left", "right")


def test_missing_joints_are_named() -> None:
    """A joint that is not in the list is refused by name; another case is another joint."""
    with pytest.raises(SkeletonMismatchError, match=r"expected all 5 .*got 3 without chest, head, right$"):
        Skeleton(JOINTS).order_from(("root", "Chest", "left"))


def test_a_missing_joint_is_where_the_nearest_is() -> None:
    """Along the bones, towards the root where two are as near; without bones the first joint stands for all."""
    chain = Skeleton(("root", "hip", "knee", "foot", "toe"), (-1, 0, 1, 2, 3))
    assert chain.nearest_from(["foot", "hip", "hat"]).tolist() == [1, 1, 1, 0, 0]
    assert chain.nearest_from(["toe"]).tolist() == [0] * 5
    assert Skeleton(JOINTS).nearest_from(["hat", *JOINTS[1:3]]).tolist() == [1, 1, 2, 1, 1]
    with pytest.raises(SkeletonMismatchError, match="expected some of the skeleton's, got hat"):
        chain.nearest_from(["hat"])


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


def test_a_part_of_a_skeleton_hangs_together() -> None:
    """A kept joint's parent is the nearest kept joint above it; the first kept joint is the root."""
    whole = Skeleton(("hip", "chest", "head", "arm", "hand"), (-1, 0, 1, 1, 3))
    assert whole.restricted_to([0, 2, 4]) == Skeleton(("hip", "head", "hand"), (-1, 0, 0))
    assert whole.restricted_to([4, 3, 1]) == Skeleton(("hand", "arm", "chest"), (1, 2, -1))
    assert whole.restricted_to([2, 4, 3]) == Skeleton(("head", "hand", "arm"), (-1, 2, 0))
    assert Skeleton(("a", "b", "c")).restricted_to([2, 0]) == Skeleton(("c", "a"))


# --- clip -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(0, 6, 3), (5, 5, 3), (5, 6, 2), (6, 3), (1, 5, 6, 3)])
def test_positions_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    """Positions are (frames, joints, 3) with at least one frame; the message gives the shape got."""
    with pytest.raises(ValueError, match=r"positions: expected \(frames, 6, 3\), got \(" + str(shape[0])):
        Clip(STICK, np.zeros(shape), 120.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300])
def test_positions_that_are_not_finite_are_refused(value: float) -> None:
    """One coordinate that is not a number of metres spoils the clip, which is named."""
    positions = np.zeros((9, 6, 3))
    positions[8, 5, 2] = value
    with pytest.raises(ValueError, match=r"clip 'kick': positions: expected metres below 1e\+08"):
        Clip(STICK, positions, 120.0, name="kick")


# --- distances --------------------------------------------------------------------------------------------------------


# Everything holds of the compiled functions and of numpy.
@pytest.mark.usefixtures("arithmetic")
@given(st.integers(2, 12), st.integers(0, 2**32 - 1), st.sampled_from([1e-3, 1.0, 1e3]))
def test_each_frame_may_turn_and_shift_and_be_mirrored(joints: int, seed: int, scale: float) -> None:
    """Distances of any skeleton equal the loops', and a body's place, heading and side change nothing in them."""
    skeleton = Skeleton(tuple(f"joint{index}" for index in range(joints)))
    generator = np.random.default_rng(seed)
    positions = generator.normal(scale=scale, size=(3, joints, 3))
    rows = distance_rows(positions, skeleton)
    np.testing.assert_allclose(rows, naive.distance_rows(positions), rtol=1e-13)
    turns = Rotation.from_rotvec(generator.normal(size=(3, 3))).as_matrix()
    moved = positions @ turns.transpose(0, 2, 1) + generator.normal(scale=10 * scale, size=(3, 1, 3))
    np.testing.assert_allclose(distance_rows(moved, skeleton), rows, rtol=1e-9, atol=1e-13 * scale)
    assert np.array_equal(distance_rows(positions * [1.0, -1.0, 1.0], skeleton), rows)
    assert np.array_equal(distance_rows(-4.0 * positions, skeleton), 4.0 * rows)


@pytest.mark.usefixtures("arithmetic")
@pytest.mark.parametrize("shape", [(31,), (30, 3), (31, 2), (5, 3, 31), (5, 93)])
def test_no_rows_of_another_shape(shape: tuple[int, ...]) -> None:
    """The last two axes are (joints, 3); the message gives the shape got."""
    with pytest.raises(ValueError, match=r"positions: expected \(\.\.\., 31, 3\), got \(" + str(shape[0])):
        distance_rows(np.zeros(shape), hdm05.SKELETON)
