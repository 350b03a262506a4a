"""Each layout read back with python-osc, several at once, and replies to each performer's own sender."""

import dataclasses
import socket
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from programs import ROOT
from pythonosc.osc_packet import OscPacket

from kinespace.stream import Done, Event, EventKind, Frame, Outcome, Progress, Recognition, osc
from kinespace.stream.inputs import Admission, OscDecoder, Source
from kinespace.stream.osc import messages as osc_answers
from kinespace.stream.outputs import LAYOUTS, LayoutSink, NativeLayout, ReplySink, ZmqSink
from kinespace.stream.outputs.layouts import LayoutFileError, WrittenLayout
from kinespace.stream.recognition import Classes, Gone
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.status import InputCounts, Status
from kinespace.stream.teaching import State, Step

LOOPBACK = "127.0.0.1"
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


def read(packet: bytes | None) -> dict[str, list[object]]:
    """Read a packet with python-osc: arguments by address."""
    return {timed.message.address: timed.message.params for timed in OscPacket(packet).messages}


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
    layout = LAYOUTS[name]()
    none = {"wekinator": [0.0], "vrchat": [0]}.get(name, [-1])
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
    source = Source(receiver, OscDecoder(), admission=admission)
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


FILMS = (ROOT / "tests" / "support" / "films.toml").read_text(encoding="utf-8")


@pytest.fixture
def films(tmp_path: Path) -> WrittenLayout:
    """Read the layout above."""
    return _layout(tmp_path, FILMS)


def _layout(folder: Path, text: str) -> WrittenLayout:
    (folder / "films.toml").write_text(text, encoding="utf-8")
    return WrittenLayout(folder / "films.toml")


def _read(packet: bytes | None) -> list[tuple[str, list[object]]]:
    return [(each.message.address, each.message.params) for each in OscPacket(packet).messages]


def test_each_moment_has_its_messages(films: WrittenLayout) -> None:
    """Numbers stay numbers, a text around a name is filled in, reserved characters of a name leave the address."""
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


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("", "message: expected a value, got nothing"),
        ('[[message]]\nwhen = "begin"\naddress = "/a"', "message 1, when: expected one of"),
        ('[[message]]\nwhen = "gone"\naddress = "/{class}"', "{class}: expected one of performer when gone"),
        ('[[message]]\nwhen = "start"\naddress = "/{class.__init__}"', "{class.__init__}: expected one of performer"),
        ('[[message]]\nwhen = "start"\naddress = "/a"\narguments = ["{score"]', "expected names in braces"),
        *(
            (f'[[message]]\nwhen = "start"\naddress = "/a"\narguments = ["{{{each}}}"]', "expected a format like :.2f")
            for each in ("score:>2000000000", "index:c", "score:.999999999f", "title:{performer.__class__}", "title!r")
        ),
        ('[[message]]\nwhen = "start"\naddress = "/a"\nargument = [1]', "perhaps 'arguments' is meant"),
    ],
)
def test_a_mistake_is_said_before_anything_is_sent(tmp_path: Path, written: str, said: str) -> None:
    """The line names the file, the place, the expectation and what stands there."""
    with pytest.raises(LayoutFileError) as refused:
        _layout(tmp_path, written)
    assert said in str(refused.value)
    assert str(refused.value).startswith("films.toml: ")
