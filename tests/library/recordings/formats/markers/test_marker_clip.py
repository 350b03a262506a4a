"""TRC and C3D: markers by name, units, gaps, points that are no positions, and every bad input."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from written import trc_text, write_c3d

from kinespace.library.recordings import read_recordings
from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.formats.gap_filling import MAX_GAP, with_missing_joints
from kinespace.library.recordings.formats.joint_choice import chosen, short_names
from kinespace.library.recordings.formats.markers import c3d, trc
from kinespace.library.recordings.formats.markers.c3d import C3dError
from kinespace.library.recordings.formats.markers.c3d_process import C3dProcess
from kinespace.library.recordings.formats.markers.trc import TrcError
from kinespace.library.recordings.formats.units import guessed_metres, metres_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray


LABELS = ("hip", "knee", "heel")
RATE = 100.0


def walk(frames: int = 120) -> NDArray[np.float64]:
    """Make three markers that go straight ahead and swing a little, millimetres."""
    generator = np.random.default_rng(2)
    start = np.array([[10.0, 900.0, 5.0], [12.0, 500.0, 6.0], [14.0, 60.0, 7.0]])
    return start + np.cumsum(generator.normal(1.0, 0.5, (frames, 3, 3)), axis=0)


def write_trc(path: Path, positions: NDArray[np.float64], labels: tuple[str, ...] = LABELS, unit: str = "mm") -> Path:
    """Write a TRC."""
    path.write_text(trc_text(labels, positions, rate=RATE, unit=unit))
    return path


def written_c3d(path: Path, positions: NDArray[np.float64], labels: tuple[str, ...] = LABELS, unit: str = "mm") -> Path:
    """Write a C3D."""
    write_c3d(path, labels, positions, rate=RATE, unit=unit)
    return path


FORMATS = pytest.mark.parametrize(
    ("write", "read", "ending"),
    [
        pytest.param(write_trc, trc.read_clip, "trc", id="trc"),
        pytest.param(written_c3d, c3d.read_clip, "c3d", id="c3d"),
    ],
)
Write = "Callable[..., Path]"
Read = "Callable[..., Clip]"

# --- sound files ------------------------------------------------------------------------------------------------


@pytest.mark.slow
@FORMATS
@pytest.mark.parametrize(("unit", "metres"), [("mm", 0.001), ("cm", 0.01), ("m", 1.0), ("in", 0.0254)])
def test_markers_come_back_in_metres(  # noqa: PLR0913, PLR0917 - one for each thing that varies
    tmp_path: Path, write: Write, read: Read, ending: str, unit: str, metres: float
) -> None:
    """Positions, labels and rate come back as written, scaled from the file's unit; a given unit goes before."""
    positions = walk()
    path = write(tmp_path / f"walk.{ending}", positions, unit=unit)
    clip = read(path)
    assert (clip.skeleton.joints, clip.skeleton.parents, clip.frame_rate) == (LABELS, (), RATE)
    assert (clip.name, clip.filled) == ("walk", 0)
    np.testing.assert_allclose(clip.positions, positions * metres, rtol=1e-6)
    np.testing.assert_allclose(read(path, metres_per_unit=2.0).positions, positions * 2.0, rtol=1e-6)
    assert read(path, frame_rate=50.0).frame_rate == 50.0


@FORMATS
def test_a_gap_is_filled_with_straight_lines(tmp_path: Path, write: Write, read: Read, ending: str) -> None:
    """A marker out of sight, or at exactly 0, 0, 0, stands on the line between its neighbours, at the ends still."""
    positions = walk()
    expected = positions.copy()
    expected[11:20, 1] = positions[10, 1] + np.linspace(0, 1, 11)[1:-1, None] * (positions[20, 1] - positions[10, 1])
    expected[:5, 0] = positions[5, 0]
    expected[50, 2] = (positions[49, 2] + positions[51, 2]) / 2
    positions[11:20, 1] = positions[:5, 0] = np.nan
    positions[50, 2] = 0.0
    clip = read(write(tmp_path / f"walk.{ending}", positions))
    np.testing.assert_allclose(clip.positions, expected / 1000, rtol=1e-5)
    assert clip.filled == 9 + 5 + 1


