"""ZeroMQ: frames in on a SUB socket, answers out on a PUB socket; pure functions first, then the two endpoints.

In:  `[b"frame/<performer>/"][JSON header][raw little-endian floats]`, the header holding `v` (1), `seq`, `t` seconds,
     `shape` [joints, 3], `dtype` "<f4" or "<f8", and `joints` (names) in the first frame and whenever they change.
Out: `[b"class/<performer>/"][JSON]`, `[b"event/<performer>/"][JSON]`, `[b"classes/"][JSON]`, `[b"status/"][JSON]`.

Topics end in a slash because subscriptions match by their first bytes: `frame/p1` would match `frame/p10` too.
Nothing is ever unpickled; types come from a list and sizes are checked before a buffer is looked at.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import zmq

from kinespace.stream.answer import Answer
from kinespace.stream.connections import Connections, Endpoint
from kinespace.stream.frame import LONGEST_PERFORMER, Announcement, Frame

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.status import Status

VERSION = 1
#: A header with 31 joint names is 500 bytes; a frame of 1000 joints in doubles 24 kB.
LARGEST_HEADER = 65_536
_TYPES: dict[str, np.dtype[np.floating]] = {name: np.dtype(name) for name in ("<f4", "<f8")}
_MOST_JOINTS = 4096
#: A topic of the longest name that a performer may have, in UTF-8.
_LONGEST_TOPIC = len(b"frame//") + 4 * LONGEST_PERFORMER
#: A header without joint names, its fields in the order documented: nearly all of them are, and json takes three times
#: as long. What this does not match json reads.
_PLAIN_HEADER = re.compile(
    rb'\{"v": ?1, ?"seq": ?(0|[1-9]\d*), ?"t": ?(-?(?:0|[1-9]\d*)(?:\.\d+)?(?:[eE][+-]?\d+)?), ?'
    rb'"shape": ?\[([1-9]\d*), ?3\], ?"dtype": ?"(<f[48])"\}'
)
_NOT_FINITE = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}
#: As plain integers: to combine or pass on pyzmq's own costs more than to send.
_NOW, _MORE_TO_COME = int(zmq.NOBLOCK), int(zmq.NOBLOCK | zmq.SNDMORE)
#: How far behind the newest a number may be and still be a late frame, not a new beginning.
_LATEST = 16
_MOST_PERFORMERS = 1024


class NumberedFrame(NamedTuple):
    """A frame with its sender's count and, when it says so, what its joints are."""

    frame: Frame
    seq: int | None
    announcement: Announcement | None


class FormatError(ValueError):
    """A ZeroMQ message is not one of ours."""


def decode(parts: Sequence[bytes], arrival: float) -> NumberedFrame:
    """Decode one multipart message.

    Parameters
    ----------
    parts
        Topic, header and positions.
    arrival
        When, seconds: the time of frames whose `t` is missing or 0.

    Raises
    ------
    FormatError
        A part is missing, too large or not what the header says.
    """
    try:
        topic, header, buffer = parts
        performer = _performer(topic)
        if len(header) > LARGEST_HEADER:
            raise FormatError(f"header: expected at most {LARGEST_HEADER} bytes, got {len(header)}")
        plain = _PLAIN_HEADER.fullmatch(header)
        if plain is None:
            return decode_described(performer, _header(header), buffer, arrival)
        seq, time, joints, kind = plain.groups()
        positions = _positions(int(joints), kind.decode(), buffer)
        return NumberedFrame(Frame(performer, float(time) or arrival, positions), int(seq), None)
    except (ValueError, RecursionError) as error:
        raise FormatError(str(error)) from error


def decode_described(performer: str, described: dict[str, Any], buffer: bytes, arrival: float) -> NumberedFrame:
    """Make a frame of positions and what is said of them.

    Parameters
    ----------
    performer
        Who.
    described
        The header's fields.
    buffer
        The positions.
    arrival
        When, seconds: the time of frames whose `t` is missing or 0.

    Raises
    ------
    FormatError
        A field is missing or wrong, or the positions are not what the fields say.
    """
    try:
        if described.get("v") != VERSION:
            raise FormatError(f"header: expected version {VERSION}")
        positions = _positions(_joint_count(described), described.get("dtype"), buffer)
        time = described.get("t", 0)
        joints = described.get("joints")
        seq = described.get("seq")
        if isinstance(time, bool) or not isinstance(time, (int, float)):
            raise FormatError(f"t: expected seconds, got {time!r}")
        if seq is not None and (isinstance(seq, bool) or not isinstance(seq, int) or seq < 0):
            raise FormatError(f"seq: expected a count, got {seq!r}")
        announcement = None if joints is None else _announcement(performer, joints)
        return NumberedFrame(Frame(performer, float(time) or arrival, positions), seq, announcement)
    except (ValueError, OverflowError, RecursionError) as error:
        raise FormatError(str(error)) from error


