"""Frames without joint names, because the publisher sent the names before we joined: the message, and the remedies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from programs import ghost_cues, live

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import Frame
from kinespace.stream.feeds import builtin_preset
from kinespace.tools.feeding.feed import Cue
from kinespace.tools.feeding.joint_sets import joints_in_order, joints_of

if TYPE_CHECKING:
    from pathlib import Path

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


def test_joints_given_by_hand_are_recognised() -> None:
    """With --joints frames without names are answered."""
    with live("--plain", "--joints", "kinectv2", transport="zmq") as stage:
        stage.play(kinect_cues(2.0)[1:])
        answers = stage.answers(20)
        assert "kickLFront1Reps" in [answer.label for answer in answers]
        assert stage.stopped()["other joints"] == 0
        assert "--joints: 25 of the library's 31 joints" in stage.program.output


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
