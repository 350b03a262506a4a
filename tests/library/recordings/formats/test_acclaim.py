"""Acclaim files: geometry worked out by hand, the slow twin on real and on random bodies, and every bad input."""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from synthetic import ARM, METRE, TinyBody, TinyBone, amc_text, arm_frames, write_pair

from kinespace.library.recordings.formats.acclaim import AcclaimError, find_asf, read_asf, read_clip

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from kinespace.library.clip import Clip

#: One bone of two metres along x, turning freely.
ROD = TinyBody((TinyBone("rod", length=2.0),))
ORDERS = ["".join(order) for order in itertools.permutations("XYZ")]
STILL = [0.0] * 6


def _tip(folder: Path, body: TinyBody, frame: dict[str, list[float]], header: str = ":DEGREES") -> list[float]:
    """Give where the last joint stands in one frame."""
    clip = read_clip(write_pair(folder, body.asf(), amc_text([frame], header=header)))
    place: list[float] = clip.positions[0, -1].tolist()
    return place


# --- geometry by hand --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("angles", "tip"),
    [
        pytest.param((0, 0, 0), (2, 0, 0), id="rest"),
        pytest.param((90, 0, 0), (2, 0, 0), id="about its own length"),
        pytest.param((0, 90, 0), (0, 0, -2), id="about y, x goes to -z"),
        pytest.param((0, 0, 90), (0, 2, 0), id="about z, x goes to y"),
        pytest.param((90, 0, 90), (0, 2, 0), id="x before z"),
        pytest.param((90, 90, 0), (0, 0, -2), id="x before y"),
        pytest.param((0, 90, 90), (0, 0, -2), id="y before z, which leaves -z alone"),
        pytest.param((0, 0, 30), (math.sqrt(3), 1, 0), id="thirty degrees"),
    ],
)
@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_a_bone_turns_by_the_right_hand_x_first(
    tmp_path: Path, angles: tuple[float, ...], tip: tuple[float, ...], unit: str
) -> None:
    """XYZ turns about x first, then y, then z, each by the right hand, in degrees and in radians."""
    header = ":DEGREES" if unit == "deg" else ":RADIANS"
    values = [math.radians(angle) if unit == "rad" else float(angle) for angle in angles]
    assert _tip(tmp_path, ROD, {"root": STILL, "rod": values}, header) == pytest.approx(tip, abs=1e-12)


@pytest.mark.parametrize(
    ("order", "tip"),
    [("XYZ", (0, 0, -2)), ("YXZ", (-2, 0, 0)), ("ZYX", (0, 0, 2)), ("ZXY", (2, 0, 0)), ("xzy", (0, 2, 0))],
)
def test_axis_order_says_which_turn_comes_first(tmp_path: Path, order: str, tip: tuple[float, ...]) -> None:
    """A quarter turn about each axis ends elsewhere for each order of turning, worked out on the fingers."""
    body = TinyBody((TinyBone("rod", length=2.0, axis_order=order),))
    assert _tip(tmp_path, body, {"root": STILL, "rod": [90.0, 90.0, 90.0]}) == pytest.approx(tip, abs=1e-12)


def test_a_bone_turns_in_its_axis_frame(tmp_path: Path) -> None:
    """A bone whose axis frame is turned a quarter about z turns about the world's y where its `dof` says x."""
    body = TinyBody((TinyBone("rod", length=2.0, axis=(0.0, 0.0, 90.0), dof=("rx",)),))
    assert _tip(tmp_path, body, {"root": STILL, "rod": [90.0]}) == pytest.approx((0, 0, -2), abs=1e-12)


def test_a_child_turns_with_its_parent(tmp_path: Path) -> None:
    """Upper arm up, lower arm back by as much: the hand points along x again from the elbow."""
    frame = {"root": STILL, "upper": [0.0, 0.0, 90.0], "lower": [-90.0]}
    clip = read_clip(write_pair(tmp_path, ARM.asf(), amc_text([frame])))
    expected = [[0, 0, 0], [0, 1, 0], [1, 1, 0], [1.5, 1, 0]]
    np.testing.assert_allclose(clip.positions[0], expected, atol=1e-12)


def test_the_root_moves_and_turns_everything(tmp_path: Path) -> None:
    """The root's translation shifts, its rotation turns the whole body about the root."""
    frame = {"root": [1.0, 2.0, 3.0, 0.0, 0.0, 90.0], "upper": [0.0] * 3, "lower": [0.0]}
    clip = read_clip(write_pair(tmp_path, ARM.asf(), amc_text([frame])))
    expected = [[1, 2, 3], [1, 3, 3], [1, 4, 3], [1, 4.5, 3]]
    np.testing.assert_allclose(clip.positions[0], expected, atol=1e-12)


