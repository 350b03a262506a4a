"""A feed in the service: work that is due by the clock is done although no packet comes."""

from __future__ import annotations

import math
import socket
from typing import TYPE_CHECKING

import pytest
from golden import message

from kinespace.library import MotionLibrary
from kinespace.stream.feeds.preset import parse_preset
from kinespace.stream.inputs import OscDecoder, Source
from kinespace.stream.inputs.feed_source import FeedSource
from kinespace.stream.osc import OscReceiver
from kinespace.stream.recognizer import Performers
from kinespace.stream.service.loop import Service

if TYPE_CHECKING:
    from collections.abc import Iterator

LOOPBACK = "127.0.0.1"
TEXT = """
port = 1
rate = 30
[[message]]
address = "/{joint}"
arguments = ["x", "y", "z"]
[joints]
a = "root"
b = "head"
c = "lhand"
d = "rhand"
e = "lfoot"
"""


@pytest.fixture
def source() -> Iterator[FeedSource]:
    """Give a feed of five joints, on a port of its own."""
    opened = FeedSource(OscReceiver(LOOPBACK, 0), parse_preset(TEXT, "five", "five.toml"))
    yield opened
    opened.close()


def test_the_last_frame_is_not_kept_waiting(source: FeedSource) -> None:
    """A last frame is closed by time, and reaches its recogniser without another packet."""
    now = [100.0]
    library = MotionLibrary.builtin().restricted_to(source.preset.joints)
    performers = Performers(library)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        service = Service(performers, [source], [], clock=lambda: now[0])
        for name in "abcde":
            sender.sendto(message(f"/{name}", "fff", 1.0, 2.0, 3.0), source.receiver.address)
        while source.counts.received < 5:
            service.step(0.05)
        assert performers.counts.recognizers.frames == 0
        now[0] += 0.05
        service.step(0.0)
        assert performers.counts.recognizers.frames == 1
        assert (performers.names, performers.counts.other_joints) == (("five",), 0)


def test_only_feeds_are_tended(source: FeedSource) -> None:
    """Our own frames are whole: their sources have no work that is due by the clock."""
    assert source.tended_within < math.inf
    ours = Source(OscReceiver(LOOPBACK, 0), OscDecoder())
    assert ours.tended_within == math.inf
    ours.close()
