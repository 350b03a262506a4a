"""ZeroMQ's endpoints: addresses to bind or to connect, a SUB socket for frames, and a PUB socket for answers."""

import os
import re
import socket
import struct
import time
from collections.abc import Sequence
from contextlib import suppress
from ipaddress import IPv4Network
from typing import NamedTuple

import zmq

from kinespace.stream.packet import KEYED, Networks, Sender
from kinespace.stream.status import InputCounts
from kinespace.stream.zeromq.keys import Keyring

#: Bytes of a message's part above which ZeroMQ refuses it and ends the connection: twice a frame of 4096 joints in
#: doubles with their names.
MAX_MESSAGE = 1 << 18
#: Bytes of a subscription, at most: the longest topic has 270. ZeroMQ keeps every subscription in memory.
MAX_SUBSCRIPTION = 512
#: Seconds of silence after which the system asks whether the other machine is still there. A sender that is switched
#: off sends no end, and ZeroMQ would wait for hours. ZeroMQ has heartbeats of its own, which older peers do not know.
_ASK_AFTER = 5
#: Seconds between two further questions.
_ASK_EVERY = 1
#: Unanswered questions after which the connection is made again.
_ASK_TIMES = 5
#: Milliseconds in which a new connection must have shown that it speaks ZeroMQ and, with keys, its key.
_MAX_HANDSHAKE = 3000
#: Hosts of this machine, as addresses name them.
_THIS_MACHINE = r"localhost|127(\.\d{1,3}){3}|\[::1\]"


class Endpoint(NamedTuple):
    """A ZeroMQ address.

    Attributes
    ----------
    address
        The address, like `tcp://127.0.0.1:5556`.
    bind
        Whether to bind or to connect to it.
    to_anybody
        Whether it may be bound where other machines reach it, although neither keys nor networks say who they are.
    """

    address: str
    bind: bool
    to_anybody: bool = False

    @classmethod
    def parse(cls, text: str, *, bind: bool, to_anybody: bool = False) -> "Endpoint":
        """Read an address; "@" before it says bind and ">" connect, as in CZMQ, else `bind` decides.

        Raises
        ------
        ValueError
            The text names no transport like `tcp://`.
        """
        address = text.lstrip("@>")
        if "://" not in address:
            raise ValueError(f"endpoint: expected an address like tcp://127.0.0.1:5556, got {text!r}")
        return cls(address, text.startswith("@") or (bind and not text.startswith(">")), to_anybody)

    @property
    def is_open_to_others(self) -> bool:
        """Whether the other end may be another machine."""
        transport, _, place = self.address.partition("://")
        if transport in ("ipc", "inproc") or not place or re.fullmatch(_THIS_MACHINE, place.rpartition(":")[0]):
            return False
        return transport == "tcp" or bool(zmq.has(transport))

    def open(self, kind: int, networks: Networks = (), keyring: Keyring | None = None) -> zmq.Socket[bytes]:
        """Make a socket and bind or connect it.

        Parameters
        ----------
        kind
            The socket's kind, as ZeroMQ counts them.
        networks
            A bound socket lets in only peers in these networks; all when empty.
        keyring
            Keys that the other end must have; None for connections without keys.

        Raises
        ------
        OSError
            The address is taken, or impossible; the message names the address.
        ValueError
            The keyring does not say whom to connect to; or other machines would reach a bound socket, and nothing says
            which of them may: libzmq bounds neither a stranger's unfinished message nor a stranger's subscriptions.
        """
        if self.bind and self.is_open_to_others and not (networks or keyring or self.to_anybody):
            ways = "--keys, --allow-from or --open"
            raise ValueError(f"address: expected {ways} with {self.address}, which others reach, got none of them")
        # Sockets without IPv6 meet no such peer, and refuse filters for it.
        filters = [each for each in networks if isinstance(each, IPv4Network)] if self.bind else []
        if networks and self.bind and not filters:
            raise ValueError(f"address: expected a network of IPv4 for {self.address}, got {networks[0]}")
        context = keyring.context if keyring else zmq.Context.instance()
        opened: zmq.Socket[bytes] = context.socket(kind)
        opened.linger = 0
        opened.setsockopt(zmq.HANDSHAKE_IVL, _MAX_HANDSHAKE)
        # A publisher receives subscriptions.
        opened.setsockopt(zmq.MAXMSGSIZE, MAX_SUBSCRIPTION if kind in (zmq.PUB, zmq.XPUB) else MAX_MESSAGE)
        opened.setsockopt(zmq.TCP_KEEPALIVE, 1)
        opened.setsockopt(zmq.TCP_KEEPALIVE_IDLE, _ASK_AFTER)
        opened.setsockopt(zmq.TCP_KEEPALIVE_INTVL, _ASK_EVERY)
        opened.setsockopt(zmq.TCP_KEEPALIVE_CNT, _ASK_TIMES)
        for network in filters:
            opened.setsockopt(zmq.TCP_ACCEPT_FILTER, str(network).encode())
        try:
            if keyring:
                keyring.secure(opened, bind=self.bind)
            if self.bind:
                opened.bind(self.address)
            else:
                opened.connect(self.address)
        except ValueError:
            opened.close()
            raise
        except zmq.ZMQError as error:
            opened.close()
            raise OSError(error.errno, f"{self.address}: {error.strerror}") from error
        return opened


