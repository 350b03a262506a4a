"""Receivers whose every packet is also written to a raw recording, before anybody makes sense of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, TypeVar

from kinespace.stream.rawfile import RawPacket
from kinespace.stream.receiver import MessageReceiver, PacketReceiver, Receiver
from kinespace.stream.service import TendedSource
from kinespace.stream.zeromq import ZmqReceiver

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.feeds import Preset
    from kinespace.stream.frame import Announcement, Frame
    from kinespace.stream.osc import OscReceiver
    from kinespace.stream.rawfile import RawWriter
    from kinespace.stream.service import Source
    from kinespace.stream.status import InputCounts

_Receiver = TypeVar("_Receiver", bound=Receiver[Any])


def described(receiver: OscReceiver | ZmqReceiver, preset: Preset | None = None) -> str:
    """Say where packets come in, and as whose they are read, as a raw recording's header does."""
    if isinstance(receiver, ZmqReceiver):
        place = f"zmq {receiver.address}"
    else:
        host, port = receiver.address
        place = f"osc {host}:{port}"
    return f"{place} feed {preset.name}" if preset else place


class Tap:
    """Writes what comes in at one place.

    Parameters
    ----------
    writer, index
        Where it is written, and which of the recording's sources it is.

    Attributes
    ----------
    arrival
        When the packet came that is received next, seconds: what its source is told, so that a rerun is told the same.
    """

    def __init__(self, writer: RawWriter, index: int) -> None:
        self.arrival = 0.0
        self._writer = writer
        self._index = index

    def keep(self, parts: Sequence[bytes], sender: tuple[str, int] | None = None) -> None:
        """Write one packet."""
        named = f"{sender[0]}:{sender[1]}" if sender else ""
        self._writer.write(RawPacket(self.arrival, self._index, named, tuple(parts)))


class _Tapped(Generic[_Receiver]):
    """A receiver's place: what comes in there is kept, and passed on.

    Parameters
    ----------
    receiver
        Where it comes in.
    tap
        Keeps it.
    """

    def __init__(self, receiver: _Receiver, tap: Tap) -> None:
        self._receiver = receiver
        self._tap = tap

    @property
    def socket(self) -> object:
        """What `zmq.Poller` can wait for."""
        return self._receiver.socket

    def broken(self) -> int:
        """Count the connections that broke."""
        return self._receiver.broken()

    def close(self) -> None:
        """Give the address back."""
        self._receiver.close()


class TappedPackets(_Tapped[PacketReceiver]):
    """A UDP port's place."""

    @property
    def kernel_drops(self) -> int:
        """Datagrams the system threw away."""
        return self._receiver.kernel_drops

    @property
    def sender(self) -> tuple[str, int] | None:
        """Who sent the last packet."""
        return self._receiver.sender

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""
        return self._receiver.address

    def receive(self) -> bytes | None:
        """Take the next packet, and keep it."""
        packet = self._receiver.receive()
        if packet is not None:
            self._tap.keep((packet,), self._receiver.sender)
        return packet

    def send_to(self, datagram: bytes, target: tuple[str, int]) -> bool:
        """Send from the port."""
        return self._receiver.send_to(datagram, target)


class TappedMessages(_Tapped[MessageReceiver]):
    """A subscription's place."""

    @property
    def address(self) -> str:
        """The endpoint."""
        return self._receiver.address

    def receive(self) -> list[bytes] | None:
        """Take the next message, and keep it."""
        parts = self._receiver.receive()
        if parts is not None:
            self._tap.keep(parts)
        return parts


class TappedSource:
    """A source on a tapped receiver, that tells the tap when each packet came.

    Parameters
    ----------
    source
        Closed by `close`.
    tap
        Of its receiver.
    """

    def __init__(self, source: Source, tap: Tap) -> None:
        self._source = source
        self._tap = tap

    def __str__(self) -> str:
        return str(self._source)

    @property
    def pollable(self) -> object:
        """The socket."""
        return self._source.pollable

    @property
    def counts(self) -> InputCounts:
        """What came in so far."""
        return self._source.counts

    def take(self, arrival: float) -> Sequence[Frame | Announcement] | None:
        """Take in one packet, and keep it."""
        self._tap.arrival = arrival
        return self._source.take(arrival)

    def tend(self, now: float) -> Sequence[Frame | Announcement]:
        """Do what the source has to do even when nothing comes."""
        return self._source.tend(now) if isinstance(self._source, TendedSource) else ()

    def close(self) -> None:
        """Close the socket."""
        self._source.close()
