"""Our OSC messages: python-osc reads ours, we read python-osc's; and the two sockets."""

from __future__ import annotations

import dataclasses
import select
import socket
import struct
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pythonosc.osc_bundle import OscBundle
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.osc_packet import OscPacket

from kinespace.library.motion_library import MotionLibrary
from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import osc
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.osc import frames
from kinespace.stream.osc.udp import RECEIVE_BUFFER
from kinespace.stream.recognition import Answer, Event, EventKind, Outcome, Progress, Recognition
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.service.status import InputCounts, Status

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import DTypeLike

LOOPBACK = "127.0.0.1"
NAMED = Recognition(
    performer="Ada",
    time=4.0,
    outcome=Outcome.NAMED,
    classes=("bow", "jump", "wave"),
    scores=np.array([0.25, 0.75, 0.5], dtype=np.float32),
    movement=0.2,
    share=0.8,
    gap=0.6,
)

_NAMES = st.text(st.characters(exclude_characters="\0", codec="utf-8"), min_size=1, max_size=12)
_FLOATS = st.floats(-1e6, 1e6, width=32)


def _message(address: str, *arguments: tuple[str, object]) -> bytes:
    """Build a message with python-osc."""
    builder = OscMessageBuilder(address)
    for kind, value in arguments:
        builder.add_arg(value, kind)
    return builder.build().dgram


def _bundle(*messages: bytes) -> bytes:
    """Build a bundle with python-osc."""
    builder = OscBundleBuilder(IMMEDIATELY)
    for message in messages:
        (timed,) = OscPacket(message).messages
        builder.add_content(timed.message)
    return builder.build().dgram


def _frame_message(performer: str, time: float, numbers: list[float]) -> bytes:
    return _message("/motion/frame", ("s", performer), ("d", time), *[("f", number) for number in numbers])


def _params(packet: bytes) -> dict[str, list[object]]:
    """Read a packet with python-osc: arguments by address."""
    return {timed.message.address: timed.message.params for timed in OscPacket(packet).messages}


def _assert_frame(received: osc.Received, performer: str, time: float, positions: np.ndarray) -> None:
    (frame,) = received.events
    assert isinstance(frame, Frame)
    assert (frame.performer, frame.time) == (performer, time)
    assert np.array_equal(frame.positions, positions)
    assert (received.malformed, received.foreign) == (0, 0)


# --- frames and announcements ------------------------------------------------------------------------------------


@given(performer=_NAMES, time=st.floats(allow_nan=False, allow_infinity=False), seed=st.integers(0, 2**32 - 1))
@example(performer="p", time=0.0, seed=0)
@example(performer="four", time=1e-300, seed=1)
def test_frames_equal_pythonoscs(performer: str, time: float, seed: int) -> None:
    """A frame of any performer and size is encoded byte for byte as python-osc would."""
    generator = np.random.default_rng(seed)
    positions = generator.normal(size=(int(generator.integers(1, 40)), 3))
    packet = osc.encode_frame(Frame(performer, time, positions))
    assert packet == _frame_message(performer, time, positions.ravel().tolist())


@given(
    performer=_NAMES,
    time=st.floats(allow_nan=False, allow_infinity=False).filter(bool),
    numbers=st.integers(0, 33).flatmap(lambda joints: st.lists(_FLOATS, min_size=3 * joints, max_size=3 * joints)),
)
def test_a_sent_frame_is_read_back(performer: str, time: float, numbers: list[float]) -> None:
    """A frame of any number of joints is read back, alone or in a bundle, which takes another path."""
    packet = _frame_message(performer, time, numbers)
    expected = np.array(numbers).reshape(-1, 3)
    _assert_frame(osc.decode(packet, 77.0), performer, time, expected)
    _assert_frame(osc.decode(_bundle(packet), 77.0), performer, time, expected)


@pytest.mark.parametrize("dtype", [np.float32, np.float64, ">f4"])
def test_positions_of_any_type_are_sent(dtype: DTypeLike) -> None:
    """Single or double precision, in any order of bytes or memory, a frame is sent as single precision."""
    positions = np.asfortranarray(np.random.default_rng(0).normal(size=(31, 3)).astype(dtype))
    received = osc.decode(osc.encode_frame(Frame("p", 1.0, positions)), 0.0)
    _assert_frame(received, "p", 1.0, positions.astype(np.float32))


