"""ZeroMQ messages of one part: a msgpack map or an OSC packet, for senders that cannot send several parts.

Sockets that keep the newest message only (CONFLATE) lose all parts but the last; Bonsai and others send OSC packets as
they are. The map has the fields of `stream.zeromq`'s header, and with them `performer` and the positions as `data`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgpack
import numpy as np

from kinespace.stream import zeromq

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.frame import Frame
    from kinespace.stream.receiver import MessageReceiver
    from kinespace.stream.zeromq import NumberedFrame


#: First bytes of msgpack maps: of up to 15 fields, and of more.
_MAPS = frozenset([*(bytes([0x80 + fields]) for fields in range(16)), b"\xde", b"\xdf"])


def is_osc(payload: bytes) -> bool:
    """Say whether a payload is an OSC packet: a map begins with another byte."""
    return payload.startswith((b"/", b"#bundle\0"))


def is_map(payload: bytes) -> bool:
    """Say whether a payload begins as a msgpack map does; anything else is somebody else's."""
    return payload[:1] in _MAPS


def decode(payload: bytes, arrival: float) -> NumberedFrame:
    """Decode a frame in one msgpack map.

    Parameters
    ----------
    payload
        The message's only part.
    arrival
        When, seconds: the time of frames whose `t` is missing or 0.

    Raises
    ------
    FormatError
        It is no msgpack, or not a frame of ours.
    """
    try:
        described = msgpack.unpackb(payload)
    except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException) as error:
        raise zeromq.FormatError(f"msgpack: {error}") from error
    if not isinstance(described, dict):
        raise zeromq.FormatError("msgpack: expected a map")
    performer, buffer = described.get("performer"), described.get("data")
    if not isinstance(performer, str) or not isinstance(buffer, bytes):
        raise zeromq.FormatError("performer, data: expected text and bytes")
    return zeromq.decode_described(performer, described, buffer, arrival)


def encode(frame: Frame, seq: int, joints: Sequence[str] | None = None) -> bytes:
    """Encode a frame as one msgpack map, positions as float32; with the joint names when they are to be told."""
    positions = np.ascontiguousarray(frame.positions, dtype="<f4")
    described: dict[str, object] = {
        "v": zeromq.VERSION,
        "performer": frame.performer,
        "seq": seq,
        "t": frame.time,
        "shape": list(positions.shape),
        "dtype": "<f4",
        "data": positions.tobytes(),
    }
    if joints is not None:
        described["joints"] = list(joints)
    packed: bytes = msgpack.packb(described)
    return packed


class ZmqPackets:
    """OSC packets out of ZeroMQ messages, in the place of a UDP port: the last part of each is the packet.

    Parameters
    ----------
    receiver
        Where messages come in.
    """

    def __init__(self, receiver: MessageReceiver) -> None:
        self._receiver = receiver
        self.socket = receiver.socket
        #: ZeroMQ does not say who sent, nor what it lost.
        self.sender: tuple[str, int] | None = None
        self.kernel_drops = 0

    @property
    def address(self) -> tuple[str, int]:
        """The endpoint's host and port, as far as it has them."""
        host, _, port = self._receiver.address.rpartition(":")
        return host, int(port) if port.isdigit() else 0

    def broken(self) -> int:
        """Count the connections that broke while the sender was there; to be asked about once a second."""
        return self._receiver.broken()

    def receive(self) -> bytes | None:
        """Take the next packet; None when there is none now."""
        parts = self._receiver.receive()
        return parts[-1] if parts else None

    def send_to(self, datagram: bytes, target: tuple[str, int]) -> bool:  # noqa: ARG002 - as a UDP port has it
        """Send nothing: what comes by ZeroMQ cannot be asked for by OSC."""
        return False

    def close(self) -> None:
        """Give the address back."""
        self._receiver.close()
