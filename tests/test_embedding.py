"""Distance rows back to joint positions: the same distances, centred, and no flips."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive_portrait
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import STICK

from library import distance_rows, hdm05
from library.embedding import embedded

if TYPE_CHECKING:
    from library.clip import Clip


@given(seed=st.integers(0, 10_000), size=st.sampled_from([0.1, 1.0, 1000.0]))
def test_distances_that_fit_in_space_are_returned(seed: int, size: float) -> None:
    """Positions found for the distances of any points in space have those distances again, and are centred."""
    points = np.random.default_rng(seed).normal(scale=size, size=(4, 6, 3)) + 5.0 * size
    rows = distance_rows(points, STICK)
    found = embedded(rows, STICK)
    assert found.shape == (4, 6, 3)
    np.testing.assert_allclose(distance_rows(found, STICK), rows, rtol=1e-6, atol=1e-9 * size)
    np.testing.assert_allclose(found.mean(axis=1), 0.0, atol=1e-9 * size)


def test_flat_bodies_are_embedded_too() -> None:
    """Points that lie in a plane, or on a line, keep their distances as well."""
    points = np.random.default_rng(3).normal(size=(2, 6, 3)) * [[[1, 1, 0]], [[1, 0, 0]]]
    rows = distance_rows(points, STICK)
    np.testing.assert_allclose(distance_rows(embedded(rows, STICK), STICK), rows, atol=1e-6)


@given(seed=st.integers(0, 10_000))
def test_a_body_never_jumps_more_than_its_points_did(seed: int) -> None:
    """From frame to frame the found body moves no more than the points moved whose distances were given."""
    generator = np.random.default_rng(seed)
    points = generator.normal(size=(6, 3)) + np.cumsum(generator.normal(scale=0.02, size=(30, 6, 3)), axis=0)
    found = embedded(distance_rows(points, STICK), STICK)
    centred = points - points.mean(axis=1, keepdims=True)
    moved = np.linalg.norm(np.diff(centred, axis=0), axis=(1, 2))
    assert (np.linalg.norm(np.diff(found, axis=0), axis=(1, 2)) <= moved * (1 + 1e-6) + 1e-6).all()


def test_a_skeleton_without_segments_cannot_be_embedded() -> None:
    """When not all pairs are measured there is nothing to embed, and the error says how many there are."""
    skeleton = hdm05.SKELETON.without_segments()
    with pytest.raises(ValueError, match="expected all pairs measured, got 435 for 31 joints"):
        embedded(np.ones((1, 435)), skeleton)


@given(seed=st.integers(0, 10_000))
def test_distances_that_fit_in_no_space_come_near(seed: int) -> None:
    """Of distances that no points have, the found positions have those of the twin's three leading axes."""
    rows = np.random.default_rng(seed).uniform(0.5, 1.5, size=(3, 15))
    exact = naive_portrait.distances_in_space(rows, 6)
    np.testing.assert_allclose(distance_rows(embedded(rows, STICK), STICK), exact, atol=1e-9)
    assert np.abs(exact - rows).max() > 0.01


def test_real_motion_is_found_again(some_clips: tuple[Clip, ...]) -> None:
    """From a real clip's distances alone a body is found that has them, and moves no more than the performer did."""
    for clip in some_clips[::5]:
        rows = distance_rows(clip.positions[::4], clip.skeleton)
        found = embedded(rows, clip.skeleton)
        np.testing.assert_allclose(distance_rows(found, clip.skeleton), rows, atol=1e-6)
        centred = clip.positions[::4] - clip.positions[::4].mean(axis=1, keepdims=True)
        turned = np.linalg.norm(np.diff(centred, axis=0), axis=(1, 2))
        assert (np.linalg.norm(np.diff(found, axis=0), axis=(1, 2)) <= turned * (1 + 1e-6) + 1e-5).all()