def test_root_order_says_which_number_is_which(tmp_path: Path) -> None:
    """The root's numbers are read in the order its `order` names them, rotations before translations if so."""
    body = dataclasses.replace(ROD, root_order="RZ RY RX TZ TY TX")
    frame = {"root": [90.0, 0.0, 0.0, 3.0, 2.0, 1.0], "rod": [0.0, 0.0, 0.0]}
    assert _tip(tmp_path, body, frame) == pytest.approx((1, 4, 3), abs=1e-12)


def test_root_axis_says_which_turn_comes_first(tmp_path: Path) -> None:
    """The root's `axis` ZYX turns about z first, where XYZ would turn about y before it."""
    body = dataclasses.replace(ROD, root_axis="ZYX")
    frame = {"root": [0.0, 0.0, 0.0, 0.0, 90.0, 90.0], "rod": [0.0, 0.0, 0.0]}
    assert _tip(tmp_path, body, frame) == pytest.approx((0, 2, 0), abs=1e-12)


def test_root_position_is_where_the_root_starts(tmp_path: Path) -> None:
    """The root's `position` is added to every frame's translation."""
    body = dataclasses.replace(ROD, position=(10.0, 20.0, 30.0))
    frame = {"root": [1.0, 2.0, 3.0, 0.0, 0.0, 0.0], "rod": [0.0, 0.0, 0.0]}
    assert _tip(tmp_path, body, frame) == pytest.approx((13, 22, 33), abs=1e-12)


def test_root_orientation_is_the_frame_it_turns_in(tmp_path: Path) -> None:
    """A root oriented a quarter about z, turned about its x, turns about the world's y, and not at rest."""
    body = dataclasses.replace(ROD, orientation=(0.0, 0.0, 90.0))
    rest, turned = STILL, [0.0, 0.0, 0.0, 90.0, 0.0, 0.0]
    assert _tip(tmp_path, body, {"root": rest, "rod": [0.0] * 3}) == pytest.approx((2, 0, 0), abs=1e-12)
    assert _tip(tmp_path, body, {"root": turned, "rod": [0.0] * 3}) == pytest.approx((0, 0, -2), abs=1e-12)


@pytest.mark.parametrize("dof", [*itertools.permutations(("rx", "ry", "rz")), ("rz", "rx"), ("ry",), ("RZ", "RY")])
def test_dof_says_which_number_is_which(tmp_path: Path, dof: tuple[str, ...]) -> None:
    """Angles given in any order of `dof`, omitted angles as zero, put the bone in the same place."""
    angles = {"rx": 20.0, "ry": 50.0, "rz": -70.0}
    named = [word.lower() for word in dof]
    full = {"root": STILL, "rod": [angles[word] if word in named else 0.0 for word in ("rx", "ry", "rz")]}
    expected = _tip(tmp_path, ROD, full)
    body = TinyBody((TinyBone("rod", length=2.0, dof=dof),))
    assert _tip(tmp_path, body, {"root": STILL, "rod": [angles[word] for word in named]}) == pytest.approx(expected)


def test_a_bone_without_dof_is_rigid(tmp_path: Path) -> None:
    """A bone without degrees of freedom has no line in the AMC and keeps its place on its parent."""
    clip = read_clip(write_pair(tmp_path, ARM.asf(), amc_text(arm_frames(20))))
    lower, hand = clip.positions[:, 2], clip.positions[:, 3]
    forearm = lower - clip.positions[:, 1]
    np.testing.assert_allclose(hand - lower, 0.5 * forearm, atol=1e-12)


@pytest.mark.parametrize(("length", "metres"), [(METRE, 1.0), (1.0, 0.0254), (0.45, 0.0254 / 0.45)])
def test_lengths_are_scaled_to_metres(tmp_path: Path, length: float, metres: float) -> None:
    """Bones, the root's position and its translations are all in the unit that `length` gives."""
    body = dataclasses.replace(ROD, length=length, position=(0.0, 5.0, 0.0))
    frame = {"root": [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], "rod": [0.0, 0.0, 0.0]}
    assert _tip(tmp_path, body, frame) == pytest.approx((3 * metres, 5 * metres, 0), abs=1e-12)


def test_without_units_lengths_are_inches_and_angles_degrees(tmp_path: Path) -> None:
    """An ASF that gives no unit has a length unit of one and angles in degrees."""
    asf = re.sub(r":units\n(  .*\n)+", "", ROD.asf())
    assert ":units" not in asf
    clip = read_clip(write_pair(tmp_path, asf, amc_text([{"root": STILL, "rod": [0.0, 0.0, 90.0]}], header="")))
    assert clip.positions[0, 1].tolist() == pytest.approx([0, 2 * 0.0254, 0], abs=1e-12)


