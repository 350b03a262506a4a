"""The source of another product's feed, and the messages that some senders need before and while they send."""

from __future__ import annotations

import math
from collections.abc import Sequence

from kinespace.stream.feeds.decoder import FeedDecoder
from kinespace.stream.feeds.preset import AskedMessage, Asking, Preset
from kinespace.stream.frame import Admitted
from kinespace.stream.inputs.admission import Admission
from kinespace.stream.inputs.recording.kinerec import Recorder
from kinespace.stream.inputs.source import Source
from kinespace.stream.osc.packet import encode_message
from kinespace.stream.osc.udp import LookedUp, OscReceiver
from kinespace.stream.packet import Receiver
from kinespace.stream.teaching.commands import Asked

#: Seconds without a frame after which a sender is silent.
SILENCE = 1.0


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
        self._asked = self._last_frame = -math.inf
        self._sender = LookedUp(sender, preset.asking.port) if preset.asking else None

    def __str__(self) -> str:
        return f"{self.preset.name} {str(self.receiver).partition(' ')[2]}"

    def take(self, arrival: float) -> Sequence[Admitted | Asked] | None:
        """Take in one packet; give its commands, and the frames that it completed; None when no packet waits."""
        made = super().take(arrival)
        if made:
            self._last_frame = arrival
        return made

    def tend(self, now: float) -> Sequence[Admitted]:
        """Close frames that wait for too long, and send the sender its messages when they are due."""
        asking = self.preset.asking
        if asking and is_due(asking, now, self._asked, self._last_frame):
            self._asked = now
            self._send(asking.messages)
        return super().tend(now)

    def _send(self, messages: Sequence[AskedMessage]) -> None:
        if self._sender is None or not isinstance(self.receiver, OscReceiver):
            return
        target = self._sender.address
        packets = packets_for_sender(self.preset, messages, self.receiver.address[1])
        self.unasked += sum(target is None or not self.receiver.send_to(packet, target) for packet in packets)

    def close(self) -> None:
        """Ask the sender to stop, and close the socket."""
        if self.preset.asking:
            self._send(self.preset.asking.farewell)
        super().close()


def is_due(asking: Asking, now: float, asked: float, last_frame: float) -> bool:
    """Say whether messages to the sender are due.

    Parameters
    ----------
    asking
        The messages for the sender, and how often they are due.
    now, asked, last_frame
        Seconds on one clock: now, when messages were last sent, and when the last frame came; -inf for never.
    """
    return now - asked >= asking.every and not (asking.while_silent and now - last_frame <= SILENCE)


def packets_for_sender(preset: Preset, messages: Sequence[AskedMessage], port: int) -> list[bytes]:
    """Encode messages for the sender, those with `{joint}` once for each joint; `port` is the port we listen on."""
    packets = list[bytes]()
    for each in messages:
        asks_for_joints = "{joint}" in each.address + "".join(map(str, each.arguments))
        joints = [name for name, target in preset.joint_map.items() if target] if asks_for_joints else [""]
        packets += [_message(each, joint, port) for joint in joints]
    return packets


def _message(asked: AskedMessage, joint: str, port: int) -> bytes:
    filled = [
        port
        if argument == "{port}"
        else argument.replace("{joint}", joint).replace("{port}", str(port))
        if isinstance(argument, str)
        else argument
        for argument in asked.arguments
    ]
    return encode_message(asked.address.replace("{joint}", joint), *filled)
