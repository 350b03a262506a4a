"""Frames without joint names, because the publisher sent the names before we joined: the message, and the remedies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from programs import ghost_cues, live
from synthetic import STICK, stick_clip

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.library.skeleton import SkeletonMismatchError
from kinespace.stream import Announcement, Frame, Performers
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.recognizer import SentJoints
from kinespace.tools.feeding.feed import Cue
from kinespace.tools.feeding.joint_sets import joints_in_order, joints_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from kinespace.library import MotionLibrary

pytestmark = pytest.mark.slow

#: Joints as Kinect 2 numbers them, by the library's names.
KINECT = joints_in_order("kinectv2")


def kinect_cues(seconds: float) -> list[Cue]:
    """Cue a ghost as a body of Kinect 2's joints, in Kinect's order."""
    order = [SKELETON.joints.index(name) for name in KINECT]
    return [
        Cue(cue.due, Frame("p", cue.frame.time, cue.frame.positions[order]), cue.seq)
        for cue in ghost_cues("kickLFront1Reps", seconds)
    ]


@pytest.mark.parametrize("joints", ["kinectv2", ",".join(KINECT)])
def test_joints_given_by_hand_are_recognised(joints: str) -> None:
    """With --joints, a preset's order or a list of names, the very same frames are answered."""
    with live("--plain", "--joints", joints, transport="zmq") as stage:
        stage.play(kinect_cues(2.0)[1:])
        answers = stage.answers(20)
        assert "kickLFront1Reps" in [answer.label for answer in answers]
        assert stage.stopped()["other joints"] == 0
        assert "--joints: 25 of the library's 31 joints" in stage.program.output


def test_names_that_come_later_mend_it_too(sticks: MotionLibrary) -> None:
    """A publisher that names its joints again is recognised from then on, and the note is gone."""
    performers = Performers(sticks)
    clip = stick_clip("wave", seed=9, frames=120)
    shown = clip.positions[:, ::-1]
    more: NDArray[np.float64] = np.concatenate([shown, shown[:, :1] + 1.0], axis=1)
    for index in range(40):
        assert performers.push(Frame("p", 1 + index / 120, more[index]), index / 120) is None
    assert performers.counts.other_joints == 40
    size = len(STICK.joints)
    assert performers.refused == {"p": f"{size + 1} joints whose names were never sent, expected {size}"}
    performers.announce(Announcement("p", (*STICK.joints[::-1], "hat")), 1.0)
    assert performers.refused == {}
    answers = [performers.push(Frame("p", 2 + index / 120, more[index]), 1.0) for index in range(120)]
    assert any(answers)
    assert performers.counts.other_joints == 40


def test_why_frames_are_refused(sticks: MotionLibrary) -> None:
    """The reason gives the number of shared joints, or a wrong count; it stays after the performer has left."""
    performers = Performers(sticks, silence=1.0)
    joints = STICK.joints
    performers.announce(Announcement("few", joints[:2]), 0.0)
    performers.announce(Announcement("many", (*joints, "hat")), 0.0)
    for name, size in (("few", 2), ("many", len(joints))):
        performers.push(Frame(name, 1.0, np.ones((size, 3))), 0.0)
    told = {
        "few": f"2 joints, 2 of them among the {len(joints)} compared, expected 5 at least",
        "many": f"{len(joints)} joints, but {len(joints) + 1} names were sent",
    }
    assert performers.refused == told
    performers.drop_silent(5.0)
    assert performers.refused == told


def test_assumed_joints_are_in_their_order(sticks: MotionLibrary) -> None:
    """Frames in another assumed order get the same answers; a sender's announcement overrides it."""
    positions = stick_clip("wave", seed=9, frames=120).positions

    def answers(joints: tuple[str, ...], shown: NDArray[np.float64], *told: Announcement) -> list[tuple[str, float]]:
        performers = Performers(sticks, joints=SentJoints(assumed=tuple(joints)))
        for each in told:
            performers.announce(each, 0.0)
        pushed = [performers.push(Frame("p", 1 + index / 120, shown[index]), 0.0) for index in range(120)]
        return [(each.label, each.score) for each in pushed if each]

    expected = answers((), positions)
    assert expected
    assert answers(STICK.joints[::-1], positions[:, ::-1]) == expected
    assert answers(STICK.joints[::-1], positions, Announcement("p", STICK.joints)) == expected
    with pytest.raises(SkeletonMismatchError):
        Performers(sticks, joints=SentJoints(assumed=STICK.joints[1:]))


def test_joints_are_given_by_name_or_by_preset(tmp_path: Path) -> None:
    """A list, a built-in preset and a copy of it mean the same; joints that the library lacks keep their names."""
    assert len(KINECT) == 25
    assert set(KINECT) == set(joints_of("kinectv2"))
    assert joints_in_order(",".join(KINECT)) == KINECT
    mine = tmp_path / "mine.toml"
    mine.write_text(builtin_preset("kinectv2").text.replace('Head = "head"', 'Head = ""'), encoding="utf-8")
    assert joints_in_order(str(mine)) == tuple("Head" if name == "head" else name for name in KINECT)
    assert joints_in_order("a, b ,c") == ("a", "b", "c")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,,b", "--joints: expected distinct names"),
        ("a,b,a", "--joints: expected distinct names"),
        ("vmc", "got vmc, whose messages name them"),
        ("head", "--joints: expected one of kinectv2, "),
    ],
)
def test_joints_that_make_no_sense_are_refused(text: str, message: str) -> None:
    """Missing or repeated names, presets without an order, and other text are refused."""
    with pytest.raises(ValueError, match=message.replace(".", r"\.")):
        joints_in_order(text)
