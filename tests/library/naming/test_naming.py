from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import skeletons

from kinespace.library.naming import Naming, convention_named, hdm05, summary
from kinespace.stream.feeds import builtin_names, builtin_preset

if TYPE_CHECKING:
    from collections.abc import Callable

OURS = hdm05.SKELETON.joints
#: A skeleton, whose names they are, how many of our joints it has, and what some joints are called here.
KNOWN = {
    "mixamo": (skeletons.MIXAMO, "mixamo", 29, {"mixamorig:LeftUpLeg": "lhipjoint", "mixamorig:HeadTop_End": "head"}),
    "rokoko": (skeletons.ROKOKO, "rokoko", 27, {"hip": "root", "leftLowerArm": "lhumerus", "rightToeEnd": "rtoes"}),
    "newton": (skeletons.NEWTON, "rokoko", 22, {"Spine4": "thorax", "LeftThigh": "lhipjoint", "LeftToeTip": "ltoes"}),
    "xsens": (skeletons.XSENS, "xsens", 20, {"T8": "thorax", "Left Upper Arm": "lclavicle", "Right Toe": "rfoot"}),
    "xsens bvh": (skeletons.XSENS_BVH, "biovision", 25, {"LeftShoulder": "lclavicle", "LeftHip": "lhipjoint"}),
    "cgspeed": (skeletons.CGSPEED, "cgspeed", 28, {"Spine1": "thorax", "LThumb_end": "lthumb"}),
    "cgspeed all": (skeletons.CGSPEED_ALL, "cgspeed", 28, {"LowerBack": "cgspeed LowerBack", "Spine": "lowerback"}),
    "unity": (skeletons.UNITY, "humanoid", 22, {"LeftMiddleProximal": "lhand", "Head": "upperneck"}),
    "vrm 1": (skeletons.VRM1, "humanoid", 22, {"leftUpperLeg": "lhipjoint", "upperChest": "thorax"}),
    "vroid": (skeletons.VROID, "humanoid", 20, {"J_Bip_L_LowerLeg": "lfemur", "J_Bip_C_Hips": "root"}),
    "mediapipe": (skeletons.MEDIAPIPE, "mediapipe", 19, {"nose": "head", "left_knee": "lfemur"}),
    "freemocap": (skeletons.FREEMOCAP, "mediapipe", 22, {"head_center": "head", "nose": "nose", "hips_center": "root"}),
    "coco": (skeletons.COCO, "mediapipe", 13, {"right_ankle": "rtibia"}),
    "plug-in gait": (skeletons.PLUG_IN_GAIT, "plugingait", 20, {"LASI": "lhipjoint", "C7": "lowerneck"}),
    "rizzoli": (skeletons.RIZZOLI, "rizzoli", 14, {"LGT": "lhipjoint", "LASIS": "LASIS", "RLM": "rtibia"}),
    "rizzoli in visual3d": (skeletons.RIZZOLI_VISUAL3D, "rizzoli", 19, {"L_FLE": "lfemur", "L_RSP": "lradius"}),
    "smpl": (skeletons.SMPL, "smpl", 22, {"left_hand": "lhand", "head": "upperneck", "left_foot": "lfoot"}),
    "smpl fbx": (skeletons.SMPL_FBX, "smpl", 22, {"m_avg_L_Hip": "lhipjoint", "m_avg_Pelvis": "root"}),
    "kinect 1": (skeletons.KINECT_1, "kinect1", 19, {"HipCenter": "root", "Spine": "Spine"}),
    "kinect 2": (skeletons.KINECT_2, "kinect2", 25, {"SpineShoulder": "thorax", "HandTipRight": "rfingers"}),
    "azure kinect": (
        skeletons.AZURE_KINECT,
        "kinect2",
        25,
        {"SPINE_CHEST": "upperback", "PELVIS": "root"},
    ),
    "openni": (skeletons.OPENNI, "openni", 15, {"left_hand": "lradius", "left_foot": "ltibia"}),
    "optitrack": (skeletons.OPTITRACK, "optitrack", 19, {"Skeleton 001_LFArm": "lhumerus"}),
    "arkit": (skeletons.ARKIT, "arkit", 28, {"left_forearm_joint": "lhumerus", "root": "ARKit root"}),
    "hdm05": (OURS, "hdm05", 31, {"lfemur": "lfemur"}),
}


