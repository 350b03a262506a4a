"""ZeroMQ messages and sockets: every message is checked, and the traps of PUB and SUB are avoided."""

from __future__ import annotations

import dataclasses
import json
import os
import pickle
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import zmq
from hypothesis import given, settings
from hypothesis import strategies as st

from kinespace.library import MotionLibrary
from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import zeromq
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.recognition import Answer, Outcome, Progress, Recognition
from kinespace.stream.recognizer import LiveSignature, Recognizer, Settings
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.service.status import InputCounts, Status
from kinespace.stream.zeromq import MAX_MESSAGE, Endpoint, FormatError, SequenceGaps, ZmqReceiver, ZmqSender

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from kinespace.library import Clip

ANY_PORT = "tcp://127.0.0.1:*"
#: Milliseconds a test waits for a message that must come, before it gives up.
PATIENCE_MS = 20_000
#: How Linux's table of connections writes one that is open, and the timer that asks whether the other end is there.
ESTABLISHED, KEEPALIVE = "01", 2
NAMED = Recognition(
    performer="Ada",
    time=4.0,
    outcome=Outcome.NAMED,
    classes=("bow", "jump", "wave"),
    scores=np.array([0.25, 0.75, 0.1], dtype=np.float32),
    movement=0.2,
    share=0.8,
    gap=0.6,
    eigenvector_class="wave",
    eigenvector_score=0.9,
)
POSITIONS = np.random.default_rng(5).normal(size=(3, 3))
TOPIC, HEADER, BUFFER = zeromq.encode_frame(Frame("p", 1.5, POSITIONS), 7)


def _header(**changes: object) -> bytes:
    """Give a good header with some fields changed; those set to `...` are left out."""
    described = json.loads(HEADER) | changes
    return json.dumps({name: value for name, value in described.items() if value is not ...}).encode()


# --- frames ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@given(
    performer=st.text(st.characters(codec="utf-8"), min_size=1, max_size=64),
    time=st.floats(allow_nan=False, allow_infinity=False).filter(bool),
    seq=st.integers(0, 2**63 - 1),
    joints=st.none() | st.lists(st.text(min_size=1), min_size=1, max_size=5, unique=True),
)
def test_a_sent_frame_is_read_back(performer: str, time: float, seq: int, joints: list[str] | None) -> None:
    """Performer, time, number, joint names and positions in single precision come back."""
    numbered = zeromq.decode(zeromq.encode_frame(Frame(performer, time, POSITIONS), seq, joints), 77.0)
    assert (numbered.frame.performer, numbered.frame.time, numbered.seq) == (performer, time, seq)
    assert np.array_equal(numbered.frame.positions, POSITIONS.astype(np.float32))
    assert numbered.announcement == (None if joints is None else Announcement(performer, tuple(joints)))


def test_a_frame_as_documented() -> None:
    """A frame's three parts are a topic that ends in a slash, a JSON header, and little-endian floats."""
    topic, header, buffer = zeromq.encode_frame(Frame("p1", 2.5, POSITIONS), 3, ("a", "b", "c"))
    assert topic == b"frame/p1/"
    assert json.loads(header) == {
        "v": 1,
        "seq": 3,
        "t": 2.5,
        "shape": [3, 3],
        "dtype": "<f4",
        "joints": ["a", "b", "c"],
    }
    assert buffer == POSITIONS.astype("<f4").tobytes()
    assert "joints" not in json.loads(zeromq.encode_frame(Frame("p1", 2.5, POSITIONS), 4)[1])


@pytest.mark.parametrize("dtype", ["<f4", "<f8"])
def test_both_types_are_read(dtype: str) -> None:
    """Single and double precision are read, each at its own precision."""
    numbered = zeromq.decode([TOPIC, _header(dtype=dtype), POSITIONS.astype(dtype).tobytes()], 0.0)
    assert np.array_equal(numbered.frame.positions, POSITIONS.astype(dtype))


@pytest.mark.parametrize("changes", [{"t": 0}, {"t": 0.0}, {"t": ...}])
def test_without_a_time_it_is_the_arrival(changes: dict[str, object]) -> None:
    """A frame whose time is 0 or missing gets its arrival as time."""
    assert zeromq.decode([TOPIC, _header(**changes), BUFFER], 42.5).frame.time == 42.5


def test_optional_and_unknown_header_fields() -> None:
    """The number and the joints may be missing, whole seconds may be an integer, and unknown fields are passed over."""
    numbered = zeromq.decode([TOPIC, _header(seq=..., t=3, units="m", more=[1, {}]), BUFFER], 0.0)
    assert (numbered.seq, numbered.announcement, numbered.frame.time) == (None, None, 3.0)


