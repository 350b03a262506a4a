"""The recorder, which keeps every packet of one receiver in a raw recording, and recordings while a service runs."""

from __future__ import annotations

import threading
from datetime import datetime
from typing import TYPE_CHECKING

from kinespace.stream.inputs.recording.kinerec import ENDING, RawPacket, RawWriter
from kinespace.stream.packet import parts_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from kinespace.stream.feeds import Preset
    from kinespace.stream.inputs.source import Source
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


class RecordingSession:
    """Starts and ends recordings of a service's sources, each in a new file of one folder.

    Parameters
    ----------
    folder
        The folder for the files, which are called by the time of their beginning.
    sources
        The sources, none of which is being recorded.
    preset
        The preset by which their packets are read; None for our own messages.
    """

    def __init__(self, folder: Path, sources: Sequence[Source], preset: Preset | None = None) -> None:
        self._folder, self._sources, self._preset = folder, sources, preset
        self._writer: RawWriter | None = None
        #: The file that is being written; empty while none is.
        self.name = ""

    def start(self) -> str:
        """Begin a recording, or go on with the one that was begun; give its name.

        Raises
        ------
        OSError
            The file cannot be written.
        """
        if self._writer is None:
            name = f"{datetime.now().astimezone():%Y-%m-%d %H.%M.%S.%f}"[:-4] + ENDING
            presets = {self._preset.name: self._preset.text} if self._preset else {}
            places = [source_name(source.receiver, self._preset) for source in self._sources]
            self._writer = RawWriter(self._folder / name, places, presets)
            self.name = name
            for index, source in enumerate(self._sources):
                source.recorder = Recorder(self._writer, index)
        return self.name

    def stop(self) -> str:
        """End the recording; give its name, empty when there was none."""
        name, self.name = self.name, ""
        writer, self._writer = self._writer, None
        if writer:
            for source in self._sources:
                source.recorder = None
            # The disk may take long, and the feed goes on.
            threading.Thread(target=writer.close, name="kinespace recording's end").start()
        return name
