"""The report of `kinespace listen` on a sender of our own messages: its joints, its clock, its mistakes."""

from __future__ import annotations

import numpy as np
import pytest
import skeletons

from kinespace.library import MotionLibrary
from kinespace.stream import Announcement, Frame, osc
from kinespace.stream.feeds import builtin_names, builtin_preset
from kinespace.stream.inputs.detection import Survey
from kinespace.tools.programs.listen import advice, as_object, command


def _heard(joints: tuple[str, ...], frames: int = 20) -> Survey:
    survey = Survey()
    survey.keep(osc.encode_announcement(Announcement("ann", joints)), 0.0, ("127.0.0.1", 9))
    for number in range(frames):
        frame = Frame("ann", 1.0 + number / 30, np.full((len(joints), 3), 0.5))
        survey.keep(osc.encode_frame(frame), number / 30, ("127.0.0.1", 9))
    return survey


@pytest.mark.parametrize(
    ("joints", "title", "ours"),
    [(skeletons.MIXAMO, "Mixamo", 29), (skeletons.SMPL, "SMPL", 22), (builtin_preset("native").joints[:12], "", 12)],
)
def test_names_of_others_and_fewer_joints_are_well(joints: tuple[str, ...], title: str, ours: int) -> None:
    """A feed with known names, or with some of our joints, needs no change."""
    survey = _heard(joints)
    guess = survey.guess([builtin_preset(name) for name in builtin_names()])
    assert guess is not None
    assert (guess.preset.name, guess.frames, len(guess.joints), guess.performers) == ("native", 20, ours, ("ann",))
    assert guess.rate == pytest.approx(30.0)
    assert guess.understood == 1.0
    assert advice(survey, guess, None) == []
    assert as_object(survey, guess, [])["names"] == title


def test_unknown_names_are_reported() -> None:
    """Unknown names make no frames, and the program names the remedy."""
    survey = _heard(("hip", "knee", "toe", "elbow", "nose"))
    guess = survey.looked_at_as(builtin_preset("native"))
    assert guess.frames == 0
    lines = " ".join(advice(survey, guess, None))
    assert "0 of the 5 announced joints have known names" in lines
    assert "--names NAME" in lines


SQUAT = next(each for each in MotionLibrary.builtin().motions if each.class_name == "squat1Reps")
NATIVE = builtin_preset("native")


def _squat(positions: np.ndarray[tuple[int, ...], np.dtype[np.floating]], unit: float = 1.0) -> Survey:
    """Hear a squat at 60 Hz, times in this unit."""
    survey = Survey()
    survey.keep(osc.encode_announcement(Announcement("ann", SQUAT.skeleton.joints)), 0.0, ("127.0.0.1", 9))
    for number, joints in enumerate(positions):
        moment = number / 60
        survey.keep(osc.encode_frame(Frame("ann", unit * (1 + moment), joints)), moment, ("127.0.0.1", 9))
    return survey


def _told(survey: Survey) -> list[str]:
    return advice(survey, survey.looked_at_as(NATIVE), None)


def test_another_unit_of_time_is_reported() -> None:
    """Milliseconds are reported, with the performer."""
    assert _told(_squat(SQUAT.positions, 1e3)) == ["performer ann: times are milliseconds: scaled"]


def test_joints_in_another_order_are_reported() -> None:
    """Names that stand in another order than their joints, and angles, make segments that stretch."""
    shuffled = SQUAT.positions[:, np.random.default_rng(2).permutation(31)]
    angles = 40 * np.sin(SQUAT.positions[:, ::-1] * np.arange(1, 94).reshape(31, 3))
    for positions in (shuffled, angles):
        (line,) = _told(_squat(positions))
        assert line.startswith("performer ann: many segments change their length by more than a tenth")


@pytest.mark.parametrize(
    ("preset", "feed", "place", "expected"),
    [
        ("native", None, ("127.0.0.1", 9310), "kinespace live"),
        ("native", None, ("0.0.0.0", 9310), "kinespace live --osc-in 0.0.0.0:9310"),  # noqa: S104 - not bound
        ("vmc", None, ("127.0.0.1", 39539), "kinespace live --feed vmc"),
        ("vmc", None, ("127.0.0.1", 7000), "kinespace live --feed vmc --osc-in 127.0.0.1:7000"),
        ("vmc", "my own.toml", ("127.0.0.1", 39539), "kinespace live --feed 'my own.toml'"),
    ],
)
def test_the_command_names_the_port(preset: str, feed: str | None, place: tuple[str, int], expected: str) -> None:
    """The command for recognition can be pasted: it listens on the same port."""
    guess = _heard(NATIVE.joints).looked_at_as(builtin_preset(preset))
    assert command(guess, feed, place) == expected
