"""The doors for commands: the port of the frames, a port for Wekinator's messages, and a ZeroMQ socket that replies."""

from __future__ import annotations

import ipaddress
import json
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import zmq

from kinespace.stream.inputs.receiver import KEYED, datagram_of
from kinespace.stream.inputs.source import TENDING
from kinespace.stream.service.status import InputCounts
from kinespace.stream.teaching import wire
from kinespace.stream.teaching.commands import CommandError
from kinespace.stream.zeromq.peers import UNREAD, Peers

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.stream.frame import Admitted, Input
    from kinespace.stream.inputs.decoder import Decoder
    from kinespace.stream.inputs.receiver import Networks, Packet, Sender
    from kinespace.stream.osc.udp import OscReceiver
    from kinespace.stream.teaching import Command, Notice
    from kinespace.stream.zeromq import Endpoint, Keyring
    from kinespace.tools.teaching.commanded import Commanded
    from kinespace.tools.teaching.desk import Desk

#: The port on which Wekinator listens.
WEKINATOR_PORT = 6448


class Allowed:
    """The senders that may teach: this machine, hosts in the given networks, and owners of known keys.

    Parameters
    ----------
    networks
        Networks whose senders may teach, beside this machine.
    """

    def __init__(self, networks: Networks = ()) -> None:
        self._networks = tuple(networks)

    def __call__(self, sender: Sender) -> bool:
        """Whether a sender may teach; never, if the transport does not tell the sender."""
        if sender is None:
            return False
        if sender[0].startswith(KEYED):
            return True
        address = ipaddress.ip_address(sender[0].partition("%")[0])
        return address.is_loopback or any(address in network for network in self._networks)


class TaughtDecoder:
    """Takes commands out of the frames' packets, and leaves the other packets to the frames' own decoder.

    Parameters
    ----------
    decoder
        The decoder of frames.
    desk
        Carries out the commands.
    allowed
        The senders that may teach.
    """

    expires = True

    def __init__(self, decoder: Decoder, desk: Desk, allowed: Allowed) -> None:
        self.decoder, self._desk, self._allowed = decoder, desk, allowed
        self._received = self._refused = 0

    @property
    def counts(self) -> InputCounts:
        """Counts of packets; commands from other hosts count as foreign."""
        counts = self.decoder.counts
        return replace(counts, received=counts.received + self._received, foreign=counts.foreign + self._refused)

    def decode(self, packet: Packet, arrival: float, sender: Sender) -> Sequence[Input]:
        """Decode one packet: carry out commands, give frames."""
        datagram = datagram_of(packet)
        if not wire.is_teaching(datagram):
            return self.decoder.decode(packet, arrival, sender)
        self._received += 1
        if self._allowed(sender):
            _obey(self._desk, datagram, wire.decode)
        else:
            self._refused += 1
            self._desk.refuse(f"a control message from {sender[0] if sender else 'elsewhere'}: see --allow-from")
        return self.decoder.decode(packet, arrival, sender) if datagram.startswith(b"#bundle") else ()

    def expire(self, now: float) -> Sequence[Input]:
        """Do the work that is due by the clock."""
        self._desk.tend(now)
        return self.decoder.expire(now)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any attribute of the frames' own decoder
        return getattr(self.decoder, name)


def _obey(desk: Desk, datagram: bytes, decode: Callable[[bytes], list[Command]]) -> None:
    try:
        for command in decode(datagram):
            desk.command(command)
    except CommandError as error:
        desk.refuse(str(error))


