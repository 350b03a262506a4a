"""BVH files: geometry by hand, the slow twin on random bodies, HDM05's clips rewritten as BVH, and every bad input."""

from __future__ import annotations

import itertools
import re
from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from written import MOVES, TURNS, Node, bvh_of_acclaim, bvh_text

from kinespace.library.distances import distance_rows
from kinespace.library.recordings.formats.acclaim import read_clip as read_amc
from kinespace.library.recordings.formats.bvh import BvhError, forward_kinematics, read_bvh, read_clip
from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.windows.body import Body

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

ROTATIONS = ("Xrotation", "Yrotation", "Zrotation")


def arm(*, root: tuple[str, ...] = (*MOVES, *TURNS), upper: tuple[str, ...] = TURNS) -> Node:
    """Make a root, an arm of two metres along x, a forearm of one along x, and its tip."""
    tip = Node("lower_end", (0.5, 0.0, 0.0))
    lower = Node("lower", (2.0, 0.0, 0.0), TURNS, [tip])
    return Node("hip", (0.0, 0.0, 0.0), root, [Node("upper", (0.0, 1.0, 0.0), upper, [lower])])


def write(folder: Path, text: str) -> Path:
    """Write a BVH."""
    path = folder / "tiny.bvh"
    path.write_text(text, encoding="utf-8", newline="")
    return path


def stand(folder: Path, root: Node, *frames: list[float]) -> np.ndarray:
    """Give where the joints of the file stand in its frames."""
    return forward_kinematics(read_bvh(write(folder, bvh_text(root, frames))))


STILL = [0.0] * 12

# --- geometry by hand --------------------------------------------------------------------------------------------


def test_offsets_add_up_at_rest(tmp_path: Path) -> None:
    """Without turns each joint stands at the sum of the offsets above it, and the End Site is a joint."""
    (places,) = stand(tmp_path, arm(), STILL)
    assert places.tolist() == [[0, 0, 0], [0, 1, 0], [2, 1, 0], [2.5, 1, 0]]


@pytest.mark.parametrize(("order", "tip"), [("ZYX", (0, 1, -2)), ("XYZ", (0, 1, -2)), ("XZY", (0, 3, 0))])
def test_the_last_named_turn_comes_first(tmp_path: Path, order: str, tip: tuple[float, ...]) -> None:
    """Of Z, Y, X rotations by right angles the last named turns the arm first."""
    angles = {"X": 0.0, "Y": 90.0, "Z": 0.0} if order != "XZY" else {"X": 90.0, "Y": 90.0, "Z": 90.0}
    turns = tuple(f"{letter}rotation" for letter in order)
    frame = [0.0] * 6 + [angles[letter] for letter in order] + [0.0] * 3
    (places,) = stand(tmp_path, arm(upper=turns), frame)
    expected = naive.turn_in_order(order[::-1], {letter.lower(): np.radians(angles[letter]) for letter in order})
    np.testing.assert_allclose(places[2] - places[1], expected @ [2, 0, 0], atol=1e-12)
    if order != "XZY":
        np.testing.assert_allclose(places[2], tip, atol=1e-12)


def test_the_root_moves_and_turns_everything(tmp_path: Path) -> None:
    """The root's channels shift and turn the whole body, so that distances stay."""
    frames = [STILL, [5.0, 6.0, 7.0, 30.0, 40.0, 50.0, *[0.0] * 6]]
    path = write(tmp_path, bvh_text(arm(), frames))
    clip = read_clip(path)
    rows = distance_rows(clip.positions, clip.skeleton)
    np.testing.assert_allclose(rows[0], rows[1], atol=1e-12)
    assert clip.positions[1, 0].tolist() == [5.0, 6.0, 7.0]


def test_position_channels_stand_in_place_of_the_offset(tmp_path: Path) -> None:
    """A joint's position channels replace its offset; if they are 0 in the whole file the offset stays."""
    root = arm(upper=(*MOVES, *TURNS))
    (places,) = stand(tmp_path, root, [0.0] * 6 + [3.0, 0.0, 0.0] + [0.0] * 6)
    assert places[1].tolist() == [3.0, 0.0, 0.0]
    (places,) = stand(tmp_path, root, [0.0] * 15)
    assert places[1].tolist() == [0.0, 1.0, 0.0]


