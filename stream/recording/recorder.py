"""The recorder: keeps every packet of one receiver in a raw recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinespace.stream.inputs.receiver import parts_of
from kinespace.stream.recording.kinerec import RawPacket

if TYPE_CHECKING:
    from kinespace.stream.feeds import Preset
    from kinespace.stream.inputs.receiver import Packet, Receiver, Sender
    from kinespace.stream.recording.kinerec import RawWriter


def source_name(receiver: Receiver, preset: Preset | None = None) -> str:
    """Name where packets come in, and the preset by which they are read, as a raw recording's header does."""
    return f"{receiver.place} feed {preset.name}" if preset else receiver.place


class Recorder:
    """Writes what comes in at one place.

    Parameters
    ----------
    writer, index
        Where it is written, and which of the recording's sources it is.
    """

    def __init__(self, writer: RawWriter, index: int) -> None:
        self._writer = writer
        self._index = index

    @property
    def note(self) -> str:
        """What a person should know of the recording now; empty when all is well."""
        writer = self._writer
        return f"recording: {writer.trouble}; {writer.failed} packets lost" if writer.trouble or writer.failed else ""

    def keep(self, packet: Packet, arrival: float, sender: Sender) -> None:
        """Write one packet, as it came at a moment, seconds; a failure is counted by the writer."""
        named = f"{sender[0]}:{sender[1]}" if sender else ""
        self._writer.write(RawPacket(arrival, self._index, named, tuple(parts_of(packet))))
