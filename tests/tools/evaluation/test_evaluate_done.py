"""What is said of a take, as live."""

from dataclasses import replace

import pytest

from kinespace.library import MotionLibrary
from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream import Settings
from kinespace.tools.evaluation.evaluate_done import done_take
from kinespace.tools.evaluation.harness import Asked, Take

SQUAT, ARMS, DOWN = "squat1Reps", "rotateArmsBothBackward1Reps", "lieDownFloor"


@pytest.fixture(scope="module")
def asked() -> Asked:
    """Let three classes of four actors recognise a squat of another actor."""
    builtin = MotionLibrary.builtin()
    some = [each for each in builtin.motions if each.class_name in {SQUAT, ARMS, DOWN} and each.actor != "bd"]
    clip = [each for each in builtin.motions if (each.class_name, each.actor) == (SQUAT, "bd")][3]
    take = Take(clip, (Segment(0.0, clip.duration, SQUAT),))
    return Asked(take, replace(builtin, motions=tuple(some)), "")


@pytest.mark.slow
def test_a_take_is_judged_as_live(asked: Asked) -> None:
    """The squat is done once, its half is not; nothing is done where nothing is promised."""
    take = done_take(asked, Settings())
    assert [each.class_name for each in take.said] == [SQUAT]
    assert take.broken == [False]
    assert not done_take(asked, Settings(false_alarms=0.0)).said
