"""How right a stream of answers was: what was published at each moment against what was performed at that moment.

Nothing looks ahead: at every frame's time the answer is the last one published by then. Seconds before a take's first
answer count as unanswered.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from stream.recognition import EventKind

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from library.labels import Segment
    from stream.recognition import Event, Recognition

#: Seconds an answer must stay right to be called lasting; to the segment's end when that comes sooner.
LASTING = 0.3
#: What stands for "no class" among class indices.
NONE = -1


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """One take: what was performed and what was published, at the time of every frame.

    Attributes
    ----------
    name
        The take's.
    times
        Shape (frames,), seconds from the take's start.
    segments
        What was performed, in the library's class names where it knows them.
    truth
        Index of the class performed; NONE where the library does not know it or nobody labelled it.
    labelled
        Whether somebody said what was performed.
    segment
        Index of the segment, -1 outside all.
    guess
        Index of the moment's best guess last published, named or not; NONE before the first and where still.
    published
        Index of the class last named, NONE for none.
    event
        Index of the class whose event is going on, NONE for none.
    score
        Raw score of the best guess; NaN before the first answer.
    """

    name: str
    times: NDArray[np.float64]
    segments: tuple[Segment, ...]
    truth: NDArray[np.intp]
    labelled: NDArray[np.bool_]
    segment: NDArray[np.intp]
    guess: NDArray[np.intp]
    published: NDArray[np.intp]
    event: NDArray[np.intp]
    score: NDArray[np.float64]


def course_of(
    name: str,
    times: NDArray[np.float64],
    segments: Sequence[Segment],
    *,
    classes: Sequence[str],
    known: Collection[str],
    recognitions: Sequence[Recognition],
    events: Sequence[Event],
) -> Course:
    """Lay what was performed and what was published beside each other, at every frame's time.

    Parameters
    ----------
    name, times
        The take's name, and its frames' times, seconds, shape (frames,).
    segments
        What was performed, by start.
    classes
        Class names that indices count in.
    known
        Those that the recogniser's library knows.
    recognitions, events
        What was published, by time.
    """
    places = {class_name: index for index, class_name in enumerate(classes)}
    inside = np.searchsorted([each.start for each in segments], times, side="right") - 1
    ends = np.array([each.end for each in segments])
    segment = np.where((inside >= 0) & (times < ends[inside]), inside, -1)
    performed = np.array([places[each.label] if each.label in known else NONE for each in segments])
    last = np.searchsorted([each.time for each in recognitions], times, side="right") - 1
    going_on = [places[each.label] if each.kind is EventKind.START else NONE for each in events]
    guesses = [places[each.classes[each.best]] if each.guess_index >= 0 else NONE for each in recognitions]
    published = [NONE if each.class_name is None else places[each.class_name] for each in recognitions]
    last_event = np.searchsorted([each.time for each in events], times, side="right") - 1
    return Course(
        name=name,
        times=times,
        segments=tuple(segments),
        truth=np.where(segment >= 0, performed[segment], NONE),
        labelled=segment >= 0,
        segment=segment,
        guess=_held(guesses, last, NONE),
        published=_held(published, last, NONE),
        event=_held(going_on, last_event, NONE),
        score=_held([each.score for each in recognitions], last, np.nan),
    )


def _held(values: Sequence[float], last: NDArray[np.intp], before: float) -> NDArray[Any]:
    """Hold each value until the next; `before` the first."""
    return np.array([*values, before])[np.where(last < 0, len(values), last)]


@dataclass(frozen=True, slots=True)
class ClassScore:
    """How one class fared: seconds performed, share of them guessed right, and of those with the last second inside."""

    seconds: float
    right: float
    right_inside: float


@dataclass(frozen=True, slots=True)
class StreamScore:
    """How right the answers to some takes were. Shares are 0 to 1; None where there is nothing to take a share of.

    Attributes
    ----------
    frame_accuracy
        Of the labelled time of known classes, the share in which the moment's best guess was the class performed.
    segment_accuracy
        The same where the last second lies wholly inside the segment.
    known_answered
        Share of that time, last second inside, in which a class was named, not held back as unknown or still.
    segments_found
        Share of the known segments with a lasting right guess.
    median_delay_s, p90_delay_s
        Seconds from a found segment's start to its first lasting right guess.
    median_seen
        How much of a found segment had been seen at its first lasting right guess: share of its seconds.
    median_event_delay_s
        Seconds from a segment's start to the start event of its class, of those that have one.
    false_per_minute
        Class answers begun during motions the library does not know, per minute of those.
    unknown_answered
        Share of the time of such motions in which a class was named.
    changes_per_minute, true_changes_per_minute
        How often the motion going on changed, by the events and by the labels.
    auc_unknown
        Area under the ROC curve of the raw score, known against unknown motions, windows wholly inside a segment.
    classes
        By class name.
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
    changes_per_minute: float
    true_changes_per_minute: float
    auc_unknown: float | None
    classes: dict[str, ClassScore] = field(repr=False)


