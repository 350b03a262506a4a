"""What teaching tells: how a lesson goes, what was taught, and that the library has changed."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kinespace.library.teaching.examples import Roster


class Step(StrEnum):
    """Where a lesson stands."""

    COUNTDOWN = "countdown"
    WAITING = "waiting"
    RECORDING = "recording"
    CHECKING = "checking"
    DONE = "done"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class State:
    """How a lesson goes, or what became of a command.

    Attributes
    ----------
    performer
        Of whom; empty for a command that is about nobody.
    step
        Where the lesson stands.
    seconds
        Left to count down, recorded so far, or kept.
    reason
        Why it was refused, what was trimmed, or what was done; may be empty.
    """

    performer: str
    step: Step
    seconds: float = 0.0
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Taught:
    """What came of an example.

    Attributes
    ----------
    class_name
        Of the example.
    examples
        How many the class has now.
    seconds
        How much of the recording is kept.
    words
        `good`, `close to <class>`, `cannot be told from <class>` or `unlike your other examples`.
    would_have_started
        How often the class would have started in the performer's last five minutes, this recording not counted.
    """

    class_name: str
    examples: int
    seconds: float
    words: str
    would_have_started: int


@dataclass(frozen=True, slots=True, eq=False)
class Changed:
    """The library is to be opened anew, and saved.

    Attributes
    ----------
    roster
        All examples now.
    number
        The example that was added, to be checked; 0 when none was.
    """

    roster: Roster = field(repr=False)
    number: int = 0


@dataclass(frozen=True, slots=True)
class Saving:
    """Somebody asked to save."""


@dataclass(frozen=True, slots=True)
class Running:
    """Somebody asked for answers, or for none."""

    on: bool


Notice = State | Taught | Changed | Saving | Running
