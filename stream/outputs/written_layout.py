"""A layout that a person wrote in TOML: which messages a program gets, when, at which address, with which arguments.

title = "a mixer of films"
port = 7000

[[message]]
when = "start"
class = "squat1Reps"
address = "/composition/columns/{number}/connect"
arguments = [1]
"""

from __future__ import annotations

import re
import string
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from pythonosc.osc_message_builder import BuildError

from kinespace.library.naming.checked_toml import Text, read_toml, text_of
from kinespace.library.naming.hdm05 import title_of
from kinespace.stream.osc.answers import address_part
from kinespace.stream.osc.packet import encode_bundle, encode_message
from kinespace.stream.outputs.layouts import Layout
from kinespace.stream.recognition import Done, Event, Recognition

#: The facts of an answer, by the names that stand in braces.
Facts = Mapping[str, str | int | float]

When = Literal["answer", "start", "end", "done", "gone"]
#: The names that may stand in braces; `number` is the class's index from 1, 0 for none.
_NAMED = ("performer", "class", "title", "index", "number", "score")
FACTS: dict[When, tuple[str, ...]] = {
    "answer": (*_NAMED, "margin", "phase", "speed", "amplitude"),
    "start": _NAMED,
    "end": _NAMED,
    "done": (*_NAMED, "count", "duration", "speed", "amplitude"),
    "gone": ("performer",),
}

#: What may stand behind a name and a colon: how wide it is written at least, and with how many places. Other programs'
#: formats may take all memory, or fail at a value that has not come before.
_FORMAT = re.compile(r"[<>^]?0?\d{0,2}(\.\d)?[dfg%]?")
_MAX_MESSAGES = 256

#: Facts that are no fractions, by which a file is tried before a performer comes.
_EXAMPLES: Facts = {"performer": "ann", "class": "bow", "title": "bow", "index": 0, "number": 1, "count": 1}


class LayoutFileError(ValueError):
    """A layout's file cannot be read; the message says where, what was expected and what was got."""


class Message(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"of_class": "class"}):
    """One message: when it is sent, of which class (any where it is empty), where to, and what it holds."""

    when: When
    address: Annotated[str, msgspec.Meta(pattern="^/")]
    arguments: tuple[int | float | str, ...] = ()
    of_class: str = ""

    def __post_init__(self) -> None:
        known = FACTS[self.when]
        for text in (self.address, *(each for each in self.arguments if isinstance(each, str))):
            try:
                fields = [each[1:] for each in string.Formatter().parse(text) if each[1] is not None]
            except ValueError as error:
                raise ValueError(f"address or arguments: expected names in braces, got {text!r} ({error})") from error
            for name, form, conversion in fields:
                if name not in known:
                    raise ValueError(f"{{{name}}}: expected one of {', '.join(known)} when {self.when}, got {text!r}")
                if conversion or not _FORMAT.fullmatch(form or ""):
                    raise ValueError(f"{{{name}}}: expected a format like :.2f or :>8, got {text!r}")
        try:
            self.encoded({name: _EXAMPLES.get(name, 0.5) for name in known})
        except (ValueError, OverflowError, BuildError) as error:
            raise ValueError(f"arguments: expected numbers and texts of OSC, got {self.arguments} ({error})") from error

    def encoded(self, facts: Facts) -> bytes:
        """Encode the message; names in braces give way to facts."""
        parts = {name: address_part(fact) if isinstance(fact, str) else fact for name, fact in facts.items()}
        address = self.address.format_map(parts)
        return encode_message(address, *(_filled(each, facts) for each in self.arguments))


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    message: Annotated[tuple[Message, ...], msgspec.Meta(min_length=1, max_length=_MAX_MESSAGES)]
    title: Text = "layout"
    port: Annotated[int, msgspec.Meta(ge=1, le=65535)] = 9000


class WrittenLayout(Layout):
    """The messages of a file.

    Raises
    ------
    LayoutFileError
        The file is no such layout.
    OSError
        It cannot be read.
    """

    def __init__(self, path: Path) -> None:
        read = read_toml(text_of(path, LayoutFileError), path.name, _File, LayoutFileError)
        self.name, self.port, self._messages = read.title, read.port, read.message

    def recognition(self, recognition: Recognition) -> bytes | None:
        """Encode the messages of an answer."""
        progress = recognition.progress
        followed = (progress.phase, progress.speed, progress.amplitude) if progress else (0.0, 0.0, 0.0)
        index = recognition.class_index
        named = _named(recognition.performer, recognition.label, index, recognition.score)
        further = dict(zip(("margin", "phase", "speed", "amplitude"), (recognition.margin, *followed), strict=True))
        return self._encoded("answer", {**named, **further})

    def event(self, event: Event) -> bytes | None:
        """Encode the messages of a start or an end."""
        named = _named(event.performer, event.label, event.index, event.score)
        return self._encoded(event.kind.value, named)

    def done(self, done: Done) -> bytes | None:
        """Encode the messages of a motion that was done."""
        named = _named(done.performer, done.label, done.index, done.score)
        further = {each: getattr(done, each) for each in ("count", "duration", "speed", "amplitude")}
        return self._encoded("done", {**named, **further})

    def classes(self, classes: Sequence[str]) -> None:
        """Send nothing; note the titles that a message asks for in place of classes."""
        asked = {each.of_class for each in self._messages} - {*classes}
        meant = {title: [each for each in classes if title_of(each) == title] for title in sorted(asked)}
        self.notes = [
            f"{self.name}: no class is called {title!r}, which is a title: {' or '.join(names)} is meant"
            for title, names in meant.items()
            if names
        ]

    def gone(self, performer: str) -> bytes | None:
        """Encode the messages of a performer who has left."""
        return self._encoded("gone", {"performer": performer})

    def _encoded(self, when: When, facts: Facts) -> bytes | None:
        chosen = [
            each.encoded(facts)
            for each in self._messages
            if each.when == when and each.of_class in ("", facts.get("class", ""))
        ]
        return encode_bundle(*chosen) if chosen else None


def _named(performer: str, class_name: str, index: int, score: float) -> dict[str, str | int | float]:
    named = {"performer": performer, "class": class_name, "title": title_of(class_name)}
    return {**named, "index": index, "number": index + 1, "score": score}


def _filled(argument: float | str, facts: Facts) -> int | float | str:
    """Give an argument; a text that is one name in braces is that fact itself, a number where it is one."""
    if not isinstance(argument, str):
        return argument
    name = argument[1:-1]
    return facts[name] if argument == f"{{{name}}}" and name in facts else argument.format_map(facts)
