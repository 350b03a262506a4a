"""Commands among the packets of a feed, and the senders that may give them."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from ipaddress import ip_network

import zmq

from kinespace.stream.frame import Admitted
from kinespace.stream.packet import KEYED, IdleSource, Networks, Packet, Sender, datagram_of, is_within, remember
from kinespace.stream.status import InputCounts
from kinespace.stream.teaching import State, commands
from kinespace.stream.teaching.commands import Asked, CommandError
from kinespace.stream.zeromq import Endpoint, Keyring

_TEACH, _RESET = commands.TEACH.encode(), commands.RESET.encode()
#: Bytes of a datagram in which an address may end, at most.
_MAX_ADDRESS = 512
#: Commands of a sender that are obeyed in a second, and at once.
_A_SECOND = 20
#: Senders whose commands are counted, at most.
_MAX_SENDERS = 256
_THIS_MACHINE = ip_network("127.0.0.0/8"), ip_network("::1/128")


def may_command(sender: Sender, networks: Networks) -> bool:
    """Say whether a sender may command: from this machine, from the given networks, or as the owner of a known key."""
    return sender is not None and (sender[0].startswith(KEYED) or is_within(sender[0], (*_THIS_MACHINE, *networks)))


class Quota:
    """Counts each sender's commands: some take hundredths of a second, in which nobody is answered."""

    def __init__(self) -> None:
        #: How many count still, by host or key, and when.
        self._used: dict[str, tuple[float, float]] = {}

    def allows(self, host: str, commands: int, now: float) -> bool:
        """Say whether a sender may give some commands at a moment in seconds; then they count."""
        used, since = self._used.get(host, (0.0, now))
        used = max(used - _A_SECOND * (now - since), 0.0) + commands
        if used > _A_SECOND:
            return False
        remember(self._used, host, (used, now), _MAX_SENDERS)
        return True


#: What a sender hears whose commands are too many.
TOO_MANY = f"too many commands: expected at most {_A_SECOND} a second"


class CommandReader:
    """Reads the commands of one address.

    Parameters
    ----------
    networks
        Networks whose senders may command, as this machine may.
    no_lessons
        What a sender hears who would teach where nobody may; empty where people may.

    Attributes
    ----------
    received, refused
        Packets with commands, and packets whose commands nobody obeys.
    others
        Messages in the last packet that were no commands; at least one where it could not be read.
    """

    def __init__(self, networks: Networks = (), no_lessons: str = "") -> None:
        self._networks, self._no_lessons, self._quota = networks, no_lessons, Quota()
        self.received = self.refused = self.others = 0

    def read(self, packet: Packet, sender: Sender, now: float) -> Sequence[Asked] | None:
        """Read a packet's commands; None for a packet that holds none: hundreds of frames come each second."""
        datagram = datagram_of(packet)
        if datagram.startswith(b"#bundle"):
            holds = _TEACH in datagram or _RESET in datagram
        else:
            holds = datagram.startswith(_TEACH) or datagram.find(_RESET, 0, _MAX_ADDRESS) > 0
        if not holds:
            return None
        mistake, given, self.others = "", list[commands.Command](), 1
        try:
            said, self.others = commands.said_in(datagram)
            if not said:
                return None
            given = commands.decode(said)
        except CommandError as error:
            mistake = str(error)
        refusal = self._refusal(given, sender, now) or mistake
        self.received += 1
        self.refused += bool(refusal)
        return [Asked(None, refusal)] if refusal else [Asked(each) for each in given]

    def _refusal(self, given: Sequence[commands.Command], sender: Sender, now: float) -> str:
        """Say why a sender's commands are not obeyed; empty where they are."""
        if not may_command(sender, self._networks):
            return f"a control message from {sender[0] if sender else 'elsewhere'}: see --allow-from"
        if self._no_lessons and not all(isinstance(each, commands.Reset) for each in given):
            return self._no_lessons
        return "" if self._quota.allows(sender[0] if sender else "", max(len(given), 1), now) else TOO_MANY


class RequestSource(IdleSource):
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
    pollable, address
        The socket, and the endpoint as bound.
    """

    def __init__(
        self, endpoint: Endpoint, commanding: Networks, keyring: Keyring | None = None, *, networks: Networks = ()
    ) -> None:
        self.pollable = endpoint.open(zmq.REP, networks, keyring)
        self.address = str(self.pollable.getsockopt_string(zmq.LAST_ENDPOINT))
        self._commanding, self._keyed = commanding, keyring is not None
        self._counts, self._quota = InputCounts(), Quota()
        #: Whether a request waits for its reply; the socket takes none before.
        self._owes = False

    def __str__(self) -> str:
        return f"ZeroMQ {self.address} (control)"

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
            return Asked(commands.decode_json(request.bytes), "", self._reply)
        except CommandError as error:
            return Asked(None, str(error), self._reply)

    def _reply(self, states: Sequence[State], described: Mapping[str, object]) -> None:
        reply = {"states": [commands.as_json(each) for each in states], **described}
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
