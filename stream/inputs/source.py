"""A source: packets from a receiver, what a decoder makes of them, and a recording of them where one is wanted."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.frame import Admitted, Input
    from kinespace.stream.inputs.admission import Admission
    from kinespace.stream.inputs.decoder import Decoder
    from kinespace.stream.inputs.receiver import Receiver, Sender
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
    admission
        Lets frames in or not, the same for all sources of a service; None for all.
    """

    def __init__(
        self,
        receiver: Receiver,
        decoder: Decoder,
        recorder: Recorder | None = None,
        admission: Admission | None = None,
    ) -> None:
        self.receiver = receiver
        self.decoder = decoder
        self._recorder = recorder
        self._admission = admission
        #: For what does not tell senders apart, or has done so itself.
        self._itself = str(receiver), 0

    def __str__(self) -> str:
        return str(self.receiver)

    @property
    def pollable(self) -> object:
        """The socket."""
        return self.receiver.socket

    @property
    def waited(self) -> float:
        """Seconds for which the last packet waited in the system before it was taken in."""
        return self.receiver.waited

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
        recording = [self._recorder.note] if self._recorder and self._recorder.note else []
        return [*recording, *self.decoder.refusals.lines()]

    def take(self, arrival: float) -> Sequence[Admitted] | None:
        """Take in one packet; what it held, in order, or None when nothing is waiting. Never raises."""
        packet = self.receiver.receive()
        if packet is None:
            return None
        arrival -= self.receiver.waited
        sender = self.receiver.sender
        if self._recorder:
            self._recorder.keep(packet, arrival, sender)
        known = None if self.decoder.expires else sender
        admitted = self._admitted(self.decoder.decode(packet, arrival, sender), arrival, known)
        if self._admission and sender:
            self._admission.replies_go_to(admitted, sender)
        return admitted

    def tend(self, now: float) -> Sequence[Admitted]:
        """Do what is due by the clock; what came of it, in order. Never raises."""
        return self._admitted(self.decoder.expire(now), now, None)

    def _admitted(self, events: Sequence[Input], arrival: float, sender: Sender) -> Sequence[Admitted]:
        if self._admission is None or not events:
            return events
        return self._admission.admit(events, arrival, sender or self._itself)

    def close(self) -> None:
        """Close the socket."""
        self.receiver.close()
