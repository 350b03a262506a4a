"""The terminal: one console for all programs, and progress of long work."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from typing import Any, Literal, TextIO, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
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


_log = logging.getLogger("kinespace.lines")


class _Lines(logging.Formatter):
    """Writes the wall clock (UTC), the level and the line; as JSON also the facts that the line tells."""

    def __init__(self, kind: Literal["text", "json"]) -> None:
        super().__init__()
        self._kind = kind

    def format(self, record: logging.LogRecord) -> str:
        """Write one line."""
        moment = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        level, text = record.levelname.lower(), printable(record.getMessage().strip())
        if self._kind == "text":
            return f"{moment} {level:7} {text}"
        facts: dict[str, object] = record.__dict__.get("facts", {})
        return json.dumps({"time": moment, "level": level, "text": text, **facts})


class _Handler(logging.StreamHandler[TextIO]):
    """Writes lines; where the reader has gone, or the disk is full, that is the program's error, not a traceback."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: ARG002, N802 - as logging calls it
        """Raise the error that is being handled."""
        raise  # noqa: PLE0704 - as above


def log_as(kind: Literal["text", "json"]) -> None:
    """Write every line that is said from now on with the wall clock and a level."""
    handler = _Handler(sys.stdout)
    handler.setFormatter(_Lines(kind))
    _log.handlers, _log.propagate = [handler], False
    _log.setLevel(logging.INFO)


def say(line: str | Text, facts: Mapping[str, object] | None = None, *, level: int = logging.INFO) -> None:
    """Print one line, which the terminal breaks where it is narrow; in a log, with its level and its facts.

    Whatever names are in it, it stays one line, and has no control characters.
    """
    if _log.handlers:
        _log.log(level, "%s", line, extra={"facts": facts or {}})
    else:
        console.print(printable(line) if isinstance(line, str) else line, soft_wrap=True)


def note(line: str) -> None:
    """Print a line that is no result where progress is shown: another program may read the results."""
    progress_console.print(printable(line), soft_wrap=True, markup=False, highlight=False)


def progress(work: Iterable[_Item], what: str, total: int | None) -> Iterator[_Item]:
    """Pass pieces of work through and show on a terminal how many of the total (None: endless) are done."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=progress_console, transient=True, disable=not progress_console.is_terminal) as bar:
        yield from bar.track(work, total=total, description=what)
