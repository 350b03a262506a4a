"""The positions that the bench plays."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from recorded import write_takes

from kinespace.library import MotionLibrary, Skeleton
from kinespace.tools.bench import recorded
from kinespace.tools.bench.recorded import Feed
from kinespace.tools.feeding.feed import resampled

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


def test_motions_of_every_class_are_played() -> None:
    """Without a folder every eighth motion of the built-in library is played, twice as many frames a second."""
    library = MotionLibrary.builtin()
    positions, motions = recorded.positions(), library.motions[::8]
    assert {motion.class_name for motion in motions} == set(library.classes)
    assert positions.shape == (sum(2 * motion.frames - 1 for motion in motions), 31, 3)
    np.testing.assert_allclose(positions[: 2 * motions[0].frames : 2], motions[0].positions, atol=1e-5)


def test_a_folders_recordings_are_played_instead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Recordings of a folder are read until there is enough, in the built-in library's order of joints."""
    library = MotionLibrary.builtin()
    clips = [resampled(motion, 120.0) for motion in library.motions[:3]]
    names = library.skeleton.joints[::-1]
    turned = replace(clips[0], skeleton=Skeleton(names), positions=clips[0].positions[:, ::-1])
    monkeypatch.setattr(recorded, "find_recordings", lambda places: places)
    monkeypatch.setattr(
        recorded, "read_recordings", lambda places: iter([turned, *clips[1:]] if places == [tmp_path] else [])
    )
    monkeypatch.setattr(recorded, "_MAX_SECONDS", clips[0].duration + 0.1)
    positions = recorded.positions(tmp_path)
    assert len(positions) == round((clips[0].duration + 0.1) * 120)
    np.testing.assert_array_equal(positions[: clips[0].frames], clips[0].positions.astype(np.float32))


def test_recordings_of_another_body_are_refused(tmp_path: Path) -> None:
    """A folder without recordings, and recordings with other joints, are refused in one line."""
    with pytest.raises(ValueError, match="no recording"):
        recorded.positions(tmp_path)
    write_takes(tmp_path, takes=1)
    with pytest.raises(ValueError, match="lupper"):
        recorded.positions(tmp_path)
