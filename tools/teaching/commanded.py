"""`Commanded` carries out the commands of a door; `RecordingDesk` carries out recordings alone, without teaching."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from kinespace.stream.teaching import State, Step, commands

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.inputs.recording.session import RecordingSession
    from kinespace.stream.teaching import Command, Notice


class Commanded(Protocol):
    """Carries out commands, as `RecordingDesk` and `tools.teaching.desk.Desk` do."""

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
        Begins and ends recordings; None without a folder for them.
    """

    def __init__(self) -> None:
        self.recording: RecordingSession | None = None

    def command(self, command: Command) -> list[Notice]:
        """Begin or end a recording; give its notice."""
        if isinstance(command, commands.Record):
            return [recorded(self.recording, on=command.on)]
        return [self.refuse("teaching is off: start live with --teach FILE")]

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
    """Begin or end a recording; give its notice."""
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