def test_angles_of_the_asf_may_be_radians(tmp_path: Path) -> None:
    """`angle rad` reads bone axes and the root's orientation in radians, and an AMC that names no unit too."""
    degrees = TinyBody(
        (TinyBone("rod", length=2.0, axis=(20.0, 40.0, 60.0), axis_order="ZXY"),), orientation=(10.0, 70.0, 30.0)
    )
    in_radians = TinyBody(
        (dataclasses.replace(degrees.bones[0], axis=tuple(map(math.radians, degrees.bones[0].axis))),),
        orientation=tuple(map(math.radians, degrees.orientation)),
        angle="rad",
    )
    values = {"root": [0.0, 0.0, 0.0, 15.0, 25.0, 35.0], "rod": [45.0, 55.0, 65.0]}
    turned = {
        "root": [0.0, 0.0, 0.0, *map(math.radians, values["root"][3:])],
        "rod": [*map(math.radians, values["rod"])],
    }
    expected = _tip(tmp_path, degrees, values)
    assert _tip(tmp_path, in_radians, turned, header="") == pytest.approx(expected, abs=1e-12)
    assert _tip(tmp_path, in_radians, turned, header=":RADIANS") == pytest.approx(expected, abs=1e-12)
    assert _tip(tmp_path, in_radians, values, header=":degrees") == pytest.approx(expected, abs=1e-12)


def test_rotations_are_the_recorded_angles(tmp_path: Path) -> None:
    """A clip's rotations are the AMC's angles in radians, root first, translations left out."""
    frames = arm_frames(5)
    clip = read_clip(write_pair(tmp_path, ARM.asf(), amc_text(frames)))
    expected = [[*frame["root"][3:], *frame["upper"], *frame["lower"]] for frame in frames]
    np.testing.assert_allclose(clip.rotations, np.radians(expected), rtol=1e-15)


# --- the slow twin -----------------------------------------------------------------------------------------------

ANGLE = st.floats(-180.0, 180.0).map(lambda value: round(value, 3))
TRIPLE = st.tuples(ANGLE, ANGLE, ANGLE)
ORDER = st.permutations("XYZ").map("".join)


@st.composite
def bodies_and_frames(draw: st.DrawFn) -> tuple[TinyBody, list[dict[str, list[float]]]]:
    """Draw a body of a few bones in any arrangement, and two frames that fit it, bones in any order."""
    bones: list[TinyBone] = []
    for index in range(draw(st.integers(1, 5))):
        dof = draw(st.permutations(("rx", "ry", "rz")))[: draw(st.integers(0, 3))]
        bones.append(
            TinyBone(
                f"bone{index}",
                parent=draw(st.sampled_from(["root", *(bone.name for bone in bones)])),
                direction=draw(TRIPLE),
                length=draw(st.floats(0.0, 3.0)),
                axis=draw(TRIPLE),
                axis_order=draw(ORDER),
                dof=tuple(dof),
            )
        )
    body = TinyBody(
        tuple(bones),
        length=draw(st.sampled_from([METRE, 0.45, 1.0])),
        angle=draw(st.sampled_from(["deg", "rad"])),
        root_order=" ".join(draw(st.permutations(("TX", "TY", "TZ", "RX", "RY", "RZ")))),
        root_axis=draw(ORDER),
        position=draw(TRIPLE),
        orientation=draw(TRIPLE),
    )
    sizes = {"root": 6} | {bone.name: len(bone.dof) for bone in bones if bone.dof}
    frames = [
        {name: [draw(ANGLE) for _ in range(sizes[name])] for name in draw(st.permutations(list(sizes)))}
        for _ in range(2)
    ]
    return body, frames


