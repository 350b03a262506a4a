from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.library import MotionLibrary, distance_rows
from kinespace.library.signature.basis import MAX_DIRECTIONS, Basis
from kinespace.library.signature.body import Body
from kinespace.library.windows.index import learned_basis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.library.windows.index import WindowIndex

#: The rounding of single precision, in which a basis is kept, in sums of some hundred numbers.
SINGLE = 1e-6


@pytest.fixture(scope="module")
def rows(builtin: MotionLibrary) -> list[NDArray[np.float64]]:
    """Give distance rows of three motions."""
    return [distance_rows(motion.positions, builtin.skeleton) for motion in builtin.motions[:200:70]]


@pytest.fixture(scope="module")
def body(builtin: MotionLibrary) -> Body:
    """Give the built-in library's body."""
    return Body.of(builtin.skeleton)


def test_the_builtin_basis_holds_nearly_all_movement(builtin_index: WindowIndex) -> None:
    """32 directions, orthonormal but for the weights, hold 98 %; segments are rigid."""
    basis, segments = builtin_index.basis, builtin_index.body.segments
    assert basis.directions.shape == (465, MAX_DIRECTIONS)
    assert 0.98 <= basis.share < 1.0
    moving = basis.weights > 0
    plain = basis.directions[moving] / basis.weights[moving, None]
    assert np.allclose(plain.T @ plain, np.eye(MAX_DIRECTIONS), atol=SINGLE)
    assert not basis.weights[segments].any()
    assert not basis.directions[segments].any()
    assert moving.sum() <= len(basis.weights) - len(segments)


def test_all_pairs_and_classes_count_alike(rows: list[NDArray[np.float64]], body: Body) -> None:
    """The variance of each moving distance, relative to the body, times its weight is 1, mean over classes."""
    basis = Basis.learned([rows[:1], rows[1:]], body)
    relative = [np.var(each / body.size(each.mean(axis=0)), axis=0) for each in rows]
    by_class = [relative[0], (relative[1] + relative[2]) / 2]
    moving = basis.weights > 0
    assert np.allclose((np.mean(by_class, axis=0) * basis.weights**2)[moving], 1.0, rtol=1e-3)
    assert np.array_equal(moving, np.mean(by_class, axis=0) > 1e-3 * np.mean(by_class))
    once, often = (Basis.learned([[rows[0]] * times, rows[1:2]], body) for times in (1, 4))
    assert np.allclose(once.weights, often.weights, rtol=1e-4)


def test_without_weights_the_basis_is_orthonormal(builtin: MotionLibrary, rows: list[NDArray[np.float64]]) -> None:
    """Then it holds even more, because a few distances swing furthest, and rows go there and back nearly unharmed."""
    basis = learned_basis(builtin, weighted=False)
    assert np.allclose(basis.directions.T @ basis.directions, np.eye(MAX_DIRECTIONS), atol=SINGLE)
    assert basis.share > 0.98
    centred = rows[0] - rows[0].mean(axis=0)
    back = centred @ basis.directions @ basis.directions.T
    assert np.square(back - centred).sum() < 0.02 * np.square(centred).sum()


def test_few_moving_pairs_make_few_directions(body: Body) -> None:
    """Two distances that vary give two directions, which hold all movement; none that vary give none."""
    still = np.ones((50, len(body.sizing)))
    assert Basis.learned([[still]], body).share == 0.0
    still[:, 7] += np.sin(np.arange(50))
    still[:, 9] += np.cos(np.arange(50))
    basis = Basis.learned([[still]], body)
    assert (np.count_nonzero(basis.weights), basis.directions.shape[1]) == (2, 2)
    assert basis.share == pytest.approx(1.0)
