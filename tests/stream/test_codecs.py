"""The values passed on, and every codec: what was encoded comes back, any other bytes are its one error, counted."""

import dataclasses
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import fields
from itertools import permutations
from urllib.parse import unquote

import numpy as np
import pytest
import wrong
from fakes import NAMED
from fuzzfeeds import PACKETS, READERS, read_broken
from golden import bundle, message
from hypothesis import example, given
from hypothesis import strategies as st
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.osc_packet import OscPacket

from kinespace.library import Skeleton
from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import Announcement, Done, Event, EventKind, Frame, Outcome, Progress, Recognition, osc, zeromq
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.frame import MAX_PERFORMER_LENGTH
from kinespace.stream.inputs import OwnDecoder
from kinespace.stream.inputs.decoder import FeedDecoder
from kinespace.stream.osc import decode_packet
from kinespace.stream.osc import messages as osc_answers
from kinespace.stream.osc.packet import MAX_BUNDLE_DEPTH, MAX_MESSAGES, MAX_VALUES, Message, PacketError
from kinespace.stream.recognition import Gone
from kinespace.stream.recognizer.carried import Carried
from kinespace.stream.status import AdmissionCounts, InputCounts, PerformerCounts, RecognizerCounts, Status
from kinespace.stream.zeromq.messages import decode_body, encode_body

_TEXT = st.text(st.characters(exclude_characters="\0", codec="utf-8"), min_size=1, max_size=12)
_NAMES = st.lists(_TEXT, min_size=1, max_size=40, unique=True)
_TIMES = st.floats(allow_nan=False, allow_infinity=False).filter(bool)


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """Draw a frame of any performer, time and number of joints, in single precision."""
    positions = draw(st.lists(st.tuples(*[st.floats(-1e6, 1e6, width=32)] * 3), min_size=1, max_size=33))
    return Frame(draw(_TEXT), draw(_TIMES), np.array(positions, np.float32))


@st.composite
def recognitions(draw: st.DrawFn) -> Recognition:
    """Draw a recognition of any outcome, classes and scores."""
    odd = st.sampled_from(["50 %", "%s", '"', "{}", "\\", "\n"])
    classes = draw(st.lists(_TEXT | odd, min_size=1, max_size=200, unique=True))
    scores = draw(st.lists(st.floats(0, 1, width=32), min_size=len(classes), max_size=len(classes)))
    followed = st.builds(
        Progress, st.sampled_from(classes), *[st.floats(0, 8, width=32)] * 5, st.integers(0, 2**31 - 1)
    )
    return Recognition(
        performer=draw(_TEXT),
        time=draw(st.floats(0, 1e9)),
        outcome=draw(st.sampled_from(Outcome)),
        classes=tuple(classes),
        scores=np.array(scores, draw(st.sampled_from([np.float32, np.float64]))),
        movement=draw(st.floats(0, 1e3)),
        eigenvector_class=draw(st.none() | st.sampled_from(classes)),
        eigenvector_score=draw(st.floats(0, 1)),
        share=draw(st.floats(0, 1)),
        gap=draw(st.floats(0, 1)),
        guess=draw(st.none() | st.integers(0, len(classes) - 1)),
        so_far=draw(st.integers(-1, len(classes) - 1)),
        progress=draw(st.none() | followed),
    )


def by_python_osc(address: str, *arguments: tuple[str, object]) -> bytes:
    """Build a message with python-osc."""
    builder = OscMessageBuilder(address)
    for kind, value in arguments:
        builder.add_arg(value, kind)
    return builder.build().dgram


# --- what is encoded is decoded ----------------------------------------------------------------------------------


def _through_osc(frame: Frame, _: int, joints: Sequence[str] | None) -> list[object]:
    """Alone, each byte for byte as python-osc would send it."""
    performer = ("s", frame.performer)
    numbers = [("f", number) for number in frame.positions.ravel().tolist()]
    packets = [osc.encode_frame(frame)]
    assert packets == [by_python_osc("/motion/frame", performer, ("d", frame.time), *numbers)]
    if joints:
        packets.insert(0, osc.encode_announcement(Announcement(frame.performer, tuple(joints))))
        assert packets[0] == by_python_osc("/motion/skeleton", performer, *[("s", joint) for joint in joints])
    return [event for packet in packets for event in OwnDecoder().decode(packet, 77.0, None)]


