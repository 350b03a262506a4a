from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from kinespace.library import MotionLibrary, distance_rows
from kinespace.library.signature.body import Body
from kinespace.stream.recognizer.windows.smoothing import NOISY, RowSmoother


@cache
def _rows(noise: float, rate: float = 30.0) -> tuple[list[float], np.ndarray, np.ndarray]:
    """Give times, clean rows and noisy rows of a real motion; noise in metres on every coordinate."""
    clip = max(MotionLibrary.builtin().motions, key=lambda each: each.frames)
    step = max(1, round(clip.frame_rate / rate))
    positions = clip.positions[::step]
    shaken = positions + np.random.default_rng(3).normal(0, noise, positions.shape)
    times = (np.arange(len(positions)) * step / clip.frame_rate).tolist()
    return times, distance_rows(positions, clip.skeleton), distance_rows(shaken, clip.skeleton)


def _smoother() -> RowSmoother:
    skeleton = MotionLibrary.builtin().skeleton
    return RowSmoother(Body.of(skeleton).segments, len(skeleton.pairs))


def _smoothed(smoother: RowSmoother, times: list[float], rows: np.ndarray, together: int = 1) -> np.ndarray:
    smooth = rows.copy()
    for begin in range(0, len(times), together):
        smoother.smooth(times[begin : begin + together], smooth[begin : begin + together])
    return smooth


def test_a_clean_feed_is_unchanged() -> None:
    """A recording's own rows pass through, number for number."""
    times, clean, _ = _rows(0.0)
    smoother = _smoother()
    assert np.array_equal(_smoothed(smoother, times, clean), clean)
    assert smoother.noise < NOISY / 4


@pytest.mark.parametrize("noise", [0.01, 0.02, 0.03])
@pytest.mark.parametrize("segments", [True, False])
def test_the_noise_is_estimated(noise: float, *, segments: bool) -> None:
    """A distance between two shaken joints has √2 times the noise of a coordinate; without segments all pairs tell."""
    times, _, shaken = _rows(noise)
    smoother = _smoother() if segments else RowSmoother(np.empty(0, dtype=np.intp), shaken.shape[1])
    _smoothed(smoother, times[:60], shaken[:60], 60)
    assert smoother.noise == pytest.approx(noise * np.sqrt(2), rel=0.2)


@pytest.mark.parametrize("together", [1, 4])
def test_a_noisy_feed_comes_nearer_to_the_clean_one(together: int) -> None:
    """Each row is the mean of the last tenth of a second, however many come at once; after a clear a feed is clean."""
    times, clean, shaken = _rows(0.03)
    smoother = _smoother()
    smooth = _smoothed(smoother, times[:160], shaken[:160], together)
    before, after = (np.abs(each[:160] - clean[:160])[10:].mean() for each in (shaken, smooth))
    assert after < 0.8 * before
    # Long after its memory has moved back.
    for end in range(40, 160):
        assert np.allclose(smooth[end], shaken[end - 2 : end + 1].mean(axis=0))
    smoother.clear()
    assert smoother.noise == 0
    assert np.array_equal(_smoothed(smoother, times[:1], shaken[:1]), shaken[:1])
