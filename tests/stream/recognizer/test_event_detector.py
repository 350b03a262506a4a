"""Events: a motion starts once and ends once, even if the guess flickers."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import naive_stream
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinespace.stream.recognition import Event, EventKind, Outcome, Recognition
from kinespace.stream.recognizer.event_detector import EventDetector

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

CLASSES = ("bow", "jump", "wave")
#: Scores in which the first class leads by much, and by little.
CLEAR, DOUBTFUL = (0.9, 0.3, 0.2), (0.55, 0.5, 0.2)
START, END = EventKind.START, EventKind.END
HOP = 1 / 30


def _recognition(
    time: float, scores: Sequence[float] = CLEAR, best: int | None = None, outcome: Outcome = Outcome.NAMED
) -> Recognition:
    values = np.array(scores)
    best = int(values.argmax()) if best is None else best
    return Recognition(
        performer="p",
        time=time,
        outcome=outcome,
        classes=CLASSES[: len(values)],
        scores=values,
        guess=best,
        movement=0.1,
        lead=_lead(values, best),
    )


def _lead(scores: Sequence[float], best: int) -> float:
    """Say by how much a class leads in log distance."""
    distances = np.log(1 / np.asarray(scores) - 1)
    return float(min(np.delete(distances, best), default=np.inf) - distances[best])


def _led_by(index: int, scores: Sequence[float] = CLEAR) -> tuple[float, ...]:
    """Give scores in which another class leads."""
    return tuple(np.roll(scores, index).tolist())


def _pushed(detector: EventDetector, recognitions: Iterable[Recognition]) -> list[Event]:
    return [event for recognition in recognitions for event in detector.push(recognition)]


def _course(*stretches: tuple[float, Outcome, int], hop: float = HOP) -> list[Recognition]:
    """Make stretches of so many seconds each, of one outcome and, as far as it is named, one class."""
    made, begin = list[Recognition](), 10.0
    for seconds, outcome, index in stretches:
        hops = round(seconds / hop)
        made += [_recognition(begin + k * hop, _led_by(index), outcome=outcome) for k in range(hops)]
        begin += hops * hop
    return made


def _told(events: Iterable[Event]) -> list[tuple[EventKind, str]]:
    return [(event.kind, event.label) for event in events]


# --- starts and ends ---------------------------------------------------------------------------------------------


def test_a_motion_starts_once_and_ends_once() -> None:
    """Three motions in a row, each named at every hop, are three starts, each but the first right after an end."""
    events = _pushed(EventDetector(), _course(*((2.0, Outcome.NAMED, index) for index in range(3))))
    assert _told(events) == [(START, "bow"), (END, "bow"), (START, "jump"), (END, "jump"), (START, "wave")]
    assert events[1].time == events[2].time
    for start, begin in zip(events[::2], (10.0, 12.0, 14.0), strict=True):
        assert begin < start.time < begin + 0.2


def test_an_event_holds_performer_and_score() -> None:
    """A start has performer, label, index, score and time of the deciding recognition; an end has its own class."""
    events = _pushed(EventDetector(), _course((1.0, Outcome.NAMED, 1), (1.0, Outcome.NAMED, 2)))
    start, end, other = events
    assert start == Event("p", START, "jump", 1, 0.9, start.time)
    # In scores that the third class leads the second one's is the first score's last.
    assert end == Event("p", END, "jump", 1, _led_by(2)[1], other.time)
    assert other == Event("p", START, "wave", 2, 0.9, other.time)


@pytest.mark.parametrize("scores", [CLEAR, DOUBTFUL])
def test_a_motion_starts_when_the_lead_has_added_up(scores: tuple[float, ...]) -> None:
    """A start comes when the lead in log distance, 1 at most, times thirtieths of a second, has added up enough."""
    lead = min(_lead(scores, 0), 1.0)
    (event,) = _pushed(EventDetector(3.0), [_recognition(10 + k * HOP, scores) for k in range(300)])
    assert event.time - 10 == pytest.approx(3.0 / (30 * lead), abs=HOP + 1e-9)


def test_a_doubtful_lead_is_believed_later_and_more_lead_later_still() -> None:
    """Starts come later the smaller the lead, and the more of it is asked for."""
    times = [
        _pushed(EventDetector(needed), [_recognition(k * HOP, scores) for k in range(600)])[0].time
        for needed, scores in [(3.0, CLEAR), (3.0, DOUBTFUL), (9.0, DOUBTFUL)]
    ]
    assert all(before < after for before, after in pairwise(times))


def test_another_library_may_ask_for_another_lead() -> None:
    """After an exchange starts come when the new lead has added up."""
    detector = EventDetector(3.0)
    assert detector.exchange({0: 0}, 10.0, 6.0) is None
    (event,) = _pushed(detector, [_recognition(10 + k * HOP) for k in range(60)])
    assert event.time - 10 == pytest.approx(6.0 / 30, abs=HOP + 1e-9)


def test_without_a_lead_to_wait_for_every_change_is_an_event() -> None:
    """With a lead of 0 each change of the named class is an event at its hop."""
    course = [_recognition(k * HOP, _led_by(k % 2)) for k in range(5)]
    events = _pushed(EventDetector(0.0), course)
    assert [event.time for event in events if event.kind is START] == [recognition.time for recognition in course]
    assert len(events) == 9


@pytest.mark.parametrize("lead", [-1e-9, np.inf, np.nan])
def test_a_lead_that_is_none_is_refused(lead: float) -> None:
    """A negative or endless lead is refused, by its name."""
    with pytest.raises(ValueError, match="lead: expected a number not below 0"):
        EventDetector(lead)


# --- no flicker --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("period", [1, 2, 3])
def test_alternating_guesses_start_nothing_new(period: int) -> None:
    """While two classes alternate every few hops, the motion that goes on goes on."""
    detector = EventDetector()
    _pushed(detector, _course((1.0, Outcome.NAMED, 2)))
    flickering = [_recognition(11 + k * HOP, _led_by(k // period % 2, DOUBTFUL)) for k in range(300)]
    assert _pushed(detector, flickering) == []
    ended = detector.end(30.0)
    assert ended is not None
    assert ended.label == "wave"


def test_a_moment_of_another_class_is_no_event() -> None:
    """A class that leads for two hops among another's is passed over; the lead gathered before does not count."""
    detector = EventDetector()
    _pushed(detector, _course((1.0, Outcome.NAMED, 0)))
    for begin in np.arange(11, 20, 0.2).tolist():
        blips = [_recognition(begin + k * HOP, _led_by(1 if k < 2 else 0, DOUBTFUL)) for k in range(6)]
        assert _pushed(detector, blips) == []