def _through_bundles(frame: Frame, _: int, joints: Sequence[str] | None) -> list[object]:
    packets = [osc.encode_announcement(Announcement(frame.performer, tuple(joints)))] if joints else []
    return [*OwnDecoder().decode(bundle(*packets, osc.encode_frame(frame)), 77.0, None)]


def _through_three_parts(frame: Frame, seq: int, joints: Sequence[str] | None) -> list[object]:
    parts = zeromq.encode_frame(frame, seq, joints)
    assert zeromq.decode(parts, 0.0).seq == seq
    return [*OwnDecoder().decode(parts, 77.0, None)]


def _through_one_part(frame: Frame, seq: int, joints: Sequence[str] | None) -> list[object]:
    packed = wrong.in_one_part(frame, seq, joints)
    assert zeromq.decode([packed], 0.0).seq == seq
    return [*OwnDecoder().decode([packed], 77.0, None)]


@pytest.mark.slow
@pytest.mark.parametrize("through", [_through_osc, _through_bundles, _through_three_parts, _through_one_part])
@given(frame=frames(), seq=st.integers(0, 2**63 - 1), joints=st.none() | _NAMES)
@example(frame=Frame("four", 1e-300, np.ones((31, 3), np.float32)), seq=0, joints=list(SKELETON.joints))
def test_a_sent_frame_is_read_back(
    through: Callable[[Frame, int, Sequence[str] | None], list[object]],
    frame: Frame,
    seq: int,
    joints: list[str] | None,
) -> None:
    """Performer, time, number, joint names and positions come back."""
    *announced, read = through(frame, seq, joints)
    assert announced == ([Announcement(frame.performer, tuple(joints))] if joints else [])
    assert (read.performer, read.time) == (frame.performer, frame.time)
    assert np.array_equal(read.positions, frame.positions)


@given(recognition=recognitions())
def test_a_sent_answer_is_read_back(recognition: Recognition) -> None:
    """A listener of either transport reads performer, class, score, margin and label; any OSC library reads all."""
    heard = zeromq.decode_answer(zeromq.encode_recognition(recognition))
    assert (heard.performer, heard.label, heard.score) == (recognition.performer, recognition.label, recognition.score)
    assert (heard.index, heard.margin) == (recognition.class_index, recognition.margin)
    assert (heard.class_name, heard.outcome) == (recognition.class_name, recognition.outcome)
    packet = osc.messages.encode_recognition(recognition)
    part, read = osc.address_part(recognition.performer), osc.decode_answer(packet)
    assert (read.performer, read.index, read.label) == (part, recognition.class_index, recognition.label)
    assert (read.class_name, read.outcome) == (recognition.class_name, recognition.outcome)
    assert (read.score, read.margin) == pytest.approx((recognition.score, recognition.margin), abs=1e-6)
    assert packet[:16] == b"#bundle\0\0\0\0\0\0\0\0\1"
    assert len(packet) <= osc_answers.MAX_ANSWER
    said = {timed.message.address: timed.message.params for timed in OscPacket(packet).messages}
    assert said[f"/motion/{part}/guess"] == [recognition.guess_index]
    assert said[f"/motion/{part}/sofar"] == [recognition.so_far]
    scores = said.get(f"/motion/{part}/scores")
    assert scores == np.float32(recognition.scores).tolist() if scores else len(recognition.scores) > 100
    followed = recognition.progress
    numbers = followed and (followed.phase, followed.speed, followed.amplitude, followed.sure, followed.scrub)
    progress = followed and [recognition.classes.index(followed.class_name), *(numbers or ()), followed.cycles]
    assert said.get(f"/motion/{part}/progress") == progress
    assert osc_answers.encode_progress(recognition) == (
        by_python_osc(f"/motion/{part}/progress", *zip("ifffffi", progress, strict=True)) if progress else b""
    )


#: Fields whose names and values are those of the JSON.
_AS_THEY_ARE = ("movement", "share", "gap", "eigenvector_class", "eigenvector_score")
_OF_PROGRESS = ("phase", "scrub", "speed", "amplitude", "sure", "cycles")


