"""The rolling covariance: what entered added, what left removed, the window's own covariance at every moment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stream.covariance import RollingCovariance

if TYPE_CHECKING:
    from library.signature import Moments

SEEDS = st.integers(0, 2**32 - 1)


def _rows(count: int, width: int = 7, *, seed: int = 0, scale: float = 0.1) -> np.ndarray:
    """Make rows like distances: around a metre, moving by a tenth."""
    generator = np.random.default_rng(seed)
    return 1.0 + generator.random(width) + scale * generator.normal(size=(count, width))


def _assert_right(moments: Moments, window: np.ndarray, tolerance: float = 1e-9) -> None:
    """Hold moments against the window's own, the covariance to a share of its largest entry."""
    exact = naive.covariance(window)
    assert moments.count == len(window)
    assert np.abs(moments.mean - window.mean(axis=0)).max() <= 1e-12 * np.abs(window).max()
    assert np.abs(moments.covariance - exact).max() <= tolerance * np.abs(exact).max()


@given(seed=SEEDS, width=st.sampled_from([1, 2, 7, 30]), scale=st.sampled_from([1e-4, 0.1, 10.0]))
@settings(max_examples=50)
def test_any_coming_and_going_gives_the_windows_own(seed: int, width: int, scale: float) -> None:
    """However many rows enter and leave at each step, count, mean and covariance are the window's own."""
    generator = np.random.default_rng(seed)
    rows = _rows(300, width, seed=seed, scale=scale)
    rolling = RollingCovariance(width)
    start = end = 0
    while end < len(rows):
        new_end = min(end + int(generator.integers(0, 25)), len(rows))
        new_start = int(generator.integers(start, new_end + 1)) if generator.random() < 0.9 else start
        entered, left = rows[max(end, new_start) : new_end], rows[start : min(new_start, end)]
        start, end = new_start, new_end
        rolling.update(entered, left, rows[start:end])
        assert len(rolling) == end - start
        if end > start:
            _assert_right(rolling.moments(), rows[start:end])


def test_steps_of_any_size_give_the_same() -> None:
    """One row at a time, a few at a time and all at once end at the same covariance."""
    rows = _rows(120)
    results = []
    for step in (1, 7, 60):
        rolling = RollingCovariance(7)
        rolling.update(rows[:60], rows[:0], rows[:60])
        for start in range(0, 60, step):
            stop = min(start + step, 60)
            rolling.update(rows[60 + start : 60 + stop], rows[start:stop], rows[stop : 60 + stop])
        results.append(rolling.moments().covariance.copy())
    assert np.allclose(results[0], results[1], rtol=1e-11, atol=0.0)
    assert np.allclose(results[0], results[2], rtol=1e-11, atol=0.0)


def test_what_came_and_left_again_leaves_no_trace() -> None:
    """Removing the rows that were added gives back the covariance from before."""
    rows = _rows(50)
    rolling = RollingCovariance(7)
    rolling.update(rows[:40], rows[:0], rows[:40])
    before = rolling.moments().covariance.copy()
    rolling.update(rows[40:], rows[:0], rows)
    assert not np.allclose(rolling.moments().covariance, before, rtol=1e-3)
    rolling.update(rows[:0], rows[40:], rows[:40])
    assert np.allclose(rolling.moments().covariance, before, rtol=1e-11, atol=0.0)


def test_one_row_has_no_covariance() -> None:
    """Of a single row the mean is the row and the covariance zero, also when others were there before."""
    rows = _rows(20)
    rolling = RollingCovariance(7)
    rolling.update(rows[:1], rows[:0], rows[:1])
    assert not rolling.moments().covariance.any()
    rolling.update(rows[1:], rows[:19], rows[19:])
    moments = rolling.moments()
    assert moments.mean == pytest.approx(rows[19])
    assert not moments.covariance.any()


def test_after_clear_it_is_as_new() -> None:
    """Cleared, it has no row and no moments, and what comes next is all there is."""
    rows = _rows(60)
    rolling = RollingCovariance(7)
    rolling.update(rows[:40], rows[:0], rows[:40])
    rolling.clear()
    assert len(rolling) == 0
    with pytest.raises(ValueError, match="at least one row"):
        rolling.moments()
    rolling.update(rows[40:], rows[:0], rows[40:])
    _assert_right(rolling.moments(), rows[40:])


