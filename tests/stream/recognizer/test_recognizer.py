"""The recogniser of one performer: when it answers, what it refuses, and when it begins anew."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import STICK, STICK_CLASSES, stick_clip, stick_clips

from kinespace.library.motion_library import MotionLibrary
from kinespace.library.skeleton import Skeleton
from kinespace.library.windows.index import opened
from kinespace.stream.frame import MAX_DISTANCE, Frame
from kinespace.stream.recognition import Outcome, Recognition
from kinespace.stream.recognizer import LiveSignature, Performers, Recognizer, RecognizerCounts, Settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from kinespace.library.windows.index import WindowIndex

RATES = [30, 60, 120, 240]


@pytest.fixture(scope="module")
def library(sticks: MotionLibrary) -> MotionLibrary:
    """Give the library of these tests."""
    return sticks


def _frames(class_name: str, *, seconds: float = 3.0, rate: float = 120.0, start: float = 0.0) -> list[Frame]:
    """Perform a class once a second or so, at a frame rate, from a moment on."""
    clip = stick_clip(class_name, seed=50, frames=round(seconds * rate), rate=rate)
    return [Frame("p", start + index / rate, positions) for index, positions in enumerate(clip.positions)]


def _pushed(recognizer: Recognizer, frames: Iterable[Frame]) -> list[Recognition]:
    return [recognition for frame in frames if (recognition := recognizer.push(frame)) is not None]


def _assert_same(first: Sequence[Recognition], second: Sequence[Recognition]) -> None:
    """Demand the same answers, number for number."""
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        assert np.array_equal(one.scores, other.scores)
        for name in (each.name for each in fields(Recognition) if each.name not in ("scores", "events")):
            assert getattr(one, name) == getattr(other, name)


# --- when it answers ---------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("signature", LiveSignature)
@pytest.mark.parametrize("start", [0.0, 7.0, 1.7e9])
@pytest.mark.parametrize(("rate", "first"), [(30, 5), (60, 9), (120, 18), (240, 36)])
def test_the_first_answer_comes_after_a_moment(
    library: MotionLibrary, signature: LiveSignature, start: float, rate: int, first: int
) -> None:
    """At any frame rate and on any clock the first answer comes with the first frame 0.15 seconds after the first."""
    recognizer = Recognizer(library, Settings(signature=signature))
    answers = _pushed(recognizer, _frames("bow", rate=rate, start=start))
    assert answers[0].time == start + first / rate


def test_two_frames_are_no_window(library: MotionLibrary) -> None:
    """Two frames, even far apart, are not answered; the third is."""
    recognizer = Recognizer(library, Settings(hop=0))
    frames = _frames("bow")
    answers = [recognizer.push(frames[index]) for index in (0, 30, 31)]
    assert [answer is None for answer in answers] == [True, True, False]


@pytest.mark.slow
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("class_name", STICK_CLASSES)
def test_feeds_of_any_rate_are_recognised_alike(library: MotionLibrary, rate: int, class_name: str) -> None:
    """The same movement at 30 to 240 frames per second gets the same class, and 30 answers a second."""
    answers = _pushed(Recognizer(library), _frames(class_name, rate=rate))
    assert {answer.label for answer in answers} == {class_name}
    assert len(answers) == pytest.approx(30 * (3 - 0.15), abs=1)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [24, 50, 100, 119.88])
@pytest.mark.parametrize("hop", [0.05, 1 / 30, 0.11])
def test_hops_keep_their_mean_distance(library: MotionLibrary, rate: float, hop: float) -> None:
    """When hops fall between frames each answer waits for the next frame, and none waits longer for its sake."""
    answers = _pushed(Recognizer(library, Settings(hop=hop)), _frames("jump", seconds=6.0, rate=rate))
    times = np.array([answer.time for answer in answers])
    spacing = max(hop, 1 / rate)
    late = (times - times[0]) - spacing * np.arange(len(times))
    assert late.min() > -1e-3 * spacing
    assert late.max() < 1 / rate


def test_hop_0_answers_every_frame(library: MotionLibrary) -> None:
    """With a hop of 0 every frame from the first answered on is answered."""
    frames = _frames("wave")
    answers = _pushed(Recognizer(library, Settings(hop=0)), frames)
    assert [answer.time for answer in answers] == [frame.time for frame in frames[18:]]


def test_an_answer_has_performer_and_time(library: MotionLibrary) -> None:
    """The answer has the performer and the time of the frame that was just pushed."""
    recognizer = Recognizer(library)
    for frame in _frames("bow"):
        recognition = recognizer.push(Frame("Ada", frame.time, frame.positions))
        if recognition is not None:
            assert (recognition.performer, recognition.time) == ("Ada", frame.time)
            assert recognition.classes == library.classes
            assert recognition.scores.shape == (len(STICK_CLASSES),)
    assert recognizer.counts.hops > 0


def test_lost_frames_cost_no_answer(library: MotionLibrary) -> None:
    """With a third of the frames lost the class is the same and answers come as often."""
    frames = _frames("wave")
    kept = np.random.default_rng(4).random(len(frames)) > 1 / 3
    answers = _pushed(Recognizer(library), [frame for frame, keep in zip(frames, kept, strict=True) if keep])
    assert {answer.label for answer in answers} == {"wave"}
    assert len(answers) == pytest.approx(30 * (3 - 0.15), abs=2)


# --- its answers ------------------------------------------------------------------------------------------------


def test_frames_that_are_only_followed_fill_the_windows(library: MotionLibrary) -> None:
    """Before the moment nothing is answered; afterwards the windows are those of all frames."""
    frames, every = _frames("bow", seconds=1.5, rate=60), Settings(hop=0)
    expected = [each for each in _pushed(Recognizer(library, every), frames) if each.time >= 1.0]
    recognizer = Recognizer(library, every)
    recognizer.only_follow(1.0)
    found = _pushed(recognizer, frames)
    assert [each.time for each in found] == [each.time for each in expected]
    assert all(np.array_equal(one.scores, other.scores) for one, other in zip(found, expected, strict=True))


@pytest.mark.slow
def test_answers_do_not_change_afterwards(library: MotionLibrary) -> None:
    """An answer does not change while the recogniser goes on."""
    recognizer = Recognizer(library, Settings(hop=0))
    answers = _pushed(recognizer, _frames("bow"))
    scores = [answer.scores.copy() for answer in answers]
    _pushed(recognizer, _frames("jump", start=3.0))
    assert all(np.array_equal(answer.scores, before) for answer, before in zip(answers, scores, strict=True))


def test_frames_are_not_changed_or_kept(library: MotionLibrary) -> None:
    """Positions are read only, and may be overwritten once they are pushed, as a receiver with one buffer does."""
    frames = _frames("jump")
    expected = _pushed(Recognizer(library), frames)
    recognizer, buffer, answers = Recognizer(library), np.empty((6, 3)), []
    for frame in frames:
        buffer[:] = frame.positions
        answer = recognizer.push(Frame("p", frame.time, buffer))
        assert np.array_equal(buffer, frame.positions)
        answers += [] if answer is None else [answer]
        buffer[:] = 1e6
    _assert_same(answers, expected)


# --- frames that come late, or not at all ------------------------------------------------------------------------


@pytest.mark.slow
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_late_frames_are_counted_and_change_nothing(library: MotionLibrary, seed: int) -> None:
    """Late and repeated frames are refused; the answers equal those without them."""
    generator = np.random.default_rng(seed)
    frames = _frames("wave", seconds=2.0)
    recognizer, answers, late = Recognizer(library), [], 0
    for index, frame in enumerate(frames):
        answers += _pushed(recognizer, [frame])
        for _ in range(int(generator.integers(0, 4)) if index else 0):
            behind = frames[max(0, index - int(generator.integers(0, 100)))]
            assert recognizer.push(Frame("p", behind.time, generator.normal(size=(6, 3)))) is None
            late += 1
    assert recognizer.counts.out_of_order == late
    assert (recognizer.counts.frames, recognizer.counts.restarts) == (len(frames), 0)
    _assert_same(answers, _pushed(Recognizer(library), frames))


def test_a_longer_gap_begins_a_new_window(library: MotionLibrary) -> None:
    """After more than the longest gap without a frame answers come as at first, and are the new feed's."""
    recognizer = Recognizer(library)
    _pushed(recognizer, _frames("bow"))
    answers = _pushed(recognizer, _frames("jump", start=2.992 + 0.51))
    assert recognizer.counts.restarts == 1
    assert answers[0].time == pytest.approx(2.992 + 0.51 + 0.15)
    assert {answer.label for answer in answers} == {"jump"}