@pytest.mark.slow
@given(recognition=recognitions())
def test_an_answer_equals_json_dumps(recognition: Recognition) -> None:
    """With any names and numbers, an answer is what json would write, field by field and in this order."""
    best = float(recognition.scores[recognition.best])
    by_class = zip(recognition.classes, recognition.scores, strict=True)
    others = [place for place in np.argsort(-recognition.scores, kind="stable") if place != recognition.best]
    followed = recognition.progress
    expected = {
        "v": 1,
        "performer": recognition.performer,
        "t": recognition.time,
        "class": recognition.class_name,
        "guess": recognition.classes[recognition.best] if recognition.guess_index >= 0 else None,
        "index": recognition.class_index,
        "guess_index": recognition.guess_index,
        "so_far": recognition.classes[recognition.so_far] if recognition.so_far >= 0 else None,
        "outcome": recognition.outcome,
        "score": best,
        "runner_up": recognition.classes[others[0]] if others else None,
        "margin": best - (float(recognition.scores[others[0]]) if others else 0.0),
        "scores": {name: round(float(score), 6) for name, score in by_class},
        **{name: getattr(recognition, name) for name in _AS_THEY_ARE},
        "doubted": [],
        "progress": followed
        and {"class": followed.class_name, **{name: getattr(followed, name) for name in _OF_PROGRESS}},
    }
    topic, encoded = zeromq.encode_recognition(recognition)
    assert [*map(unquote, topic.decode().split("/"))] == ["class", recognition.performer, ""]
    unsaid = {"time", "classes", "events", "lead", "evidence", "done", "seen", "by_course", "ended_at"}
    assert {each.name for each in fields(Recognition)} - unsaid <= set(expected)
    assert list(json.loads(encoded).items()) == list(json.loads(json.dumps(expected)).items())


_COUNTS, _MOMENTS = st.integers(0, 2**31 - 1), st.floats(-1e30, 1e30)


@given(
    event=st.builds(Event, _TEXT, st.sampled_from(EventKind), _TEXT, _COUNTS, st.floats(0, 1), _MOMENTS),
    done=st.builds(Done, _TEXT, _TEXT, _COUNTS, _MOMENTS, *[st.floats(0, 100)] * 4, _COUNTS),
    since=_MOMENTS,
)
def test_what_happened_is_byte_for_byte_python_oscs(event: Event, done: Done, since: float) -> None:
    """The packets of any event, and of any motion that was done, equal python-osc's."""
    arguments = [("s", str(event.kind)), ("s", event.label), ("i", event.index), ("f", event.score)]
    address = f"/motion/{osc.address_part(event.performer)}/event"
    assert osc_answers.encode_event(event, since) == by_python_osc(address, *arguments, ("f", event.time - since))
    numbers = done.start - since, done.duration, done.score, done.speed, done.amplitude
    arguments = [("s", done.label), ("i", done.index), ("i", done.count), *(("f", each) for each in numbers)]
    address = f"/motion/{osc.address_part(done.performer)}/done"
    assert osc_answers.encode_done(done, since) == by_python_osc(address, *arguments)


def test_a_zero_in_a_name_shifts_no_arguments() -> None:
    """A library's class may have one in its name: other programs would read its rest as index and score."""
    event = Event("ann", EventKind.START, "bow\0\0\0\0\7", 3, 0.5, 1.0)
    ((_, arguments),) = decode_packet(osc_answers.encode_event(event))
    assert arguments == ["start", "bow\ufffd\ufffd\ufffd\ufffd\7", 3, 0.5, 1.0]
    answer = Recognition("ann", 1.0, Outcome.NAMED, ("bow\0ling",), np.ones(1), movement=0.1)
    labels = [each for each in decode_packet(osc_answers.encode_recognition(answer)) if each.address.endswith("/label")]
    assert labels == [Message("/motion/ann/label", ["bow\ufffdling"])]


_STICK = Skeleton(tuple("abcde"), (-1, 0, 1, 1, 2))


@given(frame=frames(), carried=st.none() | st.just(Carried((1.0, 0.0, 0.0, 0.0, 0.5), ((0, 1), (0, 2)))))
def test_a_sent_body_is_read_back(frame: Frame, carried: Carried | None) -> None:
    """Name, time and positions come back; skeleton and weights where they are the frame's."""
    performer, header, positions = decode_body(encode_body(frame, _STICK, carried))
    assert (performer, header.t, header.joints) == (frame.performer, frame.time, len(frame.positions))
    assert np.array_equal(np.frombuffer(positions, "<f4").reshape(-1, 3), frame.positions)
    fits = len(frame.positions) == len(_STICK.joints)
    assert (header.names, header.parents) == ((_STICK.joints, _STICK.parents) if fits else (None, None))
    assert (header.carried, header.pairs) == (carried if fits and carried else (None, None))


