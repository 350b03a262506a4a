"""Commands and notices on the wire: OSC, and JSON for ZeroMQ. Pure encode and decode.

A command is `/motion/teach/<command>` with its arguments in order (`/motion/teach` alone is `teach`), or the same words
in JSON: `{"do": "teach", "performer": "ann", "class": "wave"}`. `/motion/<performer>/count/reset` is `reset`; `*` means
all performers.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any, get_args, get_type_hints

from kinespace.stream.osc.packet import PacketError, decode_packet, encode_message
from kinespace.stream.teaching import commands
from kinespace.stream.teaching.commands import Command, CommandError, Notice, State

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
#: The arguments of each command, in order: the names on the wire with the fields' names and types.
_ARGUMENTS: dict[str, dict[str, tuple[str, type]]] = {
    word: {name.removesuffix("_name"): (name, kind) for name, kind in get_type_hints(each).items()}
    for word, each in _COMMANDS.items()
}


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
        raise CommandError(f"command: expected one of {', '.join(_COMMANDS)}, got {word[: commands.MAX_NAME]!a}")
    return [*_ARGUMENTS[word]]


def _made(word: str, given: Mapping[str, Any]) -> Command:
    """Make a command of its arguments by name; CommandError where one is missing or wrong."""
    arguments, needed = _ARGUMENTS[word], [each.default is MISSING for each in fields(_COMMANDS[word])]
    for name, must in zip(arguments, needed, strict=True):
        if must and name not in given:
            raise CommandError(f"{word}: expected {', '.join(arguments)}, got no {name}")
    return _COMMANDS[word](**{arguments[name][0]: _as(arguments[name][1], name, given[name]) for name in given})


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
