"""The names of joints in other programs: their tables, the conventions, HDM05's own names."""

from collections.abc import Callable
from pathlib import Path

import pytest
from skeletons import KNOWN, names_of

from kinespace.library.naming import ConventionError, Naming, convention_named, hdm05, summary, unknown_names
from kinespace.library.naming.convention import parse_convention
from kinespace.stream.feeds import builtin_names, builtin_preset

# --- convention -------------------------------------------------------------------------------------------------------


GOOD = """
title = "Mine"
sides = [["left", "right"], ["L", "R"]]
prefixes = ["rig"]

[joints]
Pelvis = "root"
"*Knee" = "*femur"
"""


def test_sides_and_spelling(tmp_path: Path) -> None:
    """A user's own table is asked for by its file; a star stands for every way to say a side."""
    file = tmp_path / "mine.toml"
    file.write_text(GOOD, encoding="utf-8")
    convention = convention_named(str(file))
    assert (convention.name, convention.title) == ("mine", "Mine")
    knees = {"leftknee": "lfemur", "rightknee": "rfemur", "lknee": "lfemur", "rknee": "rfemur"}
    assert convention.targets == {"pelvis": "root", **knees}
    assert convention.joints == ("root", "lfemur", "rfemur")
    assert convention.spelled(["rig12_Left Knee", "Rig:Pelvis"]) == ["leftknee", "pelvis"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('title = ""\n[joints]\na = "root"\nb = "head"', "title: expected text, got ''"),
        ('[joints]\na = "root"', "at least two"),
        ('[joints]\na = "hip"\nb = "head"', "expected one of HDM05's joints or nothing, got 'hip'"),
        ('[joints]\na_b = "root"\n"a b" = "head"', "expected each name once, got 'a b' twice"),
        ('sides = ["l"]\n[joints]\na = "root"\nb = "head"', "sides 1: expected a list of length 2"),
        ('prefixes = "rig"\n[joints]\na = "root"\nb = "head"', "prefixes: expected a list, got 'rig'"),
    ],
)
def test_mistakes_are_reported(text: str, message: str) -> None:
    """A mistake is reported in one line that names the file and the mistake."""
    with pytest.raises(ConventionError, match="mine.toml: .*" + message.replace("[", r"\[")):
        parse_convention(text, "mine.toml")


def test_no_text(tmp_path: Path) -> None:
    """A file that is no text is reported; a missing file is the system's error."""
    file = tmp_path / "mine.toml"
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(ConventionError, match="expected UTF-8 text, got byte 0"):
        convention_named(str(file))
    with pytest.raises(FileNotFoundError):
        convention_named(str(tmp_path / "other.toml"))


# --- hdm05 ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("HDM_bd_squat1Reps_001_120.amc", ("bd", "squat1Reps", "001", 120.0)),
        ("hdm_DG_grabHighR_003_120.AMC", ("DG", "grabHighR", "003", 120.0)),
        ("HDM_mm_jog_on_place_002_60.amc", ("mm", "jog_on_place", "002", 60.0)),
        ("HDM_bd_03-03_01_120.amc", ("bd", "", "03-03_01", 120.0)),
        # Of another form, or of no frames per second.
        *((name, None) for name in ("13_29.amc", "HDM_bd_squat1Reps_001_000.amc", "HDM_bd_squat1Reps_001_120_cut.amc")),
        *((f"{front}_squat1Reps_001_120.amc", None) for front in ("my_HDM_bd", "HDM_bastian")),
    ],
)
def test_a_file_name_holds_actor_class_and_take(name: str, expected: tuple[str, str, str, float] | None) -> None:
    """Actor, class, take and frame rate are read off a cut clip's name; the name of an uncut take holds no class."""
    assert hdm05.read_clip_name(Path(name)) == expected


# --- naming -----------------------------------------------------------------------------------------------------------


OURS = hdm05.SKELETON.joints
SMPL, MIXAMO = names_of("smpl"), names_of("mixamo")


@pytest.mark.parametrize("skeleton", KNOWN)
def test_names_are_found(skeleton: str) -> None:
    """Every convention's skeleton is known by its names, and each of its joints gets the name that is meant."""
    labels, known = names_of(skeleton), KNOWN[skeleton]
    named = Naming().read(labels)
    assert named.convention.name == known["convention"]
    assert sum(joint in OURS for joint in named.joints) == known["ours"]
    assert len(set(named.joints)) == len(labels)
    assert {label: named.joints[labels.index(label)] for label in known["some"]} == known["some"]


def test_a_limb_without_names_names_the_labels() -> None:
    """Where no joint of an arm is known the line lists what was not understood."""
    bare = [name.removeprefix("mixamorig:") for name in MIXAMO]
    labels = [name for name in bare if "Arm" not in name and "Hand" not in name] + ["WingLeft", "WingRight"]
    named = Naming().read(labels)
    line = summary(named.title, named.joints)
    assert line.endswith("an arm or a leg is missing, not understood: LeftShoulder, RightShoulder, WingLeft, WingRight")


