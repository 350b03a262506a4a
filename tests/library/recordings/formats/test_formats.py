"""The rules that one format alone has: Acclaim and BVH, by hand and on real motions; tables, units, mistakes."""

import dataclasses
import itertools
import re
import tomllib
from pathlib import Path

import naive
import numpy as np
import pytest
from synthetic import ARM, TinyBody, TinyBone, amc_text, arm_frames, write_pair
from written import MOVES, TURNS, Node, bvh_text, csv_table, trc_text

from kinespace.library import Clip
from kinespace.library.distances import distance_rows
from kinespace.library.recordings import RecordingError, RecordingReader, read_recordings
from kinespace.library.recordings.formats import bvh, joint_table
from kinespace.library.recordings.formats.acclaim import find_asf, read_asf, read_clip
from kinespace.library.recordings.formats.errors import number_of
from kinespace.library.recordings.formats.measures import guessed_metres, metres_of
from kinespace.library.signature.body import Body

STILL = [0.0] * 6


# --- Acclaim -----------------------------------------------------------------------------------------------------


def test_without_units_lengths_are_inches_and_angles_degrees(tmp_path: Path) -> None:
    """An ASF that gives no unit has a length unit of one and angles in degrees; its root may have no place."""
    body = TinyBody((TinyBone("rod", length=2.0),))
    asf = re.sub(r":units\n(  .*\n)+|   (position|orientation) .*\n", "", body.asf())
    clip = read_clip(write_pair(tmp_path, asf, amc_text([{"root": STILL, "rod": [0.0, 0.0, 90.0]}], header="")))
    assert clip.positions[0, 1].tolist() == pytest.approx([0, 2 * 0.0254, 0], abs=1e-12)


@pytest.mark.parametrize(("unit", "header"), [("deg", ":RADIANS"), ("rad", ""), ("rad", ":degrees")])
def test_angles_may_be_radians(tmp_path: Path, unit: str, header: str) -> None:
    """The ASF's unit holds for its axes, and for an AMC that names no unit; the slow twin says where joints stand."""
    body = dataclasses.replace(ARM, angle=unit, orientation=(0.1, 0.7, 0.3))
    amc = write_pair(tmp_path, body.asf(), amc_text(arm_frames(2), header=header))
    expected = naive.clip_positions(tmp_path / "tiny.asf", amc)
    np.testing.assert_allclose(read_clip(amc).positions, expected, rtol=1e-9, atol=1e-9)


def test_rotations_are_the_recorded_angles(tmp_path: Path) -> None:
    """A clip's rotations are the AMC's angles in radians, root first, translations left out."""
    frames = arm_frames(5)
    clip = read_clip(write_pair(tmp_path, ARM.asf(), amc_text(frames)))
    expected = [[*frame["root"][3:], *frame["upper"], *frame["lower"]] for frame in frames]
    np.testing.assert_allclose(clip.rotations, np.radians(expected), rtol=1e-15)


@pytest.mark.slow
def test_real_clips_stand_where_the_recursion_puts_them(
    amc_clips: tuple[Clip, ...], some_paths: tuple[Path, ...], hdm05_folder: Path
) -> None:
    """On the first clip of every class each joint of every fortieth frame stands where the slow twin puts it."""
    for clip, path in zip(amc_clips, some_paths, strict=True):
        expected = naive.clip_positions(hdm05_folder / f"HDM_{clip.actor}.asf", path, every=40)
        np.testing.assert_allclose(clip.positions[::40], expected, rtol=1e-9, atol=1e-9)


def test_missing_frames_are_filled_with_straight_lines(tmp_path: Path) -> None:
    """Frames 3, 4, 7, 8, 9 make seven: the two that are missing lie on the line between their neighbours."""
    frames = arm_frames(5)
    there = read_clip(write_pair(tmp_path, ARM.asf(), amc_text(frames, numbers=range(480, 485))))
    assert (there.frames, there.filled) == (5, 0)
    clip = read_clip(write_pair(tmp_path, ARM.asf(), amc_text(frames, numbers=(3, 4, 7, 8, 9))))
    assert clip.filled == 2 * 4
    for filled, known in ((clip.positions, there.positions), (clip.rotations, there.rotations)):
        np.testing.assert_allclose(filled[[0, 1, 4, 5, 6]], known, rtol=1e-15)
        np.testing.assert_allclose(filled[2], (2 * known[1] + known[2]) / 3, rtol=1e-12)
        np.testing.assert_allclose(filled[3], (known[1] + 2 * known[2]) / 3, rtol=1e-12)
    assert read_clip(write_pair(tmp_path, ARM.asf(), amc_text(frames[:3], numbers=(1, 2, 6)))).frames == 6