@pytest.mark.parametrize("time", [0.0, -0.0])
@pytest.mark.parametrize("wrap", [bytes, _bundle])
def test_time_0_is_the_arrival(time: float, wrap: Callable[[bytes], bytes]) -> None:
    """A frame whose time is 0 gets its arrival as time, in any kind of packet."""
    _assert_frame(osc.decode(wrap(_frame_message("p", time, [1.0] * 9)), 42.5), "p", 42.5, np.ones((3, 3)))


@pytest.mark.parametrize(
    "arguments",
    [
        [("s", "p"), ("f", 2.0), *[("f", 1.0)] * 6],
        [("s", "p"), ("i", 2), *[("i", 1)] * 6],
        [("s", "p"), ("h", 2), *[("d", 1.0), ("h", 1)] * 3],
        [("s", "p"), ("d", 2.0), *[("f", 1.0)] * 3, *[("i", 1)] * 3],
    ],
)
def test_any_numbers_will_do(arguments: list[tuple[str, object]]) -> None:
    """Time and positions may be integers, singles or doubles, as patchers mix them."""
    _assert_frame(osc.decode(_message("/motion/frame", *arguments), 0.0), "p", 2.0, np.ones((2, 3)))


def test_performers_may_be_numbers() -> None:
    """A performer given as an integer, as patchers do, is its digits."""
    received = osc.decode(_message("/motion/frame", ("i", 7), ("d", 1.0), *[("f", 0.5)] * 6), 0.0)
    _assert_frame(received, "7", 1.0, np.full((2, 3), 0.5))
    received = osc.decode(_message("/motion/skeleton", ("i", 7), ("s", "hip"), ("s", "head")), 0.0)
    assert received.events == [Announcement("7", ("hip", "head"))]


@given(performer=_NAMES, joints=st.lists(_NAMES, min_size=1, max_size=40, unique=True))
@example(performer="p", joints=list(SKELETON.joints))
def test_an_announcement_comes_back(performer: str, joints: list[str]) -> None:
    """Joint names are sent as python-osc would send them, and are read back."""
    announcement = Announcement(performer, tuple(joints))
    packet = osc.encode_announcement(announcement)
    assert packet == _message("/motion/skeleton", *[("s", text) for text in (performer, *joints)])
    assert osc.decode(packet, 0.0) == osc.Received([announcement])


_MALFORMED = [
    _message("/motion/frame"),
    _message("/motion/frame", ("s", "p")),
    _message("/motion/frame", ("d", 1.0), ("s", "p"), *[("f", 0.5)] * 6),
    _message("/motion/frame", ("s", "p"), ("s", "now"), *[("f", 0.5)] * 6),
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("f", 0.5)] * 7),
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("f", 0.5)] * 5, ("s", "0.5")),
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("f", 0.5)] * 5, ("T", None)),
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("f", 0.5)] * 5, ("N", None)),
    _message("/motion/frame", ("s", "p"), ("d", 1.0), (["f"] * 6, [0.5] * 6)),
    _message("/motion/frame", ("s", ""), ("d", 1.0), *[("f", 0.5)] * 6),
    _message("/motion/frame", ("s", "p" * 65), ("d", 1.0), *[("f", 0.5)] * 6),
    _message("/motion/frame", ("T", None), ("d", 1.0), *[("f", 0.5)] * 6),
    _message("/motion/frame", ("f", 1.0), ("d", 1.0), *[("f", 0.5)] * 6),
    _message("/motion/frame", ("s", "p"), ("d", float("nan")), *[("f", 0.5)] * 6),
    _message("/motion/frame", ("s", "p"), ("d", float("-inf")), *[("f", 0.5)] * 6),
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("f", float("nan"))] * 6),
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("f", float("inf")), ("f", float("-inf"))] * 3),
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("f", 3e38)] * 6),
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("d", 1e300)] * 6),
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("h", 2**63 - 1)] * 6),
    _message("/motion/skeleton"),
    _message("/motion/skeleton", ("s", "p")),
    _message("/motion/skeleton", ("s", "p"), ("s", "hip"), ("i", 1)),
    _message("/motion/skeleton", ("s", "p"), ("s", "hip"), ("s", "hip")),
    _message("/motion/skeleton", ("s", "p"), ("s", "hip"), ("s", "")),
    _message("/motion/skeleton", ("s", ""), ("s", "hip")),
    _message("/motion/skeleton", ("f", 1.0), ("s", "hip")),
    b"/motion/skeleton\0\0\0\0," + b"[" * 15_000 + b"]" * 15_000 + b"\0\0\0",
    b"",
    b"\0",
    b"no osc at all",
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("f", 0.5)] * 6)[:-1],
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("f", 0.5)] * 6)[:-4],
    _message("/motion/frame", ("s", "p"), ("d", 1.0), *[("f", 0.5)] * 6).replace(b"p\0", b"\xff\0"),
]


