"""How right answers were: figures of units, their uncertainty, and the answer at each moment against the motion then.

A figure is computed from units: segments, takes or clips. Units are drawn with replacement, as many as there are, a
thousand times; the middle 95 % of the figures of these draws is the interval (Efron 1979). All counts of one unit are
drawn together, because they are not independent. Nor are the segments of one person: to say how the figure varies with
other persons, persons are drawn in place of units, each with all that is theirs.
"""

import csv
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream import EventKind, Outcome, Recognition
from kinespace.tools.cli.console import counted, csv_text, scores_of, table_of
from kinespace.tools.evaluation.harness import Protocol, Take, written

#: Says how often each of some units was drawn, shape (draws, units). The second number is the kind of
#: the units: two kinds are drawn independently.
Draw = Callable[[int, int], NDArray[np.float64]]

#: The number of draws.
RESAMPLES = 1000
#: The seed of the first kind of units: the same figures have the same interval.
_SEED = 2012
_ENDS = (2.5, 97.5)

#: Lower and upper end.
Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure computed from units.

    Attributes
    ----------
    of
        Gives the figure of each draw, shape (draws,); NaN for a draw without units for it.
    persons
        For each kind of units the person of each unit; empty where persons do not matter.
    """

    of: Callable[[Draw], NDArray[np.float64]]
    persons: Sequence[Sequence[str]] = ()

    def value(self) -> float | None:
        """Give the figure of all units; None when there are no units for it."""
        value = self.of(lambda units, _: np.ones((1, units))).item()
        return None if np.isnan(value) else value

    def interval(self, *, by_person: bool = False) -> Interval | None:
        """Give the ends of its 95 % interval, None when there is none; persons may be drawn in place of units."""
        drawn = self.of(partial(_drawn_by_person, self.persons) if by_person else _drawn)
        there = drawn[np.isfinite(drawn)]
        if not there.size:
            return None
        low, high = np.percentile(there, _ENDS).tolist()
        return low, high


#: Numbers, one of each unit.
Numbers = Sequence[float] | NDArray[np.float64]


def ratio(counted: Numbers, among: Numbers, scale: float = 1.0, *, persons: Sequence[Sequence[str]] = ()) -> Figure:
    """Divide one sum over units by another, for a share or a rate; `scale` is a factor on the quotient."""

    def of(draw: Draw) -> NDArray[np.float64]:
        drawn = draw(len(among), 0)
        above, below = (drawn @ np.asarray(each, dtype=np.float64) for each in (counted, among))
        return scale * _quotient(above, below)

    return Figure(of, persons)


def percentile(values: Sequence[Sequence[float]], percent: float, *, persons: Sequence[Sequence[str]] = ()) -> Figure:
    """Take a percentile of values; each unit has none, one or several values."""

    def of(draw: Draw) -> NDArray[np.float64]:
        every = np.array([value for each in values for value in each], dtype=np.float64)
        unit = np.repeat(np.arange(len(values)), [len(each) for each in values])
        counts = draw(len(values), 0).astype(np.intp)[:, unit]
        return np.array([np.percentile(np.repeat(every, n), percent) if n.any() else np.nan for n in counts])

    return Figure(of, persons)


#: The values of each unit, finite, any number of them.
Values = Sequence[NDArray[np.float64]]


def roc_area(higher: Values, lower: Values, *, persons: Sequence[Sequence[str]] = ()) -> Figure:
    """Give the probability that a value of the first units is above one of the second, ties counting half.

    Both kinds of units are drawn by themselves (Mann-Whitney).
    """

    def of(draw: Draw) -> NDArray[np.float64]:
        first, second = draw(len(higher), 0), draw(len(lower), 1)
        pairs = (first @ [*map(len, higher)]) * (second @ [*map(len, lower)])
        return _quotient(((first @ _wins(higher, lower)) * second).sum(axis=1), pairs)

    return Figure(of, persons)


def _wins(higher: Values, lower: Values) -> NDArray[np.float64]:
    """Count for each two units in how many pairs of their values the first is above, shape (higher, lower)."""
    edges = np.cumsum([0, *map(len, higher)])
    together = np.concatenate([np.zeros(0), *higher])
    wins = np.zeros((len(higher), len(lower)))
    for column, each in zip(wins.T, map(np.sort, lower), strict=True):
        below = np.searchsorted(each, together, side="left") + np.searchsorted(each, together, side="right")
        column[:] = np.diff(np.append(0.0, np.cumsum(below / 2))[edges])
    return wins


def _drawn(units: int, kind: int) -> NDArray[np.float64]:
    if not units:
        return np.zeros((RESAMPLES, 0))
    generator = np.random.default_rng(_SEED + kind)
    return generator.multinomial(units, np.full(units, 1 / units), size=RESAMPLES).astype(np.float64)


def _drawn_by_person(persons: Sequence[Sequence[str]], _: int, kind: int) -> NDArray[np.float64]:
    """Draw persons, for all kinds of units the same."""
    places = {person: place for place, person in enumerate(sorted({each for kind in persons for each in kind}))}
    return _drawn(len(places), 0)[:, [places[person] for person in persons[kind]]]


def _quotient(above: NDArray[np.float64], below: NDArray[np.float64]) -> NDArray[np.float64]:
    quotient: NDArray[np.float64] = np.divide(above, below, out=np.full(below.shape, np.nan), where=below > 0)
    return quotient


def values_of(figures: Mapping[str, Figure]) -> dict[str, float | None]:
    """Give the value of each figure."""
    return {name: figure.value() for name, figure in figures.items()}


def intervals_of(figures: Mapping[str, Figure], *, by_person: bool = False) -> dict[str, Interval | None]:
    """Give the interval of each figure."""
    return {name: figure.interval(by_person=by_person) for name, figure in figures.items()}


def guess_of(answer: Recognition) -> str | None:
    """Give the class that is guessed, named or not; None where there is no guess."""
    return answer.classes[answer.guess_index] if answer.guess_index >= 0 else None


def counted_in(take: Take, known: Collection[str], answers: Iterable[Recognition], inside: float = 0.0) -> Counter[str]:
    """Count the answers in a take's segments.

    Parameters
    ----------
    take
        The take.
    known
        The classes that the library knows.
    answers
        The answers, by time.
    inside
        Seconds for which an answer's segment must have lasted for the answer to count.

    Returns
    -------
    The number of `answers` to known motions, and how many of them name the class performed (`right`), have it as best
    guess (`guessed`), name another (`wrong`) or find the body `implausible`. Of answers to unknown motions (`unknown`)
    how many name a class (`unknown_named`).
    """
    counts = Counter[str]()
    for answer in answers:
        performed = [each.label for each in take.segments if each.start + inside <= answer.time < each.end]
        if performed and performed[-1] not in known:
            counts.update(unknown=1, unknown_named=answer.class_name is not None)
        elif performed:
            right, guessed = (each == performed[-1] for each in (answer.class_name, guess_of(answer)))
            counts.update(answers=1, right=right, guessed=guessed, wrong=answer.class_name is not None and not right)
            counts.update(implausible=answer.outcome is Outcome.IMPLAUSIBLE)
    return counts


#: The index that stands for "no class".
NONE = -1
#: Seconds for which a lasting answer stays right; until the segment's end if that comes sooner.
LASTING = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class AnsweredTake:
    """One take: the motion performed and the answer given, at the time of every frame.

    Attributes
    ----------
    name
        The take's name.
    times
        Shape (frames,), seconds from the take's start.
    segments
        The segments performed, with the library's class names where it knows them.
    truth
        Index of the class performed; NONE where the library does not know it or no label says it.
    segment
        Index of the segment, -1 outside all.
    guess
        Index of the best guess, named or not; NONE before the first answer and while still.
    published
        Index of the class named last, NONE for none.
    event
        Index of the class whose event goes on, NONE for none.
    score
        Raw score of the best guess; NaN before the first answer.
    person
        The person who performs; empty when not known.
    contains
        Indices of the classes that are performed at some time in the take.
    doubted
        Share of the frames at which the body was implausible or joints were left out.
    unlike
        Whether the body was found unlike the library's; None while that was not decided.
    answers
        The answers, by time.
    """

    name: str
    times: NDArray[np.float64]
    segments: tuple[Segment, ...]
    truth: NDArray[np.intp]
    segment: NDArray[np.intp]
    guess: NDArray[np.intp]
    published: NDArray[np.intp]
    event: NDArray[np.intp]
    score: NDArray[np.float64]
    person: str = ""
    contains: tuple[int, ...] = ()
    doubted: float = 0.0
    unlike: bool | None = None
    answers: Sequence[Recognition] = field(default=(), repr=False)

    @property
    def seconds(self) -> float:
        """Seconds from the first frame to the last."""
        return float(self.times[-1] - self.times[0]) if len(self.times) > 1 else 0.0

    @property
    def lasts(self) -> NDArray[np.float64]:
        """Seconds for which each frame counts: until the next frame, but not beyond its segment's end, (frames,)."""
        last = self.times[-1:] + self.seconds / max(len(self.times) - 1, 1)
        ends = np.array([*(each.end for each in self.segments), np.inf])
        until: NDArray[np.float64] = np.minimum(np.append(self.times[1:], last), ends[self.segment])
        return until - self.times