def test_a_shorter_gap_is_bridged(library: MotionLibrary) -> None:
    """After a gap shorter than the longest window, the next frame is answered with the rest of the window."""
    recognizer = Recognizer(library)
    frames = _frames("bow")
    _pushed(recognizer, frames[:200])
    assert recognizer.push(frames[200 + 58]) is not None
    assert recognizer.counts.restarts == 0


def test_a_gap_as_long_as_the_papers_window_is_too_long(library: MotionLibrary) -> None:
    """When a gap leaves a short window empty, no answer is made of the few frames after it."""
    settings = Settings(signature=LiveSignature.PAPER, window=0.3, longest_gap=0.5, hop=0.0)
    recognizer = Recognizer(library, settings)
    frames = _frames("bow")
    assert _pushed(recognizer, frames[:100])
    answers = _pushed(recognizer, frames[100 + 40 :])
    assert recognizer.counts.restarts == 1
    assert answers[0].time == pytest.approx(frames[140].time + 0.15)


@pytest.mark.parametrize("gap", [0.2, 1.5])
def test_the_longest_gap_is_a_setting(library: MotionLibrary, gap: float) -> None:
    """The window begins anew after just the given gap."""
    recognizer = Recognizer(library, Settings(longest_gap=gap))
    for time in (0.0, gap - 0.01, 2 * gap + 0.01):
        recognizer.push(Frame("p", time, _frames("bow")[0].positions))
    assert recognizer.counts.restarts == 1


