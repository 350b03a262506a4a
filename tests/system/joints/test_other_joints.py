"""Fewer joints, joints without names, and joints in other programs' names."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from programs import ghost_cues, live
from skeletons import names_of

from kinespace.library import Clip, MotionLibrary, Reading, WindowIndex
from kinespace.library.naming import Naming, hdm05
from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import Announcement, Frame, LiveSignature, Performers, Recognizer, Settings
from kinespace.stream.recognizer import SentJoints
from kinespace.tools.cli.arguments import joints_in_order
from kinespace.tools.cli.main import main
from kinespace.tools.evaluation.harness import Sources, Take, read_takes
from kinespace.tools.feeding.feed import Cue

# --- restricted -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_no_shared_joints_are_one_line(
    sticks: MotionLibrary, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A feed that shares fewer than five joints with the library is refused in one line, by both counts."""
    sticks.save(tmp_path / "sticks.npz")
    feed = ("--feed", "kinectv2", "--osc-in", "127.0.0.1:0")
    assert main(["live", "--library", str(tmp_path / "sticks.npz"), *feed]) == 2
    errors = capsys.readouterr().err
    assert errors.startswith("kinespace: joints: expected at least 5 of the library's 6")
    assert errors.count("\n") == 1


# --- unnamed joints ---------------------------------------------------------------------------------------------------


#: Joints as Kinect 2 numbers them, by the library's names.
KINECT = joints_in_order("kinectv2")


def kinect_cues(seconds: float) -> list[Cue]:
    """Cue a ghost as a body of Kinect 2's joints, in Kinect's order."""
    order = [SKELETON.joints.index(name) for name in KINECT]
    return [
        Cue(cue.due, Frame("p", cue.frame.time, cue.frame.positions[order]), cue.seq)
        for cue in ghost_cues("kickLFront1Reps", seconds)
    ]


@pytest.mark.slow
def test_joints_given_by_hand_are_recognised() -> None:
    """With --joints frames without names are answered."""
    with live("--plain", "--joints", "kinectv2", transport="zmq") as stage:
        stage.play(kinect_cues(2.0)[1:])
        answers = stage.answers(20)
        assert "kickLFront1Reps" in [answer.label for answer in answers]
        assert stage.stopped()["other joints"] == 0
        assert "--joints: 25 of the library's 31 joints" in stage.program.output


# --- names ------------------------------------------------------------------------------------------------------------


OURS = hdm05.SKELETON.joints
CLASSES = ("squat1Reps", "rotateArmsBothBackward1Reps")


@pytest.fixture(scope="module")
def motions() -> MotionLibrary:
    """Give two classes of the built-in library, three people's motions of each."""
    builtin = MotionLibrary.builtin()
    people = builtin.actors[:3]
    kept = [clip for clip in builtin.motions if clip.class_name in CLASSES and clip.actor in people]
    few = {(clip.class_name, clip.actor): clip for clip in kept}
    return MotionLibrary.of_clips(few.values(), learned=builtin.learned)


def _answered(library: MotionLibrary, clip: Clip, joints: Sequence[str]) -> str:
    """Recognise a motion whose sender announces joints by these names; give the commonest guess of its last half."""
    # The paper's signature has no windows to be learned, which takes seconds.
    settings = Settings(signature=LiveSignature.PAPER)
    performers = Performers(library, settings, joints=SentJoints(naming=Naming()))
    performers.announce(Announcement("ann", tuple(joints)), 0.0)
    answers = []
    for number, positions in enumerate(clip.positions):
        answers.append(performers.push(Frame("ann", number / clip.frame_rate, positions), 0.0))
    guesses = Counter(answer.classes[answer.best] for answer in answers[len(answers) // 2 :] if answer)
    return guesses.most_common(1)[0][0]


@pytest.mark.parametrize("naming", ["mixamo", "mediapipe", "kinect 2"])
def test_feed_of_another_naming_meets_our_library(motions: MotionLibrary, naming: str) -> None:
    """A sender of another convention is compared by the joints it has, and its motions are named."""
    labels = names_of(naming)
    joints = Naming().read(labels).joints
    there = [place for place, joint in enumerate(joints) if joint in OURS]
    clip = motions.motions[0]
    order = [OURS.index(joints[place]) for place in there]
    sent = replace(clip, skeleton=clip.skeleton.restricted_to(order), positions=clip.positions[:, order])
    assert _answered(motions, sent, [labels[place] for place in there]) == clip.class_name


# --- named joints -----------------------------------------------------------------------------------------------------


# --- honest feeds -----------------------------------------------------------------------------------------------------


def _some(places: list[Path], count: int) -> list[Path]:
    """Give so many of the recordings at most, from the whole list."""
    return places[:: -(-len(places) // count)]


# --- unlike bodies ----------------------------------------------------------------------------------------------------


#: Some takes of each set, and whether the built-in library names motions by its joints: by Kinect 1 and by films it
#: guesses less than half of the time right (measuring.md), and says so.
SETS = {
    "cmu_takes": ("[02]?_0[347].amc", False),
    "uiprmd": ("takes/*.npz", False),
    "uiprmd_kinect": ("takes/*.npz", False),
    "kindergator": ("takes/[ac]*_*3.npz", True),
    "utkinect": ("joints_s*_e01.txt", True),
    "camera": ("p[1-4]*_1.npz", True),
}
#: Seconds after which the line stands, at most, and seconds between answers.
SOON, HOP = 10.0, 1 / 6


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_it_is_said_within_ten_seconds_whether_the_library_fits(
    name: str, data_folder: Path, builtin_index: WindowIndex
) -> None:
    """All but one of the takes that are long enough are judged as their whole set is."""
    pattern, unlike = SETS[name]
    places = _some(sorted((data_folder / name).glob(pattern)), 7)
    takes = read_takes(Sources(places) if name == "utkinect" else Sources(unknown=places), Reading())
    found = [each for take in takes if (each := _decided(take, builtin_index)) is not None]
    assert len(found) >= 5
    assert found.count(unlike) >= len(found) - 1


def _decided(take: Take, index: WindowIndex) -> bool | None:
    """Play the first seconds of a take; None where it is too short to decide."""
    shared = tuple(name for name in index.library.skeleton.joints if name in take.clip.skeleton.joints)
    view = index if len(shared) == len(index.library.skeleton.joints) else index.by_joints(shared)
    recognizer, clip = Recognizer(view, Settings(hop=HOP)), take.clip.restricted_to(shared).as_of(view.library.skeleton)
    shown = range(clip.frames) if take.delivered is None else take.delivered.tolist()
    step = max(1, round(clip.frame_rate / 60))
    some = [frame for frame in shown if clip.times[frame] < SOON][::step]
    _pushed(recognizer, clip.times[some], clip.positions[some])
    return recognizer.unlike


def _pushed(recognizer: Recognizer, times: Iterable[float], positions: Iterable[np.ndarray]) -> None:
    for time, each in zip(times, positions, strict=True):
        recognizer.push(Frame("p", float(time), each))
