"""Where packets come in: a port or a subscription, and what every transport's endpoint can do."""

from __future__ import annotations

from collections.abc import Sequence
from ipaddress import IPv4Network, IPv6Network
from typing import Protocol

#: A datagram, or the parts of a ZeroMQ message.
Packet = bytes | list[bytes]
#: Addresses that are let in; empty for all.
Networks = Sequence[IPv4Network | IPv6Network]
#: Host and port of who sent a packet; None where the transport does not tell.
Sender = tuple[str, int] | None
#: Before the name of a sender who has shown a key that is let in; it stands in a host's place.
KEYED = "key "


def parts_of(packet: Packet) -> list[bytes]:
    """Give a packet's parts; a datagram is one part."""
    return [packet] if isinstance(packet, bytes) else packet


def datagram_of(packet: Packet) -> bytes:
    """Give the bytes of a datagram, or the last part of a message; empty for a message without parts."""
    return packet if isinstance(packet, bytes) else packet[-1] if packet else b""


class Receiver(Protocol):
    """Where packets come in. Its text names it for people, like `OSC 127.0.0.1:9310`."""

    @property
    def socket(self) -> object:
        """The socket, which `zmq.Poller` can wait for."""

    @property
    def place(self) -> str:
        """The address as recordings name it: the transport, a blank and the address."""

    @property
    def sender(self) -> Sender:
        """The sender of the last packet."""

    @property
    def waited(self) -> float:
        """Seconds for which the last packet waited in the system; 0 where the transport does not tell."""

    @property
    def kernel_drops(self) -> int:
        """Packets that the system threw away because they came faster than they were received."""

    def broken(self) -> int:
        """Count the connections that broke while the sender was there; to be asked about once a second."""

    def receive(self) -> Packet | None:
        """Take the next packet; None when there is none now."""

    def close(self) -> None:
        """Give the address back."""
