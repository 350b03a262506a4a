"""Answers as OSC datagrams, in the layout of the program that listens."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinespace.stream.outputs.sink import Sink

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.inputs.admission import Admission
    from kinespace.stream.osc.udp import OscReceiver, OscSender
    from kinespace.stream.outputs.layouts import Layout
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.service.status import Status
    from kinespace.stream.teaching.notices import Notice


class LayoutSink(Sink):
    """Sends answers in some program's layout to one place.

    Parameters
    ----------
    layout
        The messages that the program understands.
    sender
        Where to send them; closed by `close`.
    """

    def __init__(self, layout: Layout, sender: OscSender) -> None:
        self.layout = layout
        self.sender = sender

    def __str__(self) -> str:
        return f"{self.layout.name} {self.sender}"

    @property
    def failed(self) -> int:  # type: ignore[override]  # the sender counts
        """Answers that refused by the system."""
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
        """Send a notice of teaching."""
        self._send(self.layout.notice(notice))

    def _send(self, packet: bytes | None) -> None:
        if packet is not None:
            self.sender.send(packet)

    def close(self) -> None:
        """Close the socket."""
        self.sender.close()


class ReplySink(Sink):
    """Sends each performer's answers to the performer's own sender, from the port it sent to.

    Messages that concern all performers go to all senders.

    Parameters
    ----------
    layout
        The messages that the senders understand.
    receiver
        The port on which frames come in; not closed here.
    port
        The port on the sender's host; 0 for the port it sent from.
    senders
        Knows the sender of each performer.
    """

    def __init__(self, layout: Layout, receiver: OscReceiver, port: int, senders: Admission) -> None:
        self.layout = layout
        self.failed = 0
        self._receiver = receiver
        self.port = port
        self._senders = senders

    def __str__(self) -> str:
        return f"{self.layout.name} the sender{f':{self.port}' if self.port else ''}"

    def publish(self, recognition: Recognition) -> None:
        """Send one recognition."""
        self._send(self.layout.recognition(recognition), self._senders.senders(recognition.performer))

    def publish_event(self, event: Event) -> None:
        """Send one event."""
        self._send(self.layout.event(event), self._senders.senders(event.performer))

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Send the class names."""
        self._send(self.layout.classes(classes), self._senders.senders())

    def publish_status(self, status: Status) -> None:
        """Send the status."""
        self._send(self.layout.status(status), self._senders.senders())

    def _send(self, packet: bytes | None, targets: Sequence[tuple[str, int]]) -> None:
        if packet is None:
            return
        for host, port in dict.fromkeys((host, self.port or port) for host, port in targets):
            self.failed += not self._receiver.send_to(packet, (host, port))