def score_courses(courses: Sequence[Course], classes: Sequence[str], window: float) -> StreamScore:
    """Score some takes together.

    Parameters
    ----------
    courses
        At least one.
    classes
        The library's class names.
    window
        Seconds that "inside" looks back.
    """
    truth = np.concatenate([each.truth for each in courses])
    published = np.concatenate([each.published for each in courses])
    guess = np.concatenate([each.guess for each in courses])
    scores = np.concatenate([each.score for each in courses])
    inside = np.concatenate([_window_inside(each, window) for each in courses])
    unknown = np.concatenate([each.labelled for each in courses]) & (truth == NONE)
    known = truth != NONE
    delays, seen, sought = _delays(courses)
    event_delays = _event_delays(courses)
    minutes = sum(_seconds(each) for each in courses) / 60
    return StreamScore(
        frame_accuracy=_share(guess == truth, known),
        segment_accuracy=_share(guess == truth, known & inside),
        known_answered=_share(published != NONE, known & inside),
        segments_found=len(delays) / sought if sought else None,
        median_delay_s=_percentile(delays, 50),
        p90_delay_s=_percentile(delays, 90),
        median_seen=_percentile(seen, 50),
        median_event_delay_s=_percentile(event_delays, 50),
        false_per_minute=_false_per_minute(courses),
        unknown_answered=_share(published != NONE, unknown),
        changes_per_minute=sum(_changes(each.event) for each in courses) / minutes if minutes else 0.0,
        true_changes_per_minute=sum(_changes(each.truth) for each in courses) / minutes if minutes else 0.0,
        auc_unknown=_roc_area(scores[known & inside], scores[unknown & inside]),
        classes=_by_class(courses, classes, truth, guess, inside),
    )


def confusion(courses: Sequence[Course], classes: Sequence[str]) -> tuple[list[str], list[str], NDArray[np.float64]]:
    """Lay out the time of each label performed over what was published.

    Returns
    -------
    The labels performed, the answers ("none" last), and the shares, shape (labels, answers).
    """
    labels = sorted({segment.label for each in courses for segment in each.segments})
    shares = np.zeros((len(labels), len(classes) + 1))
    for each in courses:
        rows = np.array([labels.index(segment.label) for segment in each.segments])[each.segment[each.labelled]]
        np.add.at(shares, (rows, each.published[each.labelled]), 1.0)
    shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1.0)
    return labels, [*classes, "none"], shares


def _window_inside(course: Course, window: float) -> NDArray[np.bool_]:
    starts = np.array([each.start for each in course.segments])[course.segment]
    inside: NDArray[np.bool_] = course.labelled & (course.times - window >= starts)
    return inside


def _delays(courses: Sequence[Course]) -> tuple[list[float], list[float], int]:
    """Give the found known segments' delays, in seconds and as a share, and how many known segments there are."""
    delays, seen, sought = list[float](), list[float](), 0
    for course in courses:
        for index, segment in enumerate(course.segments):
            frames = np.flatnonzero(course.segment == index)
            if not frames.size or course.truth[frames[0]] == NONE:
                continue
            sought += 1
            right = course.guess[frames] == course.truth[frames]
            first = _first_lasting(right, course.times[frames])
            if first is not None:
                delays.append(float(course.times[frames[first]] - segment.start))
                seen.append(delays[-1] / (segment.end - segment.start))
    return delays, seen, sought


def _first_lasting(right: NDArray[np.bool_], times: NDArray[np.float64]) -> int | None:
    """Find the first moment from which the answer stays right for `LASTING` seconds, or to the end."""
    wrong = np.append(np.flatnonzero(~right), len(right))
    for first in np.flatnonzero(right & ~np.append(False, right[:-1])):
        stop = wrong[np.searchsorted(wrong, first)]
        if stop == len(right) or times[stop] - times[first] >= LASTING:
            return int(first)
    return None


def _event_delays(courses: Sequence[Course]) -> list[float]:
    delays = list[float]()
    for course in courses:
        for index, segment in enumerate(course.segments):
            going_on = (course.segment == index) & (course.truth != NONE) & (course.event == course.truth)
            if going_on.any():
                delays.append(float(course.times[int(np.argmax(going_on))] - segment.start))
    return delays


def _false_per_minute(courses: Sequence[Course]) -> float | None:
    begun, seconds = 0, 0.0
    for course in courses:
        unknown = course.labelled & (course.truth == NONE)
        new = np.append(True, course.published[1:] != course.published[:-1])
        begun += int((unknown & new & (course.published != NONE)).sum())
        seconds += float(unknown.mean()) * _seconds(course)
    return begun / seconds * 60 if seconds else None


def _by_class(
    courses: Sequence[Course],
    classes: Sequence[str],
    truth: NDArray[np.intp],
    guess: NDArray[np.intp],
    inside: NDArray[np.bool_],
) -> dict[str, ClassScore]:
    frame = sum(_seconds(each) for each in courses) / max(len(truth), 1)
    scores = {}
    for index, class_name in enumerate(classes):
        performed = truth == index
        if performed.any():
            right = guess == index
            scores[class_name] = ClassScore(
                seconds=float(performed.sum()) * frame,
                right=_share(right, performed) or 0.0,
                right_inside=_share(right, performed & inside) or 0.0,
            )
    return scores


def _seconds(course: Course) -> float:
    return float(course.times[-1] - course.times[0]) if len(course.times) > 1 else 0.0


def _changes(track: NDArray[np.intp]) -> int:
    """Count changes from the first motion on: that one begins within the take is no change from another."""
    begun = np.flatnonzero(track != NONE)
    return int(np.count_nonzero(np.diff(track[begun[0] :]))) if begun.size else 0


def _share(of: NDArray[np.bool_], among: NDArray[np.bool_]) -> float | None:
    return float(of[among].mean()) if among.any() else None


def _percentile(values: Sequence[float], percent: float) -> float | None:
    return float(np.percentile(values, percent)) if values else None


def _roc_area(known: NDArray[np.float64], unknown: NDArray[np.float64]) -> float | None:
    """Probability that a known motion's score is above an unknown one's, ties counting half (Mann-Whitney)."""
    known, unknown = known[np.isfinite(known)], unknown[np.isfinite(unknown)]
    if not known.size or not unknown.size:
        return None
    ordered = np.sort(unknown)
    below = np.searchsorted(ordered, known, side="left") + np.searchsorted(ordered, known, side="right")
    return float(below.mean() / (2 * len(ordered)))
