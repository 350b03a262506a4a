"""The notices of teaching: the state of a lesson, a taught example; and the change of a library."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from kinespace.library.teaching.examples import Roster

#: Motions an hour, said though they were not meant, that are too many; seconds from which on an hour is spoken of.
_TOO_OFTEN, _ENOUGH = 6.0, 60.0


#: The reason where an example was undone while it was checked.
UNDONE = "undone before it was checked"


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
class Tried:
    """How a class would have been said in the performer's last minutes, its examples left out.

    Attributes
    ----------
    started, done
        How often it would have started, and been done.
    seconds
        Seconds that were looked at; 0 where they are not known.
    """

    started: int = 0
    done: int = 0
    seconds: float = 0.0

    @property
    def words(self) -> str:
        """The numbers in words, and what to do where they are too large; empty where nothing is known."""
        if not self.seconds:
            return ""
        lasted = f"{self.seconds / 60:.0f} minutes" if self.seconds >= 1.5 * _ENOUGH else f"{self.seconds:.0f} s"
        times = "once" if self.done == 1 else f"{self.done} times" if self.done else "not once"
        often = 3600 * self.done / self.seconds
        hourly = f" ({often:.0f} an hour)" if self.done and self.seconds >= _ENOUGH else ""
        step = "; if you did not do it, teach nothing, or show a larger gesture" if often > _TOO_OFTEN else ""
        return f"done {times} in your last {lasted}{hourly}{step}"


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
        your other examples`, and what to change.
    tried
        How often the class would have been said in the performer's last five minutes.
    """

    class_name: str
    examples: int
    seconds: float
    words: str
    tried: Tried = Tried()


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
