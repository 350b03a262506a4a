"""A TOML table read key by key: every mistake is one line with file, key, expectation and the value."""

from __future__ import annotations

import math
from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping


class PresetError(ValueError):
    """A preset cannot be used; the message has the file, the key, the expectation and the value."""


class CheckedTable:
    """Gives a table's values checked, and refuses keys that are not read.

    Parameters
    ----------
    file
        The file's name in messages.
    place
        The table's place in the file, like `frame` or `message 2`; empty for the whole file.
    values
        The table, as `tomllib` gives it.
    """

    def __init__(self, file: str, place: str, values: Mapping[str, object]) -> None:
        self._file = file
        self._place = place
        self._values = values
        self._asked: set[str] = set()

    def fail(self, key: str, expected: str) -> PresetError:
        """Make the error of a wrong value; the caller raises it."""
        got = repr(self._values[key]) if key in self._values else f"nothing{self._misspelt(key)}"
        return PresetError(f"{self._file}: {self._inside(key)}: expected {expected}, got {got}")

    def _inside(self, key: str) -> str:
        return f"{self._place}, {key}" if self._place else key

    def _misspelt(self, key: str) -> str:
        """Name a key of the table that looks like a missing one; empty when none does."""
        near = get_close_matches(key, self._values.keys() - self._asked, n=1)
        return f", but {near[0]!r}, which is no key" if near else ""

    def _get(self, key: str) -> object:
        self._asked.add(key)
        return self._values.get(key)

    def text(self, key: str, default: str | None = None) -> str:
        """Read text that is not empty; without a default the key must be there."""
        value = self._get(key)
        if value is None and default is not None:
            return default
        if not isinstance(value, str) or not value.strip():
            raise self.fail(key, "text")
        return value.strip()

    def choice(self, key: str, choices: Collection[str], default: str) -> str:
        """Read one of some words."""
        value = self.text(key, default)
        if value not in choices:
            raise self.fail(key, f"one of {', '.join(choices)}")
        return value

    def flag(self, key: str, *, default: bool) -> bool:
        """Read true or false."""
        value = self._get(key)
        if value is None:
            return default
        if not isinstance(value, bool):
            raise self.fail(key, "true or false")
        return value

    def number(self, key: str, default: float | None, lowest: float, highest: float = math.inf) -> float:
        """Read a finite number between two others; without a default the key must be there."""
        value = self._get(key)
        if value is None and default is not None:
            return default
        number = _finite(value)
        if number is None or not lowest <= number <= highest:
            limits = f"from {lowest:g} to {highest:g}" if math.isfinite(highest) else f"of {lowest:g} or more"
            raise self.fail(key, f"a number {limits}")
        return number

    def integer(self, key: str, default: int | None, lowest: int, highest: int) -> int:
        """Read a whole number between two others."""
        value = self.number(key, default, lowest, highest)
        if value != int(value):
            raise self.fail(key, f"a whole number from {lowest} to {highest}")
        return int(value)

    def numbers(self, key: str, count: int, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
        """Read so many finite numbers; one number counts for all of them."""
        value = self._get(key)
        if value is None and default is not None:
            return default
        listed = value if isinstance(value, list) else [value] * count
        numbers = [number for each in listed if (number := _finite(each)) is not None]
        if len(listed) != count or len(numbers) != count:
            raise self.fail(key, f"{count} numbers")
        return tuple(numbers)

    def texts(self, key: str) -> tuple[str, ...]:
        """Read a list of texts; nothing when the key is not there."""
        value = self._get(key)
        if value is None:
            return ()
        if not isinstance(value, list) or not all(isinstance(each, str) and each for each in value):
            raise self.fail(key, "a list of texts")
        return tuple(value)

    def scalars(self, key: str) -> tuple[str | int | float, ...]:
        """Read a list of texts and numbers; nothing when the key is not there."""
        value = self._get(key)
        if value is None:
            return ()
        if not isinstance(value, list) or not all(type(each) in (str, int, float) for each in value):
            raise self.fail(key, "a list of texts and numbers")
        return tuple(value)

    def pairs(self, key: str, kind: type) -> dict[str, object]:
        """Read a table whose values are all of one kind; empty when the key is missing."""
        value = self._get(key)
        if value is None:
            return {}
        if not isinstance(value, dict):
            raise self.fail(key, "a table")
        for name, each in value.items():
            if not isinstance(each, (int, float) if kind is float else kind) or isinstance(each, bool):
                raise CheckedTable(self._file, self._inside(key), value).fail(
                    name, {str: "text", float: "a number", dict: "a table"}[kind]
                )
        return dict(value)

    def table(self, key: str) -> CheckedTable:
        """Read a table in this table; an empty one when the key is not there."""
        value = self._get(key)
        if value is not None and not isinstance(value, dict):
            raise self.fail(key, "a table")
        return CheckedTable(self._file, self._inside(key), value or {})

    def tables(self, key: str) -> list[CheckedTable]:
        """Read a list of tables, `[[key]]`; nothing when the key is not there."""
        value = self._get(key)
        if value is None:
            return []
        if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
            raise self.fail(key, f"tables, each headed [[{key}]]")
        return [
            CheckedTable(self._file, f"{self._inside(key)} {number}", each)
            for number, each in enumerate(value, start=1)
        ]

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def finish(self) -> None:
        """Refuse keys that were never read: a misspelt key must not be ignored."""
        for key in self._values:
            if key not in self._asked:
                near = get_close_matches(key, self._asked, n=1)
                meant = f", perhaps {near[0]} is meant" if near else ""
                known = ", ".join(sorted(self._asked))
                raise PresetError(
                    f"{self._file}: {self._inside(key)}: no such key{meant}: expected one of {known}, got {key!r}"
                )


def _finite(value: object) -> float | None:
    """Give a finite number as a float, None for any other value: TOML has infinity, NaN and integers of any size."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None
