import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from kinespace.library import Clip, MotionLibrary
from kinespace.stream.teaching.commands import From
from kinespace.tools.teaching.recordings import MAX_WAITING, RecordingsFolder

MOTION = MotionLibrary.builtin().motions[40]


def _written(path: Path) -> Path:
    body = {"joints": MOTION.skeleton.joints, "parents": MOTION.skeleton.parents, "performer": ""}
    np.savez(path, time=MOTION.times, positions=MOTION.positions, **body)
    return path


def _read(folder: RecordingsFolder) -> Clip | str:
    until = time.monotonic() + 60
    while time.monotonic() < until:
        for _, part in folder.parts():
            return part
        time.sleep(0.01)
    raise AssertionError


def test_a_part_of_a_recording_is_read(tmp_path: Path) -> None:
    """Its frames are those between the seconds, over the joints that are asked for."""
    _written(tmp_path / "a.npz")
    with closing(RecordingsFolder(tmp_path, MOTION.skeleton)) as folder:
        assert folder.ask(From("a.npz", 0.2, 1.0, "dip")) == ""
        part = _read(folder)
        assert not isinstance(part, str)
        first = round(0.2 * MOTION.frame_rate)
        assert np.allclose(part.positions[0], MOTION.positions[first], atol=0.02)
        assert part.duration == pytest.approx(0.8, abs=0.05)
        folder.ask(From("a.npz", 90.0, 91.0, "dip"))
        assert "a.npz" in str(_read(folder))
        assert folder.refused == 0


def test_no_file_elsewhere_is_read(tmp_path: Path) -> None:
    """Neither by a way up, nor by a whole path, nor by a link; all are counted, and say the same."""
    inside = tmp_path / "inside"
    inside.mkdir()
    _written(tmp_path / "outside.npz")
    (inside / "link.npz").symlink_to(tmp_path / "outside.npz")
    names = ["../outside.npz", str(tmp_path / "outside.npz"), "link.npz", "a\0b", "", ".", "x" * 5000, "gone.npz"]
    with closing(RecordingsFolder(inside, MOTION.skeleton)) as folder:
        reasons = {folder.ask(From(name, 0, 1, "dip")) for name in names}
        assert reasons == {"no such recording in the folder of --recordings"}
        assert folder.refused == len(names)
    with closing(RecordingsFolder(None, MOTION.skeleton)) as folder:
        assert folder.ask(From("a.npz", 0, 1, "dip")) == "expected --recordings"


def test_a_flood_of_requests_is_bounded(tmp_path: Path) -> None:
    """So many wait, and a file that is no recording is refused in one line."""
    (tmp_path / "a.bvh").write_text("no motion")
    with closing(RecordingsFolder(tmp_path, MOTION.skeleton)) as folder:
        asked = [folder.ask(From("a.bvh", 0, 1, "dip")) for _ in range(MAX_WAITING + 1)]
        assert asked == [""] * MAX_WAITING + ["8 recordings are being read already"]
        assert str(_read(folder)).startswith("a.bvh: ")
