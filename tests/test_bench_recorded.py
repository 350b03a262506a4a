"""The recordings the bench plays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from library import MotionLibrary
from tools.bench import recorded
from tools.bench.recorded import Feed

if TYPE_CHECKING:
    from pathlib import Path


def test_a_feed_goes_on_for_ever_and_knows_its_last_frames() -> None:
    """Frames come in their order, 1/120 s apart, begin again after the last, and the last ones can be asked for."""
    positions = np.arange(5 * 2 * 3, dtype=np.float32).reshape(5, 2, 3)
    feed = Feed(positions, "me", begin=3)
    frames = [*feed.take(4), feed.next()]
    assert [frame.performer for frame in frames] == ["me"] * 5
    np.testing.assert_array_equal([frame.positions for frame in frames], positions[[3, 4, 0, 1, 2]])
    np.testing.assert_allclose(np.diff([frame.time for frame in frames]), 1 / 120)
    np.testing.assert_array_equal(feed.last(3), positions[[0, 1, 2]])
    assert frames[0].time > 0


@pytest.mark.parametrize("rate_hz", [60.0, 120.0, 240.0, 100.0])
def test_another_rate_shows_the_same_movement(rate_hz: float) -> None:
    """What moves evenly still does at another rate, over the same seconds."""
    evenly = np.arange(121)[:, None, None] / 120 * np.ones((1, 2, 3))
    again = recorded.resampled(evenly, rate_hz)
    assert again.dtype == np.float32
    np.testing.assert_allclose(again[:, 0, 0], np.arange(len(again)) / rate_hz, atol=1e-6)
    assert len(again) == pytest.approx(rate_hz, abs=1)


@pytest.mark.parametrize("there", [(), ("cmu",), ("hdm05_cut_amc",)])
def test_a_folder_without_the_recordings_is_refused(there: tuple[str, ...], tmp_path: Path) -> None:
    """What is not the recordings' folder is refused by name, and so is no folder at all."""
    for name in there:
        (tmp_path / name).mkdir()
    with pytest.raises(ValueError, match=r"--data: expected a folder with hdm05_cut_amc/ and cmu/ in it, got .*pytest"):
        recorded.read(tmp_path)


def test_all_recordings_are_read(data_folder: Path, hdm05_folder: Path, cmu_folder: Path) -> None:
    """All clips and takes are read, the takes with their labels in the library's names, one example of each class."""
    found = recorded.read(data_folder)
    assert len(found.clips) == len([path for path in hdm05_folder.rglob("*") if path.suffix.lower() == ".amc"])
    assert len(found.takes) == len(list(cmu_folder.glob("*.amc")))
    classes = MotionLibrary.builtin().classes
    assert sorted(clip.class_name for clip in found.examples) == list(classes)
    labels = {segment.label for segments in found.segments for segment in segments}
    assert {"squat1Reps", "rotateArmsBothBackward1Reps"} <= labels
    assert "Squat" not in labels
    assert found.positions.shape[1:] == (31, 3)
    assert len(found.positions) > sum(take.frames for take in found.takes)
