"""Connections of a ZeroMQ subscriber that break while the sender is still there: counted, and made again.

ZeroMQ ends a connection over which a message above the size limit comes, and tells nobody but who asks. A sender that
connected to us comes back by itself, less that message; one that we connected to does not, because ZeroMQ takes what it
refused for another protocol and gives it up for good.
"""

from __future__ import annotations

import time
from contextlib import suppress
from typing import TYPE_CHECKING

import zmq
from zmq.utils.monitor import recv_monitor_message

if TYPE_CHECKING:
    from stream.zeromq import Endpoint

#: Seconds after which ZeroMQ, which tries again after a tenth of one, has surely tried again if it ever does.
_A_WHILE = 0.5
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
            self._note(recv_monitor_message(self._events)["event"])
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
