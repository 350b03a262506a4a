"""The notices of teaching: the state of a lesson, a taught example; and the change of a library."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kinespace.library.teaching.examples import Roster


class Step(StrEnum):
    """The states of a lesson."""

    COUNTDOWN = "countdown"
    WAITING = "waiting"
    RECORDING = "recording"
    CHECKING = "checking"
    DONE = "done"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class State:
    """The state of a lesson, or the result of a command.

    Attributes
    ----------
    performer
        The performer's name; empty for a command without a performer.
    step
        The lesson's state.
    seconds
        Seconds left to count down, seconds recorded so far, or seconds kept.
    reason
        The reason of a refusal, the trimming, or the change; may be empty.
    """

    performer: str
    step: Step
    seconds: float = 0.0
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Taught:
    """The result of an example.

    Attributes
    ----------
    class_name
        The example's class.
    examples
        The number of examples that the class has now.
    seconds
        Seconds of the recording that are kept.
    words
        `good so far: show it again to be sure`, `good`, `close to <class>`, `cannot be told from <class>` or `unlike
        your other examples`.
    would_have_started
        How often the class would have started in the performer's last five minutes, without this recording.
    """

    class_name: str
    examples: int
    seconds: float
    words: str
    would_have_started: int


#: What listeners get.
Notice = State | Taught


@dataclass(frozen=True, slots=True, eq=False)
class Changed:
    """A request to open and save the changed library.

    Attributes
    ----------
    roster
        All examples now.
    number
        The number of the added example, to be checked; 0 when none was added.
    """

    roster: Roster = field(repr=False)
    number: int = 0
