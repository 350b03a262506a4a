"""ZeroMQ addresses: which to bind or connect, and sockets with the limits and keep-alives that all of ours have."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import zmq

if TYPE_CHECKING:
    from kinespace.stream.inputs.receiver import Networks
    from kinespace.stream.zeromq.keys import Keyring

#: Bytes of a message's part above which ZeroMQ refuses it and ends the connection: a frame of 4096 joints in doubles,
#: with their names, fits twice.
MAX_MESSAGE = 1 << 18
#: Bytes of a subscription: the longest topic has 270. ZeroMQ keeps every subscription in memory.
MAX_SUBSCRIPTION = 512
#: Messages waiting in a socket: eight seconds of a 120 Hz feed, then ZeroMQ itself begins to throw away.
_HIGH_WATER_MARK = 1000
#: Seconds of silence after which the system asks whether the other machine is still there, seconds between two more
#: questions, and how many go unanswered before the connection is made anew. A sender that is switched off says nothing,
#: and ZeroMQ would wait for it for hours. These are not ZeroMQ's own heartbeats, which older peers do not know.
_ASK_AFTER, _ASK_EVERY, _ASK_TIMES = 5, 1, 5
#: Milliseconds in which a new connection must have said that it speaks ZeroMQ and, with keys, shown its own.
_MAX_HANDSHAKE = 3000
#: Hosts of this machine, as addresses name them.
_THIS_MACHINE = ("localhost", "127.", "[::1]")


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

    @property
    def is_open_to_others(self) -> bool:
        """Whether the other end may be another machine."""
        transport, _, place = self.address.partition("://")
        return transport not in ("ipc", "inproc") and not place.startswith(_THIS_MACHINE)

    def open(self, kind: int, networks: Networks = (), keyring: Keyring | None = None) -> zmq.Socket[bytes]:
        """Make a socket and bind or connect it.

        Parameters
        ----------
        kind
            Of socket, as ZeroMQ counts them.
        networks
            Where bound, only peers in them are let in; all when there are none.
        keyring
            Keys that the other end must know; None to speak with anybody in the clear.

        Raises
        ------
        OSError
            The address is taken, or makes no sense; the message says which address.
        ValueError
            The keyring does not say whom to connect to.
        """
        context = keyring.context if keyring else zmq.Context.instance()
        opened: zmq.Socket[bytes] = context.socket(kind)
        opened.linger = 0
        opened.setsockopt(zmq.HANDSHAKE_IVL, _MAX_HANDSHAKE)
        opened.set_hwm(_HIGH_WATER_MARK)
        # What a publisher hears are subscriptions.
        opened.setsockopt(zmq.MAXMSGSIZE, MAX_SUBSCRIPTION if kind == zmq.PUB else MAX_MESSAGE)
        opened.setsockopt(zmq.TCP_KEEPALIVE, 1)
        opened.setsockopt(zmq.TCP_KEEPALIVE_IDLE, _ASK_AFTER)
        opened.setsockopt(zmq.TCP_KEEPALIVE_INTVL, _ASK_EVERY)
        opened.setsockopt(zmq.TCP_KEEPALIVE_CNT, _ASK_TIMES)
        for network in networks if self.bind else ():
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
