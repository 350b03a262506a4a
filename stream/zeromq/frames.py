"""Frames as ZeroMQ messages, of several parts or of one: bytes in, frames out, and back.

`[b"frame/<performer>/"][JSON header][raw little-endian floats]`. The header holds `v` (1), `seq`, `t` seconds, `shape`
[joints, 3], `dtype` "<f4" or "<f8", and `joints` (names) in the first frame and whenever they change.

Senders that cannot send several parts, or whose sockets keep only the newest message (CONFLATE) and so lose all parts
but the last, send a msgpack map: the header's fields, `performer`, and the positions as `data`.

Topics end in a slash because subscriptions match by their first bytes: `frame/p1` would match `frame/p10` too.
Nothing is unpickled. msgspec checks a header's fields and their bounds while it reads them, and the size of the
positions is checked before they are used.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, NamedTuple

import msgspec
import numpy as np

from kinespace.stream.frame import MAX_PERFORMER_LENGTH, Announcement, Frame

VERSION = 1
#: Bytes of a header; one with 31 joint names has 500.
MAX_HEADER = 65_536
_TYPES: dict[str, np.dtype[np.floating]] = {name: np.dtype(name) for name in ("<f4", "<f8")}
_MAX_JOINTS = 4096
#: The highest sequence number.
MAX_SEQ = 2**63 - 1
#: Bytes of a topic: the longest name that a performer may have, in UTF-8.
_MAX_TOPIC = len(b"frame//") + 4 * MAX_PERFORMER_LENGTH
#: A number this far behind the newest is still a late frame, not a new beginning.
_MAX_LATE = 16
_MAX_PERFORMERS = 1024


class Header(msgspec.Struct):
    """The fields that describe a frame's positions; msgspec refuses values of other types and beyond the bounds."""

    v: int
    shape: tuple[int, int]
    dtype: str
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


class FormatError(ValueError):
    """A ZeroMQ message is not one of ours; the message says why."""


def decode(parts: Sequence[bytes], arrival: float) -> NumberedFrame:
    """Decode one multipart message.

    Parameters
    ----------
    parts
        Topic, header and positions.
    arrival
        Seconds: the time of frames whose `t` is missing or 0.

    Raises
    ------
    FormatError
        A part is missing, too large, or does not match the header.
    """
    try:
        topic, header, buffer = parts
        performer = _performer(topic)
        if len(header) > MAX_HEADER:
            raise FormatError(f"header: expected at most {MAX_HEADER} bytes, got {len(header)}")
        return numbered(performer, _read_header(header), buffer, arrival)
    except (ValueError, RecursionError) as error:
        raise FormatError(str(error)) from error


def numbered(performer: str, header: Header, buffer: bytes, arrival: float) -> NumberedFrame:
    """Make a frame of positions and their header.

    Parameters
    ----------
    performer
        The performer's name.
    header
        The description of the positions.
    buffer
        The positions.
    arrival
        Seconds: the time of frames whose `t` is missing or 0.

    Raises
    ------
    ValueError
        The version is another, or the positions do not match the header.
    """
    if header.v != VERSION:
        raise FormatError(f"v: expected version {VERSION}, got {header.v}")
    joints, axes = header.shape
    if not 0 < joints <= _MAX_JOINTS or axes != 3:
        raise FormatError(f"shape: expected 1 to {_MAX_JOINTS} joints and 3 axes, got {[joints, axes]}")
    dtype = _TYPES.get(header.dtype)
    if dtype is None:
        raise FormatError(f"dtype: expected <f4 or <f8, got {header.dtype[:32]!r}")
    if len(buffer) != joints * 3 * dtype.itemsize:
        raise FormatError(f"positions: expected {joints * 3 * dtype.itemsize} bytes, got {len(buffer)}")
    frame = Frame(performer, header.t or arrival, np.frombuffer(buffer, dtype).reshape(joints, 3))
    announcement = None if header.joints is None else Announcement(performer, tuple(header.joints))
    return NumberedFrame(frame, header.seq, announcement)


@lru_cache(maxsize=1024)
def _performer(topic: bytes) -> str:
    if len(topic) > _MAX_TOPIC:
        raise FormatError(f"topic: expected at most {_MAX_TOPIC} bytes, got {len(topic)}")
    kind, _, rest = topic.decode().partition("/")
    if kind != "frame" or not rest.endswith("/"):
        raise FormatError("topic: expected frame/<performer>/")
    return rest[:-1]


def encode_frame(frame: Frame, seq: int, joints: Sequence[str] | None = None) -> list[bytes]:
    """Encode a frame as float32; with the joint names in the first frame and whenever they change."""
    positions = np.ascontiguousarray(frame.positions, dtype="<f4")
    header: dict[str, object] = {"v": VERSION, "seq": seq, "t": frame.time, "shape": positions.shape, "dtype": "<f4"}
    if joints is not None:
        header["joints"] = joints
    return [f"frame/{frame.performer}/".encode(), msgspec.json.encode(header), positions.tobytes()]


def decode_packed(payload: bytes, arrival: float) -> NumberedFrame:
    """Decode a frame in one msgpack map.

    Parameters
    ----------
    payload
        The message's only part.
    arrival
        Seconds: the time of frames whose `t` is missing or 0.

    Raises
    ------
    FormatError
        The payload is no msgpack, or not a frame of ours.
    """
    try:
        packed = _unpack(payload)
        return numbered(packed.performer, packed, packed.data, arrival)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"msgpack: {error}") from error


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
        if performer not in self._last and len(self._last) >= _MAX_PERFORMERS:
            self._last.clear()  # only a sender that makes up names gets here
        self._last[performer] = seq
