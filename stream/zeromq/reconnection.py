"""A subscriber's broken connections: counted, and made again.

ZeroMQ ends a connection when a message above the size limit comes, and only its monitor hears of it. A sender that
connected to us comes back by itself, without that message. A sender that we connected to does not: ZeroMQ takes the
refused message for another protocol, and gives the connection up.
"""

from __future__ import annotations

import struct
import time
from contextlib import suppress
from typing import TYPE_CHECKING

import zmq

if TYPE_CHECKING:
    from kinespace.stream.zeromq.address import Endpoint

#: Seconds after which ZeroMQ, which tries again after a tenth of a second, has certainly tried again.
_A_WHILE = 0.5
#: The beginning of a monitor's message. pyzmq's own reader loads asyncio, which takes long.
_EVENT = struct.Struct("=H")
_WATCHED = zmq.EVENT_ACCEPTED | zmq.EVENT_CONNECTED | zmq.EVENT_CONNECT_RETRIED | zmq.EVENT_DISCONNECTED


class Connections:
    """Watches a subscriber's connections.

    Parameters
    ----------
    socket
        A socket that is bound or connected already.
    endpoint
        Its endpoint, which says whether it is bound or connected.

    Attributes
    ----------
    broken
        Connections that broke while the sender was still there: by a message above the size limit, a network that
        failed for a moment, or a sender that began again within a second.
    """

    def __init__(self, socket: zmq.Socket[bytes], endpoint: Endpoint) -> None:
        self.broken = 0
        self._socket = socket
        self._endpoint = endpoint
        self._events = socket.get_monitor_socket(_WATCHED)
        #: Connections that ended since the last call, and since the call before: a sender, or ZeroMQ, may take that
        #: long to come back.
        self._gone = self._gone_before = 0
        self._looked = time.monotonic()

    def look(self) -> int:
        """Note what has happened, about once a second; give the number of broken connections so far."""
        if self._socket.closed:
            return self.broken
        now = time.monotonic()
        if now >= self._looked + _A_WHILE:
            self._looked, self._gone_before, self._gone = now, self._gone, 0
        while self._events.poll(0):
            told, *_ = self._events.recv_multipart()
            self._note(_EVENT.unpack_from(told)[0])
        if not self._endpoint.bind and self._gone_before:
            # ZeroMQ would have tried again by now. Its own attempts are not counted as losses: the sender had gone.
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
