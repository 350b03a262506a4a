"""The rolling mean and deviation: what entered added, what left removed, the window's own at every moment."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stream.variance import RollingVariance, means_and_deviations

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

SEEDS = st.integers(0, 2**32 - 1)
NO_ROWS = np.empty((0, 5))


def _rows(count: int, width: int = 5, *, seed: int = 0, scale: float = 0.1) -> np.ndarray:
    """Make rows like distances: around a metre, moving by a tenth."""
    generator = np.random.default_rng(seed)
    return 1.0 + generator.random(width) + scale * generator.normal(size=(count, width))


def _assert_right(rolling: RollingVariance, window: np.ndarray, tolerance: float = 1e-9) -> None:
    """Hold mean and variance against numpy's, the variance to a share of its largest."""
    exact = np.var(window, axis=0, ddof=1) if len(window) > 1 else np.zeros(window.shape[1])
    assert len(rolling) == len(window)
    assert np.abs(rolling.mean() - window.mean(axis=0)).max() <= 1e-12 * np.abs(window).max()
    assert np.abs(np.square(rolling.deviation()) - exact).max() <= tolerance * exact.max()


def _slide(rolling: RollingVariance, rows: np.ndarray, length: int, step: int, tolerance: float = 1e-9) -> None:
    """Slide a window over rows, checked after every update."""
    start = end = 0
    while end < len(rows):
        new_end = min(end + step, len(rows))
        new_start = max(start, new_end - length)
        rolling.update(rows[max(end, new_start) : new_end], rows[start : min(new_start, end)], rows[new_start:new_end])
        start, end = new_start, new_end
        _assert_right(rolling, rows[start:end], tolerance)


@given(seed=SEEDS, width=st.sampled_from([1, 2, 30]), scale=st.sampled_from([1e-4, 0.1, 10.0]))
@settings(max_examples=40)
def test_any_coming_and_going_gives_the_windows_own(seed: int, width: int, scale: float) -> None:
    """However many rows enter and leave at each step, count, mean and variance are numpy's of the window."""
    generator = np.random.default_rng(seed)
    rows = _rows(200, width, seed=seed, scale=scale)
    rolling = RollingVariance(width)
    start = end = 0
    while end < len(rows):
        new_end = min(end + int(generator.integers(0, 25)), len(rows))
        new_start = int(generator.integers(start, new_end + 1)) if generator.random() < 0.9 else start
        entered, left = rows[max(end, new_start) : new_end], rows[start : min(new_start, end)]
        start, end = new_start, new_end
        rolling.update(entered, left, rows[start:end])
        assert len(rolling) == end - start
        if end > start:
            _assert_right(rolling, rows[start:end])


def test_of_several_windows_they_are_those_of_each() -> None:
    """Gathered in one go, mean and deviation of windows of any lengths are those that each gives."""
    windows = [RollingVariance(5) for _ in range(4)]
    for seed, (window, count) in enumerate(zip(windows, (1, 2, 30, 100), strict=True)):
        rows = _rows(count, seed=seed)
        window.update(rows, NO_ROWS, rows)
        later = _rows(count + 3, seed=seed)[3:]
        if count > 3:
            window.update(later[-3:], rows[:3], later)
    means, deviations = means_and_deviations(windows)
    for window, mean, deviation in zip(windows, means, deviations, strict=True):
        assert mean == pytest.approx(window.mean(), rel=1e-14)
        assert deviation == pytest.approx(window.deviation(), rel=1e-9)


@pytest.mark.parametrize("unit", [1.0, 1000.0])
@pytest.mark.parametrize("scale", [1e-3, 1.0])
def test_millimetres_and_metres_are_as_exact(unit: float, scale: float) -> None:
    """Movements of a millimetre and of a metre, in either unit, keep nine digits after every update."""
    _slide(RollingVariance(5), unit * _rows(600, scale=scale), length=60, step=3)


@pytest.mark.parametrize("quiet", [1e-3, 1e-5])
def test_stillness_right_after_motion_is_exact(quiet: float) -> None:
    """When metres of movement leave and a trembling of a millimetre or less stays, its variance is its own."""
    rows = np.concatenate([_rows(200, scale=1.0), _rows(200, seed=1, scale=quiet), _rows(100, seed=2, scale=1.0)])
    _slide(RollingVariance(5), rows, length=50, step=1, tolerance=1e-8)


def test_a_body_that_stops_dead_does_not_deviate() -> None:
    """Once all that moved has left, the deviation of rows that do not move at all is below a ten thousandth mm."""
    still = np.tile(_rows(1), (100, 1))
    rows = np.concatenate([_rows(100), still])
    rolling = RollingVariance(5)
    rolling.update(rows[:100], NO_ROWS, rows[:100])
    for end in range(101, 201):
        rolling.update(rows[end - 1 : end], rows[end - 101 : end - 100], rows[end - 100 : end])
    assert rolling.deviation().max() < 1e-7
    assert rolling.mean() == pytest.approx(still[0])


def test_one_distance_that_stops_is_not_lost_among_those_that_move() -> None:
    """A distance that trembles by a centimetre after it swung a metre keeps its own variance beside swinging others."""
    rows = _rows(600, scale=1.0)
    rows[300:, 2] = 1.0 + 0.01 * np.random.default_rng(3).normal(size=300)
    rolling = RollingVariance(5)
    rolling.update(rows[:100], NO_ROWS, rows[:100])
    for end in range(101, 601):
        rolling.update(rows[end - 1 : end], rows[end - 101 : end - 100], rows[end - 100 : end])
        assert rolling.deviation() == pytest.approx(np.std(rows[end - 100 : end], axis=0, ddof=1), rel=1e-6)


def test_an_hour_of_drift_loses_nothing() -> None:
    """After a hundred thousand rows that wander ten metres away, mean and variance are the last window's own."""
    generator = np.random.default_rng(8)
    rows = 1.0 + np.cumsum(0.01 * generator.normal(size=(100_000, 5)), axis=0) + np.linspace(0, 10, 100_000)[:, None]
    rolling = RollingVariance(5)
    rolling.update(rows[:120], NO_ROWS, rows[:120])
    for end in range(160, len(rows) + 1, 40):
        rolling.update(rows[end - 40 : end], rows[end - 160 : end - 120], rows[end - 120 : end])
        if end % 8000 == 0:
            _assert_right(rolling, rows[end - 120 : end])
    _assert_right(rolling, rows[-120:])


def test_one_row_does_not_deviate() -> None:
    """Of a single row the mean is the row and the deviation zero, also when others were there before."""
    rows = _rows(20)
    rolling = RollingVariance(5)
    rolling.update(rows[:1], NO_ROWS, rows[:1])
    assert not rolling.deviation().any()
    rolling.update(rows[1:], rows[:19], rows[19:])
    assert rolling.mean() == pytest.approx(rows[19])
    assert rolling.deviation().max() < 1e-6


def test_after_clear_it_is_as_new() -> None:
    """Cleared, it has no row, and what comes next is all there is."""
    rows = _rows(60)
    rolling = RollingVariance(5)
    rolling.update(rows[:40], NO_ROWS, rows[:40])
    rolling.clear()
    assert len(rolling) == 0
    rolling.update(rows[40:], NO_ROWS, rows[40:])
    _assert_right(rolling, rows[40:])


def test_a_window_of_other_rows_than_told_is_refused() -> None:
    """A window with another number of rows than entered and stayed is refused, and the error says how many."""
    rows = _rows(10)
    with pytest.raises(ValueError, match="window: expected 4 rows, got 5"):
        RollingVariance(5).update(rows[:4], NO_ROWS, rows[:5])