@pytest.mark.parametrize(
    "labels",
    [
        ("hip", "left", "right"),
        tuple(f"marker{number}" for number in range(40)),
        ("Hips", "LeftArm", "RightArm", *(f"prop{number}" for number in range(20))),
        (),
    ],
)
def test_foreign_names_stay(labels: tuple[str, ...]) -> None:
    """Names of no convention, or too few of one, stay as they are."""
    assert Naming().read(labels) == (labels, None)


FRONTS = ("mixamorig", "mixamorig5:", "mixamorig_", "Armature|", "Char 1_", "")


@pytest.mark.parametrize("spelled", [*FRONTS, str.upper, str.lower, "A:{}".format, lambda name: name.replace("_", " ")])
def test_spelling_says_nothing(spelled: Callable[[str], str] | str) -> None:
    """Capitals, marks between words and a namespace are ignored, and every prefix that programs put before Mixamo's."""
    names = MIXAMO if isinstance(spelled, str) else SMPL
    written = [name.replace("mixamorig:", spelled) if isinstance(spelled, str) else spelled(name) for name in names]
    for named, once, again in zip(Naming().read(written).joints, Naming().read(names).joints, written, strict=True):
        assert named == (once if once in OURS else again)


def test_more_names_than_a_body_has_are_compared_with_no_table() -> None:
    """A thousand names are looked up; with one more they stay as they are, because a stranger's would take too long."""
    mixamo = convention_named("mixamo")
    names = [*mixamo.targets, *map(str, range(1000))]
    assert Naming().read(names[:1000]).convention == mixamo
    assert Naming().read(names[:1001]).joints == tuple(names[:1001])
    assert "no table knows them" not in unknown_names(names, hdm05.SKELETON.joints)


def test_a_given_convention_is_used() -> None:
    """A given convention renames the joints it knows, however few; as-they-are renames none."""
    assert Naming.asked("smpl").read(("head", "spine1", "prop")).joints == ("upperneck", "lowerback", "prop")
    assert Naming.asked("as-they-are").read(SMPL) == (SMPL, None)
    assert Naming.asked("auto") == Naming()
    with pytest.raises(ValueError, match=r"names: expected one of acclaim-bvh, .* hdm05, .* kinectv2, .* 'klingon'"):
        Naming.asked("klingon")


def test_beginnings_and_ends_of_bones_are_told_apart() -> None:
    """The same names mean the beginnings of bones in one kind of file, and their ends in the other."""
    bvh = [joint for joint in OURS if joint not in ("lhipjoint", "rhipjoint", "lowerback", "lclavicle", "rclavicle")]
    bvh += ["head_end", "ltoes_end", "rtoes_end", "lfingers_end", "rfingers_end", "lthumb_end", "rthumb_end"]
    named = dict(zip(bvh, Naming().read(bvh).joints, strict=True))
    assert (named["lfemur"], named["ltoes_end"], named["head"]) == ("lhipjoint", "ltoes", "upperneck")
    assert Naming().read([*OURS, "head_end", "ltoes_end"]).joints[:31] == OURS


def test_names_that_a_library_has_are_met() -> None:
    """A feed is read by the names that bring it nearer to the library."""
    own = ("hip", "knee", "toe", "elbow", "hand")
    assert Naming().met(own, own).joints == own
    assert Naming().met(SMPL, OURS).joints == Naming().read(SMPL).joints
    assert Naming().met(SMPL, SMPL).joints == SMPL


@pytest.mark.parametrize(
    ("preset", "convention"),
    [
        *(("mediapipe", "mediapipe"), ("kinectv2", "kinect2"), ("vmc", "humanoid"), ("natnet2osc", "optitrack")),
        *(("qtm", "mixamo"), ("captury", "mixamo"), ("nimate", "openni"), ("osceleton", "openni")),
        *(("native", "hdm05"), ("natnetthree2osc", "optitrack")),
    ],
)
def test_presets_say_the_same(preset: str, convention: str) -> None:
    """A product's joints are called the same whether its feed comes by a preset or its names come with a file."""
    assert preset in builtin_names()
    by_preset, by_convention = builtin_preset(preset).joint_map, convention_named(convention)
    spelled = by_convention.spelled(list(by_preset))
    differing = {
        name: (target, by_convention.targets[bare])
        for (name, target), bare in zip(by_preset.items(), spelled, strict=True)
        if target and bare in by_convention.targets and by_convention.targets[bare] != target
    }
    assert differing == {}
    assert sum(bare in by_convention.targets for bare in spelled) >= len(builtin_preset(preset).joints)