def test_no_gap_is_longer_than_the_longest_window(library: MotionLibrary) -> None:
    """With any longest gap, after two seconds all windows are empty."""
    recognizer = Recognizer(library, Settings(longest_gap=60.0))
    for time in (0.0, 1.9, 4.0):
        recognizer.push(Frame("p", time, _frames("bow")[0].positions))
    assert recognizer.counts.restarts == 1


@pytest.mark.parametrize(("behind", "restarts"), [(1.5, 0), (2.5, 1)])
def test_a_frame_older_than_every_window_is_a_new_beginning(
    library: MotionLibrary, behind: float, restarts: int
) -> None:
    """A frame behind by less than the longest of several windows is late; behind by more it begins a new feed."""
    recognizer = Recognizer(library, Settings(longest_gap=1.5))
    pose = _frames("bow")[0].positions
    for time in (9.0, 10.0, 10.0 - behind):
        recognizer.push(Frame("p", time, pose))
    assert recognizer.counts.restarts == restarts
    assert recognizer.counts.out_of_order == 1 - restarts


def test_a_sender_that_starts_anew_is_followed_at_once(library: MotionLibrary) -> None:
    """A clock that jumps back by more than the window begins a new window with that very frame."""
    recognizer = Recognizer(library)
    before = _pushed(recognizer, _frames("bow", start=100.0))
    after = _pushed(recognizer, _frames("jump"))
    assert {answer.label for answer in before} == {"bow"}
    assert {answer.label for answer in after} == {"jump"}
    assert after[0].time == pytest.approx(0.15)
    assert recognizer.counts == RecognizerCounts(frames=720, out_of_order=0, restarts=1, hops=len(before) + len(after))


@pytest.mark.parametrize("patience", [0, 3, 10])
def test_a_clock_set_back_a_little_is_followed_after_some_patience(library: MotionLibrary, patience: int) -> None:
    """When frames keep coming that are a little old, as many as patience allows are refused, then they are the feed."""
    recognizer = Recognizer(library, Settings(patience=patience))
    _pushed(recognizer, _frames("bow"))
    answers = _pushed(recognizer, _frames("jump", start=2.5))
    assert recognizer.counts.out_of_order == patience
    assert recognizer.counts.restarts == 1
    assert answers[0].time == pytest.approx(2.5 + patience / 120 + 0.15)
    assert {answer.label for answer in answers} == {"jump"}


def test_patience_counts_late_frames_in_a_row(library: MotionLibrary) -> None:
    """Late frames with good ones between them never use up the patience."""
    recognizer = Recognizer(library, Settings(patience=2))
    frames = _frames("bow")
    for first, second in pairwise(frames):
        for frame in (second, first):
            recognizer.push(frame)
    assert recognizer.counts.restarts == 0
    assert recognizer.counts.frames == len(frames) - 1


@pytest.mark.parametrize(("unit", "start"), [(1e3, 0.0), (1e6, 1.7e15), (1e9, 1.7e18)])
def test_a_clock_in_other_units_starts_anew_with_every_frame(library: MotionLibrary, unit: float, start: float) -> None:
    """A sender that counts milli-, micro- or nanoseconds is never answered, and its frames show as restarts."""
    recognizer = Recognizer(library)
    frames = _frames("bow")
    changed = [Frame("p", start + frame.time * unit, frame.positions) for frame in frames]
    assert not _pushed(recognizer, changed)
    assert recognizer.counts.restarts == len(frames) - 1


