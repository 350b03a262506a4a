"""Recorded files found in folders and read one after the other."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic import ARM, TinyBody, TinyBone, amc_text, arm_frames

from kinespace.library.recordings import Reading, RecordingError, find_recordings, read_recordings
from kinespace.library.recordings.formats import acclaim

if TYPE_CHECKING:
    from pathlib import Path


def _touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("")


def _write_arm(folder: Path, *names: str, frames: int = 3) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.asf").write_text(ARM.asf())
    for name in names:
        (folder / name).write_text(amc_text(arm_frames(frames)))
    return [folder / name for name in names]


# --- finding -----------------------------------------------------------------------------------------------------


def test_recordings_are_found_at_any_depth(tmp_path: Path) -> None:
    """Every .amc, in upper or lower case and at any depth, is found, in sorted order; others are not."""
    wanted = ["a.amc", "b/one.AMC", "b/two.Amc", "b/c/d/deep.amc", "walks.amc/one.amc"]
    _touch(tmp_path, *wanted, "a.asf", "b/readme.txt", "b/c/one.amc.bak", "amc", "b/.amc")
    assert find_recordings([tmp_path]) == sorted(tmp_path / name for name in wanted)


def test_places_are_listed_in_the_given_order(tmp_path: Path) -> None:
    """Folders and single files keep their given order; a file given by name may have any ending."""
    _touch(tmp_path, "z/1.amc", "z/2.amc", "a/3.amc", "m.mocap")
    found = find_recordings([tmp_path / "z", tmp_path / "m.mocap", tmp_path / "a"])
    assert [path.name for path in found] == ["1.amc", "2.amc", "m.mocap", "3.amc"]


def test_a_place_that_does_not_exist_is_named(tmp_path: Path) -> None:
    """A place that is not there is refused, even beside one that is."""
    _touch(tmp_path, "one.amc")
    with pytest.raises(RecordingError, match=re.escape(f"{tmp_path / 'absent'}: no such file or folder")):
        find_recordings([tmp_path, tmp_path / "absent"])


@pytest.mark.parametrize("names", [[], ["readme.txt", "deep/HDM_bd.asf"]], ids=["empty", "other files"])
def test_a_folder_without_recordings_is_named(tmp_path: Path, names: list[str]) -> None:
    """Where no recording is in any place the places and the known endings are said."""
    _touch(tmp_path, *names)
    (tmp_path / "second").mkdir()
    message = re.escape(f"{tmp_path}, {tmp_path / 'second'}: no recording ({KINDS}) in it")
    with pytest.raises(RecordingError, match=message):
        find_recordings([tmp_path, tmp_path / "second"])


# --- reading -----------------------------------------------------------------------------------------------------


def test_each_skeleton_is_read_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A skeleton's file is read once for all its motions, and each folder's motions get their own skeleton."""
    paths = [*_write_arm(tmp_path / "one", "arm_1.amc", "arm_2.amc"), *_write_arm(tmp_path / "two", "arm_3.amc")]
    read: list[Path] = []

    def noting(path: Path) -> acclaim.AcclaimSkeleton:
        read.append(path)
        return read_asf(path)

    read_asf = acclaim.read_asf
    monkeypatch.setattr(acclaim, "read_asf", noting)
    assert len(list(read_recordings([*paths, *paths]))) == 6
    assert read == [tmp_path / "one" / "arm.asf", tmp_path / "two" / "arm.asf"]


def test_a_given_skeleton_is_used_before_a_found_one(tmp_path: Path) -> None:
    """A skeleton given by hand is used for every motion, with or without a skeleton of its own."""
    (path,) = _write_arm(tmp_path, "arm_1.amc")
    longer = TinyBody(tuple(TinyBone(bone.name, bone.parent, length=9.0, dof=bone.dof) for bone in ARM.bones))
    given = tmp_path / "longer.asf"
    given.write_text(longer.asf())
    nameless = tmp_path / "nameless.amc"
    nameless.write_text(path.read_text())
    for clip in read_recordings([path, nameless], Reading(asf=given)):
        assert np.linalg.norm(clip.positions[0, 1] - clip.positions[0, 0]) == pytest.approx(9.0)
    (own,) = read_recordings([path])
    assert np.linalg.norm(own.positions[0, 1] - own.positions[0, 0]) == pytest.approx(1.0)


KINDS = ".amc, .bvh, .c3d, .trc, .kinerec, a table in .csv or .npz"


def test_clips_before_a_bad_file_are_not_lost(tmp_path: Path) -> None:
    """The reader gives the clips before a bad file, then refuses it; the message names the bad file alone."""
    paths = _write_arm(tmp_path, "arm_1.amc", "arm_2.amc", "arm_3.amc")
    paths[1].write_text(":DEGREES\n1\nroot 0 0\n")
    clips = read_recordings(paths)
    assert next(clips).name == "arm_1"
    with pytest.raises(RecordingError, match=re.escape(f"{paths[1]}:3: expected 6 numbers after 'root', got 2")):
        next(clips)


def test_a_given_skeleton_that_is_gone_is_an_os_error(tmp_path: Path) -> None:
    """A skeleton given by hand that does not exist is the system's error, which names it."""
    paths = _write_arm(tmp_path, "arm_1.amc")
    with pytest.raises(FileNotFoundError, match=r"absent\.asf"):
        list(read_recordings(paths, Reading(asf=tmp_path / "absent.asf")))