@pytest.mark.parametrize(
    ("outcome", "seconds"), [(Outcome.STILL, 0.4), (Outcome.UNKNOWN, 0.8), (Outcome.AMBIGUOUS, 0.4)]
)
def test_having_nothing_to_name_ends_a_motion_after_a_moment(outcome: Outcome, seconds: float) -> None:
    """Still or ambiguous for 0.4 seconds, or unknown for 0.8, ends a motion, within a hop; for less it does not."""
    named = _course((1.0, Outcome.NAMED, 0))
    last = named[-1].time
    nothing = [_recognition(last + k * HOP, outcome=outcome) for k in range(1, 60)]
    (start, end) = _pushed(EventDetector(), [*named, *nothing])
    assert (start.kind, end.kind, end.label) == (START, END, "bow")
    assert end.time - last == pytest.approx(seconds, abs=HOP + 1e-9)
    hops = round(seconds / HOP) - 2
    back = [_recognition(last + (hops + 1 + k) * HOP) for k in range(60)]
    assert _told(_pushed(EventDetector(), [*named, *nothing[:hops], *back])) == [(START, "bow")]


def test_stillness_and_strangeness_add_up() -> None:
    """Half of the time after which stillness ends a motion and half of the unknown's end it together, in any order."""
    for first, then in ((0.2, 0.4), (0.4, 0.2)):
        outcomes = (Outcome.STILL, Outcome.UNKNOWN) if first < then else (Outcome.UNKNOWN, Outcome.STILL)
        course = _course((1.0, Outcome.NAMED, 0), (first, outcomes[0], 0), (2.0, outcomes[1], 0))
        end = _pushed(EventDetector(), course)[-1]
        assert end.kind is END
        assert end.time == pytest.approx(11.0 + first + then, abs=2 * HOP)


def test_nothing_to_name_is_nothing_to_end() -> None:
    """Before a motion has started, hops without a class cause no event."""
    assert _pushed(EventDetector(), _course((3.0, Outcome.UNKNOWN, 0), (3.0, Outcome.STILL, 0))) == []


def test_stillness_between_two_turns_of_a_motion_is_an_end_and_a_start() -> None:
    """A motion performed, left and performed again starts twice and ends once in between."""
    course = _course((1.0, Outcome.NAMED, 1), (1.0, Outcome.STILL, 0), (1.0, Outcome.NAMED, 1))
    assert _told(_pushed(EventDetector(), course)) == [(START, "jump"), (END, "jump"), (START, "jump")]


@pytest.mark.parametrize(("outcome", "seconds"), [(Outcome.STILL, 0.4), (Outcome.UNKNOWN, 0.8)])
def test_the_only_class_of_a_library_starts_and_ends(outcome: Outcome, seconds: float) -> None:
    """Where there is no other class to lead, being named for 0.1 seconds is a start; it ends as any other does."""
    named = [_recognition(10 + k * HOP, (0.8,)) for k in range(30)]
    unnamed = [_recognition(11 + k * HOP, (0.1,), outcome=outcome) for k in range(30)]
    start, end = _pushed(EventDetector(), [*named, *unnamed])
    assert (start.kind, end.kind) == (START, END)
    assert start.time == pytest.approx(10.1, abs=HOP + 1e-9)
    assert end.time == pytest.approx(11 + seconds, abs=HOP + 1e-9)


