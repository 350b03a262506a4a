"""The decision: the guess, whether it is known, and events that come once, even if the guess flickers."""

from collections.abc import Iterable, Sequence

import naive_stream
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import STICK

from kinespace.library import MotionLibrary
from kinespace.library.signature.parts import Signature
from kinespace.library.windows.comparer import Distances
from kinespace.stream import Event, Frame, LiveSignature, Outcome, Recognition, Settings
from kinespace.stream.recognizer.decision import Decision, Events, Hysteresis
from kinespace.stream.recognizer.done import Look
from kinespace.stream.recognizer.joints import Joints
from kinespace.stream.recognizer.settings import index_for
from kinespace.stream.recognizer.window import Window

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
    hysteresis.keep({"a", "b"})
    assert hysteresis.current == (current if current in {"a", "b", None} else None)
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
    frame = Frame("p", 0.0, np.zeros((6, 3)))
    answer = Decision(index, by_paper, ()).push(frame, window, joints, Look())
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
    for event in events:
        assert event == Event(
            "p", event.kind, CLASSES[event.index], event.index, scores[event.time][event.index], event.time
        )
