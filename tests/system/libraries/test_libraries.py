"""Libraries of one's own, small and taught ones; and whether the built-in one says that it does not fit a body."""

from dataclasses import replace
from pathlib import Path

import pytest
from fakes import pushed, shown
from synthetic import stick_clip, stick_clips

from kinespace.library import NOTHING, Clip, MotionLibrary, Reading, Skeleton, WindowIndex, by_joints, opened
from kinespace.stream import Frame, LiveSignature, Outcome, Recognition, Recognizer, Settings
from kinespace.tools.evaluation.harness import Sources, Take, read_takes
from kinespace.tools.teaching.lessons import open_taught

pytestmark = pytest.mark.slow


# --- own library ------------------------------------------------------------------------------------------------------


def _answers(library: MotionLibrary, clip: Clip, signature: LiveSignature = LiveSignature.WINDOWS) -> list[Recognition]:
    return pushed(Recognizer(library, Settings(signature=signature)), shown(clip.positions, clip.frame_rate))


def _performed(class_name: str, seed: int = 60) -> Clip:
    return stick_clip(class_name, seed=seed, frames=240)


@pytest.mark.parametrize("signature", LiveSignature)
def test_motions_of_the_class_nothing_are_unknown(signature: LiveSignature) -> None:
    """A class renamed to `nothing` competes, has no score of its own, and is answered unknown with a best guess."""
    library = MotionLibrary.of_clips(stick_clips()).renamed({"wave": NOTHING})
    assert library.classes == ("bow", "jump")
    answers = _answers(library, _performed("wave"), signature)
    assert {answer.outcome for answer in answers[5:]} == {Outcome.UNKNOWN}
    assert {answer.classes for answer in answers} == {("bow", "jump")}
    assert {len(answer.scores) for answer in answers} == {2}
    assert {answer.eigenvector_class for answer in answers[5:]} == {None}
    assert {answer.label for answer in _answers(library, _performed("bow"), signature)[5:]} == {"bow"}


# --- teaching ---------------------------------------------------------------------------------------------------------


def test_a_file_answers_the_same_taught_and_as_a_library(builtin: MotionLibrary) -> None:
    """One example of three classes, opened as by `--library X` and by `--teach X --library none`: the same answers."""
    first = {motion.class_name: motion for motion in reversed(builtin.motions) if motion.actor == "bd"}
    library = MotionLibrary.of_clips([first[name] for name in builtin.classes[:3]])
    names, indices = set[Outcome](), (opened(library), open_taught(library))
    for asked in [each for each in builtin.motions if each.actor == "mm"][::20]:
        frames = [Frame("p", *each) for each in zip(asked.times.tolist(), asked.positions, strict=True)]
        for one, other in zip(*[pushed(Recognizer(index), frames) for index in indices], strict=True):
            assert one.label == other.label
            assert one.evidence.compared == pytest.approx(other.evidence.compared, abs=1e-4)
            names.add(one.outcome)
    assert {Outcome.NAMED, Outcome.UNKNOWN} <= names


def test_a_remark_on_joints_is_no_result(builtin: MotionLibrary, capsys: pytest.CaptureFixture[str]) -> None:
    """Standard output stays free for what an evaluation prints as JSON."""
    clip = builtin.motions[0]
    tailed = Skeleton((*clip.skeleton.joints, "tail"))
    open_taught(MotionLibrary.of_clips([replace(clip, skeleton=tailed, positions=clip.positions[:, [*range(31), 0]])]))
    out, err = capsys.readouterr()
    assert (out, err) == ("", "taught motions are compared by 31 of 32 joints, without tail\n")


# --- bodies of other sets of recordings -------------------------------------------------------------------------------


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


@pytest.mark.parametrize("name", SETS)
def test_it_is_soon_said_whether_the_library_fits(name: str, data_folder: Path, builtin_index: WindowIndex) -> None:
    """All but one of the takes that are long enough are judged as their whole set is."""
    pattern, unlike = SETS[name]
    places = sorted((data_folder / name).glob(pattern))
    places = places[:: -(-len(places) // 5)]
    takes = read_takes(Sources(places) if name == "utkinect" else Sources(unknown=places), Reading())
    found = [each for take in takes if (each := _decided(take, builtin_index)) is not None]
    assert len(found) >= 3
    assert found.count(unlike) >= len(found) - 1


def _decided(take: Take, index: WindowIndex) -> bool | None:
    """Play the first seconds of a take; None where it is too short to decide."""
    shared = tuple(name for name in index.library.skeleton.joints if name in take.clip.skeleton.joints)
    view = index if len(shared) == len(index.library.skeleton.joints) else by_joints(index, shared)
    recognizer, clip = Recognizer(view, Settings(hop=HOP)), take.clip.restricted_to(shared).as_of(view.library.skeleton)
    shown = range(clip.frames) if take.delivered is None else take.delivered.tolist()
    step = max(1, round(clip.frame_rate / 60))
    some = [frame for frame in shown if clip.times[frame] < SOON][::step]
    for time, each in zip(clip.times[some], clip.positions[some], strict=True):
        recognizer.push(Frame("p", float(time), each))
    return recognizer.fitting.unlike
