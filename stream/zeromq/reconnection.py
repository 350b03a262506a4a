"""A subscriber's broken connections: counted, and made again.

ZeroMQ ends a connection when a message above the size limit comes, and only its monitor hears of it. A sender that
connected to us comes back by itself, without that message. A sender that we connected to does not: ZeroMQ takes the
refused message for another protocol, and gives the connection up.
"""

from __future__ import annotations

import time
from contextlib import suppress
from typing import TYPE_CHECKING

import zmq

from kinespace.stream.zeromq.peers import UNREAD, Peers

if TYPE_CHECKING:
    from kinespace.stream.zeromq.address import Endpoint

#: Seconds after which ZeroMQ, which tries again after a tenth of a second, has certainly tried again.
_A_WHILE = 0.5


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
    peers
        The connections that there are now.
    """

    def __init__(self, socket: zmq.Socket[bytes], endpoint: Endpoint) -> None:
        self._broken = 0
        self._socket = socket
        self._endpoint = endpoint
        self.peers = Peers(socket, UNREAD)
        #: Connections that ended since the last call, and since the call before: a sender, or ZeroMQ, may take that
        #: long to come back.
        self._gone = self._gone_before = 0
        self._looked = time.monotonic()

    @property
    def broken(self) -> int:
        """Count the connections that broke while the sender was still there, and those that were shut down.

        They break by a message above the size limit, by a network that fails for a moment, or when a sender begins
        again within a second.
        """
        return self._broken + self.peers.shut

    def look(self) -> None:
        """Note the changes of connections; call it whenever `peers.is_due`."""
        now = time.monotonic()
        if now >= self._looked + _A_WHILE:
            self._looked, self._gone_before, self._gone = now, self._gone, 0
        for event in self.peers.look():
            self._note(event)
        if not self._endpoint.bind and self._gone_before:
            # ZeroMQ would have tried again by now. Its own attempts are not counted as losses: the sender had gone.
            self._broken += 1
            self._gone_before = 0
            with suppress(zmq.ZMQError):
                self._socket.disconnect(self._endpoint.address)
            self._socket.connect(self._endpoint.address)

    def _note(self, event: int) -> None:
        if event == zmq.EVENT_DISCONNECTED:
            self._gone += 1
        elif self._endpoint.bind:
            if event == zmq.EVENT_ACCEPTED and self._gone + self._gone_before:
                self._broken += 1
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
        self.peers.close()