def test_the_largest_jump_there_is(library: MotionLibrary) -> None:
    """From the earliest to the latest number there is, and back, the window begins anew, and then goes on."""
    recognizer = Recognizer(library)
    first = _frames("bow")[0]
    for time in (-1.7e308, 1.7e308, -1.7e308):
        assert recognizer.push(Frame("p", time, first.positions)) is None
    assert recognizer.counts.restarts == 2
    assert {answer.label for answer in _pushed(recognizer, _frames("wave"))} == {"wave"}


def test_after_reset_all_is_forgotten_but_the_counts(library: MotionLibrary) -> None:
    """The same feed again after a reset, at the same times, gets the same answers, number for number."""
    recognizer = Recognizer(library)
    frames = [*_frames("bow", seconds=2.0), *_frames("wave", seconds=2.0, start=2.0)]
    first = _pushed(recognizer, frames)
    recognizer.reset()
    _assert_same(_pushed(recognizer, frames), first)
    assert recognizer.counts.frames == 2 * len(frames)
    assert recognizer.counts.hops == 2 * len(first)
    assert (recognizer.counts.out_of_order, recognizer.counts.restarts) == (0, 0)


def test_without_reset_the_same_feed_is_a_sender_that_starts_anew(library: MotionLibrary) -> None:
    """The same feed again without a reset gets the same answers, and one restart is counted."""
    recognizer = Recognizer(library)
    frames = _frames("jump")
    first = _pushed(recognizer, frames)
    _assert_same(_pushed(recognizer, frames), first)
    assert recognizer.counts.restarts == 1


def test_it_follows_one_performer(library: MotionLibrary) -> None:
    """Frames of two performers are not taken for one body: the second is refused until a reset, and changes nothing."""
    recognizer, frames = Recognizer(library), _frames("bow")
    answers = _pushed(recognizer, frames[:150])
    with pytest.raises(ValueError, match="performer: expected 'p' until `reset`, got 'q'"):
        recognizer.push(replace(frames[150], performer="q"))
    answers += _pushed(recognizer, frames[150:])
    _assert_same(answers, _pushed(Recognizer(library), frames))
    recognizer.reset()
    others = _pushed(recognizer, [replace(frame, performer="q") for frame in frames])
    assert {answer.performer for answer in others} == {"q"}


def test_every_change_is_for_one_thread_at_a_time(library: MotionLibrary) -> None:
    """A call during another call is refused, whatever it changes; afterwards the recogniser is usable."""
    recognizer, frames = Recognizer(library), _frames("bow")

    class Meanwhile(float):
        """A time; when the recogniser computes with it, other threads come."""

        def __sub__(self, other: float) -> float:
            for change in (recognizer.reset, recognizer.end, partial(recognizer.set_sensitivity, 0.1)):
                with pytest.raises(RuntimeError, match="used by one thread at a time"):
                    change()
            return float(self) - other

    answers = _pushed(
        recognizer, [*frames[:100], replace(frames[100], time=Meanwhile(frames[100].time)), *frames[101:]]
    )
    _assert_same(answers, _pushed(Recognizer(library), frames))


# --- its classes -------------------------------------------------------------------------------------------------


def test_classes_are_the_order_of_the_answers(library: MotionLibrary) -> None:
    """All of the library's classes, in any order, and more that are never named, also when nothing is known."""
    order = ("nope", *library.classes[::-1])
    answers = _pushed(Recognizer(library, classes=order), _frames("bow"))
    assert {answer.classes for answer in answers} == {order}
    assert {answer.label for answer in answers} == {"bow"}
    assert {answer.scores[0] for answer in answers} == {0.0}


@pytest.mark.parametrize("classes", [["nope"], ["bow"], "bow", [*STICK_CLASSES, "bow"]], ids=str)
def test_classes_that_are_not_all_are_refused(library: MotionLibrary, classes: Sequence[str]) -> None:
    """A class of the library that is left out would be named as another: it is refused at once, and in an exchange."""
    for made in (Recognizer, Performers):
        with pytest.raises(ValueError, match="classes: expected all of the library's"):
            made(library, classes=classes)
        with pytest.raises(ValueError, match="classes: expected all of the library's"):
            made(library).exchange(library, classes)


@pytest.mark.parametrize("given", ["mine.npz", None, {}])
def test_other_than_a_library_and_settings_is_refused(library: MotionLibrary, given: object) -> None:
    """A path, nothing or a dictionary is neither a library nor settings."""
    with pytest.raises(ValueError, match="library: expected a MotionLibrary or its windows, got"):
        Recognizer(given)  # type: ignore[arg-type]
    if given is not None:
        with pytest.raises(ValueError, match="settings: expected Settings, got"):
            Recognizer(library, given)  # type: ignore[arg-type]


