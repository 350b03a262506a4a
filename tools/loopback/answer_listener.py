"""The answers of a recogniser, or of an echo, with the moment at which each packet came in."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, NamedTuple

import zmq

from kinespace.stream import osc, zeromq
from kinespace.tools.cli.interruption import check_interrupted

if TYPE_CHECKING:
    from kinespace.stream.recognition import Answer
    from kinespace.tools.feeding.feed import Packet

#: The poller counts milliseconds; the rest of a millisecond is slept in pieces of these seconds.
_SHORT_SLEEP = 5e-5
#: Milliseconds of the longest wait: the program ends within this time.
_MAX_WAIT = 100

Receiver = osc.OscReceiver | zeromq.ZmqReceiver


class Received(NamedTuple):
    """A packet, the receiver it came in on, and the `time.perf_counter` reading when it did."""

    receiver: Receiver
    packet: Packet
    arrival: float


class Listener:
    """Waits for packets on UDP ports and ZeroMQ endpoints.

    Parameters
    ----------
    receivers
        Where packets come in; closed by `close`.
    """

    def __init__(self, *receivers: Receiver) -> None:
        self._receivers = receivers
        self._poller = zmq.Poller()
        for receiver in receivers:
            self._poller.register(receiver.socket, zmq.POLLIN)

    def listen_until(self, moment: float) -> list[Received]:
        """Collect packets until a `time.perf_counter` reading; at least once, even when that is past."""
        received = list[Received]()
        while True:
            check_interrupted()
            remaining = moment - time.perf_counter()
            if self._poller.poll(min(_MAX_WAIT, max(0, int(remaining * 1000)))):
                for receiver in self._receivers:
                    while (packet := receiver.receive()) is not None:
                        received.append(Received(receiver, packet, time.perf_counter()))
            elif remaining <= 0:
                return received
            elif remaining < 1e-3:
                time.sleep(min(remaining, _SHORT_SLEEP))

    def close(self) -> None:
        """Give the sockets back."""
        for receiver in self._receivers:
            receiver.close()


def answer_in(packet: Packet) -> Answer | None:
    """Read the answer in a packet; None for other packets."""
    return osc.decode_answer(packet) if isinstance(packet, bytes) else zeromq.decode_answer(packet)
