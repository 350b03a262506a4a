"""A library is exchanged while a feed runs: from the next hop on the answers are the new one's, and none is lost."""

from __future__ import annotations

import sys
import threading
from dataclasses import replace
from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from naive_stream import NaiveFeed
from twins import Twin

from kinespace.library.motion_library import NOTHING
from kinespace.library.skeleton import SkeletonMismatchError
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import EventKind
from kinespace.stream.recognizer import LiveSignature, Performers, Recognizer, Settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library.clip import Clip
    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognition import Event, Recognition


#: Everything holds of the compiled loops and of numpy.
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("arithmetic")]

#: The largest difference of a log distance from the twin's, and of a score from a recogniser made with the library.
SAME, SAME_SCORE = 1e-3, 1e-5
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
    shown = [named[name].positions for name in ("kickLFront1Reps", "throwBasketball", "squat1Reps")]
    return [Frame("p", 5.0 + place / 120, each) for place, each in enumerate(np.concatenate(shown))]


def _distances(answer: Recognition) -> np.ndarray:
    return np.log(1 / answer.scores - 1)


def _pushed(recognizer: Recognizer, frames: Sequence[Frame]) -> list[Recognition]:
    return [answer for frame in frames if (answer := recognizer.push(frame)) is not None]


def _exchanged(
    frames: Sequence[Frame], first: WindowIndex, then: WindowIndex, at: int, settings: Settings | None = None
) -> tuple[list[Recognition], list[Recognition], Event | None]:
    """Exchange a recogniser's library before a frame; give the answers before and after, and the event."""
    recognizer = Recognizer(first, settings)
    before = _pushed(recognizer, frames[:at])
    ended = recognizer.exchange(then)
    assert recognizer.library is then.library
    return before, _pushed(recognizer, frames[at:]), ended


@pytest.mark.parametrize(("name", "at"), [("taught", 3), ("taught", 291), ("other", 291), ("small_index", 3)])
def test_answers_are_the_twins_from_the_next_hop_on(
    request: pytest.FixtureRequest, small_index: WindowIndex, frames: list[Frame], name: str, at: int
) -> None:
    """Whether the new library has the same basis or another, every hop after the exchange is as its twin answers it."""
    twin = Twin(request.getfixturevalue(name))
    _, after, _ = _exchanged(frames, small_index, twin.index, at, Settings(plausibility=False))
    assert len(after) > 60
    pairs = [(int(first), int(second)) for first, second in twin.index.library.skeleton.pairs]
    feed, answers = NaiveFeed(twin.body.segments), iter(after)
    for place, frame in enumerate(frames[: at + 60]):
        hop = feed.push(frame.time, naive.distance_rows(frame.positions[None], pairs)[0])
        if hop is None or place < at:
            continue
        answer = next(answers)
        assert answer.time == hop.time
        views = twin.log_distances(twin.numbers(hop.time, hop.times, hop.rows))
        assert np.abs(_distances(answer) - views[: len(twin.index.comparison.weighing.views)].min(axis=0)).max() <= SAME


@pytest.mark.parametrize("signature", LiveSignature)
@pytest.mark.parametrize("name", ["taught", "other"])
def test_answers_are_as_if_the_library_had_been_there_all_along(
    request: pytest.FixtureRequest, small_index: WindowIndex, frames: list[Frame], name: str, signature: LiveSignature
) -> None:
    """Scores are the same at once, guess and outcome once they have forgotten the former library."""
    index: WindowIndex = request.getfixturevalue(name)
    settings = Settings(signature=signature, plausibility=False)
    before, after, _ = _exchanged(frames, small_index, index, 300, settings)
    along = _pushed(Recognizer(index, settings), frames)
    assert [each.time for each in before + after] == [each.time for each in along]
    for one, expected in zip(after, along[len(before) :], strict=True):
        assert np.abs(one.scores - expected.scores).max() <= SAME_SCORE
        assert one.share == pytest.approx(expected.share, rel=1e-9)
        assert (one.eigenvector_class, one.classes) == (expected.eigenvector_class, expected.classes)
        if one.time > after[0].time + FORGOTTEN:
            assert (one.guess, one.outcome) == (expected.guess, expected.outcome)


