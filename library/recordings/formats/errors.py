"""The error that every reader raises for a file that cannot be used, and numbers read from a file's words."""

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

#: How programs write that there is no number.
_NOTHING = re.compile(
    r"\W*|-?nan.*|-?1\.#\w+|n/?a|#[\w/]+[!?]?|null|none|undefined|missing|lost|occluded|not \w+|false", re.IGNORECASE
)


#: A number in which a spreadsheet of a country with decimal commas has taken the point for one of thousands.
_THOUSANDS = re.compile(r"(?<![\d.])-?\d{1,3}(\.\d{3}){2,}(?![\d.])")


#: A number with commas, apostrophes or blanks that do not break between its thousands, and a point behind them: plain
#: blanks stand between numbers.
_GROUPED = re.compile(r"[-+]?\d{1,3}([,'’\u00a0\u2009\u202f]\d{3})+\.\d*")


class RecordingError(ValueError):
    """A recording cannot be found or used; the message names it and, where there is one, the line or byte."""


@dataclass(frozen=True, slots=True)
class Line:
    """A line of a file, or a part of one: its number and its words."""

    path: Path
    number: int
    words: list[str]

    def fail(self, what: str) -> NoReturn:
        """Refuse the file because of this line."""
        refuse(self.path, self.number, what)


def refuse(path: Path, line: int, what: str) -> NoReturn:
    """Refuse a file because of one of its lines."""
    raise RecordingError(f"{path}:{line}: {what}")


def spoilt(text: str) -> str:
    """Say what a spreadsheet has done to a text's numbers; empty where it has not."""
    found = _THOUSANDS.search(text)
    return f"numbers like {found[0]}: a spreadsheet took their points for those of thousands" if found else ""


def mended(words: Sequence[str]) -> list[str]:
    """Give the numbers of a line with decimal commas, commas between, or no blank before a sign."""
    text = " ".join(words).replace(";", " ")
    text = text.replace(",", " ") if "." in text else re.sub(r"(?<=\d),(?=\d)", ".", text).replace(",", " ")
    return re.sub(r"(?<=[\d.])(?=[-+])", " ", text).split()


def number_of(field: str) -> float | None:
    """Read a field of a table: NaN where it is empty or says that there is no number, None for any other text."""
    # Python reads `1_2` as twelve.
    if "_" not in field:
        with suppress(ValueError):
            return float(field.strip("'=\"").replace(",", "."))
        if _GROUPED.fullmatch(field):
            return float(re.sub(r"[^-+.\d]", "", field))
    return math.nan if _NOTHING.fullmatch(field) else None


def numbers_in(words: Sequence[str], path: Path, line: int, count: int, where: str = "") -> list[float]:
    """Read words of a line as finite numbers.

    Parameters
    ----------
    words
        As they stand in the file.
    path, line
        Where they stand.
    count
        How many there must be.
    where
        Follows `numbers` in messages, like ` after 'length'`.

    Raises
    ------
    RecordingError
        There are more or fewer, or one is no finite number.
    """
    try:
        values = list(map(float, words))
    except ValueError:
        words = mended(words)
        try:
            values = list(map(float, words))
        except ValueError:
            refuse(path, line, f"expected numbers{where}, got {' '.join(words)[:60]!r}")
    if len(values) != count:
        refuse(path, line, f"expected {count} numbers{where}, got {len(values)}")
    if not all(map(math.isfinite, values)):
        refuse(path, line, f"expected finite numbers{where}, got {' '.join(words)[:60]!r}")
    return values


def positive_in(words: Sequence[str], path: Path, line: int, what: str) -> float:
    """Read one word of a line as a positive number; RecordingError for anything else."""
    (value,) = numbers_in(words, path, line, 1, f" as {what}")
    if value <= 0:
        refuse(path, line, f"expected a positive {what}, got {words[0]}")
    return value
