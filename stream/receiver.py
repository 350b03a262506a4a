"""Where packets come in: what a source needs of it, and what every source does with it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from kinespace.stream.status import InputCounts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.frame import Announcement, Frame

_Packet = TypeVar("_Packet")
_Packet_co = TypeVar("_Packet_co", covariant=True)


class Receiver(Protocol[_Packet_co]):
    """Where packets come in: a port, a subscription, or what stands in its place."""

    @property
    def socket(self) -> object:
        """What `zmq.Poller` can wait for."""

    def broken(self) -> int:
        """Count the connections that broke while the sender was there; to be asked about once a second."""

    def receive(self) -> _Packet_co | None:
        """Take the next packet; None when there is none now."""

    def close(self) -> None:
        """Give the address back."""


class PacketReceiver(Receiver[bytes], Protocol):
    """Where OSC packets come in: a UDP port, or what stands in its place."""

    @property
    def kernel_drops(self) -> int:
        """Count the packets that the system threw away because they came faster than they were received."""

    @property
    def sender(self) -> tuple[str, int] | None:
        """Who sent the last packet, where that is known."""

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""

    def send_to(self, datagram: bytes, target: tuple[str, int]) -> bool:
        """Send from here; False when that cannot be."""


class MessageReceiver(Receiver[list[bytes]], Protocol):
    """Where ZeroMQ messages come in: a subscription, or what stands in its place."""

    @property
    def address(self) -> str:
        """The endpoint."""


class ReceivingSource(ABC, Generic[_Packet]):
    """What all sources have in common: packets are received and counted; what they hold, each kind of source knows.

    Parameters
    ----------
    receiver
        Where packets come in; closed by `close`.
    """

    def __init__(self, receiver: Receiver[_Packet]) -> None:
        self._received_at = receiver
        self._counts = InputCounts()

    @property
    def pollable(self) -> object:
        """The socket."""
        return self._received_at.socket

    @property
    def counts(self) -> InputCounts:
        """What came in so far."""
        self._counts.broken = self._received_at.broken()
        return self._counts

    def take(self, arrival: float) -> Sequence[Frame | Announcement] | None:
        """Take in one packet; what it held, in order, or None when nothing is waiting."""
        packet = self._received_at.receive()
        if packet is None:
            return None
        self._counts.received += 1
        return self._understood(packet, arrival)

    @abstractmethod
    def _understood(self, packet: _Packet, arrival: float) -> Sequence[Frame | Announcement]:
        """Make sense of a packet; what makes none is counted."""

    def close(self) -> None:
        """Close the socket."""
        self._received_at.close()
