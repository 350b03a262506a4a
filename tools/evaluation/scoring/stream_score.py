"""How right a stream of answers was: the answer at each moment against the motion performed at that moment."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from kinespace.tools.evaluation.scoring.bootstrap import Percentile, Ratio, RocArea
from kinespace.tools.evaluation.scoring.stretches import Stretch, stretches_of
from kinespace.tools.evaluation.scoring.timeline import NONE

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kinespace.tools.evaluation.scoring.bootstrap import Figure, Interval
    from kinespace.tools.evaluation.scoring.timeline import Course

_Item = TypeVar("_Item")

#: Figures of which less is better; for all others more is better.
LOWER_IS_BETTER = frozenset(
    (
        *("median_delay_s", "p90_delay_s", "median_seen", "median_event_delay_s"),
        *("false_per_minute", "unknown_answered", "changes_per_minute", "false_starts_per_minute"),
    )
)


@dataclass(frozen=True, slots=True)
class ClassScore:
    """The result of one class: seconds performed, the share guessed right, and the same with the last second inside."""

    seconds: float
    right: float
    right_inside: float


@dataclass(frozen=True, slots=True)
class Basis:
    """The basis of figures: seconds, segments (or takes), and persons; None when the persons are not known.

    A segment that several libraries were asked about counts once.
    """

    seconds: float
    segments: int
    persons: int | None


@dataclass(frozen=True, slots=True)
class StreamScore:
    """How right the answers to some takes were. Shares are 0 to 1; None where there is nothing to take a share of.

    Attributes
    ----------
    frame_accuracy
        Of the labelled time of known classes, the share in which the moment's best guess was the class performed.
    segment_accuracy
        The same, for moments whose last second lies wholly inside the segment.
    known_answered
        Share of that time, last second inside, in which a class was named, not answered unknown or still.
    segments_found
        Share of the known segments with a lasting right guess.
    median_delay_s, p90_delay_s
        Seconds from a found segment's start to its first lasting right guess.
    median_seen
        Share of a found segment's seconds that had passed at its first lasting right guess.
    median_event_delay_s
        Seconds from a segment's start to the start event of its class, for segments with such an event.
    false_per_minute
        Named classes that begin during motions the library does not know, per minute of such motions.
    unknown_answered
        Share of the time of such motions in which a class was named.
    changes_per_minute, true_changes_per_minute
        How often the motion that goes on changed, by the events and by the labels.
    auc_unknown
        Area under the ROC curve of the raw score, known against unknown motions, windows wholly inside a segment.
    classes
        The result of each class, by name.
    segment_majority
        Share of the known segments for most of whose time the best guess was the class performed.
    false_starts_per_minute
        Start events during motions the library does not know, per minute of such motions.
    takes_found
        For takes that only say which classes they contain: the share of these classes named at some time in the take.
    known, unknown, containing
        The basis of the figures of known motions, of unknown motions, and of `takes_found` (segments are takes for the
        last).
    intervals
        Lower and upper end of the 95 % interval of each figure, by name (`tools.evaluation.scoring.bootstrap`);
        empty where none was asked for.
    """

    frame_accuracy: float | None
    segment_accuracy: float | None
    known_answered: float | None
    segments_found: float | None
    median_delay_s: float | None
    p90_delay_s: float | None
    median_seen: float | None
    median_event_delay_s: float | None
    false_per_minute: float | None
    unknown_answered: float | None
    changes_per_minute: float | None
    true_changes_per_minute: float | None
    auc_unknown: float | None
    classes: dict[str, ClassScore] = field(repr=False)
    segment_majority: float | None
    false_starts_per_minute: float | None
    takes_found: float | None
    known: Basis
    unknown: Basis
    containing: Basis
    intervals: dict[str, Interval | None] = field(repr=False)

    def figures(self) -> dict[str, float | None]:
        """Give every figure by its name."""
        others = ("classes", "known", "unknown", "containing", "intervals")
        return {name: getattr(self, name) for name in self.__slots__ if name not in others}


def score_courses(
    courses: Sequence[Course], classes: Sequence[str], window: float, *, intervals: bool = False
) -> StreamScore:
    """Score some takes together.

    Parameters
    ----------
    courses
        At least one. Courses of the same name belong to the same take, recognised by several libraries.
    classes
        The library's class names.
    window
        Seconds before a moment that must lie inside the segment.
    intervals
        Whether to compute the intervals of the figures.
    """
    stretches = list(stretches_of(courses, window))
    known = _Counting([each for each in stretches if each.known])
    unknown = _Counting([each for each in stretches if not each.known])
    figures: dict[str, Figure] = {
        "frame_accuracy": known.ratio(lambda each: each.right, lambda each: each.seconds),
        "segment_accuracy": known.ratio(lambda each: each.right_inside, lambda each: each.inside),
        "known_answered": known.ratio(lambda each: each.named_inside, lambda each: each.inside),
        "segments_found": known.ratio(lambda each: each.delay is not None, lambda _: 1),
        "median_delay_s": known.percentile(lambda each: each.delay, 50),
        "p90_delay_s": known.percentile(lambda each: each.delay, 90),
        "median_seen": known.percentile(lambda each: each.seen, 50),
        "median_event_delay_s": known.percentile(lambda each: each.event_delay, 50),
        "false_per_minute": unknown.ratio(lambda each: each.begun, lambda each: each.seconds, 60),
        "unknown_answered": unknown.ratio(lambda each: each.named, lambda each: each.seconds),
        "changes_per_minute": _changes_per_minute(courses, lambda each: each.event),
        "true_changes_per_minute": _changes_per_minute(courses, lambda each: each.truth),
        "auc_unknown": RocArea(known.scores(), unknown.scores()),
        "segment_majority": known.ratio(lambda each: each.mostly_right, lambda _: 1),
        "false_starts_per_minute": unknown.ratio(lambda each: each.started, lambda each: each.seconds, 60),
        "takes_found": _takes_found(courses),
    }
    return StreamScore(
        **{name: figure.value() for name, figure in figures.items()},
        classes=_by_class(stretches, classes),
        known=known.basis(),
        unknown=unknown.basis(),
        containing=_basis_of_takes([each for each in courses if each.contains]),
        intervals={name: each.interval() for name, each in figures.items()} if intervals else {},
    )


class _Counting:
    """Stretches by segment: the answers of several libraries to one segment belong together."""

    def __init__(self, stretches: Sequence[Stretch]) -> None:
        self._units = list(_grouped(stretches, lambda each: each.key).values())

    def ratio(self, counted: Callable[[Stretch], float], among: Callable[[Stretch], float], scale: float = 1) -> Ratio:
        """Divide two sums."""
        above, below = ([float(sum(map(count, unit))) for unit in self._units] for count in (counted, among))
        return Ratio(above, below, scale)

    def percentile(self, measured: Callable[[Stretch], float | None], percent: float) -> Percentile:
        """Take a percentile of a number over the stretches that have it."""
        values = [[value for value in map(measured, unit) if value is not None] for unit in self._units]
        return Percentile(values, percent)

    def scores(self) -> list[NDArray[np.float64]]:
        """Give the raw scores of each segment."""
        return [np.concatenate([each.scores for each in unit]) for unit in self._units]

    def basis(self) -> Basis:
        """Count seconds, segments and persons."""
        first = [unit[0] for unit in self._units]
        return _basis([each.seconds for each in first], [each.person for each in first])


def _grouped(items: Sequence[_Item], key: Callable[[_Item], object]) -> dict[object, list[_Item]]:
    groups = dict[object, list[_Item]]()
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return groups


def _basis(seconds: Sequence[float], persons: Sequence[str]) -> Basis:
    return Basis(float(sum(seconds)), len(seconds), len(set(persons)) if all(persons) else None)


def _basis_of_takes(courses: Sequence[Course]) -> Basis:
    first = {each.name: each for each in reversed(courses)}.values()
    return _basis([each.seconds for each in first], [each.person for each in first])


def _takes_found(courses: Sequence[Course]) -> Ratio:
    takes = _grouped([each for each in courses if each.contains], lambda each: each.name).values()
    found = [sum(len({*each.contains} & {*each.published.tolist()}) for each in take) for take in takes]
    return Ratio(found, [sum(len(each.contains) for each in take) for take in takes])


def _changes_per_minute(courses: Sequence[Course], track: Callable[[Course], NDArray[np.intp]]) -> Ratio:
    takes = _grouped(courses, lambda each: each.name).values()
    counted = [sum(_changes(track(each)) for each in take) for take in takes]
    return Ratio(counted, [sum(each.seconds for each in take) for take in takes], 60)


def _changes(track: NDArray[np.intp]) -> int:
    """Count changes after the first motion: that motion begins within the take and is no change from another."""
    begun = np.flatnonzero(track != NONE)
    return int(np.count_nonzero(np.diff(track[begun[0] :]))) if begun.size else 0


def _by_class(stretches: Sequence[Stretch], classes: Sequence[str]) -> dict[str, ClassScore]:
    performed = _grouped([each for each in stretches if each.known], lambda each: each.truth)
    return {
        classes[index]: ClassScore(
            seconds=sum({each.key: each.seconds for each in performed[index]}.values()),
            right=_share(performed[index], lambda each: each.right, lambda each: each.seconds),
            right_inside=_share(performed[index], lambda each: each.right_inside, lambda each: each.inside),
        )
        for index in range(len(classes))
        if index in performed
    }


def _share(
    stretches: Sequence[Stretch], counted: Callable[[Stretch], float], among: Callable[[Stretch], float]
) -> float:
    whole = sum(map(among, stretches))
    return sum(map(counted, stretches)) / whole if whole else 0.0
