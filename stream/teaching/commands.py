"""The commands of teaching, checked when they are made.

Over OSC and in JSON a command is called by the name of its class in small letters, and has its fields as arguments.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from kinespace.library.teaching.examples import Roster
from kinespace.stream.recognition import GONE, Outcome

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


#: Characters of a class's name and of a performer's name, at most.
MAX_NAME = 64
MAX_REPETITIONS = 50
#: Seconds of a countdown, and of the time before now that an example may be cut from, at most.
MAX_COUNTDOWN, MAX_LAST = 60.0, 15.0
#: Seconds by which that time may lie back.
MAX_AGO = 240.0
#: Labels of answers that are no classes.
_RESERVED = frozenset({GONE, *map(str, Outcome)})


class CommandError(ValueError):
    """A command cannot be read; the message names the argument, the expectation and the value found."""


@dataclass(frozen=True, slots=True)
class Teach:
    """Record examples of a class: count down, wait for movement, record, stop by stillness.

    Attributes
    ----------
    performer
        The performer who shows it; empty for the performer whose frame came last.
    class_name
        `nothing` for motions that must not be named.
    repetitions
        The number of examples, one after the other.
    countdown
        Seconds.

    Raises
    ------
    CommandError
        A name is not allowed, or a number is out of range.
    """

    performer: str
    class_name: str
    repetitions: int = 1
    countdown: float = 3.0

    def __post_init__(self) -> None:
        _require_performer(self.performer)
        _require_class(self.class_name)
        if not 1 <= self.repetitions <= MAX_REPETITIONS:
            raise CommandError(f"repetitions: expected 1 to {MAX_REPETITIONS}, got {self.repetitions}")
        if not 0 <= self.countdown <= MAX_COUNTDOWN:
            raise CommandError(f"countdown: expected 0 to {MAX_COUNTDOWN:g} s, got {self.countdown:g}")


@dataclass(frozen=True, slots=True)
class Last:
    """Take the performer's last movement as an example, or the movement that ended some seconds ago.

    Raises
    ------
    CommandError
        A name is not allowed, or a number is out of range.
    """

    performer: str
    seconds: float
    class_name: str
    ago: float = 0.0

    def __post_init__(self) -> None:
        _require_performer(self.performer)
        _require_class(self.class_name)
        if not 0 <= self.ago <= MAX_AGO:
            raise CommandError(f"ago: expected 0 to {MAX_AGO:g} s, got {self.ago:g}")
        if not 0 < self.seconds <= MAX_LAST:
            raise CommandError(f"seconds: expected up to {MAX_LAST:g}, got {self.seconds:g}")


@dataclass(frozen=True, slots=True)
class Hold:
    """Record an example from now on, however little the performer moves; with `on` false end it.

    Raises
    ------
    CommandError
        A name is not allowed.
    """

    performer: str
    class_name: str
    on: bool = True

    def __post_init__(self) -> None:
        _require_performer(self.performer)
        _require_class(self.class_name)


@dataclass(frozen=True, slots=True)
class Right:
    """The performer's last named motion becomes an example of its class; without a performer, the last of all."""

    performer: str = ""

    def __post_init__(self) -> None:
        _require_performer(self.performer)


@dataclass(frozen=True, slots=True)
class Wrong:
    """The performer's last named motion becomes an example of `nothing`; without a performer, the last of all."""

    performer: str = ""

    def __post_init__(self) -> None:
        _require_performer(self.performer)


@dataclass(frozen=True, slots=True)
class Rename:
    """Rename a taught class; CommandError for a name that is not allowed."""

    class_name: str
    to: str

    def __post_init__(self) -> None:
        _require_class(self.to)


@dataclass(frozen=True, slots=True)
class Forget:
    """Forget a taught class; all taught classes when the name is empty."""

    class_name: str


@dataclass(frozen=True, slots=True)
class Enable:
    """Answer a class, or stop answering it."""

    class_name: str
    on: bool


@dataclass(frozen=True, slots=True)
class Stop:
    """End the recording that goes on; it becomes an example."""


@dataclass(frozen=True, slots=True)
class Cancel:
    """End the lesson that goes on without an example."""


@dataclass(frozen=True, slots=True)
class Undo:
    """Undo the last change."""


@dataclass(frozen=True, slots=True)
class Save:
    """Save to the file given at the start."""


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Recognise all performers with another sensitivity (`stream.recognizer.settings`); CommandError beyond 0 to 1."""

    share: float

    def __post_init__(self) -> None:
        if not 0 <= self.share <= 1:
            raise CommandError(f"share: expected 0 to 1, got {self.share:g}")


@dataclass(frozen=True, slots=True)
class Reset:
    """Count a performer's motions from 1 again, by the name or as it stands in addresses; without one everybody's."""

    performer: str = ""

    def __post_init__(self) -> None:
        _require_performer(self.performer)


@dataclass(frozen=True, slots=True)
class List:
    """Change nothing; the reply has the classes and settings, as every reply does."""


#: What gives an example, and what changes or ends something.
_Showing = Teach | Last | Hold | Right | Wrong
_Changing = Rename | Forget | Enable | Stop | Cancel | Undo | Save | Sensitivity | Reset | List
Command = _Showing | _Changing


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """A command that came in.

    Attributes
    ----------
    command
        The command; None for one that could not be read, or whose sender may not command.
    refusal
        Why there is none.
    reply
        Takes the states that follow at once, and the description of classes and settings; None where nobody waits.
    """

    command: Command | None
    refusal: str = ""
    reply: Callable[[Sequence[State], Mapping[str, object]], None] | None = None


def _require_class(name: str) -> None:
    """Refuse a name that is not allowed for a class; CommandError."""
    if not 1 <= len(name) <= MAX_NAME:
        raise CommandError(f"class: expected a name of 1 to {MAX_NAME} characters, got {len(name)}")
    if "/" in name or not name.isprintable() or name != name.strip():
        raise CommandError(f"class: expected a name without / and without control characters, got {name!a}")
    if name in _RESERVED:
        raise CommandError(f"class: expected another name than {', '.join(sorted(_RESERVED))}, got {name}")


def _require_performer(name: str) -> None:
    if len(name) > MAX_NAME:
        raise CommandError(f"performer: expected at most {MAX_NAME} characters, got {len(name)}")
