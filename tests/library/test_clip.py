"""The clip: joint positions over time, checked once when it is made."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from synthetic import STICK, stick_clip

from kinespace.library.clip import Clip


@pytest.mark.parametrize(("frames", "rate"), [(1, 120.0), (60, 30.0), (301, 240.0)])
def test_a_clip_measures_its_time_from_its_first_frame(frames: int, rate: float) -> None:
    """Frame i is at i / rate seconds, and the duration reaches to the end of the last frame."""
    clip = Clip(STICK, np.zeros((frames, 6, 3)), rate)
    assert clip.frames == frames
    assert clip.duration == pytest.approx(frames / rate)
    assert clip.times.tolist() == pytest.approx([index / rate for index in range(frames)])


def test_a_moved_clip_keeps_its_labels() -> None:
    """Other positions make a new clip with the same labels; the old clip does not change."""
    clip = stick_clip("wave", seed=4, actor="bb")
    before = clip.positions.copy()
    moved = clip.moved_to(clip.positions + 1.0)
    assert np.array_equal(moved.positions, before + 1.0)
    assert np.array_equal(clip.positions, before)
    assert (moved.skeleton, moved.name, moved.class_name, moved.actor, moved.take, moved.frame_rate) == (
        STICK,
        "wave_4",
        "wave",
        "bb",
        "004",
        120.0,
    )


def test_a_clip_of_unknown_source_has_empty_labels_and_no_rotations() -> None:
    """By default the labels are empty and there are no rotations."""
    clip = Clip(STICK, np.zeros((2, 6, 3)), 120.0)
    assert (clip.name, clip.class_name, clip.actor, clip.take) == ("", "", "", "")
    assert clip.rotations.shape[1] == 0


def test_a_clip_does_not_change() -> None:
    """A clip's fields cannot be set anew."""
    with pytest.raises(dataclasses.FrozenInstanceError):
        stick_clip("wave").frame_rate = 60.0


@pytest.mark.parametrize(
    "shape",
    [
        pytest.param((0, 6, 3), id="no frame"),
        pytest.param((5, 5, 3), id="a joint missing"),
        pytest.param((5, 6, 2), id="flat"),
        pytest.param((6, 3), id="one frame alone"),
        pytest.param((5, 18), id="joints run together"),
        pytest.param((1, 5, 6, 3), id="a stack of clips"),
    ],
)
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
