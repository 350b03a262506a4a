"""The connections of a ZeroMQ socket, each with the bytes that it has sent and that are not read yet.

libzmq bounds one part of a message. It keeps all parts of a message that is not finished, and every subscription, as
long as the connection lasts, without limit. Its monitor tells the file number of each connection, and Linux tells how
many bytes came in on it: a connection with too many unread bytes is shut down, which gives its memory back. On other
systems nothing is shut down.
"""

from __future__ import annotations

import math
import os
import socket
import struct
import sys
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import zmq

if TYPE_CHECKING:
    from collections.abc import Iterator

#: The beginning of a monitor's message: the event and its value. pyzmq's own reader loads asyncio, which takes long.
_EVENT = struct.Struct("=HI")
_WATCHED = zmq.EVENT_ACCEPTED | zmq.EVENT_CONNECTED | zmq.EVENT_CONNECT_RETRIED | zmq.EVENT_DISCONNECTED
#: Linux's report on a connection, and the place of the count of received bytes in it.
_TELLS = sys.platform == "linux"
_RECEIVED, _RECEIVED_AT = struct.Struct("=Q"), 128
#: Bytes before each part of a message, at most; with keys further bytes, which `Peers.read` leaves out: they are made
#: up for whenever nothing waits.
_FRAMING = 9
#: Bytes that a peer sends before its first message: a connection with fewer has not said that it speaks ZeroMQ.
_GREETING = 64
#: Connections of one host to one socket, at most.
MAX_PER_HOST = 256
#: Seconds between two looks at the connections; between two looks while events wait that the last one left.
LOOK_EVERY, _HURRY = 0.1, 0.01
#: Events that are read in one look, at most: a stranger who opens connections without end must not hold up the loop.
_MAX_EVENTS = 64
#: Of the connections that a host has too many, one in so many is shut down in one look, but so many at least: a
#: stranger opens them anew as fast as they are shut down, and there are files for 16,384.
_ONE_IN, _MIN_SHUT = 8, 16


class Allowance(NamedTuple):
    """The unread bytes that are allowed to a connection, further bytes each second, and to all connections together."""

    each: int
    per_second: int
    together: int


#: For frames, of which 8 MB are two minutes; and for subscriptions, of which 64 kB are some thousands, and which are
#: never read: heartbeats add up.
UNREAD = Allowance(8 << 20, 0, 32 << 20)
SUBSCRIBED = Allowance(1 << 16, 100, 8 << 20)


@dataclass(slots=True)
class _Peer:
    """A connection: its other end, when it began, and the bytes that it has sent and that were read."""

    host: str
    address: object
    begun: float
    #: Bytes that had come when nothing was unread, and bytes read since.
    settled: int = 0
    read: int = 0
    received: int = 0

    def unread(self, now: float, allowance: Allowance) -> float:
        """Give the bytes that came and were not read, without the bytes that are allowed by time."""
        return self.received - self.settled - self.read - (now - self.begun) * allowance.per_second


