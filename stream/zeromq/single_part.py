"""ZeroMQ messages of one part: a msgpack map or an OSC packet, for senders that cannot send several parts.

Sockets that keep only the newest message (CONFLATE) lose all parts but the last; Bonsai and others send OSC packets
unchanged. The map has the fields of a frame's header (`kinespace.stream.zeromq.frames`), `performer`, and the positions
as `data`.
"""

from __future__ import annotations

import msgspec

from kinespace.stream.zeromq.frames import FormatError, Header, NumberedFrame, numbered

#: First bytes of msgpack maps: of up to 15 fields, and of more.
_MAPS = frozenset([*(bytes([0x80 + fields]) for fields in range(16)), b"\xde", b"\xdf"])


class Packed(Header, kw_only=True):
    """A header with the performer and the positions."""

    performer: str
    data: bytes


_unpack = msgspec.msgpack.Decoder(Packed).decode


def is_osc(payload: bytes) -> bool:
    """Say whether a payload is an OSC packet: a map begins with another byte."""
    return payload.startswith((b"/", b"#bundle\0"))


def is_map(payload: bytes) -> bool:
    """Say whether a payload begins as a msgpack map does."""
    return payload[:1] in _MAPS


def decode(payload: bytes, arrival: float) -> NumberedFrame:
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
