"""Connections that fill memory are shut down: unfinished messages, subscriptions, and too many of one host."""

from __future__ import annotations

import socket
import sys
import time
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import numpy as np
import pytest
import zmq
from programs import LOOPBACK, PATIENCE

from kinespace.stream import zeromq
from kinespace.stream.frame import Frame
from kinespace.stream.zeromq import Endpoint, ZmqReceiver, ZmqSender, peers
from kinespace.stream.zeromq.peers import Allowance
from kinespace.tools.chaos import attacks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells how much a connection has sent")

ANY_PORT = Endpoint(f"tcp://{LOOPBACK}:*", bind=True)
#: A part of a message that is not its last: 250 kB.
PART = b"\x03" + (250_000).to_bytes(8, "big") + bytes(250_000)
FRAME = zeromq.encode_frame(Frame("ann", 1.0, np.zeros((3, 3))), 1)


@pytest.fixture(autouse=True)
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look at the connections all the time."""
    monkeypatch.setattr(peers, "LOOK_EVERY", 0.0)


@pytest.fixture
def opened() -> Iterator[ExitStack]:
    """Close what the test opens."""
    with ExitStack() as stack:
        yield stack


def wait_for(happened: Callable[[], object]) -> None:
    """Wait until something is true."""
    until = time.monotonic() + PATIENCE
    while not happened():
        assert time.monotonic() < until
        time.sleep(0.001)


def is_ended(peer: socket.socket) -> bool:
    """Say whether the other end has closed a connection."""
    peer.setblocking(False)  # noqa: FBT003 - the socket's own
    try:
        while peer.recv(4096):
            pass
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


def publisher_to(receiver: ZmqReceiver, opened: ExitStack) -> zmq.Socket[bytes]:
    """Connect a publisher, and wait until it is heard."""
    sender = opened.enter_context(zmq.Context.instance().socket(zmq.PUB))
    sender.linger = 0
    sender.connect(receiver.address)

    def heard() -> bool:
        sender.send_multipart(FRAME)
        return receiver.receive() is not None

    wait_for(heard)
    return sender


def test_a_message_that_does_not_end_is_cut_off(monkeypatch: pytest.MonkeyPatch, opened: ExitStack) -> None:
    """Its connection is shut down and counted; the other connection goes on."""
    monkeypatch.setattr("kinespace.stream.zeromq.reconnection.UNREAD", Allowance(1_000_000, 0, 4_000_000))
    receiver = opened.enter_context(closing(ZmqReceiver(ANY_PORT)))
    sender = publisher_to(receiver, opened)
    stranger = opened.enter_context(attacks._greeted(receiver.address, b"PUB"))  # noqa: SLF001 - as the attack does it
    stranger.settimeout(PATIENCE)

    def refused() -> bool:
        try:
            stranger.sendall(PART)
        except OSError:
            return True
        receiver.receive()
        return False

    wait_for(refused)
    assert receiver.broken() == 1
    wait_for(lambda: receiver.receive() is None)
    sender.send_multipart(FRAME)
    wait_for(receiver.receive)
    assert receiver.broken() == 1


def test_what_waits_when_its_sender_has_gone_has_still_its_sender(opened: ExitStack) -> None:
    """Messages that are read after their connection has ended are told to be of the same sender."""
    receiver = opened.enter_context(closing(ZmqReceiver(ANY_PORT)))
    sender = publisher_to(receiver, opened)
    known = receiver.sender
    sender.linger = 1000
    for _ in range(20):
        sender.send_multipart(FRAME)
    sender.close()
    wait_for(lambda: not receiver._connections.look() and not receiver._connections.peers._peers)  # noqa: SLF001 - gone
    while receiver.receive():
        assert receiver.sender == known
    assert known


def test_whole_messages_are_not_counted(monkeypatch: pytest.MonkeyPatch, opened: ExitStack) -> None:
    """A sender whose messages are read may send any number of bytes, also when something always waits."""
    monkeypatch.setattr("kinespace.stream.zeromq.reconnection.UNREAD", Allowance(200_000, 0, 200_000))
    receiver = opened.enter_context(closing(ZmqReceiver(ANY_PORT)))
    sender = publisher_to(receiver, opened)
    for size in (10, 40_000):
        for _ in range(30):
            sender.send_multipart([b"frame/ann/", b"x" * size, b"x" * size])
            sender.send_multipart([b"x"] * 20)
            wait_for(receiver.receive)
            wait_for(receiver.receive)
    assert receiver.broken() == 0


def test_subscriptions_without_end_are_cut_off(opened: ExitStack) -> None:
    """A subscriber with thousands of topics is ended and counted; one with some hears on."""
    sender = opened.enter_context(closing(ZmqSender(ANY_PORT)))
    listener = opened.enter_context(closing(ZmqReceiver(Endpoint(sender.address, bind=False), b"class/")))
    stranger = opened.enter_context(attacks._greeted(sender.address, b"SUB"))  # noqa: SLF001 - as the attack does it
    topics = b"".join(b"\0\x0a\x01%09d" % number for number in range(10_000))

    def ended() -> bool:
        sender.watch()
        return is_ended(stranger)

    stranger.sendall(topics[:12_000])
    for _ in range(3):
        assert not ended()
    stranger.setblocking(True)  # noqa: FBT003 - the socket's own
    stranger.sendall(topics)
    wait_for(ended)
    assert sender.shut == 1

    def heard() -> bool:
        sender.send([b"class/ann/", b"{}"])
        return listener.receive() is not None

    wait_for(heard)


def test_of_too_many_connections_the_silent_end_first(monkeypatch: pytest.MonkeyPatch, opened: ExitStack) -> None:
    """The oldest that never said that it speaks ZeroMQ makes room; connections that greeted stay."""
    monkeypatch.setattr(peers, "MAX_PER_HOST", 3)
    sender = opened.enter_context(closing(ZmqSender(ANY_PORT)))
    host, port = sender.address.removeprefix("tcp://").split(":")
    first = opened.enter_context(attacks._greeted(sender.address, b"SUB"))  # noqa: SLF001 - as the attack does it
    silent = [opened.enter_context(socket.create_connection((host, int(port)))) for _ in range(4)]

    def settled() -> bool:
        sender.watch()
        return sender.shut >= 2

    wait_for(settled)
    wait_for(lambda: is_ended(silent[0]) and is_ended(silent[1]))
    assert [is_ended(each) for each in (first, *silent[2:])] == [False] * 3
    assert sender.shut == 2


def test_connections_without_end_do_not_hold_up_the_loop(monkeypatch: pytest.MonkeyPatch, opened: ExitStack) -> None:
    """A look reads and shuts down a bounded number of connections; the following looks deal with the others."""
    monkeypatch.setattr(peers, "MAX_PER_HOST", 0)
    monkeypatch.setattr(peers, "_MAX_EVENTS", 4)
    monkeypatch.setattr(peers, "_MIN_SHUT", 2)
    sender = opened.enter_context(closing(ZmqSender(ANY_PORT)))
    host, port = sender.address.removeprefix("tcp://").split(":")
    for _ in range(10):
        opened.enter_context(socket.create_connection((host, int(port))))
    watched, before, most = sender._peers, 0, 0  # noqa: SLF001 - what one look does cannot be seen from outside

    def all_shut() -> bool:
        nonlocal before, most
        watched.look()
        assert len(watched.begun) <= 4
        before, most = sender.shut, max(most, sender.shut - before)
        return sender.shut == 10

    wait_for(all_shut)
    assert most == 2


def test_a_connection_that_has_just_ended_ends_nothing_else() -> None:
    """ZeroMQ may have closed a file before it tells: nothing came in on it, and nothing is raised."""
    with socket.socket() as ended:
        number = ended.fileno()
    assert peers._received(number) is None  # noqa: SLF001 - the moment cannot be arranged from outside