@pytest.mark.slow
@FORMATS
def test_a_longer_gap_is_refused_unless_its_marker_is_not_asked_for(
    tmp_path: Path, write: Write, read: Read, ending: str
) -> None:
    """A marker gone for longer than the bound is named with when and how long; without it the file can be read."""
    positions = walk()
    longest = int(MAX_GAP * RATE)
    positions[7 : 7 + longest, 1] = np.nan
    path = write(tmp_path / f"walk.{ending}", positions)
    assert read(path).filled == longest
    positions[7 + longest, 1] = np.nan
    write(path, positions)
    message = f"{path}: 'knee' is missing for 0.51 s from frame 8 of 120 on, longer than 0.5 s"
    with pytest.raises(RecordingError, match=re.escape(message)):
        read(path)
    assert read(path, joints=("hip", "heel")).skeleton.joints == ("hip", "heel")


@FORMATS
def test_a_marker_always_at_the_origin_is_there(tmp_path: Path, write: Write, read: Read, ending: str) -> None:
    """A marker that never leaves 0, 0, 0 is the origin of the others' measurement, not missing."""
    positions = walk()
    positions[:, 0] = 0.0
    assert read(write(tmp_path / f"walk.{ending}", positions)).filled == 0


@pytest.mark.slow
@FORMATS
def test_a_performers_prefix_is_left_out_and_two_are_refused(
    tmp_path: Path, write: Write, read: Read, ending: str
) -> None:
    """`ann:hip` is called `hip`; with two performers one must be chosen."""
    path = write(tmp_path / f"walk.{ending}", walk(), tuple(f"ann:{label}" for label in LABELS))
    assert read(path).skeleton.joints == LABELS
    both = np.concatenate([walk(), walk() + 500], axis=1)
    write(path, both, tuple(f"{who}:{label}" for who in ("ann", "bob") for label in LABELS))
    with pytest.raises(RecordingError, match=r"the file has several performers \(ann, bob\)"):
        read(path)
    clip = read(path, joints=("bob:*",))
    assert clip.skeleton.joints == LABELS
    np.testing.assert_allclose(clip.positions, (walk() + 500) / 1000, rtol=1e-6)


@FORMATS
def test_a_file_named_like_hdm05s_has_class_actor_and_take(
    tmp_path: Path, write: Write, read: Read, ending: str
) -> None:
    """The reader takes class, actor and take from the name, in any format."""
    clip = read(write(tmp_path / f"HDM_bd_walk_003_100.{ending}", walk()))
    assert (clip.class_name, clip.actor, clip.take) == ("walk", "bd", "003")


@pytest.mark.slow
def test_results_that_are_no_positions_are_passed_over(tmp_path: Path) -> None:
    """Angles that the file lists as such and unlabelled markers are left out, unless they are named one by one."""
    positions = np.concatenate([walk(), walk()[:, :2]], axis=1)
    labels = (*LABELS, "*12", "hipAngles")
    path = tmp_path / "walk.c3d"
    write_c3d(path, labels, positions, angles=["hipAngles"])
    assert c3d.read_clip(path).skeleton.joints == LABELS
    assert c3d.read_clip(path, joints=("hip*", "knee")).skeleton.joints == ("hip", "knee")
    assert c3d.read_clip(path, joints=("hipAngles", "knee")).skeleton.joints == ("knee", "hipAngles")


@pytest.mark.slow
def test_the_size_of_the_body_gives_the_unit_of_a_c3d(tmp_path: Path) -> None:
    """Where POINT:UNITS is empty the body's size tells millimetres from metres."""
    for scale in (1.0, 0.001):
        path = written_c3d(tmp_path / "walk.c3d", walk() * scale, unit="")
        np.testing.assert_allclose(c3d.read_clip(path).positions, walk() / 1000, rtol=1e-5)