@pytest.mark.parametrize(
    "changes",
    [
        {"v": ...},
        {"v": 2},
        {"v": "1"},
        {"shape": ...},
        {"shape": None},
        {"shape": [3]},
        {"shape": [3, 3, 1]},
        {"shape": [9, 1]},
        {"shape": [0, 3]},
        {"shape": [-3, 3]},
        {"shape": [-1, 3]},
        {"shape": [True, 3]},
        {"shape": [3.0, 3]},
        {"shape": ["3", 3]},
        {"shape": [4, 3]},
        {"shape": [2, 3]},
        {"shape": [4097, 3]},
        {"shape": [2**62, 3]},
        {"shape": [10**30, 3]},
        {"shape": {"0": 3, "1": 3}},
        {"dtype": ...},
        {"dtype": None},
        {"dtype": "f4"},
        {"dtype": "float32"},
        {"dtype": ">f4"},
        {"dtype": "<f2"},
        {"dtype": "<i4"},
        {"dtype": "<c8"},
        {"dtype": "O"},
        {"dtype": "|O"},
        {"dtype": "V4"},
        {"dtype": "S4"},
        {"dtype": "<f8"},
        {"dtype": ["<f4"]},
        {"dtype": [["x", "<f4"]]},
        {"dtype": {"names": ["x"], "formats": ["O"]}},
        {"t": "now"},
        {"t": True},
        {"t": None},
        {"t": [1]},
        {"t": float("nan")},
        {"t": float("inf")},
        {"t": 10**400},
        {"seq": -1},
        {"seq": 1.5},
        {"seq": "7"},
        {"seq": True},
        {"joints": "abc"},
        {"joints": []},
        {"joints": ["a", "a", "b"]},
        {"joints": ["a", ""]},
        {"joints": ["a", 1]},
        {"joints": {"a": 1}},
    ],
    ids=str,
)
def test_headers_are_not_believed(changes: dict[str, object]) -> None:
    """A type that is not on the list, a size that does not fit, and any field of another kind is a FormatError."""
    with pytest.raises(FormatError):
        zeromq.decode([TOPIC, _header(**changes), BUFFER], 1.0)


@pytest.mark.parametrize(
    "header",
    [
        b"",
        b"{",
        b"[]",
        b"1",
        b"null",
        b'"v"',
        b"\xff\xfe",
        b"{'v': 1}",
        b"[" * 60_000,
        b'{"v":1,"joints":' + b"[" * 60_000,
        b'{"v":' + b"1" * 10_000 + b"}",
        HEADER[:-1],
        HEADER + b"x",
        HEADER + b" " * zeromq.MAX_HEADER,
        pickle.dumps({"v": 1}),
    ],
    ids=range(15),
)
def test_broken_headers_are_format_errors(header: bytes) -> None:
    """A header that is no JSON object of a bounded size is a FormatError, also when it is deeply nested."""
    with pytest.raises(FormatError):
        zeromq.decode([TOPIC, header, BUFFER], 1.0)


_NUMBERS = st.one_of(
    st.integers().map(str),
    st.floats().map(json.dumps),
    st.sampled_from(
        ["-0", "0", "00", "01", "+1", "1.", ".5", "1e5", "1E+5", "1e-5", "-1e400", "1_0", " 1", "0x1", "١"]
    ),
)


@given(
    seq=_NUMBERS,
    time=_NUMBERS,
    joints=st.sampled_from(["3", "03", "3.0", "0", "-3", "4097", "4"]),
    dtype=st.sampled_from(["<f4", "<f8", ">f4"]),
    space=st.sampled_from(["", " ", "  "]),
)
@settings(max_examples=150)
def test_a_header_is_read_alike_both_ways(seq: str, time: str, joints: str, dtype: str, space: str) -> None:
    """The quick way of reading a header finds what json does, with the fields in another order, or nothing either."""
    fields = [f'"seq":{space}{seq}', f'"t":{space}{time}', f'"shape":{space}[{joints},{space}3]']
    fields += [f'"dtype":{space}"{dtype}"']
    comma = f",{space}"
    quick, thorough = f'{{"v":{space}1{comma}{comma.join(fields)}}}', f'{{{comma.join(fields)}{comma}"v":{space}1}}'
    buffer = POSITIONS.astype("<f8" if "8" in dtype else "<f4").tobytes()
    found = [_read_or_none([TOPIC, header.encode(), buffer]) for header in (quick, thorough)]
    assert found[0] == found[1]


def _read_or_none(parts: list[bytes]) -> tuple[object, ...] | None:
    try:
        frame, seq, announcement = zeromq.decode(parts, 77.0)
    except FormatError:
        return None
    return frame.performer, frame.time, frame.positions.tobytes(), seq, announcement


@pytest.mark.parametrize("joints", [True, MAX_MESSAGE, 4097])
def test_bodies_of_absurd_size(joints: int) -> None:
    """More joints than anybody has, and a truth value for their number, are refused though the buffer fits."""
    with pytest.raises(FormatError, match="shape"):
        zeromq.decode([TOPIC, _header(shape=[joints, 3]), bytes(12 * int(joints))], 1.0)


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, 3e38])
def test_impossible_positions_are_format_errors(number: float) -> None:
    """NaN for all joints, an infinity or a joint beyond any stage is a FormatError."""
    positions = POSITIONS.astype("<f4")
    positions[:] = number
    with pytest.raises(FormatError, match="positions"):
        zeromq.decode([TOPIC, HEADER, positions.tobytes()], 1.0)


