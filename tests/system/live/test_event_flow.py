"""The way of events: from performers who fall silent, on the wire, and from the service to every sink."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from fakes import Bench, FakeSource
from synthetic import stick_clip

from kinespace.stream import zeromq
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.recognition import Event, EventKind
from kinespace.stream.recognizer import Performers, Recognizer
from kinespace.tools.terminal.live_table import PlainLines

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from kinespace.library.motion_library import MotionLibrary

START, END = EventKind.START, EventKind.END


@pytest.fixture(scope="module")
def library(sticks: MotionLibrary) -> MotionLibrary:
    """Give the library of these tests."""
    return sticks


def _frames(class_name: str, performer: str = "p", *, seconds: float = 2.0, start: float = 100.0) -> list[Frame]:
    clip = stick_clip(class_name, seed=70, frames=round(seconds * 120))
    return [Frame(performer, start + index / 120, positions) for index, positions in enumerate(clip.positions)]


def _told(events: Sequence[Event]) -> list[tuple[str, EventKind, str]]:
    return [(event.performer, event.kind, event.label) for event in events]


# --- performers --------------------------------------------------------------------------------------------------


def test_silence_ends_the_motion(library: MotionLibrary) -> None:
    """A dropped performer's motion ends at its last frame; performers without a motion have no end."""
    performers = Performers(library, silence=2.0)
    last = [_frames("bow", "Ada")[-1], _frames("jump", "Bo")[-1]]
    still = [Frame("Cy", frame.time, last[0].positions) for frame in _frames("wave")]
    for frame in [*_frames("bow", "Ada"), *_frames("jump", "Bo"), *still]:
        performers.push(frame, 0.0)
    performers.push(_frames("wave", "Di")[0], 1.5)
    assert performers.drop_silent(2.0) == []
    ended = performers.drop_silent(2.1)
    assert _told(ended) == [("Ada", END, "bow"), ("Bo", END, "jump")]
    assert [event.time for event in ended] == [frame.time for frame in last]
    assert performers.names == ("Di",)
    assert performers.drop_silent(2.1) == []


def test_a_pause_in_the_feed_ends_the_motion(library: MotionLibrary) -> None:
    """A second without frames ends a motion at the last frame before it, once; half a second does not."""
    first, short, long = (_frames("bow", start=start) for start in (100.0, 102.5, 105.5))
    for clocked in (True, False):
        performers = Performers(library)
        events = []
        for frame in (*first, *short, *long):
            if clocked and frame is long[0]:
                events += performers.end_paused(frame.time)
            recognition = performers.push(frame, frame.time)
            events += recognition.events if recognition else ()
        assert [event.kind for event in events] == [START, END, START]
        assert events[1].time == short[-1].time


def test_an_end_by_a_pause_is_told_though_no_answer_follows(library: MotionLibrary) -> None:
    """A feed that ends right after a pause, before it can be answered again, still tells the end, once."""
    recognizer = Recognizer(library)
    first = _frames("bow", start=100.0)
    for frame in (*first, *_frames("bow", start=110.0)[:5]):
        recognizer.push(frame)
    ended = recognizer.end()
    assert ended is not None
    assert (ended.kind, ended.label, ended.time) == (END, "bow", first[-1].time)
    assert recognizer.end() is None


def test_a_performer_dropped_to_make_room_gets_an_end(library: MotionLibrary) -> None:
    """The end of a performer dropped for a new one's sake is given when silence is next asked about, once."""
    performers = Performers(library, most=1, silence=1.0)
    for frame in _frames("wave", "Ada"):
        performers.push(frame, 0.0)
    performers.push(_frames("bow", "Bo")[0], 1.5)
    assert performers.names == ("Bo",)
    assert _told(performers.drop_silent(1.6)) == [("Ada", END, "wave")]
    assert performers.drop_silent(1.7) == []


def test_changed_joints_end_the_motion_at_the_last_frame(library: MotionLibrary) -> None:
    """Announcing other joints forgets the window; the motion still ends at the last frame that was understood."""
    performers = Performers(library, silence=1.0)
    frames = _frames("bow")
    for frame in frames:
        performers.push(frame, 0.0)
    performers.announce(Announcement("p", ("nose", "tail")), 0.1)
    (ended,) = performers.drop_silent(5.0)
    assert (ended.kind, ended.label, ended.time) == (END, "bow", frames[-1].time)


# --- on the wire -------------------------------------------------------------------------------------------------

EVENTS = [
    Event("p", START, "bow", 0, 0.75, 12.5),
    Event("Ada Lovelace/1", END, "wäve", 2, 0.125, 1_763_726_400.25),
]


@pytest.mark.parametrize("event", EVENTS)
def test_an_event_is_json_under_its_performers_topic(event: Event) -> None:
    """A ZeroMQ event is a topic of its own and strict JSON that says all of it."""
    topic, body = zeromq.encode_event(event)
    assert topic.decode() == f"event/{event.performer}/"

    def refuse(constant: str) -> float:
        raise AssertionError(constant)

    described = json.loads(body, parse_constant=refuse)
    assert described == {
        "v": 1,
        "performer": event.performer,
        "event": str(event.kind),
        "class": event.label,
        "index": event.index,
        "score": event.score,
        "t": event.time,
    }


# --- the service -------------------------------------------------------------------------------------------------


@pytest.fixture
def stage(library: MotionLibrary) -> Iterator[Bench]:
    """Open a service of two sinks with a clock of its own."""
    stage = Bench(Performers(library, silence=2.0), FakeSource(), sinks=2)
    yield stage
    stage.service.close()


def test_every_sink_hears_of_every_event(stage: Bench, library: MotionLibrary) -> None:
    """Each sink gets the events of a recogniser alone, each right after its recognition."""
    frames = [*_frames("bow"), *_frames("jump", start=102.0)]
    stage.perform(frames)
    recognizer = Recognizer(library)
    expected = [event for frame in frames if (answer := recognizer.push(frame)) for event in answer.events]
    assert _told(expected) == [("p", START, "bow"), ("p", END, "bow"), ("p", START, "jump")]
    for sink in stage.sinks:
        assert sink.events == expected
        for answer in sink.recognitions:
            place = next(index for index, each in enumerate(sink.told) if each is answer)
            assert tuple(sink.told[place + 1 : place + 1 + len(answer.events)]) == answer.events


def test_a_dropped_performers_motion_ends_for_every_sink(stage: Bench) -> None:
    """Once a performer is silent for long enough each sink hears the end, once, before the status without him."""
    frames = _frames("wave", "Ada")
    stage.perform(frames)
    stage.step(1.9)
    for sink in stage.sinks:
        assert _told(sink.events) == [("Ada", START, "wave")]
    for _ in range(3):
        stage.step(1.1)
    for sink in stage.sinks:
        assert _told(sink.events) == [("Ada", START, "wave"), ("Ada", END, "wave")]
        assert sink.events[-1].time == frames[-1].time
        place = sink.told.index(sink.events[-1])
        assert not sink.told[place + 1].performers
        assert sink.told[place - 1].performers


# --- the view of a person --------------------------------------------------------------------------------------


def test_plain_lines_tell_events_without_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    """A line tells time, performer, kind and class; a name that would move the cursor does not."""
    PlainLines().publish_event(Event("A\x1b[2Jda", START, "bow", 0, 0.9, 12.5))
    line = capsys.readouterr().out
    assert "0.000 s" in line
    assert "start: bow" in line
    assert "\x1b[2J" not in line
