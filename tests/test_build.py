"""`kinespace build`: recordings in, one motion library file out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from programs import finished
from recorded import JOINTS, SWINGS, TWO_ARMS, two_arms_frames, write_take, write_takes
from synthetic import amc_text, stick_clips

from library import MotionLibrary, hdm05, read_recordings
from library.comparison import FOR_ANYBODY, FOR_ONE_PERSON
from tools.cli import main

if TYPE_CHECKING:
    from pathlib import Path

    import pytest


def build(*arguments: object) -> int:
    """Run `kinespace build` in this process."""
    return main(["build", *map(str, arguments)])


def test_a_folder_becomes_a_library(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every recording under a folder is a motion of its class, the same as built from the clips by hand."""
    (tmp_path / "cut").mkdir()
    paths = write_takes(tmp_path / "cut")
    assert build(tmp_path / "cut", "-o", tmp_path / "mine.npz") == 0
    built = MotionLibrary.load(tmp_path / "mine.npz")
    expected = MotionLibrary.of_clips(read_recordings(paths))
    assert built.classes == tuple(sorted(SWINGS))
    assert set(built.skeleton.joints) == set(JOINTS)
    assert built.motions == expected.motions
    np.testing.assert_array_equal(built.axes, expected.axes)
    np.testing.assert_array_equal(built.means, expected.means)
    output = tmp_path / "mine.npz"
    megabytes = output.stat().st_size / 1e6
    told, lacking = capsys.readouterr().out.splitlines()
    assert told == f"{output}: 12 motions, 3 classes, {megabytes:.2f} MB"
    assert lacking.startswith("whole motions only, no windows: ")


def test_clips_named_like_hdm05s_carry_its_terms(tmp_path: Path) -> None:
    """When every name is HDM05's the library carries its licence and attribution; given ones go before them."""
    write_takes(tmp_path, takes=1)
    build(tmp_path, "-o", tmp_path / "plain.npz")
    build(tmp_path, "-o", tmp_path / "given.npz", "--licence", "CC0", "--attribution", "A. Dancer")
    plain, given = (MotionLibrary.load(tmp_path / name) for name in ("plain.npz", "given.npz"))
    assert (plain.licence, plain.attribution) == (hdm05.LICENCE, hdm05.ATTRIBUTION)
    assert (given.licence, given.attribution) == ("CC0", "A. Dancer")


def test_other_names_take_their_class_from_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A clip whose name tells no class gets its folder's name, also when the folder is where one stands."""
    folder = tmp_path / "spin"
    folder.mkdir()
    (folder / "ann.asf").write_text(TWO_ARMS.asf())
    (folder / "ann_7.amc").write_text(amc_text(two_arms_frames("raiseBoth", frames=60)))
    monkeypatch.chdir(folder)
    assert build(".", "-o", tmp_path / "mine.npz") == 0
    library = MotionLibrary.load(tmp_path / "mine.npz")
    (motion,) = library.motions
    assert (motion.class_name, motion.actor, motion.take) == ("spin", "", "ann_7")
    assert (library.licence, library.attribution) == ("", "")


def test_a_given_skeleton_and_rate_are_used(tmp_path: Path) -> None:
    """With --asf no skeleton is looked for, and --frame-rate goes before what the recordings say."""
    (tmp_path / "cut").mkdir()
    path = write_take(tmp_path / "cut", "bd", "bendLeft", 1)
    (tmp_path / "cut" / "HDM_bd.asf").rename(tmp_path / "other.asf")
    assert build(path, "-o", tmp_path / "mine.npz", "--asf", tmp_path / "other.asf", "--frame-rate", "60") == 0
    (motion,) = MotionLibrary.load(tmp_path / "mine.npz").motions
    assert (motion.frames, motion.frame_rate, motion.duration) == (180, 60.0, 3.0)


