from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import naive_windows
import numpy as np
import pytest
from naive_windows import body_of, rank_k_product

from kinespace.library import MotionLibrary, distance_rows
from kinespace.library.windows.body import Body
from kinespace.library.windows.cutting import eigenpairs_of
from kinespace.library.windows.parts import (
    BASIS_LENGTHS,
    DISTANCE_LENGTHS,
    EIGEN_LONG,
    PARTS,
    SHORT_PARTS,
    Eigenpairs,
    Kind,
    Moments,
    eigen,
    flattened,
    movement,
    posture,
    spread,
    trend,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

OF_DISTANCES = {"spread": spread, "posture": posture, "trend": trend}
by_kind = pytest.mark.parametrize("kind", OF_DISTANCES)


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


@by_kind
def test_parts_of_distances(kind: str, builtin: MotionLibrary, body: Body, rows: NDArray[np.float64]) -> None:
    """Each equals its twin's number for number."""
    twin = getattr(naive_windows, kind)(
        naive_windows.moments(np.arange(len(rows)) / 60.0, rows), body_of(builtin.skeleton)
    )
    assert np.allclose(OF_DISTANCES[kind](_moments(rows), body)[0], twin)


@by_kind
def test_a_body_twice_as_large_has_the_same_parts(kind: str, body: Body, rows: NDArray[np.float64]) -> None:
    """Everything is measured relative to the body."""
    measure = OF_DISTANCES[kind]
    assert np.allclose(measure(_moments(rows), body), measure(_moments(2 * rows), body))


@by_kind
def test_a_body_in_one_point_has_no_parts(kind: str, body: Body, rows: NDArray[np.float64]) -> None:
    """For a body without size no division by zero takes place."""
    numbers = OF_DISTANCES[kind](_moments(np.zeros_like(rows)), body)
    assert np.ptp(numbers) == 0
    assert np.isfinite(numbers).all()


def test_only_the_trend_tells_a_motion_from_its_reverse(body: Body, rows: NDArray[np.float64]) -> None:
    """Backwards its sign turns, and spread and posture stay."""
    forwards, backwards = _moments(rows), _moments(rows[::-1])
    assert np.allclose(trend(backwards, body), -trend(forwards, body))
    assert np.abs(trend(forwards, body)).max() > 0.5
    assert np.allclose(spread(backwards, body), spread(forwards, body))
    assert np.allclose(posture(backwards, body), posture(forwards, body))


def test_a_trend_is_a_correlation(body: Body) -> None:
    """A distance that grows steadily has nearly trend 1, one that shrinks nearly −1, one that stays 0."""
    rows = np.ones((30, len(body.sizing)))
    steady = np.linspace(-20.0, 20.0, 30)
    rows[:, 0] += steady
    rows[:, 1] -= steady
    # The body has the size that it would have without these two.
    numbers = trend(_moments(rows), replace(body, sizing=np.eye(len(body.sizing))[2]))[0]
    assert numbers[:3] == pytest.approx([1.0, -1.0, 0.0], abs=0.01)


def test_half_of_the_level_is_taken_out_of_the_spread(body: Body, rows: NDArray[np.float64]) -> None:
    """A motion several times as wide has larger spreads, but not by all of it."""
    narrow = _moments(rows)
    wide = replace(narrow, deviation=narrow.deviation * 4)
    higher = float((spread(wide, body) - spread(narrow, body)).mean())
    assert 0.2 < higher < np.log(4) / 2


def test_products_of_scaled_eigenvectors(covariances: NDArray[np.float64]) -> None:
    """Their squares add up to the product of the rank-k matrices."""
    scaled = eigen(eigenpairs_of(covariances))
    products = np.square(scaled[0] @ scaled[1].T).sum()
    assert products == pytest.approx(rank_k_product(covariances[0], covariances[1]))
    assert 0.0 < products < 1.0


def test_a_window_is_like_itself_and_like_none_that_does_not_move(covariances: NDArray[np.float64]) -> None:
    """The product with itself is 1, with a window without movement 0."""
    scaled = eigen(eigenpairs_of(covariances))
    assert np.square(scaled[0] @ scaled[0].T).sum() == pytest.approx(1.0)
    assert not scaled[2].any()


def test_one_eigenvector_makes_the_papers_measure() -> None:
    """With k = 1 the product is the square of |⟨u, v⟩|, for any eigenvalues."""
    vectors = np.array([[[0.6, 0.8]], [[1.0, 0.0]]])
    first, second = eigen(Eigenpairs(np.array([[7.0], [0.2]]), vectors))
    assert np.square(first @ second.T).sum() == pytest.approx(0.36)


def test_the_sign_of_an_eigenvector_says_nothing(covariances: NDArray[np.float64]) -> None:
    """Flattened, a matrix of turned vectors is the same."""
    pairs = eigenpairs_of(covariances)
    turned = Eigenpairs(pairs.values, pairs.vectors * np.array([1, -1, -1, 1])[:, None])
    assert np.allclose(flattened(eigen(turned)), flattened(eigen(pairs)))


def test_products_of_flattened_matrices_are_products_of_matrices(covariances: NDArray[np.float64]) -> None:
    """Numbers off the diagonal stand once and count twice."""
    flat = flattened(eigen(eigenpairs_of(covariances)))
    assert flat.shape == (3, 15)
    assert flat[0] @ flat[1] == pytest.approx(rank_k_product(covariances[0], covariances[1]))


def test_movement(rows: NDArray[np.float64]) -> None:
    """It equals the twin's, and is 0 for a body in one point."""
    twin = naive_windows.moments(np.arange(len(rows)) / 60.0, rows)
    assert movement(_moments(rows))[0] == pytest.approx(naive_windows.moved(twin))
    assert movement(_moments(np.zeros_like(rows))) == 0


def test_names_and_lengths() -> None:
    """Parts are named for tables, and every length that a part needs is kept."""
    assert EIGEN_LONG.name == "eigen 2 s"
    assert {part.seconds for part in PARTS} == {*DISTANCE_LENGTHS, *BASIS_LENGTHS}
    assert {part.kind for part in SHORT_PARTS} == set(Kind)
    assert max(part.seconds for part in SHORT_PARTS) <= 0.5