# --- what else may be said ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "packet",
    [
        *(wrap(wrong.osc_frame(time=zero)) for zero in (0.0, -0.0) for wrap in (bytes, bundle)),
        *(write(t=zero) for zero in (0, 0.0) for write in (wrong.zmq_frame, wrong.msgpack_frame)),
        wrong.zmq_frame(t=...),
    ],
    ids=range(9),
)
def test_without_a_time_it_is_the_arrival(packet: bytes | list[bytes]) -> None:
    """A frame whose time is 0 or missing gets its arrival as time, in any kind of packet."""
    (frame,) = OwnDecoder().decode(packet, 42.5, None)
    assert frame.time == 42.5


def test_a_zmq_frame_as_documented() -> None:
    """Three parts: a topic that ends in a slash, JSON, little-endian floats; doubles and fields of others are read."""
    positions = np.random.default_rng(5).normal(size=(3, 3))
    topic, header, buffer = zeromq.encode_frame(Frame("p1", 2.5, positions), 3, ("a", "b", "c"))
    described = {"v": 1, "seq": 3, "t": 2.5, "shape": [3, 3], "dtype": "<f4"}
    assert (topic, json.loads(header)) == (b"frame/p1/", described | {"joints": ["a", "b", "c"]})
    assert buffer == positions.astype("<f4").tobytes()
    assert json.loads(zeromq.encode_frame(Frame("p1", 2.5, positions), 3)[1]) == described
    other = json.dumps({"v": 1, "t": 3, "shape": [3, 3], "dtype": "<f8", "units": "m", "more": [1, {}]}).encode()
    numbered = zeromq.decode([topic, other, positions.tobytes()], 0.0)
    assert (numbered.seq, numbered.announcement, numbered.frame.time) == (None, None, 3.0)
    assert np.array_equal(numbered.frame.positions, positions)


# --- what is wrong is counted ------------------------------------------------------------------------------------

WRONG: list[tuple[str, str, object]] = [
    *(("malformed", f"OSC {name}", packet) for name, packet in wrong.MALFORMED_OSC.items()),
    *(("foreign", f"OSC {name}", packet) for name, packet in wrong.FOREIGN_OSC.items()),
    *(("malformed", f"ZeroMQ {name}", parts) for name, parts in wrong.MALFORMED_ZMQ.items()),
    *(("foreign", f"ZeroMQ {name}", parts) for name, parts in wrong.FOREIGN_ZMQ.items()),
]


@pytest.mark.parametrize(
    ("counter", "packet"), [pytest.param(counter, packet, id=name) for counter, name, packet in WRONG]
)
def test_a_wrong_packet_is_counted(counter: str, packet: bytes | list[bytes]) -> None:
    """It shows in its counter alone, with a reason, and gives no frame; the next frame is read."""
    reader = OwnDecoder()
    assert not reader.decode(packet, 1.0, None)
    counts = {name: getattr(reader.counts, name) for name in ("malformed", "foreign", "missing")}
    assert {name: count for name, count in counts.items() if count} == {counter: 1}
    assert len(reader.refusals.lines()) == 1
    good: bytes | list[bytes] = wrong.osc_frame() if isinstance(packet, bytes) else wrong.zmq_frame()
    assert len(reader.decode(good, 1.0, None)) == 1


_NOWHERE = osc.encode_message("/motion/frame", "ann", 1.0, *[0.0] * 5, float("inf"), *[0.0] * 3)
_FLOATS = b'{"v":1,"t":1.0,"shape":[1,3],"dtype":"float64"}'


@pytest.mark.parametrize(
    ("decoder", "packet", "told"),
    [
        (OwnDecoder(), b"hello", "last malformed: neither a message nor a bundle, from 10.0.0.5:4000: 'hello'"),
        (OwnDecoder(), _NOWHERE, "last malformed: /motion/frame of ann: positions: .* joint 2 of 3 at 0, 0, inf, from"),
        (OwnDecoder(), [b"frame/ann/", _FLOATS, bytes(24)], "last malformed: Invalid enum value 'float64' - at `.*d"),
        (OwnDecoder(), [b"hello/", b""], "last foreign: neither a frame nor one part in msgpack or OSC, from"),
        (FeedDecoder(builtin_preset("osceleton")), osc.encode_message("/joint", "head"), "last malformed: /joint: exp"),
    ],
)
def test_the_last_refusal_names_reason_and_sender(decoder: OwnDecoder, packet: bytes | list[bytes], told: str) -> None:
    """The reason, the sender and an excerpt of the packet, in one line without control characters."""
    assert decoder.refusals.lines() == []
    assert not decoder.decode(packet, 1.0, ("10.0.0.5", 4000))
    (line,) = decoder.refusals.lines()
    assert line.isprintable()
    assert re.match(told, line)


