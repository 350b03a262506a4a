"""A feed's endpoint: datagrams in, frames out, and what the sender must be told; the thinnest possible."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinespace.stream.feeds.frame_assembler import FORGET_AFTER, FrameAssembler
from kinespace.stream.feeds.handshake import NEVER, farewells, is_due, questions
from kinespace.stream.oscpacket import PacketError, decode_packet
from kinespace.stream.receiver import ReceivingSource

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.feeds.preset import Preset
    from kinespace.stream.frame import Announcement, Frame
    from kinespace.stream.receiver import PacketReceiver
    from kinespace.stream.status import InputCounts

#: Hosts that send to one port at once.
MOST_SENDERS = 16


class FeedSource(ReceivingSource[bytes]):
    """Frames from OSC packets of another product.

    Parameters
    ----------
    receiver
        Where they come in.
    preset
        What they mean.
    sender
        The host that must be told to send, for presets that ask.

    Attributes
    ----------
    unasked
        Packets to the sender that the system would not take.
    """

    def __init__(self, receiver: PacketReceiver, preset: Preset, *, sender: str = "127.0.0.1") -> None:
        super().__init__(receiver)
        self.receiver = receiver
        self.preset = preset
        self.assembler = FrameAssembler(preset)
        self.unasked = 0
        self._sender = sender
        self._undecodable = 0
        self._asked = self._heard = NEVER
        self._senders = SenderNumbers()

    def __str__(self) -> str:
        host, port = self.receiver.address
        return f"{self.preset.name} {host}:{port}"

    @property
    def counts(self) -> InputCounts:
        """What came in so far."""
        made = self.assembler.counts
        self._counts.malformed = self._undecodable + made.malformed
        self._counts.foreign = made.foreign
        self._counts.incomplete = made.incomplete + made.absurd
        self._counts.overrun = self.receiver.kernel_drops
        return super().counts

    def _understood(self, packet: bytes, arrival: float) -> Sequence[Frame | Announcement]:
        try:
            messages = decode_packet(packet)
        except PacketError:
            self._undecodable += 1
            return ()
        host = self.receiver.sender[0] if self.receiver.sender else ""
        number = self._senders.number(host, arrival)
        made = self.assembler.push(messages, arrival, bundle=packet[:1] == b"#", sender=number)
        if made:
            self._heard = arrival
        return made

    def tend(self, now: float) -> Sequence[Frame | Announcement]:
        """Close frames that nothing more comes for, and tell the sender what it must be told."""
        asking = self.preset.asking
        if asking and is_due(asking, now, self._asked, self._heard):
            self._asked = now
            self._tell(questions(self.preset, self.receiver.address[1]))
        return self.assembler.expire(now)

    def _tell(self, packets: Sequence[bytes]) -> None:
        if self.preset.asking:
            target = self._sender, self.preset.asking.port
            self.unasked += sum(not self.receiver.send_to(packet, target) for packet in packets)

    def close(self) -> None:
        """Tell the sender to stop and close the socket."""
        self._tell(farewells(self.preset, self.receiver.address[1]))
        super().close()


class SenderNumbers:
    """Tells hosts that send to one port apart; a number is free again when its host has been silent.

    Programs on one host are not told apart: many send each packet from another port.
    """

    def __init__(self) -> None:
        self._numbers: dict[str, tuple[int, float]] = {}

    def number(self, host: str, now: float) -> int:
        """Give a host's number, from 1; beyond `MOST_SENDERS` they share the last."""
        if host in self._numbers:
            number = self._numbers[host][0]
        else:
            self._numbers = {
                name: (number, heard) for name, (number, heard) in self._numbers.items() if now - heard <= FORGET_AFTER
            }
            taken = {number for number, _ in self._numbers.values()}
            free = [number for number in range(1, MOST_SENDERS + 1) if number not in taken]
            if not free:
                return MOST_SENDERS
            number = free[0]
        self._numbers[host] = (number, now)
        return number