@pytest.mark.parametrize("packet", _MALFORMED, ids=[str(number) for number in range(len(_MALFORMED))])
def test_senseless_messages_are_counted(packet: bytes) -> None:
    """A message of ours that makes no sense, and a packet that is no OSC, is one malformed, and no more happens."""
    assert osc.decode(packet, 1.0) == osc.Received([], malformed=1)


@pytest.mark.parametrize(
    "address", ["/", "/motion", "/motion/frames", "/motion/frame/p", "/Motion/frame", "/VMC/Ext/T"]
)
def test_messages_of_others_are_passed_over(address: str) -> None:
    """A message with another address is foreign, with any arguments."""
    packet = _message(address, ("s", "p"), ("d", 1.0), *[("f", 0.5)] * 6)
    assert osc.decode(packet, 1.0) == osc.Received([], foreign=1)


def test_in_a_bundle_the_good_is_not_lost_with_the_bad() -> None:
    """All valid messages of a bundle are used, in order; the others are counted by kind."""
    good = _frame_message("p", 1.0, [0.5] * 6)
    names = _message("/motion/skeleton", ("s", "p"), ("s", "hip"), ("s", "head"))
    received = osc.decode(_bundle(names, _MALFORMED[0], good, _message("/other"), _MALFORMED[17], good), 9.0)
    assert [type(event) for event in received.events] == [Announcement, Frame, Frame]
    assert (received.malformed, received.foreign) == (2, 1)


_VALID = _frame_message("performer", 3.5, [float(number) for number in range(12)])


def test_a_frame_cut_off_anywhere_is_malformed() -> None:
    """Cut off at any byte a frame is malformed; it never becomes a smaller frame."""
    for length in range(len(_VALID)):
        assert osc.decode(_VALID[:length], 1.0) == osc.Received([], malformed=1)
    assert osc.decode(_VALID + b"\0\0\0\0", 1.0).malformed == 0


def test_beginnings_of_one_length_are_not_mistaken_for_each_other() -> None:
    """A remembered beginning is not used for another beginning of the same length or size."""
    few, many = _frame_message("a" * 18, 1.0, [1.0] * 6), _frame_message("b" * 6, 2.0, [2.0] * 18)
    assert few.index(struct.pack(">d", 1.0)) == many.index(struct.pack(">d", 2.0))
    for _ in range(2):
        _assert_frame(osc.decode(few, 9.0), "a" * 18, 1.0, np.full((2, 3), 1.0))
        _assert_frame(osc.decode(many, 9.0), "b" * 6, 2.0, np.full((6, 3), 2.0))
    # The beginning of many numbers, and as many bytes in all as the packet of few.
    assert osc.decode(many[: len(few)], 9.0) == osc.Received([], malformed=1)
    assert osc.decode(few + bytes(len(many) - len(few)), 9.0).malformed == 0
    _assert_frame(osc.decode(few, 9.0), "a" * 18, 1.0, np.full((2, 3), 1.0))


def test_made_up_names_do_not_pile_up() -> None:
    """The decoder remembers a bounded number of beginnings, for any number of performers, and reads all frames."""
    for number in range(3000):
        _assert_frame(
            osc.decode(_frame_message(f"{number}", 1.0, [0.5] * 6), 9.0), f"{number}", 1.0, np.full((2, 3), 0.5)
        )
    assert len(frames._layouts.known) <= 1024  # noqa: SLF001 - invisible from outside
    assert len(frames._layouts.places) <= 1024  # noqa: SLF001 - as above


