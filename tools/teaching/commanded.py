"""What carries out commands that come in by a door: recordings alone, where nobody may teach."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from kinespace.stream.teaching import State, Step, commands

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.inputs.recording.session import RecordingSession
    from kinespace.stream.teaching import Command, Notice


class Commanded(Protocol):
    """Carries out commands; `tools.teaching.desk.Desk` is one, with words for each method."""

    def command(self, command: Command) -> Sequence[Notice]:
        """Carry out a command; give its notices."""

    def refuse(self, reason: str) -> State:
        """Give a notice that a command could not be read."""

    def described(self) -> dict[str, object]:
        """Describe the classes and the settings, for a reply."""

    def tend(self, now: float) -> None:
        """Do the work that is due by the clock."""


class RecordingDesk:
    """Begins and ends recordings; refuses to teach.

    Attributes
    ----------
    recording
        Begins and ends recordings; None: nobody may record.
    """

    def __init__(self) -> None:
        self.recording: RecordingSession | None = None

    def command(self, command: Command) -> list[Notice]:
        """Begin or end a recording; give the notice of it."""
        if isinstance(command, commands.Record):
            return [recorded(self.recording, on=command.on)]
        return [self.refuse("nobody may teach: start live with --teach FILE")]

    def refuse(self, reason: str) -> State:
        """Give a notice that a command could not be carried out."""
        return State("", Step.REFUSED, 0.0, reason)

    def described(self) -> dict[str, object]:
        """Describe the recording, for a reply."""
        return describe_recording(self.recording)

    def tend(self, now: float) -> None:
        """Do nothing: no work is due by the clock."""

    def close(self) -> None:
        """End the recording."""
        if self.recording:
            self.recording.stop()


def recorded(session: RecordingSession | None, *, on: bool) -> State:
    """Begin or end a recording; give the notice of it."""
    if session is None:
        return State("", Step.REFUSED, 0.0, "there is no folder for recordings: start live with --recordings DIR")
    try:
        name = session.start() if on else session.stop()
    except OSError as error:
        return State("", Step.REFUSED, 0.0, f"cannot record: {error.strerror}")
    return State("", Step.DONE, 0.0, f"recording {name}" if on else f"recorded {name}" if name else "not recording")


def describe_recording(session: RecordingSession | None) -> dict[str, object]:
    """Describe the recording that is being made, for a reply."""
    return {"records": session is not None, "recording": session.name if session else ""}