# The folder is the same for all examples, each of which overwrites its files.
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(drawn=bodies_and_frames(), header=st.sampled_from([":DEGREES", ":RADIANS", ""]))
def test_any_body_stands_where_the_recursion_puts_it(
    tmp_path: Path, drawn: tuple[TinyBody, list[dict[str, list[float]]]], header: str
) -> None:
    """With any hierarchy, orders, axes and units, every joint stands where the slow twin's recursion puts it."""
    body, frames = drawn
    amc = write_pair(tmp_path, body.asf(), amc_text(frames, header=header))
    clip = read_clip(amc)
    expected = naive.clip_positions(tmp_path / "tiny.asf", amc)
    assert clip.skeleton.joints == tuple(naive.read_asf(tmp_path / "tiny.asf").joints)
    np.testing.assert_allclose(clip.positions, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_real_clips_stand_where_the_recursion_puts_them(
    amc_clips: tuple[Clip, ...], some_paths: tuple[Path, ...], hdm05_folder: Path
) -> None:
    """On the first clip of every class each joint of every fortieth frame stands where the slow twin puts it."""
    for clip, path in zip(amc_clips, some_paths, strict=True):
        expected = naive.clip_positions(hdm05_folder / f"HDM_{clip.actor}.asf", path, every=40)
        np.testing.assert_allclose(clip.positions[::40], expected, rtol=1e-9, atol=1e-9)


# --- how a file is written does not matter -----------------------------------------------------------------------


def _with_comments(text: str) -> str:
    return "# first line\n\n" + "".join(f"{line}   # länger\n\n#\n" for line in text.splitlines())


def _with_tabs(text: str) -> str:
    return "".join(f"\t {line} \t\n" for line in text.replace(" ", "\t ").splitlines())


@pytest.mark.parametrize(
    "rewritten",
    [
        pytest.param(lambda text: text.replace("\n", "\r\n"), id="CRLF"),
        pytest.param(_with_comments, id="comments and empty lines"),
        pytest.param(_with_tabs, id="tabs and trailing blanks"),
        pytest.param(lambda text: text.rstrip("\n"), id="no newline at the end"),
    ],
)
def test_the_same_words_are_the_same_clip(tmp_path: Path, rewritten: Callable[[str], str]) -> None:
    """Line ends, comments in any encoding and white space change nothing."""
    asf, amc = ARM.asf(), amc_text(arm_frames(6))
    expected = read_clip(write_pair(tmp_path, asf, amc))
    clip = read_clip(write_pair(tmp_path, rewritten(asf), rewritten(amc)))
    assert clip.skeleton == expected.skeleton
    assert np.array_equal(clip.positions, expected.positions)
    assert np.array_equal(clip.rotations, expected.rotations)


@pytest.mark.slow
def test_bones_may_stand_in_another_order_in_every_frame(
    some_paths: tuple[Path, ...], amc_clips: tuple[Clip, ...], hdm05_folder: Path, tmp_path: Path
) -> None:
    """Real clips whose bones are shuffled anew in each frame, read line by line, are the clips read by columns."""
    generator = np.random.default_rng(17)
    for clip, path in zip(amc_clips, some_paths, strict=True):
        asf = hdm05_folder / f"HDM_{clip.actor}.asf"
        amc = naive.read_amc(path, naive.read_asf(asf))
        shuffled = [{name: frame[name] for name in generator.permutation(list(frame))} for frame in amc.frames]
        (tmp_path / path.name).write_text(amc_text(shuffled, numbers=amc.numbers))
        again = read_clip(tmp_path / path.name, read_asf(asf))
        assert np.array_equal(again.positions, clip.positions)
        assert np.array_equal(again.rotations, clip.rotations)


def test_two_bones_of_as_many_numbers_may_change_places(tmp_path: Path) -> None:
    """Two bones of three angles each that change places in one frame keep their own angles."""
    body = TinyBody((TinyBone("left"), TinyBone("right", direction=(0.0, 1.0, 0.0))))
    frames = [{"root": STILL, "left": [1.0, 2.0, 3.0], "right": [40.0, 50.0, 60.0]} for _ in range(3)]
    expected = read_clip(write_pair(tmp_path, body.asf(), amc_text(frames)))
    frames[1] = {name: frames[1][name] for name in ("root", "right", "left")}
    clip = read_clip(write_pair(tmp_path, body.asf(), amc_text(frames)))
    assert np.array_equal(clip.rotations, expected.rotations)
    assert np.array_equal(clip.positions, expected.positions)


def test_a_bones_children_may_be_listed_again(tmp_path: Path) -> None:
    """Joints stand in the order of the hierarchy's lines, children of one line side by side."""
    body = TinyBody(tuple(TinyBone(name, dof=()) for name in "abcd"))
    hierarchy = ":hierarchy\n  begin\n    root c a\n    a d\n    root b\n  end\n"
    (tmp_path / "tiny.asf").write_text(body.asf().partition(":hierarchy")[0] + hierarchy)
    skeleton = read_asf(tmp_path / "tiny.asf").skeleton
    assert skeleton.joints == ("root", "c", "a", "d", "b")
    assert skeleton.parents == (-1, 0, 0, 2, 0)


# --- time --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("first", [0, 1, 480])
def test_frame_numbers_may_start_anywhere(tmp_path: Path, first: int) -> None:
    """Frames numbered from any start are as many as are there."""
    frames = arm_frames(5)
    expected = read_clip(write_pair(tmp_path, ARM.asf(), amc_text(frames)))
    clip = read_clip(write_pair(tmp_path, ARM.asf(), amc_text(frames, numbers=range(first, first + 5))))
    assert np.array_equal(clip.positions, expected.positions)


def test_gaps_in_frame_numbers_are_filled_with_straight_lines(tmp_path: Path) -> None:
    """Frames 3, 4, 7, 8, 9 make seven: the two that are missing lie on the line between their neighbours."""
    frames = arm_frames(5)
    there = read_clip(write_pair(tmp_path, ARM.asf(), amc_text(frames)))
    clip = read_clip(write_pair(tmp_path, ARM.asf(), amc_text(frames, numbers=(3, 4, 7, 8, 9))))
    for filled, known in ((clip.positions, there.positions), (clip.rotations, there.rotations)):
        assert len(filled) == 7
        np.testing.assert_allclose(filled[[0, 1, 4, 5, 6]], known, rtol=1e-15)
        np.testing.assert_allclose(filled[2], (2 * known[1] + known[2]) / 3, rtol=1e-12)
        np.testing.assert_allclose(filled[3], (known[1] + 2 * known[2]) / 3, rtol=1e-12)


def test_more_gap_than_motion_is_refused(tmp_path: Path) -> None:
    """A file of which more is missing than is there is no motion, and the message counts both."""
    at_most = write_pair(tmp_path, ARM.asf(), amc_text(arm_frames(3), numbers=(1, 2, 6)))
    assert read_clip(at_most).frames == 6
    beyond = write_pair(tmp_path, ARM.asf(), amc_text(arm_frames(3), numbers=(1, 2, 7)))
    with pytest.raises(AcclaimError, match=r"tiny_01\.amc: 4 of 7 frames are missing"):
        read_clip(beyond)


@pytest.mark.parametrize(
    ("name", "header", "given_rate", "expected"),
    [
        pytest.param("tiny_01.amc", ":DEGREES", None, 120.0, id="nobody says"),
        pytest.param("tiny_01.amc", ":SAMPLES-PER-SECOND 60", None, 60.0, id="the file says"),
        pytest.param("HDM_bd_wave_001_240.amc", ":SAMPLES-PER-SECOND 60", None, 240.0, id="the name goes before"),
        pytest.param("HDM_bd_wave_001_240.amc", ":SAMPLES-PER-SECOND 60", 30.0, 30.0, id="the caller goes first"),
    ],
)
def test_frame_rate_comes_from_caller_name_file_or_habit(
    tmp_path: Path, name: str, header: str, given_rate: float | None, expected: float
) -> None:
    """The caller's rate is used first, then the name's, then the file's, else 120."""
    amc = write_pair(tmp_path, ARM.asf(), amc_text(arm_frames(3), header=header))
    body = read_asf(tmp_path / "tiny.asf")
    assert read_clip(amc.rename(tmp_path / name), body, frame_rate=given_rate).frame_rate == expected


# --- names -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "skeleton"),
    [
        ("HDM_bd_squat1Reps_001_120", "HDM_bd"),
        ("13_29", "13"),
        ("walk", "walk"),
        ("walk_01_120", "walk_01_120"),
    ],
)
@pytest.mark.parametrize("endings", [*itertools.product([".amc", ".AMC", ".Amc"], [".asf", ".ASF"])])
@pytest.mark.parametrize("folder", [".", ".."])
def test_the_skeleton_is_found_by_name(
    tmp_path: Path, name: str, skeleton: str, endings: tuple[str, str], folder: str
) -> None:
    """An actor's, a subject's or the motion's own skeleton is found beside it or one folder up, in any case."""
    place = tmp_path / "class"
    place.mkdir()
    asf = place / folder / f"{skeleton}{endings[1]}"
    asf.write_text(ARM.asf())
    amc = place / f"{name}{endings[0]}"
    amc.write_text(amc_text(arm_frames(2)))
    assert find_asf(amc).samefile(asf)
    assert read_clip(amc).frames == 2


