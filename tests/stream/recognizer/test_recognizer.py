"""The recogniser of one performer: when it answers, what it refuses and decides, and when it begins anew."""

import copy
import math
import pickle
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import naive
import naive_stream
import numpy as np
import pytest
from fakes import assert_same, pushed, shown
from hypothesis import example, given, settings
from hypothesis import strategies as st
from naive_stream import NaiveFeed
from synthetic import STICK, STICK_CLASSES, stick_clip, stick_clips

from kinespace.library import Clip, MotionLibrary, Skeleton, SkeletonMismatchError, WindowIndex, opened
from kinespace.library.signature.parts import Signature
from kinespace.library.windows.comparer import Distances
from kinespace.stream import Event, EventKind, Frame, Outcome, Performers, Recognition, Recognizer, Settings, recognise
from kinespace.stream.frame import MAX_DISTANCE
from kinespace.stream.recognizer.decision import Decision, Events, Hysteresis
from kinespace.stream.recognizer.done import Look
from kinespace.stream.recognizer.joints import Joints
from kinespace.stream.recognizer.recognizer import answers_to
from kinespace.stream.recognizer.settings import LiveSignature, index_for, needed_lead, sensitivity_for
from kinespace.stream.recognizer.window import Window
from kinespace.tools.feeding.feed import resampled

#: Bows twice a second, for three seconds.
BOWING = shown(stick_clip("bow", seed=50, frames=360).positions)


# --- when it answers ---------------------------------------------------------------------------------------------

STEP = st.sampled_from([1 / 240, 1 / 60, 1 / 30, 0.2, 0.29, 0.41, 0.51, 1.99, 2.01, 0.0, -0.01, -0.3, -1.4, -2.1, 60.0])


@given(
    steps=st.lists(st.one_of(st.just(1 / 120), STEP), min_size=5, max_size=120),
    hop=st.sampled_from([0.0, 1 / 30, 0.05, 0.11]),
    longest_gap=st.sampled_from([0.2, 0.5, 60.0]),
    start=st.sampled_from([0.0, 1.7e9]),
    window=st.sampled_from([None, 0.3]),
)
# Frames that do not lie on the grid of the hops.
@example(steps=[0.007] * 100, hop=0.05, longest_gap=0.5, start=0.0, window=None)
@settings(max_examples=60)
def test_frames_are_taken_and_answered_as_by_the_twin(  # noqa: PLR0913, PLR0917 - a feed has many sides
    sticks: MotionLibrary, steps: list[float], hop: float, longest_gap: float, start: float, window: float | None
) -> None:
    """Frames late, repeated, after gaps, of a clock that began again: the slow twin answers at the same frames."""
    others = {} if window is None else {"signature": LiveSignature.PAPER, "window": window}
    given = Settings(hop=hop, longest_gap=longest_gap, plausibility=False, **others)  # type: ignore[arg-type]
    recognizer, generator, time = Recognizer(sticks, given), np.random.default_rng(1), start
    feed = NaiveFeed([0], hop, longest_gap, window or 2.0)
    for step in steps:
        time += step
        positions = stick_clip("bow", frames=1).positions[0] + 0.01 * generator.normal(size=(6, 3))
        answer = recognizer.push(Frame("p", time, positions))
        due = feed.push(time, naive.distance_rows(positions[None])[0])
        assert (answer is None) == (due is None)
        assert answer is None or (answer.time, answer.performer, answer.classes) == (time, "p", sticks.classes)
    counts = recognizer.counts
    assert (counts.out_of_order, counts.restarts) == (feed.out_of_order, feed.restarts)
    assert counts.frames + counts.out_of_order == len(steps)


# --- one performer, one thread -----------------------------------------------------------------------------------


