"""Frames and answers as ZeroMQ messages: pure functions between them and bytes.

Frames as ZeroMQ messages, of several parts or of one: bytes in, frames out, and back.

`[b"frame/<performer>/"][JSON header][raw little-endian floats]`. The header holds `v` (1), `seq`, `t` seconds, `shape`
[joints, 3], `dtype` "<f4" or "<f8", and `joints` (names) in the first frame and whenever they change.

Senders that cannot send several parts, or whose sockets keep only the newest message (CONFLATE) and so lose all parts
but the last, send a msgpack map: the header's fields, `performer`, and the positions as `data`.

Topics end in a slash because subscriptions match by their first bytes: `frame/p1` would match `frame/p10` too.
Nothing is unpickled. msgspec checks a header's fields and their bounds while it reads them, and the size of the
positions is checked before they are used.

Answers as ZeroMQ messages: a topic and a JSON object.

`[b"class/<performer>/"][JSON]`, `[b"event/<performer>/"][JSON]`, `[b"done/<performer>/"][JSON]`,
`[b"classes/"][JSON]`, `[b"status/"][JSON]`; `/` and `%` of the performer's name are written as in URLs. NaN and
infinity are null, because JSON has neither.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict
from functools import lru_cache
from typing import Annotated, Literal, NamedTuple
from urllib.parse import unquote

import msgspec
import numpy as np

from kinespace.library import Skeleton
from kinespace.stream.frame import MAX_PERFORMER_LENGTH, Announcement, Frame
from kinespace.stream.packet import remember
from kinespace.stream.recognition import GONE, Answer, Classes, Done, Event, Gone, Progress, Recognition
from kinespace.stream.recognizer.carried import Carried
from kinespace.stream.status import Status
from kinespace.stream.teaching.commands import State, Taught, as_json

VERSION = 1
#: Bytes of a header; one with 31 joint names has 500.
MAX_HEADER = 65_536
_TYPES: dict[str, np.dtype[np.floating]] = {name: np.dtype(name) for name in ("<f4", "<f8")}
#: How many joints a frame has, and a body that is drawn.
_Joints = Annotated[int, msgspec.Meta(ge=1, le=4096)]
#: The highest sequence number.
MAX_SEQ = 2**63 - 1
#: Bytes of a topic: the longest name that a performer may have, in UTF-8.
_MAX_TOPIC = len(b"frame//") + 4 * MAX_PERFORMER_LENGTH
#: A number this far behind the newest is still a late frame, not a new beginning.
_MAX_LATE = 16
_MAX_PERFORMERS = 1024


class Header(msgspec.Struct):
    """The fields that describe a frame's positions; msgspec refuses values of other types and beyond the bounds."""

    v: Literal[1]
    shape: tuple[_Joints, Literal[3]]
    dtype: Literal["<f4", "<f8"]
    seq: Annotated[int, msgspec.Meta(ge=0, le=MAX_SEQ)] | None = None
    t: float = 0.0
    joints: list[str] | None = None


class Packed(Header, kw_only=True):
    """A header with the performer and the positions."""

    performer: str
    data: bytes


_read_header = msgspec.json.Decoder(Header).decode
_unpack = msgspec.msgpack.Decoder(Packed).decode


class NumberedFrame(NamedTuple):
    """A frame with its sender's count and, if the header has them, the names of its joints."""

    frame: Frame
    seq: int | None
    announcement: Announcement | None


def decode(parts: Sequence[bytes], arrival: float) -> NumberedFrame:
    """Decode a frame.

    Parameters
    ----------
    parts
        Topic, header and positions; or one part, a msgpack map of them all.
    arrival
        Seconds: the time of frames whose `t` is missing or 0.

    Raises
    ------
    ValueError, RecursionError
        A part is missing, too large, or does not match the header.
    """
    header: Header
    if len(parts) == 1 and not parts[0].startswith(b"frame/"):
        header = packed = _unpack(parts[0])
        performer, buffer = packed.performer, packed.data
    else:
        topic, described, buffer = parts
        performer = _performer(topic)
        if len(described) > MAX_HEADER:
            raise ValueError(f"header: expected at most {MAX_HEADER} bytes, got {len(described)}")
        header = _read_header(described)
    dtype = _TYPES[header.dtype]
    expected = 3 * header.shape[0] * dtype.itemsize
    if len(buffer) != expected:
        raise ValueError(f"positions: expected {expected} bytes, got {len(buffer)}")
    frame = Frame(performer, header.t or arrival, np.frombuffer(buffer, dtype).reshape(header.shape))
    announcement = None if header.joints is None else Announcement(performer, tuple(header.joints))
    return NumberedFrame(frame, header.seq, announcement)


