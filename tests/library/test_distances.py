"""Distance rows: compared with loops, and unchanged by place, heading and mirroring."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kinespace.library.distances import distance_rows, measure_into
from kinespace.library.naming import hdm05
from kinespace.library.skeleton import Skeleton

#: Everything holds of the compiled kernels and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

BODY = hdm05.SKELETON


def _positions(seed: int, *shape: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(scale=0.5, size=(*(shape or (20,)), 31, 3))


@given(st.integers(2, 12), st.integers(0, 2**32 - 1), st.sampled_from([1e-3, 1.0, 1e3]))
def test_each_frame_may_turn_and_shift_and_be_mirrored(joints: int, seed: int, scale: float) -> None:
    """Distances of any skeleton equal the loops', and a body's place, heading and side change nothing in them."""
    skeleton = Skeleton(tuple(f"joint{index}" for index in range(joints)))
    generator = np.random.default_rng(seed)
    positions = generator.normal(scale=scale, size=(3, joints, 3))
    rows = distance_rows(positions, skeleton)
    np.testing.assert_allclose(rows, naive.distance_rows(positions, naive.pairs(joints)), rtol=1e-13)
    turns = Rotation.from_rotvec(generator.normal(size=(3, 3))).as_matrix()
    moved = positions @ turns.transpose(0, 2, 1) + generator.normal(scale=10 * scale, size=(3, 1, 3))
    np.testing.assert_allclose(distance_rows(moved, skeleton), rows, rtol=1e-9, atol=1e-13 * scale)
    assert np.array_equal(distance_rows(positions * [1.0, -1.0, 1.0], skeleton), rows)
    assert np.array_equal(distance_rows(-4.0 * positions, skeleton), 4.0 * rows)


def test_a_frame_has_the_same_bits_alone_and_among_many() -> None:
    """Whatever number of frames is measured at once, in the same memory, and no other rows are written."""
    positions = _positions(7, 200)
    expected, begin = distance_rows(positions, BODY), 0
    memory, rows = np.empty((16, 31, 3)), np.full((16, 465), np.nan)
    measure = measure_into(memory, BODY, rows)
    for frames in (1, 4, 16, 3, 4, 2, 8, 16, 12, 5, 1):
        memory[:frames], rows[:] = positions[begin : begin + frames], np.nan
        measure(frames)
        assert np.array_equal(rows[:frames], expected[begin : begin + frames])
        assert np.isnan(rows[frames:]).all()
        begin += frames
    assert np.array_equal(distance_rows(positions[11], BODY), expected[11])


@pytest.mark.parametrize("leading", [(), (1,), (4,), (2, 3), (0,)])
def test_any_leading_axes_are_kept(leading: tuple[int, ...]) -> None:
    """Positions (..., joints, 3), of single precision too, give distances (..., pairs) of double precision."""
    positions = _positions(6, *leading).astype(np.float32) if leading else _positions(6)[0].astype(np.float32)
    rows = distance_rows(positions, BODY)
    assert (rows.shape, rows.dtype) == ((*positions.shape[:-2], 465), np.float64)
    single = distance_rows(positions.reshape(-1, 31, 3).astype(np.float64), BODY)
    assert np.array_equal(rows.reshape(-1, 465), single)


@pytest.mark.parametrize("shape", [(31,), (30, 3), (31, 2), (5, 3, 31), (5, 93)])
def test_positions_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    """The last two axes are (joints, 3); the message gives the shape got."""
    with pytest.raises(ValueError, match=r"positions: expected \(\.\.\., 31, 3\), got \(" + str(shape[0])):
        distance_rows(np.zeros(shape), BODY)
