"""The figures of `kinespace evaluate stream` as a person reads them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

from kinespace.tools.terminal.console import console
from kinespace.tools.terminal.tables import add_names, counted, narrow_table

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from kinespace.tools.evaluation.scoring.bootstrap import Interval
    from kinespace.tools.evaluation.scoring.protocols import Protocol
    from kinespace.tools.evaluation.scoring.stream_score import Basis, StreamScore

    #: The names of figures, and the form of their values.
    _Rows = Mapping[str, tuple[str, Callable[[float], str]]]

#: Characters that the figures beside classes' names need.
_BESIDE_CLASSES = 38


def percent(value: float) -> str:
    """Write a share."""
    return f"{value:.1%}"


def _seconds(value: float) -> str:
    return f"{value:.2f} s"


def _plain(value: float) -> str:
    return f"{value:.3g}"


_KNOWN: _Rows = {
    "frame_accuracy": ("share of their time guessed right", percent),
    "segment_accuracy": ("the same, last second wholly inside", percent),
    "segment_majority": ("segments most of which is guessed right", percent),
    "known_answered": ("share named at all, last second inside", percent),
    "segments_found": ("segments found: a lasting right guess", percent),
    "median_delay_s": ("delay of that guess, median", _seconds),
    "p90_delay_s": ("the same, 90 %", _seconds),
    "median_seen": ("share of the motion seen by then, median", percent),
    "median_event_delay_s": ("delay of the start event, median", _seconds),
}
_UNKNOWN: _Rows = {
    "unknown_answered": ("share of their time named", percent),
    "false_per_minute": ("names begun per minute", _plain),
    "false_starts_per_minute": ("start events per minute", _plain),
    "auc_unknown": ("ROC area of the raw score against known", _plain),
}
_CONTAINING: _Rows = {"takes_found": ("classes named at some time in the take", percent)}
_CHANGES: _Rows = {
    "changes_per_minute": ("changes of the motion per minute", _plain),
    "true_changes_per_minute": ("the same, by the labels", _plain),
}
_SHOWN_OF_PERSONS = ("frame_accuracy", "segment_accuracy", "segment_majority", "unknown_answered", "takes_found")


def print_score(score: StreamScore) -> None:
    """Print the figures with their intervals and their basis, and each class's result."""
    table = narrow_table("Answers against the motion performed at that moment")
    table.add_column("")
    table.add_column("", justify="right")
    table.add_column("95 %", justify="right")
    for heading, basis, unit, rows in (
        ("known motions", score.known, "segment", _KNOWN),
        ("unknown motions", score.unknown, "segment", _UNKNOWN),
        ("takes that contain a class", score.containing, "take", _CONTAINING),
    ):
        if basis.segments:
            table.add_row(f"{heading}: {_rests_on(basis, unit)}")
            _add_rows(table, score, rows)
    if score.known.segments:
        table.add_row("whole takes")
        _add_rows(table, score, _CHANGES)
    console.print(table)
    if score.classes:
        _print_classes(score)


def print_persons(
    persons: Mapping[str, StreamScore], summary: Mapping[str, Mapping[str, object]], by: Protocol
) -> None:
    """Print every person's main figures, their mean, and the worst of each."""
    shown = [name for name in _SHOWN_OF_PERSONS if summary["mean"][name] is not None]
    headings = {name: told for rows in (_KNOWN, _UNKNOWN, _CONTAINING) for name, (told, _) in rows.items()}
    table = narrow_table(f"By person ({by})")
    table.add_column("person")
    for name in shown:
        table.add_column(headings[name], justify="right")
    rows = {person: score.figures() for person, score in persons.items()}
    for person, figures in (*rows.items(), ("mean", summary["mean"]), ("worst", summary["worst"])):
        shares = [figures[name] for name in shown]
        table.add_row(person, *(percent(share) if isinstance(share, float) else "-" for share in shares))
    console.print(table)


def interval(ends: Interval | None, write: Callable[[float], str]) -> str:
    """Write the ends of an interval; their unit is written once, after the second.

    An interval without length says nothing: every draw had the same figure.
    """
    if ends is None or ends[0] == ends[1]:
        return "-"
    low, high = map(write, ends)
    return f"{low.rstrip('% s')}–{high}"


def _rests_on(basis: Basis, unit: str) -> str:
    persons = "persons not told" if basis.persons is None else counted(basis.persons, "person")
    return f"{basis.seconds:.0f} s, {counted(basis.segments, unit)}, {persons}"


def _add_rows(table: Table, score: StreamScore, rows: _Rows) -> None:
    figures = score.figures()
    for name, (told, write) in rows.items():
        value = figures[name]
        table.add_row(f"  {told}", "-" if value is None else write(value), interval(score.intervals.get(name), write))


def _print_classes(score: StreamScore) -> None:
    classes = Table(title="By class", title_justify="left")
    add_names(classes, "class", score.classes, beside=_BESIDE_CLASSES)
    for heading in ("seconds", "right", "right, last second inside"):
        classes.add_column(heading, justify="right")
    for name, each in score.classes.items():
        classes.add_row(name, f"{each.seconds:.1f}", percent(each.right), percent(each.right_inside))
    console.print(classes)
