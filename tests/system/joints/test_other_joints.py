"""Fewer joints, joints without names, and joints in other programs' names."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
import skeletons
from performed import pushed, shown
from programs import ghost_cues, live

from kinespace.library.clip import Clip
from kinespace.library.motion_library import MotionLibrary
from kinespace.library.naming import Naming, hdm05
from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import Announcement, Frame
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer import LiveSignature, Performers, Recognizer, SentJoints, Settings
from kinespace.tools.cli.arguments import joints_in_order, joints_of
from kinespace.tools.cli.main import main
from kinespace.tools.feeding.feed import Cue

# --- restricted -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stranger(builtin: MotionLibrary) -> tuple[Clip, ...]:
    """Give a motion of each class of the small library by a person that the library lacks."""
    names = ("kickLFront1Reps", "lieDownFloor", "squat1Reps")
    return tuple(next(m for m in builtin.motions if (m.class_name, m.actor) == (name, "bk")) for name in names)


def _answers(recognizer: Recognizer, clip: Clip) -> list[Recognition]:
    order = [clip.skeleton.joints.index(name) for name in recognizer.library.skeleton.joints]
    return pushed(recognizer, shown(clip.positions[:, order], clip.frame_rate))


def _assert_same(first: list[Recognition], second: list[Recognition]) -> None:
    assert len(first) == len(second) > 20
    for one, other in zip(first, second, strict=True):
        assert one.scores == pytest.approx(other.scores, abs=1e-3)
        assert (one.label, one.best) == (other.label, other.best)
        assert one.eigenvector_class == other.eigenvector_class


@pytest.mark.slow
@pytest.mark.parametrize("joints", ["kinect20", "vrchat"])
@pytest.mark.parametrize("signature", LiveSignature)
def test_fewer_joints_are_as_if_there_had_never_been_more(
    small_library: MotionLibrary, stranger: tuple[Clip, ...], signature: LiveSignature, joints: str
) -> None:
    """A library restricted to 20 or 9 joints answers as one built from clips of those joints."""
    restricted = small_library.restricted_to(joints_of(joints))
    kept = restricted.skeleton.joints
    built = MotionLibrary.of_clips(clip.restricted_to(kept) for clip in small_library.motions)
    assert built.skeleton.joints == kept
    for clip in stranger:
        expected = _answers(Recognizer(built, Settings(signature=signature)), clip)
        _assert_same(_answers(Recognizer(restricted, Settings(signature=signature)), clip), expected)


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


@pytest.mark.parametrize("naming", ["mixamo", "mediapipe", "kinect2"])
def test_feed_of_another_naming_meets_our_library(motions: MotionLibrary, naming: str) -> None:
    """A sender of another convention is compared by the joints it has, and its motions are named."""
    labels = {"mixamo": skeletons.MIXAMO, "mediapipe": skeletons.MEDIAPIPE, "kinect2": skeletons.KINECT_2}[naming]
    joints = Naming().read(labels).joints
    there = [place for place, joint in enumerate(joints) if joint in OURS]
    clip = motions.motions[0]
    order = [OURS.index(joints[place]) for place in there]
    sent = replace(clip, skeleton=clip.skeleton.restricted_to(order), positions=clip.positions[:, order])
    assert _answered(motions, sent, [labels[place] for place in there]) == clip.class_name
