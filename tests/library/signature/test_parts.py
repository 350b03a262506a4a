from __future__ import annotations

from typing import TYPE_CHECKING

import naive_windows
import numpy as np
import pytest
from naive_windows import body_of, rank_k_product

from kinespace.library import MotionLibrary, distance_rows
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import (
    EIGEN_LONG,
    PARTS,
    SHORT_PARTS,
    Eigenpairs,
    Kind,
    Moments,
    eigen,
    flattened,
    lengths_of,
    movement,
    posture,
    spread,
    trend,
)
from kinespace.library.windows.cutting import eigenpairs_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

OF_DISTANCES = {"spread": spread, "posture": posture, "trend": trend}


def _moments(rows: NDArray[np.float64]) -> Moments:
    twin = naive_windows.moments(np.arange(len(rows)) / 60.0, rows)
    return Moments(twin.mean[None], twin.deviation[None], twin.trend[None])


@pytest.fixture(scope="module")
def rows(builtin: MotionLibrary) -> NDArray[np.float64]:
    """Give the distance rows of the end of a real motion."""
    return distance_rows(builtin.motions[100].positions[20:], builtin.skeleton)


@pytest.fixture(scope="module")
def body(builtin: MotionLibrary) -> Body:
    """Give the built-in library's body."""
    return Body.of(builtin.skeleton)


@pytest.fixture(scope="module")
def covariances() -> NDArray[np.float64]:
    """Give the covariances of three windows of five directions, the last one without movement."""
    points = np.random.default_rng(5).normal(size=(2, 20, 5)) * [3.0, 2.0, 1.0, 0.5, 0.1]
    return np.array([*(naive_windows.covariance(each) for each in points), np.zeros((5, 5))])


@pytest.mark.parametrize("kind", OF_DISTANCES)
def test_parts_of_distances(kind: str, builtin: MotionLibrary, body: Body, rows: NDArray[np.float64]) -> None:
    """Each equals its twin's; a body twice as large has the same, and a body in one point has finite numbers."""
    measure = OF_DISTANCES[kind]
    times = np.arange(len(rows)) / 60.0
    twin = getattr(naive_windows, kind)(naive_windows.moments(times, rows), body_of(builtin.skeleton))
    assert np.allclose(measure(_moments(rows), body)[0], twin)
    assert np.allclose(measure(_moments(2 * rows), body)[0], twin)
    numbers = measure(_moments(np.zeros_like(rows)), body)
    assert np.ptp(numbers) == 0
    assert np.isfinite(numbers).all()


def test_products_of_scaled_eigenvectors(covariances: NDArray[np.float64]) -> None:
    """Their squares, and products of the flattened matrices, are the rank-k matrices' products, whatever the signs."""
    pairs = eigenpairs_of(covariances)
    scaled, flat = eigen(pairs), flattened(eigen(pairs))
    expected = rank_k_product(covariances[0], covariances[1])
    assert 0.0 < expected < 1.0
    assert flat.shape == (3, 15)
    assert np.square(scaled[0] @ scaled[1].T).sum() == pytest.approx(expected)
    assert flat[0] @ flat[1] == pytest.approx(expected)
    assert np.square(scaled[0] @ scaled[0].T).sum() == pytest.approx(1.0)
    assert not scaled[2].any()
    turned = Eigenpairs(pairs.values, pairs.vectors * np.array([1, -1, -1, 1])[:, None])
    assert np.allclose(flattened(eigen(turned)), flat)
    # Rounding makes the values of a window that hardly moves negative.
    below = eigen(Eigenpairs(np.array([[2.0, -1e-17]]), np.eye(2)[None]))
    assert below.tolist() == [[[1.0, 0.0], [0.0, 0.0]]]


def test_movement(rows: NDArray[np.float64]) -> None:
    """It equals the twin's, and is 0 for a body in one point."""
    twin = naive_windows.moments(np.arange(len(rows)) / 60.0, rows)
    assert movement(_moments(rows))[0] == pytest.approx(naive_windows.moved(twin))
    assert movement(_moments(np.zeros_like(rows))) == 0


def test_names_and_lengths() -> None:
    """Parts are named for tables; their windows' lengths are listed once, ascending."""
    assert EIGEN_LONG.name == "eigen 2 s"
    assert lengths_of(PARTS) == ((0.25, 1.0), (0.5, 2.0))
    assert lengths_of(PARTS[1:2]) == ((), (0.5,))
    # Without an eigen part the leading eigenvector is still found.
    assert lengths_of(PARTS[-1:]) == ((0.25,), (2.0,))
    assert {part.kind for part in SHORT_PARTS} == set(Kind)
    assert max(part.seconds for part in SHORT_PARTS) <= 0.5