@pytest.mark.parametrize("size", [0, 1, 35, 37, 72, 1_000_000])
def test_the_size_is_checked(size: int) -> None:
    """A buffer of another size than the header's shape and type make is a FormatError that tells both."""
    with pytest.raises(FormatError, match=f"positions: expected 36 bytes, got {size}"):
        zeromq.decode([TOPIC, HEADER, bytes(size)], 1.0)


@pytest.mark.parametrize(
    "topic",
    [
        b"",
        b"frame",
        b"frame/",
        b"frame//",
        b"frame/p",
        b"mocap/p/",
        b"/p/",
        b"frame/\xff/",
        b"frame/" + b"p" * 65 + b"/",
    ],
)
def test_foreign_topics_are_format_errors(topic: bytes) -> None:
    """A topic of another form, or with an impossible performer, is a FormatError."""
    with pytest.raises(FormatError):
        zeromq.decode([topic, HEADER, BUFFER], 1.0)


@pytest.mark.parametrize("parts", [[], [TOPIC], [TOPIC, HEADER], [TOPIC, HEADER, BUFFER, b""]])
def test_another_number_of_parts(parts: list[bytes]) -> None:
    """A frame has three parts, no less and no more."""
    with pytest.raises(FormatError):
        zeromq.decode(parts, 1.0)