# --- senseless frames --------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("joints", [0, 1, 5, 7, 31])
def test_another_number_of_joints_is_refused(library: MotionLibrary, joints: int) -> None:
    """A frame of another body is the caller's mistake: it raises, is not counted, and does not change the window."""
    recognizer = Recognizer(library)
    frames = _frames("bow")
    answers = _pushed(recognizer, frames[:150])
    with pytest.raises(ValueError, match=rf"positions: expected \({len(STICK.joints)}, 3\)"):
        recognizer.push(Frame("p", frames[150].time, np.zeros((joints, 3))))
    answers += _pushed(recognizer, frames[150:])
    _assert_same(answers, _pushed(Recognizer(library), frames))
    assert recognizer.counts.frames == len(frames)


STRANGE = st.sampled_from([0.0, 1.0, -1.0, 1e-3, 1e-160, 5e-324, 1e7, -0.9 * MAX_DISTANCE / 5, 3.0])
STEPS = st.sampled_from([0.0, 1e-9, 1 / 240, 0.01, 0.1, 0.4, 0.6, -0.01, -0.5, -3.0, 1e6, -1e6, 1e18])


@pytest.fixture(scope="module", params=["two people", "one person", "fewer joints", "no parents", "one class"])
def any_index(request: pytest.FixtureRequest, arithmetic: str) -> WindowIndex:  # noqa: ARG001 - in either arithmetic
    """Give a library of each kind."""
    clips = stick_clips(takes=2)
    if request.param == "one person":
        clips = [clip for clip in clips if clip.actor == "aa"]
    if request.param == "one class":
        clips = [clip for clip in clips if clip.class_name == "bow"]
    if request.param == "no parents":
        clips = [clip.as_of(Skeleton(STICK.joints)) for clip in clips]
    library = MotionLibrary.of_clips(clips)
    return opened(library.restricted_to(STICK.joints[:5]) if request.param == "fewer joints" else library)


@pytest.mark.slow
@given(
    positions=st.lists(st.lists(STRANGE, min_size=18, max_size=18), min_size=1, max_size=4),
    steps=st.lists(STEPS, min_size=20, max_size=60),
    signature=st.sampled_from(LiveSignature),
)
@settings(max_examples=40)
def test_nothing_that_is_a_frame_stops_it(
    any_index: WindowIndex, positions: list[list[float]], steps: list[float], signature: LiveSignature
) -> None:
    """No frame that crossed the border makes the recogniser raise, and all answers are made of finite numbers."""
    joints = len(any_index.library.skeleton.joints)
    recognizer = Recognizer(any_index, Settings(signature=signature, hop=0))
    time = 0.0
    for index, step in enumerate(steps):
        time += step
        pose = np.array(positions[index % len(positions)]).reshape(6, 3)[:joints]
        answer = recognizer.push(Frame("p", time, pose))
        if answer is not None:
            numbers = [*answer.scores.tolist(), answer.share, answer.gap, answer.eigenvector_score]
            assert np.isfinite([*numbers, answer.movement, answer.margin]).all()
            assert min(*numbers, answer.movement) >= 0.0
            assert max(numbers) <= 1.0
    counts = recognizer.counts
    assert counts.frames + counts.out_of_order == len(steps)


@pytest.mark.slow
@pytest.mark.parametrize("signature", LiveSignature)
@pytest.mark.parametrize("place", [0.0, 1.5])
def test_all_joints_in_one_point_are_no_body(any_index: WindowIndex, place: float, signature: LiveSignature) -> None:
    """All joints at the origin, as some trackers send without a body, are no motion; a body that comes is named."""
    shape = (len(any_index.library.skeleton.joints), 3)
    nobody = [Frame("p", index / 30, np.full(shape, place)) for index in range(90)]
    recognizer = Recognizer(any_index, Settings(signature=signature))
    answers = _pushed(recognizer, nobody)
    assert {answer.outcome for answer in answers} <= {Outcome.STILL, Outcome.IMPLAUSIBLE}
    assert {answer.movement for answer in answers} == {0.0}
    assert np.isfinite([answer.scores for answer in answers]).all()
    bow = [Frame("p", each.time, each.positions[: shape[0]]) for each in _frames("bow", start=3.0)]
    assert _pushed(recognizer, bow)[-1].outcome is not Outcome.STILL
