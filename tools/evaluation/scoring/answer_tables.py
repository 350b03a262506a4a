"""Answers and segments of an evaluation as CSV files, a row each, for pandas and for statistics programs."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinespace.tools.evaluation.scoring.timeline import NONE, Course, stretches_of
from kinespace.tools.terminal.tables import csv_text


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