@given(data=st.data())
@settings(max_examples=150)
def test_a_frame_with_bytes_changed_is_read_alike_both_ways(data: st.DataObject) -> None:
    """With any bytes changed, the quick reader of frames agrees with the thorough one."""
    packet = bytearray(_VALID)
    for _ in range(data.draw(st.integers(1, 3))):
        packet[data.draw(st.integers(0, len(packet) - 1))] = data.draw(
            st.sampled_from([0, 1, 44, 102, 105, 112, 127, 255])
        )
    alone = osc.decode(bytes(packet), 1.0)
    element = b"#bundle\0" + bytes(7) + b"\1" + struct.pack(">i", len(packet)) + bytes(packet)
    bundled = osc.decode(element, 1.0)
    assert (alone.malformed, alone.foreign, len(alone.events)) == (
        bundled.malformed,
        bundled.foreign,
        len(bundled.events),
    )
    for one, other in zip(alone.events, bundled.events, strict=True):
        assert isinstance(one, Frame)
        assert isinstance(other, Frame)
        assert (one.performer, one.time) == (other.performer, other.time)
        assert np.array_equal(one.positions, other.positions, equal_nan=True)


@given(
    packet=st.binary(max_size=200),
    start=st.sampled_from([b"", b"/motion/frame\0\0\0,sd", b"/motion/skeleton\0\0\0\0,"]),
)
@settings(max_examples=150)
def test_random_bytes_raise_nothing(packet: bytes, start: bytes) -> None:
    """Any bytes give events or counts."""
    received = osc.decode(start + packet, 1.0)
    assert len(received.events) + received.malformed + received.foreign >= 1 or packet[:7] == b"#bundle"


# --- answers -----------------------------------------------------------------------------------------------------


def test_an_answer_is_one_bundle_to_be_used_at_once() -> None:
    """Class, guess, label and scores travel in one bundle whose time tag says immediately."""
    packet = osc.encode_recognition(NAMED)
    assert packet[:16] == b"#bundle\0\0\0\0\0\0\0\0\1"
    assert OscBundle(packet).num_contents == 4
    assert _params(packet) == {
        "/motion/Ada/class": [1, 0.75, 0.25],
        "/motion/Ada/guess": [1],
        "/motion/Ada/label": ["jump"],
        "/motion/Ada/scores": [0.25, 0.75, 0.5],
    }


@given(
    performer=_NAMES,
    label=_NAMES,
    count=st.integers(1, 230),
    seed=st.integers(0, 2**32 - 1),
    outcome=st.sampled_from(Outcome),
    wide=st.booleans(),
)
def test_an_answer_is_byte_for_byte_python_oscs(  # noqa: PLR0913 - what an answer holds
    performer: str, label: str, count: int, seed: int, outcome: Outcome, *, wide: bool
) -> None:
    """The packet equals python-osc's for any performer, classes and scores, with scores and without."""
    generator = np.random.default_rng(seed)
    scores = generator.random(count).astype(np.float64 if wide else np.float32)
    answer = dataclasses.replace(
        NAMED,
        performer=performer,
        outcome=outcome,
        classes=tuple(f"{label}{place}" for place in range(count)),
        scores=scores,
        guess=int(generator.integers(count)),
    )
    start = f"/motion/{osc.address_part(performer)}"
    numbers = (("i", answer.class_index), ("f", answer.score), ("f", answer.margin))
    messages = [
        _message(f"{start}/class", *numbers),
        _message(f"{start}/guess", ("i", answer.guess_index)),
        _message(f"{start}/label", ("s", answer.label)),
    ]
    expected = _bundle(*messages, _message(f"{start}/scores", *[("f", score) for score in scores.tolist()]))
    if len(expected) > osc.MAX_ANSWER:
        expected = _bundle(*messages)
    assert osc.encode_recognition(answer) == expected


def test_progress_travels_with_the_answer() -> None:
    """While a motion is followed, its progress is a message of the bundle, as python-osc builds it."""
    answer = dataclasses.replace(NAMED, progress=Progress("wave", 0.25, 0.5, 2.0, 0.75, 0.875, 3))
    index = answer.classes.index("wave")
    numbers = [index, 0.25, 2.0, 0.75, 0.875, 0.5, 3]
    assert _params(osc.encode_recognition(answer))["/motion/Ada/progress"] == numbers
    types = zip("ifffffi", numbers, strict=True)
    assert osc.encode_progress(answer) == _message("/motion/Ada/progress", *types)
    assert osc.encode_progress(NAMED) == b""


