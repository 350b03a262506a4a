"""Recorded files found in folders and read one after the other; UTKinect's takes."""

import re
from pathlib import Path

import numpy as np
import pytest
from programs import ran
from synthetic import ARM, amc_text, arm_frames

from kinespace.library import LibraryFileError, MotionLibrary, Reading
from kinespace.library.recordings import (
    RecordingError,
    RecordingReader,
    clips_of,
    find_recordings,
    read_recordings,
    segments_beside,
)
from kinespace.library.recordings.formats.labels import Segment
from kinespace.tools.evaluation.harness import Sources, read_takes


def _write_arm(folder: Path, *names: str, frames: int = 3) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.asf").write_text(ARM.asf())
    for name in names:
        (folder / name).write_text(amc_text(arm_frames(frames)))
    return [folder / name for name in names]


# --- finding -----------------------------------------------------------------------------------------------------


def test_recordings_are_found_at_any_depth(tmp_path: Path) -> None:
    """Every .amc, in any case and at any depth, sorted, but places as they are given; a file given has any ending."""
    wanted = ["a.amc", "b/one.AMC", "b/two.Amc", "b/c/d/deep.amc", "walks.amc/one.amc"]
    for name in (*wanted, "a.asf", "b/readme.txt", "b/c/one.amc.bak", "amc", "b/.amc"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert find_recordings([tmp_path]) == sorted(tmp_path / name for name in wanted)
    given = [tmp_path / name for name in ("walks.amc", "b/readme.txt", "b/c")]
    assert find_recordings(given) == [given[0] / "one.amc", given[1], given[2] / "d/deep.amc"]


@pytest.mark.parametrize("ending", ["bvh", "c3d", "csv", "mvnx"])
@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n", "git lfs pull"),
        (b"\n<!DOCTYPE html>\n<html>", "download the raw file"),
        (b'\xef\xbb\xbf<?xml version="1.0"?><mvnx/>', "export BVH"),
        (b"Kaydara FBX Binary  \x00", "export BVH"),
        (b"PK\x03\x04" + bytes(99), "save it as CSV"),
        (b"", "an empty file"),
    ],
)
def test_another_file_is_called_by_its_kind(tmp_path: Path, ending: str, content: bytes, told: str) -> None:
    """Whatever its ending says, a person is told what the file is, and what to do."""
    path = tmp_path / f"take.{ending}"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=f"{re.escape(str(path))}: expected a recording .*{told}"):
        RecordingReader().clips(path)


# --- reading -----------------------------------------------------------------------------------------------------


def test_clips_before_a_bad_file_are_not_lost(tmp_path: Path) -> None:
    """The reader gives the clips before a bad file, then refuses it; the message names the bad file alone."""
    paths = _write_arm(tmp_path, "arm_1.amc", "arm_2.amc", "arm_3.amc")
    paths[1].write_text(":DEGREES\n1\nroot 0 0\n")
    clips = read_recordings(paths)
    assert next(clips).name == "arm_1"
    with pytest.raises(RecordingError, match=re.escape(f"{paths[1]}:3: expected 6 numbers after 'root', got 2")):
        next(clips)


# --- as a person writes it ----------------------------------------------------------------------------------------


def test_paths_are_text_or_path_one_or_many(tmp_path: Path) -> None:
    """A name, a path, a list and a generator of them give the same clips; anything else is a mistake, said at once."""
    (path,) = _write_arm(tmp_path, "arm_1.amc")
    for given in (str(path), path, [str(path)], (each for each in [path])):
        assert [clip.name for clip in read_recordings(given)] == ["arm_1"]
    assert find_recordings(str(tmp_path)) == [path]
    for wrong in (3, [path, 3], None):
        with pytest.raises(ValueError, match="paths: expected a path or several, as text or Path"):
            read_recordings(wrong)  # type: ignore[arg-type] # a mistake


def test_a_trc_that_cannot_be_read_is_not_passed_over(tmp_path: Path) -> None:
    """Labels and libraries have the other endings of tables, too; nothing else ends in .trc."""
    (tmp_path / "labels.txt").write_text("0.1\t0.2\twave\n")
    (tmp_path / "take.trc").write_text("PathFileType\t4\n")
    assert find_recordings(tmp_path) == [tmp_path / "take.trc"]
    with pytest.raises(RecordingError, match="without joints' positions"):
        list(read_recordings(tmp_path))


def test_a_folder_gives_motions_with_classes_and_persons(tmp_path: Path) -> None:
    """A clip has its folder's class; a take is cut by the labels beside it; the person is where the caller says."""
    _write_arm(tmp_path / "bow", "ann_1.amc", frames=20)
    _write_arm(tmp_path, "bob_take.amc", frames=20)
    for person in ("bow/ann", "bob"):
        (tmp_path / f"{person}.asf").write_text(ARM.asf())
    (tmp_path / "bob_take.csv").write_text("start_s,end_s,label\n0,0.05,jump\n0.05,0.1,wave\n")
    read = [(clip.class_name, clip.actor) for clip in read_recordings(tmp_path, actor_in="name")]
    assert read == [("jump", "bob"), ("wave", "bob"), ("bow", "ann")]
    with pytest.raises(ValueError, match="'nose' is not a valid ActorIn"):
        read_recordings(tmp_path, actor_in="nose")  # type: ignore[arg-type]  # a mistake


