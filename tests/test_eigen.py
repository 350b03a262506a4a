"""The leading eigenvector: against the whole eigenproblem, hop by hop, and a certificate that cannot be fooled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from library.distances import distance_rows
from library.eigen import BLOCK, RESIDUAL_TOLERANCE, LeadingAxis, leading_axis

if TYPE_CHECKING:
    from library.clip import Clip

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

SEEDS = st.integers(0, 2**32 - 1)


def _residual(matrix: np.ndarray, axis: LeadingAxis) -> float:
    """Recompute ‖Cv − λv‖ / λ from what was handed out."""
    return float(np.linalg.norm(matrix @ axis.vector - axis.value * axis.vector)) / axis.value


def _assert_leads(matrix: np.ndarray, axis: LeadingAxis) -> None:
    """Hold an axis against the whole eigenproblem: value, unit length, residual, and that nothing lies above."""
    value, vector = naive.leading_eigenvector(matrix)
    assert axis.value == pytest.approx(value, rel=1e-9)
    assert np.linalg.norm(axis.vector) == pytest.approx(1.0, abs=1e-12)
    assert axis.residual <= RESIDUAL_TOLERANCE
    assert _residual(matrix, axis) <= RESIDUAL_TOLERANCE
    assert axis.total == pytest.approx(np.trace(matrix))
    # Davis and Kahan: the sine of the angle to the true vector is at most the residual over the gap.
    gap = value - np.linalg.eigvalsh(matrix)[-2] if len(matrix) > 1 else value
    if gap > 1e-3 * value:
        sine = np.linalg.norm(axis.vector - (axis.vector @ vector) * vector)
        assert sine <= 2.0 * RESIDUAL_TOLERANCE * value / gap


def _spectral(values: list[float], seed: int = 0) -> np.ndarray:
    """Make a matrix of the given eigenvalues in random directions."""
    basis, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(len(values), len(values))))
    matrix = (basis * values) @ basis.T
    return (matrix + matrix.T) / 2.0


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 40])
@given(seed=SEEDS)
def test_the_exact_axis_is_that_of_the_whole_eigenproblem(size: int, seed: int) -> None:
    """Without a start the leading eigenvector, its value, the second and the trace are those of a full solution."""
    factor = np.random.default_rng(seed).normal(size=(size, size + 2))
    matrix = factor @ factor.T
    axis = leading_axis(matrix)
    assert axis.exact
    _assert_leads(matrix, axis)
    assert axis.runner_up == pytest.approx(np.linalg.eigvalsh(matrix)[-2] if size > 1 else 0.0)
    assert axis.share == pytest.approx(axis.value / np.trace(matrix))
    assert axis.gap == pytest.approx(1.0 - axis.runner_up / axis.value)


@pytest.mark.parametrize(("window", "hop"), [(120, 12), (60, 30), (30, 1), (3, 1)])
def test_real_windows_hop_by_hop(some_clips: tuple[Clip, ...], window: int, hop: int) -> None:
    """Sliding over real motion, each window starting from the last one's answer, every axis is the true one."""
    warm = 0
    for clip in some_clips:
        rows = distance_rows(clip.positions[:180], clip.skeleton)[:, ::5]
        axis = None
        for end in range(window, len(rows) + 1, hop):
            matrix = naive.covariance(rows[end - window : end])
            axis = leading_axis(matrix, axis)
            _assert_leads(matrix, axis)
            warm += not axis.exact
    assert warm > 0


def test_real_windows_of_all_distances(some_clips: tuple[Clip, ...]) -> None:
    """Over all 465 distances warm starts answer most hops, and every answer is the true one up to its sign."""
    exact = []
    for clip in some_clips[::3]:
        rows = distance_rows(clip.positions[:160], clip.skeleton)
        axis = None
        for end in range(120, len(rows) + 1, 10):
            matrix = naive.covariance(rows[end - 120 : end])
            axis = leading_axis(matrix, axis)
            _assert_leads(matrix, axis)
            _, vector = naive.first_axis_by_svd(rows[end - 120 : end])
            assert abs(axis.vector @ vector) == pytest.approx(1.0, abs=1e-9)
            exact.append(axis.exact)
    assert np.mean(exact) < 0.5


@given(seed=SEEDS, strength=st.sampled_from([1e-9, 1e-3, 0.1, 1.0, 10.0]))
def test_a_start_costs_time_never_correctness(seed: int, strength: float) -> None:
    """However far the matrix has moved from the start's, the answer is the leading axis."""
    generator = np.random.default_rng(seed)
    first, second = (generator.normal(size=(25, 6)) * [3.0, 2.0, 1.0, 1.0, 0.5, 0.1] for _ in range(2))
    moved = first + strength * second
    _assert_leads(moved @ moved.T, leading_axis(moved @ moved.T, leading_axis(first @ first.T)))


