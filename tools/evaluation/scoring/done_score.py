"""How rightly motions were found that were done: found, counted, false alarms an hour, the delay after the end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import gammaincinv

from kinespace.library import NOTHING
from kinespace.library.recordings.formats.labels import Segment
from kinespace.tools.evaluation.takes import Take

#: Seconds after a segment's end up to which a motion may end that belongs to it, and the share of the motion that must
#: lie in the segment: labels are right to a tenth of a second at best.
_LATE, _INSIDE = 0.5, 0.5
#: Segments of one class in a take, at least, for its count to be judged, and by how much it may be off.
_MANY, _OFF_BY = 5, 1
#: The confidence of the interval of false alarms.
_CONFIDENCE = 0.95


class Said(NamedTuple):
    """A motion that was said to be done: its class, begin and end, and when it was said; seconds."""

    class_name: str
    start: float
    end: float
    at: float


@dataclass(frozen=True, slots=True, eq=False)
class DoneTake:
    """A take, what was said of it, and the classes that the library knows.

    Attributes
    ----------
    take, known
        The take, and the library's classes.
    said
        The motions that were said to be done.
    broken
        For each motion broken off at half whether its class was said to be done.
    """

    take: Take
    known: Collection[str]
    said: Sequence[Said]
    broken: Sequence[bool] = ()

    @property
    def segments(self) -> list[Segment]:
        """The segments of known motions."""
        return [each for each in self.take.segments if each.label in self.known]

    def shared(self) -> tuple[list[tuple[Segment, list[Said]]], list[Said]]:
        """Give each segment with what was said of it, and what was false."""
        of_segments, false = [(each, list[Said]()) for each in self.segments], list[Said]()
        for said in self.said:
            own = (of_segment for each, of_segment in of_segments if _belongs(said, each))
            # A contained motion without a segment is neither right nor false.
            next(own, [] if said.class_name in self.take.contains else false).append(said)
        return of_segments, false


def _belongs(said: Said, segment: Segment) -> bool:
    inside = min(said.end, segment.end) - max(said.start, segment.start)
    right = said.class_name == segment.label and said.end <= segment.end + _LATE
    return right and inside >= _INSIDE * (said.end - said.start)


def score_done(takes: Sequence[DoneTake]) -> dict[str, object]:
    """Score some takes together.

    Returns
    -------
    `found`, share of the segments whose motion was said; `takes_found`, share of the takes without segments in which a
    contained motion was said; `counted_right`, share of the takes of five or more segments of one class whose count is
    off by one at most; `false_per_hour` with its `false_interval` (exact, of a Poisson process), over `hours`, of which
    `unknown_hours` show nothing known; `delay_s`, median seconds from a segment's end to its last motion said;
    `broken_done`, share of the motions broken off at half that were said. None where there is nothing to take a share
    of. `segments` and `takes` say what they rest on.
    """
    performed = [each for take in takes for each in take.shared()[0]]
    delays = [said[-1].at - segment.end for segment, said in performed if said]
    containing = [each for each in takes if each.take.contains and not each.segments]
    in_takes = [any(said.class_name in each.take.contains for said in each.said) for each in containing]
    counted = [right for each in takes if (right := _counted_right(each)) is not None]
    false, hours = sum(len(take.shared()[1]) for take in takes), sum(each.take.clip.duration for each in takes) / 3600
    return {
        "found": _share([bool(said) for _, said in performed]),
        "takes_found": _share(in_takes),
        "counted_right": _share(counted),
        "false_per_hour": false / hours if hours else None,
        "false_interval": [each / hours for each in _interval(false)] if hours else None,
        "hours": hours,
        "unknown_hours": sum(_unknown_seconds(each) for each in takes) / 3600,
        "delay_s": float(np.median(delays)) if delays else None,
        "broken_done": _share([each for take in takes for each in take.broken]),
        "segments": len(performed),
        "takes": len(containing),
    }


def by_class(takes: Sequence[DoneTake]) -> dict[str, dict[str, float]]:
    """Give of each class the segments, how many of them were found, and how often it was said falsely."""
    performed = [each for take in takes for each in take.shared()[0]]
    segments = Counter(each.label for each, _ in performed)
    found = Counter(each.label for each, said in performed if said)
    false = Counter(each.class_name for take in takes for each in take.shared()[1])
    counts = {"segments": segments, "found": found, "false": false}
    return {name: {key: float(each[name]) for key, each in counts.items()} for name in sorted(segments | false)}


def _counted_right(each: DoneTake) -> bool | None:
    """Say whether a take's motions were counted right; None for a take without many of one class."""
    performed, said = Counter(one.label for one in each.segments), Counter(one.class_name for one in each.said)
    many = [name for name, count in performed.items() if count >= _MANY]
    return all(abs(said[name] - performed[name]) <= _OFF_BY for name in many) if many else None


def _unknown_seconds(each: DoneTake) -> float:
    """Give the seconds in which nothing known happens."""
    known = sum(one.duration for one in each.segments if one.label != NOTHING)
    return max(each.take.clip.duration - known, 0.0) if each.take.segments and not each.take.contains else 0.0


def _share(right: Sequence[bool]) -> float | None:
    return sum(right) / len(right) if right else None


def _interval(count: int) -> tuple[float, float]:
    """Give the exact interval of a Poisson count (Garwood 1936)."""
    tail = (1 - _CONFIDENCE) / 2
    low = float(gammaincinv(count, tail)) if count else 0.0
    return low, float(gammaincinv(count + 1, 1 - tail))
