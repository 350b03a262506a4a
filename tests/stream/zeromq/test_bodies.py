"""Bodies on the wire: what is encoded is decoded, thirty are sent a second, and rubbish is never a body."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from synthetic import STICK, stick_clip

from kinespace.stream.frame import Frame
from kinespace.stream.outputs.zeromq_sink import BodySink
from kinespace.stream.recognizer.joints.carried import Carried

if TYPE_CHECKING:
    from kinespace.library.skeleton import Skeleton

POSE = stick_clip("bow").positions[0]
JOINTS = len(POSE)
CARRIED = Carried((1.0, *[0.0] * (JOINTS - 1)), ((0, 1), (0, 2)))


class Sender:
    """Keeps what is sent."""

    def __init__(self) -> None:
        self.sent: list[list[bytes]] = []

    def send(self, parts: list[bytes]) -> None:
        """Keep a message."""
        self.sent.append(parts)


class Anybody:
    """Performers of whom everything is known."""

    def skeleton_of(self, name: str) -> Skeleton:
        """Give the stick's."""
        assert name
        return STICK

    def carried(self, name: str) -> Carried:
        """Give the same each time."""
        assert name
        return CARRIED


@pytest.mark.parametrize("rate", [20.0, 30.0, 50.0, 60.0, 119.88, 240.0])
def test_at_most_thirty_are_sent_a_second(rate: float) -> None:
    """Of any feed at most thirty frames a second are sent, and more than twenty; joints' names about once a second."""
    sender = Sender()
    sink = BodySink(sender, Anybody())  # type: ignore[arg-type]  # only `send` is called
    for index in range(round(3 * rate)):
        sink.publish_frame(Frame("ann", 1.0 + index / rate, POSE))
    assert 3 * 20 <= len(sender.sent) <= 3 * 30 + 1
    headers = [json.loads(parts[1]) for parts in sender.sent]
    assert 2 <= sum("names" in header for header in headers) <= 4
    assert 9 <= sum("carried" in header for header in headers) <= 20


def test_a_sender_that_begins_anew_is_shown_at_once() -> None:
    """When the times go back the next frame is sent, not only one after the last."""
    sender = Sender()
    sink = BodySink(sender, Anybody())  # type: ignore[arg-type]  # only `send` is called
    for moment in (100.0, 1.0, 1.001, 1.05):
        sink.publish_frame(Frame("ann", moment, POSE))
    assert len(sender.sent) == 3
    sink.publish_gone("ann")
    sink.publish_frame(Frame("ann", 1.051, POSE))
    assert len(sender.sent) == 4
