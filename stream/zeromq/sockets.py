"""ZeroMQ's two endpoints: a SUB socket for frames, and a PUB socket for answers."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from typing import TYPE_CHECKING

import zmq

from kinespace.stream.inputs.receiver import KEYED
from kinespace.stream.zeromq.peers import SUBSCRIBED, Peers
from kinespace.stream.zeromq.reconnection import Connections

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.inputs.receiver import Networks, Sender
    from kinespace.stream.zeromq.address import Endpoint
    from kinespace.stream.zeromq.keys import Keyring

#: Plain integers, because pyzmq's own flags are slow to combine and to pass on.
_NOW, _MORE_TO_COME = int(zmq.NOBLOCK), int(zmq.NOBLOCK | zmq.SNDMORE)
#: Parts of a message, at most: ours have three. A message with more is dropped in pieces of so many parts.
MAX_PARTS = 8
_MAX_PASSED = 256
#: ZeroMQ's names for the file number of a message's connection, and for the key shown on it.
_CONNECTION, _USER = int(zmq.SRCFD), "User-Id"


class ZmqReceiver:
    """A SUB socket for frames. Poll it continuously: a bound SUB accepts new peers only while it is polled.

    Parameters
    ----------
    endpoint
        The endpoint to bind or to connect.
    topic
        The beginning of the topics that are wanted.
    networks
        Networks whose peers a bound socket lets in; empty for all.
    keyring
        Keys that the other end must have; None for none.

    Attributes
    ----------
    sender
        The sender of the last message: host and port of the connection or, with keys, `key NAME` and the port. None
        where ZeroMQ does not tell.
    """

    #: ZeroMQ tells neither which messages it dropped nor how long it kept one.
    kernel_drops = 0
    waited = 0.0

    def __init__(
        self, endpoint: Endpoint, topic: bytes = b"", networks: Networks = (), keyring: Keyring | None = None
    ) -> None:
        self.socket = endpoint.open(zmq.SUB, networks, keyring)
        self.socket.subscribe(topic)
        self._connections = Connections(self.socket, endpoint)
        #: The connection of a message whose further parts are dropped.
        self._passing: int | None = None
        self._keyring = keyring
        self.sender: Sender = None
        #: Senders by connection. They stay when a connection ends, because messages of it may still wait, and until its
        #: number is another's.
        self._senders: dict[int, Sender] = {}

    def __str__(self) -> str:
        return f"ZeroMQ {self.address}"

    @property
    def place(self) -> str:
        """The address as recordings name it: `zmq`, a space and the endpoint."""
        return f"zmq {self.address}"

    @property
    def address(self) -> str:
        """The endpoint as bound or connected, its port resolved."""
        return str(self.socket.getsockopt_string(zmq.LAST_ENDPOINT))

    def broken(self) -> int:
        """Count the connections that broke while the sender was there, or were shut down."""
        self._look_if_due()
        return self._connections.broken

    def receive(self) -> list[bytes] | None:
        """Take the next message; None when no message waits.

        Of a message with more than `MAX_PARTS` parts only the first are given, which no decoder reads.
        """
        self._look_if_due()
        # The parts come together. Each says whether it is the last, which is quicker than asking the socket.
        parts = list[bytes]()
        try:
            if self._passing is not None and not self._pass_over(self._passing):
                return None
            while len(parts) < MAX_PARTS:
                part = self.socket.recv(_NOW, copy=False)
                parts.append(part.bytes)
                if not part.more:
                    self._note_sender(part, parts)
                    return parts
        except zmq.Again:
            self._connections.peers.drained()
            return None
        self._passing = self._note_sender(part, parts)
        return parts

    def _look_if_due(self) -> None:
        if self._connections.peers.is_due:
            self._connections.look()
            for connection in self._connections.peers.begun:
                self._senders.pop(connection, None)

    def _note_sender(self, part: zmq.Frame, parts: Sequence[bytes]) -> int:
        """Note the sender of some parts; give the number of its connection, -1 for none."""
        try:
            connection: int = part.get(_CONNECTION)
        except zmq.ZMQError:
            # Within a process there are no connections.
            self.sender = None
            return -1
        if connection not in self._senders:
            self._senders[connection] = self._named(connection, part)
        self.sender = self._senders[connection]
        self._connections.peers.read(connection, len(parts), sum(map(len, parts)))
        return connection

    def _named(self, connection: int, part: zmq.Frame) -> Sender:
        """Name the other end of a connection; None for an end in this machine without an address."""
        try:
            with socket.socket(fileno=os.dup(connection)) as peer:
                host, port = peer.getpeername()[:2]
        except (OSError, ValueError):
            # Closed in the meantime, or of a kind without addresses.
            return None
        if self._keyring:
            with suppress(zmq.ZMQError):
                return f"{KEYED}{self._keyring.name_of(str(part.get(_USER)))}", port
        return host, port

    def _pass_over(self, connection: int) -> bool:
        """Drop some parts of a message that has too many; say whether the last part was among them."""
        for _ in range(_MAX_PASSED):
            part = self.socket.recv(_NOW, copy=False)
            self._connections.peers.read(connection, 1, len(part))
            if not part.more:
                self._passing = None
                return True
        return False

    def close(self) -> None:
        """Close the socket."""
        self._connections.close()
        self.socket.close()


class ZmqSender:
    """A PUB socket. Having no listeners is no error; a listener that is too slow loses the newest answers.

    Parameters
    ----------
    endpoint
        To bind or to connect.
    keyring
        Keys that the other end must know; None for none.
    networks
        Where bound, networks whose listeners are let in; empty for all.
    asks
        Count the messages without a subscriber. For trusted listeners: their topics are kept.

    Attributes
    ----------
    failed
        Messages that ZeroMQ did not take.
    unheard
        Messages that had no subscriber when they were sent, if it `asks`.
    """

    def __init__(
        self, endpoint: Endpoint, keyring: Keyring | None = None, networks: Networks = (), *, asks: bool = False
    ) -> None:
        self.socket = endpoint.open(zmq.XPUB if asks else zmq.PUB, networks, keyring)
        self._peers = Peers(self.socket, SUBSCRIBED)
        self.failed = self.unheard = 0
        self._asks, self._topics = asks, set[bytes]()

    def __str__(self) -> str:
        return f"ZeroMQ {self.address}"

    @property
    def address(self) -> str:
        """The endpoint as bound or connected, its port resolved."""
        return str(self.socket.getsockopt_string(zmq.LAST_ENDPOINT))

    def send(self, parts: Sequence[bytes]) -> None:
        """Send one message; a failure is counted, never raised."""
        *first, last = parts
        try:
            for part in first:
                self.socket.send(part, _MORE_TO_COME)
            self.socket.send(last, _NOW)
        except zmq.ZMQError:
            self.failed += 1
        if self._asks:
            self._ask(parts[0])

    def _ask(self, topic: bytes) -> None:
        """Note the subscriptions until now; say whether a topic has a subscriber."""
        with suppress(zmq.Again):
            while told := self.socket.recv(_NOW):
                (self._topics.add if told[0] else self._topics.discard)(told[1:])
        self.unheard += not any(topic.startswith(each) for each in self._topics)

    def watch(self) -> None:
        """End connections that subscribe to too much; call it some ten times a second."""
        if self._peers.is_due:
            self._peers.look()

    @property
    def shut(self) -> int:
        """Count the connections that were ended because they subscribed to too much."""
        return self._peers.shut

    def close(self) -> None:
        """Close the socket."""
        self._peers.close()
        self.socket.close()