def test_libraries_among_the_sources_are_merged(tmp_path: Path) -> None:
    """A library and new recordings give one library of both; what both have is there once."""
    (tmp_path / "cut").mkdir()
    write_takes(tmp_path / "cut", actors=("bd",), takes=1)
    build(tmp_path / "cut", "-o", tmp_path / "first.npz")
    write_takes(tmp_path / "cut", actors=("mm",), takes=1)
    assert build(tmp_path / "first.npz", tmp_path / "cut", "-o", tmp_path / "both.npz") == 0
    both = MotionLibrary.load(tmp_path / "both.npz")
    assert [(motion.class_name, motion.actor) for motion in both.motions] == [
        (class_name, actor) for class_name in sorted(SWINGS) for actor in ("bd", "mm")
    ]
    assert (both.licence, both.attribution) == (hdm05.LICENCE, hdm05.ATTRIBUTION)


def test_an_existing_library_is_replaced_whole_if_ordered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Building over a file is refused before anything is read; ordered, it replaces it and leaves nothing else."""
    (tmp_path / "cut").mkdir()
    (tmp_path / "made").mkdir()
    output = tmp_path / "made" / "mine.npz"
    output.write_bytes(b"something else")
    write_takes(tmp_path / "cut", takes=1)
    assert build(tmp_path / "nowhere", "-o", output) == 2
    assert capsys.readouterr().err == f"kinespace: {output}: exists already; --overwrite writes over it\n"
    assert output.read_bytes() == b"something else"
    assert build(tmp_path / "cut", "-o", output, "--overwrite") == 0
    assert len(MotionLibrary.load(output)) == 6
    assert list(output.parent.iterdir()) == [output]


def test_a_failed_build_leaves_the_old_library(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """When a recording cannot be used the file that was there is there still, byte for byte, and nothing beside it."""
    (tmp_path / "cut").mkdir()
    (tmp_path / "made").mkdir()
    output = tmp_path / "made" / "mine.npz"
    paths = write_takes(tmp_path / "cut", takes=1)
    build(tmp_path / "cut", "-o", output)
    before = output.read_bytes()
    paths[-1].write_text(paths[-1].read_text().replace("rlower", "tail"))
    capsys.readouterr()
    assert build(tmp_path / "cut", "-o", output, "--overwrite") == 2
    assert output.read_bytes() == before
    assert list(output.parent.iterdir()) == [output]
    assert capsys.readouterr().err.startswith(f"kinespace: {paths[-1]}:")


def test_long_takes_without_labels_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A take that lasts as no motion does is taken as one all the same, with a line that says how to cut it."""
    write_take(tmp_path, "bd", "bendLeft", 1)
    path = write_take(tmp_path, "bd", "bendRight", 1, frames=120 * 16)
    assert build(tmp_path, "-o", tmp_path / "mine.npz") == 0
    told = (
        f"1 of 2 recordings are longer than 15 s, {path.stem} (16 s) the longest; each is taken as one motion: --labels"
    )
    (line,) = [line for line in capsys.readouterr().out.splitlines() if "--labels" in line]
    assert line.startswith(told)
    labels = tmp_path / "labels.csv"
    labels.write_text("start_s,end_s,label\n0,15.5,down\n")
    assert build(path, "--labels", labels, "-o", tmp_path / "other.npz") == 0
    assert "--labels" not in capsys.readouterr().out


