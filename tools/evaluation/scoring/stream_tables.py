"""The figures of `kinespace evaluate stream` as a person reads them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kinespace.tools.evaluation.harness import written
from kinespace.tools.evaluation.scoring.bootstrap import Interval
from kinespace.tools.evaluation.scoring.protocols import Protocol
from kinespace.tools.evaluation.scoring.stream_score import StreamScore
from kinespace.tools.terminal.console import console
from kinespace.tools.terminal.tables import counted, print_scores, table_of

_SHARE, _SECONDS, _PLAIN = "{:.1%}", "{:.2f} s", "{:.3g}"
#: What each figure is, and the form of its value; under a heading the basis of the figures below it.
_KNOWN = {
    "frame_accuracy": ("share of their time guessed right", _SHARE),
    "segment_accuracy": ("the same, last second wholly inside", _SHARE),
    "segment_majority": ("segments most of which is guessed right", _SHARE),
    "known_answered": ("share named at all, last second inside", _SHARE),
    "segments_found": ("segments found: a lasting right guess", _SHARE),
    "median_delay_s": ("delay of that guess, median", _SECONDS),
    "p90_delay_s": ("the same, 90 %", _SECONDS),
    "median_seen": ("share of the motion seen by then, median", _SHARE),
    "median_event_delay_s": ("delay of the start event, median", _SECONDS),
}
_UNKNOWN = {
    "unknown_answered": ("share of their time named", _SHARE),
    "false_per_minute": ("names begun per minute", _PLAIN),
    "false_starts_per_minute": ("start events per minute", _PLAIN),
    "auc_unknown": ("ROC area of the raw score against known", _PLAIN),
}
_CONTAINING = {"takes_found": ("classes named at some time in the take", _SHARE)}
_WHOLE = {
    "changes_per_minute": ("changes of the motion per minute", _PLAIN),
    "true_changes_per_minute": ("the same, by the labels", _PLAIN),
    "doubted": ("share of their time in which joints are doubted", _SHARE),
    "unlike": ("takes whose body was found unlike the library's", _SHARE),
}
_CLASSES = (
    ("class", "{name}"),
    ("seconds", "{seconds:.1f}"),
    ("right", "{right:.1%}"),
    ("right, last second inside", "{right_inside:.1%}"),
)
_SHOWN_OF_PERSONS = ("frame_accuracy", "segment_accuracy", "segment_majority", "unknown_answered", "takes_found")


def print_score(score: StreamScore, *, by_person: bool = False) -> None:
    """Print the figures with their intervals (`Figure.interval`) and their basis, and each class's result."""
    rows = list[tuple[str, ...]]()
    for heading, basis, unit, figures in (
        ("known motions", score.known, "segment", _KNOWN),
        ("unknown motions", score.unknown, "segment", _UNKNOWN),
        ("takes that contain a class", score.containing, "take", _CONTAINING),
        ("whole takes", score.known, "", _WHOLE),
    ):
        if basis["segments"]:
            rows.append((f"{heading}: {rests_on(basis, unit)}" if unit else heading,))
            for name, (text, form) in figures.items():
                ends = interval(score.figures[name].interval(by_person=by_person), form)
                rows.append((f"  {text}", written(score.values[name], form), ends))
    headings = "", "", "95 %, by person" if by_person else "95 %"
    console.print(table_of("Answers against the motion performed at that moment", headings, rows))
    if score.classes:
        by_class = ({"name": name, **each} for name, each in score.classes.items())
        print_scores(by_class, _CLASSES, title="By class")


def print_persons(
    persons: Mapping[str, Mapping[str, float | None]], summary: Mapping[str, Mapping[str, float | None]], by: Protocol
) -> None:
    """Print every person's main figures, their mean, and the worst of each."""
    shown = [name for name in _SHOWN_OF_PERSONS if summary["mean"][name] is not None]
    texts = _KNOWN | _UNKNOWN | _CONTAINING
    rows = [(person, *(written(figures[name]) for name in shown)) for person, figures in {**persons, **summary}.items()]
    console.print(table_of(f"By person ({by})", ("person", *(texts[name][0] for name in shown)), rows))


def interval(ends: Interval | None, form: str = _SHARE) -> str:
    """Write the ends of an interval; their unit is written once, after the second.

    An interval without length says nothing: every draw had the same figure.
    """
    if ends is None or ends[0] == ends[1]:
        return "-"
    low, high = map(form.format, ends)
    return f"{low.rstrip('% s')}–{high}"


def rests_on(basis: Mapping[str, Any], unit: str) -> str:
    """Write what figures rest on (`stream_score.basis_of`)."""
    persons = "persons not known" if basis["persons"] is None else counted(basis["persons"], "person")
    return f"{basis['seconds']:.0f} s, {counted(basis['segments'], unit)}, {persons}"
