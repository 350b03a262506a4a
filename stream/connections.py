"""ZeroMQ addresses, and the connections of a subscriber that break: counted, and made again.

ZeroMQ ends a connection over which a message above the size limit comes, and tells nobody but who asks. A sender that
connected to us comes back by itself, less that message; one that we connected to does not, because ZeroMQ takes what it
refused for another protocol and gives it up for good.
"""

from __future__ import annotations

import struct
import time
from contextlib import suppress
from typing import NamedTuple

import zmq

#: Bytes of a message above which ZeroMQ refuses it.
LARGEST_MESSAGE = 1 << 20
#: Messages waiting in a socket: eight seconds of a 120 Hz feed, then ZeroMQ itself begins to throw away.
_HIGH_WATER_MARK = 1000
#: Seconds of silence after which the system asks whether the other machine is still there, seconds between two more
#: questions, and how many go unanswered before the connection is made anew. A sender switched off or a cable pulled
#: says nothing, and ZeroMQ would wait for it for hours. Not ZeroMQ's own heartbeats: older peers know nothing of them.
_ASK_AFTER, _ASK_EVERY, _ASK_TIMES = 5, 1, 5
#: Seconds after which ZeroMQ, which tries again after a tenth of one, has surely tried again if it ever does.
_A_WHILE = 0.5
#: What a message of a monitor begins with. pyzmq's own reader of them loads asyncio, which takes longer than the rest.
_EVENT = struct.Struct("=H")
_WATCHED = zmq.EVENT_ACCEPTED | zmq.EVENT_CONNECTED | zmq.EVENT_CONNECT_RETRIED | zmq.EVENT_DISCONNECTED


class Endpoint(NamedTuple):
    """A ZeroMQ address, and whether to bind or to connect to it."""

    address: str
    bind: bool

    @classmethod
    def parse(cls, text: str, *, bind: bool) -> Endpoint:
        """Read an address; "@" before it says bind and ">" connect, as in CZMQ, else `bind` decides.

        Raises
        ------
        ValueError
            There is no transport in it, like `tcp://`.
        """
        address = text.lstrip("@>")
        if "://" not in address:
            raise ValueError(f"endpoint: expected an address like tcp://127.0.0.1:5556, got {text!r}")
        return cls(address, text.startswith("@") or (bind and not text.startswith(">")))

    def open(self, kind: int) -> zmq.Socket[bytes]:
        """Make a socket and bind or connect it.

        Raises
        ------
        OSError
            The address is taken, or makes no sense; the message says which address.
        """
        opened: zmq.Socket[bytes] = zmq.Context.instance().socket(kind)
        opened.linger = 0
        opened.set_hwm(_HIGH_WATER_MARK)
        opened.setsockopt(zmq.MAXMSGSIZE, LARGEST_MESSAGE)
        opened.setsockopt(zmq.TCP_KEEPALIVE, 1)
        opened.setsockopt(zmq.TCP_KEEPALIVE_IDLE, _ASK_AFTER)
        opened.setsockopt(zmq.TCP_KEEPALIVE_INTVL, _ASK_EVERY)
        opened.setsockopt(zmq.TCP_KEEPALIVE_CNT, _ASK_TIMES)
        try:
            if self.bind:
                opened.bind(self.address)
            else:
                opened.connect(self.address)
        except zmq.ZMQError as error:
            opened.close()
            raise OSError(error.errno, f"{self.address}: {error.strerror}") from error
        return opened


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