def test_a_motion_that_goes_on_goes_on(small_index: WindowIndex, taught: WindowIndex, frames: list[Frame]) -> None:
    """A class that stays is neither ended nor started again, though its index is another."""
    before, after, ended = _exchanged(frames, small_index, taught, 130)
    events = [event for answer in before + after for event in answer.events]
    assert ended is None
    assert {answer.classes[answer.best] for answer in (before[-1], *after[:3])} == {"kickLFront1Reps"}
    assert [event.label for event in events[:2]] == ["kickLFront1Reps"] * 2
    start, end = events[:2]
    assert (start.kind, end.kind) == (EventKind.START, EventKind.END)
    assert start.time < frames[130].time < end.time
    assert (start.index, end.index) == (
        small_index.library.classes.index("kickLFront1Reps"),
        taught.library.classes.index("kickLFront1Reps"),
    )


def test_removing_a_class_ends_its_motion(small_index: WindowIndex, frames: list[Frame]) -> None:
    """The exchange gives its end, at the time of the newest frame, and the end comes once."""
    without = WindowIndex.of(small_index.library.without(classes=["kickLFront1Reps"]))
    _, after, ended = _exchanged(frames, small_index, without, 130)
    assert ended is not None
    assert (ended.label, ended.kind, ended.time) == ("kickLFront1Reps", EventKind.END, frames[129].time)
    kinds = [event.kind for answer in after for event in answer.events]
    assert EventKind.END not in kinds[:1]


def test_a_library_that_holds_nothing(small_index: WindowIndex, taught: WindowIndex, frames: list[Frame]) -> None:
    """A class renamed to `nothing` is no longer among the answers' classes."""
    index = WindowIndex.of(taught.library.renamed({"squat1Reps": NOTHING}))
    _, after, _ = _exchanged(frames, small_index, index, 200)
    assert {answer.classes for answer in after} == {("hopBothLegs1hops", "kickLFront1Reps", "lieDownFloor")}
    assert {len(answer.scores) for answer in after} == {3}


def test_all_performers_go_on(small_index: WindowIndex, taught: WindowIndex, frames: list[Frame]) -> None:
    """Present performers lose no answer, and later ones are compared with the new library."""
    performers = Performers(small_index)
    answers = [performers.push(frame, 0.0) for frame in frames[:200]]
    assert performers.exchange(taught) == []
    assert performers.library is taught.library
    answers += [performers.push(frame, 0.0) for frame in frames[200:400]]
    _, after, _ = _exchanged(frames[:400], small_index, taught, 200)
    last = [answer for answer in answers[200:] if answer is not None]
    assert [each.scores.tolist() for each in last] == [each.scores.tolist() for each in after]
    newcomer = [performers.push(replace(frame, performer="q"), 0.0) for frame in frames[:60]]
    assert {answer.classes for answer in newcomer if answer} == {taught.library.classes}


def test_other_joints_are_refused(small_index: WindowIndex, sticks: MotionLibrary, frames: list[Frame]) -> None:
    """A library of other joints is refused, and the feed goes on with the one that there was."""
    performers = Performers(small_index)
    for frame in frames[:50]:
        performers.push(frame, 0.0)
    with pytest.raises(SkeletonMismatchError, match="31 joints"):
        performers.exchange(sticks)
    assert performers.library is small_index.library
    assert any(performers.push(frame, 0.0) for frame in frames[50:60])


def test_two_threads_at_once_are_refused(small_index: WindowIndex, frames: list[Frame]) -> None:
    """When two threads use one recogniser at once, one gets an error, and the recogniser stays usable."""
    recognizer, refused = Recognizer(small_index), list[str]()
    done = threading.Event()

    def push_again_and_again() -> None:
        time = 100.0
        while not done.is_set():
            time += 0.01
            try:
                recognizer.push(Frame("p", time, frames[0].positions))
            except RuntimeError as error:
                refused.append(str(error))
                done.set()

    threads = [threading.Thread(target=push_again_and_again) for _ in range(2)]
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(60)
    finally:
        done.set()
        sys.setswitchinterval(before)
    assert "one thread at a time" in refused[0]
    assert _pushed(recognizer, [replace(frame, time=frame.time + 1e6) for frame in frames[:60]])