def test_the_same_matrix_again_needs_no_exact_solution() -> None:
    """Started from its own answer a matrix is answered without the exact solver, and with the same axis."""
    matrix = _spectral([9.0, 4.0, 2.0, 1.0, 0.5, 0.1, 0.0, 0.0])
    first = leading_axis(matrix)
    again = leading_axis(matrix, first)
    assert (first.exact, again.exact) == (True, False)
    assert abs(first.vector @ again.vector) == pytest.approx(1.0, abs=1e-12)
    assert again.runner_up == pytest.approx(4.0)


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_a_small_matrix_may_be_started_warm(size: int) -> None:
    """A matrix no larger than the block of vectors iterated together is answered from a start too."""
    matrix = _spectral([float(size - index) for index in range(size)])
    axis = leading_axis(matrix, leading_axis(matrix + np.eye(size)))
    assert not axis.exact
    _assert_leads(matrix, axis)


#: Reproduced in the tests below.

# --- the certificate ---------------------------------------------------------------------------------------------


def test_an_axis_that_leads_no_more_is_not_handed_out() -> None:
    """An old axis still an exact eigenvector, its residual zero, gives way to one outside all that was tracked."""
    before = np.diag([5.0, 4.0, 3.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    after = np.diag([5.0, 4.0, 3.0, 2.0, 0.0, 0.0, 0.0, 6.0])
    start = leading_axis(before)
    old = start.vector
    assert np.linalg.norm(after @ old - 5.0 * old) == 0.0
    axis = leading_axis(after, start)
    assert abs(axis.vector[7]) == pytest.approx(1.0)
    _assert_leads(after, axis)


@pytest.mark.parametrize("new", [5.0001, 5.5, 6.0, 50.0])
@pytest.mark.parametrize("hidden", [4, 7])
def test_a_start_orthogonal_to_the_leading_vector_does_not_fool_it(new: float, hidden: int) -> None:
    """A start whose whole block is orthogonal to the leading eigenvector ends at that vector nevertheless."""
    start = leading_axis(np.diag([5.0, 0.4, 0.3, 0.2, 0.0, 0.0, 0.0, 0.0]))
    matrix = np.diag([5.0, 0.4, 0.3, 0.2, 0.0, 0.0, 0.0, 0.0])
    matrix[hidden, hidden] = new
    assert np.abs(start.block[hidden]).max() < 1e-12
    _assert_leads(matrix, leading_axis(matrix, start))


@pytest.mark.parametrize("inside", [0.55, 0.6, 0.65])
@pytest.mark.parametrize("leading", [1.2, 1.5])
def test_a_leading_vector_half_hidden_does_not_fool_it(inside: float, leading: float) -> None:
    """A leading vector partly in the block and partly outside, each part below the old axis, is found still."""
    start = leading_axis(np.diag([1.0, 0.9, 0.8, 0.7, 0.0, 0.0, 0.0, 0.0]))
    half_hidden = np.zeros(8)
    half_hidden[1], half_hidden[4] = np.sqrt(inside), np.sqrt(1.0 - inside)
    matrix = leading * np.outer(half_hidden, half_hidden)
    matrix[0, 0] = 1.0
    _assert_leads(matrix, leading_axis(matrix, start))


def test_a_second_vector_half_hidden_is_not_overlooked() -> None:
    """Where a vector half in the block and half outside leads as well, the gap is 0: the axis is arbitrary."""
    start = leading_axis(np.diag([1.0, 0.9, 0.8, 0.7, 0.0, 0.0, 0.0, 0.0]))
    half_hidden = np.zeros(8)
    half_hidden[[1, 4]] = np.sqrt(0.5)
    matrix = np.outer(half_hidden, half_hidden)
    matrix[0, 0] = 1.0
    assert leading_axis(matrix, start).gap == pytest.approx(0.0, abs=1e-9)


@given(seed=SEEDS, values=st.lists(st.sampled_from([0.0, 0.2, 0.9, 1.0, 1.1, 2.0]), min_size=6, max_size=10))
def test_any_start_of_eigenvectors_ends_at_the_leading_one(seed: int, values: list[float]) -> None:
    """Started from the eigenvectors of any other eigenvalues, in the same directions, the answer leads."""
    shuffled = np.random.default_rng(seed).permutation(values).tolist()
    matrix = _spectral(values, seed)
    if matrix.trace() > 1e-9:
        start = leading_axis(_spectral(shuffled, seed))
        _assert_leads(matrix, leading_axis(matrix, start))


# --- degenerate matrices -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1, 2, 5, 465])
@pytest.mark.parametrize("warm", [False, True])
def test_a_matrix_without_variance_has_no_axis_to_speak_of(size: int, *, warm: bool) -> None:
    """A matrix of zeros gives a unit vector, but value, share, gap and residual are 0, and nothing is NaN."""
    zeros = np.zeros((size, size))
    start = leading_axis(_spectral([float(size - index) for index in range(size)])) if warm else None
    axis = leading_axis(zeros, start)
    assert (axis.value, axis.runner_up, axis.total, axis.residual) == (0.0, 0.0, 0.0, 0.0)
    assert (axis.share, axis.gap) == (0.0, 0.0)
    assert np.linalg.norm(axis.vector) == pytest.approx(1.0)


def test_after_a_matrix_without_variance_motion_is_found_again() -> None:
    """The answer for a still window, taken as the start for a moving one, leads to the moving one's axis."""
    matrix = _spectral([3.0, 1.0, 0.5, 0.2, 0.1, 0.0])
    _assert_leads(matrix, leading_axis(matrix, leading_axis(np.zeros((6, 6)))))


def test_one_number_is_its_own_axis() -> None:
    """A single distance has one axis, all of the variance on it and nothing beside it."""
    axis = leading_axis(np.array([[2.5]]))
    assert abs(axis.vector[0]) == pytest.approx(1.0)
    assert (axis.value, axis.runner_up, axis.share, axis.gap) == (2.5, 0.0, 1.0, 1.0)


@pytest.mark.parametrize("warm", [False, True])
def test_two_numbers_as_worked_out_by_hand(*, warm: bool) -> None:
    """[[2, 1], [1, 2]] has the diagonal for its axis, with 3 over 1."""
    start = leading_axis(np.diag([1.0, 2.0])) if warm else None
    axis = leading_axis(np.array([[2.0, 1.0], [1.0, 2.0]]), start)
    np.testing.assert_allclose(np.abs(axis.vector), np.sqrt([0.5, 0.5]))
    assert (axis.value, axis.runner_up) == pytest.approx((3.0, 1.0))
    assert (axis.share, axis.gap) == pytest.approx((0.75, 2 / 3))


@pytest.mark.parametrize("values", [[2.0, 2.0, 1.0, 0.0, 0.0, 0.0], [1.0] * 6, [3.0, 3.0 - 1e-12, 1.0, 0.0, 0.0, 0.0]])
@pytest.mark.parametrize("warm", [False, True])
def test_equal_leading_eigenvalues_leave_no_gap(values: list[float], *, warm: bool) -> None:
    """Where two eigenvalues lead together the gap is about 0, which says that the axis is arbitrary between them."""
    matrix = _spectral(values)
    axis = leading_axis(matrix, leading_axis(matrix) if warm else None)
    assert abs(axis.gap) < 1e-9
    assert axis.value == pytest.approx(values[0])
    assert _residual(matrix, axis) <= RESIDUAL_TOLERANCE


@pytest.mark.parametrize("scale", [1e-12, 1e-6, 1.0, 1e6, 1e12])
def test_the_unit_of_length_does_not_matter(scale: float) -> None:
    """In millimetres or kilometres the axis, share, gap and residual stay, and values go with the unit's square."""
    matrix = _spectral([4.0, 2.0, 1.0, 0.5, 0.1, 0.0])
    expected, axis = leading_axis(matrix), leading_axis(scale * matrix, leading_axis(matrix))
    assert abs(axis.vector @ expected.vector) == pytest.approx(1.0, abs=1e-12)
    assert axis.value == pytest.approx(scale * expected.value)
    assert (axis.share, axis.gap) == pytest.approx((expected.share, expected.gap))
    assert axis.residual <= RESIDUAL_TOLERANCE


def test_neither_matrix_nor_start_is_changed() -> None:
    """Both may be read-only: the solver leaves them as they are."""
    matrix = _spectral([4.0, 2.0, 1.0, 0.5, 0.1, 0.0])
    moved = matrix + _spectral([0.1, 0.0, 0.0, 0.0, 0.0, 0.0], seed=1)
    start = leading_axis(matrix)
    for array in (matrix, moved, start.vector, start.block):
        array.setflags(write=False)
    assert start.block.shape == (6, BLOCK)
    _assert_leads(moved, leading_axis(moved, start))


@pytest.mark.parametrize("shape", [(3, 4), (4, 3), (3,), (3, 3, 3)])
def test_a_matrix_that_is_not_square_is_refused(shape: tuple[int, ...]) -> None:
    """A covariance is square, and the message says what was got."""
    with pytest.raises(ValueError, match=r"covariance: expected a square matrix, got \(" + str(shape[0])):
        leading_axis(np.zeros(shape))


def test_a_start_of_another_size_is_refused() -> None:
    """A start for another number of distances is refused, saying both."""
    with pytest.raises(ValueError, match="start: expected a vector of 6, got 3"):
        leading_axis(np.eye(6), leading_axis(np.eye(3)))
