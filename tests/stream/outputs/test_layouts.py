"""Each layout read back with python-osc, replies to each performer's own sender, MIDI, and bodies."""

import dataclasses
import json
import socket
import sys
import tomllib
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mido
import numpy as np
import pytest
from fakes import params_of as read
from programs import LOOPBACK, ROOT
from pythonosc.osc_packet import OscPacket
from synthetic import STICK, stick_clip

from kinespace.stream import Done, Event, EventKind, Frame, Outcome, Progress, Recognition, osc
from kinespace.stream.inputs import Admission, OwnDecoder, Source
from kinespace.stream.osc import messages as osc_answers
from kinespace.stream.outputs import LAYOUTS, LayoutSink, NativeLayout, ReplySink, ZmqSink
from kinespace.stream.outputs.layouts import LayoutFileError, WrittenLayout
from kinespace.stream.outputs.midi_sink import AMPLITUDE, PHASE, SCORE, SPEED, MidiSink
from kinespace.stream.outputs.zeromq_sink import BodySink
from kinespace.stream.recognition import Classes, Gone
from kinespace.stream.recognizer.carried import Carried
from kinespace.stream.status import InputCounts, PerformerCounts, Status
from kinespace.stream.teaching import State, Step

CLASSES = ("bow", "jump", "wave")
START = Event("Ada L", EventKind.START, "jump", 1, 0.75, 4.0)
DONE = Done("Ada L", "jump", 1, 6.0, 1.5, 0.875, 1.25, 0.75, 3)
LEFT = Gone("Ada L")
STATUS = Status(InputCounts(), PerformerCounts(), 0, {"Ada L": 30.0}, 0.0, 0.0)


def recognition(
    outcome: Outcome = Outcome.NAMED, performer: str = "Ada L", best: int = 1, classes: int = 3
) -> Recognition:
    """Make a recognition whose best class has 0.75, the others 0.25."""
    scores = np.full(classes, 0.25, dtype=np.float32)
    scores[best] = 0.75
    names = CLASSES if classes == 3 else tuple(f"c{index:04d}" for index in range(classes))
    return Recognition(performer, 4.0, outcome, names, scores, movement=0.2)


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_answer_is_osc_that_fits(name: str) -> None:
    """Every message is valid OSC of at most 1200 bytes, for three classes and for a thousand."""
    layout = LAYOUTS[name]()
    told = [layout.recognition(recognition(classes=classes)) for classes in (3, 1000)]
    told += map(layout.encode, (START, DONE, Classes(CLASSES), STATUS, LEFT))
    assert told[0] is not None
    for packet in told:
        if packet is not None:
            assert read(packet)
            assert len(packet) <= osc_answers.MAX_ANSWER


#: What the service tells, and the words of its addresses by OSC and of its topics by ZeroMQ; who leaves has no class.
TOLD = (recognition(), START, DONE, LEFT, Classes(CLASSES), STATUS, State("Ada L", Step.WAITING))
AS_OSC = ("scores", "event", "done", "label", "classes", "status", "state")
AS_ZMQ = ("class", "event", "done", "class", "classes", "status", "teach")


def _last_word(packet: bytes) -> str:
    return [*read(packet)][-1].rpartition("/")[2]


def _first_word(parts: list[bytes]) -> str:
    return parts[0].decode().partition("/")[0]


@pytest.mark.parametrize(
    ("sink", "word", "expected"),
    [
        (partial(LayoutSink, NativeLayout()), _last_word, AS_OSC),
        # Of what a layout does not know nothing is sent.
        (partial(LayoutSink, LAYOUTS["vrchat"]()), _last_word, ("MotionScore", "MotionScore")),
        (ZmqSink, _first_word, AS_ZMQ),
        (partial(ZmqSink, named=False), _first_word, AS_ZMQ),
    ],
)
def test_everything_is_published(
    sink: Callable[..., LayoutSink | ZmqSink], word: Callable[[Any], str], expected: tuple[str, ...]
) -> None:
    """Answers, events, classes, notices and the status, each as what it is, with names unless told not to."""
    sent, over = list[Any](), list[bool]()
    made = sink(SimpleNamespace(send=sent.append, failed=2, close=lambda: over.append(True)))
    for message in TOLD:
        made.send(message)
    made.close()
    assert (tuple(map(word, sent)), over, made.failed) == (expected, [True], 2)
    assert word is _last_word or (b"Ada" in sent[5][1]) is (sink is ZmqSink)


