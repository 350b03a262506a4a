"""Commands and notices on the wire: OSC, Wekinator's OSC, and JSON for ZeroMQ. Pure encode and decode.

`/motion/teach s performer s class [i repetitions f countdown]`; `/motion/teach/stop`, `/cancel`, `/undo`, `/redo`,
`/save`; `/rename s s`, `/forget [s]`, `/enable s i`, `/trim i`, `/last s f s [f]`,
`/sensitivity f`, `/record i`, `/list`. JSON has the same words: `{"do":
"teach", "performer": "ann", "class": "wave"}`.
"""

from __future__ import annotations

import json
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from kinespace.stream.osc.packet import Message, PacketError, decode_packet, encode_message
from kinespace.stream.teaching import commands
from kinespace.stream.teaching.commands import Command, CommandError
from kinespace.stream.teaching.notices import Notice, State, Taught

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

#: The beginning of commands' addresses.
TEACH = "/motion/teach"
WEKINATOR = "/wekinator/control/"
#: The largest number of a Wekinator gesture.
_MAX_GESTURE = 200
#: Bytes of a JSON request, at most.
_MAX_REQUEST = 10_000

_PLAIN: dict[str, Callable[[], Command]] = {
    "stop": commands.Stop,
    "cancel": commands.Cancel,
    "undo": commands.Undo,
    "redo": commands.Redo,
    "save": commands.Save,
    "list": commands.List,
}
#: The arguments of each further command, by its name: names in JSON, types in OSC, and how many are needed.
_ARGUMENTS: dict[str, tuple[Callable[..., Command], tuple[tuple[str, type], ...], int]] = {
    "teach": (
        commands.Teach,
        (("performer", str), ("class", str), ("repetitions", int), ("countdown", float)),
        2,
    ),
    "last": (commands.Last, (("performer", str), ("seconds", float), ("class", str), ("ago", float)), 3),
    "rename": (commands.Rename, (("class", str), ("to", str)), 2),
    "forget": (commands.Forget, (("class", str),), 1),
    "enable": (commands.Enable, (("class", str), ("on", bool)), 2),
    "trim": (commands.Trim, (("on", bool),), 1),
    "sensitivity": (commands.Sensitivity, (("share", float),), 1),
    "record": (commands.Record, (("on", bool),), 1),
    "run": (commands.Run, (("on", bool),), 1),
}


def decode(packet: bytes) -> list[Command]:
    """Read the commands of an OSC packet.

    Raises
    ------
    CommandError
        The packet is no OSC, or a message is no command; the error names the argument that was expected.
    """
    return [command for message in _messages(packet) if (command := _command(message)) is not None]


def _command(message: Message) -> Command | None:
    if message.address != TEACH and not message.address.startswith(f"{TEACH}/"):
        return None
    word = message.address.removeprefix(TEACH).removeprefix("/") or "teach"
    return _made(word, list(message.arguments))


def _made(word: str, arguments: Sequence[object]) -> Command:
    if word in _PLAIN:
        return _PLAIN[word]()
    if word not in _ARGUMENTS:
        known = ", ".join((*_ARGUMENTS, *_PLAIN))
        raise CommandError(f"command: expected one of {known}, got {word[: commands.MAX_NAME]!a}")
    make, expected, needed = _ARGUMENTS[word]
    if word == "forget" and not arguments:
        raise CommandError("forget: expected a class, got none")
    if not needed <= len(arguments) <= len(expected):
        raise CommandError(f"{word}: expected {', '.join(name for name, _ in expected)}, got {len(arguments)}")
    return make(*(_as(kind, name, each) for (name, kind), each in zip(expected, arguments, strict=False)))


def _as(kind: type, name: str, value: object) -> object:
    if kind is str and isinstance(value, str):
        return value
    if kind in (int, bool) and isinstance(value, int | float) and value == int(value):
        return kind(value)
    if kind is float and isinstance(value, int | float):
        return float(value)
    raise CommandError(f"{name}: expected {kind.__name__}, got {ascii(value)[:40]}")


def decode_json(request: bytes) -> Command:
    """Read one command in JSON; CommandError for other text."""
    try:
        told = json.loads(request) if len(request) <= _MAX_REQUEST else None
    except (ValueError, RecursionError):
        told = None
    if not isinstance(told, dict) or not isinstance(told.get("do"), str):
        raise CommandError('request: expected JSON like {"do": "teach", "performer": "ann", "class": "wave"}')
    word = told["do"]
    names = [name for name, _ in _ARGUMENTS[word][1]] if word in _ARGUMENTS else []
    strange = [name for name in told if name not in (*names, "do")]
    if strange:
        raise CommandError(f"{word}: expected {', '.join(names) or 'no more'}, got {ascii(strange[0])[:40]}")
    return _made(word, _in_order(told, names))


