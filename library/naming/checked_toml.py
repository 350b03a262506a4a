"""TOML that a person wrote, read into checked values: a mistake is one line with file, key, expectation and value.

A file is described by a `msgspec.Struct` whose types say what each key may hold; what types cannot say a struct's
`__post_init__` says by a ValueError that begins with the key. Types with bounds must not stand in a union with a tuple:
msgspec 0.22 takes other numbers for the bounds then, or crashes.
"""

import re
import tomllib
from collections.abc import Callable, Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec.inspect import DictType, EnumType, StructType, UnionType, type_info

from kinespace.library import memory

_Struct = TypeVar("_Struct", bound=msgspec.Struct)

#: Ten times the longest preset; a longer text might take very long to parse.
_MAX_CHARACTERS = 32_000
#: Text that is not empty or blank.
Text = Annotated[str, msgspec.Meta(pattern=r"\S")]
#: Between the keys of a place in msgspec's messages: `$.message[0].address`, or `$.joints[...]` for any key of a table.
_STEPS = re.compile(r"\.([^.\[]+)|\[(\d+|\.\.\.)\]")
_MESSAGE = re.compile(r"(?P<what>.*?)(?: - at `\$(?P<place>.*)`)?", re.DOTALL)
#: msgspec's names of the types that TOML has, and ours.
_TYPES = {bool: "bool", int: "int", float: "float", str: "str", list: "array", dict: "object"}
_WORDS = {
    "bool": "true or false",
    "int": "a whole number",
    "float": "a number",
    "str": "text",
    "array": "a list",
    "object": "a table",
}
_NOT_BLANK = " matching regex '\\\\S'"
#: Characters of a value in a message, at most.
_MAX_SHOWN = 80
_FIELD = re.compile(r"Object (?P<how>contains unknown|missing required) field `(?P<key>.*)`", re.DOTALL)


def text_of(path: Path, error: type[ValueError]) -> str:
    """Read a file of UTF-8 text; the error is raised for another file, OSError for one that cannot be read."""
    try:
        return memory.content(path).decode()
    except UnicodeDecodeError as mistake:
        raise error(f"{path}: expected UTF-8 text, got byte {mistake.start} of another encoding") from mistake


def read_toml(
    text: str,
    file: str,
    kind: type[_Struct],
    error: type[ValueError],
    prepared: Callable[[dict[str, Any]], dict[str, Any]] = lambda table: table,
) -> _Struct:
    """Read TOML into a struct.

    Parameters
    ----------
    text
        The TOML.
    file
        The file's name in messages.
    kind
        The struct; it forbids unknown fields.
    error
        The error that is raised.
    prepared
        Writes short forms of a value out, before the table is checked.

    Raises
    ------
    error
        The text is too long or no TOML, or something in it is wrong, missing or unknown.
    """
    if len(text) > _MAX_CHARACTERS:
        raise error(f"{file}: expected at most {_MAX_CHARACTERS} characters, got {len(text)}")
    try:
        table = prepared(tomllib.loads(text))
        return msgspec.convert(table, kind)
    except tomllib.TOMLDecodeError as mistake:
        raise error(f"{file}: expected TOML, got a mistake: {mistake}") from mistake
    except RecursionError as mistake:
        raise error(f"{file}: expected TOML, got tables or lists nested too deep") from mistake
    except msgspec.ValidationError as mistake:
        raise error(f"{file}: {_explained(str(mistake), table, kind)}") from mistake


def _explained(message: str, table: dict[str, object], kind: type[msgspec.Struct]) -> str:
    """Put msgspec's message into our words: the place, the expectation, the value that came."""
    found = _MESSAGE.fullmatch(message)
    assert found  # noqa: S101 - it fits any text
    what, steps = found["what"], [key or index for key, index in _STEPS.findall(found["place"] or "")]
    places, field, came = list(_places(table, steps)), _FIELD.fullmatch(what), re.search(r", got `(\w+)`$", what)
    if field:
        unknown, key = field["how"] == "contains unknown", field["key"]
        place = next(place for place, there in places if (key in there) is unknown)  # type: ignore[operator]
        place, known, what = f"{place}, {key}", _choices(kind, steps), "a value, got nothing"
        if unknown:
            near = get_close_matches(key, known, n=1)
            what = f"one of {', '.join(known)}, got {key!r}" + (f", perhaps {near[0]!r} is meant" if near else "")
    else:
        fitting = [each for each in places if came and _TYPES.get(type(each[1])) == came[1]]
        place, value = (fitting or places)[0]
        if not what.startswith(("Expected", "Invalid")):
            return f"{place}, {what}".removeprefix(", ")
        what = re.sub(r", got .*", "", what.removeprefix("Expected ")).replace(_NOT_BLANK, "")
        what = re.sub(r"`(\w+)(?: \| null)?`", lambda each: _WORDS.get(each[1], each[1]), what)
        what = f"one of {', '.join(_choices(kind, steps))}" if what.startswith("Invalid") else what
        what = f"{what}, got {repr(value)[:_MAX_SHOWN]}"
    return f"{place}: expected {what}".removeprefix(", ")


def _places(value: object, steps: Sequence[str]) -> Iterator[tuple[str, object]]:
    """Name all places to which msgspec's steps may lead, and give their values."""
    if not steps:
        yield "", value
    elif isinstance(value, list):
        for place, found in _places(value[int(steps[0])], steps[1:]):
            yield f" {int(steps[0]) + 1}{place}", found
    elif isinstance(value, dict):
        for key in value if steps[0] == "..." else [steps[0]]:
            for place, found in _places(value.get(key), steps[1:]):
                yield f", {key}{place}", found


def _choices(kind: type[msgspec.Struct], steps: Sequence[str]) -> list[str]:
    """Give the keys of the struct, or the words, to which msgspec's steps lead."""
    info: Any = type_info(kind)
    for step in (*steps, None):
        if isinstance(info, UnionType):
            info = info.types[0]
        if step is None:
            break
        if isinstance(info, StructType):
            info = next(each.type for each in info.fields if each.encode_name == step)
        else:
            info = info.value_type if isinstance(info, DictType) else info.item_type
    if isinstance(info, StructType):
        return sorted(each.encode_name for each in info.fields)
    return list(info.cls if isinstance(info, EnumType) else info.values)
