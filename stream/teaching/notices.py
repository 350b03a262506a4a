"""The notices of teaching: the state of a lesson, a taught example, and changes of the library."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kinespace.library.teaching.examples import Roster
    from kinespace.stream.recognition import Event


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
        `good`, `close to <class>`, `cannot be told from <class>` or `unlike your other examples`.
    would_have_started
        How often the class would have started in the performer's last five minutes, without this recording.
    """

    class_name: str
    examples: int
    seconds: float
    words: str
    would_have_started: int


@dataclass(frozen=True, slots=True, eq=False)
class Changed:
    """A request to open and save the library anew.

    Attributes
    ----------
    roster
        All examples now.
    number
        The number of the added example, to be checked; 0 when none was added.
    """

    roster: Roster = field(repr=False)
    number: int = 0


@dataclass(frozen=True, slots=True)
class Saving:
    """A request to save."""


@dataclass(frozen=True, slots=True)
class Running:
    """A request for answers, or for no answers."""

    on: bool


@dataclass(frozen=True, slots=True)
class Sensed:
    """A request for another sensitivity."""

    share: float


@dataclass(frozen=True, slots=True)
class Exchanged:
    """The recognisers compare with another library: its classes, and the ends of motions whose class is gone."""

    classes: tuple[str, ...]
    ended: tuple[Event, ...] = ()


Notice = State | Taught | Changed | Saving | Running | Sensed | Exchanged
