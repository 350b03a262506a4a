"""Distance rows: compared with loops, and unchanged by place, heading and mirroring."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kinespace.library.distances import DistanceMeasurer, distance_rows
from kinespace.library.naming import hdm05
from kinespace.library.skeleton import Skeleton

if TYPE_CHECKING:
    from kinespace.library.clip import Clip
    from kinespace.library.motion_library import MotionLibrary

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

BODY = hdm05.SKELETON


def _positions(seed: int, frames: int = 20) -> np.ndarray:
    return np.random.default_rng(seed).normal(scale=0.5, size=(frames, 31, 3))


def test_real_distances_equal_three_loops(some_clips: tuple[Clip, ...]) -> None:
    """On real motion every distance equals one computed pair by pair, coordinate by coordinate."""
    for clip in some_clips:
        positions = clip.positions[::60]
        expected = naive.distance_rows(positions, BODY.pairs.tolist())
        np.testing.assert_allclose(distance_rows(positions, BODY), expected, rtol=1e-14, atol=1e-15)


@given(st.integers(2, 12), st.integers(0, 2**32 - 1), st.sampled_from([1e-3, 1.0, 1e3]))
def test_distances_equal_three_loops(joints: int, seed: int, scale: float) -> None:
    """The distances equal those from three plain loops, for any number of frames measured side by side."""
    skeleton = Skeleton.of_joints([f"joint{index}" for index in range(joints)])
    positions = np.random.default_rng(seed).normal(scale=scale, size=(3, joints, 3))
    expected = naive.distance_rows(positions, naive.pairs(joints))
    np.testing.assert_allclose(distance_rows(positions, skeleton), expected, rtol=1e-13)


@given(st.integers(0, 2**32 - 1))
def test_distances_do_not_move_with_the_body(seed: int) -> None:
    """Turning about any axis and shifting by metres changes no distance beyond rounding."""
    generator = np.random.default_rng(seed)
    positions = _positions(seed)
    turn = Rotation.from_rotvec(generator.normal(size=3)).as_matrix()
    moved = positions @ turn.T + generator.normal(scale=10.0, size=3)
    np.testing.assert_allclose(distance_rows(moved, BODY), distance_rows(positions, BODY), rtol=1e-9, atol=1e-12)


def test_every_frame_may_move_by_itself() -> None:
    """Each frame turned and shifted by its own amount still gives the same rows."""
    generator = np.random.default_rng(11)
    positions = _positions(11)
    turns = Rotation.from_rotvec(generator.normal(size=(len(positions), 3))).as_matrix()
    moved = positions @ turns.transpose(0, 2, 1) + generator.normal(size=(len(positions), 1, 3))
    np.testing.assert_allclose(distance_rows(moved, BODY), distance_rows(positions, BODY), rtol=1e-10)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mirror_image_has_the_same_distances(axis: int) -> None:
    """Mirroring a coordinate changes nothing at all: left and right are not told apart."""
    positions = _positions(3)
    mirrored = positions.copy()
    mirrored[..., axis] *= -1.0
    assert np.array_equal(distance_rows(mirrored, BODY), distance_rows(positions, BODY))


@pytest.mark.parametrize(("scale", "tolerance"), [(2.0, 0.0), (0.125, 0.0), (1000.0, 1e-15), (-1.0, 0.0)])
def test_distances_scale_with_the_body(scale: float, tolerance: float) -> None:
    """A body twice as large has distances twice as large, exactly where the factor is a power of two."""
    positions = _positions(4)
    expected = abs(scale) * distance_rows(positions, BODY)
    np.testing.assert_allclose(distance_rows(scale * positions, BODY), expected, rtol=tolerance, atol=0.0)


def test_a_frame_has_the_same_bits_alone_and_in_a_batch(builtin: MotionLibrary) -> None:
    """A frame measured alone, as live, gives the same bits as in a batch, as at rest."""
    for clip in builtin.motions[::9]:
        rows = distance_rows(clip.positions, BODY)
        for frame in range(0, clip.frames, 7):
            assert np.array_equal(distance_rows(clip.positions[frame], BODY), rows[frame])


@pytest.mark.parametrize("leading", [(), (1,), (4,), (2, 3), (0,)])
def test_any_leading_axes_are_kept(leading: tuple[int, ...]) -> None:
    """Positions (..., joints, 3) give distances (..., pairs)."""
    positions = np.random.default_rng(6).normal(size=(*leading, 31, 3))
    rows = distance_rows(positions, BODY)
    assert rows.shape == (*leading, 465)
    assert np.array_equal(rows.reshape(-1, 465), distance_rows(positions.reshape(-1, 31, 3), BODY))


def test_measured_again_and_again_in_the_same_memory() -> None:
    """Any numbers of frames one after the other give the same rows as alone, and leave other rows alone."""
    positions = np.random.default_rng(7).normal(size=(200, 31, 3))
    expected, measurer = distance_rows(positions, BODY), DistanceMeasurer(BODY, 16)
    rows, begin = np.full((200, 465), np.nan), 0
    for frames in (1, 4, 16, 3, 4, 2, 8, 16, 12, 5, 1):
        measurer.measure(positions[begin : begin + frames], rows[begin : begin + frames])
        begin += frames
        assert np.array_equal(rows[:begin], expected[:begin])
        assert np.isnan(rows[begin:]).all()


def test_input_is_neither_changed_nor_bound_to_a_layout() -> None:
    """A strided view of read-only positions gives the rows of a copy, and is not changed."""
    wide = np.random.default_rng(8).normal(size=(40, 62, 6))
    view = wide[::2, ::2, ::-2]
    wide.setflags(write=False)
    before = view.copy()
    assert np.array_equal(distance_rows(view, BODY), distance_rows(before, BODY))
    assert np.array_equal(view, before)


def test_single_precision_is_measured_in_double() -> None:
    """Positions as a feed sends them, float32, are measured with the precision of float64."""
    positions = _positions(9).astype(np.float32)
    rows = distance_rows(positions, BODY)
    assert rows.dtype == np.float64
    assert np.array_equal(rows, distance_rows(positions.astype(np.float64), BODY))


def test_joints_in_one_place_are_at_no_distance() -> None:
    """All joints in one place, far from the origin, are at distance zero."""
    assert not distance_rows(np.full((2, 31, 3), 1e6), BODY).any()


@pytest.mark.parametrize("shape", [(31,), (30, 3), (31, 2), (5, 3, 31), (5, 93)])
def test_positions_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    """The last two axes are (joints, 3); the message gives the shape got."""
    with pytest.raises(ValueError, match=r"positions: expected \(\.\.\., 31, 3\), got \(" + str(shape[0])):
        distance_rows(np.zeros(shape), BODY)
