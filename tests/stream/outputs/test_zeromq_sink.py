"""What ZeroMQ sinks publish: every message of the service, and thirty bodies a second."""

import json

import numpy as np
import pytest
from synthetic import STICK, stick_clip

from kinespace.library.skeleton import Skeleton
from kinespace.stream import zeromq
from kinespace.stream.frame import Frame
from kinespace.stream.outputs import ZmqSink
from kinespace.stream.outputs.zeromq_sink import BodySink
from kinespace.stream.recognition import Done, Event, EventKind, Outcome, Recognition
from kinespace.stream.recognizer.joints.carried import Carried
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.status import InputCounts, Status
from kinespace.stream.teaching import State, Step
from kinespace.stream.zeromq import messages as zeromq_answers

POSE = stick_clip("bow").positions[0]
CARRIED = Carried((1.0, *[0.0] * (len(POSE) - 1)), ((0, 1), (0, 2)))


class Sender:
    """Keeps what is sent."""

    failed = 3

    def __init__(self) -> None:
        self.sent: list[list[bytes]] = []
        self.closed = False

    def __str__(self) -> str:
        return "ZeroMQ here"

    def send(self, parts: list[bytes]) -> None:
        """Keep a message."""
        self.sent.append(parts)

    def close(self) -> None:
        """Note it."""
        self.closed = True


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


def test_everything_is_published() -> None:
    """Answers, events, classes, notices and the status are sent as they are encoded, with names unless told not to."""
    sender, open_to_all = Sender(), Sender()
    sink = ZmqSink(sender)  # type: ignore[arg-type]  # not all of a sender is used
    answer = Recognition("ann", 1.0, Outcome.NAMED, ("bow",), np.ones(1), 0.1)
    event = Event("ann", EventKind.START, "bow", 0, 0.5, 1.0)
    done = Done("ann", "bow", 0, 0.0, 1.0, 0.9, 1.0, 1.0, 2)
    status = Status(InputCounts(), PerformerCounts(), 0, {"ann": 30.0}, 0.0, 0.0)
    sink.publish(answer)
    sink.publish_event(event)
    sink.publish_done(done)
    sink.publish_gone("ann")
    sink.publish_classes(("bow",))
    sink.publish_status(status)
    sink.publish_notice(State("ann", Step.WAITING))
    assert sender.sent == [
        zeromq.encode_recognition(answer),
        zeromq_answers.encode_event(event),
        zeromq_answers.encode_done(done),
        zeromq_answers.encode_gone("ann"),
        zeromq_answers.encode_classes(("bow",)),
        zeromq_answers.encode_status(status),
        [b"teach/", b'{"performer": "ann", "state": "waiting", "seconds": 0.0}'],
    ]
    ZmqSink(open_to_all, named=False).publish_status(status)  # type: ignore[arg-type]  # as above
    assert open_to_all.sent == [zeromq_answers.encode_status(status, named=False)]
    sink.close()
    assert (str(sink), sink.failed, sender.closed) == ("ZeroMQ here", 3, True)


@pytest.mark.parametrize("rate", [20.0, 30.0, 50.0, 60.0, 119.88, 240.0])
def test_at_most_thirty_bodies_are_sent_a_second(rate: float) -> None:
    """Of any feed at most thirty frames a second, more than twenty; the second and every thirtieth with the joints."""
    sender = Sender()
    sink = BodySink(sender, Anybody())  # type: ignore[arg-type]  # only `send` is called
    for index in range(round(3 * rate)):
        sink.publish_frame(Frame("ann", 1.0 + index / rate, POSE))
    assert 3 * 20 <= len(sender.sent) <= 3 * 30 + 1
    headers = [json.loads(parts[1]) for parts in sender.sent]
    assert ["names" in header for header in headers] == [number % 30 == 1 for number in range(len(headers))]
    assert ["carried" in header for header in headers] == [number % 5 == 0 for number in range(len(headers))]
    assert str(sink) == "ZeroMQ here (bodies)"


def test_a_sender_that_begins_anew_is_shown_at_once() -> None:
    """When the times go back, and when a performer has left or was forgotten among many, the next frame is sent."""
    sender = Sender()
    sink = BodySink(sender, Anybody())  # type: ignore[arg-type]  # only `send` is called
    for moment, count in ((100.0, 1), (1.0, 2), (1.001, 2), (1.05, 3)):
        sink.publish_frame(Frame("ann", moment, POSE))
        assert len(sender.sent) == count
    sink.publish_gone("ann")
    sink.publish_frame(Frame("ann", 1.051, POSE))
    assert len(sender.sent) == 4
    for number in range(255):
        sink.publish_frame(Frame(f"{number}", 1.0, POSE))
    for name in ("ann", "one more", "ann"):
        sink.publish_frame(Frame(name, 1.052, POSE))
    assert len(sender.sent) == 4 + 255 + 2