def test_touchdesigner_gets_numbers_only() -> None:
    """No text anywhere; class, score, margin and a flag that is 1 in the one message that names another class."""
    layout = LAYOUTS["touchdesigner"]()
    first, again = read(layout.recognition(recognition())), read(layout.recognition(recognition()))
    assert first == {"/motion/Ada%20L/class": [1, 0.75, 0.5, 1], "/motion/Ada%20L/scores": [0.25, 0.75, 0.25]}
    assert again["/motion/Ada%20L/class"][-1] == 0
    unknown, left = read(layout.recognition(recognition(Outcome.UNKNOWN))), read(layout.gone(LEFT))
    assert unknown["/motion/Ada%20L/class"] == [-1, 0.75, 0.5, 1]
    assert left == {"/motion/Ada%20L/class": [-1, 0.0, 0.0, 0], "/motion/Ada%20L/going": [-1]}
    assert read(layout.event(START)) == {"/motion/Ada%20L/going": [1]}
    assert read(layout.event(dataclasses.replace(START, kind=EventKind.END))) == {"/motion/Ada%20L/going": [-1]}
    assert read(layout.done(DONE)) == {"/motion/Ada%20L/done": [1, 3, 1.5, 0.875, 1.25, 0.75]}
    assert layout.encode(Classes(CLASSES)) is None
    assert layout.encode(State("Ada L", Step.WAITING)) is None
    for told in (first, again, unknown, read(layout.status(STATUS))):
        assert all(type(value) in (int, float) for values in told.values() for value in values)


def test_event_times_are_floats_since_the_first_answer() -> None:
    """Events hold a float of seconds since the first answer: Pure Data and node-osc know no doubles."""
    layout = NativeLayout()
    layout.recognition(dataclasses.replace(recognition(), time=START.time - 2.5))
    packet = layout.event(START)
    assert read(packet) == {"/motion/Ada%20L/event": ["start", "jump", 1, 0.75, 2.5]}
    assert b",ssiff\0" in (packet or b"")
    layout.gone(LEFT)
    layout.recognition(dataclasses.replace(recognition(), time=START.time + 100.0))
    layout.recognition(dataclasses.replace(recognition(), time=START.time))
    assert read(layout.event(START))["/motion/Ada%20L/event"][-1] == 0.0


def test_at_most_256_performers_are_remembered() -> None:
    """Of more, which only a sender that makes up names has, the oldest is forgotten; of Wekinator's places all."""
    channels, outputs = LAYOUTS["touchdesigner"](), LAYOUTS["wekinator"]()

    def changed(performer: str) -> object:
        return read(channels.recognition(recognition(performer=performer)))[f"/motion/{performer}/class"][-1]

    assert [changed(f"{number}") for number in range(255)] == [1] * 255
    assert [changed(name) for name in ("5", "255", "256", "5", "0")] == [0, 1, 1, 0, 1]
    told = [read(outputs.recognition(recognition(performer=f"{number}"))) for number in range(257)]
    assert [len(each["/wek/outputs"]) for each in told] == [*range(1, 257), 1]


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_class_is_none_where_the_label_is_unknown(name: str) -> None:
    """In every layout an unknown motion, and a performer who left, have no class."""
    layout, none = LAYOUTS[name](), {"wekinator": [0.0], "vrchat": [0]}.get(name, [-1])
    told = [read(layout.recognition(recognition(outcome))) for outcome in (Outcome.UNKNOWN, Outcome.NAMED)]
    told.append(read(layout.gone(LEFT)))
    said, ends = [[*each.items()] for each in told], ("/class", "/Motion", "/outputs")
    classes = [next(params for address, params in each if address.endswith(ends)) for each in said]
    numbers = [[value for value in params if not isinstance(value, str)][:1] for params in classes]
    assert numbers[0] == numbers[2] == none
    assert numbers[1] != none


def test_wekinator_counts_from_one() -> None:
    """One float a performer, 0 for none, in order of arrival; a newcomer takes the place of one who left."""
    layout = LAYOUTS["wekinator"]()
    assert read(layout.recognition(recognition())) == {"/wek/outputs": [2.0]}
    assert read(layout.recognition(recognition(Outcome.STILL, "Bob"))) == {"/wek/outputs": [2.0, 0.0]}
    assert read(layout.event(START)) == {"/output_2": []}
    assert layout.encode(STATUS) is None
    assert read(layout.gone(LEFT)) == {"/wek/outputs": [0.0, 0.0]}
    assert layout.gone(LEFT) is None
    assert read(layout.recognition(recognition(performer="Bob"))) == {"/wek/outputs": [0.0, 2.0]}
    assert read(layout.recognition(recognition(best=2, performer="Cy"))) == {"/wek/outputs": [3.0, 2.0]}