@lru_cache(maxsize=1024)
def _performer(topic: bytes) -> str:
    if len(topic) > _LONGEST_TOPIC:
        raise FormatError(f"topic: expected at most {_LONGEST_TOPIC} bytes, got {len(topic)}")
    kind, _, rest = topic.decode().partition("/")
    if kind != "frame" or not rest.endswith("/"):
        raise FormatError("topic: expected frame/<performer>/")
    return rest[:-1]


def _header(header: bytes) -> dict[str, Any]:
    # As text, for json takes longer to find out how bytes are encoded than to read them.
    described = json.loads(header.decode())
    if not isinstance(described, dict):
        raise FormatError("header: expected an object")
    return described


def _joint_count(described: dict[str, Any]) -> int:
    shape = described.get("shape")
    if not (isinstance(shape, list) and len(shape) == 2 and type(shape[0]) is int and shape[1] == 3):
        raise FormatError(f"shape: expected [joints, 3], got {shape!r}")
    return shape[0]


def _positions(joints: int, kind: object, buffer: bytes) -> np.ndarray[tuple[int, ...], np.dtype[np.floating]]:
    if not 0 < joints <= _MOST_JOINTS:
        raise FormatError(f"shape: expected 1 to {_MOST_JOINTS} joints, got {joints}")
    dtype = _TYPES.get(kind) if isinstance(kind, str) else None
    if dtype is None:
        raise FormatError(f"dtype: expected one of {tuple(_TYPES)}, got {kind!r}")
    if len(buffer) != joints * 3 * dtype.itemsize:
        raise FormatError(f"positions: expected {joints * 3 * dtype.itemsize} bytes, got {len(buffer)}")
    return np.frombuffer(buffer, dtype).reshape(joints, 3)


def _announcement(performer: str, joints: object) -> Announcement:
    if not isinstance(joints, list) or not all(isinstance(joint, str) for joint in joints):
        raise FormatError("joints: expected a list of names")
    return Announcement(performer, tuple(joints))


def encode_frame(frame: Frame, seq: int, joints: Sequence[str] | None = None) -> list[bytes]:
    """Encode a frame as float32; with the joint names in the first frame and whenever they change."""
    positions = np.ascontiguousarray(frame.positions, dtype="<f4")
    header: dict[str, object] = {"v": VERSION, "seq": seq, "t": frame.time, "shape": positions.shape, "dtype": "<f4"}
    if joints is not None:
        header["joints"] = list(joints)
    return [f"frame/{frame.performer}/".encode(), json.dumps(header).encode(), positions.tobytes()]


def encode_recognition(recognition: Recognition) -> list[bytes]:
    """Encode an answer: its class, scores, and what the leading eigenvector says.

    `class` is the named class or null, `guess` the best guess or null.
    """
    # What json.dumps would write, in a third of its time: of an answer only the numbers are ever new.
    scores = recognition.scores.tolist()
    if math.isfinite(sum(scores)):
        form, names = _answer_form(recognition.classes, "%.6f")
    else:
        form, names = _answer_form(recognition.classes, "%s")
        scores = [_number(round(score, 6)) for score in scores]
    second, guess = recognition.second_index, recognition.guess_index
    performer = recognition.performer
    answer = form % (
        _text(performer),
        _number(recognition.time),
        names[recognition.class_index],
        names[guess],
        guess,
        recognition.outcome.value,
        _number(recognition.score),
        names[second],
        _number(recognition.margin),
        *scores,
        _number(recognition.movement),
        _number(recognition.share),
        _number(recognition.gap),
        "null" if recognition.eigenvector_class is None else _text(recognition.eigenvector_class),
        _number(recognition.eigenvector_score),
        _names(recognition.doubted),
    )
    return [f"class/{performer}/".encode(), answer.encode()]


@lru_cache(maxsize=16)
def _answer_form(classes: tuple[str, ...], score: str) -> tuple[str, tuple[str, ...]]:
    """Give what stands between the numbers of every answer, and the classes' names as JSON, with null at -1."""
    names = tuple(map(_text, classes))
    scores = ", ".join(f"{name.replace('%', '%%')}: {score}" for name in names)
    form = (
        f'{{"v": {VERSION}, "performer": %s, "t": %s, "class": %s, "guess": %s, "index": %d, "outcome": "%s", '
        f'"score": %s, "runner_up": %s, "margin": %s, "scores": {{{scores}}}, '
        '"movement": %s, "share": %s, "gap": %s, "eigenvector_class": %s, "eigenvector_score": %s, '
        '"doubted": %s}'
    )
    return form, (*names, "null")


