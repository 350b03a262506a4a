"""Commands where nobody may teach: recordings alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinespace.stream.inputs.recording.recorder import RecordingSession
from kinespace.stream.teaching import Asked, Step, commands
from kinespace.tools.teaching.control import Control

if TYPE_CHECKING:
    from pathlib import Path


def test_a_recording_begins_and_ends_without_teaching(tmp_path: Path) -> None:
    """The reply names the recording while it goes on; the end of the program ends it."""
    control = Control()
    control.recording = RecordingSession(tmp_path, [])
    (begun,) = control.carry_out(Asked(commands.Record(on=True)))
    name = control.recording.name
    assert (begun.step, begun.reason) == (Step.DONE, f"recording {name}")
    assert control.described() == {"records": True, "recording": name}
    (ended,) = control.carry_out(Asked(commands.Record(on=False)))
    assert (ended.step, ended.reason) == (Step.DONE, f"recorded {name}")
    control.carry_out(Asked(commands.Record(on=True)))
    control.close()
    assert control.described() == {"records": True, "recording": ""}


def test_teaching_is_refused_with_the_option_that_allows_it() -> None:
    """A command to teach, and a recording without a folder, are refused in words."""
    control = Control()
    (taught,) = control.carry_out(Asked(commands.Teach("ann", "wave")))
    (begun,) = control.carry_out(Asked(commands.Record(on=True)))
    assert [taught.step, begun.step] == [Step.REFUSED, Step.REFUSED]
    assert "--teach FILE" in taught.reason
    assert "--recordings DIR" in begun.reason