def answered_take(
    take: Take,
    times: NDArray[np.float64],
    recognitions: Sequence[Recognition],
    *,
    classes: Sequence[str],
    known: Collection[str],
) -> AnsweredTake:
    """Put the motions performed and the answers together, at every frame's time.

    Parameters
    ----------
    take
        The take; classes in it that the library does not know are ignored.
    times
        Of the frames that were played, seconds, shape (frames,).
    recognitions
        The answers, by time.
    classes
        The class names in which indices count.
    known
        The classes that the recogniser's library knows.
    """
    places, segments = {class_name: index for index, class_name in enumerate(classes)}, take.segments
    inside = np.searchsorted([each.start for each in segments], times, side="right") - 1
    # The last element is for frames before the first segment, whose index is -1.
    ends = np.array([*(each.end for each in segments), -np.inf])
    segment = np.where(times < ends[inside], inside, -1)
    performed = np.array([*(places[each.label] if each.label in known else NONE for each in segments), NONE])
    last = np.searchsorted([each.time for each in recognitions], times, side="right") - 1
    events = [event for each in recognitions for event in each.events]
    going_on = [places[each.label] if each.kind is EventKind.START else NONE for each in events]
    guesses = [NONE if (guess := guess_of(each)) is None else places[guess] for each in recognitions]
    published = [NONE if each.class_name is None else places[each.class_name] for each in recognitions]
    last_event = np.searchsorted([each.time for each in events], times, side="right") - 1
    return AnsweredTake(
        name=take.clip.name,
        times=times,
        segments=segments,
        truth=performed[segment],
        segment=segment,
        guess=_held(guesses, last, NONE),
        published=_held(published, last, NONE),
        event=_held(going_on, last_event, NONE),
        score=_held([each.score for each in recognitions], last, np.nan),
        person=take.person,
        contains=tuple(places[each] for each in take.contains if each in known),
        answers=recognitions,
        doubted=float(_held([each.is_doubted for each in recognitions], last, before=False).mean()),
    )


