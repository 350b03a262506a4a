"""The leading axis of a moving window: the same from either matrix, and the whole eigenproblem's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest

from library.distances import distance_rows
from library.eigen import RESIDUAL_TOLERANCE
from stream.leading import CovarianceAxis, GramAxis, RollingAxis
from stream.window import SlidingWindow

if TYPE_CHECKING:
    from library.clip import Clip
    from stream.leading import WindowAxis

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

EITHER = pytest.mark.parametrize("form", [GramAxis, CovarianceAxis])


def _body_size(window: np.ndarray) -> float:
    return float(np.sqrt(np.square(window.mean(axis=0)).mean()))


def _assert_leads(found: WindowAxis, window: np.ndarray, *, gap: float = 0.02) -> None:
    """Hold an answer against the textbook's of the window's rows, and its residual against the true one."""
    body_size, axis = found
    matrix = naive.covariance(window)
    values = np.linalg.eigvalsh(matrix)
    assert body_size == pytest.approx(_body_size(window), rel=1e-12)
    assert np.linalg.norm(axis.vector) == pytest.approx(1.0, abs=1e-12)
    assert axis.value == pytest.approx(values[-1], rel=1e-9)
    assert axis.total == pytest.approx(matrix.trace(), rel=1e-9)
    assert axis.residual <= RESIDUAL_TOLERANCE
    true = np.linalg.norm(matrix @ axis.vector - axis.value * axis.vector) / axis.value
    assert true <= axis.residual + 1e-9
    assert axis.runner_up >= values[-2] * (1.0 - 1e-9)
    if 1.0 - values[-2] / values[-1] >= gap:
        _, vector = naive.first_axis_by_svd(window)
        assert abs(vector @ axis.vector) == pytest.approx(1.0, abs=1e-9)


@EITHER
@pytest.mark.parametrize(("seconds", "hop"), [(0.25, 1), (0.5, 4), (1.0, 16), (0.1, 30)])
def test_real_windows_hop_by_hop(
    some_clips: tuple[Clip, ...], form: type[GramAxis | CovarianceAxis], seconds: float, hop: int
) -> None:
    """Sliding over real motion, with more frames than pairs or fewer, either matrix gives the true axis."""
    warm = checked = 0
    for clip in some_clips[::3]:
        rows = distance_rows(clip.positions[:240], clip.skeleton)[:, ::9]
        window, rolling = SlidingWindow(seconds, rows.shape[1]), form(rows.shape[1])
        for index, row in enumerate(rows, start=1):
            window.push([index / 120], row[None])
            if index % hop == 0:
                rolling.update(*window.take_change(), window.rows)
                if len(window) > 5:
                    found = rolling.leading(window.rows)
                    _assert_leads(found, window.rows)
                    warm += not found.axis.exact
                    checked += 1
    assert checked > 20
    assert warm > checked / 2 or hop == 30


def test_both_matrices_say_the_same(some_clips: tuple[Clip, ...]) -> None:
    """Over all 465 distances, at every hop, the two forms agree on axis, mean and what it is worth."""
    for clip in some_clips[::4]:
        rows = distance_rows(clip.positions[:200], clip.skeleton)
        forms = [GramAxis(465), CovarianceAxis(465)]
        for form in forms:
            form.update(rows[:120], rows[:0], rows[:120])
        for end in range(124, len(rows) + 1, 4):
            window = rows[end - 120 : end]
            found = []
            for form in forms:
                form.update(rows[end - 4 : end], rows[end - 124 : end - 120], window)
                found.append(form.leading(window))
            (body_size, axis), (other_size, other) = found
            assert body_size == pytest.approx(other_size, rel=1e-12)
            assert abs(axis.vector @ other.vector) == pytest.approx(1.0, abs=1e-9)
            assert (axis.value, axis.total) == pytest.approx((other.value, other.total), rel=1e-9)
            assert axis.gap == pytest.approx(other.gap, abs=1e-3)


def test_the_cheaper_matrix_is_used(some_clips: tuple[Clip, ...]) -> None:
    """A window growing and shrinking passes from one matrix to the other and back; every answer stays the true one."""
    rows = distance_rows(some_clips[0].positions, some_clips[0].skeleton)[:, ::8]
    width = rows.shape[1]
    rolling = RollingAxis(width)
    used, start, end = [], 0, 0
    lengths = [10, 30, 40, 52, 57, 60, 90, 60, 57, 52, 48, 20, 90, 5]
    for length in lengths:
        new_end = min(end + 9, len(rows)) if end else 10
        new_end = max(new_end, length)
        new_start = new_end - length
        entered = rows[max(end, new_start) : new_end]
        left = rows[start : min(max(new_start, start), end)]
        if new_start < start:
            rolling.clear()
            entered, left = rows[new_start:new_end], rows[:0]
        start, end = new_start, new_end
        rolling.update(entered, left, rows[start:end])
        used.append((length / width, rolling.by_frames))
        _assert_leads(rolling.leading(rows[start:end]), rows[start:end])
    assert {by_frames for share, by_frames in used if share < 0.85} == {True}
    assert {by_frames for share, by_frames in used if share > 1.0} == {False}
    between = [by_frames for share, by_frames in used if 0.85 <= share <= 1.0]
    assert set(between) == {True, False}


@EITHER
def test_a_sudden_change_is_followed(form: type[GramAxis | CovarianceAxis]) -> None:
    """When another direction takes over within one hop, the new axis is the answer, not the old one's rest."""
    generator = np.random.default_rng(3)
    one, other = np.linalg.qr(generator.normal(size=(50, 2)))[0].T
    rows = 1.0 + 0.001 * generator.normal(size=(120, 50))
    rows[:60] += np.outer(generator.normal(size=60), one)
    rows[60:] += np.outer(5.0 * generator.normal(size=60), other)
    rolling = form(50)
    rolling.update(rows[:60], rows[:0], rows[:60])
    _assert_leads(rolling.leading(rows[:60]), rows[:60])
    for end in range(75, 121, 15):
        window = rows[end - 60 : end]
        rolling.update(rows[end - 15 : end], rows[end - 75 : end - 60], window)
        _assert_leads(rolling.leading(window), window)


