"""Commands among the packets of a feed, and the senders that may give them."""

from __future__ import annotations

from collections.abc import Sequence
from ipaddress import ip_network

from kinespace.stream.packet import KEYED, Networks, Packet, Sender, datagram_of, is_within
from kinespace.stream.teaching import commands, wire
from kinespace.stream.teaching.commands import Asked, CommandError

_TEACH, _RESET = wire.TEACH.encode(), wire.RESET.encode()
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
        if len(self._used) >= _MAX_SENDERS:
            self._used.clear()
        self._used[host] = used, now
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
            said, self.others = wire.said_in(datagram)
            if not said:
                return None
            given = wire.decode(said)
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
