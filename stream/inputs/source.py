"""A source: packets from a receiver, what a decoder makes of them, and a recording of them where one is wanted."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.frame import Input
    from kinespace.stream.inputs.decoder import Decoder
    from kinespace.stream.inputs.receiver import Receiver
    from kinespace.stream.recording.recorder import Recorder
    from kinespace.stream.status import InputCounts


class Source:
    """Frames from one address.

    Parameters
    ----------
    receiver
        Where packets come in; closed by `close`.
    decoder
        What they mean.
    recorder
        Keeps every packet before it is decoded; None for no recording.
    """

    def __init__(self, receiver: Receiver, decoder: Decoder, recorder: Recorder | None = None) -> None:
        self.receiver = receiver
        self.decoder = decoder
        self._recorder = recorder

    def __str__(self) -> str:
        return str(self.receiver)

    @property
    def pollable(self) -> object:
        """The socket."""
        return self.receiver.socket

    @property
    def tended(self) -> bool:
        """Whether `tend` has something to do even when nothing comes."""
        return self.decoder.expires

    @property
    def counts(self) -> InputCounts:
        """What came in so far; a copy."""
        receiver = self.receiver
        return replace(self.decoder.counts, overrun=receiver.kernel_drops, broken=receiver.broken())

    @property
    def notes(self) -> list[str]:
        """What a person should know of this source now, a line each."""
        return [self._recorder.note] if self._recorder and self._recorder.note else []

    def take(self, arrival: float) -> Sequence[Input] | None:
        """Take in one packet; what it held, in order, or None when nothing is waiting. Never raises."""
        packet = self.receiver.receive()
        if packet is None:
            return None
        sender = self.receiver.sender
        if self._recorder:
            self._recorder.keep(packet, arrival, sender)
        return self.decoder.decode(packet, arrival, sender)

    def tend(self, now: float) -> Sequence[Input]:
        """Do what is due by the clock; what came of it, in order. Never raises."""
        return self.decoder.expire(now)

    def close(self) -> None:
        """Close the socket."""
        self.receiver.close()
