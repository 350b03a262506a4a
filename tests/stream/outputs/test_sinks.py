"""Answers as MIDI: what a port is sent, and a file that mido reads."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mido
import numpy as np
import pytest
from synthetic import STICK, stick_clip

from kinespace.stream import Done, Event, EventKind, Frame, Outcome, Progress, Recognition
from kinespace.stream.outputs.midi_sink import AMPLITUDE, PHASE, SCORE, SPEED, MidiSink
from kinespace.stream.outputs.zeromq_sink import BodySink
from kinespace.stream.recognition import Gone
from kinespace.stream.recognizer.carried import Carried

START = Event("ann", EventKind.START, "jump", 1, 0.75, 4.0)
END = Event("ann", EventKind.END, "jump", 1, 0.75, 5.0)
DONE = Done("bob", "bow", 0, 6.0, 1.5, 0.875, 1.25, 0.75, 3)


class _Port:
    """A port that keeps what it is sent, or is unplugged."""

    def __init__(self) -> None:
        self.sent: list[str] = []
        self.unplugged = False

    def send(self, message: Any) -> None:  # noqa: ANN401 - mido's class
        """Keep a message."""
        if self.unplugged:
            raise KeyError("unplugged")
        self.sent.append(str(message))

    def reset(self) -> None:
        """End all notes."""
        self.sent.append("reset")

    def close(self) -> None:
        """Say so."""
        self.sent.append("closed")


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> _Port:
    """Stand in for the machine's ports."""
    made = _Port()
    monkeypatch.setattr(mido, "get_output_names", lambda: ["Synth 1", "Loop 2"])
    monkeypatch.setattr(mido, "open_output", {"Synth 1": None, "Loop 2": made}.__getitem__)
    return made


def _answer(performer: str, score: float) -> Recognition:
    scores = np.array([1 - score, score], dtype=np.float32)
    progress = Progress("jump", 0.5, 0.5, 1.25, 3.0, sure=1.0, cycles=0)
    return Recognition(performer, 4.0, Outcome.NAMED, ("bow", "jump"), scores, movement=0.2, progress=progress)


def test_a_port_is_sent_notes_and_controllers(port: _Port) -> None:
    """Each performer has a channel, each class a note; a controller is sent when it changes."""
    sink = MidiSink("Loop")
    assert str(sink) == "MIDI Loop 2"
    for performer, score in (("ann", 0.75), ("ann", 0.75), ("bob", 1.0)):
        sink.send(_answer(performer, score))
    controls = [(SCORE, 95), (PHASE, 64), (SPEED, 80), (AMPLITUDE, 127)]
    first = [f"control_change channel=0 control={control} value={value} time=0" for control, value in controls]
    controls[0] = SCORE, 127
    second = [f"control_change channel=1 control={control} value={value} time=0" for control, value in controls]
    assert port.sent == [*first, *second]
    port.sent.clear()
    sink.send(START)
    sink.send(END)
    sink.send(DONE)
    assert port.sent == [
        "note_on channel=0 note=61 velocity=95 time=0",
        "note_off channel=0 note=61 velocity=95 time=0",
        "note_on channel=1 note=36 velocity=111 time=0",
        "note_off channel=1 note=36 velocity=111 time=0",
    ]
    sink.send(Gone("ann"))
    port.unplugged = True
    sink.send(Event("cy", EventKind.START, "bow", 0, 0.5, 9.0))
    assert sink.failed == 1
    port.unplugged = False
    sink.send(Event("cy", EventKind.START, "bow", 0, 0.5, 9.0))
    assert port.sent[-1].startswith("note_on channel=0 note=60")
    sink.close()
    assert port.sent[-2:] == ["reset", "closed"]


def test_a_port_that_is_not_there_is_said_with_those_that_are(port: _Port) -> None:
    """The message names the ports."""
    with pytest.raises(OSError, match="no port 'Piano'; there are: Synth 1, Loop 2"):
        MidiSink("Piano")
    assert not port.sent


def test_a_file_holds_the_notes_at_any_time(tmp_path: Path) -> None:
    """Mido reads them back, with the time between them: the file is whole after every note."""
    sink = MidiSink(f"{tmp_path / 'take.mid'}")
    sink.send(_answer("ann", 0.75))
    for number in range(40):
        sink.send((START, END)[number % 2])
        notes = [each for each in mido.MidiFile(tmp_path / "take.mid") if not each.is_meta]
        read = [(each.type, each.note, each.velocity) for each in notes]
        assert read == [(("note_on", "note_off")[place % 2], 61, 95) for place in range(number + 1)]
        assert all(0 <= each.time < 5 for each in notes)
    sink.close()


POSE = stick_clip("bow").positions[0]
CARRIED = Carried((1.0, *[0.0] * (len(POSE) - 1)), ((0, 1), (0, 2)))


def _bodies() -> tuple[BodySink, list[list[bytes]]]:
    """Make a sink for performers of whom everything is known, and the list of what it sends."""
    sent = list[list[bytes]]()
    return BodySink(SimpleNamespace(send=sent.append), lambda _: STICK, lambda _: CARRIED), sent  # type: ignore[arg-type]


@pytest.mark.parametrize("rate", [20.0, 30.0, 50.0, 60.0, 119.88, 240.0])
def test_at_most_thirty_bodies_are_sent_a_second(rate: float) -> None:
    """Of any feed at most thirty frames a second, more than twenty; the second and every thirtieth with the joints."""
    sink, sent = _bodies()
    for index in range(round(3 * rate)):
        sink.send(Frame("ann", 1.0 + index / rate, POSE))
    assert 3 * 20 <= len(sent) <= 3 * 30 + 1
    headers = [json.loads(parts[1]) for parts in sent]
    assert ["names" in header for header in headers] == [number % 30 == 1 for number in range(len(headers))]
    assert ["carried" in header for header in headers] == [number % 5 == 0 for number in range(len(headers))]


def test_a_sender_that_begins_anew_is_shown_at_once() -> None:
    """When the times go back, and when a performer has left or was forgotten among many, the next frame is sent."""
    sink, sent = _bodies()
    for moment, count in ((100.0, 1), (1.0, 2), (1.001, 2), (1.05, 3)):
        sink.send(Frame("ann", moment, POSE))
        assert len(sent) == count
    sink.send(Gone("ann"))
    sink.send(Frame("ann", 1.051, POSE))
    assert len(sent) == 4
    for number in range(255):
        sink.send(Frame(f"{number}", 1.0, POSE))
    for name in ("ann", "one more", "ann"):
        sink.send(Frame(name, 1.052, POSE))
    assert len(sent) == 4 + 255 + 2