def _held(values: Sequence[float], last: NDArray[np.intp], before: float) -> NDArray[Any]:
    """Hold each value until the next one; `before` the first."""
    return np.array([*values, before])[np.where(last < 0, len(values), last)]


class AnsweredSegment(NamedTuple):
    """One segment of one take, with the answers of one recogniser.

    Attributes
    ----------
    key
        Name of the take and index of the segment; the same for every recogniser.
    person
        The person who performs; empty when not known.
    segment
        Its label and its time in the take.
    truth
        Index of the class performed, NONE when the recogniser's library does not know the class.
    seconds
        The time of its frames: each lasts until the next frame, the last of them until the segment's end at most.
    right, named
        The time of the frames whose best guess was the class performed, and of the frames with a named class.
    inside, right_inside, named_inside
        The time of the frames whose last second lies wholly in the segment, and of such among them.
    begun, started
        The numbers of named classes and of start events that begin in it.
    found
        Whether a right guess lasted.
    delay
        Seconds to the first such guess; None when there is none, and where the segment follows one of its class: the
        guess was held.
    event_delay
        Seconds until an event of the class performed goes on; None as before.
    scores
        Raw scores of the frames inside, where there was an answer.
    """

    key: tuple[str, int]
    person: str
    segment: Segment
    truth: int
    seconds: float
    right: float
    named: float
    inside: float
    right_inside: float
    named_inside: float
    begun: int
    started: int
    found: bool
    delay: float | None
    event_delay: float | None
    scores: NDArray[np.float64]

    @property
    def known(self) -> bool:
        """Whether the recogniser's library knows the motion performed."""
        return self.truth != NONE

    @property
    def mostly_right(self) -> bool:
        """Whether the guess was right for more than half of it."""
        # Not by rounding: frames of one rate may fill exactly half.
        return 2 * self.right > self.seconds * (1 + 1e-9)


