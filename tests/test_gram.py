"""The rolling Gram matrix: the inner products of a window's frames, right at every moment and never adrift."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from library.distances import distance_rows
from stream.gram import RollingGram
from stream.window import SlidingWindow

if TYPE_CHECKING:
    from library.clip import Clip

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

SEEDS = st.integers(0, 2**32 - 1)


def _rows(count: int, width: int = 40, *, seed: int = 0, scale: float = 0.1) -> np.ndarray:
    """Make rows like distances: around a metre, moving by a tenth."""
    generator = np.random.default_rng(seed)
    return 1.0 + generator.random(width) + scale * generator.normal(size=(count, width))


def _error(rolling: RollingGram, window: np.ndarray) -> float:
    """Compare with the window's own products, relative to the largest."""
    exact = naive.gram(window)
    return float(np.abs(rolling.centred(window).dense() - exact).max() / np.abs(exact).max())


@given(seed=SEEDS, width=st.sampled_from([1, 2, 40]), scale=st.sampled_from([1e-3, 0.1, 10.0]))
@settings(max_examples=40)
def test_any_coming_and_going_gives_the_windows_own(seed: int, width: int, scale: float) -> None:
    """However many rows enter and leave at each step, over many moves of the memory, the products are the window's."""
    generator = np.random.default_rng(seed)
    rows = _rows(400, width, seed=seed, scale=scale)
    rolling = RollingGram(width)
    start = end = 0
    while end < len(rows):
        new_end = min(end + int(generator.integers(0, 40)), len(rows))
        new_start = int(generator.integers(start, new_end + 1)) if generator.random() < 0.9 else start
        entered, left = rows[max(end, new_start) : new_end], rows[start : min(new_start, end)]
        start, end = new_start, new_end
        window = rows[start:end]
        rolling.update(entered, left, window)
        assert len(rolling) == len(window)
        if len(window) > 1:
            assert _error(rolling, window) <= 1e-9
            centred = rolling.centred(window)
            assert centred.total == pytest.approx(np.square(window - window.mean(axis=0)).sum(), rel=1e-9)


@given(seed=SEEDS, count=st.integers(2, 90))
def test_it_multiplies_as_it_is_written_out(seed: int, count: int) -> None:
    """Vectors whose numbers add up to 0 are multiplied as by the matrix in full, and the results add up to 0."""
    rows = _rows(count, seed=seed)
    rolling = RollingGram(40)
    rolling.update(rows, rows[:0], rows)
    vectors = np.random.default_rng(seed).normal(size=(3, count))
    vectors -= vectors.mean(axis=1, keepdims=True)
    centred = rolling.centred(rows)
    assert len(centred) == count
    products = centred.times(vectors)
    assert np.allclose(products, vectors @ naive.gram(rows), rtol=1e-9, atol=1e-12)
    assert np.abs(products.sum(axis=1)).max() <= 1e-12 * np.abs(products).max() * count


def test_the_matrix_is_symmetric_to_the_last_bit() -> None:
    """One triangle says exactly what the other does, after many steps too."""
    rows = _rows(400)
    rolling = RollingGram(40)
    rolling.update(rows[:60], rows[:0], rows[:60])
    for start in range(0, 340, 5):
        rolling.update(rows[60 + start : 65 + start], rows[start : start + 5], rows[5 + start : 65 + start])
    matrix = rolling.centred(rows[340:]).dense()
    assert np.array_equal(matrix, matrix.T)
    assert np.linalg.eigvalsh(matrix)[0] >= -1e-12 * np.trace(matrix)


def test_real_clips_after_every_hop(some_clips: tuple[Clip, ...]) -> None:
    """On real motion, all 465 distances, in metres and millimetres, the products stay exact without a refresh."""
    for clip, unit in zip(some_clips[::2], (1.0, 1000.0) * len(some_clips), strict=False):
        rows = distance_rows(clip.positions, clip.skeleton) * unit
        window, rolling = SlidingWindow(0.5, rows.shape[1]), RollingGram(rows.shape[1])
        for end, row in enumerate(rows, start=1):
            window.push([end / 120], row[None])
            if end % 12 == 0:
                rolling.update(*window.take_change(), window.rows)
                centred = window.rows - window.rows.mean(axis=0)
                exact = centred @ centred.T
                dense = rolling.centred(window.rows).dense()
                assert np.abs(dense - exact).max() <= 1e-9 * np.abs(exact).max(), clip.name
        assert rolling.refreshes == 1


