"""Frames and answers as WebSocket messages: pure functions between them and ZeroMQ's messages.

A frame is text, one JSON object: `performer`, `positions` (a list of [x, y, z] or {x, y, z} in metres for each joint,
null for what is lost), and perhaps `t` (seconds; 0 or none: the arrival) and `joints` (names, in the first frame and
when they change); or binary, the msgpack map of ZeroMQ. An answer is text: ZeroMQ's JSON with its topic as `type`; an
error is, too, for the client whose frame cannot be read.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from kinespace.stream.zeromq.frames import VERSION


class _Place(msgspec.Struct):
    """A joint's place by its axes."""

    x: float | None
    y: float | None
    z: float | None


class _Sent(msgspec.Struct):
    """A frame as a browser sends it."""

    performer: str
    positions: list[tuple[float | None, float | None, float | None] | _Place | None]
    t: float | None = None
    joints: list[str] | None = None


#: The place of a joint that is lost.
_NOWHERE = (None, None, None)
_read = msgspec.json.Decoder(_Sent).decode


def packed(message: str | bytes) -> tuple[bytes, str]:
    """Give a frame as ZeroMQ's msgpack map; anything else as it is: the recogniser counts it.

    Returns
    -------
    The bytes, and the reason why they are no frame, as the client is told it; empty for a frame.
    """
    if isinstance(message, bytes):
        return message, ""
    try:
        sent = _read(message)
    except (ValueError, RecursionError) as error:
        told = msgspec.json.encode({"type": "error", "text": f"no frame is read: {error}"}).decode()
        return message.encode(errors="replace"), told
    places = [(each.x, each.y, each.z) if isinstance(each, _Place) else each or _NOWHERE for each in sent.positions]
    with np.errstate(over="ignore"):
        positions = np.array(places, dtype=np.float64).astype("<f4").reshape(-1, 3)
    header = {"v": VERSION, "performer": sent.performer, "t": sent.t or 0.0, "shape": positions.shape, "dtype": "<f4"}
    joints = {} if sent.joints is None else {"joints": sent.joints}
    return msgspec.msgpack.encode(header | joints | {"data": positions.tobytes()}), ""


def as_text(parts: Sequence[bytes]) -> str:
    """Give one of the recogniser's messages, topic and JSON, as one JSON object."""
    kind = parts[0].partition(b"/")[0]
    return (b'{"type":"' + kind + b'",' + parts[1].removeprefix(b"{")).decode()
