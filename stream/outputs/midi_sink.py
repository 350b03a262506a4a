"""Answers as MIDI: a note for each class, controllers for score and progress."""

from __future__ import annotations

from kinespace.stream.outputs.sink import Sink, extra
from kinespace.stream.recognition import Done, Event, EventKind, Recognition

#: The name among the layouts of `--out`.
MIDI = "midi"
#: The note of the first class while a motion goes on, and its short note when a motion was done; others follow.
GOES_ON, DONE = 60, 36
#: Controllers: score; phase; speed and amplitude, 64 as fast and as large as usual.
SCORE, PHASE, SPEED, AMPLITUDE = 20, 21, 22, 23
#: MIDI's channels and its highest number; performers have a channel each, those after the sixteenth share.
_CHANNELS, _MOST = 16, 127


class MidiSink(Sink):
    """Plays answers.

    Parameters
    ----------
    place
        The beginning of a port's name, or nothing: the first port.

    Raises
    ------
    ImportError
        mido is not there.
    OSError
        There is no such port; the message names those that are there.
    """

    def __init__(self, place: str = "") -> None:
        self._mido = extra("mido", MIDI)
        #: The channel of each performer, and the value of each controller that was sent last.
        self._channels: dict[str, int] = {}
        self._sent: dict[tuple[int, int], int] = {}
        try:
            names = self._mido.get_output_names()
        except Exception as error:
            raise OSError(f"--out midi: this machine has no MIDI ({error})") from error
        self._name = next((name for name in names if name.startswith(place)), "")
        if not self._name:
            raise OSError(f"--out midi: no port {place!r}; there are: {', '.join(names) or 'none'}")
        self._port = self._mido.open_output(self._name)

    def __str__(self) -> str:
        return f"MIDI {self._name}"

    def publish(self, recognition: Recognition) -> None:
        """Send the controllers that have changed."""
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

    def publish_gone(self, performer: str) -> None:
        """Give the performer's channel to the next newcomer."""
        self._channels.pop(performer, None)

    def _channel(self, performer: str) -> int:
        if performer not in self._channels:
            taken = {*self._channels.values()}
            free = (channel for channel in range(_CHANNELS) if channel not in taken)
            self._channels[performer] = next(free, len(self._channels) % _CHANNELS)
        return self._channels[performer]

    def _send(self, kind: str, **numbers: int) -> None:
        try:
            self._port.send(self._mido.Message(kind, **numbers))
        except Exception:  # noqa: BLE001 - as above: a port that is unplugged must not end the recogniser
            self.failed += 1

    def close(self) -> None:
        """End all notes, and close the port."""
        self._port.reset()
        self._port.close()