def test_the_skeleton_beside_goes_before_the_one_above(tmp_path: Path) -> None:
    """Of two skeletons of the name the one in the motion's own folder is taken."""
    place = tmp_path / "class"
    place.mkdir()
    for folder in (tmp_path, place):
        (folder / "13.asf").write_text(ARM.asf())
    assert find_asf(place / "13_29.amc") == place / "13.asf"


def test_a_missing_skeleton_is_named(tmp_path: Path) -> None:
    """When the skeleton lies two folders up or elsewhere, the message names the motion and the names tried."""
    (tmp_path / "HDM_bd.asf").write_text(ARM.asf())
    deep = tmp_path / "one" / "two"
    deep.mkdir(parents=True)
    amc = deep / "HDM_bd_wave_001_120.amc"
    amc.write_text(amc_text(arm_frames(2)))
    with pytest.raises(AcclaimError, match=r"HDM_bd_wave_001_120\.amc: no skeleton HDM_bd\.asf or .*beside it or one"):
        read_clip(amc)


@pytest.mark.parametrize("missing", ["tiny.asf", "tiny_01.amc"])
def test_a_file_that_is_not_there_is_an_os_error(tmp_path: Path, missing: str) -> None:
    """A motion or a given skeleton that does not exist is the system's error, which names it."""
    amc = write_pair(tmp_path, ARM.asf(), amc_text(arm_frames(2)))
    (tmp_path / missing).unlink()
    with pytest.raises(FileNotFoundError, match=re.escape(missing)):
        read_clip(amc, read_asf(tmp_path / "tiny.asf"))