def test_cut_off_anywhere_a_packet_never_becomes_a_smaller_one() -> None:
    """A frame cut at any byte is malformed; of a bundle only whole messages are found, where one ends."""
    whole = wrong.osc_frame([1.0] * 6)
    for length in range(len(whole)):
        events, refused = osc.decode(whole[:length], 1.0)
        assert (events, [kind for kind, _ in refused]) == ([], ["malformed"])
    packet = bundle(whole, bundle(message("/b", "i", 1), whole), message("/c", "s", "ü"))
    expected, found = decode_packet(packet), []
    for length in range(len(packet)):
        try:
            found.append(decode_packet(packet[:length]))
        except PacketError:
            continue
    assert found == [[], expected[:1], expected[:3]]


def test_bundles_messages_and_values_have_limits() -> None:
    """At the limits a packet is read; beyond them it is an error and does not exhaust the stack."""
    packet = message("/deep")
    for depth in range(3000):
        packet = bundle(packet)
        if depth == MAX_BUNDLE_DEPTH:
            assert decode_packet(packet) == [Message("/deep", [])]
        elif depth in (MAX_BUNDLE_DEPTH + 1, 2999):
            with pytest.raises(PacketError, match=f"deeper than {MAX_BUNDLE_DEPTH}"):
                decode_packet(packet)
    assert len(decode_packet(bundle(*[b"/a\0\0"] * MAX_MESSAGES))) == MAX_MESSAGES
    (many,) = decode_packet(b"/a\0\0," + b"T" * MAX_VALUES + bytes(4 - (MAX_VALUES + 1) % 4))
    assert len(many.arguments) == MAX_VALUES


def test_no_topic_begins_anothers() -> None:
    """Who asks ZeroMQ for a performer's answers gets nobody else's, whatever a stranger calls a performer."""
    names, topics = ("ann", "ann/", "ann/x", "ann%2Fx"), list[bytes]()
    for name in names:
        body = encode_body(Frame(name, 1.0, np.ones((2, 3))))
        assert (decode_body(body) or ())[0] == name
        topics += [body[0], zeromq.messages.encode(Gone(name))[0]]
    assert not [each for each in permutations(topics, 2) if each[1].startswith(each[0])]


@pytest.mark.parametrize(
    "header", [{"joints": 3}, {"joints": 2, "parents": [0, 2]}, {"joints": 2, "pairs": [[0, 5]]}, {"joints": "2"}]
)
def test_a_body_that_does_not_fit_is_refused(header: dict[str, object]) -> None:
    """Sizes and indices beyond the body never reach who draws it."""
    assert decode_body([b"body/a/", json.dumps({"v": 1, "t": 0} | header).encode(), bytes(24)]) is None


# --- any bytes ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", READERS)
def test_any_bytes_are_a_value_or_the_codecs_error(name: str) -> None:
    """Golden packets cut, changed, joined and nested, parts missing and swapped: nothing else is raised."""
    read, refused = read_broken(name, PACKETS, seed=list(READERS).index(name))
    assert read > 0
    assert refused > 0


@given(places=st.lists(st.tuples(st.integers(0, 99), st.sampled_from([0, 1, 44, 102, 105, 112, 127, 255])), max_size=3))
def test_a_changed_frame_is_read_alike_both_ways(places: list[tuple[int, int]]) -> None:
    """With any bytes changed, the quick reader of frames agrees with the thorough one."""
    packet = bytearray(wrong.osc_frame([float(number) for number in range(12)], "performer"))
    for place, byte in places:
        packet[place % len(packet)] = byte
    alone, bundled = osc.decode(bytes(packet), 1.0), osc.decode(bundle(bytes(packet)), 1.0)
    assert [kind for kind, _ in alone.refused] == [kind for kind, _ in bundled.refused]
    for one, other in zip(alone.events, bundled.events, strict=True):
        assert (one.performer, one.time) == (other.performer, other.time)
        assert np.array_equal(one.positions, other.positions, equal_nan=True)


