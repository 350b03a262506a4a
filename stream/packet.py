"""Packets, their senders, and what a source says that has none."""

import math
from collections.abc import Sequence
from ipaddress import IPv4Network, IPv6Network, ip_address
from typing import TypeVar

_Key = TypeVar("_Key")
_Value = TypeVar("_Value")
#: A datagram, or the parts of a ZeroMQ message.
Packet = bytes | list[bytes]
#: Networks whose packets are read; empty for all.
Networks = Sequence[IPv4Network | IPv6Network]
#: Host and port of a packet's sender; None where the transport does not say.
Sender = tuple[str, int] | None
#: In place of a host: before the name of a sender that has shown a known key.
KEYED = "key "


def parts_of(packet: Packet) -> list[bytes]:
    """Give a packet's parts; a datagram is one part."""
    return [packet] if isinstance(packet, bytes) else packet


def remember(known: dict[_Key, _Value], key: _Key, value: _Value, most: int) -> None:
    """Remember a value by what a stranger has named; of more than `most` the oldest is forgotten."""
    if key not in known and len(known) >= most:
        del known[next(iter(known))]
    known[key] = value


def datagram_of(packet: Packet) -> bytes:
    """Give the bytes of a datagram, or the last part of a message; empty for a message without parts."""
    return packet if isinstance(packet, bytes) else packet[-1] if packet else b""


def sender_name(sender: Sender) -> str:
    """Write a sender as host:port, or as its host or key where it has no port; empty where the transport says none."""
    host, port = sender or ("", 0)
    return f"{host}:{port}" if port else host


def is_within(host: str, networks: Networks) -> bool:
    """Say whether an address in numbers, perhaps with a zone (`fe80::1%eth0`), belongs to one of the networks."""
    address = ip_address(host.partition("%")[0])
    return any(address in network for network in networks)


class IdleSource:
    """What a service's loop asks of a source: this one has no packets aside, waits for nobody, and is never late."""

    #: No frames come in here.
    place = ""
    #: Notes for a person, a line each.
    notes: Sequence[str] = ()
    patience = math.inf
    waited = lag = 0.0
    has_put_aside = False
