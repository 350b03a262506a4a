"""A library is exchanged while a feed runs: from the next hop on the answers are the new one's, and none is lost."""

from dataclasses import replace

import numpy as np
import pytest
from performed import pushed, shown

from kinespace.library import Clip, MotionLibrary, WindowIndex
from kinespace.stream import Frame, LiveSignature, Recognizer, Settings

#: Everything holds of the compiled loops and of numpy.
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("arithmetic")]

#: The largest difference of a score from that of a recogniser made with the library.
SAME_SCORE = 1e-5
#: Seconds after which guess and judgement have forgotten everything.
FORGOTTEN = 1.5


@pytest.fixture(scope="module")
def taught(small_index: WindowIndex, some_clips: tuple[Clip, ...]) -> WindowIndex:
    """Give the small library with two motions more: one of a new class, and one of a class that it has."""
    added = [clip for clip in some_clips if clip.class_name in ("hopBothLegs1hops", "squat1Reps")]
    return small_index.with_motions(replace(clip, actor="new") for clip in added)


@pytest.fixture(scope="module")
def other(small_library: MotionLibrary, builtin: MotionLibrary) -> WindowIndex:
    """Give a library that shares one class with the small one: another basis, other metrics, other classes."""
    kept = ("kickLFront1Reps", "throwBasketball", "sneak2StepsLStart")
    motions = tuple(clip for clip in builtin.motions if clip.class_name in kept and clip.actor in ("bd", "dg", "mm"))
    return WindowIndex.of(replace(small_library, motions=motions))


@pytest.fixture(scope="module")
def frames(some_clips: tuple[Clip, ...]) -> list[Frame]:
    """Give a feed of a kick, a throw and a squat."""
    named = {clip.class_name: clip for clip in some_clips}
    names = ("kickLFront1Reps", "throwBasketball", "squat1Reps")
    return shown(np.concatenate([named[name].positions for name in names]), begin=5.0)


@pytest.mark.parametrize("signature", LiveSignature)
@pytest.mark.parametrize("name", ["taught", "other"])
def test_answers_are_as_if_the_library_had_been_there_all_along(
    request: pytest.FixtureRequest, small_index: WindowIndex, frames: list[Frame], name: str, signature: LiveSignature
) -> None:
    """Scores are the same at once, guess and outcome once they have forgotten the former library."""
    index: WindowIndex = request.getfixturevalue(name)
    settings = Settings(signature=signature, plausibility=False)
    recognizer = Recognizer(small_index, settings)
    before = pushed(recognizer, frames[:300])
    recognizer.exchange(index)
    assert recognizer.library is index.library
    after = pushed(recognizer, frames[300:])
    along = pushed(Recognizer(index, settings), frames)
    assert [each.time for each in before + after] == [each.time for each in along]
    for one, expected in zip(after, along[len(before) :], strict=True):
        assert np.abs(one.scores - expected.scores).max() <= SAME_SCORE
        assert one.share == pytest.approx(expected.share, rel=1e-9)
        assert (one.eigenvector_class, one.classes) == (expected.eigenvector_class, expected.classes)
        if one.time > after[0].time + FORGOTTEN:
            assert (one.guess, one.outcome) == (expected.guess, expected.outcome)