def test_nothing_is_unpickled(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pickle in place of any part is refused, and its code does not run."""

    def loads(*_: object) -> None:
        pytest.fail("unpickled")

    poison = pickle.dumps(Frame("p", 1.0, POSITIONS))
    monkeypatch.setattr(pickle, "loads", loads)
    monkeypatch.setattr(pickle, "load", loads)
    for parts in ([poison, HEADER, BUFFER], [TOPIC, poison, BUFFER], [TOPIC, HEADER, poison], [poison]):
        with pytest.raises(FormatError):
            zeromq.decode(parts, 1.0)
        assert zeromq.decode_answer(parts) is None


@given(parts=st.lists(st.binary(max_size=60) | st.sampled_from([TOPIC, HEADER, BUFFER]), max_size=4))
@settings(max_examples=150)
def test_random_parts_raise_nothing_else(parts: list[bytes]) -> None:
    """Any parts, good ones and random bytes mixed, are a frame or a FormatError."""
    try:
        numbered = zeromq.decode(parts, 1.0)
    except FormatError:
        return
    assert len(parts) == 3
    assert numbered.frame.positions.shape == (3, 3)


@pytest.mark.slow
@given(
    header=st.dictionaries(
        st.sampled_from(["v", "seq", "t", "shape", "dtype", "joints"]),
        st.recursive(
            st.none()
            | st.booleans()
            | st.integers()
            | st.floats()
            | st.text(max_size=3)
            | st.sampled_from([1, 3, "<f4"]),
            lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=2), inner, max_size=2),
            max_leaves=4,
        ),
    ),
    full=st.booleans(),
)
@settings(max_examples=150)
def test_any_json_raises_nothing_else(header: dict[str, object], *, full: bool) -> None:
    """Any JSON in the header's fields gives a frame or a FormatError."""
    described = json.loads(HEADER) | header if full else header
    try:
        numbered = zeromq.decode([TOPIC, json.dumps(described).encode(), BUFFER], 1.0)
    except FormatError:
        return
    assert numbered.frame.positions.shape == (3, 3)


# --- answers -----------------------------------------------------------------------------------------------------


def test_an_answer_holds_the_recognition() -> None:
    """Every field of a recognition but the evidence for it is in one JSON object under a topic of its own."""
    topic, encoded = zeromq.encode_recognition(NAMED)
    answer = json.loads(encoded)
    assert topic == b"class/Ada/"
    assert answer.pop("scores") == pytest.approx({"bow": 0.25, "jump": 0.75, "wave": 0.1}, abs=1e-6)
    assert answer.pop("margin") == pytest.approx(0.5)
    assert answer == {
        "v": 1,
        "performer": "Ada",
        "t": 4.0,
        "class": "jump",
        "guess": NAMED.class_name,
        "index": 1,
        "guess_index": 1,
        "outcome": "named",
        "score": 0.75,
        "runner_up": "bow",
        "movement": 0.2,
        "share": 0.8,
        "gap": 0.6,
        "eigenvector_class": "wave",
        "eigenvector_score": 0.9,
        "doubted": [],
        "progress": None,
    }
    unsaid = {"time", "classes", "events", "lead", "evidence"}
    assert {each.name for each in dataclasses.fields(Recognition)} - unsaid <= {"scores", *answer}


def test_answers_hold_progress() -> None:
    """While a motion is followed, the answer says how far it is."""
    followed = dataclasses.replace(NAMED, progress=Progress("wave", 0.25, 0.5, 2.0, 0.75, 0.875, 3))
    told = json.loads(zeromq.encode_recognition(followed)[1])["progress"]
    assert told == {
        "class": "wave",
        "phase": 0.25,
        "scrub": 0.5,
        "speed": 2.0,
        "amplitude": 0.75,
        "sure": 0.875,
        "cycles": 3,
    }


def _dumped(recognition: Recognition) -> dict[str, object]:
    """Give an answer as json.dumps writes it, field by field."""
    second = sorted(range(len(recognition.scores)), key=lambda index: -recognition.scores[index])
    second = [index for index in second if index != recognition.best]
    described = {
        "v": 1,
        "performer": recognition.performer,
        "t": recognition.time,
        "class": recognition.class_name,
        "guess": recognition.classes[recognition.best] if recognition.guess_index >= 0 else None,
        "index": recognition.class_index,
        "guess_index": recognition.guess_index,
        "outcome": recognition.outcome,
        "score": float(recognition.scores[recognition.best]),
        "runner_up": recognition.classes[second[0]] if second else None,
        "margin": float(recognition.scores[recognition.best])
        - (float(recognition.scores[second[0]]) if second else 0.0),
        "scores": {
            name: round(float(score), 6) for name, score in zip(recognition.classes, recognition.scores, strict=True)
        },
        "movement": recognition.movement,
        "share": recognition.share,
        "gap": recognition.gap,
        "eigenvector_class": recognition.eigenvector_class,
        "eigenvector_score": recognition.eigenvector_score,
        "doubted": [],
        "progress": None,
    }
    return json.loads(json.dumps(described))


_ANY_TEXT = st.text(st.characters(codec="utf-8"), min_size=1, max_size=12)
_SHARES = st.floats(0, 1)


@given(
    performer=_ANY_TEXT,
    classes=st.lists(
        st.one_of(_ANY_TEXT, st.sampled_from(["50 %", "%s", '"', "{}", "\\", "\n"])), min_size=1, unique=True
    ),
    outcome=st.sampled_from(Outcome),
    numbers=st.tuples(st.floats(0, 1e9), st.floats(0, 1e3), _SHARES, _SHARES, _SHARES),
    data=st.data(),
)
def test_an_answer_equals_json_dumps(
    performer: str,
    classes: list[str],
    outcome: Outcome,
    numbers: tuple[float, float, float, float, float],
    data: st.DataObject,
) -> None:
    """With any names and numbers, an answer is read like one written by json."""
    scores = data.draw(st.lists(st.floats(0, 1), min_size=len(classes), max_size=len(classes)))
    guess = data.draw(st.one_of(st.none(), st.integers(0, len(classes) - 1)))
    kind = data.draw(st.sampled_from([np.float32, np.float64]))
    time, movement, share, gap, eigenvector_score = numbers
    recognition = Recognition(
        performer=performer,
        time=time,
        outcome=outcome,
        classes=tuple(classes),
        scores=np.array(scores, kind),
        movement=movement,
        eigenvector_class=data.draw(st.sampled_from([None, *classes])),
        eigenvector_score=eigenvector_score,
        share=share,
        gap=gap,
        guess=guess,
    )
    topic, encoded = zeromq.encode_recognition(recognition)
    assert topic == f"class/{performer}/".encode()
    assert json.loads(encoded) == _dumped(recognition)
    assert list(json.loads(encoded)) == list(_dumped(recognition))


def test_numbers_that_are_not_finite_are_null() -> None:
    """NaN and infinities, which no recogniser gives, make an answer that every JSON parser reads."""
    scores = np.array([np.nan, np.inf, -np.inf, 0.1234567])
    odd = dataclasses.replace(
        NAMED, classes=("%.6f", "b", "c", "d"), scores=scores, guess=3, movement=np.nan, gap=-np.inf
    )
    encoded = zeromq.encode_recognition(odd)[1]
    assert b"NaN" not in encoded
    assert b"Infinity" not in encoded
    answer = json.loads(encoded)
    assert answer["scores"] == {"%.6f": None, "b": None, "c": None, "d": 0.123457}
    assert (answer["movement"], answer["gap"]) == (None, None)


@pytest.mark.slow
@pytest.mark.parametrize("signature", LiveSignature)
def test_real_answers_equal_json_dumps(signature: LiveSignature, some_clips: tuple[Clip, ...]) -> None:
    """Recognitions of real motions are read like ones written by json."""
    recognizer = Recognizer(MotionLibrary.builtin(), Settings(signature=signature))
    clip = max(some_clips, key=lambda clip: clip.duration)
    frames = [Frame("p", 1.0 + time, each) for time, each in zip(clip.times.tolist(), clip.positions, strict=True)]
    answers = [answer for frame in frames if (answer := recognizer.push(frame))]
    assert answers
    for answer in answers:
        assert json.loads(zeromq.encode_recognition(answer)[1]) == _dumped(answer)


def test_a_performer_who_left_has_no_class() -> None:
    """The last answer about a performer names no class and gives the reason; listeners read it as any other."""
    parts = zeromq.encode_gone("Zoë 1")
    assert parts[0] == "class/Zoë 1/".encode()
    assert zeromq.decode_answer(parts) == Answer("Zoë 1", -1, 0.0, 0.0, "gone")


@pytest.mark.parametrize("outcome", [Outcome.STILL, Outcome.AMBIGUOUS])
def test_without_a_class_it_is_null(outcome: Outcome) -> None:
    """Without a class the name is null, the index -1 and the outcome says why."""
    answer = json.loads(zeromq.encode_recognition(dataclasses.replace(NAMED, outcome=outcome))[1])
    assert (answer["class"], answer["index"], answer["outcome"]) == (None, -1, outcome.value)
    assert answer["score"] == 0.75


@pytest.mark.parametrize("outcome", list(Outcome))
def test_a_sent_answer_is_read_back(outcome: Outcome) -> None:
    """A listener reads performer, class, score, margin and label; without a class it reads the reason."""
    recognition = dataclasses.replace(NAMED, performer="Zoë 1", outcome=outcome)
    expected = Answer("Zoë 1", recognition.class_index, 0.75, recognition.margin, recognition.label)
    assert zeromq.decode_answer(zeromq.encode_recognition(recognition)) == expected


_ANSWER = json.loads(zeromq.encode_recognition(NAMED)[1])


@pytest.mark.parametrize(
    "parts",
    [
        [],
        [b"class/p/"],
        [b"class/p/", b"{}", b""],
        [b"class/p/", b""],
        [b"class/p/", b"{"],
        [b"class/p/", b"[]"],
        [b"class/p/", b"null"],
        [b"class/p/", b"\xff"],
        [b"class/p/", b"[" * 100_000],
        [b"status/", json.dumps(_ANSWER).encode()],
        [b"class/p/", json.dumps(_ANSWER | {"index": None}).encode()],
        [b"class/p/", json.dumps(_ANSWER | {"index": float("inf")}).encode()],
        [b"class/p/", json.dumps(_ANSWER | {"score": "high"}).encode()],
        [b"class/p/", json.dumps(_ANSWER | {"score": []}).encode()],
        [b"class/p/", json.dumps({name: value for name, value in _ANSWER.items() if name != "margin"}).encode()],
        zeromq.encode_classes(("bow",)),
        zeromq.encode_frame(Frame("p", 1.0, POSITIONS), 0),
    ],
    ids=range(17),
)
def test_other_messages_are_no_answer(parts: list[bytes]) -> None:
    """A listener takes no other message for an answer, and no message at all stops it."""
    assert zeromq.decode_answer(parts) is None


def test_classes_and_status_are_json() -> None:
    """Class names come in the order of their indices; the status holds every counter by its name, and the sums."""
    topic, encoded = zeromq.encode_classes(("bow", "jump"))
    assert (topic, json.loads(encoded)) == (b"classes/", {"v": 1, "classes": ["bow", "jump"]})
    inputs = InputCounts(received=90, malformed=1, foreign=2, overrun=3, missing=4)
    status = Status(inputs, PerformerCounts(no_room=5), 6, {"Ada": 120.0}, 0.001, 0.002)
    topic, encoded = zeromq.encode_status(status)
    assert topic == b"status/"
    described = json.loads(encoded)
    assert described == {"v": 1, "alive": True, "frames_per_second": 120.0, "lost": 13} | dataclasses.asdict(status) | {
        "notes": [],
        "followed": 1,
    }
    told = {"received": 90, "malformed": 1, "foreign": 2, "overrun": 3, "missing": 4}
    assert described["inputs"] == told | {"incomplete": 0, "broken": 0, "thrown_away": 0}
    assert set(described["outcomes"]["recognizers"]) == {"frames", "out_of_order", "restarts", "hops"}


def test_an_open_status_names_no_performer() -> None:
    """Where anybody may listen the status gives the number of performers, but neither their names nor their senders."""
    said = {"Ada": "who", "Bob": "10.0.0.5"}
    status = Status(InputCounts(), PerformerCounts(), 0, {"Ada": 120.0}, 0.0, 0.0, said, doubted=said, compared=said)
    status = dataclasses.replace(status, notes=("two senders are called Ada: 10.0.0.5",))
    _, encoded = zeromq.encode_status(status, named=False)
    assert b"Ada" not in encoded
    assert b"10.0.0.5" not in encoded
    assert json.loads(encoded)["followed"] == 1


# --- sequence numbers --------------------------------------------------------------------------------------------


def _missing(numbers: list[int | None]) -> int:
    gaps = SequenceGaps()
    for number in numbers:
        gaps.see("p", number)
    return gaps.missing


@pytest.mark.parametrize(
    ("numbers", "missing"),
    [
        ([], 0),
        ([5], 0),
        ([0, 1, 2, 3], 0),
        ([0, 1, 4], 2),
        ([10, 20, 30], 18),
        ([0, 2, 1, 3], 0),
        ([0, 3, 2, 1, 4], 0),
        ([0, 1, 1, 1, 2], 0),
        ([0, 4, 4, 5], 3),
        ([100, 101, 0, 1, 2], 0),
        ([100, 101, 50, 51], 0),
        ([0, 1, 2, 3, 0, 1, 2, 3, 4], 0),
        ([0, 5, 0, 1, 2], 4),
        ([5000, 0, 3], 2),
        ([None, None], 0),
        ([3, None, 4], 0),
    ],
)
def test_gaps_in_the_numbers(numbers: list[int | None], missing: int) -> None:
    """Skipped numbers are missing, late ones fill their gap, and 0 or one far below is a sender that began again."""
    assert _missing(numbers) == missing


@given(data=st.data())
def test_dropped_and_swapped_numbers(data: st.DataObject) -> None:
    """Of a feed that loses frames and swaps neighbours, exactly the lost ones between first and last are missing."""
    count = data.draw(st.integers(3, 60))
    kept = sorted({0, count - 1, *data.draw(st.sets(st.integers(0, count - 1)))})
    for place in range(1, len(kept) - 2, 3):
        if data.draw(st.booleans()) and kept[place + 1] - kept[place] < 10:
            kept[place], kept[place + 1] = kept[place + 1], kept[place]
    assert _missing([1000 + number for number in kept]) == count - len(kept)


def test_performers_are_counted_apart() -> None:
    """Each performer's numbers are its own, and the gaps of all add up."""
    gaps = SequenceGaps()
    for performer, number in [("a", 0), ("b", 100), ("a", 1), ("b", 103), ("a", 3)]:
        gaps.see(performer, number)
    assert gaps.missing == 3


def test_made_up_names_do_not_pile_up() -> None:
    """The decoder remembers a bounded number of beginnings, for any number of performers, and reads all frames."""
    gaps = SequenceGaps()
    gaps.see("p", 7)
    for number in range(5000):
        gaps.see(f"stranger {number}", number)
    gaps.see("p", 100)
    assert gaps.missing == 0
    gaps.see("p", 102)
    assert gaps.missing == 1


# --- endpoints ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "bind", "expected"),
    [
        ("tcp://127.0.0.1:5556", True, Endpoint("tcp://127.0.0.1:5556", bind=True)),
        ("tcp://127.0.0.1:5556", False, Endpoint("tcp://127.0.0.1:5556", bind=False)),
        ("@tcp://*:5556", False, Endpoint("tcp://*:5556", bind=True)),
        ("@tcp://*:5556", True, Endpoint("tcp://*:5556", bind=True)),
        (">tcp://host:5556", True, Endpoint("tcp://host:5556", bind=False)),
        (">ipc:///tmp/feed", False, Endpoint("ipc:///tmp/feed", bind=False)),
    ],
)
def test_an_endpoint_says_bind_or_connect(text: str, expected: Endpoint, *, bind: bool) -> None:
    """A "@" binds and a ">" connects, with either default; without both the default decides."""
    assert Endpoint.parse(text, bind=bind) == expected


