"""ZeroMQ addresses: which to bind or connect, and sockets with the limits and keep-alives that all of ours have."""

from __future__ import annotations

from typing import NamedTuple

import zmq

#: Bytes of a message's part above which ZeroMQ refuses it and ends the connection: a frame of 4096 joints in doubles,
#: with their names, fits twice.
MAX_MESSAGE = 1 << 18
#: Messages waiting in a socket: eight seconds of a 120 Hz feed, then ZeroMQ itself begins to throw away.
_HIGH_WATER_MARK = 1000
#: Seconds of silence after which the system asks whether the other machine is still there, seconds between two more
#: questions, and how many go unanswered before the connection is made anew. A sender that is switched off says nothing,
#: and ZeroMQ would wait for it for hours. These are not ZeroMQ's own heartbeats, which older peers do not know.
_ASK_AFTER, _ASK_EVERY, _ASK_TIMES = 5, 1, 5


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
        opened.setsockopt(zmq.MAXMSGSIZE, MAX_MESSAGE)
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
