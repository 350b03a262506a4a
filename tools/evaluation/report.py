"""An evaluation as one page: takes, their labels and the answers, and the bodies, drawn as on the live page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kinespace.tools.page.sheet import body_shown, write_sheet

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from kinespace.library import Clip
    from kinespace.tools.evaluation.scoring.timeline import Course

#: Bodies of a second.
_BODIES = 20.0
#: Scores of a second.
_SCORES = 10.0


def write_report(path: Path, takes: Sequence[tuple[Course, Clip]], classes: Sequence[str]) -> None:
    """Write a page that needs no other file and no net.

    Parameters
    ----------
    path
        The HTML file.
    takes
        Each take's answers, and its body.
    classes
        The classes in which the answers' indices count.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    shown = {"classes": classes, "takes": [_described(course, clip) for course, clip in takes]}
    write_sheet(path, "report", "an evaluation", shown)


def _described(course: Course, clip: Clip) -> dict[str, object]:
    return {
        "name": course.name,
        "person": course.person,
        "seconds": course.seconds,
        **body_shown(clip, _BODIES),
        "performed": [(each.start, each.end, each.label) for each in course.segments],
        "events": spans(course.times, course.event),
        "named": spans(course.times, course.published),
        "guesses": spans(course.times, course.guess),
        "scores": _scores(course),
    }


def spans(times: NDArray[np.floating], values: NDArray[np.integer]) -> list[tuple[float, float, int]]:
    """List the stretches of equal values from 0 on: beginning, end (the next frame's time), value."""
    if not len(values):
        return []
    begins = np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1]]))
    ends = np.append(begins[1:], len(values) - 1)
    listed = zip(times[begins].tolist(), times[ends].tolist(), values[begins].tolist(), strict=True)
    return [each for each in listed if each[2] >= 0]


def _scores(course: Course) -> list[tuple[float, float]]:
    step = max(round(len(course.times) / max(course.seconds * _SCORES, 1.0)), 1)
    scores = np.nan_to_num(course.score[::step]).round(3)
    return list(zip(course.times[::step].round(2).tolist(), scores.tolist(), strict=True))