def test_a_take_is_cut_by_labels(tmp_path: Path) -> None:
    """By a file of labels or by a list, into clips with the labels' classes and frames."""
    (path,) = _write_arm(tmp_path, "arm_1.amc", frames=240)
    (take,) = read_recordings(path)
    (tmp_path / "take.csv").write_text("start_s,end_s,label\n0,0.5,wave\n1,1.5,bow\n")
    for labels in (tmp_path / "take.csv", str(tmp_path / "take.csv"), [(0, 0.5, "wave"), (1, 1.5, "bow")]):
        wave, bow = clips_of(take, labels)
        assert (wave.class_name, bow.class_name, bow.take) == ("wave", "bow", "arm_1")
        np.testing.assert_array_equal(bow.positions, take.positions[120:180])
    with pytest.raises(ValueError, match="expected 0 <= start < end"):
        clips_of(take, [(1, 0.5, "wave")])


WRONG = {
    "flat.csv": ("time,head_x,head_y,hip_x,hip_y\n0,1,2,3,4\n", "columns x and y but no z: 2-D landmarks"),
    "other.csv": ("a,b\n1,2\n", "a .csv without joints' positions"),
}


@pytest.mark.parametrize("name", [*WRONG, "bare.npy", "bare.npz"])
def test_a_table_that_is_none_has_its_own_sentence(name: str, tmp_path: Path) -> None:
    """2-D columns, bare arrays: each is said, by the reader and by `kinespace info`."""
    text, said = WRONG.get(name, ("", "a bare array" if name.endswith("npy") else "without the arrays time, positions"))
    if text:
        (tmp_path / name).write_text(text)
    else:
        {"bare.npy": np.save, "bare.npz": np.savez}[name](tmp_path / name, np.zeros((3, 5, 3)))
    with pytest.raises(RecordingError, match=re.escape(said)):
        list(read_recordings(tmp_path / name))
    if not name.endswith("npz"):
        status, _, told = ran("info", tmp_path / name)
        assert (status, said in told) == (2, True)


def test_a_recording_given_as_a_library_is_said(tmp_path: Path) -> None:
    """The message gives the command that makes a library of it."""
    joints = {"time": np.arange(3.0), "positions": np.zeros((3, 5, 3)), "joints": np.array(list("abcde"))}
    np.savez(tmp_path / "take.npz", parents=np.array([], int), performer="", **joints)
    with pytest.raises(LibraryFileError, match=r"a recording, no motion library: kinespace build .*take\.npz -o FILE"):
        MotionLibrary.load(tmp_path / "take.npz")


# --- UTKinect's takes: frames that a depth camera skipped, wrote twice or left empty ----------------------------------


POSTURES = np.random.default_rng(3).normal(size=(4, 20, 3))
#: The camera skipped frames 11 and 13, wrote frame 12 twice, and saw nobody in frame 15.
NUMBERS = (10, 12, 12, 14, 15)
ROWS = [*POSTURES, np.zeros((20, 3))]
TEXT = "".join(f"{n} {' '.join(map(str, row.ravel()))}\n" for n, row in zip(NUMBERS, ROWS, strict=True))
LABELS = "s01_e01\nwalk: 1 20\ns01_e02\nwalk: 9 12\nsit down: 11 14\ncarry: NaN NaN\n"


def _written(folder: Path, text: str = TEXT, labels: str = LABELS) -> Path:
    (folder / "joints_s01_e02.txt").write_text(text)
    (folder / "actionLabel.txt").write_text(labels)
    return folder / "joints_s01_e02.txt"


def test_a_take_is_read_with_its_labels(tmp_path: Path) -> None:
    """Frames between are on straight lines; of two actions that overlap the earlier ends where the later begins."""
    path = _written(tmp_path)
    assert find_recordings(tmp_path) == [path]
    assert "joints_s01_e02" in ran("info", path)[1]
    (take,) = read_takes(Sources([tmp_path]), Reading())
    assert (take.person, take.delivered.tolist()) == ("s01", [0, 2, 4])  # type: ignore[union-attr]  # a sensor's
    (clip,), segments = read_recordings(path), segments_beside(path)
    assert (clip.frames, clip.actor, clip.take, clip.frame_rate, clip.filled) == (5, "s01", "e02", 30.0, 2 * 20)
    np.testing.assert_allclose(clip.positions[[0, 2, 4]], POSTURES[[0, 1, 3]])
    np.testing.assert_allclose(clip.positions[1], POSTURES[:2].mean(axis=0))
    assert segments == (Segment(0.0, 1 / 30, "walk"), Segment(1 / 30, 4 / 30, "sit down"))


@pytest.mark.parametrize(
    ("text", "labels", "message"),
    [
        (TEXT.replace("14 ", "9 "), LABELS, "expected on each line a frame's number, that does not fall"),
        (TEXT.replace("\n12 ", "\nnan ", 1), LABELS, "expected on each line a frame's number, that does not fall"),
        (re.sub(r" \S+\n", "\n", TEXT), LABELS, "expected on each line a frame's number, that does not fall"),
        (TEXT + "16 1 2\n", LABELS, "the number of columns changed"),
        (TEXT.partition("\n")[0], LABELS, "expected at least 2 frames with a person, got 1"),
        (TEXT, "s01_e01\nwalk: 1 20\n", "expected actions of s01_e02, got none"),
    ],
)
def test_a_take_that_makes_no_sense_is_refused(tmp_path: Path, text: str, labels: str, message: str) -> None:
    """The file is named, and the mistake."""
    path = _written(tmp_path, text, labels)
    with pytest.raises(RecordingError, match=f"^{re.escape(str(tmp_path))}.*: {message}"):
        read_takes(Sources([path]), Reading())


def test_all_of_utkinect_is_read(data_folder: Path) -> None:
    """The 20 takes have 199 actions of ten kinds; a misprinted number is put right."""
    takes = [segments_beside(path) for path in find_recordings(data_folder / "utkinect")]
    labels = [each.label for segments in takes for each in segments or ()]
    assert (len(takes), len(labels), len(set(labels))) == (20, 199, 10)
    (push,) = (each for each in takes[4] or () if each.label == "push")
    assert 0 < push.duration < 5
