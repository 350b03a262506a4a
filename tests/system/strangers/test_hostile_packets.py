"""Packets made to end, block or fill the service: refused by their size, counted, at a cost below 1 ms."""

from __future__ import annotations

import time
from contextlib import closing
from typing import TYPE_CHECKING

import zmq
from programs import LOOPBACK, PATIENCE
from synthetic import stick_clip

from kinespace.stream import Frame, Performers, zeromq
from kinespace.stream.inputs import Source, ZmqDecoder
from kinespace.stream.service.loop import Service
from kinespace.stream.zeromq import Endpoint, ZmqReceiver

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary


def test_a_message_of_a_hundred_thousand_parts_is_passed_over(sticks: MotionLibrary) -> None:
    """It is thrown away a little at a time, and frames before and after it are recognised."""
    receiver = ZmqReceiver(Endpoint(f"tcp://{LOOPBACK}:*", bind=True))
    source = Source(receiver, ZmqDecoder())
    positions = stick_clip("wave", seed=51, frames=2).positions
    publisher = zmq.Context.instance().socket(zmq.XPUB)
    publisher.linger = 0
    publisher.set_hwm(0)
    with closing(publisher), Service(Performers(sticks), [source], []) as service:
        publisher.connect(receiver.address)
        while not publisher.poll(10):
            service.step(0.01)
        publisher.send_multipart(zeromq.encode_frame(Frame("ann", 1.0, positions[0]), 0))
        publisher.send_multipart([b"x"] * 100_000)
        publisher.send_multipart(zeromq.encode_frame(Frame("ann", 1.01, positions[1]), 1))
        until = time.monotonic() + PATIENCE
        while service.status().outcomes.recognizers.frames < 2 and time.monotonic() < until:
            service.step(0.01)
        inputs = service.status().inputs
    assert (service.status().outcomes.recognizers.frames, inputs.received, inputs.foreign) == (2, 3, 1)
