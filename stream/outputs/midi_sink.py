"""Answers as MIDI, to a port or into a file: a note for each class, controllers for score and progress."""

import errno
import os
import struct
import time
from pathlib import Path
from typing import Any, BinaryIO

from kinespace.stream.outputs.sink import Sink, extra
from kinespace.stream.recognition import Done, Event, EventKind, Gone, Recognition
from kinespace.stream.status import Status

#: The name among the layouts of `--out`.
MIDI = "midi"
#: The note of the first class while a motion goes on, and its short note when a motion was done; others follow.
GOES_ON, DONE = 60, 36
#: Controllers: score; phase; speed and amplitude, 64 as fast and as large as usual.
SCORE, PHASE, SPEED, AMPLITUDE = 20, 21, 22, 23
#: MIDI's channels and its highest number; performers have a channel each, those after the sixteenth share.
_CHANNELS, _MOST = 16, 127
#: A file's ticks in half a second; its beginning, before the length of its one track in bytes; a track's end.
_TICKS = 480
_BEGINNING = b"MThd" + struct.pack(">IHHH", 6, 0, 1, _TICKS) + b"MTrk"
_END = b"\x00\xff\x2f\x00"


class MidiSink(Sink):
    """Plays answers.

    Parameters
    ----------
    place
        The beginning of a port's name, a file that ends with `.mid`, or nothing: the first port.

    Raises
    ------
    ImportError
        mido is not there, or python-rtmidi for a port.
    OSError
        There is no such port; the message names those that are there.

    Attributes
    ----------
    is_behind
        Whether a file lacks notes, for want of room.
    """

    def __init__(self, place: str = "") -> None:
        self._mido, self.is_behind = extra("mido", MIDI), False
        #: The channel of each performer, and the value of each controller that was sent last.
        self._channels: dict[str, int] = {}
        self._sent: dict[tuple[int, int], int] = {}
        self._port: Any = None
        self._file: BinaryIO | None = None
        if place.endswith(".mid"):
            self._name, self._begun, self._ticks = place, time.monotonic(), 0
            #: The track's bytes that are not in the file yet, and how many are in it.
            self._track, self._written, self.is_behind = bytearray(), 0, True
            # An unwritable place is said before anybody moves.
            self._file = Path(place).open("wb", buffering=0)  # noqa: SIM115 - open until `close`
            self._write()
            return
        try:
            names = self._mido.get_output_names()
        except ImportError as error:
            # The extra has python-rtmidi for the Pythons for which it has wheels.
            why = f"no port without rtmidi ({error}): pip install python-rtmidi"
            raise ImportError(f"--out midi: {why}; --out midi=FILE.mid writes a file") from error
        except Exception as error:
            raise OSError(f"--out midi: no MIDI here ({error}); --out midi=FILE.mid writes a file") from error
        self._name = next((name for name in names if name.startswith(place)), "")
        if not self._name:
            raise OSError(f"--out midi: no port {place!r}; there are: {', '.join(names) or 'none'}")
        self._port = self._mido.open_output(self._name)

    def __str__(self) -> str:
        return f"MIDI {self._name}"

    def publish_recognition(self, recognition: Recognition) -> None:
        """Send the controllers that have changed."""
        if self._file:
            # A file would grow by thirty numbers a second: it holds the notes.
            return
        channel, progress = self._channel(recognition.performer), recognition.progress
        values = {SCORE: recognition.score * _MOST}
        if progress:
            values |= {PHASE: progress.phase * _MOST, SPEED: progress.speed * 64, AMPLITUDE: progress.amplitude * 64}
        for control, value in values.items():
            number = min(max(round(value), 0), _MOST)
            if self._sent.get((channel, control)) != number:
                self._sent[channel, control] = number
                self._send("control_change", channel=channel, control=control, value=number)

    def publish_event(self, event: Event) -> None:
        """Begin the class's note, as loud as it is sure, or end it."""
        kind = "note_on" if event.kind is EventKind.START else "note_off"
        self._note(kind, event.performer, GOES_ON + event.index, event.score)

    def publish_done(self, done: Done) -> None:
        """Play the class's short note."""
        for kind in ("note_on", "note_off"):
            self._note(kind, done.performer, DONE + done.index, done.score)

    def _note(self, kind: str, performer: str, note: int, score: float) -> None:
        velocity = min(max(round(score * _MOST), 1), _MOST)
        self._send(kind, channel=self._channel(performer), note=min(note, _MOST), velocity=velocity)

    def publish_gone(self, gone: Gone) -> None:
        """Give the performer's channel to the next newcomer."""
        self._channels.pop(gone.performer, None)

    def _channel(self, performer: str) -> int:
        if performer not in self._channels:
            taken = {*self._channels.values()}
            free = (channel for channel in range(_CHANNELS) if channel not in taken)
            self._channels[performer] = next(free, len(self._channels) % _CHANNELS)
        return self._channels[performer]

    def _send(self, kind: str, **numbers: int) -> None:
        message = self._mido.Message(kind, **numbers)
        if self._file is None:
            try:
                self._port.send(message)
            except Exception:  # noqa: BLE001 - as above: a port that is unplugged must not end the recogniser
                self.failed += 1
            return
        now = round((time.monotonic() - self._begun) * 2 * _TICKS)
        self._track += bytes([*self._mido.midifiles.meta.encode_variable_int(now - self._ticks), *message.bytes()])
        self._ticks = now
        self._write()

    def publish_status(self, status: Status) -> None:  # noqa: ARG002 - it comes every second
        """Try again to write what a full disk did not take."""
        self._write()

    def _write(self) -> None:
        """Write what is new into the file, and only then its length: a program that is killed leaves whole notes."""
        if self._file is None or not (self.is_behind or self._track):
            return
        length = self._written + len(self._track)
        try:
            for place, content in (
                (len(_BEGINNING) + 4 + self._written, self._track),
                (0, _BEGINNING + struct.pack(">I", length)),
            ):
                self._file.seek(place)
                if self._file.write(content) < len(content):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))  # noqa: TRY301 - as the system says it
        except OSError as error:
            self.is_behind, self.notes = True, [f"{self._name}: not all notes are written: {error.strerror}"]
        else:
            self.is_behind, self.notes, self._written = False, (), length
            self._track.clear()

    def close(self) -> None:
        """End all notes; end the file, or close the port."""
        if self._file:
            self._track += _END
            self._write()
            self._file.close()
        elif self._port is not None:
            self._port.reset()
            self._port.close()
