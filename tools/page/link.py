"""The page's link to a recogniser: a subscription to its messages, and requests to its control socket."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import closing, suppress
from typing import Any

import msgspec
import zmq

from kinespace.stream.zeromq import Endpoint, Keyring

#: The messages that a page always needs, and the messages that only an open page needs.
_TOPICS = (b"event/", b"done/", b"class/", b"classes/", b"status/", b"teach/")
_BODIES = b"body/"
#: Messages taken in one turn, at most, so that a flood leaves turns for the pages.
_MAX_IN_TURN = 512
#: Milliseconds to wait for the control socket.
_MAX_REPLY = 2000
_encode = msgspec.json.Encoder().encode


class _Reply(msgspec.Struct):
    states: list[dict[str, Any]] = []
    classes: list[str] = []
    taught: dict[str, int] = {}
    off: list[str] = []
    sensitivity: float | None = None
    teaches: bool = False


_read = msgspec.json.Decoder(_Reply).decode


class Subscription:
    """A subscription to a recogniser's messages; it connects again by itself after the recogniser was away.

    Parameters
    ----------
    endpoint
        The endpoint at which the recogniser publishes.
    keyring
        Keys of both ends; None for none.
    """

    def __init__(self, endpoint: Endpoint, keyring: Keyring | None = None) -> None:
        self._socket = endpoint.open(zmq.SUB, keyring=keyring)
        for topic in _TOPICS:
            self._socket.subscribe(topic)
        self._bodies = False

    def fileno(self) -> int:
        """Give the file number that becomes readable when messages may have come."""
        return int(self._socket.getsockopt(zmq.FD))

    def want_bodies(self, *, wanted: bool) -> None:
        """Subscribe to bodies, or to none while no page is open."""
        if wanted != self._bodies:
            self._bodies = wanted
            (self._socket.subscribe if wanted else self._socket.unsubscribe)(_BODIES)

    def messages(self) -> Iterator[list[bytes]]:
        """Take the messages that wait."""
        for _ in range(_MAX_IN_TURN):
            try:
                yield self._socket.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def ask_control(endpoint: Endpoint, keyring: Keyring | None, command: Mapping[str, object]) -> dict[str, Any] | None:
    """Ask the control socket of a recogniser; from any thread.

    Parameters
    ----------
    endpoint
        The address of `--control`.
    keyring
        Keys of both ends; None for none.
    command
        The command.

    Returns
    -------
    The reply; None when no reply comes in two seconds.
    """
    # A socket that got no reply could not ask again: each command has its own.
    with closing(endpoint.open(zmq.REQ, keyring=keyring)) as asking, suppress(zmq.ZMQError, ValueError):
        asking.send(_encode(command), zmq.NOBLOCK)
        if asking.poll(_MAX_REPLY):
            reply: dict[str, Any] = msgspec.to_builtins(_read(asking.recv()))
            return reply
    return None
