"""Requests over ZeroMQ: commands in JSON, each with a reply."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace

import zmq

from kinespace.stream.frame import Admitted
from kinespace.stream.inputs.commands import TOO_MANY, Quota, may_command
from kinespace.stream.packet import Networks
from kinespace.stream.status import InputCounts
from kinespace.stream.teaching import Asked, State, wire
from kinespace.stream.teaching.commands import CommandError
from kinespace.stream.zeromq import Endpoint, Keyring


class RequestSource:
    """A source without frames: one command in each request.

    Parameters
    ----------
    endpoint
        The address of a REP socket.
    commanding
        Networks whose senders may command, if the transport names the sender; another process of this machine may.
    keyring
        Keys of peers who may command, on any host; None for no keys.
    networks
        Networks whose peers may connect to a bound socket; empty for all.

    Attributes
    ----------
    pollable
        The socket.
    """

    #: No frames come in here.
    place = ""
    #: Nothing is due by the clock.
    tended_within = float("inf")
    has_put_aside = False
    #: There are no notes for a person.
    notes: Sequence[str] = ()
    #: A command is carried out when it comes; how long it waited does not matter.
    waited = lag = 0.0
    patience = float("inf")

    def __init__(
        self, endpoint: Endpoint, commanding: Networks, keyring: Keyring | None = None, *, networks: Networks = ()
    ) -> None:
        self.pollable = endpoint.open(zmq.REP, networks, keyring)
        self._commanding, self._keyed = commanding, keyring is not None
        self._counts, self._quota = InputCounts(), Quota()
        #: Whether a request waits for its reply; the socket takes none before.
        self._owes = False

    def __str__(self) -> str:
        return f"ZeroMQ {self.address} (control)"

    @property
    def address(self) -> str:
        """The endpoint as bound."""
        return str(self.pollable.getsockopt_string(zmq.LAST_ENDPOINT))

    @property
    def counts(self) -> InputCounts:
        """Counts of requests that nobody obeyed; a copy."""
        return replace(self._counts)

    def take(self, arrival: float) -> Sequence[Asked] | None:
        """Take in one request; None when none waits, or while one waits for its reply."""
        if self._owes:
            return None
        try:
            request = self.pollable.recv_multipart(zmq.NOBLOCK, copy=False)[0]
        except zmq.Again:
            return None
        self._owes = True
        return [self._asked(request, arrival)]

    def _asked(self, request: zmq.Frame, now: float) -> Asked:
        peer = str(request.get("Peer-Address") or "")
        if peer and not self._keyed and not may_command((peer, 0), self._commanding):
            self._counts.foreign += 1
            return Asked(None, f"a control message from {peer}: see --allow-from", self._reply)
        if not self._quota.allows(peer, 1, now):
            self._counts.foreign += 1
            return Asked(None, TOO_MANY, self._reply)
        try:
            return Asked(wire.decode_json(request.bytes), "", self._reply)
        except CommandError as error:
            return Asked(None, str(error), self._reply)

    def _reply(self, states: Sequence[State], described: Mapping[str, object]) -> None:
        reply = {"states": [wire.as_json(each) for each in states], **described}
        try:
            self.pollable.send(json.dumps(reply).encode(), zmq.NOBLOCK)
        except zmq.ZMQError:
            self._counts.broken += 1
        self._owes = False

    def tend(self, now: float) -> Sequence[Admitted]:  # noqa: ARG002 - as in a source
        """Do nothing: no work is due by the clock."""
        return ()

    def close(self) -> None:
        """Close the socket."""
        self.pollable.close()
