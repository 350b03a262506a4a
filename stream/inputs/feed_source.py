"""The source of a feed whose sender needs messages before and while it sends."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinespace.stream.feeds.decoder import FeedDecoder
from kinespace.stream.feeds.handshake import NEVER, farewells, is_due, questions
from kinespace.stream.inputs.source import Source
from kinespace.stream.osc.udp import LookedUp, OscReceiver

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.stream.feeds.preset import Preset
    from kinespace.stream.frame import Admitted
    from kinespace.stream.inputs.admission import Admission
    from kinespace.stream.inputs.recording.recorder import Recorder
    from kinespace.stream.packet import Receiver
    from kinespace.stream.teaching.commands import Asked


class FeedSource(Source):
    """Frames from OSC packets of another product.

    Parameters
    ----------
    receiver
        Where the packets come in. Only a UDP port can also send messages to the sender.
    preset
        The meaning of the packets.
    sender
        The host that gets the messages, for presets that have any.
    recorder
        Keeps every packet; None for no recording.
    admission
        Admits frames or refuses them; None admits all.

    Attributes
    ----------
    unasked
        Packets to the sender that the system would not send.
    """

    decoder: FeedDecoder

    def __init__(
        self,
        receiver: Receiver,
        preset: Preset,
        *,
        sender: str = "127.0.0.1",
        recorder: Recorder | None = None,
        admission: Admission | None = None,
    ) -> None:
        super().__init__(receiver, FeedDecoder(preset), recorder, admission)
        self.preset = preset
        self.unasked = 0
        self._asked = self._heard = NEVER
        self._sender = LookedUp(sender, preset.asking.port) if preset.asking else None

    def __str__(self) -> str:
        return f"{self.preset.name} {str(self.receiver).partition(' ')[2]}"

    def take(self, arrival: float) -> Sequence[Admitted | Asked] | None:
        """Take in one packet; give its commands, and the frames that it completed; None when no packet waits."""
        made = super().take(arrival)
        if made:
            self._heard = arrival
        return made

    def tend(self, now: float) -> Sequence[Admitted]:
        """Close frames that wait for too long, and send the sender its messages when they are due."""
        asking = self.preset.asking
        if asking and is_due(asking, now, self._asked, self._heard):
            self._asked = now
            self._tell(questions)
        return super().tend(now)

    def _tell(self, encoded: Callable[[Preset, int], list[bytes]]) -> None:
        if self._sender is None or not isinstance(self.receiver, OscReceiver):
            return
        target = self._sender.address
        packets = encoded(self.preset, self.receiver.address[1])
        self.unasked += sum(target is None or not self.receiver.send_to(packet, target) for packet in packets)

    def close(self) -> None:
        """Tell the sender to stop and close the socket."""
        self._tell(farewells)
        super().close()