@pytest.mark.parametrize(
    ("name", "header", "given_rate", "expected"),
    [
        ("tiny_01.amc", ":DEGREES", None, 120.0),
        ("tiny_01.amc", ":SAMPLES-PER-SECOND 60", None, 60.0),
        ("HDM_bd_wave_001_240.amc", ":SAMPLES-PER-SECOND 60", None, 240.0),
        ("HDM_bd_wave_001_240.amc", ":SAMPLES-PER-SECOND 60", 30.0, 30.0),
    ],
)
def test_frame_rate_comes_from_caller_name_file_or_habit(
    tmp_path: Path, name: str, header: str, given_rate: float | None, expected: float
) -> None:
    """The caller's rate is used first, then the name's, then the file's, else 120."""
    amc = write_pair(tmp_path, ARM.asf(), amc_text(arm_frames(3), header=header))
    body = read_asf(tmp_path / "tiny.asf")
    assert read_clip(amc.rename(tmp_path / name), body, frame_rate=given_rate).frame_rate == expected


@pytest.mark.parametrize(
    ("name", "skeleton"),
    [("HDM_bd_squat1Reps_001_120", "HDM_bd"), ("13_29", "13"), ("walk", "walk"), ("walk_01_120", "walk_01_120")],
)
@pytest.mark.parametrize("endings", [*itertools.product([".amc", ".AMC", ".Amc"], [".asf", ".ASF"])])
@pytest.mark.parametrize("folder", [".", ".."])
def test_the_skeleton_is_found_by_name(
    tmp_path: Path, name: str, skeleton: str, endings: tuple[str, str], folder: str
) -> None:
    """An actor's, a subject's or the motion's own skeleton is found in its folder or one folder up, in any case."""
    place = tmp_path / "class"
    place.mkdir()
    amc = place / f"{name}{endings[0]}"
    with pytest.raises(
        RecordingError, match=rf"{name}\..*: no skeleton .*{skeleton}\.asf.* in its folder or one folder up"
    ):
        find_asf(amc)
    asf = place / folder / f"{skeleton}{endings[1]}"
    asf.touch()
    assert find_asf(amc).samefile(asf)
    (place / f"{skeleton}.asf").touch()
    assert find_asf(amc).parent == place


# --- BVH ---------------------------------------------------------------------------------------------------------


def test_joints_that_always_coincide_are_one(tmp_path: Path) -> None:
    """A joint at its parent's place, or a sister's, is left out; its children move to the joint that stays."""
    left = Node("left", (0.0, 1.0, 0.0), TURNS, [Node("left_end", (1.0, 0.0, 0.0))])
    right = Node("right", (0.0, 1.0, 0.0), TURNS, [Node("right_end", (-1.0, 0.0, 0.0))])
    same = Node("same", (0.0, 0.0, 0.0), TURNS, [left, right])
    frames = np.random.default_rng(1).uniform(-90, 90, (5, 15)).tolist()
    path = tmp_path / "tiny.bvh"
    path.write_text(bvh_text(Node("hip", (0.0, 0.0, 0.0), (*MOVES, *TURNS), [same]), frames))
    clip = bvh.read_clips(path)[0]
    assert clip.skeleton.joints == ("hip", "left", "left_end", "right_end")
    assert clip.skeleton.parents == (-1, 0, 1, 1)
    body = Body.of(clip.skeleton)
    lengths = distance_rows(clip.positions, clip.skeleton)[:, body.segments]
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], lengths.shape), atol=1e-12)
    with pytest.raises(ValueError, match="'same' always coincides with another chosen joint"):
        bvh.read_clips(path, joints=("hip", "same"))
    chosen = bvh.read_clips(path, joints=("same", "left_end", "right_end"))[0]
    assert (chosen.skeleton.joints, chosen.skeleton.parents) == (("same", "left_end", "right_end"), (-1, 0, 0))


@pytest.mark.parametrize(
    ("period", "rate"),
    [
        *(("0.01", 100.0), ("0.008333", 120.0), (".0083333", 120.0), ("0.033333", 30.0), ("0.0333", 30.0)),
        *(("0.0417083", 1 / 0.0417083), ("8.3e-3", 1 / 0.0083), ("1", 1.0), (repr(1 / 60), 60.0), ("2.5", 0.4)),
    ],
)
def test_the_rate_is_the_whole_number_the_period_was_rounded_from(tmp_path: Path, period: str, rate: float) -> None:
    """A rounded Frame Time means the whole number of frames per second it was rounded from."""
    root = Node("hip", (0.0, 0.0, 0.0), TURNS, [Node("hip_end", (0.0, 1.0, 0.0))])
    (tmp_path / "tiny.bvh").write_text(bvh_text(root, [[0.0] * 3], period))
    assert bvh.read_clips(tmp_path / "tiny.bvh")[0].frame_rate == pytest.approx(rate, rel=1e-12)