# --- time --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [15, 60, 120, 240])
def test_the_hop_rate_does_not_matter(rate: int) -> None:
    """At 15 to 240 hops a second the same course has the same events, within a hop or two."""
    stretches = [(1.0, Outcome.NAMED, 0), (1.0, Outcome.UNKNOWN, 0), (1.0, Outcome.NAMED, 2), (1.0, Outcome.NAMED, 1)]
    expected = _pushed(EventDetector(), _course(*stretches))
    events = _pushed(EventDetector(), _course(*stretches, hop=1 / rate))
    assert _told(events) == _told(expected)
    assert len(events) == 5
    for event, other in zip(events, expected, strict=True):
        assert event.time == pytest.approx(other.time, abs=HOP + 1 / rate + 1e-9)


def test_a_gap_adds_no_lead() -> None:
    """A gap in the feed counts as a tenth of a second: it neither starts nor ends a motion."""
    scores = _led_by(1, (0.55, 0.52, 0.2))
    detector = EventDetector()
    assert _pushed(detector, [_recognition(0.0, scores), _recognition(60.0, scores)]) == []
    detector = EventDetector()
    _pushed(detector, _course((1.0, Outcome.NAMED, 0)))
    away = [_recognition(100.0 * k, outcome=Outcome.STILL) for k in range(1, 5)]
    told = [len(detector.push(recognition)) for recognition in away]
    assert told in ([0, 0, 0, 1], [0, 0, 0, 0])


def test_a_clock_set_back_gathers_no_lead() -> None:
    """A sender that begins again has an event when the lead has been gathered on its new clock, not before."""
    detector = EventDetector()
    _pushed(detector, _course((1.0, Outcome.NAMED, 0)))
    events = _pushed(detector, [_recognition(k * HOP, _led_by(1)) for k in range(30)])
    assert _told(events) == [(END, "bow"), (START, "jump")]
    assert 0 < events[0].time < 0.5


def test_the_end_of_a_feed_ends_the_motion_once() -> None:
    """`end` ends the motion that is under way, with the class and score of its start, once."""
    detector = EventDetector()
    assert detector.end(1.0) is None
    (start,) = _pushed(detector, _course((1.0, Outcome.NAMED, 2)))
    assert detector.end(77.0) == Event("p", END, "wave", 2, start.score, 77.0)
    assert detector.end(78.0) is None


def test_after_an_end_a_motion_starts_as_at_first() -> None:
    """Lead gathered before `end` does not count after it."""
    used = EventDetector()
    _pushed(used, _course((1.0, Outcome.NAMED, 0)))
    used.end(11.0)
    course = _course((2.0, Outcome.NAMED, 0), (2.0, Outcome.NAMED, 1))
    assert _pushed(used, course) == _pushed(EventDetector(), course)


# --- against the twin --------------------------------------------------------------------------------------------


@given(seed=st.integers(0, 2**32 - 1), lead=st.sampled_from([0.5, 3.0, 8.0]))
@settings(max_examples=60)
def test_events_are_the_twins_of_any_course(seed: int, lead: float) -> None:
    """Of any course of scores, outcomes and hops the events are the twin's, and take turns."""
    generator = np.random.default_rng(seed)
    length = 150
    hops = generator.choice([1 / 120, HOP, HOP, 0.09, 0.7], size=length) * generator.uniform(0.9, 1.1, length)
    times = np.cumsum(hops).tolist()
    leaders = np.repeat(generator.integers(0, 3, length), generator.integers(1, 25, length))[:length].tolist()
    scores = [
        _led_by(leader, (0.5 + 0.4 * sure, 0.5, 0.3))
        for leader, sure in zip(leaders, generator.random(length), strict=True)
    ]
    kinds = [Outcome.NAMED, Outcome.NAMED, Outcome.UNKNOWN, Outcome.STILL, Outcome.AMBIGUOUS]
    outcomes = np.repeat(generator.integers(0, 5, length), generator.integers(1, 25, length))[:length].tolist()
    course = [
        _recognition(time, score, best=leader, outcome=kinds[outcome])
        for time, score, leader, outcome in zip(times, scores, leaders, outcomes, strict=True)
    ]
    named = [recognition.class_index for recognition in course]
    events = _pushed(EventDetector(lead), course)
    leads = [recognition.lead for recognition in course]
    expected = list(naive_stream.events(times, leads, named, [str(each.outcome) for each in course], lead))
    assert [(event.time, str(event.kind), event.index) for event in events] == expected
    assert [event.kind for event in events] == [START, END] * (len(events) // 2) + [START] * (len(events) % 2)
    assert all(start.index == end.index for start, end in zip(events[::2], events[1::2], strict=False))
