"""How right a stream of answers was: the answer at each moment against the motion performed at that moment."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from kinespace.tools.evaluation.bootstrap import Figure, Interval, Percentile, Ratio, RocArea, intervals_of, values_of
from kinespace.tools.evaluation.harness import Protocol, written
from kinespace.tools.evaluation.timeline import NONE, Course, Stretch, stretches_of
from kinespace.tools.terminal.console import console
from kinespace.tools.terminal.tables import counted, print_scores, table_of

_Item = TypeVar("_Item")
_seconds = attrgetter("seconds")
#: Seconds, units, and persons, by name.
Basis = dict[str, float | None]

#: Figures of which less is better; for all others more is better.
LOWER_IS_BETTER = frozenset(
    (
        *("median_delay_s", "p90_delay_s", "median_seen", "median_event_delay_s"),
        *("false_per_minute", "unknown_answered", "changes_per_minute", "false_starts_per_minute", "doubted"),
    )
)


def basis_of(seconds: Sequence[float], persons: Sequence[str]) -> Basis:
    """Give what figures rest on: the seconds of each segment together, segments, and persons, None if not all known."""
    known = len(set(persons)) if all(persons) else None
    return {"seconds": float(sum(seconds)), "segments": len(seconds), "persons": known}


@dataclass(frozen=True, eq=False)
class StreamScore:
    """How right the answers to some takes were.

    Attributes
    ----------
    figures
        By name; `scoring.stream_tables` says of each what it is. Shares are 0 to 1.
    classes
        Of each class performed, the seconds, and the shares of its time guessed right, and right with the last second
        inside the segment.
    known, unknown, containing
        The basis of the figures of known motions, of unknown motions, and of `takes_found` (segments are takes for the
        last). A segment that several libraries were asked about counts once.
    """

    figures: Mapping[str, Figure]
    classes: dict[str, dict[str, float]] = field(repr=False)
    known: Basis
    unknown: Basis
    containing: Basis

    @cached_property
    def values(self) -> dict[str, float | None]:
        """The value of each figure; None where there is nothing to take a share of."""
        return values_of(self.figures)

    def as_json(self, *, by_person: bool = False) -> dict[str, object]:
        """Give values, classes, bases, and the 95 % interval of each figure (`Figure.interval`)."""
        bases = {"known": self.known, "unknown": self.unknown, "containing": self.containing}
        intervals = intervals_of(self.figures, by_person=by_person)
        return {**self.values, "classes": self.classes, **bases, "intervals": intervals}


def score_courses(courses: Sequence[Course], classes: Sequence[str], window: float) -> StreamScore:
    """Score some takes together.

    Parameters
    ----------
    courses
        At least one. Courses of the same name belong to the same take, recognised by several libraries.
    classes
        The library's class names.
    window
        Seconds before a moment that must lie inside the segment.
    """
    stretches = list(stretches_of(courses, window))
    of_known = [each for each in stretches if each.known]
    known, unknown = _grouped(of_known, "key"), _grouped([each for each in stretches if not each.known], "key")
    takes, containing = _grouped(courses, "name"), _grouped([each for each in courses if each.contains], "name")
    figures: dict[str, Figure] = {
        "frame_accuracy": _ratio(known, lambda each: each.right, _seconds),
        "segment_accuracy": _ratio(known, lambda each: each.right_inside, lambda each: each.inside),
        "segment_majority": _ratio(known, lambda each: each.mostly_right, lambda _: 1),
        "known_answered": _ratio(known, lambda each: each.named_inside, lambda each: each.inside),
        "segments_found": _ratio(known, lambda each: each.found, lambda _: 1),
        "median_delay_s": _percentile(known, lambda each: each.delay, 50),
        "p90_delay_s": _percentile(known, lambda each: each.delay, 90),
        "median_seen": _percentile(known, lambda each: each.seen, 50),
        "median_event_delay_s": _percentile(known, lambda each: each.event_delay, 50),
        "unknown_answered": _ratio(unknown, lambda each: each.named, _seconds),
        "false_per_minute": _ratio(unknown, lambda each: each.begun, _seconds, 60),
        "false_starts_per_minute": _ratio(unknown, lambda each: each.started, _seconds, 60),
        "auc_unknown": RocArea(_scores(known), _scores(unknown), persons=(_persons(known), _persons(unknown))),
        "takes_found": _ratio(containing, _found, lambda each: len(each.contains)),
        "changes_per_minute": _ratio(takes, lambda each: _changes(each.event), _seconds, 60),
        "true_changes_per_minute": _ratio(takes, lambda each: _changes(each.truth), _seconds, 60),
        "doubted": _ratio(takes, lambda each: each.doubted * each.seconds, _seconds),
        "unlike": _ratio(takes, lambda each: bool(each.unlike), lambda each: each.unlike is not None),
    }
    of_classes = sorted(_grouped(of_known, "truth"), key=lambda own: own[0].truth)
    by_class = {classes[own[0].truth]: _score_of_class(_grouped(own, "key")) for own in of_classes}
    return StreamScore(figures, by_class, _basis(known), _basis(unknown), _basis(containing))


def _grouped(items: Sequence[_Item], by: str) -> list[list[_Item]]:
    """Put together the answers of several libraries to one segment, or to one take."""
    groups = dict[object, list[_Item]]()
    for item in items:
        groups.setdefault(getattr(item, by), []).append(item)
    return list(groups.values())


def _ratio(
    units: Sequence[Sequence[_Item]],
    counted: Callable[[_Item], float],
    among: Callable[[_Item], float],
    scale: float = 1,
) -> Ratio:
    above, below = ([float(sum(map(count, unit))) for unit in units] for count in (counted, among))
    return Ratio(above, below, scale, persons=(_persons(units),))


def _percentile(
    units: Sequence[Sequence[Stretch]], measured: Callable[[Stretch], float | None], percent: float
) -> Percentile:
    """Take a percentile of a number over the stretches that have it."""
    values = [[value for each in unit if (value := measured(each)) is not None] for unit in units]
    return Percentile(values, percent, persons=(_persons(units),))


def _scores(units: Sequence[Sequence[Stretch]]) -> list[NDArray[np.float64]]:
    return [np.concatenate([each.scores for each in unit]) for unit in units]


def _basis(units: Sequence[Sequence[Stretch | Course]]) -> Basis:
    return basis_of([unit[0].seconds for unit in units], _persons(units))


def _persons(units: Sequence[Sequence[Any]]) -> list[str]:
    return [unit[0].person for unit in units]


def _found(course: Course) -> int:
    """Count the classes of a take that were named at some time."""
    return len({*course.contains} & {*course.published.tolist()})


def _changes(track: NDArray[np.intp]) -> int:
    """Count changes after the first motion: that motion begins within the take and is no change from another."""
    begun = np.flatnonzero(track != NONE)
    return int(np.count_nonzero(np.diff(track[begun[0] :]))) if begun.size else 0


def _score_of_class(units: Sequence[Sequence[Stretch]]) -> dict[str, float]:
    right = _ratio(units, lambda each: each.right, _seconds).value()
    inside = _ratio(units, lambda each: each.right_inside, lambda each: each.inside).value()
    return {"seconds": _basis(units)["seconds"] or 0.0, "right": right or 0.0, "right_inside": inside or 0.0}


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