@dataclass(slots=True)
class Peers:
    """Watches the connections of a socket; call `look` whenever `is_due`.

    Attributes
    ----------
    watched
        The socket, bound or connected already.
    allowance
        The bytes that a connection may leave unread.
    shut
        Connections that were shut down.
    begun
        File numbers of the connections that `look` found to be new when it was last called.
    """

    watched: zmq.Socket[bytes]
    allowance: Allowance
    shut: int = 0
    begun: list[int] = field(default_factory=list)
    _events: zmq.Socket[bytes] = field(init=False)
    #: By file number.
    _peers: dict[int, _Peer] = field(default_factory=dict)
    #: File numbers of connections that were shut down and whose end ZeroMQ has not told yet.
    _ending: set[int] = field(default_factory=set)
    _drained: bool = False
    #: When the next look is due, and when the connections were examined last, by `time.monotonic`.
    _next: float = 0.0
    _examined: float = -math.inf

    def __post_init__(self) -> None:
        self._events = self.watched.get_monitor_socket(_WATCHED)

    def read(self, connection: int, parts: int, size: int) -> None:
        """Note that so many parts, of so many bytes together, were read from a connection."""
        peer = self._peers.get(connection)
        if peer:
            peer.read += size + parts * (_FRAMING if size > 255 * parts else 2)

    def drained(self) -> None:
        """Note that no whole message waits."""
        self._drained = True

    @property
    def is_due(self) -> bool:
        """Whether it is time for a look."""
        return time.monotonic() >= self._next

    def look(self) -> list[int]:
        """Shut down connections that leave too much unread; give the events since the last call, except its own.

        Events above a bounded number wait for the next look, which is due soon then.
        """
        if self.watched.closed:
            return []
        self.begun = []
        happened = list(islice(self._happened(), _MAX_EVENTS))
        told = [event for event, connection in happened if self._note(event, connection)]
        now = time.monotonic()
        more_wait = len(happened) == _MAX_EVENTS
        self._next = now + (min(_HURRY, LOOK_EVERY) if more_wait else LOOK_EVERY)
        if not more_wait or now - self._examined >= LOOK_EVERY:
            self._examined = now
            self._examine(now)
        return told

    def _examine(self, now: float) -> None:
        for connection, peer in [*self._peers.items()]:
            received = _received(connection)
            if received is None:
                del self._peers[connection]
                continue
            peer.received = received
            if self._drained and peer.read:
                peer.settled, peer.read = received, 0
        self._drained = False
        self._shut_greedy(now)
        self._shut_many()

    def _happened(self) -> Iterator[tuple[int, int]]:
        with suppress(zmq.Again):
            while True:
                told, _address = self._events.recv_multipart(zmq.NOBLOCK)
                yield _EVENT.unpack_from(told)

    def _note(self, event: int, connection: int) -> bool:
        """Note an event; say whether it is news to others."""
        if event in (zmq.EVENT_ACCEPTED, zmq.EVENT_CONNECTED):
            self._ending.discard(connection)
            if address := _other_end(connection):
                self.begun.append(connection)
                self._peers[connection] = _Peer(str(address[0]), address, time.monotonic())
        elif event == zmq.EVENT_DISCONNECTED:
            self._peers.pop(connection, None)
            if connection in self._ending:
                self._ending.remove(connection)
                return False
        return True

    def _shut_greedy(self, now: float) -> None:
        unread = {each: peer.unread(now, self.allowance) for each, peer in self._peers.items()}
        together = sum(unread.values())
        for connection in sorted(unread, key=lambda each: unread[each], reverse=True):
            if unread[connection] <= self.allowance.each and together <= self.allowance.together:
                return
            together -= unread[connection]
            self._shut(connection)

    def _shut_many(self) -> None:
        """Shut down connections of hosts with too many: first the oldest that have not greeted, then the newest."""
        counts = Counter(peer.host for peer in self._peers.values())
        for host, count in counts.items():
            if count > MAX_PER_HOST:
                of_host = [each for each, peer in self._peers.items() if peer.host == host]
                silent = [each for each in of_host if self._peers[each].received < _GREETING]
                others = [each for each in reversed(of_host) if self._peers[each].received >= _GREETING]
                excess = count - MAX_PER_HOST
                for connection in (*silent, *others)[: min(excess, max(excess // _ONE_IN, _MIN_SHUT))]:
                    self._shut(connection)

    def _shut(self, connection: int) -> None:
        """Shut a connection down, unless its file number is another's by now."""
        peer = self._peers.pop(connection)
        if _other_end(connection) == peer.address:
            with suppress(OSError), socket.socket(fileno=os.dup(connection)) as opened:
                opened.shutdown(socket.SHUT_RDWR)
                self.shut += 1
                self._ending.add(connection)

    def close(self) -> None:
        """Stop watching; before the socket is closed."""
        if not self.watched.closed:
            self.watched.disable_monitor()
        self._events.close()


def _other_end(connection: int) -> tuple[object, ...] | None:
    """Give the address of a connection's other end; None where it has none, or has ended."""
    try:
        with socket.socket(fileno=os.dup(connection)) as opened:
            address = opened.getpeername()
    except (OSError, ValueError):
        return None
    return tuple(address) if isinstance(address, tuple) else None


def _received(connection: int) -> int | None:
    """Give the bytes that came in on a connection; None where that is not known, or it has ended."""
    if not _TELLS:
        return None
    try:
        opened = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP, fileno=connection)
    except OSError:
        return None
    try:
        told = opened.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _RECEIVED_AT + _RECEIVED.size)
    except OSError:
        return None
    finally:
        # The file is ZeroMQ's to close.
        opened.detach()
    return int(_RECEIVED.unpack_from(told, _RECEIVED_AT)[0]) if len(told) >= _RECEIVED_AT + _RECEIVED.size else None
