"""The counts of one segment of a take: how long it was guessed right and named, and how late it was found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from kinespace.tools.evaluation.scoring.timeline import NONE

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from kinespace.tools.evaluation.scoring.timeline import Course

#: Seconds for which a lasting answer stays right; until the segment's end if that comes sooner.
LASTING = 0.3


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
    delay, seen
        Seconds to the first lasting right guess, and as a share of the segment; None when there is none.
    event_delay
        Seconds until an event of the class performed goes on; None when there is no such event.
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
            delay = None if first is None else float(times[first] - segment.start)
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
                delay=delay,
                seen=None if delay is None else delay / segment.duration,
                event_delay=float(times[going_on[0]] - segment.start) if going_on.size else None,
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
