"""A message made to block the service: passed over, and counted."""

from __future__ import annotations

import time
from contextlib import closing

import numpy as np
import zmq
from programs import LOOPBACK, PATIENCE

from kinespace.stream import Frame, zeromq
from kinespace.stream.inputs import Source, ZmqDecoder
from kinespace.stream.zeromq import Endpoint, ZmqReceiver


def test_a_message_of_a_hundred_thousand_parts_is_passed_over() -> None:
    """It is thrown away a little at a time, and frames before and after it are read."""
    receiver, publisher = (
        ZmqReceiver(Endpoint(f"tcp://{LOOPBACK}:*", bind=True)),
        zmq.Context.instance().socket(zmq.XPUB),
    )
    publisher.linger, events, until = 0, [], time.monotonic() + PATIENCE
    publisher.set_hwm(0)
    with closing(publisher), closing(Source(receiver, ZmqDecoder())) as source:
        publisher.connect(receiver.address)
        while not publisher.poll(10):
            source.take(0.0)
        publisher.send_multipart(zeromq.encode_frame(Frame("ann", 1.0, np.ones((5, 3))), 0))
        publisher.send_multipart([b"x"] * 100_000)
        publisher.send_multipart(zeromq.encode_frame(Frame("ann", 1.01, np.ones((5, 3))), 1))
        while source.counts.received < 3 and time.monotonic() < until:
            events += source.take(1.0) or ()
        assert ([event.time for event in events], source.counts.foreign) == ([1.0, 1.01], 1)
