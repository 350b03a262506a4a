"""Answers as OSC datagrams, in the layout of the program that listens."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from kinespace.stream.outputs.sink import Sink

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.osc.udp import OscReceiver
    from kinespace.stream.outputs.layouts import Layout
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.status import Status
    from kinespace.stream.teaching.notices import Notice


class AnswerSender(Protocol):
    """Where datagrams go. Its text names the place for people."""

    failed: int

    def send(self, datagram: bytes) -> None:
        """Send one; a failure is counted, never raised."""

    def close(self) -> None:
        """Give sockets back."""


class ReplySender:
    """Sends to the sender of the last frame, from the port it sent to.

    Parameters
    ----------
    receiver
        The port frames come in on; not closed here.
    port
        Where on the sender's host; 0 for the port it sent from.
    """

    def __init__(self, receiver: OscReceiver, port: int) -> None:
        self._receiver = receiver
        self._port = port
        self.failed = 0

    def __str__(self) -> str:
        return f"the sender{f':{self._port}' if self._port else ''}"

    def send(self, datagram: bytes) -> None:
        """Send one datagram; nothing is sent before anything came."""
        if self._receiver.sender is None:
            return
        host, port = self._receiver.sender
        self.failed += not self._receiver.send_to(datagram, (host, self._port or port))

    def close(self) -> None:
        """Nothing to close: the socket is the receiver's."""


class LayoutSink(Sink):
    """Sends answers in some program's layout to one place.

    Parameters
    ----------
    layout
        How the program wants to be told.
    sender
        Where to; closed by `close`.
    """

    def __init__(self, layout: Layout, sender: AnswerSender) -> None:
        self.layout = layout
        self.sender = sender

    def __str__(self) -> str:
        return f"{self.layout.name} {self.sender}"

    @property
    def failed(self) -> int:  # type: ignore[override]  # the sender counts
        """Answers that the system would not take."""
        return self.sender.failed

    def publish(self, recognition: Recognition) -> None:
        """Send one recognition."""
        self._send(self.layout.recognition(recognition))

    def publish_event(self, event: Event) -> None:
        """Send one event."""
        self._send(self.layout.event(event))

    def publish_gone(self, performer: str) -> None:
        """Send that a performer has left."""
        self._send(self.layout.gone(performer))

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Send the class names."""
        self._send(self.layout.classes(classes))

    def publish_status(self, status: Status) -> None:
        """Send the status."""
        self._send(self.layout.status(status))

    def publish_notice(self, notice: Notice) -> None:
        """Send what teaching tells."""
        self._send(self.layout.notice(notice))

    def _send(self, packet: bytes | None) -> None:
        if packet is not None:
            self.sender.send(packet)

    def close(self) -> None:
        """Close the socket."""
        self.sender.close()
