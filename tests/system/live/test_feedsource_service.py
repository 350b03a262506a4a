"""A feed in the service: work that is due by the clock is done although no packet comes."""

from __future__ import annotations

import math
import socket
from contextlib import closing
from typing import TYPE_CHECKING

from golden import LAYOUTS, Moment
from programs import LOOPBACK, small_library

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.inputs import OscDecoder, Source
from kinespace.stream.inputs.feed_source import FeedSource
from kinespace.stream.osc import OscReceiver
from kinespace.stream.recognizer import LiveSignature, Performers, Settings
from kinespace.stream.service.loop import Service

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def test_the_last_frame_is_not_kept_waiting(played: NDArray[np.float32]) -> None:
    """A last frame is closed by time, and reaches its recogniser without another packet; our own frames are whole."""
    now = [100.0]
    # A whole frame would be closed by its last joint.
    packets = LAYOUTS["osceleton"][1](Moment(dict(zip(SKELETON.joints, played[0], strict=True)), 1.0, 0))[:-1]
    source = FeedSource(OscReceiver(LOOPBACK, 0), builtin_preset("osceleton"))
    # The paper's signature has nothing to learn.
    settings = Settings(signature=LiveSignature.PAPER)
    performers = Performers(small_library().restricted_to(source.preset.joints), settings)
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
        Service(performers, [source], [], clock=lambda: now[0]) as service,
    ):
        for packet in packets:
            sender.sendto(packet, source.receiver.address)
        while source.counts.received < len(packets):
            service.step(0.05)
        assert performers.counts.recognizers.frames == 0
        now[0] += 0.05
        service.step(0.0)
        assert performers.counts.recognizers.frames == 1
        assert (performers.names, performers.counts.other_joints) == (("1",), 0)
    with closing(Source(OscReceiver(LOOPBACK, 0), OscDecoder())) as ours:
        assert source.tended_within < ours.tended_within == math.inf