def answered_segments(answered: Sequence[AnsweredTake], window: float) -> Iterator[AnsweredSegment]:
    """Count in every segment of some takes.

    Parameters
    ----------
    answered
        The takes.
    window
        Seconds before a moment that must lie inside the segment.
    """
    for one in answered:
        begun, started, every = _begun(one.published), _begun(one.event), one.lasts
        for index, segment in enumerate(one.segments):
            frames = np.flatnonzero(one.segment == index)
            if not frames.size:
                continue
            truth, times = int(one.truth[frames[0]]), one.times[frames]
            right, named = one.guess[frames] == truth, one.published[frames] != NONE
            lasts = every[frames]
            inside = times - window >= segment.start
            scores = one.score[frames][inside]
            known = truth != NONE
            first = _first_lasting(right, times) if known else None
            going_on = np.flatnonzero(one.event[frames] == truth) if known else frames[:0]
            again = index > 0 and one.segments[index - 1].label == segment.label
            delay = None if first is None or again else float(times[first] - segment.start)
            yield AnsweredSegment(
                key=(one.name, index),
                person=one.person,
                segment=segment,
                truth=truth,
                seconds=float(lasts.sum()),
                right=float(lasts @ right),
                named=float(lasts @ named),
                inside=float(lasts @ inside),
                right_inside=float(lasts @ (right & inside)),
                named_inside=float(lasts @ (named & inside)),
                begun=int(begun[frames].sum()),
                started=int(started[frames].sum()),
                found=first is not None,
                delay=delay,
                event_delay=float(times[going_on[0]] - segment.start) if going_on.size and not again else None,
                scores=scores[np.isfinite(scores)],
            )


