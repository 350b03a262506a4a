"""What programs print: lines, tables, progress, words on the files that they read; and places for files they write."""

import argparse
import errno
import json
import os
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import Any, Literal, TypeVar

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from kinespace.library import Clip
from kinespace.library.library_file import locked
from kinespace.library.naming import summary
from kinespace.library.recordings.formats.labels import labels_beside
from kinespace.library.recordings.remarks import remarks
from kinespace.tools.cli.values import printable

_Item = TypeVar("_Item")


class _PrintableConsole(Console):
    """A console on which no text from a file or a sender has control characters."""

    def render_str(self, text: str, **options: Any) -> Text:  # noqa: ANN401 - rich's own, passed on
        """Render text without control characters; lines and tabs stay."""
        return super().render_str(printable(text, "\n\t"), **options)


#: Results go to standard output, plain when it is not a terminal. Names come from files and from the net: a name may
#: look like rich's markup, and must not end a program.
console = _PrintableConsole(highlight=False, markup=False, emoji=False)
#: Progress goes to standard error, so that it does not mix with results.
progress_console = Console(stderr=True)


#: How lines are logged; None: they are printed as they are.
_logs: Literal["text", "json"] | None = None


def log_as(kind: Literal["text", "json"] | None) -> None:
    """Write every line that is said from now on with the wall clock (UTC) and a level; None: without, as before."""
    global _logs  # noqa: PLW0603 - a program has one standard output
    _logs = kind


def say(line: str | Text, facts: Mapping[str, object] | None = None, *, level: str = "info") -> None:
    """Print one line, which the terminal breaks where it is narrow; in a log, with its level, in JSON with its facts.

    Whatever names are in it, it stays one line, and has no control characters.
    """
    if _logs is None:
        if isinstance(line, str):
            # In one piece, because several threads say lines. Rich would take a quarter of a millisecond for each.
            print(printable(line) + "\n", end="", flush=True)
        else:
            console.print(line, soft_wrap=True)
        return
    moment = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    text = printable(str(line).strip())
    logged = {"time": moment, "level": level, "text": text, **(facts or {})}
    # In one piece: several threads write.
    print((json.dumps(logged) if _logs == "json" else f"{moment} {level:7} {text}") + "\n", end="", flush=True)


def note(line: str) -> None:
    """Print a line that is no result where progress is shown: another program may read the results."""
    progress_console.print(printable(line), soft_wrap=True, markup=False, highlight=False)


def progress(work: Iterable[_Item], what: str, total: int | None) -> Iterator[_Item]:
    """Pass pieces of work through and show on a terminal how many of the total (None: endless) are done."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=progress_console, transient=True, disable=not progress_console.is_terminal) as bar:
        yield from bar.track(work, total=total, description=what)


def print_json(value: object) -> None:
    """Print one JSON value."""
    print(json.dumps(value))


def tell(options: argparse.Namespace, found: object, *shown: Table | str) -> None:
    """Print what a program has found: one JSON value with --json, otherwise tables and lines."""
    if options.json:
        print_json(found)
    else:
        for each in shown:
            console.print(each, soft_wrap=isinstance(each, str))


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
    table = Table(title=title, caption=caption, box=SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.title_justify = table.caption_justify = "left"
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


def scores_of(
    scores: Iterable[Mapping[str, object]], columns: str, *, title: str, caption: str | None = None, names: int = 1
) -> Table:
    """Make a table of a row for each score.

    Parameters
    ----------
    scores
        Figures by name; None for a figure that there is not.
    columns
        Headings, each with how its figures are written, like `right {right:.1%} | seconds {seconds:.1f}`.
    title, caption, names
        As for `table_of`.
    """
    parted = [column.partition("{") for column in columns.split(" | ")]
    headings, forms = [heading.strip() for heading, *_ in parted], [brace + form for _, brace, form in parted]
    there = ({name: _None() if value is None else value for name, value in score.items()} for score in scores)
    rows = [[form.format(**score) for form in forms] for score in there]
    return table_of(title, headings, rows, caption=caption, names=names)


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


def require_place_for(output: Path, *, overwrite: bool = True) -> None:
    """Refuse a place that cannot be written to, with its name.

    Parameters
    ----------
    output
        The file to be written.
    overwrite
        Whether a file may be replaced; if not, the message names the option that allows it.

    Raises
    ------
    IsADirectoryError, FileNotFoundError, PermissionError
        It is a folder, or its folder does not exist or is not writable.
    FileExistsError
        It exists, and may not be replaced.
    ValueError
        Another program teaches there.
    """
    folder = output.absolute().parent
    if output.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(output))
    if not folder.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(output.parent))
    if not os.access(folder, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(output.parent))
    if output.exists() and not overwrite:
        raise FileExistsError(f"{output}: exists already; --overwrite writes over it")
    with locked(output):
        pass


#: Remarks of each kind on what was read otherwise than it stands in a file, at most.
_MAX_SAID = 10
#: Characters of one, at most.
_LONGEST = 280


class NameNotes:
    """Says, once for each, which convention clips' joint names had, how many of our joints they have, and oddities."""

    def __init__(self) -> None:
        self._noted, self._said = set[str](), Counter[str]()

    def __call__(self, clip: Clip) -> Clip:
        """Print a note on a clip if it is new; give the clip."""
        line = summary(clip.naming, clip.skeleton.joints) if clip.naming else ""
        if line and line not in self._noted:
            self._noted.add(line)
            note(line)
        for remark in (*clip.notes, *remarks(clip)):
            # A folder's recordings mostly have the same oddities: of what a body is like one line of each kind is
            # enough, of what was read otherwise than it stands in a file some.
            kind, most = remark.partition(":")[0], _MAX_SAID if remark in clip.notes else 1
            self._said[kind] += 1
            if self._said[kind] <= most:
                note(shortened(f"{clip.name}: {remark}", _LONGEST))
            elif self._said[kind] == _MAX_SAID + 1:
                note(f"{clip.name}: {remark}; no more of this kind ({kind}) is said")
        return clip


def require_place_for_report(output: Path, options: argparse.Namespace) -> None:
    """As `require_place_for`; and refuse a library, a recording, and (FileExistsError) what another option reads."""
    if output.suffix.lower() in (".npz", ".kinerec"):
        raise ValueError(f"{output}: expected a table or a picture, like a.csv or a.png")
    require_place_for(output)
    real, given = output.resolve(), [*vars(options).values()]
    for each in chain(given, *(option for option in given if isinstance(option, list))):
        if isinstance(each, Path) and each is not output and real.exists():
            place = each.resolve()
            if real.is_relative_to(place) or real in labels_beside(place):
                raise FileExistsError(f"{output}: expected another place for what is written: it is read with {each}")