@lru_cache(maxsize=1024)
def _performer(topic: bytes) -> str:
    if len(topic) > _MAX_TOPIC:
        raise ValueError(f"topic: expected at most {_MAX_TOPIC} bytes, got {len(topic)}")
    kind, _, rest = topic.decode().partition("/")
    if kind != "frame" or not rest.endswith("/"):
        raise ValueError("topic: expected frame/<performer>/")
    return rest[:-1]


def encode_frame(frame: Frame, seq: int, joints: Sequence[str] | None = None) -> list[bytes]:
    """Encode a frame as float32; with the joint names in the first frame and whenever they change."""
    positions = np.ascontiguousarray(frame.positions, dtype="<f4")
    header: dict[str, object] = {"v": VERSION, "seq": seq, "t": frame.time, "shape": positions.shape, "dtype": "<f4"}
    if joints is not None:
        header["joints"] = joints
    return [f"frame/{frame.performer}/".encode(), msgspec.json.encode(header), positions.tobytes()]


class SequenceGaps:
    """Counts, per performer, the numbered frames that never came."""

    def __init__(self) -> None:
        self._last: dict[str, int] = {}
        self.missing = 0

    def see(self, performer: str, seq: int | None) -> None:
        """Take note of a number.

        A number that does not follow its predecessor leaves a gap. A number shortly below the newest comes late and
        fills a gap; 0, or a number far below, means that the sender began again.
        """
        if seq is None:
            return
        last = self._last.get(performer, seq - 1)
        if 0 < seq < last <= seq + _MAX_LATE:
            self.missing = max(0, self.missing - 1)
            return
        if seq > last:
            self.missing += seq - last - 1
        remember(self._last, performer, seq, _MAX_PERFORMERS)


#: Digits of a class's score.
_SCORE_DIGITS = 6
_encode = msgspec.json.Encoder().encode


_read = msgspec.json.Decoder(Answer).decode


def _topic(kind: str, performer: str) -> bytes:
    """Name a performer's messages; without a further / in it, or `class/ann/` would ask for those of `ann/x`, too."""
    return f"{kind}/{performer.replace('%', '%25').replace('/', '%2F')}/".encode()


def encode_recognition(recognition: Recognition) -> list[bytes]:
    """Encode an answer: its class, its scores, and the leading eigenvector's numbers.

    `class` is the named class or null and `index` its index or -1, `guess` the best guess or null and `guess_index` its
    index or -1; `so_far` the class that the last seconds are nearest to.
    """
    scores = [round(score, _SCORE_DIGITS) for score in recognition.scores.tolist()]
    names, second = (*recognition.classes, None), recognition.second_index
    answer = {
        "v": VERSION,
        "performer": recognition.performer,
        "t": float(recognition.time),
        "class": names[recognition.class_index],
        "guess": names[recognition.guess_index],
        "index": recognition.class_index,
        "guess_index": recognition.guess_index,
        "so_far": names[recognition.so_far],
        "outcome": recognition.outcome.value,
        "score": recognition.score,
        "runner_up": names[second],
        "margin": recognition.margin,
        "scores": dict(zip(recognition.classes, scores, strict=True)),
        "movement": float(recognition.movement),
        "share": float(recognition.share),
        "gap": float(recognition.gap),
        "eigenvector_class": recognition.eigenvector_class,
        "eigenvector_score": float(recognition.eigenvector_score),
        "doubted": recognition.doubted,
        "progress": recognition.progress and _described(recognition.progress),
    }
    return [_topic("class", recognition.performer), _encode(answer)]


