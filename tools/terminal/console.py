"""The terminal: one console for all programs, and progress of long work."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rich.text import Text

_Item = TypeVar("_Item")


def printable(name: str, kept: str = "") -> str:
    """Give a name from a file or the net without control characters, apart from `kept`."""
    return "".join(
        character if character.isprintable() or character in kept else "\N{REPLACEMENT CHARACTER}" for character in name
    )


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


def say(line: str | Text) -> None:
    """Print a line, which the terminal breaks where it is narrow."""
    console.print(line, soft_wrap=True)


def note(line: str) -> None:
    """Print a line that is no result where progress is shown: another program may read the results."""
    progress_console.print(line, soft_wrap=True, markup=False, highlight=False)


def progress(work: Iterable[_Item], what: str, total: int | None) -> Iterator[_Item]:
    """Pass pieces of work through and show on a terminal how many of the total (None: endless) are done."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=progress_console, transient=True, disable=not progress_console.is_terminal) as bar:
        yield from bar.track(work, total=total, description=what)
