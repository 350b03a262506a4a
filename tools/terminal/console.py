"""The terminal: one console for all programs, and progress of long work."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

#: Results go to standard output, plain when it is not a terminal. Names come from files and from the net: text in a
#: name that looks like rich's markup is printed as it is, and cannot end a program.
console = Console(highlight=False, markup=False, emoji=False)
#: Progress goes to standard error, so that it never mixes with results.
progress_console = Console(stderr=True)

_Item = TypeVar("_Item")


def printable(name: str) -> str:
    """Replace the characters of a name from the net that would steer the terminal or break the line."""
    return "".join(character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in name)


def progress(work: Iterable[_Item], what: str, total: int | None) -> Iterator[_Item]:
    """Pass pieces of work through and show how many of the total (None: endless) are done, if there is a terminal."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=progress_console, transient=True, disable=not progress_console.is_terminal) as bar:
        yield from bar.track(work, total=total, description=what)
