"""Every format by the same properties: what was written is read, however it was written; anything else is refused."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from written import METRES, TURNS, Node, Written, bvh_text, csv_table, trc_text, write_c3d, written

from kinespace.library import Clip
from kinespace.library.memory import limited_to
from kinespace.library.recordings import Reading, RecordingError, RecordingReader
from kinespace.library.recordings.formats.measures import MAX_GAP

HIERARCHIES, MARKERS, TABLES = ("amc", "bvh"), ("c3d",), ("csv", "npz", "trc")
TEXTS = ("amc", "bvh", "trc", "csv")
every_format = pytest.mark.parametrize("ending", [*HIERARCHIES, *MARKERS, *TABLES])
#: A test's folder is the same for all examples, each of which writes over the files of the one before.
one_folder = settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
seeds = st.integers(0, 2**32 - 1)


def read(path: Path, reading: Reading | None = None) -> Clip:
    """Read a recording."""
    return RecordingReader(reading).clip(path)


def assert_same(clip: Clip, other: Written, *, metres: float = 1.0) -> None:
    """Hold a clip against what was written."""
    order = [clip.skeleton.joints.index(name) for name in other.joints]
    assert len(clip.skeleton.joints) == len(other.joints)
    np.testing.assert_allclose(clip.positions[:, order], other.positions * metres, rtol=1e-6, atol=1e-6)
    assert clip.frame_rate == pytest.approx(other.rate)
    assert (clip.name, clip.filled) == ("take", 0)


@every_format
@one_folder
@given(seed=seeds, shuffled=st.booleans())
def test_what_was_written_is_read(tmp_path: Path, ending: str, seed: int, *, shuffled: bool) -> None:
    """Joints stand where the slow twin, or the writer, put them, in whichever order the file has them."""
    generator = np.random.default_rng(seed)
    assert_same(read((made := written(ending, tmp_path, generator, shuffled=shuffled)).path), made)


@pytest.mark.parametrize("unit", ["m", "cm", "mm", "in"])
@pytest.mark.parametrize("ending", ["amc", "bvh", "c3d", "trc", "csv"])
def test_any_unit_is_the_same_clip(tmp_path: Path, ending: str, unit: str) -> None:
    """Units are named by the file, or guessed by the body's size; a unit given is used before both."""
    made = written(ending, tmp_path, np.random.default_rng(4), unit=unit)
    if unit != "in" or ending not in ("bvh", "csv"):
        assert_same(read(made.path), made)
    if ending != "amc":
        assert_same(read(made.path, Reading(unit=unit)), made)
        assert_same(read(made.path, Reading(unit="2.0")), made, metres=2.0 / METRES[unit])


@every_format
def test_options_are_the_same_for_all(tmp_path: Path, ending: str) -> None:
    """A rate that is given, joints that are chosen, and HDM05's names, wherever they make sense."""
    made = written(ending, tmp_path, np.random.default_rng(5))
    # A table has times: with another rate its frames are computed anew.
    assert ending in TABLES or read(made.path, Reading(frame_rate=50.0)).frames == len(made.positions)
    assert read(made.path, Reading(frame_rate=50.0)).frame_rate == 50.0
    wanted = made.joints[1:]
    clip = read(made.path, Reading(joints=("?" + wanted[0][1:], *wanted[1:])))
    assert clip.skeleton.joints == wanted
    np.testing.assert_array_equal(clip.positions, read(made.path).positions[:, 1:])
    with pytest.raises(RecordingError, match=re.escape(f"{made.path}: no joint is called 'nose'; there are ")):
        read(made.path, Reading(joints=("nose",)))
    if ending != "npz":
        named = made.path.rename(tmp_path / f"HDM_bd_walk_003_100.{ending}")
        clip = read(named, Reading(asf=tmp_path / "take.asf" if ending == "amc" else None))
        assert (clip.class_name, clip.actor, clip.take, clip.frame_rate) == ("walk", "bd", "003", pytest.approx(100.0))


@every_format
def test_what_takes_too_much_memory_is_refused_before_it_is_read(tmp_path: Path, ending: str) -> None:
    """One line names the limit, what the file would take, and the option that allows it."""
    path = written(ending, tmp_path, np.random.default_rng(6)).path
    message = rf"take\.{ending}: memory: expected at most 0 MB once it is read, got 0 MB; kinespace --max-memory .*GB"
    with limited_to(100), pytest.raises(RecordingError, match=message):
        read(path)
    if ending not in TABLES:
        # Four times its size, whatever is in it.
        path.write_bytes(b"no recording" * 40)
        with limited_to(3 * 480), pytest.raises(RecordingError, match=message):
            read(path)