def test_without_rows_there_are_no_moments() -> None:
    """Before the first row, and after the last has left, asking raises; then rows may come again."""
    rows = _rows(10)
    rolling = RollingCovariance(7)
    with pytest.raises(ValueError, match="moments: expected at least one row"):
        rolling.moments()
    rolling.update(rows, rows[:0], rows)
    rolling.update(rows[:0], rows, rows[:0])
    assert len(rolling) == 0
    with pytest.raises(ValueError, match="moments: expected at least one row"):
        rolling.moments()
    rolling.update(rows, rows[:0], rows)
    _assert_right(rolling.moments(), rows)


@pytest.mark.parametrize("held", [9, 11, 0])
def test_a_window_of_another_length_is_refused(held: int) -> None:
    """A window that does not hold what was added and not removed is the caller's mistake and changes nothing."""
    rows = _rows(30)
    rolling = RollingCovariance(7)
    rolling.update(rows[:8], rows[:0], rows[:8])
    with pytest.raises(ValueError, match=f"window: expected 10 rows, got {held}"):
        rolling.update(rows[8:11], rows[:1], rows[1 : 1 + held])
    _assert_right(rolling.moments(), rows[:8])


def test_the_rows_are_not_changed() -> None:
    """Neither what entered, nor what left, nor the window is written to."""
    rows = _rows(60)
    rows.setflags(write=False)
    rolling = RollingCovariance(7)
    rolling.update(rows[:40], rows[:0], rows[:40])
    rolling.update(rows[40:], rows[:20], rows[20:])
    _assert_right(rolling.moments(), rows[20:])


@given(seed=SEEDS)
@settings(max_examples=40)
def test_the_covariance_is_symmetric(seed: int) -> None:
    """Over many steps the matrix stays symmetric to rounding, so that one triangle says what the other does."""
    rows = _rows(400, 12, seed=seed)
    rolling = RollingCovariance(12)
    rolling.update(rows[:60], rows[:0], rows[:60])
    for start in range(0, 340, 5):
        rolling.update(rows[60 + start : 65 + start], rows[start : start + 5], rows[5 + start : 65 + start])
    matrix = rolling.moments().covariance
    assert np.abs(matrix - matrix.T).max() <= 1e-13 * np.abs(matrix).max()
    assert np.linalg.eigvalsh(matrix)[0] >= -1e-12 * np.trace(matrix)


@pytest.mark.parametrize("scale", [1.0, 1000.0, 1e-3])
def test_a_body_that_does_not_move_has_no_covariance(scale: float) -> None:
    """A pose held to the last digit, right after motion or from the start, leaves zeros and not rounding's signs."""
    for seed in range(20):
        moving = _rows(90, seed=seed) * scale
        pose = np.repeat(moving[-1:], 200, axis=0)
        rows = np.concatenate([moving, pose])
        rolling = RollingCovariance(7)
        rolling.update(rows[:30], rows[:0], rows[:30])
        for start in range(0, len(rows) - 31, 3):
            rolling.update(rows[30 + start : 33 + start], rows[start : start + 3], rows[3 + start : 33 + start])
            diagonal = rolling.moments().covariance.diagonal()
            if start >= 90:
                assert not diagonal.any()
            assert diagonal.min() >= 0.0


def test_the_smallest_movement_is_still_seen() -> None:
    """Movement of a millionth of the body's size, below any sensor's noise, is measured and not taken for none."""
    rows = _rows(100, scale=1e-6)
    rolling = RollingCovariance(7)
    rolling.update(rows[:50], rows[:0], rows[:50])
    rolling.update(rows[50:], rows[:50], rows[50:])
    _assert_right(rolling.moments(), rows[50:])


def test_rows_of_nothing_but_zeros() -> None:
    """A body whose joints all lie in one point has a covariance of zeros, and a mean of zeros."""
    rows = np.zeros((40, 7))
    rolling = RollingCovariance(7)
    rolling.update(rows[:20], rows[:0], rows[:20])
    rolling.update(rows[20:], rows[:20], rows[20:])
    moments = rolling.moments()
    assert not moments.mean.any()
    assert not moments.covariance.any()


def test_the_first_rows_and_the_refreshes_are_counted() -> None:
    """The counter tells how often everything was computed afresh: at first, and after a stop, but not while moving."""
    rows = np.concatenate([_rows(1000), _rows(60, scale=1e-6)])
    rolling = RollingCovariance(7)
    counted = []
    rolling.update(rows[:60], rows[:0], rows[:60])
    for end in range(61, len(rows) + 1):
        rolling.update(rows[end - 1 : end], rows[end - 61 : end - 60], rows[end - 60 : end])
        counted.append(rolling.refreshes)
    assert counted[0] == counted[938] == 1
    assert counted[-1] > 1
    _assert_right(rolling.moments(), rows[-60:])