@pytest.mark.parametrize("text", ["", "5556", "127.0.0.1:5556", "tcp:/127.0.0.1", "@", ">localhost:5556"])
def test_an_endpoint_without_a_transport_is_refused(text: str) -> None:
    """An address without a transport is refused, with an example."""
    with pytest.raises(ValueError, match=r"endpoint: expected an address like tcp://127\.0\.0\.1:5556"):
        Endpoint.parse(text, bind=True)


@pytest.mark.parametrize("make", [ZmqReceiver, ZmqSender])
def test_the_error_names_a_taken_address(make: Callable[[Endpoint], ZmqReceiver | ZmqSender]) -> None:
    """Binding a taken address raises an OSError that names it."""
    first = make(Endpoint(ANY_PORT, bind=True))
    with pytest.raises(OSError, match=first.address):
        make(Endpoint(first.address, bind=True))
    first.close()


@pytest.mark.parametrize("bind", [True, False])
@pytest.mark.parametrize("address", ["tcp://", "tcp://127.0.0.1", "tcp://127.0.0.1:none", "smoke://signals"])
def test_the_error_names_a_senseless_address(address: str, *, bind: bool) -> None:
    """An address that ZeroMQ does not understand raises an OSError that names it."""
    with pytest.raises(OSError, match=f"{address}: "):
        ZmqReceiver(Endpoint(address, bind=bind))


