from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from naive_windows import body_of

from kinespace.library import MotionLibrary, distance_rows
from kinespace.library.skeleton import Skeleton
from kinespace.library.windows.body import Body

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: A root with two chains: 0-1-2 and 0-3.
FORK = Skeleton(("root", "knee", "foot", "hand"), (-1, 0, 1, 0))


@pytest.fixture(scope="module")
def rows(builtin: MotionLibrary) -> NDArray[np.float64]:
    """Give distance rows of a real motion."""
    return distance_rows(builtin.motions[0].positions[:40], builtin.skeleton)


def test_the_size_of_a_body_is_its_mean_segment_length() -> None:
    """Segments of 1, 2 and 6 metres make a body of 3 metres."""
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 0, 6]])
    assert Body.of(FORK).size(distance_rows(positions, FORK)) == pytest.approx(3.0)


def test_the_length_between_two_joints_follows_the_segments_between_them() -> None:
    """From foot to hand it leads through knee and root, whichever way the limbs point."""
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 0, 6]])
    lengths = Body.of(FORK).lengths(distance_rows(positions, FORK))
    by_pair = {(int(a), int(b)): length for (a, b), length in zip(FORK.pairs, lengths, strict=True)}
    assert by_pair == pytest.approx({(0, 1): 1, (0, 2): 3, (0, 3): 6, (1, 2): 2, (1, 3): 7, (2, 3): 9})


def test_size_and_lengths_of_a_real_body(builtin: MotionLibrary, rows: NDArray[np.float64]) -> None:
    """Size and lengths equal the twin's, which walks from joint to joint."""
    body, twin = Body.of(builtin.skeleton), body_of(builtin.skeleton)
    assert np.allclose(body.size(rows), [twin.size(row) for row in rows])
    assert np.allclose(body.lengths(rows), [twin.lengths(row) for row in rows])


def test_no_distance_is_longer_than_the_segments_between(builtin: MotionLibrary, rows: NDArray[np.float64]) -> None:
    """Segments are the shortest way a body allows between two joints, and a straight line is shorter still."""
    assert (rows <= Body.of(builtin.skeleton).lengths(rows) + 1e-9).all()


def test_without_parents_all_distances_stand_in_for_segments() -> None:
    """The size is then the mean distance, and that is also the length between any two joints."""
    unknown = Skeleton(FORK.joints)
    row = np.arange(1.0, 7.0)
    body = Body.of(unknown)
    assert body.size(row) == pytest.approx(3.5)
    assert body.lengths(row) == pytest.approx(np.full(6, 3.5))


@pytest.mark.parametrize("parents", [(-1, 0, -1, 2), (-1, -1, 0, 1)])
def test_two_trees_are_no_body(parents: tuple[int, ...]) -> None:
    """Between joints of two trees there is no way."""
    with pytest.raises(ValueError, match="one tree"):
        Body.of(Skeleton(FORK.joints, parents))


def test_equal_skeletons_share_a_body(builtin: MotionLibrary) -> None:
    """A new performer costs no search for segments and paths: names without end must not take the time of others."""
    again = Skeleton(builtin.skeleton.joints, builtin.skeleton.parents)
    assert Body.of(again) is Body.of(builtin.skeleton)
