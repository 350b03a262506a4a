"""Libraries of one's own: small ones, and one that is taught while a feed runs."""

import pytest
from performed import pushed, shown
from synthetic import stick_clip, stick_clips

from kinespace.library import NOTHING, Clip, MotionLibrary, opened
from kinespace.stream import Frame, LiveSignature, Outcome, Recognition, Recognizer, Settings
from kinespace.tools.teaching.lessons import open_taught

pytestmark = pytest.mark.slow


# --- own library ------------------------------------------------------------------------------------------------------


BOTH = pytest.mark.parametrize("signature", LiveSignature)


def _answers(library: MotionLibrary, clip: Clip, signature: LiveSignature = LiveSignature.WINDOWS) -> list[Recognition]:
    return pushed(Recognizer(library, Settings(signature=signature)), shown(clip.positions, clip.frame_rate))


def _performed(class_name: str, seed: int = 60) -> Clip:
    return stick_clip(class_name, seed=seed, frames=240)


@BOTH
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
        both = [pushed(Recognizer(index), frames) for index in indices]
        for one, other in zip(*both, strict=True):
            assert one.label == other.label
            assert one.evidence.compared == pytest.approx(other.evidence.compared, abs=1e-4)
            names.add(one.outcome)
    assert {Outcome.NAMED, Outcome.UNKNOWN} <= names