# --- bad input ---------------------------------------------------------------------------------------------------


GOOD_AMC = (
    ":FULLY-SPECIFIED\n:DEGREES\n1\nroot 0 0 0 0 0 0\nupper 1 2 3\nlower 4\n2\nroot 0 0 0 0 0 0\nupper 1 2 3\nlower 4\n"
)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        pytest.param(
            "upper 1 2 3", "uper 1 2 3", r":5: expected a frame number or a bone of .*, got 'uper'", id="unknown"
        ),
        pytest.param("upper 1 2 3\n", "", r":6: the frame before has no upper", id="bone missing"),
        pytest.param("lower 4\n2", "lower 4\nlower 4\n2", r":7: bone 'lower' stands twice in a frame", id="bone twice"),
        pytest.param("upper 1 2 3", "upper 1 2", r":5: expected 3 numbers for 'upper', got 2", id="too few"),
        pytest.param("upper 1 2 3", "upper", r":5: expected 3 numbers for 'upper', got 0", id="none"),
        pytest.param("lower 4", "lower 4 5", r":6: expected 1 numbers for 'lower', got 2", id="too many"),
        pytest.param("root 0 0 0", "root 0 O 0", r":4: expected numbers after 'root', got '0 O 0 0 0 0'", id="letter"),
        pytest.param("lower 4", "lower 4,5", r":6: expected numbers after 'lower', got '4,5'", id="comma"),
        pytest.param(
            "lower 4", "hand 4\nlower 4", r":6: expected a frame number or a bone .*, got 'hand'", id="rigid bone"
        ),
        pytest.param("\n1\n", "\n", r":3: bone 'root' stands twice in a frame, or before the first", id="no number"),
        pytest.param("\n1\n", "\n-1\n", r":3: expected a frame number or a bone .*, got '-1'", id="negative number"),
        pytest.param("\n1\n", "\n1.5\n", r":3: expected a frame number or a bone .*, got '1\.5'", id="half a frame"),
        pytest.param("\n1\n", "\n1 7\n", r":3: expected a frame number or a bone .*, got '1'", id="two numbers"),
        pytest.param("\n1\n", "\n²\n", r":3: expected a frame number .*, got '²'", id="superscript"),
        pytest.param("\n2\n", f"\n{10**30}\n", r":7: expected a frame number .*, got '10+'", id="huge"),
        pytest.param("\n2\n", f"\n{'9' * 5000}\n", r":7: expected a frame number ", id="endless"),
        pytest.param(":DEGREES", ":SAMPLES-PER-SECOND fast", r":2: expected numbers after", id="rate"),
        pytest.param(":DEGREES", ":SAMPLES-PER-SECOND -60", r":2: expected a positive", id="rate negative"),
        pytest.param(":DEGREES", ":SAMPLES-PER-SECOND 0", r":2: expected a positive", id="rate zero"),
        pytest.param("lower 4\n2", "lower nan\n2", r": NaN or infinity in frame 1$", id="NaN"),
        pytest.param(
            "upper 1 2 3\nlower 4\n2", "upper 1 -inf 3\nlower 4\n2", r": NaN or infinity in frame 1$", id="inf"
        ),
        pytest.param("lower 4\n2", "lower 1e999\n2", r": NaN or infinity in frame 1$", id="too large a number"),
        pytest.param(
            "lower 4\n2\n", "lower 4\n1\n", r": expected growing frame numbers, frame 1 comes too", id="number twice"
        ),
        pytest.param(
            "lower 4\n2\n", "lower 4\n0\n", r": expected growing frame numbers, frame 0 comes too", id="backwards"
        ),
    ],
)
def test_a_motion_that_does_not_fit_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    """A motion that does not fit its skeleton is refused with file and line, or with the frame."""
    assert GOOD_AMC.count(old) >= 1
    amc = write_pair(tmp_path, ARM.asf(), GOOD_AMC.replace(old, new, 1))
    with pytest.raises(AcclaimError, match=re.escape(str(amc)) + message):
        read_clip(amc)