def _begun(track: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Say for each frame whether a class begins with it."""
    begun: NDArray[np.bool_] = (track != NONE) & np.append(True, track[1:] != track[:-1])
    return begun


def _first_lasting(right: NDArray[np.bool_], times: NDArray[np.float64]) -> int | None:
    """Find the first moment from which the answer stays right for `LASTING` seconds, or to the end."""
    wrong = np.append(np.flatnonzero(~right), len(right))
    for first in np.flatnonzero(right & ~np.append(False, right[:-1])):
        stop = wrong[np.searchsorted(wrong, first)]
        if stop == len(right) or times[stop] - times[first] >= LASTING:
            return int(first)
    return None


def answer_rows(answered: Sequence[AnsweredTake], classes: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Give a row for each answer: take, person, the class performed, the label of its segment, and the answer.

    `truth` is empty where the library does not know what is performed, or no label says it; scores of classes that the
    take's library lacks are empty, too.
    """
    scores = dict.fromkeys((f"score {name}" for name in classes), "")
    for one in answered:
        for answer in one.answers:
            frame = max(int(np.searchsorted(one.times, answer.time, side="right")) - 1, 0)
            truth, segment = int(one.truth[frame]), int(one.segment[frame])
            yield {
                "take": one.name,
                "person": one.person,
                "truth": "" if truth == NONE else classes[truth],
                "performed": "" if segment < 0 else one.segments[segment].label,
                **{name: value for name, value in answer.as_dict().items() if name not in scores},
                **scores,
                **dict(zip((f"score {name}" for name in answer.classes), answer.scores.tolist(), strict=True)),
            }


def segment_rows(answered: Sequence[AnsweredTake], classes: Sequence[str], window: float) -> Iterator[dict[str, Any]]:
    """Give a row for each segment: take, person, times, the class performed, and how it was answered; shares of time.

    `delay` and `event_delay` are seconds from its start, None where no right guess lasted and no right event came, and
    where the segment follows one of its class.
    """
    for each in answered_segments(answered, window):
        yield {
            "take": each.key[0],
            "person": each.person,
            "start": each.segment.start,
            "end": each.segment.end,
            "performed": each.segment.label,
            "truth": classes[each.truth] if each.known else "",
            "seconds": each.seconds,
            "right": each.right / each.seconds if each.known and each.seconds else "",
            "named": each.named / each.seconds if each.seconds else "",
            "starts": each.started,
            "delay": each.delay,
            "event_delay": each.event_delay,
        }


def write_rows(path: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Write rows of the same columns as CSV, times and scores to six digits."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        for number, row in enumerate(rows):
            if number == 0:
                writer.writerow(row.keys())
            writer.writerow(map(_cell, row.values()))


def _cell(value: object) -> object:
    return round(value, 6) if isinstance(value, float) else csv_text(value) if isinstance(value, str) else value


_Item = TypeVar("_Item")
#: Of each unit the stretches: a segment has one for each library that was asked.
_Stretches = Sequence[Sequence[AnsweredSegment]]
#: Counts in a stretch, or in a take.
_Counted = Callable[[_Item], float]
_seconds = attrgetter("seconds")
#: Seconds, units, and persons, by name.
Basis = dict[str, float | None]

#: Figures of which less is better; for all others more is better.
_LATE = "median_delay_s", "p90_delay_s", "median_seen", "median_event_delay_s"
_FALSE = "false_per_minute", "unknown_answered", "changes_per_minute", "false_starts_per_minute", "doubted"
LOWER_IS_BETTER = frozenset((*_LATE, *_FALSE))


def basis_of(seconds: Sequence[float], persons: Sequence[str]) -> Basis:
    """Give what figures rest on: the seconds of each segment together, segments, and persons, None if not all known."""
    known = len(set(persons)) if all(persons) else None
    return {"seconds": float(sum(seconds)), "segments": len(seconds), "persons": known}


def score_takes(
    answered: Sequence[AnsweredTake], classes: Sequence[str], window: float
) -> tuple[dict[str, Figure], dict[str, Mapping[str, Any]]]:
    """Score some takes together: how right the answers were.

    Parameters
    ----------
    answered
        At least one. Courses of the same name belong to the same take, recognised by several libraries.
    classes
        The library's class names.
    window
        Seconds before a moment that must lie inside the segment.

    Returns
    -------
    The figures by name: `tables_of` says of each what it is; shares are 0 to 1. And, by name, `classes`: of each class
    performed, the seconds, and the shares of its time guessed right, and right with the last second inside the segment;
    `known`, `unknown`, `containing`: the basis of the figures of known motions, of unknown motions, and of
    `takes_found` (segments are takes for the last). A segment that several libraries were asked about counts once.
    """
    stretches = list(answered_segments(answered, window))
    of_known = [each for each in stretches if each.known]
    known, unknown = _grouped(of_known, "key"), _grouped([each for each in stretches if not each.known], "key")
    takes, containing = _grouped(answered, "name"), _grouped([each for each in answered if each.contains], "name")
    figures: dict[str, Figure] = {
        "frame_accuracy": _ratio(known, lambda each: each.right, _seconds),
        "segment_accuracy": _ratio(known, lambda each: each.right_inside, lambda each: each.inside),
        "segment_majority": _ratio(known, lambda each: each.mostly_right, lambda _: 1),
        "known_answered": _ratio(known, lambda each: each.named_inside, lambda each: each.inside),
        "segments_found": _ratio(known, lambda each: each.found, lambda _: 1),
        "median_delay_s": _percentile(known, lambda each: each.delay, 50),
        "p90_delay_s": _percentile(known, lambda each: each.delay, 90),
        "median_seen": _percentile(known, lambda each: each.delay and each.delay / each.segment.duration, 50),
        "median_event_delay_s": _percentile(known, lambda each: each.event_delay, 50),
        "unknown_answered": _ratio(unknown, lambda each: each.named, _seconds),
        "false_per_minute": _ratio(unknown, lambda each: each.begun, _seconds, 60),
        "false_starts_per_minute": _ratio(unknown, lambda each: each.started, _seconds, 60),
        "auc_unknown": roc_area(_scores(known), _scores(unknown), persons=(_persons(known), _persons(unknown))),
        "takes_found": _ratio(containing, _found, lambda each: len(each.contains)),
        "changes_per_minute": _ratio(takes, lambda each: _changes(each.event), _seconds, 60),
        "true_changes_per_minute": _ratio(takes, lambda each: _changes(each.truth), _seconds, 60),
        "doubted": _ratio(takes, lambda each: each.doubted * each.seconds, _seconds),
        "unlike": _ratio(takes, lambda each: bool(each.unlike), lambda each: each.unlike is not None),
    }
    of_classes = sorted(_grouped(of_known, "truth"), key=lambda own: own[0].truth)
    by_class = {classes[own[0].truth]: _score_of_class(_grouped(own, "key")) for own in of_classes}
    bases = {"known": _basis(known), "unknown": _basis(unknown), "containing": _basis(containing)}
    return figures, {"classes": by_class, **bases}


def _grouped(items: Sequence[_Item], by: str) -> list[list[_Item]]:
    """Put together the answers of several libraries to one segment, or to one take."""
    groups = dict[object, list[_Item]]()
    for item in items:
        groups.setdefault(getattr(item, by), []).append(item)
    return list(groups.values())


def _ratio(
    units: Sequence[Sequence[_Item]], counted: _Counted[_Item], among: _Counted[_Item], scale: float = 1
) -> Figure:
    above, below = ([float(sum(map(count, unit))) for unit in units] for count in (counted, among))
    return ratio(above, below, scale, persons=(_persons(units),))


def _percentile(units: _Stretches, measured: Callable[[AnsweredSegment], float | None], percent: float) -> Figure:
    """Take a percentile of a number over the stretches that have it."""
    values = [[value for each in unit if (value := measured(each)) is not None] for unit in units]
    return percentile(values, percent, persons=(_persons(units),))


def _scores(units: _Stretches) -> list[NDArray[np.float64]]:
    return [np.concatenate([each.scores for each in unit]) for unit in units]


def _basis(units: Sequence[Sequence[AnsweredSegment | AnsweredTake]]) -> Basis:
    return basis_of([unit[0].seconds for unit in units], _persons(units))


def _persons(units: Sequence[Sequence[Any]]) -> list[str]:
    return [unit[0].person for unit in units]


def _found(one: AnsweredTake) -> int:
    """Count the classes of a take that were named at some time."""
    return len({*one.contains} & {*one.published.tolist()})


def _changes(track: NDArray[np.intp]) -> int:
    """Count changes after the first motion: that motion begins within the take and is no change from another."""
    begun = np.flatnonzero(track != NONE)
    return int(np.count_nonzero(np.diff(track[begun[0] :]))) if begun.size else 0


def _score_of_class(units: _Stretches) -> dict[str, float]:
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
_CLASSES = "class {name} | seconds {seconds:.1f} | right {right:.1%} | right, last second inside {right_inside:.1%}"
_SHOWN_OF_PERSONS = ("frame_accuracy", "segment_accuracy", "segment_majority", "unknown_answered", "takes_found")


def tables_of(found: Mapping[str, Any], headed: str) -> Iterator[Table]:
    """Draw the values of figures, their intervals (below `headed`), basis, and each class's result."""
    rows = list[tuple[str, ...]]()
    for heading, basis, unit, figures in (
        ("known motions", found["known"], "segment", _KNOWN),
        ("unknown motions", found["unknown"], "segment", _UNKNOWN),
        ("takes that contain a class", found["containing"], "take", _CONTAINING),
        ("whole takes", found["known"], "", _WHOLE),
    ):
        if basis["segments"]:
            rows.append((f"{heading}: {rests_on(basis, unit)}" if unit else heading,))
            for name, (text, form) in figures.items():
                rows.append((f"  {text}", written(found[name], form), interval(found["intervals"][name], form)))
    yield table_of("Answers against the motion performed at that moment", ("", "", headed), rows)
    if classes := found["classes"]:
        yield scores_of(({"name": name, **each} for name, each in classes.items()), _CLASSES, title="By class")


def table_of_persons(
    persons: Mapping[str, Mapping[str, float | None]], summary: Mapping[str, Mapping[str, float | None]], by: Protocol
) -> Table:
    """Draw every person's main figures, their mean, and the worst of each."""
    shown = [name for name in _SHOWN_OF_PERSONS if summary["mean"][name] is not None]
    texts = _KNOWN | _UNKNOWN | _CONTAINING
    rows = [(person, *(written(figures[name]) for name in shown)) for person, figures in {**persons, **summary}.items()]
    return table_of(f"By person ({by})", ("person", *(texts[name][0] for name in shown)), rows)


def interval(ends: Interval | None, form: str = _SHARE) -> str:
    """Write the ends of an interval; their unit is written once, after the second.

    An interval without length says nothing: every draw had the same figure.
    """
    if ends is None or ends[0] == ends[1]:
        return "-"
    low, high = map(form.format, ends)
    return f"{low.rstrip('% s')}–{high}"


def rests_on(basis: Mapping[str, Any], unit: str) -> str:
    """Write what figures rest on (`scores.basis_of`)."""
    persons = "persons not known" if basis["persons"] is None else counted(basis["persons"], "person")
    return f"{basis['seconds']:.0f} s, {counted(basis['segments'], unit)}, {persons}"
