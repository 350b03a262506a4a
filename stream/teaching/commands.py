"""The commands of teaching, checked when they are made, and the notices; both over OSC, and in JSON for ZeroMQ.

A command is called by the name of its class in small letters, and has its fields as arguments:
`/motion/teach/<command>` with its arguments in order (`/motion/teach` alone is `teach`), or the same words in JSON:
`{"do": "teach", "performer": "ann", "class": "wave"}`. `/motion/<performer>/count/reset` is `reset`; `*` means all
performers.
"""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, get_args

import msgspec

from kinespace.stream.osc.packet import PacketError, decode_packet, encode_message
from kinespace.stream.recognition import GONE, Outcome
from kinespace.stream.teaching.examples import Roster

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
        return f"done {times} in {lasted} of your movement before{hourly}{step}"


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
        How often the class would have been said in the performer's last minutes.
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


#: What follows from a command, a frame or the time.
Told = list[Notice | Changed]
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


#: The least and the most that numbers may be.
_BOUNDS = {
    "repetitions": (1, MAX_REPETITIONS),
    "countdown": (0, MAX_COUNTDOWN),
    "seconds": (0.01, MAX_LAST),
    "ago": (0, MAX_AGO),
    "share": (0, 1.0),
}


class _Command(msgspec.Struct, frozen=True, rename={"class_name": "class"}):
    """A command; CommandError where a name is not allowed, or a number is out of range."""

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            given = getattr(self, name)
            if name == "performer" and len(given) > MAX_NAME:
                raise CommandError(f"performer: expected at most {MAX_NAME} characters, got {len(given)}")
            if name == "to" or (name == "class_name" and isinstance(self, Teach | Last | Hold)):
                _require_class(given)
            least, most = _BOUNDS.get(name, (0, 0))
            if name in _BOUNDS and not least <= given <= most:
                raise CommandError(f"{name}: expected {least:g} to {most:g}, got {given}")


class Teach(_Command, frozen=True):
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


class Last(_Command, frozen=True):
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


class Hold(_Command, frozen=True):
    """Record an example from now on, however little the performer moves; with `on` false end it.

    Raises
    ------
    CommandError
        A name is not allowed.
    """

    performer: str
    class_name: str
    on: bool = True


class Right(_Command, frozen=True):
    """The performer's last named motion becomes an example of its class; without a performer, the last of all."""

    performer: str = ""


class Wrong(_Command, frozen=True):
    """The performer's last named motion becomes an example of `nothing`; without a performer, the last of all."""

    performer: str = ""


class Rename(_Command, frozen=True):
    """Rename a taught class; CommandError for a name that is not allowed."""

    class_name: str
    to: str


class Forget(_Command, frozen=True):
    """Forget a taught class; all taught classes when the name is empty."""

    class_name: str


class Enable(_Command, frozen=True):
    """Answer a class, or stop answering it."""

    class_name: str
    on: bool


class Stop(_Command, frozen=True):
    """End the recording that goes on; it becomes an example."""


class Cancel(_Command, frozen=True):
    """End the lesson that goes on without an example."""


class Undo(_Command, frozen=True):
    """Undo the last change."""


class Save(_Command, frozen=True):
    """Save to the file given at the start."""


class Sensitivity(_Command, frozen=True):
    """Recognise all performers with another sensitivity (`stream.recognizer.settings`); CommandError beyond 0 to 1."""

    share: float


class Reset(_Command, frozen=True):
    """Count a performer's motions from 1 again, by the name or as it stands in addresses; without one everybody's."""

    performer: str = ""


class List(_Command, frozen=True):
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


#: The beginning of commands' addresses.
TEACH = "/motion/teach"
RESET = "/count/reset"
_RESET = re.compile(f"/motion/([^/]+){RESET}")
#: Commands in one packet, at most: each may take some hundredths of a second, in which nobody is answered.
MAX_COMMANDS = 8
#: Bytes of a JSON request, at most.
_MAX_REQUEST = 10_000
#: The largest number that is read, so that every number can be a float.
_MAX_NUMBER = 1e15
_COMMANDS: dict[str, type[Command]] = {each.__name__.lower(): each for each in get_args(Command)}
#: The arguments of each command, in order, by their names on the wire.
_FIELDS = {word: msgspec.structs.fields(kind) for word, kind in _COMMANDS.items()}
_ARGUMENTS = {word: {each.encode_name: each for each in of} for word, of in _FIELDS.items()}


#: A command's word and its arguments.
_Said = tuple[str, list[object]]


