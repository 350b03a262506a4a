"""ZeroMQ messages of one part: msgpack and OSC, believed no more than others, whole where several would be lost."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import msgpack
import numpy as np
import pytest
import singlepart
import zmq
from golden import message
from programs import LOOPBACK, PATIENCE

from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.inputs import Source, ZmqDecoder
from kinespace.stream.zeromq import Endpoint, ZmqReceiver, single_part

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

POSITIONS = np.random.default_rng(5).normal(size=(3, 3))


@pytest.fixture
def opened() -> Iterator[tuple[ZmqReceiver, Callable[[list[bytes]], None]]]:
    """Give a receiver and a sender to it that loses no message."""
    receiver = ZmqReceiver(Endpoint.parse(f"tcp://{LOOPBACK}:*", bind=True))
    publisher = zmq.Context.instance().socket(zmq.XPUB)
    publisher.linger = 0
    publisher.connect(receiver.address)
    receiver.socket.poll(200)
    assert publisher.poll(int(PATIENCE * 1000))
    publisher.recv()
    yield receiver, publisher.send_multipart
    publisher.close()
    receiver.close()


def taken(source: Source, count: int) -> list[Frame | Announcement]:
    """Take so many messages, waiting for them."""
    events: list[Frame | Announcement] = []
    until = time.monotonic() + PATIENCE
    while count and time.monotonic() < until:
        came = source.take(5.0)
        if came is None:
            time.sleep(0.001)
            continue
        events += came
        count -= 1
    assert not count
    return events


def test_msgpack_and_osc_come_in_beside_three_parts(
    opened: tuple[ZmqReceiver, Callable[[list[bytes]], None]],
) -> None:
    """One source reads all three; gaps in the numbers are counted over all, and other messages are counted."""
    receiver, send = opened
    source = Source(receiver, ZmqDecoder())
    frames = [Frame("p", 1.0 + number, POSITIONS.astype(np.float32)) for number in range(3)]
    send(zeromq.encode_frame(frames[0], 0))
    send([singlepart.encode(frames[1], 3, ("a", "b", "c"))])
    send([osc.encode_frame(frames[2])])
    send([b"junk"])
    send([b"/junk"])
    send([message("/elsewhere")])
    send([b""])
    send([msgpack.packb({"v": 1})])
    events = taken(source, 8)
    assert [event.time for event in events if isinstance(event, Frame)] == [1.0, 2.0, 3.0]
    assert [event for event in events if isinstance(event, Announcement)] == [Announcement("p", ("a", "b", "c"))]
    counts = source.counts
    assert (counts.received, counts.malformed, counts.foreign, counts.missing) == (8, 2, 3, 2)


def test_the_newest_of_one_part_survives_conflation() -> None:
    """A socket that keeps one message only gives the newest map whole: of three parts it would give the last alone."""
    receiver = zmq.Context.instance().socket(zmq.PULL)
    receiver.setsockopt(zmq.CONFLATE, 1)
    receiver.bind(f"tcp://{LOOPBACK}:*")
    sender = zmq.Context.instance().socket(zmq.PUSH)
    sender.linger = 0
    sender.connect(receiver.getsockopt_string(zmq.LAST_ENDPOINT))
    for number in range(20):
        sender.send(singlepart.encode(Frame("p", 1.0 + number, POSITIONS), number))
    until = time.monotonic() + PATIENCE
    seq = -1
    while seq != 19 and time.monotonic() < until:
        if receiver.poll(50):
            seq = single_part.decode(receiver.recv(), 0.0).seq or 0
    sender.close()
    receiver.close()
    assert seq == 19