#: Without waiting; plain integers, because pyzmq's own flags are slow to combine and to pass on.
_NOW = int(zmq.NOBLOCK)
#: Without waiting, and a further part of the message follows.
_MORE_TO_COME = int(zmq.NOBLOCK | zmq.SNDMORE)
#: Parts of a message, at most: ours have three. The further parts of a message with more are dropped.
MAX_PARTS = 8
_MAX_PASSED = 256
#: ZeroMQ's name for the file number of a message's connection.
_CONNECTION = int(zmq.SRCFD)
#: ZeroMQ's name for the key shown on a connection.
_USER = "User-Id"
#: The beginning of a monitor's message: the event and its value. pyzmq's own reader loads asyncio, which takes long.
_EVENT = struct.Struct("=HI")
_BEGUN = (zmq.EVENT_ACCEPTED, zmq.EVENT_CONNECTED)
_WATCHED = zmq.EVENT_ACCEPTED | zmq.EVENT_CONNECTED | zmq.EVENT_CONNECT_RETRIED | zmq.EVENT_DISCONNECTED
#: Seconds between two looks at the events.
_LOOK_EVERY = 0.1
#: Events that are read in one look, at most: who opens connections without end must not hold up the loop.
_MAX_EVENTS = 64
#: Seconds after which ZeroMQ, which tries again after a tenth of a second, has certainly tried again; a connection that
#: begins later has nothing to do with one that ended.
_A_WHILE = 0.5


