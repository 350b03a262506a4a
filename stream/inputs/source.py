"""A source: a receiver of packets, their decoder, and perhaps a recorder and a reader of commands."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import TYPE_CHECKING

from kinespace.stream.inputs.turns import Turns, Waiting
from kinespace.stream.packet import datagram_of, sender_name

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.frame import Admitted, Input
    from kinespace.stream.inputs.admission import Admission
    from kinespace.stream.inputs.commands import CommandReader
    from kinespace.stream.inputs.decoder import Decoder
    from kinespace.stream.inputs.detection import Survey
    from kinespace.stream.inputs.recording.kinerec import Recorder
    from kinespace.stream.packet import Receiver, Sender
    from kinespace.stream.status import InputCounts
    from kinespace.stream.teaching.commands import Asked

#: Seconds between two turns of most sources that have work to do even when no packet comes.
TENDING = 0.02
#: Senders that are named in the notes, at most.
_MAX_NAMED = 3
#: Packets of senders served last that are searched for a packet of another sender, at most.
_MAX_LOOKED_THROUGH = 256
#: Seconds that a packet's decoding is charged with, at most: a busy machine takes more, and no sender is to pay for it.
_MAX_CHARGE = 1e-3


class Source:
    """Frames from one address.

    Parameters
    ----------
    receiver
        The receiver of packets; closed by `close`.
    decoder
        The decoder of packets.
    recorder
        Keeps every packet before it is decoded; None for no recording.
    admission
        Admits frames or refuses them, the same for all sources of a service; None admits all.

    Attributes
    ----------
    recorder
        As given; it may change while the source is open.
    has_put_aside
        Whether packets were put aside; the socket does not wake the loop for them.
    commands
        Reads the commands among the packets; None where nobody may command.
    waited
        Seconds for which the last packet waited before it was taken in.
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
        self.recorder: Recorder | Survey | None = recorder
        self.commands: CommandReader | None = None
        self._admission = admission
        self.waited = 0.0
        self._turns, self.has_put_aside = Turns(), False
        self._last_was_aside = False
        self._now = 0.0
        #: The sender's name where the transport names none, or the decoder has numbered the senders itself.
        self._itself = str(receiver), 0

    def __str__(self) -> str:
        return str(self.receiver)

    @property
    def pollable(self) -> object:
        """The socket."""
        return self.receiver.socket

    @property
    def tended_within(self) -> float:
        """Seconds within which `tend` has work to do even when no packet comes; inf if it never has."""
        return TENDING if self.decoder.expires else math.inf

    @property
    def counts(self) -> InputCounts:
        """Counts of all that came in; a copy."""
        receiver = self.receiver
        excess = self._turns.thrown_away
        counts = replace(
            self.decoder.counts, overrun=receiver.kernel_drops, broken=receiver.broken(), thrown_away=excess
        )
        if self.commands:
            counts.received += self.commands.received
            counts.foreign += self.commands.refused
        return counts

    @property
    def notes(self) -> list[str]:
        """Notes on this source for a person, a line each."""
        recording = [self.recorder.note] if self.recorder and self.recorder.note else []
        last = [sender_name(sender) or "a sender" for sender in self._turns.last(self._now)[:_MAX_NAMED]]
        greedy = [f"{name} sends more than its share: served last" for name in last]
        return [*recording, *greedy, *self.decoder.refusals.lines()]

    def take(self, arrival: float) -> Sequence[Admitted | Asked] | None:
        """Take in one packet; give its commands and frames in order, or None when no packet waits. Never raises."""
        self._now = arrival
        taken = self._next(arrival)
        if taken is None:
            return None
        packet, arrival, self.waited, sender = taken
        known = None if self.decoder.expires else sender
        begun = time.perf_counter()
        asked = self.commands.read(packet, sender) if self.commands else None
        # A bundle may hold both commands and frames.
        has_frames = asked is None or datagram_of(packet).startswith(b"#bundle")
        decoded = self.decoder.decode(packet, arrival, sender) if has_frames else ()
        self._turns.charge(sender, min(time.perf_counter() - begun, _MAX_CHARGE), len(decoded), self._now)
        admitted = self._admitted(decoded, arrival, known)
        # Answers to senders go by OSC only.
        if self._admission and sender and isinstance(packet, bytes):
            self._admission.replies_go_to(admitted, sender)
        return [*asked, *admitted] if asked else admitted

    def _next(self, now: float) -> Waiting | None:
        """Take the next packet; packets of senders served last only when nothing else waits, and one in a row."""
        receiver, turns = self.receiver, self._turns
        for _ in range(_MAX_LOOKED_THROUGH):
            packet = receiver.receive()
            if packet is None:
                break
            waited, sender = receiver.waited, receiver.sender
            if self.recorder:
                self.recorder.keep(packet, now - waited, sender)
            taken = Waiting(packet, now - waited, waited, sender)
            if not turns.comes_last(sender, now):
                self._last_was_aside = False
                return taken
            turns.put_aside(taken)
            self.has_put_aside = True
        if not turns.aside or self._last_was_aside:
            self._last_was_aside = False
            return None
        self._last_was_aside = True
        taken = turns.take()
        self.has_put_aside = bool(turns.aside)
        return taken._replace(waited=now - taken.arrival)

    def tend(self, now: float) -> Sequence[Admitted]:
        """Do the work that is due by the clock; give the frames that it completed, in order. Never raises."""
        return self._admitted(self.decoder.expire(now), now, None)

    def _admitted(self, events: Sequence[Input], arrival: float, sender: Sender) -> Sequence[Admitted]:
        if self._admission is None or not events:
            return events
        return self._admission.admit(events, arrival, sender or self._itself)

    def close(self) -> None:
        """Close the socket."""
        self.receiver.close()
