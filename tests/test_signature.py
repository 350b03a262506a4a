"""What is kept of a motion: moments and axis against the textbook, and similarity without sign."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import STICK, stick_clip

from library.distances import distance_rows
from library.signature import Moments, signature_of, similarity

if TYPE_CHECKING:
    from library.clip import Clip


def _rows(seed: int, frames: int = 30, numbers: int = 8, scale: float = 1.0) -> np.ndarray:
    generator = np.random.default_rng(seed)
    return scale * (5.0 + generator.normal(size=(frames, numbers)) @ generator.normal(size=(numbers, numbers)))


@given(st.integers(2, 40), st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_moments_are_mean_and_sample_covariance(frames: int, numbers: int, seed: int) -> None:
    """Mean and covariance of any rows are those of numpy on the raw rows, divided by count - 1."""
    rows = _rows(seed, frames, numbers)
    moments = Moments.of_rows(rows)
    assert moments.count == frames
    np.testing.assert_allclose(moments.mean, rows.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(moments.covariance, naive.covariance(rows), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("frames", [1, 5])
def test_rows_that_are_all_alike_have_no_covariance(frames: int) -> None:
    """One row, or the same row again, has itself for mean and exactly zero covariance."""
    row = np.array([0.5, 1.25, 3.0])
    moments = Moments.of_rows(np.tile(row, (frames, 1)))
    assert np.array_equal(moments.mean, row)
    assert not moments.covariance.any()


@pytest.mark.parametrize("shape", [(0, 8), (8,), (2, 3, 4)])
def test_rows_that_are_no_matrix_are_refused(shape: tuple[int, ...]) -> None:
    """Without a frame, or in another shape, there are no moments."""
    with pytest.raises(ValueError, match=r"rows: expected \(frames, pairs\) with at least one frame, got \("):
        Moments.of_rows(np.zeros(shape))


def test_real_signatures_are_those_of_the_paper(some_clips: tuple[Clip, ...]) -> None:
    """On real clips the axis is the first of the SVD of the centred distances, with its variance and share."""
    for clip in some_clips:
        rows = distance_rows(clip.positions, clip.skeleton)
        signature = signature_of(Moments.of_rows(rows))
        variance, axis = naive.first_axis_by_svd(rows)
        assert abs(signature.axis.vector @ axis) == pytest.approx(1.0, abs=1e-9)
        assert signature.axis.value == pytest.approx(variance)
        assert signature.axis.share == pytest.approx(variance / rows.var(axis=0, ddof=1).sum())
        np.testing.assert_allclose(signature.mean, rows.mean(axis=0), rtol=1e-12)
        np.testing.assert_allclose(signature.deviation, rows.std(axis=0, ddof=1), rtol=1e-6, atol=1e-9)


def test_a_window_started_warm_has_the_clips_signature() -> None:
    """The stream's way, from the last axis, and the library's, from nothing, give the same signature."""
    rows = distance_rows(stick_clip("wave", frames=120).positions, STICK)
    last = signature_of(Moments.of_rows(rows[:-10]))
    warm = signature_of(Moments.of_rows(rows), last.axis)
    cold = signature_of(Moments.of_rows(rows))
    assert (warm.axis.exact, cold.axis.exact) == (False, True)
    assert abs(warm.axis.vector @ cold.axis.vector) == pytest.approx(1.0, abs=1e-9)
    assert np.array_equal(warm.mean, cold.mean)
    assert np.array_equal(warm.deviation, cold.deviation)


def test_body_size_and_movement_as_defined() -> None:
    """Body size is the root mean square of the mean distances, movement that of the deviations in body sizes."""
    rows = _rows(3)
    signature = signature_of(Moments.of_rows(rows))
    size = float(np.sqrt(np.mean(rows.mean(axis=0) ** 2)))
    assert signature.body_size == pytest.approx(size)
    assert signature.movement == pytest.approx(np.sqrt(np.mean(rows.var(axis=0, ddof=1))) / size)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_movement_has_no_unit(scale: float) -> None:
    """A child and a giant, millimetres and metres, move as much when they do the same."""
    signature = signature_of(Moments.of_rows(_rows(4)))
    scaled = signature_of(Moments.of_rows(_rows(4, scale=scale)))
    assert scaled.body_size == pytest.approx(scale * signature.body_size)
    assert scaled.movement == pytest.approx(signature.movement)
    assert abs(scaled.axis.vector @ signature.axis.vector) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("row", [np.array([1.0, 2.0, 3.0]), np.zeros(3)], ids=["statue", "point"])
def test_a_statue_does_not_move(row: np.ndarray) -> None:
    """A body that stands still, even one of no size, moves by exactly 0."""
    signature = signature_of(Moments.of_rows(np.tile(row, (10, 1))))
    assert signature.movement == 0.0
    assert not signature.deviation.any()


def test_rounding_below_zero_is_no_deviation() -> None:
    """A variance that downdating has left a hair below zero gives a deviation of 0, not NaN."""
    moments = Moments(10, np.ones(3), np.diag([1.0, -1e-20, 0.5]))
    assert signature_of(moments).deviation.tolist() == pytest.approx([1.0, 0.0, np.sqrt(0.5)])


def test_signatures_do_not_depend_on_duration(some_clips: tuple[Clip, ...]) -> None:
    """A motion played twice in a row has the same axis: the paper's independence of temporal length."""
    for clip in some_clips[:3]:
        rows = distance_rows(clip.positions, clip.skeleton)
        once, twice = (signature_of(Moments.of_rows(np.tile(rows, (times, 1)))) for times in (1, 2))
        assert abs(once.axis.vector @ twice.axis.vector) == pytest.approx(1.0, abs=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_similarity_is_the_inner_product_without_its_sign(seed: int) -> None:
    """Scores are those of adding up products in a loop, and turning any eigenvector round changes none."""
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
