"""What a source needs of the place where packets come in: a port, or what stands in its place."""

from __future__ import annotations

from typing import Protocol


class PacketReceiver(Protocol):
    """Where OSC packets come in: a UDP port, or what stands in its place."""

    kernel_drops: int

    @property
    def sender(self) -> tuple[str, int] | None:
        """Who sent the last packet, where that is known."""

    @property
    def socket(self) -> object:
        """What `zmq.Poller` can wait for."""

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""

    def receive(self) -> bytes | None:
        """Take the next packet; None when there is none now."""

    def broken(self) -> int:
        """Count the connections that broke while the sender was there; to be asked about once a second."""

    def send_to(self, datagram: bytes, target: tuple[str, int]) -> bool:
        """Send from here; False when that cannot be."""

    def close(self) -> None:
        """Give the address back."""


class MessageReceiver(Protocol):
    """Where ZeroMQ messages come in: a subscription, or what stands in its place."""

    @property
    def socket(self) -> object:
        """What `zmq.Poller` can wait for."""

    @property
    def address(self) -> str:
        """The endpoint."""

    def broken(self) -> int:
        """Count the connections that broke while the sender was there; to be asked about once a second."""

    def receive(self) -> list[bytes] | None:
        """Take the next message; None when there is none now."""

    def close(self) -> None:
        """Give the address back."""
