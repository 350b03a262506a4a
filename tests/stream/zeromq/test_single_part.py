"""ZeroMQ messages of one part: msgpack and OSC, believed no more than others."""

import msgpack
import numpy as np
import singlepart
from golden import message

from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.inputs import ZmqDecoder


def test_msgpack_and_osc_come_in_beside_three_parts() -> None:
    """One decoder reads all three; gaps in the numbers are counted over all, and other messages are counted."""
    decoder, frames = ZmqDecoder(), [Frame("p", 1.0 + number, np.ones((3, 3), np.float32)) for number in range(3)]
    packets = [
        zeromq.encode_frame(frames[0], 0),
        [singlepart.encode(frames[1], 3, ("a", "b", "c"))],
        [osc.encode_frame(frames[2])],
        *([each] for each in (b"junk", b"/junk", message("/elsewhere"), b"", msgpack.packb({"v": 1}))),
    ]
    events = [event for packet in packets for event in decoder.decode(packet, 5.0, None)]
    assert [event.time for event in events if isinstance(event, Frame)] == [1.0, 2.0, 3.0]
    assert [event for event in events if isinstance(event, Announcement)] == [Announcement("p", ("a", "b", "c"))]
    counts = decoder.counts
    assert (counts.received, counts.malformed, counts.foreign, counts.missing) == (8, 2, 3, 2)