_EVENTS = st.builds(
    Event,
    performer=_NAMES,
    kind=st.sampled_from(EventKind),
    label=_NAMES,
    index=st.integers(0, 2**31 - 1),
    score=st.floats(0.0, 1.0),
    time=st.floats(-1e30, 1e30),
)


@given(event=_EVENTS, since=st.floats(-1e30, 1e30))
def test_an_event_is_byte_for_byte_python_oscs(event: Event, since: float) -> None:
    """The packet of any event equals python-osc's."""
    time = event.time - since
    arguments = (("s", str(event.kind)), ("s", event.label), ("i", event.index), ("f", event.score), ("f", time))
    expected = _message(f"/motion/{osc.address_part(event.performer)}/event", *arguments)
    assert osc.encode_event(event, since) == expected


@pytest.mark.parametrize("time", [1e300, -1e300])
def test_a_time_beyond_all_floats_is_the_largest(time: float) -> None:
    """A clock that makes no sense ends no answer."""
    (params,) = _params(osc.encode_event(Event("p", EventKind.END, "bow", 0, 0.5, time))).values()
    assert params[-1] == pytest.approx(np.copysign(3.4028235e38, time))


def test_a_performer_who_left_has_no_class() -> None:
    """Class and guess are -1, the label says why, and listeners read it as an answer."""
    packet = osc.encode_gone("Ada L")
    assert _params(packet) == {
        "/motion/Ada_L/class": [-1, 0.0, 0.0],
        "/motion/Ada_L/guess": [-1],
        "/motion/Ada_L/label": ["gone"],
    }
    assert osc.decode_answer(packet) == Answer("Ada_L", -1, 0.0, 0.0, "gone")


def test_unknown_is_no_class_but_a_guess() -> None:
    """The class is -1 where the label is unknown; the guess has a place of its own."""
    params = _params(osc.encode_recognition(dataclasses.replace(NAMED, outcome=Outcome.UNKNOWN)))
    assert params["/motion/Ada/class"] == [-1, 0.75, 0.25]
    assert (params["/motion/Ada/guess"], params["/motion/Ada/label"]) == ([1], ["unknown"])


@pytest.mark.parametrize("outcome", [Outcome.STILL, Outcome.AMBIGUOUS])
def test_no_class_is_index_minus_1(outcome: Outcome) -> None:
    """Without a class the index is -1 and the label says why; score, margin and scores are sent all the same."""
    params = _params(osc.encode_recognition(dataclasses.replace(NAMED, outcome=outcome)))
    assert params["/motion/Ada/class"] == [-1, 0.75, 0.25]
    assert params["/motion/Ada/label"] == [str(outcome)]
    assert params["/motion/Ada/scores"] == [0.25, 0.75, 0.5]


def test_channels_hold_numbers_alone() -> None:
    """Class, scores and status hold only integers and floats of 32 bits, as TouchDesigner's CHOP needs."""
    bundle = osc.encode_recognition(NAMED)
    status = osc.encode_status(Status(InputCounts(), PerformerCounts(), 0, {"p": 120.0}, 0.0, 0.0))
    assert b"/motion/Ada/class\0\0\0,iff\0\0\0\0" in bundle
    assert b"/motion/Ada/scores\0\0,fff\0\0\0\0" in bundle
    assert status.startswith(b"/motion/status\0\0,ifii\0\0\0")


@pytest.mark.parametrize("count", [1, 2, 11, 140, 220, 1000])
def test_an_answer_fits_one_packet(count: int) -> None:
    """No answer is larger than 1200 bytes: the scores go when there are too many, class and label never do."""
    classes = tuple(f"class{index}" for index in range(count))
    scores = np.linspace(0.0, 1.0, count, dtype=np.float32)
    answer = dataclasses.replace(NAMED, performer="p" * 64, classes=classes, scores=scores)
    packet = osc.encode_recognition(answer)
    assert len(packet) <= osc.MAX_ANSWER == 1200
    params = _params(packet)
    assert params[f"/motion/{'p' * 64}/class"][0] == count - 1
    assert params[f"/motion/{'p' * 64}/label"] == [classes[-1]]
    assert (f"/motion/{'p' * 64}/scores" in params) == (count <= 140)