def test_joints_that_always_coincide_are_one(tmp_path: Path) -> None:
    """A joint at its parent's place, or a sister's, is left out; its children move to the joint that stays."""
    left = Node("left", (0.0, 1.0, 0.0), TURNS, [Node("left_end", (1.0, 0.0, 0.0))])
    right = Node("right", (0.0, 1.0, 0.0), TURNS, [Node("right_end", (-1.0, 0.0, 0.0))])
    same = Node("same", (0.0, 0.0, 0.0), TURNS, [left, right])
    frames = np.random.default_rng(1).uniform(-90, 90, (5, 15)).tolist()
    path = write(tmp_path, bvh_text(Node("hip", (0.0, 0.0, 0.0), (*MOVES, *TURNS), [same]), frames))
    clip = read_clip(path)
    assert clip.skeleton.joints == ("hip", "left", "left_end", "right_end")
    assert clip.skeleton.parents == (-1, 0, 1, 1)
    body = Body.of(clip.skeleton)
    lengths = distance_rows(clip.positions, clip.skeleton)[:, body.segments]
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], lengths.shape), atol=1e-12)
    with pytest.raises(BvhError, match="'same' always coincides with another chosen joint"):
        read_clip(path, joints=("hip", "same"))
    assert read_clip(path, joints=("same", "left_end")).skeleton.joints == ("same", "left_end")


@pytest.mark.parametrize(("scale", "reach"), [(1.0, 2.7), (100.0, 2.7), (1000.0, 2.7), (0.1, 0.27)])
def test_the_size_of_the_body_gives_the_unit(tmp_path: Path, scale: float, reach: float) -> None:
    """Metres, centimetres and millimetres are told apart by the body's size; a given unit is used instead."""
    root = arm()
    for node in root.all():
        node.offset = tuple(scale * number for number in node.offset)
    path = write(tmp_path, bvh_text(root, [STILL]))
    clip = read_clip(path)
    assert distance_rows(clip.positions, clip.skeleton).max() == pytest.approx(reach, abs=0.02)
    given_unit = read_clip(path, metres_per_unit=0.0254)
    assert distance_rows(given_unit.positions, clip.skeleton).max() == pytest.approx(scale * 2.7 * 0.0254, rel=0.01)


@pytest.mark.parametrize(
    ("period", "rate"),
    [
        *(("0.01", 100.0), ("0.008333", 120.0), (".0083333", 120.0), ("0.033333", 30.0), ("0.0333", 30.0)),
        *(("0.0417083", 1 / 0.0417083), ("8.3e-3", 1 / 0.0083), ("1", 1.0), (repr(1 / 60), 60.0), ("2.5", 0.4)),
    ],
)
def test_the_rate_is_the_whole_number_the_period_was_rounded_from(tmp_path: Path, period: str, rate: float) -> None:
    """A rounded Frame Time means the whole number of frames per second it was rounded from."""
    assert read_clip(write(tmp_path, bvh_text(arm(), [STILL], period))).frame_rate == pytest.approx(rate, rel=1e-12)
    assert read_clip(tmp_path / "tiny.bvh", frame_rate=50.0).frame_rate == 50.0


# --- the slow twin -----------------------------------------------------------------------------------------------

NUMBER = st.floats(-300.0, 300.0).map(lambda value: round(value, 6))
TRIPLE = st.tuples(NUMBER, NUMBER, NUMBER)


@st.composite
def bodies(draw: st.DrawFn) -> Node:
    """Draw a body of a few joints in any arrangement, with channels in any order."""
    nodes: list[Node] = []
    for index in range(draw(st.integers(2, 7))):
        names = list(draw(st.permutations(ROTATIONS)))
        if index == 0 or draw(st.booleans()):
            names = list(draw(st.permutations((*names, *MOVES))))
        node = Node(f"joint {index}", draw(TRIPLE), tuple(names[: draw(st.integers(1, len(names)))]))
        if nodes:
            draw(st.sampled_from(nodes)).children.append(node)
        nodes.append(node)
    for node in nodes:
        if not node.children:
            node.children.append(Node(f"{node.name}_end", draw(TRIPLE)))
    return nodes[0]