@pytest.mark.slow
def test_the_error_without_ezc3d_names_the_package_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without ezc3d a C3D is refused with the command that installs it."""
    path = written_c3d(tmp_path / "walk.c3d", walk())
    monkeypatch.setitem(__import__("sys").modules, "ezc3d", None)
    with pytest.raises(C3dError, match=r"reading C3D needs ezc3d: pip install 'kinespace\[c3d\]'"):
        c3d.read_clip(path)


# --- how a TRC is written does not matter ------------------------------------------------------------------------


@pytest.mark.parametrize(
    "rewritten",
    [
        pytest.param(lambda text: text.replace("\n", "\r\n"), id="CRLF"),
        pytest.param(lambda text: text.replace("\n\n", "\n"), id="no empty line"),
        pytest.param(lambda text: text.rstrip("\n"), id="no last line end"),
        pytest.param(lambda text: text.replace("\n", "\t\n"), id="trailing tabs"),
        pytest.param(lambda text: "\N{BYTE ORDER MARK}" + text, id="byte order mark"),
    ],
)
def test_the_same_trc_is_the_same_clip(tmp_path: Path, rewritten: Callable[[str], str]) -> None:
    """Line ends, trailing tabs and a byte order mark make no difference."""
    text = trc_text(LABELS, walk(9))
    expected = trc.read_clip(write_trc(tmp_path / "plain.trc", walk(9)))
    path = tmp_path / "other.trc"
    path.write_text(rewritten(text), newline="", encoding="utf-8")
    np.testing.assert_array_equal(trc.read_clip(path).positions, expected.positions)


# --- broken files -------------------------------------------------------------------------------------------------

GOOD = trc_text(LABELS, walk(3))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("PathFileType", "PathType", ":1: expected PathFileType"),
        ("\tUnits", "\tUnit", ":3: expected a header with DataRate, NumFrames, NumMarkers and Units, no Units"),
        ("\tmm\t", "\tparsec\t", ":3: expected Units like mm or m, got 'parsec'"),
        ("100.0\t100.0", "0\t100.0", ":3: expected a positive DataRate, got '0'"),
        ("\t3\t3\t", "\t3\t4\t", ":4: expected 4 names of markers, got 3"),
        ("\t3\t3\t", "\tx\t3\t", ":3: expected a number as NumFrames, got 'x'"),
        ("\t3\t3\t", "\t4\t3\t", ":9: the file ends after 3 of 4 frames"),
        ("\t3\t3\t", "\t2\t3\t", ":9: the file ends after 3 of 2 frames"),
        ("X1\t", "Q1\t", ":5: expected X1 Y1 Z1"),
        ("\n2\t", "\n2\tone\t", ":8: expected 11 fields, got 12"),
        ("\n2\t0.02\t", "\n2\t0.02\tone", ":8: expected numbers, got 'one"),
        ("knee", "hip", ": the file has 'hip' twice"),
    ],
)
def test_a_trc_that_makes_no_sense_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    """Each mistake is reported with the file and the line."""
    assert old in GOOD
    path = tmp_path / "walk.trc"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(TrcError, match=re.escape(f"{path}{message}")):
        trc.read_clip(path)


def test_a_trc_cut_off_anywhere_is_refused(tmp_path: Path) -> None:
    """The file is refused by name, unless only its last digits are missing."""
    path = tmp_path / "walk.trc"
    for end in range(0, len(GOOD.rpartition("\t")[0]), 5):
        path.write_text(GOOD[:end])
        with pytest.raises(TrcError, match=re.escape(str(path))):
            trc.read_clip(path)


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, len(GOOD)), rubbish=st.binary(max_size=12), lost=st.integers(0, 40))
def test_rubbish_in_a_trc_is_refused_by_name_or_read(tmp_path: Path, place: int, rubbish: bytes, lost: int) -> None:
    """Bytes put in or taken out anywhere end in a clip of finite numbers or in one error that names the file."""
    path = tmp_path / "walk.trc"
    content = GOOD.encode()
    path.write_bytes(content[:place] + rubbish + content[place + lost :])
    told = str(path)
    try:
        assert np.isfinite(trc.read_clip(path).positions).all()
    except RecordingError as error:
        told = str(error)
    assert told.startswith(str(path))


@pytest.mark.slow
def test_a_c3d_cut_off_anywhere_is_refused(tmp_path: Path) -> None:
    """However much of the end is missing, filling bytes aside, the file is refused by name with where it ends."""
    path = written_c3d(tmp_path / "walk.c3d", walk())
    whole = path.read_bytes()
    for end in (0, 1, 20, 100, 512, 700, len(whole) // 2, len(whole) - 512):
        path.write_bytes(whole[:end])
        with pytest.raises(C3dError, match=re.escape(str(path))):
            c3d.read_clip(path)
    path.write_bytes(b"no C3D at all" * 200)
    with pytest.raises(C3dError, match="byte 1: expected a C3D's 0x50"):
        c3d.read_clip(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"UNITS\x08\x00", b"UNITS\x02\x00", "a parameter that ends outside the parameters"),
        (b"UNITS\x08\x00", b"UNITS\xff\x7f", "the parameters have no end"),
        (b"LABELS\x13\x00\xff", b"LABELS\x13\x00\x07", "a parameter that ends outside the parameters"),
        (b"\x04\x01USED\x07\x00\x02\x00\x03\x00", b"\x04\x01USED\x07\x00\x02\x00\x03\x80", "USED is below 0"),
        (b"\x06\xffPOINT"[1:], b"\x80POINT", "parameters of groups that are not there"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(tmp_path: Path, old: bytes, new: bytes, message: str) -> None:
    """Parameters that would lead ezc3d astray are refused beforehand, with their byte."""
    path = written_c3d(tmp_path / "walk.c3d", walk())
    content = path.read_bytes()
    # The program that writes them marks some parameters as locked by a name of negative length.
    content = content.replace(b"\xfc\x01USED", b"\x04\x01USED")
    assert old in content
    path.write_bytes(content.replace(old, new, 1))
    with pytest.raises(C3dError, match=rf"byte \d+: {message}"):
        c3d.read_clip(path)


@pytest.fixture(scope="module")
def process() -> Iterator[C3dProcess]:
    """Give one process for many C3D files."""
    with C3dProcess() as process:
        yield process


#: A parameter of type and dimensions that its reader does not expect under that name, so that it runs off its memory.
BREAKS_THE_READER = (b"RATE\x09\x00\x04\x00", b"RATE\x09\x00\xff\x00")


@pytest.mark.slow
def test_a_c3d_that_breaks_its_reader_breaks_nothing_else(tmp_path: Path) -> None:
    """A file that ends ezc3d's process gives one error that names it; the next file is read."""
    good = written_c3d(tmp_path / "a.c3d", walk())
    bad = tmp_path / "b.c3d"
    bad.write_bytes(good.read_bytes().replace(*BREAKS_THE_READER, 1))
    alone = subprocess.run([sys.executable, "-c", "import ezc3d, sys; ezc3d.c3d(sys.argv[1])", bad], check=False)
    assert alone.returncode != 0, "this ezc3d survives it: another file is needed"
    assert alone.returncode != 1, "an error of Python's breaks nothing"
    told = re.escape(f"{bad}: not a usable C3D (the reader broke down on it)")
    with C3dProcess() as process:
        for _ in range(2):
            with pytest.raises(C3dError, match=told):
                c3d.read_clip(bad, process=process)
            assert c3d.read_clip(good, process=process).frames == 120
    with pytest.raises(C3dError, match=told):
        list(read_recordings([bad]))


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system cannot hold a process")
def test_a_c3d_that_is_never_done_is_given_up(
    tmp_path: Path, process: C3dProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that takes far too long is given up and named, and the next file is read."""
    path = written_c3d(tmp_path / "a.c3d", walk())
    assert c3d.read_clip(path, process=process).frames == 120
    assert process.process_id is not None
    os.kill(process.process_id, signal.SIGSTOP)
    monkeypatch.setattr("kinespace.library.recordings.formats.markers.c3d_process._PATIENCE", 0.2)
    monkeypatch.setattr("kinespace.library.recordings.formats.markers.c3d_process._MIN_RATE", 1e12)
    with pytest.raises(C3dError, match="the reader did not end within 0 s on it"):
        c3d.read_clip(path, process=process)
    monkeypatch.undo()
    assert c3d.read_clip(path, process=process).frames == 120


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited on Linux only")
def test_a_c3d_that_takes_all_memory_is_given_up(
    tmp_path: Path, process: C3dProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that needs far too much memory is given up and named, and the next file is read."""
    path = written_c3d(tmp_path / "a.c3d", np.tile(walk(), (200, 1, 1)))
    monkeypatch.setattr("kinespace.library.recordings.formats.markers.c3d_process._MEMORY", 1 << 18)
    monkeypatch.setattr("kinespace.library.recordings.formats.markers.c3d_process._MEMORY_TIMES", 0)
    with pytest.raises(C3dError, match=re.escape(f"{path}: not a usable C3D")):
        c3d.read_clip(path, process=process)
    monkeypatch.undo()
    assert c3d.read_clip(path, process=process).frames == 24_000


def test_a_built_in_python_reads_c3d_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """When Python cannot be started again, no process is started."""
    path = written_c3d(tmp_path / "a.c3d", walk())
    expected = c3d.read_clip(path)
    monkeypatch.setattr(sys, "executable", "/opt/TouchDesigner/bin/TouchDesigner.exe")
    monkeypatch.setattr(subprocess, "Popen", None)
    np.testing.assert_array_equal(c3d.read_clip(path).positions, expected.positions)


@pytest.mark.slow
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    places=st.lists(st.tuples(st.integers(0, 1100), st.binary(max_size=3), st.integers(0, 3)), min_size=1, max_size=4)
)
def test_rubbish_in_a_c3d_is_refused_by_name_or_read(
    tmp_path: Path, process: C3dProcess, places: list[tuple[int, bytes, int]]
) -> None:
    """Bytes changed in header and parameters end in a clip of finite numbers or in one error that names the file."""
    content, path = written_c3d(tmp_path / "good.c3d", walk()).read_bytes(), tmp_path / "bad.c3d"
    for place, rubbish, lost in places:
        content = content[:place] + rubbish + content[place + lost :]
    path.write_bytes(content)
    told = str(path)
    try:
        assert np.isfinite(c3d.read_clip(path, process=process).positions).all()
    except RecordingError as error:
        told = str(error)
    assert told.startswith(str(path))


