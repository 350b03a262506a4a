"""The recorder, which keeps every packet of one receiver in a raw recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinespace.stream.inputs.recording.kinerec import RawPacket
from kinespace.stream.packet import parts_of

if TYPE_CHECKING:
    from kinespace.stream.feeds import Preset
    from kinespace.stream.inputs.recording.kinerec import RawWriter
    from kinespace.stream.packet import Packet, Receiver, Sender


def source_name(receiver: Receiver, preset: Preset | None = None) -> str:
    """Name the place where packets come in, and the preset by which they are read, for a raw recording's header."""
    return f"{receiver.place} feed {preset.name}" if preset else receiver.place


class Recorder:
    """Writes the packets that come in at one place.

    Parameters
    ----------
    writer, index
        The writer, and the index of this source in the recording.
    """

    def __init__(self, writer: RawWriter, index: int) -> None:
        self._writer = writer
        self._index = index

    @property
    def note(self) -> str:
        """A note on the recording for a person; empty when all is well."""
        writer = self._writer
        return f"recording: {writer.trouble}; {writer.failed} packets lost" if writer.trouble or writer.failed else ""

    def keep(self, packet: Packet, arrival: float, sender: Sender) -> None:
        """Write one packet that came at `arrival`, seconds; the writer counts a failure."""
        named = f"{sender[0]}:{sender[1]}" if sender else ""
        self._writer.write(RawPacket(arrival, self._index, named, tuple(parts_of(packet))))
