"""Receiving answers: every packet, with its receiver and its time."""

from __future__ import annotations

import time
from contextlib import closing

import pytest

from kinespace.stream import osc
from kinespace.tools.loopback.answer_listener import Listener


def test_every_packet_is_received_in_order_with_its_moment(stage: osc.OscReceiver) -> None:
    """Datagrams that wait are all collected, in order, each with the receiver it came in on and when it was taken."""
    listener, before = Listener(stage), time.perf_counter()
    with closing(osc.OscSender(*stage.address)) as sender:
        for number in range(20):
            sender.send(b"%d" % number)
        received = listener.listen_until(before + 0.02)
        after = time.perf_counter()
        assert [each.packet for each in received] == [b"%d" % number for number in range(20)]
        assert all(each.receiver is stage for each in received)
        arrivals = [each.arrival for each in received]
        assert [before, *arrivals, after] == sorted([before, *arrivals, after])
        # A moment that is past is not waited for, but what waits is taken.
        assert listener.listen_until(0.0) == []
        sender.send(b"late")
        assert [each.packet for each in listener.listen_until(0.0)] == [b"late"]


@pytest.mark.parametrize("seconds", [0.0003, 0.003, 0.03])
def test_listening_lasts_until_the_moment(stage: osc.OscReceiver, seconds: float) -> None:
    """Without a packet, listening ends when the moment has come and not before."""
    moment = time.perf_counter() + seconds
    assert Listener(stage).listen_until(moment) == []
    assert time.perf_counter() >= moment