@pytest.mark.slow
@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(root=bodies(), chance=st.randoms(use_true_random=False))
def test_any_body_is_read_as_written_and_stands_where_the_recursion_puts_it(
    tmp_path: Path, root: Node, chance: st.RandomType
) -> None:
    """Names, offsets, channels and numbers come back as written; every joint stands where the slow twin puts it."""
    joints = list(root.all())
    size = sum(len(node.channels) for node in joints)
    frames = [[round(chance.uniform(1.0, 300.0), 6) for _ in range(size)] for _ in range(3)]
    motion = read_bvh(write(tmp_path, bvh_text(root, frames)))
    assert [joint.name for joint in motion.joints] == [node.name for node in joints]
    assert [joint.offset for joint in motion.joints] == [node.offset for node in joints]
    spelled = [tuple(f"{name[1].upper()}" for name in joint.channels) for joint in motion.joints]
    assert spelled == [tuple(name[0] for name in node.channels) for node in joints]
    assert motion.channels.tolist() == frames
    for frame, places in zip(frames, forward_kinematics(motion), strict=True):
        expected = naive.bvh_places(root.offset, root.channels, root.children, iter(frame), np.zeros(3), np.eye(3))
        np.testing.assert_allclose(places, expected, rtol=1e-9, atol=1e-8)


def test_many_frames_are_placed_as_few_are(tmp_path: Path) -> None:
    """Frames in several blocks have the same positions as alone."""
    frames = np.random.default_rng(5).uniform(-90, 90, (4100, 12)).tolist()
    places = stand(tmp_path, arm(), *frames)
    for index in (0, 4095, 4096, 4099):
        np.testing.assert_array_equal(places[index], stand(tmp_path, arm(), frames[index])[0])


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_hdm05_as_bvh_has_the_same_distances(
    tmp_path: Path, some_paths: tuple[Path, ...], hdm05_folder: Path, scale: float
) -> None:
    """The first clip of every class, rewritten as BVH, has the joints' distances that the Acclaim reader gives."""
    for path in some_paths:
        expected = read_amc(path)
        text, stands = bvh_of_acclaim(hdm05_folder / f"HDM_{expected.actor}.asf", path, scale=scale)
        bvh = tmp_path / f"{path.stem}.bvh"
        bvh.write_text(text)
        clip = read_clip(bvh)
        assert (clip.class_name, clip.actor, clip.take) == (expected.class_name, expected.actor, expected.take)
        assert (clip.frame_rate, clip.frames) == (expected.frame_rate, expected.frames)
        assert len(clip.skeleton.joints) == len(expected.skeleton.joints)
        order = [clip.skeleton.joints.index(stands[name]) for name in expected.skeleton.joints]
        np.testing.assert_allclose(
            distance_rows(clip.positions[:, order], expected.skeleton),
            distance_rows(expected.positions, expected.skeleton),
            atol=1e-9,
        )


# --- how a file is written does not matter -----------------------------------------------------------------------

GOOD = bvh_text(arm(), np.random.default_rng(3).uniform(-90, 90, (4, 12)).tolist())


@pytest.mark.parametrize(
    "rewritten",
    [
        pytest.param(lambda text: text.replace("\n", "\r\n"), id="CRLF"),
        pytest.param(lambda text: text.replace("\n{", " {"), id="brace on the line"),
        pytest.param(lambda text: text.replace(" ", "\t\t"), id="tabs"),
        pytest.param(lambda text: text.replace("\n", "\n\n"), id="empty lines"),
        pytest.param(lambda text: "\N{BYTE ORDER MARK}" + text, id="byte order mark"),
        pytest.param(lambda text: text.rstrip("\n"), id="no last line end"),
        pytest.param(lambda text: text.replace("Zrotation", "ZROTATION").replace("ROOT", "root"), id="case"),
        pytest.param(lambda text: text.replace(" hip", " me:hip").replace("upper", "me:upper"), id="prefixes"),
    ],
)
def test_the_same_words_are_the_same_clip(tmp_path: Path, rewritten: Callable[[str], str]) -> None:
    """Line ends, white space, case, a byte order mark and prefixes make no difference."""
    expected = read_clip(write(tmp_path, GOOD))
    clip = read_clip(write(tmp_path, rewritten(GOOD)))
    assert clip.skeleton == expected.skeleton
    np.testing.assert_array_equal(clip.positions, expected.positions)
    np.testing.assert_array_equal(clip.rotations, expected.rotations)


def test_chosen_joints_hang_on_the_nearest_chosen_above(tmp_path: Path) -> None:
    """Patterns choose joints, whose parents are the nearest chosen ones; a name that fits none is refused."""
    path = write(tmp_path, GOOD)
    clip = read_clip(path, joints=("hip", "lower*"))
    assert clip.skeleton.joints == ("hip", "lower", "lower_end")
    assert clip.skeleton.parents == (-1, 0, 1)
    np.testing.assert_array_equal(clip.positions, read_clip(path).positions[:, [0, 2, 3]])
    with pytest.raises(BvhError, match=re.escape(f"{path}: no joint is called 'nose'; there are hip, upper")):
        read_clip(path, joints=("nose",))