@pytest.mark.parametrize("ending", ["trc", "csv", "bvh"])
def test_short_numbers_take_memory_too(tmp_path: Path, ending: str) -> None:
    """A text of many short numbers is refused by their count, because its length does not show it."""
    path, none = tmp_path / f"take.{ending}", np.zeros((300, 5, 3))
    tip = Node("tip", (0.0, 1.0, 0.0), TURNS, [Node("end", (0.0, 1.0, 0.0))])
    made = {"trc": trc_text, "csv": csv_table}.get(ending)
    text = made("abcde", none) if made else bvh_text(Node("hip", (0.0,) * 3, TURNS, [tip]), none[:, :2].reshape(300, 6))
    path.write_text(text.replace("0.0", "0"))
    with limited_to(5 * len(text)), pytest.raises(RecordingError, match="memory: expected at most"):
        read(path)


# --- how a text is written does not matter -----------------------------------------------------------------------

REWRITTEN: dict[str, tuple[tuple[str, ...], Callable[[str], str]]] = {
    "CRLF": (TEXTS, lambda text: text.replace("\n", "\r\n")),
    "no last line end": (TEXTS, lambda text: text.rstrip("\n")),
    "empty lines": (("amc", "bvh", "csv", "trc"), lambda text: text.replace("\n", "\n\n")),
    "no empty lines": (("trc",), lambda text: text.replace("\n\n", "\n")),
    "tabs and trailing blanks": (HIERARCHIES, lambda text: text.replace(" ", "\t\t").replace("\n", " \t\n")),
    "trailing tabs": (("trc",), lambda text: text.replace("\n", "\t\n")),
    "a byte order mark": (("bvh", "trc", "csv"), lambda text: "\N{BYTE ORDER MARK}" + text),
    "comments": (("amc",), lambda text: "# first\n" + text.replace("\n", "   # länger\n#\n")),
    "case": (("bvh",), lambda text: text.replace("rotation", "ROTATION").replace("ROOT", "root")),
    "braces on the line": (("bvh",), lambda text: text.replace("\n{", " {")),
    "a performer's prefix": (("bvh",), lambda text: text.replace("joint ", "ann:joint ")),
}


@pytest.mark.parametrize(
    ("ending", "rewritten"),
    [pytest.param(ending, change, id=f"{ending}, {name}") for name, (of, change) in REWRITTEN.items() for ending in of],
)
def test_the_same_words_are_the_same_clip(tmp_path: Path, ending: str, rewritten: Callable[[str], str]) -> None:
    """Line ends, white space, marks, comments, case and prefixes make no difference, in a skeleton's file neither."""
    made = written(ending, tmp_path, np.random.default_rng(7), frames=6)
    expected = read(made.path)
    for path in (made.path, tmp_path / "take.asf") if ending == "amc" else (made.path,):
        text = path.read_text()
        with path.open("w", encoding="latin-1" if ending == "amc" else "utf-8", newline="") as file:
            file.write(rewritten(text))
    clip = read(made.path)
    assert clip.skeleton == expected.skeleton
    np.testing.assert_array_equal(clip.positions, expected.positions)
    np.testing.assert_array_equal(clip.rotations, expected.rotations)


# --- joints that are not seen, or twice --------------------------------------------------------------------------


def walked(ending: str, folder: Path, positions: np.ndarray, labels: tuple[str, ...] = ("hip", "knee", "heel")) -> Path:
    """Write millimetres of markers, NaN where one is not seen."""
    path = folder / f"walk.{ending}"
    if ending == "c3d":
        write_c3d(path, labels, positions)
    else:
        path.write_text((trc_text if ending == "trc" else csv_table)(labels, positions))
    return path


def walk(frames: int = 120) -> np.ndarray:
    """Make three markers that go straight ahead and swing a little, millimetres."""
    start = np.array([[10.0, 900.0, 5.0], [12.0, 500.0, 6.0], [14.0, 60.0, 7.0]])
    return start + np.cumsum(np.random.default_rng(2).normal(1.0, 0.5, (frames, 3, 3)), axis=0)