def test_bodies_that_differ_cannot_be_merged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A library of another body among the sources ends with the two bodies named."""
    MotionLibrary.of_clips(stick_clips(takes=1)).save(tmp_path / "stick.npz")
    path = write_take(tmp_path, "bd", "bendLeft", 1)
    assert build(tmp_path / "stick.npz", path, "-o", tmp_path / "mine.npz") == 2
    error = capsys.readouterr().err
    assert error.startswith("kinespace: skeleton: expected 6 joints")
    assert error.count("\n") == 1
    assert not (tmp_path / "mine.npz").exists()


def test_the_command_builds_a_library_that_info_reads(tmp_path: Path) -> None:
    """As a command of its own, build writes a file, says so with what it lacks, and info lists it."""
    write_takes(tmp_path, takes=1)
    status, output, errors = finished("build", tmp_path, "-o", tmp_path / "mine.npz")
    assert (status, errors) == (0, "")
    assert output.startswith(f"{tmp_path / 'mine.npz'}: 6 motions, 3 classes, ")
    assert output.count("\n") == 2
    status, output, errors = finished("info", tmp_path / "mine.npz")
    assert (status, errors) == (0, "")
    assert "6 motions of 6 joints, 15 pairs measured" in output


def test_a_folder_of_real_recordings_becomes_a_library(hdm05_folder: Path, tmp_path: Path) -> None:
    """A class's folder of HDM05 becomes a library with the same motions as the built-in one holds of that class."""
    status, _, errors = finished("build", hdm05_folder / "squat1Reps", "-o", tmp_path / "squats.npz")
    assert (status, errors) == (0, "")
    built, whole = MotionLibrary.load(tmp_path / "squats.npz"), MotionLibrary.builtin()
    of_class = [index for index, motion in enumerate(whole.motions) if motion.class_name == "squat1Reps"]
    key = [(motion.actor, motion.take, motion.frames) for motion in built.motions]
    assert key == [(whole.motions[i].actor, whole.motions[i].take, whole.motions[i].frames) for i in of_class]
    alike = np.abs(np.sum(built.axes * whole.axes[of_class], axis=1))
    np.testing.assert_allclose(alike, 1.0, atol=1e-4)


# --- windows -----------------------------------------------------------------------------------------------------


def test_one_persons_recordings_are_compared_as_the_built_in_library_does(hdm05_folder: Path, tmp_path: Path) -> None:
    """One person's recordings of the usual body get windows for that person, measured as the built-in library's."""
    paths = [min((hdm05_folder / name).glob("*_bk_*.amc")) for name in ("squat1Reps", "grabHighR")]
    assert build(*paths, "-o", tmp_path / "mine.npz") == 0
    windows, builtin = MotionLibrary.load(tmp_path / "mine.npz").windows, MotionLibrary.builtin().windows
    assert windows is not None
    assert builtin is not None
    assert windows.groups == FOR_ONE_PERSON
    assert windows.comparison.is_same(builtin.comparison)
    assert len(MotionLibrary.load(tmp_path / "mine.npz").portraits) == 2


def test_three_people_teach_their_own_comparison(tmp_path: Path) -> None:
    """Three people's recordings of any body get windows for anybody and portraits, two people's of an unknown none."""
    write_takes(tmp_path, actors=("bd", "mm"), takes=1)
    assert build(tmp_path, "-o", tmp_path / "two.npz") == 0
    write_takes(tmp_path, actors=("tr",), takes=1)
    assert build(tmp_path, "-o", tmp_path / "three.npz") == 0
    windows = MotionLibrary.load(tmp_path / "three.npz").windows
    assert windows is not None
    assert windows.groups == FOR_ANYBODY
    assert set(windows.actors.tolist()) == {"bd", "mm", "tr"}
    assert len(MotionLibrary.load(tmp_path / "three.npz").portraits) == len(SWINGS)
    two = MotionLibrary.load(tmp_path / "two.npz")
    assert (two.windows, two.portraits) == (None, ())


def test_labels_cut_recordings_into_motions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With labels each segment is a motion of its label's class; a bad line ends with the file and the line."""
    path = write_take(tmp_path, "bd", "bendLeft", 1)
    labels = tmp_path / "labels.csv"
    labels.write_text("start_s,end_s,label\n0.5,1,down\n0,0.5,up\n")
    assert build(path, "--labels", labels, "-o", tmp_path / "mine.npz") == 0
    motions = MotionLibrary.load(tmp_path / "mine.npz").motions
    assert [(motion.class_name, motion.duration, motion.take) for motion in motions] == [
        ("down", 0.5, path.stem),
        ("up", 0.5, path.stem),
    ]
    labels.write_text("start_s,end_s,label\n0,0.5,up\n0.5,x,down\n")
    capsys.readouterr()
    assert build(path, "--labels", labels, "-o", tmp_path / "other.npz") == 2
    assert capsys.readouterr().err.startswith(f"kinespace: {labels}:3: could not convert string to float: 'x'")
