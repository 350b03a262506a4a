"""TOML that a person wrote: a mistake in any place of any kind is one line with place, expectation and value."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

import msgspec
import pytest

from kinespace.library.naming.checked_toml import Text, read_toml


class Colour(StrEnum):
    """Two words."""

    RED = "red"
    BLUE = "blue"


class Part(msgspec.Struct, forbid_unknown_fields=True):
    """A table in a list, or by name."""

    size: Annotated[float, msgspec.Meta(gt=0)] = 1.0
    colour: Colour = Colour.RED
    kind: Literal["here", "there"] = "here"


class File(msgspec.Struct, forbid_unknown_fields=True):
    """A file with tables in every place."""

    name: Text
    parts: tuple[Part, ...] = ()
    named: dict[str, Part] = {}
    perhaps: Part | None = None


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "name: expected a value, got nothing"),
        ("name =", "expected TOML, got a mistake: Invalid value (at end of document)"),
        ("name = 1", "name: expected text, got 1"),
        ('name = " "', "name: expected text, got ' '"),
        (f"name = [{'1, ' * 50}]", f"name: expected text, got [{'1, ' * 26}1"),
        ("nam = 1", "nam: expected one of name, named, parts, perhaps, got 'nam', perhaps 'name' is meant"),
        ('name = "a"\nxyz = 1', "xyz: expected one of name, named, parts, perhaps, got 'xyz'"),
        ('name = "a"\nparts = [{}, {size = 0}]', "parts 2, size: expected a number > 0.0, got 0"),
        ('name = "a"\nparts = [{}, {sise = 1}]', "parts 2, sise: expected one of colour, kind, size, got 'sise', per"),
        ('name = "a"\n[named.b]\n[named.c]\nsize = "x"', "named, c, size: expected a number, got 'x'"),
        ('name = "a"\n[named.b]\n[named.c]\nfar = 1', "named, c, far: expected one of colour, kind, size, got 'far'"),
        ('name = "a"\n[named.b]\ncolour = "green"', "named, b, colour: expected one of red, blue, got 'green'"),
        ('name = "a"\n[perhaps]\nkind = "where"', "perhaps, kind: expected one of here, there, got 'where'"),
        ('name = "a"\nperhaps = true', "perhaps: expected a table, got True"),
        (f"name = {'[' * 20_000}", "expected TOML, got tables or lists nested too deep"),
        ("#" * 32_001, "expected at most 32000 characters, got 32001"),
    ],
)
def test_a_mistake_is_one_line(text: str, line: str) -> None:
    """The line begins with the file, and has the place, the expectation and at most 80 characters of the value."""
    with pytest.raises(ValueError, match=r"^a\.toml: ") as caught:
        read_toml(text, "a.toml", File, ValueError)
    told = str(caught.value).removeprefix("a.toml: ")
    assert told.startswith(line) if line.endswith("per") else told == line