# --- broken files -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("HIERARCHY", "HIERARCHIE", ":1: expected a word of a BVH hierarchy, got 'HIERARCHIE'"),
        ("ROOT hip", "ROOT", ":2: expected a name"),
        ("ROOT", "JOINT", ":2: expected one ROOT with all joints"),
        ("JOINT lower", "JOINT upper", ":10: joint 'upper' stands in it twice"),
        ("OFFSET 0.0 1.0 0.0", "OFFSET 0.0 1.0", ":8: expected 3 numbers, got 2"),
        ("OFFSET 0.0 1.0 0.0", "OFFSET 0.0 one 0.0", ":8: expected numbers, got '0.0 one 0.0'"),
        ("OFFSET 0.0 1.0 0.0", "OFFSET 0.0 nan 0.0", ":8: expected finite numbers"),
        ("OFFSET 0.5 0.0 0.0\n", "", ":16: joint 'lower_end' has no OFFSET"),
        ("CHANNELS 6", "CHANNELS 5", ":5: expected CHANNELS, how many"),
        ("CHANNELS 3 Zrotation", "CHANNELS 3 Wrotation", ":9: expected CHANNELS, how many"),
        ("JOINT upper\n{", "JOINT upper\n", ":8: expected { after 'upper', got 'OFFSET'"),
        ("}\n}\n}\nMOTION", "}\n}\nMOTION", ":20: joint 'hip' is not closed with }"),
        ("}\n}\n}\nMOTION", "}\n}\n}\n}\nMOTION", ":21: a } without its {"),
        ("MOTION", "ROOT two\n{\nOFFSET 0 0 0\n}\nMOTION", ":21: a second ROOT"),
        ("Frames: 4", "Frames: 0", ":22: expected a number of frames, got '0'"),
        ("Frames: 4", "Frames 4", ":22: expected Frames: and a number"),
        ("Frames: 4", "Frames: 3", ":27: a frame more than the 3 that were announced"),
        ("Frames: 4", "Frames: 5", ":27: the file ends after 4 of 5 frames"),
        ("Frame Time: 0.01", "Frame Time: 0", ":23: expected a positive Frame Time"),
        ("Frame Time: 0.01", "Frame Time: x", ":23: expected numbers, got 'x'"),
        ("Frame Time: 0.01\n", "Frame Time: 0.01\n1 2 3\n", ":24: expected 12 numbers, got 3"),
        ("Frame Time: 0.01\n", "Frame Time: 0.01\n" + "nan " * 12 + "\n", ":28: a frame more"),
    ],
)
def test_a_file_that_makes_no_sense_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    """Each mistake is reported with the file and the line."""
    assert old in GOOD
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(BvhError, match=re.escape(f"{path}{message}")):
        read_clip(path)


def test_words_and_nan_in_place_of_numbers_are_refused(tmp_path: Path) -> None:
    """NaN and infinity in the motion are reported with their frame, a word with its line."""
    lines = GOOD.splitlines()
    for word, message in (("nan", "NaN or infinity in frame 2"), ("1e999", "in frame 2"), ("x", "expected numbers")):
        broken = [*lines[:24], f"{word} {lines[24].partition(' ')[2]}", *lines[25:]]
        path = write(tmp_path, "\n".join(broken))
        with pytest.raises(BvhError, match=message):
            read_clip(path)


def test_a_file_cut_off_anywhere_is_refused(tmp_path: Path) -> None:
    """However much of the end is missing, down to nothing, the file is refused by name, save for its last digits."""
    digits = len(GOOD.rstrip("\n").rpartition(" ")[2]) + 1
    for end in itertools.chain(range(0, len(GOOD) - digits, 7), (len(GOOD) - digits,)):
        with pytest.raises(BvhError, match=re.escape(str(tmp_path / "tiny.bvh"))):
            read_clip(write(tmp_path, GOOD[:end]))


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, len(GOOD)), rubbish=st.binary(max_size=12), lost=st.integers(0, 40))
def test_rubbish_in_the_middle_is_refused_by_name_or_read(
    tmp_path: Path, place: int, rubbish: bytes, lost: int
) -> None:
    """Bytes put in or taken out anywhere end in a clip of finite numbers or in one error that names the file."""
    path = tmp_path / "tiny.bvh"
    content = GOOD.encode()
    path.write_bytes(content[:place] + rubbish + content[place + lost :])
    told = str(path)
    try:
        assert np.isfinite(read_clip(path).positions).all()
    except RecordingError as error:
        told = str(error)
    assert told.startswith(str(path))
