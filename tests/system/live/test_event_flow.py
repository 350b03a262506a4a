"""The way of events: from performers who fall silent, on the wire, and from the service to every sink."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from fakes import Bench, FakeSource
from synthetic import stick_clip

from kinespace.stream import zeromq
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Event, EventKind
from kinespace.stream.recognizer import Performers, Recognizer

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from kinespace.library.motion_library import MotionLibrary

START, END = EventKind.START, EventKind.END


def _frames(class_name: str, performer: str = "p", *, seconds: float = 2.0, start: float = 100.0) -> list[Frame]:
    clip = stick_clip(class_name, seed=70, frames=round(seconds * 120))
    return [Frame(performer, start + index / 120, positions) for index, positions in enumerate(clip.positions)]


def _told(events: Sequence[Event]) -> list[tuple[str, EventKind, str]]:
    return [(event.performer, event.kind, event.label) for event in events]


# --- performers --------------------------------------------------------------------------------------------------


def test_an_end_by_a_pause_is_told_though_no_answer_follows(sticks: MotionLibrary) -> None:
    """A feed that ends right after a pause, before it can be answered again, still tells the end, once."""
    recognizer = Recognizer(sticks)
    first = _frames("bow", start=100.0)
    for frame in (*first, *_frames("bow", start=110.0)[:5]):
        recognizer.push(frame)
    ended = recognizer.end()
    assert ended is not None
    assert (ended.kind, ended.label, ended.time) == (END, "bow", first[-1].time)
    assert recognizer.end() is None


def test_a_performer_dropped_to_make_room_gets_an_end(sticks: MotionLibrary) -> None:
    """The end of a performer dropped for a new one's sake is given when silence is next asked about, once."""
    performers = Performers(sticks, most=1, silence=1.0)
    for frame in _frames("wave", "Ada"):
        performers.push(frame, 0.0)
    performers.push(_frames("bow", "Bo")[0], 1.5)
    assert performers.names == ("Bo",)
    assert _told(performers.drop_silent(1.6)) == [("Ada", END, "wave")]
    assert performers.drop_silent(1.7) == []


# --- on the wire -------------------------------------------------------------------------------------------------


def test_an_event_is_json_under_its_performers_topic() -> None:
    """A ZeroMQ event is a topic of its own and JSON that says all of it."""
    event = Event("Ada Lovelace/1", END, "wäve", 2, 0.125, 1_763_726_400.25)
    topic, body = zeromq.encode_event(event)
    assert topic.decode() == f"event/{event.performer}/"
    told = {"v": 1, "performer": event.performer, "event": "end", "class": "wäve", "index": 2, "score": 0.125}
    assert json.loads(body) == told | {"t": event.time}


# --- the service -------------------------------------------------------------------------------------------------


@pytest.fixture
def stage(sticks: MotionLibrary) -> Iterator[Bench]:
    """Open a service of two sinks with a clock of its own."""
    stage = Bench(Performers(sticks, silence=2.0), FakeSource(), sinks=2)
    yield stage
    stage.service.close()


def test_every_sink_hears_of_every_event(stage: Bench, sticks: MotionLibrary) -> None:
    """Each sink gets the events of a recogniser alone, each right after its recognition."""
    frames = [*_frames("bow"), *_frames("jump", start=102.0)]
    stage.perform(frames)
    recognizer = Recognizer(sticks)
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