class WekinatorDoor:
    """A source without frames: Wekinator's control messages."""

    tended_within = TENDING
    has_put_aside = False
    #: There are no notes for a person.
    notes: Sequence[str] = ()
    #: A command is carried out when it comes; how long it waited does not matter.
    waited = 0.0

    def __init__(self, receiver: OscReceiver, desk: Desk, allowed: Allowed) -> None:
        self._receiver, self._desk, self._allowed = receiver, desk, allowed
        self._control = wire.Wekinator()
        self._counts = InputCounts()

    def __str__(self) -> str:
        return f"{self._receiver} (Wekinator's control)"

    @property
    def pollable(self) -> object:
        """The socket."""
        return self._receiver.socket

    @property
    def counts(self) -> InputCounts:
        """Counts of packets."""
        return replace(self._counts, overrun=self._receiver.kernel_drops)

    def take(self, arrival: float) -> Sequence[Admitted] | None:  # noqa: ARG002 - as in a source
        """Carry out the commands of one packet; None when no packet waits."""
        packet = self._receiver.receive()
        if packet is None:
            return None
        self._counts.received += 1
        if self._allowed(self._receiver.sender):
            _obey(self._desk, packet, self._control.decode)
        else:
            self._counts.foreign += 1
            self._desk.refuse("a control message from elsewhere: see --allow-from")
        return ()

    def tend(self, now: float) -> Sequence[Admitted]:
        """Do the work that is due by the clock."""
        self._desk.tend(now)
        return ()

    def close(self) -> None:
        """Close the socket."""
        self._receiver.close()


class RequestDoor:
    """A source without frames: requests over ZeroMQ, each in JSON and each with a reply.

    Parameters
    ----------
    endpoint
        The address of a REP socket.
    desk
        Carries out the commands.
    allowed
        The senders that may teach, if the transport names the sender; another process of this machine may.
    keyring
        Keys of peers who may teach, on any host; None for no keys.
    """

    tended_within = TENDING
    has_put_aside = False
    #: There are no notes for a person.
    notes: Sequence[str] = ()
    #: A command is carried out when it comes; how long it waited does not matter.
    waited = 0.0

    def __init__(self, endpoint: Endpoint, desk: Commanded, allowed: Allowed, keyring: Keyring | None = None) -> None:
        self._socket = endpoint.open(zmq.REP, keyring=keyring)
        self._peers = Peers(self._socket, UNREAD)
        self._desk, self._allowed, self._keyed = desk, allowed, keyring is not None
        self._counts = InputCounts()

    def __str__(self) -> str:
        return f"ZeroMQ {self.address} (control)"

    @property
    def address(self) -> str:
        """The endpoint as bound."""
        return str(self._socket.getsockopt_string(zmq.LAST_ENDPOINT))

    @property
    def pollable(self) -> object:
        """The socket."""
        return self._socket

    @property
    def counts(self) -> InputCounts:
        """Counts of packets; a copy."""
        return replace(self._counts, broken=self._counts.broken + self._peers.shut)

    def take(self, arrival: float) -> Sequence[Admitted] | None:  # noqa: ARG002 - as in a source
        """Carry out one request, and reply; None when none waits."""
        try:
            parts = self._socket.recv_multipart(zmq.NOBLOCK, copy=False)
        except zmq.Again:
            self._peers.drained()
            return None
        request = parts[0]
        with suppress(zmq.ZMQError):  # within a process there are no connections
            self._peers.read(request.get(zmq.SRCFD), len(parts), sum(map(len, parts)))
        self._counts.received += 1
        told = [wire.as_json(notice) for notice in self._answered(request)]
        reply = {"states": [each for each in told if each], **self._desk.described()}
        try:
            self._socket.send(json.dumps(reply).encode(), zmq.NOBLOCK)
        except zmq.ZMQError:
            self._counts.broken += 1
        return ()

    def _answered(self, request: zmq.Frame) -> Sequence[Notice]:
        peer = str(request.get("Peer-Address") or "")
        if peer and not self._keyed and not self._allowed((peer, 0)):
            self._counts.foreign += 1
            return [self._desk.refuse(f"a control message from {peer}: see --allow-from")]
        try:
            return self._desk.command(wire.decode_json(request.bytes))
        except CommandError as error:
            return [self._desk.refuse(str(error))]

    def tend(self, now: float) -> Sequence[Admitted]:
        """Do the work that is due by the clock."""
        self._desk.tend(now)
        if self._peers.is_due:
            self._peers.look()
        return ()

    def close(self) -> None:
        """Close the socket."""
        self._peers.close()
        self._socket.close()