@lru_cache(maxsize=1024)
def _text(text: str) -> str:
    return json.dumps(text)


@lru_cache(maxsize=64)
def _names(names: tuple[str, ...]) -> str:
    return json.dumps(names)


def _number(number: float) -> str:
    """Write a number as json.dumps does."""
    written = float.__repr__(float(number))
    return _NOT_FINITE.get(written, written)


def encode_event(event: Event) -> list[bytes]:
    """Encode that a motion started or ended."""
    described = {
        "v": VERSION,
        "performer": event.performer,
        "event": event.kind,
        "class": event.label,
        "index": event.index,
        "score": event.score,
        "t": event.time,
    }
    return [f"event/{event.performer}/".encode(), json.dumps(described).encode()]


def decode_answer(parts: Sequence[bytes]) -> Answer | None:
    """Decode a recognition, for programs that listen to the answers; None for any other message."""
    try:
        topic, encoded = parts
        if not topic.startswith(b"class/"):
            return None
        answer = json.loads(encoded)
        return Answer(
            performer=str(answer["performer"]),
            class_index=int(answer["index"]),
            score=float(answer["score"]),
            margin=float(answer["margin"]),
            label=str(answer["class"] or answer["outcome"]),
        )
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError):
        return None


def encode_classes(classes: Sequence[str]) -> list[bytes]:
    """Encode the class names in the order their indices count."""
    return [b"classes/", json.dumps({"v": VERSION, "classes": list(classes)}).encode()]


def encode_status(status: Status) -> list[bytes]:
    """Encode every counter."""
    described = {"v": VERSION, "alive": True, **asdict(status)}
    described |= {"frames_per_second": status.frames_per_second, "lost": status.lost}
    return [b"status/", json.dumps(described).encode()]


class SequenceGaps:
    """Counts the frames a sender numbered and that never came, per performer."""

    def __init__(self) -> None:
        self._last: dict[str, int] = {}
        self.missing = 0

    def see(self, performer: str, seq: int | None) -> None:
        """Take note of a number.

        One that does not follow its predecessor leaves a gap. One shortly below it comes late and fills a gap; 0, or
        one far below, is a sender that began again.
        """
        if seq is None:
            return
        last = self._last.get(performer, seq - 1)
        if 0 < seq < last <= seq + _LATEST:
            self.missing = max(0, self.missing - 1)
            return
        if seq > last:
            self.missing += seq - last - 1
        if performer not in self._last and len(self._last) >= _MOST_PERFORMERS:
            self._last.clear()  # only somebody who makes up names gets here
        self._last[performer] = seq


class ZmqReceiver:
    """A SUB socket that frames come in on. Poll it continuously: a bound SUB takes in new peers only when polled."""

    def __init__(self, endpoint: Endpoint, topic: bytes = b"") -> None:
        self.socket = endpoint.open(zmq.SUB)
        self.socket.subscribe(topic)
        self._connections = Connections(self.socket, endpoint)

    @property
    def address(self) -> str:
        """The endpoint as bound or connected, its port resolved."""
        return str(self.socket.getsockopt_string(zmq.LAST_ENDPOINT))

    def broken(self) -> int:
        """Count the connections that broke while the sender was there; to be asked about once a second."""
        return self._connections.look()

    def receive(self) -> list[bytes] | None:
        """Take the next message; None when there is none now."""
        # The parts come together. Each says whether it is the last; to ask the socket would cost more than to receive.
        try:
            part = self.socket.recv(_NOW, copy=False)
        except zmq.Again:
            return None
        parts = [part.bytes]
        while part.more:
            part = self.socket.recv(_NOW, copy=False)
            parts.append(part.bytes)
        return parts

    def close(self) -> None:
        """Give the address back."""
        self._connections.close()
        self.socket.close()


class ZmqSender:
    """A PUB socket. Nobody listening is no error; a listener too slow loses the newest, which its `seq` shows."""

    def __init__(self, endpoint: Endpoint) -> None:
        self.socket = endpoint.open(zmq.PUB)
        self.failed = 0

    @property
    def address(self) -> str:
        """The endpoint as bound or connected, its port resolved."""
        return str(self.socket.getsockopt_string(zmq.LAST_ENDPOINT))

    def send(self, parts: Sequence[bytes]) -> None:
        """Send one message; a failure is counted, never raised."""
        *first, last = parts
        try:
            for part in first:
                self.socket.send(part, _MORE_TO_COME)
            self.socket.send(last, _NOW)
        except zmq.ZMQError:
            self.failed += 1

    def close(self) -> None:
        """Give the address back."""
        self.socket.close()
