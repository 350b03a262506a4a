"""Tables that keep figures and names whole on a narrow terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from kinespace.tools.terminal.console import console, printable

#: Characters that a line of a heading may always have.
_HEADING = 10
#: How cells begin that spreadsheets take for something to compute.
_COMPUTED = ("=", "+", "-", "@", "\t", "\r")


def table_of(
    title: str,
    headings: Sequence[str],
    rows: Iterable[Sequence[str | Text]],
    *,
    caption: str | None = None,
    names: int = 1,
) -> Table:
    """Make a table without frames.

    Figures are never broken. Where a terminal is too narrow, headings of figures break between words, and names fold.

    Parameters
    ----------
    title, caption
        Above and below the table.
    headings
        Of the columns.
    rows
        The cells; a row may be short.
    names
        The number of columns of names: the first ones, which stand left. The others hold figures and stand right.
    """
    table = Table(
        title=title,
        caption=caption,
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        show_edge=False,
        title_justify="left",
        caption_justify="left",
    )
    cells = [[printable(each) if isinstance(each, str) else each for each in row] for row in rows]
    widths = [max((len(row[place]) for row in cells if place < len(row)), default=0) for place in range(len(headings))]
    is_wide = sum(max(width, len(heading)) + 2 for width, heading in zip(widths, headings, strict=True)) > console.width
    for place, heading in enumerate(headings):
        if place < names:
            table.add_column(heading, overflow="fold")
        else:
            broken = textwrap.fill(heading, max(widths[place], _HEADING), break_long_words=False)
            table.add_column(broken if is_wide else heading, justify="right", no_wrap=True)
    for row in cells:
        table.add_row(*row)
    return table


class _None:
    """A figure that there is not."""

    def __format__(self, form: str) -> str:
        return "-"


def print_scores(
    scores: Iterable[Mapping[str, object]],
    columns: Iterable[tuple[str, str]],
    *,
    title: str,
    caption: str | None = None,
    names: int = 1,
) -> None:
    """Print a row for each score.

    Parameters
    ----------
    scores
        Figures by name; None for a figure that there is not.
    columns
        Headings, and how figures are written, like `{right:.1%}`.
    title, caption, names
        As for `table_of`.
    """
    headings, forms = zip(*columns, strict=True)
    there = ({name: _None() if value is None else value for name, value in score.items()} for score in scores)
    rows = [[form.format(**score) for form in forms] for score in there]
    console.print(table_of(title, headings, rows, caption=caption, names=names))


def counted(count: int, noun: str, several: str = "") -> str:
    """Write a number with its noun; `several` is the noun's plural where that is not an s more."""
    return f"{count} {noun if count == 1 else several or noun + 's'}"


def csv_text(text: str) -> str:
    """Give text as a cell of a CSV file; a formula, like `=1+1`, gets an apostrophe: no spreadsheet computes it."""
    return f"'{text}" if text.startswith(_COMPUTED) else text


def shortened(name: str, width: int) -> str:
    """Give a name in at most this many characters, fit to be printed; without its middle: classes differ in ends."""
    name = printable(name)
    if len(name) <= width:
        return name
    end = width // 2
    return f"{name[: width - end - 1]}…{name[len(name) - end :]}"
