"""Commands among the packets of a feed, and the senders that may give them."""

from __future__ import annotations

from collections.abc import Sequence
from ipaddress import ip_network

from kinespace.stream.packet import KEYED, Networks, Packet, Sender, datagram_of, is_within
from kinespace.stream.teaching import wire
from kinespace.stream.teaching.commands import Asked, CommandError

_TEACH = wire.TEACH.encode()
_THIS_MACHINE = ip_network("127.0.0.0/8"), ip_network("::1/128")


def may_command(sender: Sender, networks: Networks) -> bool:
    """Say whether a sender may command: from this machine, from the given networks, or as the owner of a known key."""
    return sender is not None and (sender[0].startswith(KEYED) or is_within(sender[0], (*_THIS_MACHINE, *networks)))


def holds_command(packet: Packet) -> bool:
    """Say whether a packet holds a command."""
    datagram = datagram_of(packet)
    return datagram.startswith(_TEACH) or (datagram.startswith(b"#bundle") and _TEACH in datagram)


class CommandReader:
    """Reads the commands of one address.

    Parameters
    ----------
    networks
        Networks whose senders may command, as this machine may.

    Attributes
    ----------
    received, refused
        Packets with commands, and packets of senders that may not command.
    """

    def __init__(self, networks: Networks = ()) -> None:
        self._networks = networks
        self.received = self.refused = 0

    def read(self, packet: Packet, sender: Sender) -> Sequence[Asked] | None:
        """Read a packet's commands; None for a packet that holds none: hundreds of frames come each second."""
        if not holds_command(packet):
            return None
        self.received += 1
        if not may_command(sender, self._networks):
            self.refused += 1
            return [Asked(None, f"a control message from {sender[0] if sender else 'elsewhere'}: see --allow-from")]
        try:
            return [Asked(command) for command in wire.decode(datagram_of(packet))]
        except CommandError as error:
            return [Asked(None, str(error))]
