"""Decoders: packet, arrival and sender in, frames and announcements out. No socket, no clock, and nothing is raised.

A decoder counts what it cannot read. A source decodes what its receiver takes in; a recording is decoded by the same
decoders, with the arrivals and senders that it kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from kinespace.stream.inputs.receiver import datagram_of, parts_of
from kinespace.stream.osc.frames import decode as decode_datagram
from kinespace.stream.status import InputCounts
from kinespace.stream.zeromq import single_part
from kinespace.stream.zeromq.frames import FormatError, SequenceGaps
from kinespace.stream.zeromq.frames import decode as decode_message

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.frame import Input
    from kinespace.stream.inputs.receiver import Packet, Sender
    from kinespace.stream.zeromq.frames import NumberedFrame


class Decoder(Protocol):
    """Makes frames and announcements of packets."""

    #: Whether frames stay open that only time closes: then `expire` is to be called every few hundredths of a second.
    expires: bool

    @property
    def counts(self) -> InputCounts:
        """What was read so far, and what could not be."""

    def decode(self, packet: Packet, arrival: float, sender: Sender) -> Sequence[Input]:
        """Decode one packet.

        Parameters
        ----------
        packet
            As received.
        arrival
            When, seconds on our clock.
        sender
            Who sent it, where that is known.

        Returns
        -------
        What it held, in order, and what it completed.
        """

    def expire(self, now: float) -> Sequence[Input]:
        """Close what nothing more came for; give what that completed."""


class OscDecoder:
    """Reads our own OSC messages."""

    expires = False

    def __init__(self) -> None:
        self.counts = InputCounts()

    def decode(self, packet: Packet, arrival: float, sender: Sender) -> Sequence[Input]:  # noqa: ARG002 - a frame says all
        """Decode a datagram."""
        self.counts.received += 1
        received = decode_datagram(datagram_of(packet), arrival)
        self.counts.malformed += received.malformed
        self.counts.foreign += received.foreign
        return received.events

    def expire(self, now: float) -> Sequence[Input]:  # noqa: ARG002 - nothing stays open
        """Nothing: each message is a whole frame."""
        return ()


class ZmqDecoder(OscDecoder):
    """Reads our own ZeroMQ messages: of several parts, of one part in msgpack, and OSC packets in one part."""

    def __init__(self) -> None:
        super().__init__()
        self._gaps = SequenceGaps()

    def decode(self, packet: Packet, arrival: float, sender: Sender) -> Sequence[Input]:
        """Decode a message."""
        parts = parts_of(packet)
        if len(parts) == 1 and single_part.is_osc(parts[0]):
            return super().decode(parts[0], arrival, sender)
        self.counts.received += 1
        try:
            if parts and parts[0].startswith(b"frame/"):
                return self._counted(decode_message(parts, arrival))
            if len(parts) == 1 and single_part.is_map(parts[0]):
                return self._counted(single_part.decode(parts[0], arrival))
        except FormatError:
            self.counts.malformed += 1
        else:
            self.counts.foreign += 1
        return ()

    def _counted(self, numbered: NumberedFrame) -> Sequence[Input]:
        self._gaps.see(numbered.frame.performer, numbered.seq)
        self.counts.missing = self._gaps.missing
        return (numbered.announcement, numbered.frame) if numbered.announcement else (numbered.frame,)