def test_it_follows_one_performer(sticks: MotionLibrary) -> None:
    """Frames of another performer, or of another body, are refused until a reset, and change nothing."""
    recognizer, frames = Recognizer(sticks), BOWING
    answers = pushed(recognizer, frames[:150])
    with pytest.raises(ValueError, match="performer: expected 'p' until `reset`, got 'q'"):
        recognizer.push(replace(frames[150], performer="q"))
    for joints in (0, 1, 5, 7, 31):
        with pytest.raises(ValueError, match=rf"positions: expected \({len(STICK.joints)}, 3\)"):
            recognizer.push(Frame("p", frames[150].time, np.zeros((joints, 3))))
    answers += pushed(recognizer, frames[150:])
    assert_same(answers, pushed(Recognizer(sticks), frames), "events")
    assert recognizer.counts.frames == len(frames)
    recognizer.reset()
    assert recognizer.pair_contributions() is None
    others = pushed(recognizer, [replace(frame, performer="q") for frame in frames])
    assert {answer.performer for answer in others} == {"q"}


@pytest.mark.parametrize("signature", list(LiveSignature))
def test_a_hops_covariance_is_the_batchs_and_its_best_product_the_papers_answer(
    sticks: MotionLibrary, signature: LiveSignature
) -> None:
    """The covariance equals numpy's of the window's rows, and the class is of the window with the largest product."""
    recognizer, frames = Recognizer(sticks, Settings(signature=signature)), BOWING
    with pytest.raises(ValueError, match="covariance: expected an answer before, got none yet"):
        recognizer.covariance()
    index = index_for(sticks, recognizer.settings)
    for place, frame in enumerate(frames, 1):
        if answer := recognizer.push(frame):
            hop = recognizer.covariance()
            positions = np.array([each.positions for each in frames[place - hop.frames : place]])
            rows = naive.distance_rows(positions) @ hop.directions
            np.testing.assert_allclose(np.cov(rows.T, bias=True), hop.matrix, rtol=1e-7, atol=1e-12)
            assert abs(np.linalg.eigh(hop.matrix)[1][:, -1] @ hop.eigenvector) == pytest.approx(1)
            products = np.abs(index.eigenvectors @ hop.eigenvector)
            assert answer.eigenvector_score == pytest.approx(products.max(), abs=1e-5)
            assert answer.eigenvector_class == sticks.motions[index.motions[products.argmax()]].class_name


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_copies_are_refused_in_words(sticks: MotionLibrary, copied: Callable[[object], object]) -> None:
    """A copy would share the memory of the original, and both would answer wrongly; libraries are copied rightly."""
    for each in (Recognizer(sticks), Performers(sticks)):
        with pytest.raises(TypeError, match=f"expected a library or settings, got a {type(each).__name__}"):
            copied(each)
    copied((sticks, opened(sticks), Settings()))


def test_every_change_is_for_one_thread_at_a_time(sticks: MotionLibrary) -> None:
    """A call during another call is refused, whatever it changes; afterwards the recogniser is usable."""
    recognizer, frames = Recognizer(sticks), BOWING
    changes = (
        recognizer.reset,
        recognizer.end,
        partial(recognizer.set_sensitivity, 0.1),
        partial(recognizer.exchange, sticks),
        partial(recognizer.push, frames[0]),
    )

    class Meanwhile(float):
        """A time; when the recogniser computes with it, other threads come."""

        def __sub__(self, other: float) -> float:
            for change in changes:
                with pytest.raises(RuntimeError, match="used by one thread at a time"):
                    change()
            return float(self) - other

    meanwhile = replace(frames[100], time=Meanwhile(frames[100].time))
    answers = pushed(recognizer, [*frames[:100], meanwhile, *frames[101:]])
    # What is due is answered before anything else.
    again = Recognizer(sticks)
    due = next(due for frame in frames if (due := again.take(frame)))
    with pytest.raises(RuntimeError, match="used by one thread at a time"):
        again.reset()
    assert len(answers_to([due])) == 1
    again.reset()
    assert_same(answers, pushed(Recognizer(sticks), frames), "events")