class ZmqReceiver:
    """A SUB socket for frames. Poll it continuously: a bound SUB accepts new peers only while it is polled.

    It counts the connections that broke, and makes them again. ZeroMQ ends a connection when a message above the size
    limit comes, and only its monitor shows it. A sender that connected to us comes back by itself, without that
    message. A sender that we connected to does not: ZeroMQ takes the refused message for another protocol, and gives
    the connection up.

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
    address, place
        The endpoint as bound or connected, its port resolved; and as recordings name it: `zmq`, a space, the endpoint.
    counts
        Counts of the connections that broke while the sender was still there: by a message above the size limit, by a
        network that fails for a moment, or when a sender begins again within half a second.
    sender
        The sender of the last message: host and port of the connection or, with keys, `key NAME` and the port. None
        where ZeroMQ does not say.
    """

    #: ZeroMQ does not say how long it kept a message.
    waited = 0.0

    def __init__(
        self, endpoint: Endpoint, topic: bytes = b"", networks: Networks = (), keyring: Keyring | None = None
    ) -> None:
        self.socket = endpoint.open(zmq.SUB, networks, keyring)
        self.address = str(self.socket.getsockopt_string(zmq.LAST_ENDPOINT))
        self.place = f"zmq {self.address}"
        self.socket.subscribe(topic)
        self._endpoint, self._keyring = endpoint, keyring
        self._events: zmq.Socket[bytes] = self.socket.get_monitor_socket(_WATCHED)
        self.counts = InputCounts()
        #: When connections ended that may come back yet, and when to look at the events again.
        self._gone, self._next = list[float](), 0.0
        #: Whether the further parts of a message are to be dropped.
        self._passing = False
        self.sender: Sender = None
        #: Senders by connection. They stay when a connection ends, because messages of it may still wait, and until its
        #: number is another's.
        self._senders: dict[int, Sender] = {}

    def __str__(self) -> str:
        return f"ZeroMQ {self.address}"

    def receive(self) -> list[bytes] | None:
        """Take the next message; None when no message waits.

        Of a message with more than `MAX_PARTS` parts only the first are given, which no decoder reads.
        """
        self._look()
        # The parts come together. Each says whether it is the last, which is quicker than asking the socket.
        parts = list[bytes]()
        try:
            if self._passing and not self._pass_over():
                return None
            while len(parts) < MAX_PARTS:
                part = self.socket.recv(_NOW, copy=False)
                parts.append(part.bytes)
                if not part.more:
                    self._note_sender(part)
                    return parts
        except zmq.Again:
            return None
        self._note_sender(part)
        self._passing = True
        return parts

    def _look(self) -> None:
        """Note the changes of connections, some times a second."""
        now = time.monotonic()
        if now < self._next or self.socket.closed:
            return
        self._next = now + _LOOK_EVERY
        with suppress(zmq.Again):
            for _ in range(_MAX_EVENTS):
                event, connection = _EVENT.unpack_from(self._events.recv_multipart(zmq.NOBLOCK)[0])
                self._note(event, now)
                if event in _BEGUN:
                    self._senders.pop(connection, None)
        lost = [moment for moment in self._gone if now - moment >= _A_WHILE]
        del self._gone[: len(lost)]
        if lost and not self._endpoint.bind:
            # ZeroMQ would have tried again by now. Its own attempts are not counted as losses: the sender had gone.
            self.counts.broken += 1
            with suppress(zmq.ZMQError):
                self.socket.disconnect(self._endpoint.address)
            self.socket.connect(self._endpoint.address)

    def _note(self, event: int, now: float) -> None:
        if event == zmq.EVENT_DISCONNECTED:
            self._gone.append(now)
        elif not self._endpoint.bind:
            self._gone.clear()
        elif event == zmq.EVENT_ACCEPTED and self._gone:
            self.counts.broken += 1
            del self._gone[0]

    def _note_sender(self, part: zmq.Frame) -> None:
        try:
            connection: int = part.get(_CONNECTION)
        except zmq.ZMQError:
            # Within a process there are no connections.
            self.sender = None
            return
        if connection not in self._senders:
            self._senders[connection] = self._named(connection, part)
        self.sender = self._senders[connection]

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

    def _pass_over(self) -> bool:
        """Drop some parts of a message that has too many; say whether the last part was among them."""
        for _ in range(_MAX_PASSED):
            if not self.socket.recv(_NOW, copy=False).more:
                self._passing = False
                return True
        return False

    def close(self) -> None:
        """Stop watching the connections, and close the socket."""
        if not self.socket.closed:
            self.socket.disable_monitor()
        self._events.close()
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
        Where bound, networks whose listeners are admitted; empty for all.
    asks
        Count the messages without a subscriber. For trusted listeners: their topics are kept.

    Attributes
    ----------
    address
        The endpoint as bound or connected, its port resolved.
    failed
        Messages that ZeroMQ did not take.
    unheard
        Messages that had no subscriber when they were sent, if it `asks`.
    """

    def __init__(
        self, endpoint: Endpoint, keyring: Keyring | None = None, networks: Networks = (), *, asks: bool = False
    ) -> None:
        self.socket = endpoint.open(zmq.XPUB if asks else zmq.PUB, networks, keyring)
        self.address = str(self.socket.getsockopt_string(zmq.LAST_ENDPOINT))
        self.failed = self.unheard = 0
        self._asks, self._topics = asks, set[bytes]()

    def __str__(self) -> str:
        return f"ZeroMQ {self.address}"

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
        """Note the subscriptions until now; count a topic without a subscriber."""
        with suppress(zmq.Again):
            while subscription := self.socket.recv(_NOW):
                (self._topics.add if subscription[0] else self._topics.discard)(subscription[1:])
        self.unheard += not any(topic.startswith(each) for each in self._topics)

    def close(self) -> None:
        """Close the socket."""
        self.socket.close()
