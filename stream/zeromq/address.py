"""ZeroMQ addresses: to bind or to connect, and sockets with the limits and keep-alives of all our sockets."""

from __future__ import annotations

import re
from ipaddress import IPv4Network
from typing import NamedTuple

import zmq

from kinespace.stream.packet import Networks
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
    def parse(cls, text: str, *, bind: bool, to_anybody: bool = False) -> Endpoint:
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
            raise ValueError(
                f"address: expected --keys, --allow-from or --open with {self.address}, because other machines reach "
                "it, got none of them"
            )
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