# --- its library -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("classes", [["nope"], ["bow"], "bow", [*STICK_CLASSES, "bow"]], ids=str)
def test_classes_that_are_not_all_are_refused(sticks: MotionLibrary, classes: Sequence[str]) -> None:
    """A class of the library that is left out would be named as another: it is refused at once, and in an exchange."""
    for made in (Recognizer, Performers):
        with pytest.raises(ValueError, match="classes: expected all of the library's"):
            made(sticks, classes=classes)
        with pytest.raises(ValueError, match="classes: expected all of the library's"):
            made(sticks).exchange(sticks, classes)


@pytest.mark.parametrize("given", ["mine.npz", None, {}])
def test_other_than_a_library_and_settings_is_refused(sticks: MotionLibrary, given: object) -> None:
    """A path, nothing or a dictionary is neither a library nor settings."""
    for settings_ in (Settings(), Settings(LiveSignature.PAPER)):
        with pytest.raises(ValueError, match="library: expected a MotionLibrary or its windows, got"):
            Recognizer(given, settings_)  # type: ignore[arg-type]
    if given is not None:
        with pytest.raises(ValueError, match="settings: expected Settings, got"):
            Recognizer(sticks, given)  # type: ignore[arg-type]


def test_in_another_library_no_window_nor_answer_is_lost(sticks: MotionLibrary, small_library: MotionLibrary) -> None:
    """The next hop is compared with the new one; a motion whose class is gone ends; other joints are refused."""
    frames, settings_ = BOWING, Settings(progress=True)
    index = opened(sticks)
    fewer = index.of_some([place for place, each in enumerate(sticks.motions) if each.class_name != "bow"])
    expected, never = (pushed(Recognizer(each, settings_), frames) for each in (index, fewer))
    recognizer = Recognizer(index, settings_)
    with pytest.raises(SkeletonMismatchError):
        recognizer.exchange(small_library)
    answers = pushed(recognizer, frames[:200])
    assert recognizer.exchange(index) is None
    answers += pushed(recognizer, frames[200:280])
    ended = recognizer.exchange(fewer)
    assert (ended.kind, ended.label, ended.time) == (EventKind.END, "bow", frames[279].time)
    for answer, other in zip(answers, expected, strict=False):
        np.testing.assert_allclose(answer.scores, other.scores, atol=1e-4)
        assert (answer.label, answer.progress is None) == (other.label, other.progress is None)
    for answer, other in zip(reversed(pushed(recognizer, frames[280:])), reversed(never), strict=False):
        np.testing.assert_allclose(answer.scores, other.scores, atol=1e-4)
        assert (answer.time, answer.classes) == (other.time, ("jump", "wave"))


# --- senseless frames --------------------------------------------------------------------------------------------

STRANGE = st.sampled_from([0.0, 1.0, -1.0, 1e-3, 1e-160, 5e-324, 1e7, -0.9 * MAX_DISTANCE / 5, 3.0])
LEAPS = st.sampled_from([0.0, 1e-9, 1 / 240, 0.01, 0.1, 0.4, 0.6, -0.01, -0.5, -3.0, 1e6, -1e6, 1e18])


@pytest.fixture(scope="module", params=["one person", "fewer joints", "no parents", "one class"])
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
    steps=st.lists(LEAPS, min_size=20, max_size=60),
    signature=st.sampled_from(LiveSignature),
)
@settings(max_examples=15)
def test_nothing_that_is_a_frame_stops_it(
    any_index: WindowIndex, positions: list[list[float]], steps: list[float], signature: LiveSignature
) -> None:
    """No frame that crossed the border makes the recogniser raise, and all answers are made of finite numbers."""
    joints = len(any_index.library.skeleton.joints)
    recognizer, time = Recognizer(any_index, Settings(signature=signature, hop=0)), 0.0
    for index, step in enumerate(steps):
        time += step
        pose = np.array(positions[index % len(positions)]).reshape(6, 3)[:joints]
        answer = recognizer.push(Frame("p", time, pose))
        if answer is not None:
            numbers = [*answer.scores.tolist(), answer.share, answer.gap, answer.eigenvector_score]
            assert np.isfinite([*numbers, answer.movement, answer.margin]).all()
            assert min(*numbers, answer.movement) >= 0.0
            assert max(numbers) <= 1.0