# --- the sockets -------------------------------------------------------------------------------------------------


class Wire:
    """Opens senders and receivers, and closes all of them."""

    def __init__(self) -> None:
        self._opened: list[ZmqReceiver | ZmqSender] = []

    def receiver(self, address: str = ANY_PORT, *, bind: bool = True, topic: bytes = b"") -> ZmqReceiver:
        """Open a SUB socket."""
        receiver = ZmqReceiver(Endpoint(address, bind=bind), topic)
        self._opened.append(receiver)
        return receiver

    def sender(self, address: str = ANY_PORT, *, bind: bool = True) -> ZmqSender:
        """Open a PUB socket."""
        sender = ZmqSender(Endpoint(address, bind=bind))
        self._opened.append(sender)
        return sender

    def close(self) -> None:
        """Close all."""
        for each in self._opened:
            each.close()


@pytest.fixture
def wire() -> Iterator[Wire]:
    """Close every socket that a test opens."""
    wire = Wire()
    yield wire
    wire.close()


def _next(receiver: ZmqReceiver) -> list[bytes]:
    """Wait for the next message."""
    assert receiver.socket.poll(PATIENCE_MS)
    parts = receiver.receive()
    assert parts is not None
    return parts


def _delivered(sender: ZmqSender, receiver: ZmqReceiver, topic: bytes = TOPIC) -> list[list[bytes]]:
    """Give all messages that came before a mark that is sent now."""
    sender.send([topic, b"mark"])
    found = []
    while (parts := _next(receiver)) != [topic, b"mark"]:
        found.append(parts)
    return found


