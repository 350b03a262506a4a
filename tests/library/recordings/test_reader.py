"""Recorded files found in folders and read one after the other."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
import pytest
from recorded import JOINTS, write_take
from synthetic import ARM, TinyBody, TinyBone, amc_text, arm_frames
from written import MOVES, TURNS, Node, bvh_text

from kinespace.library import Clip
from kinespace.library.recordings import Reading, RecordingError, RecordingReader, find_recordings, read_recordings
from kinespace.library.recordings.formats import acclaim, bvh
from kinespace.library.recordings.formats.acclaim import AcclaimError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
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
    """Every .amc, in upper or lower case and at any depth, is found, in sorted order; other files are not."""
    wanted = ["a.amc", "b/one.AMC", "b/two.Amc", "b/c/d/deep.amc"]
    _touch(tmp_path, *wanted, "a.asf", "b/readme.txt", "b/c/one.amc.bak", "amc", "b/.amc")
    assert find_recordings([tmp_path]) == sorted(tmp_path / name for name in wanted)


def test_a_folder_named_like_a_recording_is_searched(tmp_path: Path) -> None:
    """A folder whose name ends in .amc is searched, not read."""
    _touch(tmp_path, "walks.amc/one.amc")
    assert find_recordings([tmp_path]) == [tmp_path / "walks.amc" / "one.amc"]


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


def test_all_of_hdm05_is_found(hdm05_folder: Path) -> None:
    """In the archive's folder 288 recordings are found, the one that ends in .AMC among them."""
    found = find_recordings([hdm05_folder])
    assert len(found) == len(set(found)) == 288
    assert {path.suffix for path in found} == {".amc", ".AMC"}


# --- reading -----------------------------------------------------------------------------------------------------


def test_clips_come_in_the_order_of_the_paths(tmp_path: Path) -> None:
    """Each path gives its clip, named like the file, in the order given."""
    paths = _write_arm(tmp_path, "arm_03.amc", "arm_01.AMC", "arm_02.amc")
    assert [clip.name for clip in read_recordings(paths)] == ["arm_03", "arm_01", "arm_02"]


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


def test_a_given_frame_rate_holds_for_all(tmp_path: Path) -> None:
    """A frame rate given by hand is every clip's."""
    paths = _write_arm(tmp_path, "arm_1.amc", "arm_2.amc")
    assert [clip.frame_rate for clip in read_recordings(paths, Reading(frame_rate=50.0))] == [50.0, 50.0]
    assert [clip.frame_rate for clip in read_recordings(paths)] == [120.0, 120.0]


def test_a_given_frame_rate_of_zero_is_refused(tmp_path: Path) -> None:
    """A frame rate of 0 is as bad as a negative one."""
    paths = _write_arm(tmp_path, "arm_1.amc")
    with pytest.raises(ValueError, match="frame_rate: expected a positive number"):
        list(read_recordings(paths, Reading(frame_rate=0.0)))


KINDS = ".amc, .bvh, .c3d, .trc, .kinerec, a table in .csv or .npz, or UTKinect's .txt"


@pytest.mark.parametrize(
    ("name", "content", "got"),
    [
        ("walk.fbx", "x", ".fbx"),
        ("walk", "x", "no ending"),
        ("walk.asf", "x", ".asf"),
        ("walk.csv", "", "an empty file"),
        ("walk.csv", "a,b\n1,2\n", "a .csv without joints' positions: columns like time, head_x, head_y, head_z"),
    ],
)
def test_a_file_of_another_kind_is_refused(tmp_path: Path, name: str, content: str, got: str) -> None:
    """A file with another ending or without positions is refused by name, with the kinds that are read."""
    (tmp_path / name).write_text(content)
    message = re.escape(f"{tmp_path / name}: expected a recording ({KINDS}), got {got}")
    with pytest.raises(RecordingError, match=message):
        list(read_recordings([tmp_path / name]))


def test_clips_before_a_bad_file_are_not_lost(tmp_path: Path) -> None:
    """The reader gives the clips before a bad file, then refuses it; the message names the bad file alone."""
    paths = _write_arm(tmp_path, "arm_1.amc", "arm_2.amc", "arm_3.amc")
    paths[1].write_text(":DEGREES\n1\nroot 0 0\n")
    clips = read_recordings(paths)
    assert next(clips).name == "arm_1"
    with pytest.raises(AcclaimError, match=re.escape(f"{paths[1]}:3: expected 6 numbers for 'root', got 2")):
        next(clips)


def test_a_recording_that_is_gone_is_an_os_error(tmp_path: Path) -> None:
    """A file removed since it was listed is the system's error, which names it."""
    paths = _write_arm(tmp_path, "arm_1.amc")
    paths[0].unlink()
    with pytest.raises(FileNotFoundError, match=r"arm_1\.amc"):
        list(read_recordings(paths))


def test_a_given_skeleton_that_is_gone_is_an_os_error(tmp_path: Path) -> None:
    """A skeleton given by hand that does not exist is the system's error, which names it."""
    paths = _write_arm(tmp_path, "arm_1.amc")
    with pytest.raises(FileNotFoundError, match=r"absent\.asf"):
        list(read_recordings(paths, Reading(asf=tmp_path / "absent.asf")))


# --- in pieces ---------------------------------------------------------------------------------------------------


def joined(clips: Iterable[Clip]) -> Clip:
    """Put clips that follow each other together."""
    pieces = list(clips)
    positions = np.concatenate([piece.positions for piece in pieces])
    rotations = np.concatenate([piece.rotations for piece in pieces])
    filled = sum(piece.filled for piece in pieces)
    return replace(pieces[0], positions=positions, rotations=rotations, filled=filled)