def test_roots_without_joints_are_no_body(tmp_path: Path) -> None:
    """A file of such alone is refused in words."""
    alone = "ROOT {}\n{{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n}}\n"
    motion = "MOTION\nFrames: 2\nFrame Time: 0.05\n0 0 0 0 0 0\n0 0 0 0 0 0\n"
    (tmp_path / "roots.bvh").write_text(f"HIERARCHY\n{alone.format('a')}{alone.format('b')}{motion}", encoding="utf-8")
    with pytest.raises(RecordingError, match="expected a ROOT with joints"):
        list(read_recordings([tmp_path / "roots.bvh"]))


# --- tables -----------------------------------------------------------------------------------------------------------


def table(folder: Path, text: str) -> Clip:
    """Write a table and read it."""
    (folder / "take.csv").write_text(text)
    return joint_table.read_clips(folder / "take.csv")[0]


def test_uneven_times_are_put_on_an_even_grid(tmp_path: Path) -> None:
    """Positions that grow with time grow with it on the grid too, whenever the frames came; other columns go by."""
    times = np.arange(60) / 30 + np.random.default_rng(1).uniform(-0.004, 0.004, 60)
    rows = "".join(f"{n},{time},{time},0,1,2,0.5,{2 * time}\n" for n, time in enumerate(times))
    clip = table(tmp_path, "frame,time,a_x,a_y,a_z,b_z,b_x,b_y\n" + rows)
    assert clip.frame_rate == 30
    moved = np.diff(clip.positions, axis=0)
    np.testing.assert_allclose(moved, np.broadcast_to([[1 / 30, 0, 0], [0, 2 / 30, 0]], moved.shape), atol=1e-9)


def test_times_that_hardly_differ_are_none(tmp_path: Path) -> None:
    """Numbers that differ by the least a computer can tell count nothing."""
    rows = "".join(f"{number * 5e-324},0,1,{number},0,0,1\n" for number in range(5))
    assert table(tmp_path, "time,a_x,a_y,a_z,b_x,b_y,b_z\n" + rows).frame_rate == 30


def test_a_gap_is_listed(tmp_path: Path) -> None:
    """During two seconds without frames the body stays where it was last seen, and the clip lists the gap."""
    times = [*np.arange(10) / 20, *(2.45 + np.arange(10) / 20)]
    rows = "".join(f"{time},{time},0,1,0.5,{2 * time},2\n" for time in times)
    clip = table(tmp_path, "time,a_x,a_y,a_z,b_x,b_y,b_z\n" + rows)
    assert clip.gaps == (pytest.approx((0.45, 2.45)),)
    assert clip.positions[30, 0, 0] == pytest.approx(0.45)


def test_short_words_over_axes_are_markers(tmp_path: Path) -> None:
    """Where axes have a row of their own `L.Acc` is no acceleration; beside an axis it is."""
    labels, path = ("hip", "L.Acc", "RFOR"), tmp_path / "take.trc"
    path.write_text(trc_text(labels, np.random.default_rng(6).uniform(0, 900, (4, 3, 3))))
    assert joint_table.read_clips(path)[0].skeleton.joints == labels
    row = "0,1,2,3,4,5,6,7,8,9\n"
    assert (
        "no positions: L.Acc"
        in table(
            tmp_path,
            "t,"
            + ",".join(f"{name}_{axis}" for name in ("hip", "knee", "L.Acc") for axis in "xyz")
            + "\n"
            + row
            + row.replace("0,", "0.1,", 1),
        ).notes[0]
    )


# --- the parts ---------------------------------------------------------------------------------------------------


def test_units_are_known_by_name_and_by_number() -> None:
    """Names in any case and numbers of metres are units; all other texts are refused."""
    known = {"mm": 0.001, " CM ": 0.01, "Meters": 1.0, "0.0254": 0.0254, "feet": 0.3048, "mete": 1.0, "(mm)": 0.001}
    assert [metres_of(unit) for unit in known] == [*known.values()]
    assert [metres_of(unit) for unit in ("", "parsec", "-1", "nan", "0", "inf")] == [None] * 6
    guesses = {0.5: 1, 16.0: 1, 16.1: 0.01, 500.0: 0.01, 501.0: 0.001, 2500.0: 0.001}
    for size, metres in guesses.items():
        seen = np.array([[0.0, 0.0, 0.0], [0.0, size, 0.0], [np.nan] * 3])
        assert guessed_metres(np.stack([seen[[0, 2, 2]], seen, seen])) == metres
    for size, metres in {16.0: 1, 46.0: 0.0254 / 0.45, 100.0: 0.0254, 100.1: 0.01}.items():
        assert guessed_metres(np.array([[[0, 0, 0], [0, size, 0]]]), ("Head", "LeftFoot")) == metres
    assert guessed_metres(np.full((2, 3, 3), np.nan)) == 1.0
    # Of two joints that a frame has neither is a thing, however far apart they are.
    few = np.random.default_rng(0).normal(scale=0.4, size=(48, 12, 3))
    few[5, 2:], few[5, :2] = np.nan, [[20.0, 0.0, 0.0], [-20.0, 0.0, 0.0]]
    assert guessed_metres(few) == 1.0
    # Fingers that are not tracked stand at the wrist, and a face has most of the points.
    body, mesh = np.linspace([0, 0, 0], [0.5, 1.7, 0.3], 12), np.linspace([0.4, 1.5, 0.2], [0.42, 1.62, 0.24], 68)
    for many in (np.repeat(body[6:7], 20, axis=0), mesh):
        for unit in (1.0, 0.01, 0.001):
            assert guessed_metres(np.concatenate([body, many])[None] / unit) == unit