@pytest.mark.parametrize("noise", [1e-3, 1e-5, 1e-6])
@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_still_right_after_moving(noise: float, unit: float) -> None:
    """When the rows stop and only waver, from whatever far place they came, the products are those of the wavering."""
    moving = np.cumsum(_rows(200, scale=0.05) - _rows(200, scale=0.0), axis=0) + _rows(1, scale=0.0)
    rows = unit * np.concatenate([moving, moving[-1] + noise * np.random.default_rng(1).normal(size=(200, 40))])
    rolling = RollingGram(40)
    rolling.update(rows[:60], rows[:0], rows[:60])
    for end in range(65, len(rows) + 1, 5):
        rolling.update(rows[end - 5 : end], rows[end - 65 : end - 60], rows[end - 60 : end])
        assert _error(rolling, rows[end - 60 : end]) <= 1e-6
    assert rolling.refreshes <= 20


@pytest.mark.parametrize("scale", [1.0, 1000.0, 1e-3])
def test_a_body_that_does_not_move_has_no_products(scale: float) -> None:
    """A pose held to the last digit, right after motion or from the start, leaves a total of 0."""
    for seed in range(10):
        moving = _rows(90, seed=seed) * scale
        rows = np.concatenate([moving, np.repeat(moving[-1:], 200, axis=0)])
        rolling = RollingGram(40)
        rolling.update(rows[:30], rows[:0], rows[:30])
        for start in range(0, len(rows) - 33, 3):
            window = rows[3 + start : 33 + start]
            rolling.update(rows[30 + start : 33 + start], rows[start : start + 3], window)
            total = rolling.centred(window).total
            assert (total == 0.0) == (start + 3 >= 89)
            assert total >= 0.0


def test_nothing_drifts() -> None:
    """After a hundred thousand rows the products are as exact as at first, and were computed afresh not once."""
    rolling, rows = RollingGram(12), np.empty((0, 12))
    for piece in range(20):
        rows = np.concatenate([rows[-50:], _rows(5000, 12, seed=piece)])
        if not piece:
            rolling.update(rows[:50], rows[:0], rows[:50])
        for end in range(60, len(rows) + 1, 10):
            rolling.update(rows[end - 10 : end], rows[end - 60 : end - 50], rows[end - 50 : end])
        assert _error(rolling, rows[-50:]) <= 1e-12
    assert rolling.refreshes == 1


def test_after_clear_it_is_as_new() -> None:
    """Cleared, it has no row and no products, and what comes next is all there is."""
    rows = _rows(60)
    rolling = RollingGram(40)
    rolling.update(rows[:40], rows[:0], rows[:40])
    rolling.clear()
    assert len(rolling) == 0
    with pytest.raises(ValueError, match="centred: expected at least one row, got none"):
        rolling.centred(rows[:0])
    rolling.update(rows[40:], rows[:0], rows[40:])
    assert _error(rolling, rows[40:]) <= 1e-9


def test_one_row_has_none() -> None:
    """A single row does not deviate from its mean."""
    rows = _rows(20)
    rolling = RollingGram(40)
    rolling.update(rows, rows[:0], rows)
    rolling.update(rows[:0], rows[:19], rows[19:])
    assert rolling.centred(rows[19:]).total == 0.0


@pytest.mark.parametrize("held", [9, 11, 0])
def test_a_window_of_another_length_is_refused(held: int) -> None:
    """A window that does not hold what was added and not removed is the caller's mistake and changes nothing."""
    rows = _rows(30)
    rolling = RollingGram(40)
    rolling.update(rows[:8], rows[:0], rows[:8])
    with pytest.raises(ValueError, match=f"window: expected 10 rows, got {held}"):
        rolling.update(rows[8:11], rows[:1], rows[1 : 1 + held])
    assert _error(rolling, rows[:8]) <= 1e-9


def test_the_rows_are_not_changed() -> None:
    """Neither what entered, nor what left, nor the window is written to."""
    rows = _rows(60)
    rows.setflags(write=False)
    rolling = RollingGram(40)
    rolling.update(rows[:40], rows[:0], rows[:40])
    rolling.update(rows[40:], rows[:20], rows[20:])
    assert _error(rolling, rows[20:]) <= 1e-9
