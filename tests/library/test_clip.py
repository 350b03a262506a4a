"""The clip: joint positions over time, checked once when it is made."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import STICK

from kinespace.library.clip import Clip


@pytest.mark.parametrize(("frames", "rate"), [(1, 120.0), (60, 30.0), (301, 240.0)])
def test_a_clip_measures_its_time_from_its_first_frame(frames: int, rate: float) -> None:
    """Frame i is at i / rate seconds, and the duration reaches to the end of the last frame."""
    clip = Clip(STICK, np.zeros((frames, 6, 3)), rate)
    assert clip.frames == frames
    assert clip.duration == pytest.approx(frames / rate)
    assert clip.times.tolist() == pytest.approx([index / rate for index in range(frames)])


@pytest.mark.parametrize("shape", [(0, 6, 3), (5, 5, 3), (5, 6, 2), (6, 3), (1, 5, 6, 3)])
def test_positions_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    """Positions are (frames, joints, 3) with at least one frame; the message gives the shape got."""
    with pytest.raises(ValueError, match=r"positions: expected \(frames, 6, 3\), got \(" + str(shape[0])):
        Clip(STICK, np.zeros(shape), 120.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_positions_that_are_not_finite_are_refused(value: float) -> None:
    """One coordinate that is not a number of metres spoils the clip, which is named."""
    positions = np.zeros((9, 6, 3))
    positions[8, 5, 2] = value
    with pytest.raises(ValueError, match="positions: expected finite metres, got NaN or infinity in clip 'kick'"):
        Clip(STICK, positions, 120.0, name="kick")


@pytest.mark.parametrize("rate", [0.0, -120.0, np.nan, np.inf])
def test_a_frame_rate_is_positive(rate: float) -> None:
    """A clip without a positive, finite frame rate has no time."""
    with pytest.raises(ValueError, match="frame_rate: expected a positive number of frames per second, got"):
        Clip(STICK, np.zeros((2, 6, 3)), rate)


def test_lists_of_numbers_are_positions() -> None:
    """Lists and whole numbers become doubles; texts and ragged lists are refused."""
    clip = Clip(STICK, [[[1, 2, 3]] * 6] * 2, 120)  # type: ignore[arg-type]
    assert clip.positions.dtype == np.float64
    assert clip.positions.tolist() == [[[1.0, 2.0, 3.0]] * 6] * 2
    for wrong in ([["a"]], [[[1, 2, 3]], [[1]]], None):
        with pytest.raises(ValueError, match="positions: expected numbers, got"):
            Clip(STICK, wrong, 120)  # type: ignore[arg-type]


def test_parameters_of_another_type_are_refused() -> None:
    """A text is no frame rate, and a list of joints is no skeleton."""
    with pytest.raises(ValueError, match="frame_rate: expected a positive number of frames per second, got '60'"):
        Clip(STICK, np.zeros((2, 6, 3)), "60")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="skeleton: expected a Skeleton, got tuple"):
        Clip(STICK.joints, np.zeros((2, 6, 3)), 60.0)  # type: ignore[arg-type]