def test_a_c3d_with_one_marker_is_refused(tmp_path: Path) -> None:
    """A file with fewer than two labelled points is refused."""
    path = written_c3d(tmp_path / "walk.c3d", walk()[:, :1], ("hip",))
    with pytest.raises(C3dError, match="expected at least 2 labelled points, got 1"):
        c3d.read_clip(path)


@pytest.mark.parametrize("reader", [trc.read_clip, c3d.read_clip])
def test_a_file_that_is_not_there_is_an_os_error(tmp_path: Path, reader: Read) -> None:
    """A missing file is the system's error."""
    with pytest.raises(FileNotFoundError):
        reader(tmp_path / "absent")


# --- the parts ---------------------------------------------------------------------------------------------------


def test_names_are_chosen_by_pattern_in_the_files_order() -> None:
    """Patterns fit whole labels or the part after the colon; the order is the file's; no match is an error."""
    labels = ["a:hip", "a:knee", "b:hip", "toe"]
    assert chosen(labels, ()) == [0, 1, 2, 3]
    assert chosen(labels, ("toe", "hip")) == [0, 2, 3]
    assert chosen(labels, ("a:*", "t?e")) == [0, 1, 3]
    with pytest.raises(ValueError, match="no joint is called 'nose'"):
        chosen(labels, ("hip", "nose"))
    assert short_names(labels[1:]) == ("knee", "hip", "toe")


