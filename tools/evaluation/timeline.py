"""The answers to a take, counted one by one: for experiments in which every answer counts alike."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream.recognition import EventKind, Outcome, Recognition
from kinespace.tools.evaluation.takes import Take
from kinespace.tools.terminal.tables import csv_text


def guess_of(answer: Recognition) -> str | None:
    """Give the class that is guessed, named or not; None where there is no guess."""
    return answer.classes[answer.guess_index] if answer.guess_index >= 0 else None


def counted(take: Take, known: Collection[str], answers: Iterable[Recognition], inside: float = 0.0) -> Counter[str]:
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
class Course:
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


def course_of(
    take: Take,
    times: NDArray[np.float64],
    recognitions: Sequence[Recognition],
    *,
    classes: Sequence[str],
    known: Collection[str],
) -> Course:
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
    return Course(
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


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """One segment of one take, with the answers of one recogniser.

    Attributes
    ----------
    key
        Name of the take and index of the segment; the same for every recogniser.
    person
        The person who performs; empty when not known.
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
    delay, seen
        Seconds to the first such guess, and as a share of the segment; None when there is none, and where the segment
        follows one of its class: the guess was held.
    event_delay
        Seconds until an event of the class performed goes on; None as before.
    scores
        Raw scores of the frames inside, where there was an answer.
    """

    key: tuple[str, int]
    person: str
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
    seen: float | None
    event_delay: float | None
    scores: NDArray[np.float64] = field(repr=False)

    @property
    def known(self) -> bool:
        """Whether the recogniser's library knows the motion performed."""
        return self.truth != NONE

    @property
    def mostly_right(self) -> bool:
        """Whether the guess was right for more than half of it."""
        # Not by rounding: frames of one rate may fill exactly half.
        return 2 * self.right > self.seconds * (1 + 1e-9)


def stretches_of(courses: Sequence[Course], window: float) -> Iterator[Stretch]:
    """Count in every segment of some takes.

    Parameters
    ----------
    courses
        The takes.
    window
        Seconds before a moment that must lie inside the segment.
    """
    for course in courses:
        begun, started, every = _begun(course.published), _begun(course.event), course.lasts
        for index, segment in enumerate(course.segments):
            frames = np.flatnonzero(course.segment == index)
            if not frames.size:
                continue
            truth, times = int(course.truth[frames[0]]), course.times[frames]
            right, named = course.guess[frames] == truth, course.published[frames] != NONE
            lasts = every[frames]
            inside = times - window >= segment.start
            scores = course.score[frames][inside]
            known = truth != NONE
            first = _first_lasting(right, times) if known else None
            going_on = np.flatnonzero(course.event[frames] == truth) if known else frames[:0]
            again = index > 0 and course.segments[index - 1].label == segment.label
            delay = None if first is None or again else float(times[first] - segment.start)
            yield Stretch(
                key=(course.name, index),
                person=course.person,
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
                seen=None if delay is None else delay / segment.duration,
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


def answer_rows(courses: Sequence[Course], classes: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Give a row for each answer: take, person, the class performed, the label of its segment, and the answer.

    `truth` is empty where the library does not know what is performed, or no label says it; scores of classes that the
    take's library lacks are empty, too.
    """
    scores = dict.fromkeys((f"score {name}" for name in classes), "")
    for course in courses:
        for answer in course.answers:
            frame = max(int(np.searchsorted(course.times, answer.time, side="right")) - 1, 0)
            truth, segment = int(course.truth[frame]), int(course.segment[frame])
            yield {
                "take": course.name,
                "person": course.person,
                "truth": "" if truth == NONE else classes[truth],
                "performed": "" if segment < 0 else course.segments[segment].label,
                **{name: value for name, value in answer.as_dict().items() if name not in scores},
                **scores,
                **dict(zip((f"score {name}" for name in answer.classes), answer.scores.tolist(), strict=True)),
            }


def segment_rows(courses: Sequence[Course], classes: Sequence[str], window: float) -> Iterator[dict[str, Any]]:
    """Give a row for each segment: take, person, times, the class performed, and how it was answered; shares of time.

    `delay` and `event_delay` are seconds from its start, None where no right guess lasted and no right event came, and
    where the segment follows one of its class.
    """
    by_name = {course.name: course for course in courses}
    for each in stretches_of(courses, window):
        name, index = each.key
        segment = by_name[name].segments[index]
        yield {
            "take": name,
            "person": each.person,
            "start": segment.start,
            "end": segment.end,
            "performed": segment.label,
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