# --- the values passed on ---------------------------------------------------------------------------------------------


# --- frame ------------------------------------------------------------------------------------------------------------


def _positions() -> np.ndarray:
    return np.random.default_rng(3).normal(size=(4, 3))


@pytest.mark.parametrize("given", [_positions().tolist(), _positions().astype(np.float16), np.arange(12).reshape(4, 3)])
def test_lists_and_other_numbers_become_doubles(given: object) -> None:
    """Lists, half floats and whole numbers make the frame that doubles make, without a warning."""
    frame = Frame("p", 1.0, given)  # type: ignore[arg-type]
    assert frame.positions.dtype == np.float64
    assert np.array_equal(frame.positions, np.asarray(given))


_SHAPES = [(), (3,), (4, 2), (4, 4), (12,), (3, 4), (1, 4, 3)]
_KINDS = (str, object, complex, bool)
REFUSED: list[tuple[str, object, str]] = [
    *(("positions", np.zeros(shape), r"\(joints, 3\), got \(") for shape in _SHAPES),
    *(("positions", each, "numbers, got") for each in (None, "abc", [[1.0, 2.0, 3.0], [1.0]])),
    *(("positions", np.ones((4, 3), kind), "numbers, got") for kind in _KINDS),
    *(("time", each, "finite seconds, got") for each in ("0", None, [0.0], np.nan, np.inf, -np.inf)),
    *(("performer", each, "1 to 64 characters, got") for each in (3, None, ["ann"])),
    *(("performer", each, "1 to 64 characters") for each in ("", "x" * (MAX_PERFORMER_LENGTH + 1))),
    ("joints", "abc", "several names, got the text 'abc'"),
    *(("joints", each, "distinct, non-empty names") for each in ((), ("",), ("hip", ""), ("hip", "knee", "hip"))),
    ("joints", ("hip", "a." * 15_000), "names of at most 400 characters"),
]


@pytest.mark.parametrize(("name", "value", "expected"), REFUSED)
@pytest.mark.parametrize("positions", [_positions(), _positions().tolist()], ids=["array", "list"])
def test_what_is_wrong_is_refused_by_name(name: str, value: object, expected: str, positions: object) -> None:
    """Other shapes and types, times that are none, impossible names: in frames and in announcements."""
    frame = {"performer": "p", "time": 0.0, "positions": positions} | {name: value}
    announced = {"performer": "p", "joints": ("a", "b")} | {name: value}
    for kind, made in ((Frame, frame), (Announcement, announced)):
        if name in getattr(kind, "__slots__", ()):
            with pytest.raises(ValueError, match=f"{name}: expected {expected}"):
                kind(**{field: made[field] for field in kind.__slots__})


# --- recognition ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("outcome", [each for each in Outcome if each is not Outcome.NAMED])
def test_without_a_name_the_label_says_why(outcome: Outcome) -> None:
    """Still and ambiguous windows name no class, index -1, and say their outcome; the scores are there all the same."""
    nameless = dataclasses.replace(NAMED, outcome=outcome)
    assert (nameless.class_index, nameless.class_name) == (-1, None)
    assert nameless.label == outcome.value
    assert type(nameless.label) is str
    assert (nameless.best, nameless.score, nameless.second_index, nameless.margin) == (1, 0.75, 2, 0.25)


# --- status -----------------------------------------------------------------------------------------------------------


def test_lost_counts_each_kind_of_loss_once() -> None:
    """Each kind of loss counts once; frames that were used, foreign messages and new beginnings are no losses."""
    used, kinds = 10**12, (10**power for power in range(11))
    recognizers = RecognizerCounts(frames=used, out_of_order=next(kinds), restarts=used, hops=used)
    outcomes = PerformerCounts(no_room=next(kinds), other_joints=next(kinds), dropped=used, recognizers=recognizers)
    admission = AdmissionCounts(other_sender=next(kinds), not_allowed=used, odd_times=next(kinds))
    lost = {name: next(kinds) for name in ("malformed", "overrun", "missing", "incomplete", "broken", "thrown_away")}
    inputs = InputCounts(received=used, foreign=used, **lost)
    assert Status(inputs, outcomes, used, {}, 0.0, 0.0, admission=admission).lost == int("1" * 11)