def assert_same(one: Clip, other: Clip) -> None:
    """Hold one clip against another, bit for bit."""
    for field in fields(Clip):
        first, second = getattr(one, field.name), getattr(other, field.name)
        if isinstance(first, np.ndarray):
            np.testing.assert_array_equal(first, second)
        elif field.name == "skeleton":
            first.require_same(second)
        else:
            assert first == second, field.name


def pieces_and_whole(path: Path) -> Clip:
    """Read a recording in pieces, which together are the whole; the whole."""
    (whole,) = read_recordings([path])
    with RecordingReader() as reader:
        pieces = list(reader.pieces(path))
    assert len(pieces) > 3
    assert_same(joined(pieces), whole)
    return whole


#: Changes to an AMC's frames; each frame is a number and five lines.
AMC_CHANGES: dict[str, Callable[[list[list[str]]], list[list[str]]]] = {
    "as it is": lambda frames: frames,
    # Within a piece, and where two meet.
    "with frames missing": lambda frames: [*frames[:5], *frames[7:30], *frames[60:]],
    "with bones in another order from some frame on": lambda frames: [
        *frames[:50],
        *([number, *reversed(bones)] for number, *bones in frames[50:]),
    ],
    "with bones in changing order from some frame on": lambda frames: [
        *frames[:50],
        *([number, *bones[index % 5 :], *bones[: index % 5]] for index, (number, *bones) in enumerate(frames[50:])),
    ],
    "by line from the first frame": lambda frames: (
        [[*frames[0][:2], f"{frames[0][2]} # a comment", *frames[0][3:]], *frames[1:]]
    ),
}


@pytest.mark.parametrize("changed", AMC_CHANGES)
@pytest.mark.parametrize("block", [700, 1500])
def test_the_pieces_of_an_amc_are_the_whole(
    changed: str, block: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pieces together are the clip, for every way to write the frames and every place to part them."""
    monkeypatch.setattr(acclaim, "_BLOCK_BYTES", block)
    monkeypatch.setattr(acclaim, "_BLOCK_FRAMES", block // 70)
    path = write_take(tmp_path, "bd", "bendLeft", 1)
    (as_written,) = read_recordings([path])
    heads, lines = path.read_text().splitlines()[:2], path.read_text().splitlines()[2:]
    frames = AMC_CHANGES[changed]([lines[at : at + 6] for at in range(0, len(lines), 6)])
    path.write_text("\n".join([*heads, *chain.from_iterable(frames)]) + "\n")
    whole = pieces_and_whole(path)
    assert whole.frames == 180
    if "missing" in changed:
        assert whole.filled == 32 * len(JOINTS)
    else:
        assert_same(whole, as_written)


def test_a_real_take_in_pieces_is_the_whole(cmu_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A take of 38 seconds comes in pieces that together equal the take read at once."""
    monkeypatch.setattr(acclaim, "_BLOCK_BYTES", 300_000)
    assert pieces_and_whole(cmu_folder / "13_29.amc").frames > 4000


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_a_bvh_in_pieces_is_the_whole(unit: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A root that begins to move late, and a unit guessed from the first frame, are the same in every piece."""
    monkeypatch.setattr(bvh, "_BLOCK", 16)
    arm = Node("arm", (0.0, 0.5 * unit, 0.0), TURNS, [Node("arm_end", (0.6 * unit, 0.0, 0.0))])
    root = Node("root", (0.1 * unit, 1.0 * unit, 0.0), (*MOVES, *TURNS), [arm, Node("head", (0.0, 1.2 * unit, 0.0))])
    generator = np.random.default_rng(4)
    frames = generator.uniform(-40.0, 40.0, (100, 9))
    frames[:, :3] = 0.0
    still, moving = tmp_path / "still.bvh", tmp_path / "moving.bvh"
    still.write_text(bvh_text(root, frames.tolist()))
    frames[70:, :3] = generator.uniform(-unit, unit, (30, 3))
    moving.write_text(bvh_text(root, frames.tolist()))
    assert pieces_and_whole(still).frames == pieces_and_whole(moving).frames == 100


def test_the_error_of_a_bad_piece_comes_when_the_piece_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pieces come until the mistake; the error is the same as for the whole file."""
    monkeypatch.setattr(acclaim, "_BLOCK_BYTES", 700)
    path = write_take(tmp_path, "bd", "bendLeft", 1)
    good = path.read_text()
    spoilt = {
        "NaN or infinity in frame 170": re.sub(r"(?m)^170\n(\w+) [-\d.e]+", r"170\n\1 nan", good),
        "frame 3 comes too late": re.sub(r"(?m)^170$", "3", good),
        "frames are missing, more than are there": re.sub(r"(?m)^180$", "1000", good),
    }
    for told, text in spoilt.items():
        assert text != good
        path.write_text(text)
        got = list[Clip]()
        with RecordingReader() as reader:
            with pytest.raises(RecordingError, match=told) as whole:
                reader.clip(path)
            with pytest.raises(RecordingError, match=told) as parted:
                got.extend(reader.pieces(path))
        assert str(parted.value) == str(whole.value)
        # A list keeps the clips before the mistake.
        assert sum(piece.frames for piece in got) > 100


def test_a_number_made_up_does_not_fill_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A frame number far beyond the others is refused before all frames between are made."""
    monkeypatch.setattr(acclaim, "_BLOCK_BYTES", 700)
    path = write_take(tmp_path, "bd", "bendLeft", 1)
    path.write_text(re.sub(r"(?m)^1(\d\d)$", r"1000000000000\1", path.read_text()))
    with RecordingReader() as reader, pytest.raises(RecordingError, match="frames are missing, more than are there"):
        list(reader.pieces(path))