def _greet(sender: ZmqSender, receiver: ZmqReceiver, topic: bytes = TOPIC) -> None:
    """Send until a message comes through: peers take a moment to connect, and messages before that are lost."""
    for _ in range(PATIENCE_MS // 50):
        sender.send([topic, b"hello"])
        if receiver.socket.poll(50):
            break
    _delivered(sender, receiver, topic)


@pytest.mark.parametrize("receiver_binds", [True, False])
def test_either_side_may_bind(wire: Wire, *, receiver_binds: bool) -> None:
    """Bound or connected, frames go through whole and in order, and then receiving gives None."""
    if receiver_binds:
        receiver = wire.receiver()
        sender = wire.sender(receiver.address, bind=False)
    else:
        sender = wire.sender()
        receiver = wire.receiver(sender.address, bind=False)
    _greet(sender, receiver)
    messages = [zeromq.encode_frame(Frame("p", 1.0 + seq, POSITIONS), seq, ("a", "b", "c")) for seq in range(50)]
    for message in messages:
        sender.send(message)
    assert _delivered(sender, receiver) == messages
    assert receiver.receive() is None
    assert sender.failed == 0


def test_a_bound_receiver_hears_senders_that_connect_later(wire: Wire) -> None:
    """A bound SUB that is polled as a service does takes in senders that connect at any later time, several at once."""
    receiver = wire.receiver()
    assert receiver.receive() is None
    for name in ("first", "second"):
        sender = wire.sender(receiver.address, bind=False)
        _greet(sender, receiver)
        sender.send([b"frame/p/", name.encode()])
        assert _delivered(sender, receiver) == [[b"frame/p/", name.encode()]]


def test_p1_is_not_p10(wire: Wire) -> None:
    """A subscriber to one performer's answers gets no other's, though topics match by their first bytes."""
    sender = wire.sender()
    receiver = wire.receiver(sender.address, bind=False, topic=b"class/p1/")
    _greet(sender, receiver, b"class/p1/")
    performers = ["p10", "p1", "p11", "p", "p1x", "p1"]
    for performer in performers:
        sender.send(zeromq.encode_recognition(dataclasses.replace(NAMED, performer=performer)))
    answers = [zeromq.decode_answer(parts) for parts in _delivered(sender, receiver, b"class/p1/")]
    assert [answer.performer for answer in answers if answer] == ["p1", "p1"]


def test_a_slow_reader_keeps_the_oldest_and_the_numbers_show_it(wire: Wire) -> None:
    """Beyond the high water mark it is the newest frames that are lost, and the gap in the numbers counts them all."""
    sender = wire.sender("inproc://a-slow-reader")
    receiver = wire.receiver("inproc://a-slow-reader", bind=False)
    _greet(sender, receiver)
    for seq in range(5000):
        sender.send(zeromq.encode_frame(Frame("p", 1.0 + seq, POSITIONS), seq))
    kept = []
    while (parts := receiver.receive()) is not None:
        kept.append(parts)
    sender.send(zeromq.encode_frame(Frame("p", 6000.0, POSITIONS), 5000))
    gaps, seen = SequenceGaps(), []
    for parts in (*kept, _next(receiver)):
        numbered = zeromq.decode(parts, 0.0)
        gaps.see(numbered.frame.performer, numbered.seq)
        seen.append(numbered.seq)
    assert seen == [*range(len(kept)), 5000]
    assert 1000 <= len(kept) < 5000
    assert gaps.missing == 5000 - len(kept)
    assert sender.failed == 0


def test_sending_without_a_listener_is_no_error(wire: Wire) -> None:
    """Publishing without a subscriber loses the message, without an error."""
    sender = wire.sender()
    for _ in range(2000):
        sender.send([b"class/p/", b"{}"])
    assert sender.failed == 0


def test_a_message_too_large_does_not_get_in(wire: Wire) -> None:
    """A message beyond the bound never reaches us, and its sender's further messages do."""
    receiver = wire.receiver()
    sender = wire.sender(receiver.address, bind=False)
    _greet(sender, receiver)
    sender.send([b"frame/p/", bytes(MAX_MESSAGE - 1)])
    assert [len(part) for part in _next(receiver)] == [8, MAX_MESSAGE - 1]
    sender.send([b"frame/p/", bytes(2 * MAX_MESSAGE)])
    for _ in range(PATIENCE_MS // 50):
        sender.send([b"frame/p/", b"small"])
        if receiver.socket.poll(50):
            break
    assert {parts[1] for parts in _delivered(sender, receiver)} == {b"small"}


@pytest.mark.slow
@pytest.mark.parametrize("bind", [True, False], ids=["bound", "connected"])
def test_a_message_too_large_is_counted_and_the_sender_comes_back(wire: Wire, *, bind: bool) -> None:
    """Either end may have connected: the break is counted once each time, and later messages are heard again."""
    other = wire.receiver() if bind else wire.sender()
    receiver, sender = (other, wire.sender(other.address, bind=False)) if bind else (None, other)
    receiver = receiver or wire.receiver(sender.address, bind=False)
    _greet(sender, receiver)
    assert receiver.broken() == 0
    for times in (1, 2):
        sender.send([b"frame/p/", bytes(2 * MAX_MESSAGE)])
        until, heard = time.monotonic() + PATIENCE_MS / 1000, False
        while not heard and time.monotonic() < until:
            sender.send([b"frame/p/", b"small"])
            seen = receiver.broken() == times
            heard = bool(receiver.socket.poll(20)) and seen
            while receiver.receive():
                pass
        assert heard
        assert receiver.broken() == times


@pytest.mark.slow
@pytest.mark.parametrize("bind", [True, False], ids=["bound", "connected"])
def test_a_sender_that_leaves_is_not_counted(wire: Wire, *, bind: bool) -> None:
    """A sender that ends, and begins again seconds later, is not counted as broken, and is heard again."""
    if bind:
        receiver = wire.receiver()
        sender = wire.sender(receiver.address, bind=False)
    else:
        sender = wire.sender()
        receiver = wire.receiver(sender.address, bind=False)
    address = receiver.address if bind else sender.address
    _greet(sender, receiver)
    sender.close()
    for _ in range(60):
        assert receiver.broken() == 0
        receiver.socket.poll(20)
    again = wire.sender(address, bind=not bind)
    _greet(again, receiver)
    assert receiver.broken() == 0


def test_closing_does_not_wait_for_anybody(wire: Wire) -> None:
    """Messages that were not delivered when a sender is closed are dropped."""
    sender = wire.sender()
    assert sender.socket.linger == 0
    assert wire.receiver().socket.linger == 0
    sender.close()
    assert sender.socket.closed


def test_a_closed_sender_counts_its_failures(wire: Wire) -> None:
    """Sending on a closed socket is counted as failed, without an error."""
    sender = wire.sender()
    sender.close()
    sender.send([b"class/p/", b"{}"])
    assert sender.failed == 1


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells of each connection which timer runs")
def test_a_sender_that_was_switched_off_is_asked_for(wire: Wire) -> None:
    """While nothing comes, the system asks on both ends' connections whether the other is there, within seconds."""
    receiver = wire.receiver()
    sender = wire.sender(receiver.address, bind=False)
    _greet(sender, receiver)
    port = f":{int(receiver.address.rpartition(':')[2]):04X}"
    until, timers = time.monotonic() + PATIENCE_MS / 1000, list[tuple[int, float]]()
    # The last message is acknowledged first.
    while [kind for kind, _ in timers] != [KEEPALIVE, KEEPALIVE] and time.monotonic() < until:
        rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        ends = [row[5].split(":") for row in rows if row[3] == ESTABLISHED and port in row[1] + row[2]]
        timers = [(int(kind, 16), int(ticks, 16) / os.sysconf("SC_CLK_TCK")) for kind, ticks in ends]
        time.sleep(0.01)
    assert [kind for kind, _ in timers] == [KEEPALIVE, KEEPALIVE]
    assert max(seconds for _, seconds in timers) <= 6.0


def test_messages_never_come_in_halves(wire: Wire) -> None:
    """Parts are delivered together or not at all: CONFLATE, which drops a message's topic, is not used."""
    for each in (wire.sender(), wire.receiver()):
        assert not each.socket.getsockopt(zmq.CONFLATE)


def test_the_default_joints_fit_a_header() -> None:
    """A frame that names all 31 joints has a header far below the bound."""
    _, header, _ = zeromq.encode_frame(Frame("p", 1.0, np.zeros((31, 3))), 0, SKELETON.joints)
    assert len(header) < zeromq.MAX_HEADER / 100
