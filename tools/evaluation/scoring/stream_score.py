"""How right a stream of answers was: the answer at each moment against the motion performed at that moment."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from kinespace.tools.evaluation.scoring.bootstrap import Percentile, Ratio, RocArea, intervals_of, values_of
from kinespace.tools.evaluation.scoring.stretches import Stretch, stretches_of
from kinespace.tools.evaluation.scoring.timeline import NONE

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from kinespace.tools.evaluation.scoring.bootstrap import Figure
    from kinespace.tools.evaluation.scoring.timeline import Course

_Item = TypeVar("_Item")
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

    def as_json(self) -> dict[str, object]:
        """Give values, classes, bases, and the 95 % interval of each figure."""
        bases = {"known": self.known, "unknown": self.unknown, "containing": self.containing}
        return {**self.values, "classes": self.classes, **bases, "intervals": intervals_of(self.figures)}


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
    known = _Counting([each for each in stretches if each.known])
    unknown = _Counting([each for each in stretches if not each.known])
    containing = [each for each in courses if each.contains]
    figures: dict[str, Figure] = {
        "frame_accuracy": known.ratio(lambda each: each.right, lambda each: each.seconds),
        "segment_accuracy": known.ratio(lambda each: each.right_inside, lambda each: each.inside),
        "segment_majority": known.ratio(lambda each: each.mostly_right, lambda _: 1),
        "known_answered": known.ratio(lambda each: each.named_inside, lambda each: each.inside),
        "segments_found": known.ratio(lambda each: each.delay is not None, lambda _: 1),
        "median_delay_s": known.percentile(lambda each: each.delay, 50),
        "p90_delay_s": known.percentile(lambda each: each.delay, 90),
        "median_seen": known.percentile(lambda each: each.seen, 50),
        "median_event_delay_s": known.percentile(lambda each: each.event_delay, 50),
        "unknown_answered": unknown.ratio(lambda each: each.named, lambda each: each.seconds),
        "false_per_minute": unknown.ratio(lambda each: each.begun, lambda each: each.seconds, 60),
        "false_starts_per_minute": unknown.ratio(lambda each: each.started, lambda each: each.seconds, 60),
        "auc_unknown": RocArea(known.scores(), unknown.scores()),
        "takes_found": _over_takes(containing, _found, lambda each: len(each.contains)),
        "changes_per_minute": _over_takes(courses, lambda each: _changes(each.event), lambda each: each.seconds, 60),
        "true_changes_per_minute": _over_takes(
            courses, lambda each: _changes(each.truth), lambda each: each.seconds, 60
        ),
        "doubted": _over_takes(courses, lambda each: each.doubted * each.seconds, lambda each: each.seconds),
    }
    first = {each.name: each for each in reversed(containing)}.values()
    rests_on = basis_of([each.seconds for each in first], [each.person for each in first])
    return StreamScore(figures, _by_class(stretches, classes), known.basis(), unknown.basis(), rests_on)


class _Counting:
    """Stretches by segment: the answers of several libraries to one segment belong together."""

    def __init__(self, stretches: Sequence[Stretch]) -> None:
        self._units = _grouped(stretches, lambda each: each.key)

    def ratio(self, counted: Callable[[Stretch], float], among: Callable[[Stretch], float], scale: float = 1) -> Ratio:
        """Divide two sums."""
        return _ratio(self._units, counted, among, scale)

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
        return basis_of([each.seconds for each in first], [each.person for each in first])


def _grouped(items: Sequence[_Item], key: Callable[[_Item], object]) -> list[list[_Item]]:
    groups = dict[object, list[_Item]]()
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return list(groups.values())


def _ratio(
    units: Sequence[Sequence[_Item]], counted: Callable[[_Item], float], among: Callable[[_Item], float], scale: float
) -> Ratio:
    above, below = ([float(sum(map(count, unit))) for unit in units] for count in (counted, among))
    return Ratio(above, below, scale)


def _over_takes(
    courses: Sequence[Course], counted: Callable[[Course], float], among: Callable[[Course], float], scale: float = 1
) -> Ratio:
    return _ratio(_grouped(courses, lambda each: each.name), counted, among, scale)


def _found(course: Course) -> int:
    """Count the classes of a take that were named at some time."""
    return len({*course.contains} & {*course.published.tolist()})


def _changes(track: NDArray[np.intp]) -> int:
    """Count changes after the first motion: that motion begins within the take and is no change from another."""
    begun = np.flatnonzero(track != NONE)
    return int(np.count_nonzero(np.diff(track[begun[0] :]))) if begun.size else 0


def _by_class(stretches: Sequence[Stretch], classes: Sequence[str]) -> dict[str, dict[str, float]]:
    performed = [each for each in stretches if each.known]
    scores = dict[str, dict[str, float]]()
    for own in sorted(_grouped(performed, lambda each: each.truth), key=lambda each: each[0].truth):
        counting = _Counting(own)
        right = counting.ratio(lambda each: each.right, lambda each: each.seconds).value()
        inside = counting.ratio(lambda each: each.right_inside, lambda each: each.inside).value()
        seconds = counting.basis()["seconds"] or 0.0
        scores[classes[own[0].truth]] = {"seconds": seconds, "right": right or 0.0, "right_inside": inside or 0.0}
    return scores
