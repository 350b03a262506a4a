"""Tables that keep names whole on a narrow terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.table import Table

from kinespace.tools.terminal.console import console

if TYPE_CHECKING:
    from collections.abc import Iterable

#: Characters that a column of names has at least.
_MIN_WIDTH = 16
#: How cells begin that spreadsheets take for something to compute.
_COMPUTED = ("=", "+", "-", "@", "\t", "\r")


def narrow_table(title: str, caption: str | None = None) -> Table:
    """Make an empty table without frames, so that two class names fit side by side on 80 characters."""
    return Table(
        title=title,
        caption=caption,
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        show_edge=False,
        title_justify="left",
        caption_justify="left",
    )


def counted(count: int, noun: str, several: str = "") -> str:
    """Write a number with its noun; `several` is the noun's plural where that is not an s more."""
    return f"{count} {noun if count == 1 else several or noun + 's'}"


def csv_text(text: str) -> str:
    """Give text as a cell of a CSV file; a formula, like `=1+1`, gets an apostrophe: no spreadsheet computes it."""
    return f"'{text}" if text.startswith(_COMPUTED) else text


def add_names(table: Table, heading: str, names: Iterable[str], *, beside: int) -> None:
    """Add a column of names, as wide as the longest name: other columns are narrowed first.

    Parameters
    ----------
    table
        A table without rows.
    heading
        The column's heading.
    names
        The names in the column.
    beside
        Characters that the other columns need at least; this column takes at most the rest.
    """
    longest = max(map(len, (heading, *names)))
    table.add_column(heading, width=min(longest, max(console.width - beside, _MIN_WIDTH)), overflow="fold")


def shortened(name: str, width: int) -> str:
    """Give a name in at most so many characters; its middle is left out, because classes differ in their ends."""
    if len(name) <= width:
        return name
    end = width // 2
    return f"{name[: width - end - 1]}…{name[len(name) - end :]}"
