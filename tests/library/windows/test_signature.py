"""The paper's signature of a motion: its axis against the textbook, and similarity without sign."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinespace.library import MotionLibrary
from kinespace.library.distances import distance_rows
from kinespace.library.windows.signature import signature_of, similarity

if TYPE_CHECKING:
    from kinespace.library.clip import Clip


@pytest.fixture(scope="module")
def motions() -> tuple[Clip, ...]:
    """Give a motion of each of the built-in library's classes."""
    by_class = {motion.class_name: motion for motion in MotionLibrary.builtin().motions}
    return tuple(by_class.values())


@given(st.integers(2, 40), st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_the_signature_is_the_leading_eigenvector(frames: int, numbers: int, seed: int) -> None:
    """Of any rows, more or fewer than numbers, the axis is numpy's, of length 1, whatever its sign."""
    generator = np.random.default_rng(seed)
    rows = 5.0 + generator.normal(size=(frames, numbers)) * 2.0 ** -np.arange(numbers)
    axis = signature_of(rows)
    value, _ = naive.leading_eigenvector(naive.covariance(rows))
    assert axis.shape == (numbers,)
    assert np.linalg.norm(axis) == pytest.approx(1.0)
    assert axis @ naive.covariance(rows) @ axis == pytest.approx(value)


def test_real_signatures_equal_the_papers(motions: tuple[Clip, ...]) -> None:
    """On real motions the axis is the first of the SVD of the centred distances."""
    assert len(motions) == 11
    for motion in motions:
        rows = distance_rows(motion.positions, motion.skeleton)
        _, axis = naive.first_axis_by_svd(rows)
        assert abs(signature_of(rows) @ axis) == pytest.approx(1.0, abs=1e-9)


def test_signatures_do_not_depend_on_duration_and_size(motions: tuple[Clip, ...]) -> None:
    """A motion played twice in a row, or done by a giant, has the same axis: the paper's independence of both."""
    for motion in motions[:3]:
        rows = distance_rows(motion.positions, motion.skeleton)
        for other in (np.tile(rows, (2, 1)), 1000 * rows):
            assert abs(signature_of(rows) @ signature_of(other)) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("frames", [2, 10])
def test_a_statue_has_some_unit_vector(frames: int) -> None:
    """Where nothing moves, the signature is still finite and of length 1."""
    axis = signature_of(np.tile([0.5, 1.25, 3.0], (frames, 1)))
    assert np.linalg.norm(axis) == pytest.approx(1.0)


@pytest.mark.parametrize("shape", [(0, 8), (1, 8), (8,), (2, 3, 4)])
def test_rows_without_a_motion_are_refused(shape: tuple[int, ...]) -> None:
    """Without two frames, or in another shape, there is no signature."""
    with pytest.raises(ValueError, match=r"rows: expected \(frames, pairs\) with at least two frames, got \("):
        signature_of(np.zeros(shape))


@given(st.integers(0, 2**32 - 1))
def test_similarity_is_the_inner_product_without_its_sign(seed: int) -> None:
    """Scores equal products added up in a loop, and the sign of an eigenvector does not change them."""
    generator = np.random.default_rng(seed)
    axes = generator.normal(size=(5, 9))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    axis = axes[2] * 0.6 + axes[3] * 0.8
    scores = similarity(axes, axis)
    assert scores.tolist() == pytest.approx([naive.score(row, axis) for row in axes])
    signs = generator.choice([-1.0, 1.0], size=(5, 1))
    assert np.array_equal(similarity(signs * axes, -axis), scores)


def test_similarity_runs_from_unlike_to_the_same() -> None:
    """Orthogonal axes score 0, the same axis 1, either way round."""
    axes = np.eye(3)
    assert similarity(axes, axes[1]).tolist() == [0.0, 1.0, 0.0]
    assert similarity(-axes, axes[1]).tolist() == [0.0, 1.0, 0.0]


def test_several_windows_are_compared_at_once() -> None:
    """Windows side by side, shape (pairs, windows), give each the column it gives alone."""
    generator = np.random.default_rng(12)
    axes, windows = generator.normal(size=(4, 9)), generator.normal(size=(9, 3))
    together = similarity(axes, windows)
    assert together.shape == (4, 3)
    for column, window in zip(together.T, windows.T, strict=True):
        np.testing.assert_allclose(column, similarity(axes, window), rtol=1e-12)