def said_in(packet: bytes) -> tuple[list[_Said], int]:
    """Find the commands of an OSC packet; give them, and the number of its messages that are none.

    Raises
    ------
    CommandError
        The packet is no OSC.
    """
    try:
        messages = decode_packet(packet)
    except PacketError as error:
        raise CommandError(f"packet: expected OSC ({error})") from error
    asked: list[_Said] = []
    for address, arguments in messages:
        if reset := _RESET.fullmatch(address):
            asked.append(("reset", [reset[1].replace("*", "")]))
        elif address == TEACH or address.startswith(f"{TEACH}/"):
            asked.append((address[len(TEACH) + 1 :] or "teach", arguments))
    return asked, len(messages) - len(asked)


def decode(said: Sequence[_Said]) -> list[Command]:
    """Read the commands of a packet.

    Raises
    ------
    CommandError
        They are too many, or one is no command; the error names the argument that was expected.
    """
    if len(said) > MAX_COMMANDS:
        raise CommandError(f"packet: expected at most {MAX_COMMANDS} commands, got {len(said)}")
    found = []
    for word, arguments in said:
        names = _names(word)
        if names and len(arguments) > len(names):
            raise CommandError(f"{word}: expected {', '.join(names)}, got {len(arguments)}")
        # Many programs send a number with every message, also with one that has no arguments.
        found.append(_made(word, dict(zip(names, arguments, strict=False))))
    return found


def decode_json(request: bytes) -> Command:
    """Read one command in JSON; CommandError for other text."""
    try:
        given = json.loads(request) if len(request) <= _MAX_REQUEST else None
    except (ValueError, RecursionError):
        given = None
    if not isinstance(given, dict) or not isinstance(word := given.pop("do", None), str):
        raise CommandError('request: expected JSON like {"do": "teach", "performer": "ann", "class": "wave"}')
    names = _names(word)
    for name in given:
        if name not in names:
            raise CommandError(f"{word}: expected {', '.join(names) or 'no more'}, got {ascii(name)[:40]}")
    return _made(word, given)


def _names(word: str) -> list[str]:
    """Name the arguments of a command; CommandError for an unknown command."""
    if word not in _COMMANDS:
        raise CommandError(f"command: expected one of {', '.join(_COMMANDS)}, got {word[:MAX_NAME]!a}")
    return [*_ARGUMENTS[word]]


def _made(word: str, given: Mapping[str, Any]) -> Command:
    """Make a command of its arguments by name; CommandError where one is missing or wrong."""
    arguments = _ARGUMENTS[word]
    for name, argument in arguments.items():
        if argument.required and name not in given:
            raise CommandError(f"{word}: expected {', '.join(arguments)}, got no {name}")
    return _COMMANDS[word](**{arguments[name].name: _as(arguments[name].type, name, given[name]) for name in given})


def _as(kind: type, name: str, value: Any) -> Any:  # noqa: ANN401 - of the kind that is asked for
    # JSON can write half a character, which no other transport can.
    if kind is str and isinstance(value, str) and value.encode(errors="replace").decode() == value:
        return value
    number = kind is not str and isinstance(value, int | float) and abs(value) <= _MAX_NUMBER
    if number and (kind is float or value == int(value)):
        return kind(value)
    raise CommandError(f"{name}: expected {kind.__name__}, got {ascii(value)[:40]}")


def encode(notice: Notice) -> bytes:
    """Give a notice as an OSC message."""
    if isinstance(notice, State):
        return encode_message(f"{TEACH}/state", notice.performer, str(notice.step), notice.seconds, notice.reason)
    taught, tried = (notice.class_name, notice.examples, notice.seconds, notice.words), notice.tried
    return encode_message(f"{TEACH}/taught", *taught, tried.started, tried.done, tried.seconds)


def as_json(notice: Notice) -> dict[str, object]:
    """Give a notice as a JSON object."""
    seconds = round(notice.seconds, 3)
    if isinstance(notice, State):
        described = {"performer": notice.performer, "state": str(notice.step), "seconds": seconds}
        return described | ({"reason": notice.reason} if notice.reason else {})
    return {
        "taught": notice.class_name,
        "examples": notice.examples,
        "seconds": seconds,
        "check": notice.words,
        "would_have_started": notice.tried.started,
        "would_have_been_done": notice.tried.done,
        "tried_seconds": round(notice.tried.seconds, 1),
        "tried": notice.tried.words,
    }


def as_line(notice: Notice) -> str:
    """Give a notice as a line for people."""
    if isinstance(notice, State):
        whose = f" {notice.performer}" if notice.performer else ""
        seconds = f" {notice.seconds:.1f} s" if notice.seconds else ""
        return f"teaching{whose}: {notice.step}{seconds}{f': {notice.reason}' if notice.reason else ''}"
    kept = f"examples: {notice.examples}, {notice.seconds:.1f} s kept"
    tried = f"; it would have been {notice.tried.words}" if notice.tried.words else ""
    return f"taught {notice.class_name}: {notice.words}; {kept}{tried}"
