"""Hearing answers: every packet, with its receiver and its time."""

from __future__ import annotations

import time
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest
from programs import LOOPBACK

from kinespace.stream import osc
from kinespace.tools.loopback.answer_listener import Listener

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def opened() -> Iterator[ExitStack]:
    """Give a stack that closes what a test opens."""
    with ExitStack() as stack:
        yield stack


def osc_pair(opened: ExitStack) -> tuple[osc.OscReceiver, osc.OscSender]:
    """Open a UDP port and a sender to it."""
    receiver = osc.OscReceiver(LOOPBACK, 0)
    opened.callback(receiver.close)
    sender = osc.OscSender(*receiver.address)
    opened.callback(sender.close)
    return receiver, sender


def test_every_packet_is_heard_in_order_with_its_moment(opened: ExitStack) -> None:
    """Datagrams that wait are all collected, in order, each with the receiver it came in on and when it was taken."""
    receiver, sender = osc_pair(opened)
    listener = Listener(receiver)
    before = time.perf_counter()
    for number in range(20):
        sender.send(b"%d" % number)
    heard = listener.listen_until(before + 0.02)
    after = time.perf_counter()
    assert [each.packet for each in heard] == [b"%d" % number for number in range(20)]
    assert all(each.receiver is receiver for each in heard)
    arrivals = [each.arrival for each in heard]
    assert arrivals == sorted(arrivals)
    assert before <= arrivals[0] <= arrivals[-1] <= after


def test_waiting_packets_are_heard_even_when_late(opened: ExitStack) -> None:
    """Listening until a past moment still takes waiting packets, and does not wait for more."""
    receiver, sender = osc_pair(opened)
    listener = Listener(receiver)
    assert listener.listen_until(0.0) == []
    sender.send(b"late")
    assert [each.packet for each in listener.listen_until(0.0)] == [b"late"]


@pytest.mark.parametrize("seconds", [0.0003, 0.003, 0.03])
def test_listening_lasts_until_the_moment(opened: ExitStack, seconds: float) -> None:
    """Without a packet, listening ends when the moment has come and not before."""
    receiver, _ = osc_pair(opened)
    moment = time.perf_counter() + seconds
    assert Listener(receiver).listen_until(moment) == []
    assert time.perf_counter() >= moment