def _with_pauses(clips: Iterable[Clip], noise: float, sway: float) -> Iterator[Frame]:
    """Show motions one after another at 60 Hz; before each the body stands still for four seconds."""
    generator, time = np.random.default_rng(1), 1.0
    for clip in clips:
        shown = resampled(clip, 60.0).positions
        swaying = sway * np.sin(0.03 * np.arange(240))[:, None, None] * np.linspace(0, 1, len(shown[0]))[:, None]
        for positions in (*(shown[0] + swaying), *shown):
            yield Frame("ann", time, positions + generator.normal(0.0, noise, positions.shape))
            time += 1 / 60


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "sway"), [(0.0, 0.0), (0.0003, 0.003)])
def test_a_body_at_rest_is_answered_as_if_all_were_compared(
    builtin: MotionLibrary, monkeypatch: pytest.MonkeyPatch, noise: float, sway: float
) -> None:
    """Names, guesses, events and motions that are done are the same; half of the still hops compare nothing."""
    first = {each.class_name: each for each in builtin.motions}
    frames = list(_with_pauses(list(first.values())[:4], noise, sway))
    reads, compared = [0], WindowIndex.distances

    def counted(index: WindowIndex, signatures: list[Signature]) -> list[Distances]:
        reads[-1] += len(signatures)
        return compared(index, signatures)

    monkeypatch.setattr(WindowIndex, "distances", counted)
    answers = []
    for rests in (True, False):
        if not rests:
            monkeypatch.setattr(Window, "_rests", lambda _: False)
        recognizer = Recognizer(builtin)
        answers.append([answer for frame in frames if (answer := recognizer.push(frame))])
        reads.append(0)
    said = [[(a.time, a.label, a.guess, a.events, a.done and a.done.label) for a in each] for each in answers]
    assert said[0] == said[1]
    still = sum(answer.outcome is Outcome.STILL for answer in answers[0])
    assert still > 300
    assert reads[1] == len(answers[1])
    assert reads[0] < len(answers[0]) - 0.4 * still


def test_a_clip_is_answered_as_live(sticks: MotionLibrary) -> None:
    """The answers are those of a recogniser to which the frames are pushed; fewer joints restrict the library."""
    clip = replace(stick_clip("bow", seed=50, frames=240, rate=120.0), actor="ann")
    expected = pushed(Recognizer(sticks), shown(clip.positions, 120.0, performer="ann"))
    assert_same(recognise(sticks, clip), [each for each in expected if each])
    assert recognise(sticks, clip, Settings(hop=0.5))[1].time == pytest.approx(0.65, abs=0.02)
    assert recognise(sticks, replace(clip.restricted_to(STICK.joints[:5]), actor=""))
    with pytest.raises(SkeletonMismatchError, match="expected at least 5"):
        recognise(sticks, clip.restricted_to(STICK.joints[:4]))
    with pytest.raises(ValueError, match="clip: expected a Clip, got ndarray"):
        recognise(sticks, clip.positions)  # type: ignore[arg-type] # a mistake
    with pytest.raises(ValueError, match=r"frame: expected a Frame.* got ndarray"):
        Recognizer(sticks).push(clip.positions)  # type: ignore[arg-type] # a mistake


def test_an_answer_is_a_flat_row(sticks: MotionLibrary) -> None:
    """Every value is a number or a text; label, guess, scores and events are the answer's."""
    answers = recognise(sticks, stick_clip("bow", seed=50, frames=360, rate=120.0))
    rows = [answer.as_dict() for answer in answers]
    assert {type(value) for row in rows for value in row.values()} <= {str, float, int}
    assert len({tuple(row) for row in rows}) == 1
    for row, answer in zip(rows, answers, strict=True):
        assert (row["label"], row["score"], row["margin"]) == (answer.label, answer.score, answer.margin)
        assert row["class"] == (answer.class_name or "")
        assert [row[f"score {name}"] for name in answer.classes] == answer.scores.tolist()
        assert bool(row["event"]) == bool(answer.events)
    assert any(row["event"].startswith("start bow") for row in rows)
    assert np.all(np.diff([row["time"] for row in rows]) > 0)


