"""The connections of a subscriber that break: counted, and made again.

ZeroMQ ends a connection over which a message above the size limit comes, and tells only its monitor. A sender that
connected to us comes back by itself, less that message. A sender that we connected to does not: ZeroMQ takes the
message that it refused for another protocol, and gives the connection up for good.
"""

from __future__ import annotations

import struct
import time
from contextlib import suppress
from typing import TYPE_CHECKING

import zmq

if TYPE_CHECKING:
    from kinespace.stream.zeromq.address import Endpoint

#: Seconds after which ZeroMQ, which tries again after a tenth of one, has surely tried again if it ever does.
_A_WHILE = 0.5
#: The beginning of a monitor's message. pyzmq's own reader of them loads asyncio, which takes longer than the rest.
_EVENT = struct.Struct("=H")
_WATCHED = zmq.EVENT_ACCEPTED | zmq.EVENT_CONNECTED | zmq.EVENT_CONNECT_RETRIED | zmq.EVENT_DISCONNECTED


class Connections:
    """Watches a subscriber's connections.

    Parameters
    ----------
    socket
        Bound or connected already.
    endpoint
        To what, and which of the two.

    Attributes
    ----------
    broken
        Connections that broke while the sender was still there, up to the last look: over a message above the size
        limit, by a network that failed for a moment, or by a sender begun again within a second.
    """

    def __init__(self, socket: zmq.Socket[bytes], endpoint: Endpoint) -> None:
        self.broken = 0
        self._socket = socket
        self._endpoint = endpoint
        self._events = socket.get_monitor_socket(_WATCHED)
        #: Connections that ended in this while, and in the one before: that long a sender may take to come back, or
        #: ZeroMQ to try again.
        self._gone = self._gone_before = 0
        self._looked = time.monotonic()

    def look(self) -> int:
        """Take note of what has happened, about once a second; give how many have broken so far."""
        if self._socket.closed:
            return self.broken
        now = time.monotonic()
        if now >= self._looked + _A_WHILE:
            self._looked, self._gone_before, self._gone = now, self._gone, 0
        while self._events.poll(0):
            told, *_ = self._events.recv_multipart()
            self._note(_EVENT.unpack_from(told)[0])
        if not self._endpoint.bind and self._gone_before:
            # ZeroMQ would have tried again by now. What it tries it counts as nothing lost: the sender had gone.
            self.broken += 1
            self._gone_before = 0
            with suppress(zmq.ZMQError):
                self._socket.disconnect(self._endpoint.address)
            self._socket.connect(self._endpoint.address)
        return self.broken

    def _note(self, event: int) -> None:
        if event == zmq.EVENT_DISCONNECTED:
            self._gone += 1
        elif self._endpoint.bind:
            if event == zmq.EVENT_ACCEPTED and self._gone + self._gone_before:
                self.broken += 1
                self._forget_one()
        elif event in (zmq.EVENT_CONNECTED, zmq.EVENT_CONNECT_RETRIED):
            self._gone = self._gone_before = 0

    def _forget_one(self) -> None:
        if self._gone_before:
            self._gone_before -= 1
        else:
            self._gone -= 1

    def close(self) -> None:
        """Stop watching; before the socket is closed."""
        if not self._socket.closed:
            self._socket.disable_monitor()
        self._events.close()