#: Phase, phase for scrubbing, speed, amplitude, certainty and rounds.
FOLLOWED = Progress("jump", 0.25, 0.5, 1.5, 0.75, 0.125, 3)


@pytest.mark.parametrize("name", ["native", "max", "touchdesigner"])
def test_layouts_send_progress(name: str) -> None:
    """Index, phase, speed, amplitude, certainty, phase for scrubbing, rounds; nothing where no motion is followed."""
    layout = LAYOUTS[name]()
    told = read(layout.recognition(dataclasses.replace(recognition(), progress=FOLLOWED)))
    (numbers,) = (numbers for address, numbers in told.items() if address.endswith("/progress"))
    assert numbers == [1, 0.25, 1.5, 0.75, 0.125, 0.5, 3]
    assert not any(address.endswith("/progress") for address in read(layout.recognition(recognition())))


def test_wekinators_layout_sends_progress() -> None:
    """Phase, speed and amplitude come beside the classes, zeros for a performer in no motion."""
    layout = LAYOUTS["wekinator"]()
    followed = dataclasses.replace(recognition(), progress=FOLLOWED)
    assert read(layout.recognition(recognition(Outcome.STILL, "Bob"))) == {"/wek/outputs": [0.0]}
    told = {"/wek/outputs": [0.0, 2.0], "/wek/progress": [0.0, 0.0, 0.0, 0.25, 1.5, 0.75]}
    assert read(layout.recognition(followed)) == told
    told = {"/wek/outputs": [0.0, 0.0], "/wek/progress": [0.0] * 6}
    assert read(layout.gone(LEFT)) == told


def test_vrchat_gets_parameters() -> None:
    """A whole number from 0 to 255 and a float from 0 to 1."""
    layout = LAYOUTS["vrchat"]()
    told = read(layout.recognition(recognition()))
    assert told == {"/avatar/parameters/Motion": [2], "/avatar/parameters/MotionScore": [0.75]}
    assert read(layout.recognition(recognition(Outcome.STILL)))["/avatar/parameters/Motion"] == [0]
    assert read(layout.recognition(recognition(best=999, classes=1000)))["/avatar/parameters/Motion"] == [255]
    assert read(layout.gone(LEFT)) == {"/avatar/parameters/Motion": [0], "/avatar/parameters/MotionScore": [0.0]}


@pytest.mark.parametrize("back", [True, False], ids=["to its own port", "to a port of its host"])
def test_the_sender_is_replied_to(back: bool) -> None:  # noqa: FBT001 - a parametrised test's argument
    """Each performer's answers go to the performer's own sender, from the port it sent to; the status to all."""
    receiver, admission = osc.OscReceiver(LOOPBACK, 0), Admission()
    source = Source(receiver, OwnDecoder(), admission=admission)
    with ExitStack() as opened:
        senders = {}
        for host, name in (("127.0.0.1", "p"), ("127.0.0.2", "q")):
            senders[name] = opened.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            senders[name].bind((host, 0 if back or name != "q" else senders["p"].getsockname()[1]))
            senders[name].settimeout(60.0)
        sink = ReplySink(NativeLayout(), receiver, 0 if back else senders["p"].getsockname()[1], admission)
        assert str(sink) == ("native the sender" if back else f"native the sender:{sink.port}")
        sink.send(recognition())
        receiver.socket.settimeout(60.0)
        for name, sender in senders.items():
            sender.sendto(osc.encode_frame(Frame(name, 1.0, np.zeros((3, 3)))), receiver.address)
            assert source.take(1.0)
        for name, sender in senders.items():
            answer = dataclasses.replace(recognition(), performer=name)
            sink.send(answer)
            packet, came_from = sender.recvfrom(2000)
            assert packet == osc.messages.encode_recognition(answer)
            assert came_from[1] == receiver.address[1]
        sink.send(STATUS)
        assert {sender.recv(2000) for sender in senders.values()} == {osc_answers.encode_status(STATUS)}
        assert sink.failed == 0
        sink.close()
    receiver.close()


