"""Progress in takes: how it agrees with the rounds that a person makes of one motion, one after the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import distance_rows
from kinespace.stream.recognizer import Settings
from kinespace.tools.evaluation.harness import Feed, answers_to

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from kinespace.library import Clip
    from kinespace.library.recordings.formats.labels import Segment
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.recognition import Progress
    from kinespace.tools.evaluation.takes import Take

#: Seconds over which the course of a motion is smoothed before its turning points are looked for.
_SMOOTHED = 0.1
#: A phase with a smaller error is right.
_NEAR = 0.1
#: The columns of the table.
COLUMNS = (
    ("take", "{take}"),
    ("class", "{class_name}"),
    ("seconds", "{seconds:.1f}"),
    ("rounds", "{rounds:.2f}"),
    ("by progress", "{rounds_told:.2f}"),
    ("followed", "{followed:.1%}"),
    ("mean error", "{phase_error:.3f}"),
    ("within .1", "{within_tenth:.1%}"),
)

#: How progress agrees with the rounds of one labelled segment, by name.
RoundsScore = dict[str, object]


def rounds_scored(takes: Sequence[Take], index: WindowIndex) -> Iterator[RoundsScore]:
    """Recognise takes, and score the progress in each segment of a known class with a whole round at least.

    A round lasts from one turning point of the motion's principal axis to the next of its kind; between the two the
    true phase rises evenly. Where in a round the library's recordings begin is not known, so that the offset of the
    true phase is the one that fits best.

    Yields
    ------
    Take, class and seconds of the segment; rounds between the first turning point and the last, and rounds by which the
    progress went on meanwhile; the share of the hops between them with a progress in the motion; and of these the mean
    error of the phase, and the share with an error below 0.1.
    """
    for take in takes:
        answers = answers_to(Feed.of(take.clip, index.library.skeleton), index, Settings(progress=True))
        for segment in take.segments:
            turns = _turns(take.clip, segment) if segment.label in index.classes else []
            inside = [each for each in answers if len(turns) > 1 and turns[0] <= each.time < turns[-1]]
            own = {each.time: each.progress for each in inside if each.progress}
            own = {time: each for time, each in own.items() if each.class_name == segment.label}
            if own:
                yield _scored(take.clip.name, segment, turns, len(inside), own)


def _turns(clip: Clip, segment: Segment) -> list[float]:
    """Find the turning points of a segment's principal axis that are more in number: its maxima or its minima."""
    # Slow to load, and most evaluations do not need them.
    from scipy.ndimage import gaussian_filter1d  # noqa: PLC0415
    from scipy.signal import find_peaks  # noqa: PLC0415

    inside = slice(round(segment.start * clip.frame_rate), round(segment.end * clip.frame_rate))
    rows = distance_rows(clip.positions[inside], clip.skeleton)
    rows -= rows.mean(axis=0)
    axis = np.linalg.svd(rows, full_matrices=False)[2][0]
    course = gaussian_filter1d(rows @ axis, _SMOOTHED * clip.frame_rate)
    both = (find_peaks(each, prominence=course.std())[0] for each in (course, -course))
    times: list[float] = clip.times[inside][max(both, key=len)].tolist()
    return times


def _scored(
    take: str, segment: Segment, turns: Sequence[float], hops: int, own: Mapping[float, Progress]
) -> RoundsScore:
    true: NDArray[np.float64] = np.interp(list(own), turns, np.arange(len(turns)))
    phases = np.array([each.phase for each in own.values()])
    errors = (phases - true + 0.5) % 1
    offset = np.angle(np.exp(2j * np.pi * errors).mean()) / (2 * np.pi)
    errors = np.abs((errors - offset + 0.5) % 1 - 0.5)
    return {
        "take": take,
        "class_name": segment.label,
        "seconds": segment.duration,
        "rounds": float(true[-1] - true[0]),
        "rounds_told": float(((np.diff(phases) + 0.5) % 1 - 0.5).sum()),
        "followed": len(own) / hops,
        "phase_error": float(errors.mean()),
        "within_tenth": float((errors < _NEAR).mean()),
    }
