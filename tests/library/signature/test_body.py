from __future__ import annotations

import numpy as np
import pytest
from naive_windows import body_of

from kinespace.library import MotionLibrary, distance_rows
from kinespace.library.signature.body import Body
from kinespace.library.skeleton import Skeleton

#: A root with two chains: 0-1-2 and 0-3.
FORK = Skeleton(("root", "knee", "foot", "hand"), (-1, 0, 1, 0))


def test_size_and_lengths_follow_the_segments() -> None:
    """Segments of 1, 2 and 6 metres make a body of 3 metres; from foot to hand the way leads through knee and root."""
    row = distance_rows(np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 0, 6]]), FORK)
    body = Body.of(FORK)
    assert body.size(row) == pytest.approx(3.0)
    by_pair = {(int(a), int(b)): length for (a, b), length in zip(FORK.pairs, body.lengths(row), strict=True)}
    assert by_pair == pytest.approx({(0, 1): 1, (0, 2): 3, (0, 3): 6, (1, 2): 2, (1, 3): 7, (2, 3): 9})


def test_size_and_lengths_of_a_real_body(builtin: MotionLibrary) -> None:
    """They equal the twin's, which walks from joint to joint; no distance is longer than the segments between."""
    body, twin = Body.of(builtin.skeleton), body_of(builtin.skeleton)
    rows = distance_rows(builtin.motions[0].positions[:20], builtin.skeleton)
    assert np.allclose(body.size(rows), [twin.size(row) for row in rows])
    assert np.allclose(body.lengths(rows), [twin.lengths(row) for row in rows])
    assert (rows <= body.lengths(rows) + 1e-9).all()


def test_without_parents_all_distances_stand_in_for_segments() -> None:
    """The size is then the mean distance, and that is also the length between any two joints."""
    body, row = Body.of(Skeleton(FORK.joints)), np.arange(1.0, 7.0)
    assert body.size(row) == pytest.approx(3.5)
    assert body.lengths(row) == pytest.approx(np.full(6, 3.5))
    assert not len(body.segments)


@pytest.mark.parametrize("parents", [(-1, 0, -1, 2), (-1, -1, 0, 1)])
def test_two_trees_are_no_body(parents: tuple[int, ...]) -> None:
    """Between joints of two trees there is no way."""
    with pytest.raises(ValueError, match="one tree"):
        Body.of(Skeleton(FORK.joints, parents))
