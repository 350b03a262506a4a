"""Commands among the packets of a feed, and the senders that may give them."""

import json
from collections.abc import Mapping, Sequence
from ipaddress import ip_network

import zmq

from kinespace.stream.frame import Admitted
from kinespace.stream.packet import KEYED, IdleSource, Networks, Packet, Sender, datagram_of, is_within, remember
from kinespace.stream.status import InputCounts
from kinespace.stream.teaching import State, commands
from kinespace.stream.teaching.commands import Asked, CommandError
from kinespace.stream.zeromq import Endpoint, Keyring

_TEACH, _RESET = commands.TEACH.encode(), commands.RESET.encode()
#: Commands of a sender that are obeyed in a second, and at once.
_A_SECOND = 20
#: Senders whose commands are counted, at most.
_MAX_SENDERS = 256
#: The addresses of this machine.
THIS_MACHINE = ip_network("127.0.0.0/8"), ip_network("::1/128")


def may_command(sender: Sender, networks: Networks) -> bool:
    """Say whether a sender may command: from this machine, from the given networks, or as the owner of a known key."""
    return sender is not None and (sender[0].startswith(KEYED) or is_within(sender[0], (*THIS_MACHINE, *networks)))


class Commanders:
    """Knows who may command, and counts the commands: some take hundredths of a second, in which nobody is answered.

    Parameters
    ----------
    networks
        Networks whose senders may command, as this machine may.
    """

    def __init__(self, networks: Networks) -> None:
        self._networks = networks
        #: How many count still, by host or key, and when.
        self._used: dict[str, tuple[float, float]] = {}

    def refusal(self, sender: Sender, commands: int, now: float) -> str:
        """Say why a sender may not give some commands at a moment in seconds; empty where it may: then they count."""
        host = sender[0] if sender else ""
        if not may_command(sender, self._networks):
            return f"a control message from {host or 'elsewhere'}: see --allow-from"
        # A program of this machine may send from any of its sixteen million addresses.
        host = "127.0.0.1" if host.startswith("127.") else host
        used, since = self._used.get(host, (0.0, now))
        used = max(used - _A_SECOND * (now - since), 0.0) + commands
        if used > _A_SECOND:
            return f"too many commands: expected at most {_A_SECOND} a second"
        remember(self._used, host, (used, now), _MAX_SENDERS)
        return ""


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
    counts
        Counts of packets with commands; those whose commands nobody obeys are foreign.
    others
        Messages in the last packet that were no commands; at least one where it could not be read.
    """

    def __init__(self, networks: Networks = (), no_lessons: str = "") -> None:
        self._commanders, self._no_lessons = Commanders(networks), no_lessons
        self.counts, self.others = InputCounts(), 0

    def read(self, packet: Packet, sender: Sender, now: float) -> Sequence[Asked] | None:
        """Read a packet's commands; None for a packet that holds none: hundreds of frames come each second."""
        datagram = datagram_of(packet)
        if _TEACH not in datagram and _RESET not in datagram:
            return None
        mistake, given, self.others = "", list[commands.Command](), 1
        try:
            said, self.others = commands.said_in(datagram)
            if not said:
                return None
            given = commands.decode(said)
        except CommandError as error:
            mistake = str(error)
        teaches = not all(isinstance(each, commands.Reset) for each in given)
        refusal = self._commanders.refusal(sender, max(len(given), 1), now)
        refusal = refusal or (self._no_lessons if teaches else "") or mistake
        self.counts.received += 1
        self.counts.foreign += bool(refusal)
        return [Asked(None, refusal)] if refusal else [Asked(each) for each in given]


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
        self._commanders, self._keyed = Commanders(commanding), keyring is not None
        #: Counts of requests that nobody obeyed.
        self.counts = InputCounts()

    def __str__(self) -> str:
        return f"ZeroMQ {self.address} (control)"

    def take(self, arrival: float) -> Sequence[Asked] | None:
        """Take in one request; None when none waits, or while one waits for its reply."""
        try:
            request = self.pollable.recv_multipart(zmq.NOBLOCK, copy=False)[0]
        except zmq.ZMQError as error:
            # Before its reply the socket takes none, either.
            if error.errno not in (zmq.EAGAIN, zmq.EFSM):
                raise
            return None
        return [self._asked(request, arrival)]

    def _asked(self, request: zmq.Frame, now: float) -> Asked:
        # Another process of this machine may have no address.
        peer = str(request.get("Peer-Address") or "127.0.0.1")
        if refusal := self._commanders.refusal((f"{KEYED}{peer}" if self._keyed else peer, 0), 1, now):
            self.counts.foreign += 1
            return Asked(None, refusal, self._reply)
        try:
            return Asked(commands.decode_json(request.bytes), "", self._reply)
        except CommandError as error:
            return Asked(None, str(error), self._reply)

    def _reply(self, states: Sequence[State], described: Mapping[str, object]) -> None:
        reply = {"states": [commands.as_json(each) for each in states], **described}
        try:
            self.pollable.send(json.dumps(reply).encode(), zmq.NOBLOCK)
        except zmq.ZMQError:
            self.counts.broken += 1

    def tend(self, now: float) -> Sequence[Admitted]:  # noqa: ARG002 - as in a source
        """Do nothing: no work is due by the clock."""
        return ()

    def close(self) -> None:
        """Close the socket."""
        self.pollable.close()
