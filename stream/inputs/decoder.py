"""Decoders: packet, arrival and sender in, frames and announcements out. No socket, no clock, and no error is raised.

A decoder counts packets that it cannot read. A source decodes its receiver's packets; recordings are decoded by the
same decoders, with the recorded arrivals and senders.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from kinespace.stream.frame import Input
from kinespace.stream.osc.frames import decode as decode_datagram
from kinespace.stream.packet import Packet, Sender, datagram_of, parts_of
from kinespace.stream.status import InputCounts, Refusals
from kinespace.stream.zeromq.frames import FormatError, NumberedFrame, SequenceGaps, decode_packed
from kinespace.stream.zeromq.frames import decode as decode_message

#: First bytes of OSC packets, which some programs send unchanged: a map begins with another byte.
_OSC = (b"/", b"#bundle\0")
#: First bytes of msgpack maps: of up to 15 fields, and of more.
_MAPS = frozenset([*(bytes([0x80 + fields]) for fields in range(16)), b"\xde", b"\xdf"])


class Decoder(Protocol):
    """Decodes packets to frames and announcements."""

    #: Whether frames may stay open until time closes them: then `expire` must be called every few hundredths of a
    #: second.
    expires: bool

    @property
    def counts(self) -> InputCounts:
        """Counts of packets, and of packets that could not be read."""

    @property
    def refusals(self) -> Refusals:
        """The last packets that could not be read, with the reason."""

    def decode(self, packet: Packet, arrival: float, sender: Sender) -> Sequence[Input]:
        """Decode one packet.

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

    def expire(self, now: float) -> Sequence[Input]:
        """Close frames that wait for too long; give the frames that this completed."""


class OscDecoder:
    """Reads our own OSC messages."""

    expires = False

    def __init__(self) -> None:
        self.counts = InputCounts()
        self.refusals = Refusals()

    def decode(self, packet: Packet, arrival: float, sender: Sender) -> Sequence[Input]:
        """Decode a datagram."""
        self.counts.received += 1
        received = decode_datagram(packet if isinstance(packet, bytes) else datagram_of(packet), arrival)
        if received.malformed:
            self.counts.malformed += received.malformed
            self.refusals.note("malformed", received.why_malformed, sender, packet)
        if received.foreign:
            self.counts.foreign += received.foreign
            self.refusals.note("foreign", received.why_foreign, sender, packet)
        return received.events

    def expire(self, now: float) -> Sequence[Input]:  # noqa: ARG002 - nothing stays open
        """Give nothing: each message is a whole frame."""
        return ()


class ZmqDecoder(OscDecoder):
    """Reads our own ZeroMQ messages: of several parts, of one part in msgpack, and OSC packets in one part."""

    def __init__(self) -> None:
        super().__init__()
        self._gaps = SequenceGaps()

    def decode(self, packet: Packet, arrival: float, sender: Sender) -> Sequence[Input]:
        """Decode a message."""
        parts = parts_of(packet)
        if len(parts) == 1 and parts[0].startswith(_OSC):
            return super().decode(parts[0], arrival, sender)
        self.counts.received += 1
        try:
            if parts and parts[0].startswith(b"frame/"):
                return self._counted(decode_message(parts, arrival))
            if len(parts) == 1 and parts[0][:1] in _MAPS:
                return self._counted(decode_packed(parts[0], arrival))
        except FormatError as error:
            self.counts.malformed += 1
            self.refusals.note("malformed", str(error), sender, packet)
        else:
            self.counts.foreign += 1
            self.refusals.note("foreign", "neither a frame nor one part in msgpack or OSC", sender, packet)
        return ()

    def _counted(self, numbered: NumberedFrame) -> Sequence[Input]:
        self._gaps.see(numbered.frame.performer, numbered.seq)
        self.counts.missing = self._gaps.missing
        return (numbered.announcement, numbered.frame) if numbered.announcement else (numbered.frame,)