@pytest.mark.parametrize("value", ["nan", "inf", "-Infinity"])
def test_a_number_that_is_not_finite_is_found_line_by_line_too(tmp_path: Path, value: str) -> None:
    """Where bones change their order a NaN is refused with its line."""
    text = GOOD_AMC.replace("upper 1 2 3\nlower 4\n2", f"lower 4\nupper 1 {value} 3\n2", 1)
    amc = write_pair(tmp_path, ARM.asf(), text)
    with pytest.raises(
        AcclaimError, match=re.escape(f"{amc}:6: expected finite numbers after 'upper', got '1 {value} 3'")
    ):
        read_clip(amc)


def test_a_motion_cut_off_anywhere_is_refused(tmp_path: Path) -> None:
    """A motion cut at any byte is refused by name, unless whole frames are left, which are read."""
    text = amc_text(arm_frames(3))
    whole = read_clip(write_pair(tmp_path, ARM.asf(), text))
    # A number may be cut short and still be one: from the first digit of a frame's last number to its line's end.
    last_numbers = [(match.end(), text.index("\n", match.end()) + 1) for match in re.finditer(r"lower -?\d", text)]
    for length in range(len(text)):
        amc = write_pair(tmp_path, ARM.asf(), text[:length])
        frames = [place for place, (first, end) in enumerate(last_numbers, start=1) if first <= length <= end]
        if not frames:
            with pytest.raises(AcclaimError, match=re.escape(str(amc))):
                read_clip(amc)
        else:
            clip = read_clip(amc)
            assert clip.frames == frames[0]
            assert np.array_equal(clip.positions[:-1], whole.positions[: clip.frames - 1])