@pytest.mark.parametrize("ending", [*MARKERS, "csv", "trc"])
def test_markers_out_of_sight_stand_on_straight_lines(tmp_path: Path, ending: str) -> None:
    """So do markers at exactly 0, 0, 0; one that is missing for longer than the bound is left out."""
    positions = walk()
    expected = positions.copy()
    expected[11:20, 1] = positions[10, 1] + np.linspace(0, 1, 11)[1:-1, None] * (positions[20, 1] - positions[10, 1])
    expected[:5, 0] = positions[5, 0]
    expected[50, 2] = (positions[49, 2] + positions[51, 2]) / 2
    positions[11:20, 1] = positions[:5, 0] = np.nan
    positions[50, 2] = 0.0
    clip = read(walked(ending, tmp_path, positions), Reading(unit="mm"))
    np.testing.assert_allclose(clip.positions, expected / 1000, rtol=1e-5)
    assert clip.filled == 9 + 5 + 1
    positions = walk()
    positions[7 : 7 + int(MAX_GAP * 100), 1] = np.nan
    clip = read(walked(ending, tmp_path, positions))
    assert (clip.filled, clip.notes) == (int(MAX_GAP * 100), ())
    positions[7 + int(MAX_GAP * 100), 1] = np.nan
    clip = read(walked(ending, tmp_path, positions))
    assert clip.skeleton.joints == ("hip", "heel")
    assert clip.notes == ("left out: 1 of 3 markers: knee (not seen in 42%)",)
    # Where most are missing nobody is there: the body rests.
    positions[30:90] = np.nan
    clip = read(walked(ending, tmp_path, positions), Reading(joints=("hip", "heel"), unit="mm"))
    assert clip.gaps == ((0.3, 0.9),)
    np.testing.assert_array_equal(clip.positions[30:90], np.broadcast_to(clip.positions[29], (60, 2, 3)))
    assert clip.notes == ("not seen: too many markers from 0.30 to 0.90 s; the body rests",)


def test_markers_that_are_missing_by_turns_do_not_stop_the_body(tmp_path: Path) -> None:
    """Where one marker or another is missing nearly always those that are seen always are read, not a body at rest."""
    positions = np.concatenate([walk(400), walk(400)[:, :2] + 200], axis=1)
    for place in range(3):
        positions[130 * place : 130 * (place + 1), place] = np.nan
    clip = read(walked("csv", tmp_path, positions, ("hip", "knee", "heel", "toe", "hand")), Reading(unit="mm"))
    assert (clip.skeleton.joints, clip.gaps) == (("toe", "hand"), ())
    np.testing.assert_allclose(clip.positions, positions[:, 3:] / 1000, rtol=1e-6)
    assert clip.notes[0].startswith("left out: 3 of 5 markers: hip (not seen in 32%)")


@pytest.mark.parametrize("ending", [*MARKERS, "csv", "trc"])
def test_of_two_performers_one_must_be_chosen(tmp_path: Path, ending: str) -> None:
    """`ann:hip` is called `hip`; two performers are two clips, and where one is expected, that is said."""
    both = np.concatenate([walk(), walk() + 500], axis=1)
    labels = tuple(f"{who}:{label}" for who in ("ann", "bob") for label in ("hip", "knee", "heel"))
    path = walked(ending, tmp_path, both, labels)
    with pytest.raises(RecordingError, match=r"the recording has several performers \(ann, bob\)"):
        read(path)
    clip = read(path, Reading(joints=("bob:*",), unit="mm"))
    assert clip.skeleton.joints == ("hip", "knee", "heel")
    np.testing.assert_allclose(clip.positions, (walk() + 500) / 1000, rtol=1e-6)
    # A joint each is no body each.
    path = walked(ending, tmp_path, both[:, [0, 3]], ("ann:hip", "bob:hip"))
    assert read(path, Reading(unit="mm")).skeleton.joints == ("hip", "hip_2")


# --- broken files ------------------------------------------------------------------------------------------------


def read_or_refused(path: Path) -> Clip | None:
    """Read a recording, or see it refused in one line that names a file of its folder."""
    told, clip = str(path), None
    try:
        clip = read(path)
    except RecordingError as error:
        told = str(error)
    assert told.startswith(str(path.parent))
    assert "\n" not in told
    assert clip is None or np.isfinite(clip.positions).all()
    return clip


@pytest.mark.slow
@every_format
def test_a_file_cut_anywhere_is_refused_or_has_fewer_frames(tmp_path: Path, ending: str) -> None:
    """What is left is never made up: the frames but the last, whose last number may be cut short, are those written."""
    path = written(ending, tmp_path, np.random.default_rng(8), frames=3).path
    whole, content = read(path), path.read_bytes()
    read_anyway = 0
    for length in range(0, len(content), 7):
        path.write_bytes(content[:length])
        if clip := read_or_refused(path):
            read_anyway += clip.frames < whole.frames and not clip.notes
            there = [
                whole.skeleton.joints.index(name) for name in clip.skeleton.joints if name in whole.skeleton.joints
            ]
            if len(there) == len(clip.skeleton.joints):
                np.testing.assert_array_equal(clip.positions[:-1], whole.positions[: clip.frames - 1, there])
    # A line that is cut between two numbers' digits, and a table that says nowhere how many frames it has.
    assert read_anyway < (len(content) / 9 if ending in ("amc", "csv") else 1)
    path.write_bytes(content)
    if ending == "amc":
        asf = tmp_path / "take.asf"
        text = asf.read_text()
        for length in range(0, len(text), 7):
            asf.write_text(text[:length])
            if clip := read_or_refused(path):
                assert clip.skeleton == whole.skeleton