def _in_order(told: Mapping[str, Any], names: Sequence[str]) -> list[object]:
    """Give the arguments in the order of OSC; one that is left out before another one has its default."""
    given = [place for place, name in enumerate(names) if name in told]
    if not given:
        return []
    make, _, needed = _ARGUMENTS[told["do"]]
    if missing := [name for name in names[:needed] if name not in told]:
        raise CommandError(f"{told['do']}: expected {', '.join(names)}, got no {missing[0]}")
    defaults = [each.default for each in fields(make)]  # type: ignore[arg-type]  # a command, which is a dataclass
    return [told.get(name, default) for name, default in zip(names, defaults, strict=True)][: given[-1] + 1]


class Wekinator:
    """Reads Wekinator's own control messages, whose gestures are numbered from 1.

    `startDtwRecording` and `startRecording` teach the performer heard last, without a countdown. The class is the
    gesture's name by `setOutputNames`, or `gesture <number>`. `startRecording` teaches the number of the last
    `/wekinator/control/outputs`. `train` does nothing: an example is known at once.
    """

    def __init__(self) -> None:
        self._names: list[str] = []
        self._output = 1

    def decode(self, packet: bytes) -> list[Command]:
        """Read the commands of an OSC packet; CommandError as `decode`."""
        return [command for message in _messages(packet) for command in self._commands(message)]

    def _commands(self, message: Message) -> list[Command]:  # noqa: PLR0911 - one line a message
        if not message.address.startswith(WEKINATOR):
            return []
        match message.address.removeprefix(WEKINATOR), list(message.arguments):
            case "startDtwRecording" | "deleteExamplesForOutput" as word, [int() | float() as number]:
                name = self._name(number)
                return [commands.Forget(name) if word.startswith("delete") else commands.Teach("", name, 1, 0.0)]
            case "startRecording", _:
                return [commands.Teach("", self._name(self._output), 1, 0.0)]
            case (("stopRecording" | "stopDtwRecording"), _):
                return [commands.Stop()]
            case "deleteAllExamples", _:
                return [commands.Forget("")]
            case (("startRunning" | "train"), _):
                return [commands.Run(on=True)]
            case "stopRunning", _:
                return [commands.Run(on=False)]
            case "outputs", [int() | float() as number, *_]:
                self._output = self._checked(number)
                return []
            case "setOutputNames", [*names] if names and all(isinstance(name, str) for name in names):
                return self._called([str(name) for name in names])
        raise CommandError(f"{message.address[: commands.MAX_NAME]!a}: not a control message with its arguments")

    def _called(self, names: list[str]) -> list[Command]:
        for name in names:
            commands.require_class(name)
        self._names = names[:_MAX_GESTURE]
        return []

    @staticmethod
    def _checked(number: float) -> int:
        if not (1 <= number <= _MAX_GESTURE and number == int(number)):
            raise CommandError(f"gesture: expected 1 to {_MAX_GESTURE}, got {number:g}")
        return int(number)

    def _name(self, number: float) -> str:
        place = self._checked(number)
        return self._names[place - 1] if place <= len(self._names) else f"gesture {place}"


def _messages(packet: bytes) -> list[Message]:
    try:
        return decode_packet(packet)
    except PacketError as error:
        raise CommandError(f"packet: expected OSC ({error})") from error


def encode(notice: Notice) -> bytes | None:
    """Give a notice as an OSC message; None for a notice that has none."""
    match notice:
        case State():
            return encode_message(f"{TEACH}/state", notice.performer, str(notice.step), notice.seconds, notice.reason)
        case Taught():
            return encode_message(
                f"{TEACH}/taught",
                notice.class_name,
                notice.examples,
                notice.seconds,
                notice.words,
                notice.would_have_started,
            )
        case _:
            return None


def as_json(notice: Notice) -> dict[str, object] | None:
    """Give a notice as a JSON object; None for a notice that has none."""
    match notice:
        case State():
            told = {"performer": notice.performer, "state": str(notice.step), "seconds": round(notice.seconds, 3)}
            return told | ({"reason": notice.reason} if notice.reason else {})
        case Taught():
            return {
                "taught": notice.class_name,
                "examples": notice.examples,
                "seconds": round(notice.seconds, 3),
                "check": notice.words,
                "would_have_started": notice.would_have_started,
            }
        case _:
            return None


def as_line(notice: Notice) -> str:
    """Give a notice as a line for people; empty for a notice that has none."""
    match notice:
        case State():
            whose = f" {notice.performer}" if notice.performer else ""
            seconds = f" {notice.seconds:.1f} s" if notice.seconds else ""
            return f"teaching{whose}: {notice.step}{seconds}{f': {notice.reason}' if notice.reason else ''}"
        case Taught():
            kept = f"examples: {notice.examples}, {notice.seconds:.1f} s kept"
            starts = f"starts it would have had in the last minutes: {notice.would_have_started}"
            return f"taught {notice.class_name}: {notice.words}; {kept}; {starts}"
        case _:
            return ""