def _layout(folder: Path, text: str) -> WrittenLayout:
    (folder / "films.toml").write_text(text, encoding="utf-8")
    return WrittenLayout(folder / "films.toml")


def _read(packet: bytes | None) -> list[tuple[str, list[object]]]:
    return [(each.message.address, each.message.params) for each in OscPacket(packet).messages]


def test_each_moment_has_its_messages() -> None:
    """Numbers stay numbers, a text around a name is filled in, reserved characters of a name leave the address."""
    films = WrittenLayout(ROOT / "tests" / "support" / "films.toml")
    assert (films.name, films.port) == ("a mixer of films", 7000)
    begins = ("/Ada%20L/jump", ["begins jump", 1, 0.75])
    assert _read(films.event(START)) == [("/composition/columns/2/connect", [1]), begins]
    bow = dataclasses.replace(START, label="bow", index=0)
    assert _read(films.event(bow)) == [("/Ada%20L/bow", ["begins bow", 0, 0.75])]
    assert films.event(dataclasses.replace(START, kind=EventKind.END)) is None
    answer = dataclasses.replace(recognition(), progress=FOLLOWED)
    assert _read(films.recognition(answer)) == [("/fader", [0.75, 0.5, 0.25, "1.5 x", 0.5])]
    assert _read(films.done(DONE)) == [("/count", [3, 1.5])]
    assert _read(films.gone(LEFT)) == [("/blackout", [])]


def test_titles_are_sent_and_a_title_in_place_of_a_class_is_said(tmp_path: Path) -> None:
    """`{title}` is the name that people say; as a class it would never fire, and a note says which class is meant."""
    message = '[[message]]\nwhen = "start"\nclass = "{}"\naddress = "/a"\narguments = ["{{title}}"]\n'
    layout = _layout(tmp_path, message.format("squat1Reps") + message.format("kick") + message.format("bow"))
    assert _read(layout.event(Event("ann", EventKind.START, "squat1Reps", 1, 0.75, 4.0))) == [("/a", ["squat"])]
    sink = LayoutSink(layout, None)  # type: ignore[arg-type]  # nothing is sent
    sink.send(Classes(("kickLFront1Reps", "squat1Reps")))
    assert sink.notes == ["layout: no class is called 'kick', which is a title: kickLFront1Reps is meant"]
    layout.classes(Classes(("kick", "squat1Reps")))
    assert layout.notes == []


#: Layouts that are refused, each with a part of the line that says why.
MISTAKES = tomllib.loads(Path(__file__).with_name("mistakes.toml").read_text(encoding="utf-8"))["mistake"]


@pytest.mark.parametrize(("said", "written"), [each.values() for each in MISTAKES])
def test_a_mistake_is_said_before_anything_is_sent(tmp_path: Path, said: str, written: str) -> None:
    """The line names the file, the place, the expectation and what stands there."""
    with pytest.raises(LayoutFileError) as refused:
        _layout(tmp_path, written)
    assert said in str(refused.value)
    assert str(refused.value).startswith("films.toml: ")


# --- answers as MIDI, and bodies --------------------------------------------------------------------------------------


BEGUN = Event("ann", EventKind.START, "jump", 1, 0.75, 4.0)
ENDED = Event("ann", EventKind.END, "jump", 1, 0.75, 5.0)
BOWED = Done("bob", "bow", 0, 6.0, 1.5, 0.875, 1.25, 0.75, 3)


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
    sink.send(BEGUN)
    sink.send(ENDED)
    sink.send(BOWED)
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


def test_without_rtmidi_it_is_said_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The extra leaves it out where it has no wheel."""
    monkeypatch.setitem(sys.modules, "rtmidi", None)
    monkeypatch.setattr(mido, "get_output_names", mido.Backend("mido.backends.rtmidi").get_output_names)
    with pytest.raises(ImportError, match=r"--out midi: no port without rtmidi .*: pip install python-rtmidi; "):
        MidiSink()


def test_a_file_holds_the_notes_at_any_time(tmp_path: Path) -> None:
    """Mido reads them back, with the time between them: the file is whole after every note."""
    sink = MidiSink(f"{tmp_path / 'take.mid'}")
    sink.send(_answer("ann", 0.75))
    for number in range(40):
        sink.send((BEGUN, ENDED)[number % 2])
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