@pytest.mark.parametrize("lines", [4, 5, 15, 31, 32, 35, 62, 1000])
def test_a_real_motion_cut_off_in_a_frame_is_refused(
    some_paths: tuple[Path, ...], hdm05_folder: Path, tmp_path: Path, lines: int
) -> None:
    """A real file cut off after some lines, or within one, is refused with its name and the line where it ends."""
    path = some_paths[0]
    kept = path.read_bytes().split(b"\n")[:lines]
    # A frame is its number and 29 bones: cutting after a line of this count would leave whole frames.
    assert (lines - 3) % 30
    body = read_asf(hdm05_folder / f"{path.name[:6]}.asf")
    for text in (b"\n".join(kept), b"\n".join([*kept[:-1], kept[-1][: len(kept[-1]) // 2]])):
        cut = tmp_path / path.name
        cut.write_bytes(text)
        with pytest.raises(AcclaimError, match=re.escape(str(cut)) + r":\d+: "):
            read_clip(cut, body)


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(b"", id="empty"),
        pytest.param(b"# nothing\n\n", id="comments alone"),
        pytest.param(b":FULLY-SPECIFIED\n:DEGREES\n", id="keywords alone"),
        pytest.param(bytes(range(256)) * 8, id="every byte"),
        pytest.param(np.random.default_rng(3).bytes(4096), id="random bytes"),
        pytest.param(b"\x00" * 512, id="zeros"),
        pytest.param(b"PK\x03\x04 not a motion", id="a zip file's head"),
        pytest.param("motion,1,2,3\nüber\n".encode("utf-16"), id="UTF-16"),
    ],
)
def test_rubbish_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    """A file that is no motion, or no skeleton, is refused with its name."""
    amc = write_pair(tmp_path, ARM.asf(), GOOD_AMC)
    amc.write_bytes(content)
    with pytest.raises(AcclaimError, match=re.escape(str(amc))):
        read_clip(amc)
    asf = tmp_path / "tiny.asf"
    asf.write_bytes(content)
    with pytest.raises(AcclaimError, match=re.escape(str(asf))):
        read_asf(asf)


# As above, the folder may be shared: every example overwrites the file.
@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    start=st.integers(0, len(GOOD_AMC) - 1),
    length=st.integers(0, 20),
    rubbish=st.binary(max_size=12),
    asf=st.booleans(),
)
def test_rubbish_in_the_middle_is_refused_by_name_or_read(
    tmp_path: Path, start: int, length: int, rubbish: bytes, *, asf: bool
) -> None:
    """Bytes overwritten anywhere in either file raise no error but one that names it."""
    amc = write_pair(tmp_path, ARM.asf(), GOOD_AMC)
    path = tmp_path / "tiny.asf" if asf else amc
    content = path.read_bytes()
    start = start * len(content) // len(GOOD_AMC)
    path.write_bytes(content[:start] + rubbish + content[start + length :])
    try:
        clip = read_clip(amc)
    except AcclaimError as error:
        assert str(tmp_path) in str(error)  # noqa: PT017 - rubbish that happens to be a motion is no error
    else:
        assert np.isfinite(clip.positions).all()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        pytest.param("length 0.0254", "length 0", r":5: expected a positive unit of length, got 0\.0", id="unit zero"),
        pytest.param("length 0.0254", "length -1", r":5: expected a positive unit of length", id="unit negative"),
        pytest.param("length 0.0254", "length", r":5: expected 1 numbers after 'length', got 0", id="unit absent"),
        pytest.param("angle deg", "angle grad", r":6: expected angle deg or rad, got 'grad'", id="unit of angle"),
        pytest.param("axis XYZ\n", "axis XYX\n", r":11: expected a rotation order like XYZ, got 'XYX'", id="root axis"),
        pytest.param("   axis XYZ\n", "", r": no 'axis' in :root", id="no root axis"),
        pytest.param("   order TX TY TZ RX RY RZ\n", "", r": no 'order' in :root", id="no root order"),
        pytest.param("TX TY TZ", "TX TY TY", r":10: expected some of tx, .* each once, got", id="root channel twice"),
        pytest.param(
            "TX TY TZ", "TX TY L", r":10: expected some of tx, .*, got 'tx ty l rx ry rz'", id="root channel unknown"
        ),
        pytest.param(
            "position 0.0 0.0 0.0",
            "position 0.0 0.0",
            r":12: expected 3 numbers after 'position', got 2",
            id="position",
        ),
        pytest.param(
            "direction 1.0 0.0 0.0", "direction 1.0 nan 0.0", r":18: expected finite numbers", id="direction NaN"
        ),
        pytest.param(
            "direction 1.0 0.0 0.0", "direction 1.0 0.0", r":18: expected 3 numbers after 'direction'", id="direction"
        ),
        pytest.param("     direction 1.0 0.0 0.0\n", "", r":17: bone 'upper' has no direction", id="no direction"),
        pytest.param("     length 1.0\n", "", r":17: bone 'upper' has no length", id="no length"),
        pytest.param(
            "     length 1.0\n", "     length one\n", r":19: expected numbers after 'length', got 'one'", id="length"
        ),
        pytest.param("     axis 0.0 0.0 0.0 XYZ\n", "", r":17: bone 'upper' has no axis", id="no axis"),
        pytest.param(
            "0.0 0.0 0.0 XYZ", "0.0 0.0 0.0 XY", r":20: expected a rotation order like XYZ, got 'XY'", id="axis order"
        ),
        pytest.param("dof rx ry rz", "dof rx ry rx", r":21: expected some of rx, ry, rz, each once", id="dof twice"),
        pytest.param("dof rx ry rz", "dof rx ry l", r":21: expected some of rx, ry, rz, each once", id="dof unknown"),
        pytest.param("name lower", "name upper", r":26: bone 'upper' is described twice", id="name twice"),
        pytest.param("name lower", "name root", r":26: bone 'root' is described twice", id="a second root"),
        pytest.param(
            "lower hand\n", "lower hnd\n", r":44: bone 'hnd' stands in the hierarchy but not in", id="unknown child"
        ),
        pytest.param("lower hand\n", "lower upper\n", r":44: bone 'upper' has two parents", id="two parents"),
        pytest.param(
            "root upper\n", "lower upper\n", r":42: bone 'lower' has children before it has a parent", id="circle"
        ),
        pytest.param("    lower hand\n", "", r": not a usable ASF skeleton, bones without a parent: hand", id="orphan"),
    ],
)
def test_a_skeleton_that_makes_no_sense_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    """A skeleton with something missing, unknown, twice or without number is refused with the file and the line."""
    text = ARM.asf()
    assert old in text
    write_pair(tmp_path, text.replace(old, new, 1), GOOD_AMC)
    asf = tmp_path / "tiny.asf"
    with pytest.raises(AcclaimError, match=re.escape(str(asf)) + message):
        read_asf(asf)


def test_a_skeleton_cut_off_anywhere_is_refused(tmp_path: Path) -> None:
    """Cut at every byte before its last bone's name is complete, a skeleton is refused by name."""
    text = ARM.asf()
    asf = tmp_path / "tiny.asf"
    for length in range(text.rindex("hand") + 4):
        asf.write_text(text[:length])
        with pytest.raises(AcclaimError, match=re.escape(str(asf))):
            read_asf(asf)
    asf.write_text(text[: text.rindex("hand") + 4])
    assert len(read_asf(asf).bones) == 4