@EITHER
def test_without_movement_there_is_no_axis_to_speak_of(form: type[GramAxis | CovarianceAxis]) -> None:
    """Rows that do not change give a unit vector of no worth, and movement afterwards is found."""
    rows = np.concatenate([np.ones((60, 50)), 1.0 + 0.1 * np.random.default_rng(5).normal(size=(60, 50))])
    rolling = form(50)
    rolling.update(rows[:40], rows[:0], rows[:40])
    body_size, axis = rolling.leading(rows[:40])
    assert body_size == pytest.approx(1.0, rel=1e-14)
    assert (axis.value, axis.total, axis.residual, axis.share, axis.gap) == (0.0, 0.0, 0.0, 0.0, 0.0)
    assert np.linalg.norm(axis.vector) == 1.0
    rolling.update(rows[40:120], rows[:40], rows[40:120])
    _assert_leads(rolling.leading(rows[40:120]), rows[40:120])


def test_after_clear_it_answers_as_new(some_clips: tuple[Clip, ...]) -> None:
    """Cleared, it answers the next rows bit for bit as one that was never used."""
    rows = distance_rows(some_clips[1].positions, some_clips[1].skeleton)
    used, new = RollingAxis(465), RollingAxis(465)
    used.update(rows[:100], rows[:0], rows[:100])
    used.leading(rows[:100])
    used.clear()
    for rolling in (used, new):
        rolling.update(rows[20:90], rows[:0], rows[20:90])
    one, other = used.leading(rows[20:90]), new.leading(rows[20:90])
    assert one.axis.vector.tobytes() == other.axis.vector.tobytes()
    assert one.body_size == other.body_size


@EITHER
def test_without_rows_there_is_no_axis(form: type[GramAxis | CovarianceAxis]) -> None:
    """Before the first row asking is the caller's mistake."""
    with pytest.raises(ValueError, match="expected at least one row, got none"):
        form(5).leading(np.empty((0, 5)))


@EITHER
def test_a_single_row_has_its_size(form: type[GramAxis | CovarianceAxis]) -> None:
    """The size of one row's body is the row's, and there is no variance."""
    rows = np.random.default_rng(6).random((1, 5))
    rolling = form(5)
    rolling.update(rows, rows[:0], rows)
    body_size, axis = rolling.leading(rows)
    assert body_size == pytest.approx(_body_size(rows), rel=1e-15)
    assert (axis.value, axis.total) == (0.0, 0.0)
