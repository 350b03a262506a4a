"""Recordings that begin and end while a service runs."""

from __future__ import annotations

import threading
from datetime import datetime
from typing import TYPE_CHECKING

from kinespace.stream.inputs.recording.kinerec import ENDING, RawWriter
from kinespace.stream.inputs.recording.recorder import Recorder, source_name

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from kinespace.stream.feeds import Preset
    from kinespace.stream.inputs.source import Source


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