def test_the_built_in_librarys_answers_carry_all_scores() -> None:
    """With the built-in library's classes an answer holds all scores, for the longest performer's name too."""
    classes = MotionLibrary.builtin().classes
    answer = dataclasses.replace(
        NAMED, performer="p" * 64, classes=classes, scores=np.linspace(0.0, 1.0, len(classes), dtype=np.float32)
    )
    assert len(_params(osc.encode_recognition(answer))[f"/motion/{'p' * 64}/scores"]) == len(classes)


@pytest.mark.parametrize(
    ("performer", "part"),
    [("Ada", "Ada"), ("7", "7"), ("a b", "a_b"), ("a/b", "a_b"), ("#*,?[]{}", "________"), ("Zoë", "Zo_"), ("\t", "_")],
)
def test_performers_stand_in_addresses(performer: str, part: str) -> None:
    """Characters that OSC reserves or that do not print become underscores in addresses."""
    assert osc.address_part(performer) == part
    addresses = _params(osc.encode_recognition(dataclasses.replace(NAMED, performer=performer)))
    assert set(addresses) == {f"/motion/{part}/{last}" for last in ("class", "guess", "label", "scores")}


def test_classes_are_sent_in_the_order_of_their_indices() -> None:
    """The names of all classes are one message, the first of index 0."""
    assert _params(osc.encode_classes(("bow", "jump"))) == {"/motion/classes": ["bow", "jump"]}


def test_the_status_is_sent() -> None:
    """The status holds a sign of life, frames per second, the number of performers, and losses."""
    counts = PerformerCounts(no_room=10, other_joints=20)
    counts.recognizers.out_of_order = 30
    inputs = InputCounts(received=9999, malformed=1, foreign=500, overrun=2, missing=3)
    status = Status(inputs, counts, 7, {"a": 119.5, "b": 30.0}, 0.1, 0.2)
    assert _params(osc.encode_status(status)) == {"/motion/status": [1, 149.5, 2, 66]}


def test_a_loss_beyond_all_integers_is_the_largest() -> None:
    """When a sender's numbers jump by more than OSC's integers hold, the status says the largest one."""
    status = Status(InputCounts(missing=10**15), PerformerCounts(), 0, {}, 0.0, 0.0)
    assert _params(osc.encode_status(status)) == {"/motion/status": [1, 0.0, 0, 2**31 - 1]}


def test_a_sent_answer_is_read_back() -> None:
    """A listener reads performer, class, score, margin and label; without a class it reads the reason."""
    assert osc.decode_answer(osc.encode_recognition(NAMED)) == Answer("Ada", 1, 0.75, 0.25, "jump")
    still = dataclasses.replace(NAMED, outcome=Outcome.STILL)
    assert osc.decode_answer(osc.encode_recognition(still)) == Answer("Ada", -1, 0.75, 0.25, "still")


@pytest.mark.parametrize(
    "packet",
    [
        b"",
        b"no osc",
        osc.encode_classes(("bow", "jump")),
        osc.encode_frame(Frame("p", 1.0, np.zeros((2, 3)))),
        _message("/motion/Ada/class", ("i", 1), ("f", 0.5), ("f", 0.5)),
        _bundle(_message("/motion/Ada/class", ("i", 1)), _message("/motion/Ada/label", ("s", "x"))),
        _bundle(_message("/class", ("i", 1), ("f", 0.5), ("f", 0.5)), _message("/label", ("s", "x"))),
        _bundle(
            _message("/motion/Ada/class", ("s", "x"), ("f", 0.5), ("f", 0.5)), _message("/motion/Ada/label", ("s", "x"))
        ),
        _bundle(
            _message("/motion/Ada/class", ("f", float("inf")), ("f", 0.5), ("f", 0.5)),
            _message("/motion/Ada/label", ("s", "x")),
        ),
        _bundle(
            _message("/motion/Ada/class", ("f", float("nan")), ("f", 0.5), ("f", 0.5)),
            _message("/motion/Ada/label", ("s", "x")),
        ),
        _bundle(_message("/motion/Ada/class", ("i", 1), ("f", 0.5), ("f", 0.5)), _message("/motion/Ada/label")),
    ],
)
def test_other_packets_are_no_answer(packet: bytes) -> None:
    """A listener takes no other packet for an answer, and no packet at all stops it."""
    assert osc.decode_answer(packet) is None


