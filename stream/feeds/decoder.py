"""The decoder of other products' OSC packets, which also numbers their hosts."""

from __future__ import annotations

from collections.abc import Sequence

from kinespace.stream.feeds.frame_assembler import FORGET_AFTER, FrameAssembler
from kinespace.stream.feeds.preset import Preset
from kinespace.stream.feeds.unpackers import UNPACKERS
from kinespace.stream.frame import Input
from kinespace.stream.osc.packet import PacketError
from kinespace.stream.packet import Packet, Sender, datagram_of
from kinespace.stream.status import InputCounts, Refusals

#: Hosts that may send to one port at once.
MAX_SENDERS = 16


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
    """

    expires = True

    def __init__(self, preset: Preset) -> None:
        self.assembler = FrameAssembler(preset)
        self._unpack = UNPACKERS[preset.packing]()
        self._whole = preset.packing != "osc"
        self._received = self._undecodable = 0
        self._senders = SenderNumbers()
        self.refusals = Refusals()

    @property
    def counts(self) -> InputCounts:
        """Counts of packets, and of packets that could not be read."""
        made = self.assembler.counts
        return InputCounts(
            received=self._received,
            malformed=self._undecodable + made.malformed,
            foreign=made.foreign,
            incomplete=made.incomplete + made.absurd,
        )

    def decode(self, packet: Packet, arrival: float, sender: Sender) -> Sequence[Input]:
        """Decode one packet; give the frames that it completed."""
        self._received += 1
        datagram = datagram_of(packet)
        try:
            messages = self._unpack(datagram)
        except PacketError as error:
            self._undecodable += 1
            self.refusals.note("malformed", str(error), sender, packet)
            return ()
        number = self._senders.number(sender[0] if sender else "", arrival)
        counts = self.assembler.counts
        malformed = counts.malformed
        made = self.assembler.push(messages, arrival, bundle=self._whole or datagram[:1] == b"#", sender=number)
        if counts.malformed > malformed:
            self.refusals.note("malformed", self.assembler.why_malformed, sender, packet)
        return made

    def expire(self, now: float) -> Sequence[Input]:
        """Close frames that wait for too long."""
        return self.assembler.expire(now)


class SenderNumbers:
    """Numbers the hosts that send to one port; a host that has been silent gives its number back.

    Programs on one host share its number, because many send each packet from another port.
    """

    def __init__(self) -> None:
        self._numbers: dict[str, tuple[int, float]] = {}

    def number(self, host: str, now: float) -> int:
        """Give a host's number, from 1; beyond `MAX_SENDERS` they share the last."""
        if host in self._numbers:
            number = self._numbers[host][0]
        else:
            self._numbers = {
                name: (number, last) for name, (number, last) in self._numbers.items() if now - last <= FORGET_AFTER
            }
            taken = {number for number, _ in self._numbers.values()}
            free = [number for number in range(1, MAX_SENDERS + 1) if number not in taken]
            if not free:
                return MAX_SENDERS
            number = free[0]
        self._numbers[host] = (number, now)
        return number
