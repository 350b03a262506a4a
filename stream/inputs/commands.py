"""Commands among the packets of a feed, and the senders that may give them."""

from __future__ import annotations

import ipaddress
from typing import TYPE_CHECKING

from kinespace.stream.packet import KEYED, datagram_of
from kinespace.stream.teaching import wire
from kinespace.stream.teaching.commands import Asked, CommandError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.packet import Networks, Packet, Sender

_TEACH = wire.TEACH.encode()


class Allowed:
    """The senders that may command: this machine, hosts in the given networks, and owners of known keys.

    Parameters
    ----------
    networks
        Networks whose senders may command, beside this machine.
    """

    def __init__(self, networks: Networks = ()) -> None:
        self._networks = tuple(networks)

    def __call__(self, sender: Sender) -> bool:
        """Whether a sender may command; never, if the transport does not tell the sender."""
        if sender is None:
            return False
        if sender[0].startswith(KEYED):
            return True
        address = ipaddress.ip_address(sender[0].partition("%")[0])
        return address.is_loopback or any(address in network for network in self._networks)


class CommandReader:
    """Reads the commands of one address.

    Parameters
    ----------
    allowed
        The senders that may command.

    Attributes
    ----------
    received, refused
        Packets with commands, and packets of senders that may not command.
    """

    def __init__(self, allowed: Allowed) -> None:
        self._allowed = allowed
        self.received = self.refused = 0

    def read(self, packet: Packet, sender: Sender) -> Sequence[Asked] | None:
        """Read a packet's commands; None for a packet that holds none: hundreds of frames come each second."""
        datagram = datagram_of(packet)
        in_bundle = datagram.startswith(b"#bundle") and _TEACH in datagram
        if not (in_bundle or datagram.startswith(_TEACH)):
            return None
        self.received += 1
        if not self._allowed(sender):
            self.refused += 1
            return [Asked(None, f"a control message from {sender[0] if sender else 'elsewhere'}: see --allow-from")]
        try:
            return [Asked(command) for command in wire.decode(datagram)]
        except CommandError as error:
            return [Asked(None, str(error))]
