"""Answers as ZeroMQ messages."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from kinespace.stream.outputs.sink import Sink
from kinespace.stream.teaching.wire import as_json
from kinespace.stream.zeromq import answers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.service.status import Status
    from kinespace.stream.teaching.notices import Notice
    from kinespace.stream.zeromq.sockets import ZmqSender


class ZmqSink(Sink):
    """Publishes on a ZeroMQ endpoint.

    Parameters
    ----------
    sender
        Where to publish; closed by `close`.
    named
        Whether the status names performers and senders; False where every program may listen.
    """

    def __init__(self, sender: ZmqSender, *, named: bool = True) -> None:
        self.sender = sender
        self._named = named

    def __str__(self) -> str:
        return str(self.sender)

    @property
    def failed(self) -> int:  # type: ignore[override]  # the sender counts
        """Answers that ZeroMQ would not take."""
        return self.sender.failed

    @property
    def notes(self) -> list[str]:  # type: ignore[override]  # the sender counts
        """Note the connections that were ended."""
        shut = self.sender.shut
        return [f"{self.sender}: {shut} connections ended, because they asked for too much"] if shut else []

    def watch(self) -> None:
        """End connections that subscribe to too much."""
        self.sender.watch()

    def publish(self, recognition: Recognition) -> None:
        """Send one recognition."""
        self.sender.send(answers.encode_recognition(recognition))

    def publish_event(self, event: Event) -> None:
        """Send one event."""
        self.sender.send(answers.encode_event(event))

    def publish_gone(self, performer: str) -> None:
        """Send that a performer has left."""
        self.sender.send(answers.encode_gone(performer))

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Send the class names."""
        self.sender.send(answers.encode_classes(classes))

    def publish_status(self, status: Status) -> None:
        """Send the status."""
        self.sender.send(answers.encode_status(status, named=self._named))

    def publish_notice(self, notice: Notice) -> None:
        """Send a notice of teaching."""
        told = as_json(notice)
        if told is not None:
            self.sender.send([b"teach/", json.dumps(told).encode()])

    def close(self) -> None:
        """Close the socket."""
        self.sender.close()