def decode_answer(parts: Sequence[bytes]) -> Answer | None:
    """Decode a recognition, for programs that listen to the answers; None for any other message."""
    try:
        topic, encoded = parts
        return _read(encoded) if topic.startswith(b"class/") else None
    except (ValueError, RecursionError):
        return None


#: What is told of a performer who has left.
_NOTHING = {"class": None, "guess": None, "index": -1, "guess_index": -1, "so_far": None, "score": 0.0, "margin": 0.0}
#: The names of fields on the wire, where they are others.
_WIRE = {"label": "class", "class_name": "class", "kind": "event", "time": "t"}


def encode(message: object, *, named: bool = True) -> list[bytes] | None:
    """Encode whatever a service has to say; None for what is not sent, as frames.

    Parameters
    ----------
    message
        What happened to a performer is told below the name of its class, by the names of its fields.
    named
        Whether the listeners of a status may know the names of performers and senders.
    """
    match message:
        case Recognition():
            return encode_recognition(message)
        case State() | Taught():
            # A file's name may be no text that UTF-8 has.
            return [b"teach/", json.dumps(as_json(message)).encode()]
        case Classes(names):
            topic, told = b"classes/", dict[str, object](classes=names)
        case Status():
            topic, told = b"status/", _of_status(message, named=named)
        case Gone(performer):
            topic, told = _topic("class", performer), {"performer": performer, "outcome": GONE, **_NOTHING}
        case Event() | Done():
            topic, told = _topic(type(message).__name__.lower(), message.performer), _described(message)
        case _:
            return None
    return [topic, _encode({"v": VERSION, **told})]


def _described(answer: Progress | Event | Done) -> dict[str, object]:
    return {_WIRE.get(name, name): value for name, value in asdict(answer).items()}


def _of_status(status: Status, *, named: bool) -> dict[str, object]:
    """Give every counter."""
    told = {"alive": True, **asdict(status), "followed": len(status.performers)}
    if not named:
        told |= {"performers": {}, "refused": {}, "doubted": {}, "compared": {}, "notes": [], "listening": []}
    return told | {"frames_per_second": status.frames_per_second, "lost": status.lost, "health": status.health}


class BodyHeader(msgspec.Struct, omit_defaults=True):
    """The fields that describe a body; None for a field that is as it was in the message before."""

    v: int
    t: float
    joints: _Joints
    names: tuple[str, ...] | None = None
    parents: tuple[int, ...] | None = None
    carried: tuple[float, ...] | None = None
    pairs: tuple[tuple[int, int], ...] | None = None


_read_body = msgspec.json.Decoder(BodyHeader).decode


def encode_body(frame: Frame, skeleton: Skeleton | None = None, carried: Carried | None = None) -> list[bytes]:
    """Encode a frame's positions, and perhaps its skeleton and the joints that carry the decision."""
    header = BodyHeader(VERSION, float(frame.time), len(frame.positions))
    if skeleton and len(skeleton.joints) == header.joints:
        header.names, header.parents = skeleton.joints, skeleton.parents
    if carried and len(carried.joints) == header.joints:
        header.carried, header.pairs = carried.joints, carried.pairs
    return [_topic("body", frame.performer), _encode(header), frame.positions.astype("<f4").tobytes()]


def decode_body(parts: Sequence[bytes]) -> tuple[str, BodyHeader, bytes] | None:
    """Decode a body: the performer, the header, the positions' bytes; None for any other message."""
    try:
        topic, encoded, positions = parts
        header = _read_body(encoded)
        kind, _, performer = topic.decode().partition("/")
    except (ValueError, RecursionError):
        return None
    if kind != "body" or len(positions) != 12 * header.joints:
        return None
    described = (header.names, header.parents, header.carried)
    if any(each is not None and len(each) != header.joints for each in described):
        return None
    ends = [*(header.parents or ()), *(joint for pair in header.pairs or () for joint in pair)]
    if any(not -1 <= joint < header.joints for joint in ends):
        return None
    return unquote(performer.removesuffix("/")), header, positions
