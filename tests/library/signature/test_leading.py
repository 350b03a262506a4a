"""The paper's signature of a motion: its axis against the textbook, and similarity without sign."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinespace.library.signature.leading import leading_eigenvectors, signature_of, similarity

SEEDS = st.integers(0, 2**32 - 1)


@given(st.integers(2, 40), st.integers(1, 12), SEEDS)
def test_the_signature_is_the_leading_eigenvector(frames: int, numbers: int, seed: int) -> None:
    """Of any rows, more or fewer than numbers, the axis is numpy's, of length 1, whatever its sign."""
    generator = np.random.default_rng(seed)
    rows = 5.0 + generator.normal(size=(frames, numbers)) * 2.0 ** -np.arange(numbers)
    axis = signature_of(rows)
    value, _ = naive.leading_eigenvector(naive.covariance(rows))
    assert axis.shape == (numbers,)
    assert np.linalg.norm(axis) == pytest.approx(1.0)
    assert axis @ naive.covariance(rows) @ axis == pytest.approx(value)


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


@given(SEEDS)
def test_similarity_is_the_inner_product_without_its_sign(seed: int) -> None:
    """Scores equal products added up in a loop, for one window and for several, whatever the signs."""
    generator = np.random.default_rng(seed)
    axes, windows = generator.normal(size=(5, 9)), generator.normal(size=(9, 3))
    together = similarity(axes, windows)
    for column, window in zip(together.T, windows.T, strict=True):
        assert column.tolist() == pytest.approx([naive.score(row, window) for row in axes])
        assert np.array_equal(
            similarity(generator.choice([-1.0, 1.0], size=(5, 1)) * axes, -window), similarity(axes, window)
        )


@pytest.mark.parametrize(("size", "most"), [(5, 3), (2, 4), (3, 0)])
def test_leading_eigenvectors_are_the_largest(size: int, most: int) -> None:
    """As many as there are, the largest first, in the matrix's own precision."""
    points = np.random.default_rng(size).normal(size=(9, size)).astype(np.float32)
    matrix = points.T @ points
    values, vectors = leading_eigenvectors(matrix, most)
    assert values.dtype == vectors.dtype == np.float32
    assert values == pytest.approx(np.linalg.eigvalsh(matrix)[::-1][:most], rel=1e-5)
    np.testing.assert_allclose(matrix @ vectors, values * vectors, atol=1e-4)