def test_units_are_known_by_name_and_by_number() -> None:
    """Names in any case and numbers of metres are units; all other texts are refused."""
    assert [metres_of(unit) for unit in ("mm", " CM ", "Meters", "0.0254", "feet")] == [
        0.001,
        0.01,
        1.0,
        0.0254,
        0.3048,
    ]
    assert [metres_of(unit) for unit in ("", "parsec", "-1", "nan", "0", "inf")] == [None] * 6
    assert [guessed_metres(reach) for reach in (0.5, 2.5, 60.0, 250.0, 700.0, 2500.0)] == [
        1,
        1,
        0.01,
        0.01,
        0.001,
        0.001,
    ]


def test_filling_changes_missing_places_alone() -> None:
    """Filling returns the very same array where nothing is missing."""
    positions = walk(20)
    missing = np.zeros((20, 3), dtype=bool)
    assert with_missing_joints(positions, missing, LABELS, RATE) is positions
    missing[3, 1] = True
    filled = with_missing_joints(positions, missing, LABELS, RATE)
    np.testing.assert_array_equal(filled[~missing], positions[~missing])
    np.testing.assert_allclose(filled[3, 1], (positions[2, 1] + positions[4, 1]) / 2)
    with pytest.raises(ValueError, match=r"'knee' is missing for 0\.20 s"):
        with_missing_joints(positions, np.broadcast_to([False, True, False], (20, 3)), LABELS, RATE)