# --- the sockets -------------------------------------------------------------------------------------------------


@pytest.fixture
def receiver() -> Iterator[osc.OscReceiver]:
    """Open a receiver on a free port."""
    receiver = osc.OscReceiver(LOOPBACK, 0)
    yield receiver
    receiver.close()


@pytest.fixture
def sender(receiver: osc.OscReceiver) -> Iterator[osc.OscSender]:
    """Open a sender to the receiver."""
    sender = osc.OscSender(*receiver.address)
    yield sender
    sender.close()


def _receive(receiver: osc.OscReceiver) -> bytes | None:
    """Wait for a datagram that was sent."""
    readable, _, _ = select.select([receiver.socket], [], [], 10.0)
    assert readable
    return receiver.receive()


def test_datagrams_arrive_in_order(receiver: osc.OscReceiver, sender: osc.OscSender) -> None:
    """Datagrams are received one at a time and in order, also an empty one; then there is none."""
    packets = [b"first", b"", b"third", osc.encode_recognition(NAMED)]
    for packet in packets:
        sender.send(packet)
    assert [_receive(receiver) for _ in packets] == packets
    assert receiver.receive() is None
    assert sender.failed == 0


def test_receiving_never_waits(receiver: osc.OscReceiver) -> None:
    """When no datagram has come, receiving returns None at once."""
    assert not receiver.socket.getblocking()
    assert receiver.receive() is None


@pytest.mark.parametrize("size", [8193, 65507])
def test_the_largest_datagrams_are_whole(receiver: osc.OscReceiver, sender: osc.OscSender, size: int) -> None:
    """Datagrams far above 8 kB, up to the largest there are, arrive whole."""
    packet = np.random.default_rng(size).bytes(size)
    sender.send(packet)
    assert _receive(receiver) == packet


def test_the_system_is_asked_for_room(receiver: osc.OscReceiver) -> None:
    """The receive buffer is larger than the system's default, as far as the system allows."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plain:
        usual = plain.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        possible = plain.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
    assert receiver.socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) == possible >= usual


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells how many datagrams it threw away")
def test_packets_dropped_by_the_system_are_counted(receiver: osc.OscReceiver, sender: osc.OscSender) -> None:
    """When more comes than the buffer holds, the counter gives exactly the number of lost packets."""
    sent = 4 * RECEIVE_BUFFER // 60_000
    for _ in range(sent):
        sender.send(bytes(60_000))
    came = 0
    while receiver.receive() is not None:
        came += 1
    assert 0 < came < sent
    sender.send(b"one more")
    assert _receive(receiver) == b"one more"
    assert receiver.kernel_drops == sent - came


def test_the_error_names_a_busy_port(receiver: osc.OscReceiver) -> None:
    """A second receiver on a port raises, naming host and port, and leaves no socket behind."""
    host, port = receiver.address
    with pytest.raises(OSError, match=rf"{host}:{port}: "):
        osc.OscReceiver(host, port)


def test_another_machines_address_is_an_error() -> None:
    """A host that is not this machine's cannot be listened on, and the error names it."""
    with pytest.raises(OSError, match=r"192\.0\.2\.1:0"):
        osc.OscReceiver("192.0.2.1", 0)


def test_a_closed_port_is_free_again() -> None:
    """Once closed, the same port can be listened on."""
    first = osc.OscReceiver(LOOPBACK, 0)
    address = first.address
    first.close()
    second = osc.OscReceiver(*address)
    assert second.address == address
    second.close()


def test_datagrams_that_cannot_be_sent_are_counted(receiver: osc.OscReceiver, sender: osc.OscSender) -> None:
    """A datagram that the system does not take is counted, and the next one goes out."""
    sender.send(bytes(70_000))
    sender.send(b"small")
    assert sender.failed == 1
    assert _receive(receiver) == b"small"


def test_sending_without_a_listener_is_no_error() -> None:
    """Sending where nobody listens raises no error."""
    gone = osc.OscReceiver(LOOPBACK, 0)
    sender = osc.OscSender(*gone.address)
    gone.close()
    for _ in range(10):
        sender.send(b"hello")
    sender.close()