PAPER = LiveSignature.PAPER


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"signature": "best"}, "signature: expected windows or paper, got 'best'"),
        ({"window": 1.0}, "window: expected the signature paper with it, got windows"),
        ({"signature": "paper", "sensitivity": 0.0}, "sensitivity: expected the signature windows with it, got paper"),
        ({"signature": "paper", "progress": True}, "progress: expected the signature windows with it, got paper"),
        *(({"signature": "paper", "window": each}, "window: expected more than 0") for each in (0, -1.0, math.inf)),
        *(({"longest_gap": each}, "longest_gap: expected more than 0 and at most 60 s") for each in (0, math.nan)),
        *(
            ({name: each}, f"{name}: expected a number not below 0, got {each}")
            for name in ("sensitivity", "lead", "hop", "stillness")
            for each in (-1e-9, math.inf, math.nan)
        ),
        ({"sensitivity": 1.1}, "sensitivity: expected a share from 0 to 1, got 1.1"),
        *(({"hop": each}, f"hop: expected 0, or 0.001 to 60 seconds, got {each}") for each in (61.0, 0.0009)),
        *(({"hop": each}, "hop: expected a number, got") for each in ("1", None, True)),
        *(({"progress": each}, "progress: expected True or False, got") for each in (1, None)),
        ({"lead": "3"}, "lead: expected a number, got '3'"),
    ],
)
def test_settings_that_make_no_sense_are_refused(given: dict[str, Any], said: str) -> None:
    """The message says which, what was expected, and what came."""
    with pytest.raises(ValueError, match=said):
        Settings(**given)


def test_settings_at_their_bounds() -> None:
    """Numbers of any kind do, and None where a library decides; a signature may be its text."""
    Settings(sensitivity=1, lead=0, hop=60, stillness=np.float32(0.0))
    assert [Settings(hop=hop).hop for hop in (0, 0.001)] == [0, 0.001]
    assert Settings(signature="paper", window=0.1).signature is PAPER  # type: ignore[arg-type]
    assert Settings(sensitivity=None, lead=None) == Settings()


@pytest.mark.parametrize(("actors", "share", "lead"), [("aa", 0.2, 3.6), ([""], 0.07, 3.6), ("ab", 0.2, 3.0)])
def test_a_small_library_names_less_and_starts_later(
    actors: Sequence[str], share: float, lead: float, builtin: MotionLibrary
) -> None:
    """One motion of each class says little of what is unknown, as does one person; strangers say most."""
    library = MotionLibrary.of_clips([stick_clip("wave", actor=actor) for actor in actors])
    assert (sensitivity_for(library, Settings()), needed_lead(library, Settings())) == (share, lead)
    assert needed_lead(library, Settings(lead=2.0)) == 2.0
    assert needed_lead(library, Settings(PAPER)) == 3.0
    judged = builtin.without(actors=builtin.actors[len(actors) :])
    assert (sensitivity_for(judged, Settings()), needed_lead(judged, Settings())) == (0.05, 3.0)


def test_a_library_is_opened_as_the_settings_compare_it(sticks: MotionLibrary) -> None:
    """By the paper with its own window, once; windows that are open already are used."""
    index = opened(sticks)
    assert index_for(sticks, Settings()) is index_for(index, Settings()) is index
    paper = index_for(index, Settings(PAPER, window=0.3))
    assert paper.comparison.weighing.parts[0].seconds == 0.3
    assert index_for(paper, Settings(PAPER, window=0.3)) is index_for(sticks, Settings(PAPER, window=0.3)) is paper
    assert index_for(paper, Settings(PAPER)).comparison.weighing.parts[0].seconds == 0.5


# --- what is decided: names, guesses, events --------------------------------------------------------------------------


CLASSES = ("bow", "jump", "wave")
NAMED = Outcome.NAMED
MOVING = Signature({}, np.zeros(1), 0.1, 0.5, 0.5)


