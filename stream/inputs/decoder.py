"""Decoders: packet, arrival and sender in, frames and announcements out. No socket, no clock, and no error is raised.

A decoder counts packets that it cannot read. A source decodes its receiver's packets; recordings are decoded by the
same decoders, with the recorded arrivals and senders.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import takewhile

from kinespace.stream.feeds.frame_assembler import FORGET_AFTER, FrameAssembler
from kinespace.stream.feeds.preset import Preset
from kinespace.stream.feeds.unpackers import LOOSE, UNPACKERS
from kinespace.stream.frame import Input
from kinespace.stream.osc.messages import decode as decode_datagram
from kinespace.stream.osc.packet import PacketError
from kinespace.stream.packet import Packet, Sender, datagram_of
from kinespace.stream.status import InputCounts, Refusals
from kinespace.stream.zeromq.messages import SequenceGaps
from kinespace.stream.zeromq.messages import decode as decode_message

#: First bytes of OSC packets, which some programs send unchanged: a map begins with another byte.
_OSC = (b"/", b"#bundle\0")
#: First bytes of msgpack maps: of up to 15 fields, and of more.
_MAPS = frozenset([*(bytes([0x80 + fields]) for fields in range(16)), b"\xde", b"\xdf"])


class OwnDecoder:
    """Reads our own messages: OSC packets, and ZeroMQ messages of several parts or of one part in msgpack or OSC.

    Attributes
    ----------
    expires
        Whether frames may stay open until time closes them: then `expire` must be called every few hundredths of a
        second.
    counts
        Counts of packets, and of packets that could not be read.
    refusals
        The last packets that could not be read, with the reason.
    """

    expires = False

    def __init__(self) -> None:
        self.counts = InputCounts()
        self.refusals = Refusals()
        self._gaps = SequenceGaps()

    def decode(self, packet: Packet, arrival: float, sender: Sender) -> Sequence[Input]:
        """Decode a datagram, or a ZeroMQ message.

        Parameters
        ----------
        packet
            As received.
        arrival
            When, seconds on our clock.
        sender
            The sender, where it is known.

        Returns
        -------
        Its frames and announcements in order, and frames that it completed.
        """
        self.counts.received += 1
        if isinstance(packet, bytes) or (len(packet) == 1 and packet[0].startswith(_OSC)):
            events, refused = decode_datagram(datagram_of(packet), arrival)
            for kind, reason in refused:
                self._refuse(kind, reason, sender, packet)
            return events
        first = packet[0] if packet else b""
        if not first.startswith(b"frame/") and (len(packet) != 1 or first[:1] not in _MAPS):
            self._refuse("foreign", "neither a frame nor one part in msgpack or OSC", sender, packet)
            return ()
        try:
            frame, seq, announcement = decode_message(packet, arrival)
        except (ValueError, RecursionError) as error:
            self._refuse("malformed", str(error), sender, packet)
            return ()
        self._gaps.see(frame.performer, seq)
        self.counts.missing = self._gaps.missing
        return (announcement, frame) if announcement else (frame,)

    def _refuse(self, kind: str, reason: str, sender: Sender, packet: Packet) -> None:
        self.counts.malformed += kind == "malformed"
        self.counts.foreign += kind == "foreign"
        self.refusals.note(kind, reason, sender, packet)

    def expire(self, now: float) -> Sequence[Input]:  # noqa: ARG002 - nothing stays open
        """Give nothing: each message is a whole frame."""
        return ()


#: Senders to one port at once, and ports of one of their hosts that are remembered.
MAX_SENDERS = 16
#: Packets from a port after which a program is known to keep to it.
STEADY = 8


class FeedDecoder:
    """Reads OSC packets of another product: datagrams, or the last parts of ZeroMQ messages.

    Parameters
    ----------
    preset
        The meaning of the product's messages.

    Attributes
    ----------
    assembler
        Makes frames of the joints.
    counts
        Counts of packets, and of the assembler.
    """

    expires = True

    def __init__(self, preset: Preset) -> None:
        self.assembler = FrameAssembler(preset)
        self.counts = self.assembler.counts
        self._unpack = UNPACKERS[preset.packing]()
        self._whole = preset.packing not in LOOSE
        self._senders = SenderNumbers()
        self.refusals = Refusals()

    def decode(self, packet: Packet, arrival: float, sender: Sender) -> Sequence[Input]:
        """Decode one packet; give the frames that it completed."""
        self.counts.received += 1
        datagram = datagram_of(packet)
        try:
            messages = self._unpack(datagram)
        except PacketError as error:
            self.counts.malformed += 1
            self.refusals.note("malformed", str(error), sender, packet)
            return ()
        host, port = sender or ("", 0)
        number = self._senders.number(host, arrival, port, messages[0].address if messages else "")
        malformed = self.counts.malformed
        made = self.assembler.push(messages, arrival, bundle=self._whole or datagram[:1] == b"#", sender=number)
        if self.counts.malformed > malformed:
            self.refusals.note("malformed", self.assembler.why_malformed, sender, packet)
        return made

    def expire(self, now: float) -> Sequence[Input]:
        """Close frames that wait for too long."""
        return self.assembler.expire(now)


Decoder = OwnDecoder | FeedDecoder


@dataclass(slots=True)
class _Port:
    """A port of a host: when packets came, how many, some addresses that begin them, whether it is a program's."""

    first: float
    last: float = 0.0
    packets: int = 0
    addresses: set[str] = field(default_factory=set)
    own: bool = False

    def rivals(self, other: "_Port") -> bool:
        """Say whether two ports are of two programs that send the same messages at the same time."""
        steady = min(self.packets, other.packets) >= STEADY and other.last > self.first
        return steady and not self.addresses.isdisjoint(other.addresses)


class SenderNumbers:
    """Numbers the senders to one port; a sender that has been silent gives its number back.

    Programs on one host share its number, because many send each packet from another port; but two that keep to their
    ports, and send the same messages, have numbers of their own.
    """

    def __init__(self) -> None:
        self._numbers: dict[tuple[str, int], tuple[int, float]] = {}
        self._ports: dict[str, dict[int, _Port]] = {}

    def number(self, host: str, now: float, port: int = 0, address: str = "") -> int:
        """Give a sender's number, from 1; beyond `MAX_SENDERS` they share the last."""
        sender = host, self._own_port(host, now, port, address)
        if sender in self._numbers:
            number = self._numbers[sender][0]
        else:
            self._numbers = {name: known for name, known in self._numbers.items() if now - known[1] <= FORGET_AFTER}
            taken = {number for number, _ in self._numbers.values()}
            free = [number for number in range(1, MAX_SENDERS + 1) if number not in taken]
            if not free:
                return MAX_SENDERS
            number = free[0]
        self._numbers[sender] = (number, now)
        return number

    def _own_port(self, host: str, now: float, port: int, address: str) -> int:
        """Give the port of a program that another one of its host, which came before, rivals; else 0."""
        if host not in self._ports and len(self._ports) >= MAX_SENDERS:
            self._ports.clear()
        ports = self._ports.setdefault(host, {})
        if port not in ports and len(ports) >= MAX_SENDERS:
            del ports[min(ports, key=lambda each: ports[each].last)]
        known = ports.setdefault(port, _Port(now))
        known.packets, known.last = known.packets + 1, now
        if len(known.addresses) < MAX_SENDERS:
            known.addresses.add(address)
        # Of two such programs the first keeps the host's number.
        before = takewhile(lambda each: each is not known, ports.values())
        known.own = known.own or any(map(known.rivals, before))
        return port if known.own else 0