# --- every mistake is refused in a line that says what was expected, and where ----------------------------------------


AMC = (
    ":FULLY-SPECIFIED\n:DEGREES\n1\nroot 0 0 0 0 0 0\nupper 1 2 3\nlower 4\n2\nroot 0 0 0 0 0 0\nupper 1 2 3\nlower 4\n"
)
LOWER = Node("lower", (2.0, 0.0, 0.0), TURNS, [Node("lower_end", (0.5, 0.0, 0.0))])
BODY = Node("hip", (0.0, 0.0, 0.0), (*MOVES, *TURNS), [Node("upper", (0.0, 1.0, 0.0), TURNS, [LOWER])])
WALK = np.random.default_rng(3).uniform(0.0, 900.0, (3, 3, 3))
LABELS = ("hip", "knee", "heel")
GOOD = {
    "amc": AMC,
    "asf": ARM.asf(),
    "bvh": bvh_text(BODY, np.random.default_rng(3).uniform(-90, 90, (4, 12)).tolist()),
    "trc": trc_text(LABELS, WALK),
    "csv": csv_table(LABELS[:2], WALK[:, :2]),
}
#: By ending: what is replaced, by what, and the message behind the file's name.
BROKEN = tomllib.loads(Path(__file__).with_name("mistakes.toml").read_text(encoding="utf-8"))
BROKEN["amc"] += [
    ("\n2\n", f"\n{'9' * 5000}\n", r":7: expected a frame number "),
    (AMC[AMC.index("1\n") :], "", r":2: no frames in it"),
]
BROKEN["asf"] += [
    (ARM.asf()[ARM.asf().index(":bonedata") :], "", r": not a usable ASF skeleton, no :bonedata in it"),
]
BROKEN["bvh"] += [
    (
        GOOD["bvh"][GOOD["bvh"].index("JOINT upper") : GOOD["bvh"].index("}\nMOTION")],
        "",
        ":7: expected a hierarchy of",
    ),
    (GOOD["bvh"][GOOD["bvh"].index("MOTION") :], "", ":20: expected HIERARCHY and MOTION"),
    ("Frame Time: 0.01\n", "Frame Time: 0.01\n" + "x " * 12 + "\n", ":24: expected numbers, got 'x x"),
    (
        "Frames: 4\nFrame Time: 0.01\n",
        "Frames: 5\nFrame Time: 0.01\n" + "nan " * 12 + "\n",
        ":24: expected finite num",
    ),
]
BROKEN["csv"] += [
    (GOOD["csv"][GOOD["csv"].index("\n0.01") :], "", ": expected at least 2 frames, got 1"),
]


@pytest.mark.parametrize(
    ("ending", "old", "new", "message"), [(ending, *row) for ending, rows in BROKEN.items() for row in rows]
)
def test_a_mistake_is_named_with_its_file_and_its_line(
    tmp_path: Path, ending: str, old: str, new: str, message: str
) -> None:
    """The line counts as an editor counts; where no line is at fault the frame is named, or the file alone."""
    spoilt = GOOD[ending].replace(old, new, 1)
    assert spoilt != GOOD[ending]
    if ending in ("amc", "asf"):
        path = write_pair(tmp_path, spoilt if ending == "asf" else GOOD["asf"], spoilt if ending == "amc" else AMC)
    else:
        path = tmp_path / f"take.{ending}"
        path.write_text(spoilt)
    named = tmp_path / "tiny.asf" if ending == "asf" else path
    wanted = message if ending in ("amc", "asf") else re.escape(message)
    with pytest.raises(RecordingError, match=f"^{re.escape(str(named))}{wanted}"):
        RecordingReader().clip(path)


def test_a_plain_blank_stands_between_numbers() -> None:
    """Three coordinates in a field are no number with thousands; blanks that do not break are."""
    assert number_of("100 200 300.5") is None
    assert number_of("1\u202f160.5") == number_of("1'160.5") == 1160.5
