"""Answers as MIDI: what a port is sent, and a file that mido reads."""

from pathlib import Path
from typing import Any

import mido
import numpy as np
import pytest

from kinespace.stream import Done, Event, EventKind, Outcome, Progress, Recognition
from kinespace.stream.outputs.midi_sink import AMPLITUDE, PHASE, SCORE, SPEED, MidiSink

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
        sink.publish(_answer(performer, score))
    controls = [(SCORE, 95), (PHASE, 64), (SPEED, 80), (AMPLITUDE, 127)]
    first = [f"control_change channel=0 control={control} value={value} time=0" for control, value in controls]
    controls[0] = SCORE, 127
    second = [f"control_change channel=1 control={control} value={value} time=0" for control, value in controls]
    assert port.sent == [*first, *second]
    port.sent.clear()
    sink.publish_event(START)
    sink.publish_event(END)
    sink.publish_done(DONE)
    assert port.sent == [
        "note_on channel=0 note=61 velocity=95 time=0",
        "note_off channel=0 note=61 velocity=95 time=0",
        "note_on channel=1 note=36 velocity=111 time=0",
        "note_off channel=1 note=36 velocity=111 time=0",
    ]
    sink.publish_gone("ann")
    port.unplugged = True
    sink.publish_event(Event("cy", EventKind.START, "bow", 0, 0.5, 9.0))
    assert sink.failed == 1
    port.unplugged = False
    sink.publish_event(Event("cy", EventKind.START, "bow", 0, 0.5, 9.0))
    assert port.sent[-1].startswith("note_on channel=0 note=60")
    sink.close()
    assert port.sent[-2:] == ["reset", "closed"]


def test_a_port_that_is_not_there_is_said_with_those_that_are(port: _Port) -> None:
    """The message names the ports."""
    with pytest.raises(OSError, match="no port 'Piano'; there are: Synth 1, Loop 2"):
        MidiSink("Piano")
    assert not port.sent


def test_a_file_holds_the_notes(tmp_path: Path) -> None:
    """Mido reads them back, with the time between them."""
    sink = MidiSink(f"{tmp_path / 'take.mid'}")
    sink.publish(_answer("ann", 0.75))
    for event in (START, END):
        sink.publish_event(event)
    sink.close()
    notes = [each for each in mido.MidiFile(tmp_path / "take.mid") if not each.is_meta]
    assert [(each.type, each.note, each.velocity) for each in notes] == [("note_on", 61, 95), ("note_off", 61, 95)]
    assert all(0 <= each.time < 5 for each in notes)


def test_a_program_that_is_killed_leaves_the_notes_until_then(tmp_path: Path) -> None:
    """The file is whole after every note."""
    path = tmp_path / "take.mid"
    sink = MidiSink(f"{path}")
    for number in range(1, 40):
        sink.publish_event(START)
        path.with_name("killed.mid").write_bytes(path.read_bytes())
        assert len([each for each in mido.MidiFile(tmp_path / "killed.mid") if not each.is_meta]) == number
    sink.close()