def _recognition(
    time: float, leader: int = 0, lead: float = 2.0, outcome: Outcome = NAMED, classes: Sequence[str] = CLASSES
) -> Recognition:
    """Make an answer in which a class leads in log distance."""
    scores = np.full(len(classes), 0.2)
    scores[leader] = 0.9
    return Recognition("p", time, outcome, tuple(classes), scores, 0.1, guess=leader, lead=lead)


def _pushed(decision: Events, recognitions: Iterable[Recognition]) -> list[Event]:
    return [event for recognition in recognitions for event in decision.push(recognition)]


@given(st.lists(st.tuples(st.integers(0, 3), st.floats(0, 2), st.floats(0, 0.2)), max_size=60), st.floats(0.01, 3))
def test_a_name_takes_over_when_its_lead_has_added_up(course: list[tuple[int, float, float]], needed: float) -> None:
    """The lead of the name in front, times thirtieths of a second, counts since it came to the front, and once."""
    hysteresis, names, gathered, current = Hysteresis(needed), "abcd", 0.0, None
    for hop, (leader, pace, elapsed) in enumerate(course):
        gathered = 30 * pace * elapsed + (gathered if hop and course[hop - 1][0] == leader else 0.0)
        if abs(gathered - needed) < 1e-6:
            return
        taken = names[leader] != current and gathered > needed
        current = names[leader] if taken else current
        assert hysteresis.push(names[leader], pace, elapsed) == taken
        assert hysteresis.current == current
    hysteresis.clear()
    assert hysteresis.current is None


# --- guesses -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("gap", "outcome"), [(0.019, Outcome.AMBIGUOUS), (0.021, NAMED)])
def test_the_papers_eigenvector_may_be_arbitrary(sticks: MotionLibrary, gap: float, outcome: Outcome) -> None:
    """Then its movement is ambiguous, and it has no evidence."""
    by_paper = Settings(LiveSignature.PAPER)
    index = index_for(sticks, by_paper)
    window, logs = Window(index), np.array([[0.1, 1.0, 1.0]] * 3)
    window.signature = MOVING._replace(gap=gap)
    window.distances = Distances(logs, logs[0], logs[1:], np.exp(-logs[0]))
    joints = Joints(index.segments, STICK.joints, np.empty((1, 6, 3)), is_watched=False)
    answer = Decision(index, by_paper, ()).push(Frame("p", 0.0, np.zeros((6, 3))), window, joints, Look())
    assert (answer.outcome, answer.evidence) == (outcome, None)


# --- events ------------------------------------------------------------------------------------------------------


@given(
    course=st.lists(
        st.tuples(
            st.integers(0, 2), st.sampled_from(Outcome), st.floats(0.0, 2.0), st.floats(0.01, 0.3), st.integers(1, 12)
        ),
        min_size=1,
        max_size=12,
    ),
    needed=st.sampled_from([0.3, 3.0, 6.0]),
)
@settings(max_examples=60)
def test_events_are_the_twins(course: list[tuple[int, Outcome, float, float, int]], needed: float) -> None:
    """At any hops, of any outcomes and leads, starts and ends, with their scores, are the slow twin's."""
    time, answers = 5.0, list[Recognition]()
    for leader, outcome, lead, hop, hops in course:
        for _ in range(hops):
            time += hop
            answers.append(_recognition(time, leader, lead, outcome))
    named = [each.guess if each.outcome is NAMED else -1 for each in answers]
    leads, outcomes = [each.lead for each in answers], [str(each.outcome) for each in answers]
    # An end by half of the seconds of one outcome and half of another's is decided by rounding.
    for slack in (1 - 1e-9, 1 + 1e-9):
        expected = list(naive_stream.events([each.time for each in answers], leads, named, outcomes, needed * slack))
        if slack < 1:
            before = expected
    if before != expected:
        return
    events = _pushed(Events(needed), answers)
    assert [(event.time, str(event.kind), event.index) for event in events] == expected
    scores = {answer.time: answer.scores for answer in answers}
    for each in events:
        assert each == Event("p", each.kind, CLASSES[each.index], each.index, scores[each.time][each.index], each.time)