@pytest.mark.parametrize("skeleton", KNOWN)
def test_names_are_found(skeleton: str) -> None:
    """Every convention's skeleton is known by its names, and each of its joints gets the name that is meant."""
    labels, convention, ours, some = KNOWN[skeleton]
    named = Naming().read(labels)
    assert named.convention is not None
    assert named.convention.name == convention
    assert sum(joint in OURS for joint in named.joints) == ours
    assert len(set(named.joints)) == len(labels)
    assert {label: named.joints[labels.index(label)] for label in some} == some


@pytest.mark.parametrize("skeleton", KNOWN)
def test_sides_are_kept(skeleton: str) -> None:
    """A left joint is our left one, and as many of our joints are left as are right."""
    labels, *_ = KNOWN[skeleton]
    pairs = dict(zip(labels, Naming().read(labels).joints, strict=True))
    mirrored = {joint: ("r" if joint[0] == "l" else "l") + joint[1:] for joint in OURS if joint[1:] in _PAIRED}
    assert {mirrored.get(joint, joint) for joint in pairs.values()} & {*OURS} == {*pairs.values()} & {*OURS}


_PAIRED = {joint[1:] for joint in OURS if joint[0] == "l"} & {joint[1:] for joint in OURS if joint[0] == "r"}


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


@pytest.mark.parametrize("spelled", [str.upper, str.lower, lambda name: name.replace("_", " "), "Ann:{}".format])
def test_spelling_says_nothing(spelled: Callable[[str], str]) -> None:
    """Capitals, marks between words and a namespace are ignored."""
    joints = Naming().read(skeletons.SMPL).joints
    assert Naming().read([spelled(name) for name in skeletons.SMPL]).joints == tuple(
        joint if joint in OURS else spelled(joint) for joint in joints
    )


@pytest.mark.parametrize("front", ["mixamorig:", "mixamorig", "mixamorig5:", "mixamorig_", "Armature|", "Char 1_", ""])
def test_prefixes_are_left_out(front: str) -> None:
    """Mixamo's names are recognised with every prefix that programs put before them."""
    labels = [name.replace("mixamorig:", front) for name in skeletons.MIXAMO]
    named = Naming().read(labels)
    assert [joint for joint in named.joints if joint in OURS] == [
        joint for joint in Naming().read(skeletons.MIXAMO).joints if joint in OURS
    ]


def test_left_arm_alone_keeps_its_side() -> None:
    """The beginning that all labels share may be their side."""
    labels = [f"left_{part}" for part in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")]
    assert Naming().read(labels).joints == ("lhipjoint", "lfemur", "ltibia", "lclavicle", "lhumerus", "lradius")


def test_a_given_convention_is_used() -> None:
    """A given convention renames the joints it knows, however few; as-they-are renames none."""
    labels = ("head", "spine1", "prop")
    assert Naming.asked("smpl").read(labels).joints == ("upperneck", "lowerback", "prop")
    assert Naming.asked("as-they-are").read(skeletons.SMPL) == (skeletons.SMPL, None)
    assert Naming.asked("auto") == Naming()
    with pytest.raises(
        ValueError, match=r"names: expected one of acclaim-bvh, .* hdm05, .* kinectv2, .* got 'klingon'"
    ):
        Naming.asked("klingon")


def test_other_joint_of_our_name_does_not_pass_for_ours() -> None:
    """SMPL's head stands where our upperneck does; a second one is called otherwise."""
    named = Naming.asked("smpl").read(("Head", "head", "left_hip"))
    assert named.joints == ("upperneck", "SMPL head", "lhipjoint")


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
    assert Naming().met(skeletons.SMPL, OURS).joints == Naming().read(skeletons.SMPL).joints
    assert Naming().met(skeletons.SMPL, skeletons.SMPL).joints == skeletons.SMPL


def test_line() -> None:
    """A person is told the convention and how many of our joints it found."""
    named = Naming().read(skeletons.KINECT_1)
    assert summary(named.title, named.joints) == "Kinect 1 names: 19 of 31 joints"
    assert Naming().read(OURS).title == ""


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
