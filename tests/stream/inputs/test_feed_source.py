"""Feeds whose senders are asked: the messages for a sender, their times, and their port; what comes is counted."""

import math
import socket
from collections.abc import Iterator
from contextlib import contextmanager

from golden import message

from kinespace.stream import Frame
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.feeds.preset import parse_preset
from kinespace.stream.inputs.source import SILENCE, FeedSource, is_due
from kinespace.stream.osc import OscReceiver, decode_packet
from kinespace.stream.osc.packet import Message

LOOPBACK, NEVER = "127.0.0.1", -math.inf


def test_the_handshake_is_repeated_only_while_nothing_comes() -> None:
    """Asked at once, then every two seconds while frames stay away, and not while they come."""
    asking = builtin_preset("qtm").asking
    assert asking
    assert is_due(asking, 100.0, NEVER, NEVER)
    assert not is_due(asking, 101.0, 100.0, NEVER)
    assert is_due(asking, 102.0, 100.0, NEVER)
    assert not is_due(asking, 200.0, 100.0, 200.0 - 0.9 * SILENCE)
    assert is_due(asking, 200.0, 100.0, 200.0 - 1.1 * SILENCE)
    kept_awake = builtin_preset("synapse").asking
    assert kept_awake
    assert is_due(kept_awake, 10.0, 8.0, 9.9)
    assert not is_due(kept_awake, 10.0, 8.1, 9.9)


@contextmanager
def asked_source(every: float = 2.0) -> Iterator[tuple[FeedSource, socket.socket]]:
    """Open a source that asks, and the socket of the one that is asked."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.bind((LOOPBACK, 0))
        sender.settimeout(5.0)
        port = sender.getsockname()[1]
        text = f"""
port = 1
[[message]]
address = "/{{joint}}"
arguments = ["x", "y", "z"]
[frame]
close = ["complete", "timeout"]
[ask]
port = {port}
every = {every}
while_silent = true
[[ask.message]]
address = "/please"
arguments = ["{{port}}", "to {{port}}", 1.5]
[[ask.farewell]]
address = "/bye"
[joints]
a = "root"
b = "head"
"""
        source = FeedSource(OscReceiver(LOOPBACK, 0), parse_preset(text, "asks", "asks.toml"))
        yield source, sender


def test_the_source_asks_from_its_own_port() -> None:
    """When tended, the source asks from the port that it listens on; it stops while frames come, and says goodbye."""
    with asked_source() as (source, sender):
        port = source.receiver.address[1]
        assert source.tend(0.0) == []
        packet, came_from = sender.recvfrom(1000)
        assert decode_packet(packet) == [Message("/please", [port, f"to {port}", 1.5])]
        assert came_from[1] == port
        for place, name in enumerate("ab"):
            sender.sendto(message(f"/{name}", "fff", 1.0, 2.0, 3.0 + place), came_from)
        made = [event for _ in range(2) for event in wait_for(source, 1.5)]
        assert [type(event) is Frame for event in made] == [False, True]
        source.tend(1.9)
        source.tend(2.2)
        sender.sendto(b"nothing in between", sender.getsockname())
        assert sender.recv(1000) == b"nothing in between"
        source.tend(4.5)
        assert decode_packet(sender.recv(1000))[0].address == "/please"
        source.close()
        assert decode_packet(sender.recv(1000))[0].address == "/bye"


def wait_for(source: FeedSource, arrival: float) -> list[object]:
    """Take in one datagram, waiting for it."""
    source.receiver.socket.settimeout(5.0)
    while (taken := source.take(arrival)) is None:
        pass
    return list(taken)
