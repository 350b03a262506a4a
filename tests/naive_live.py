"""The slow twin of live recognition by windows, of events and of how streams are scored; see `naive` for the rest.

Nothing here calls the product. Every hop is computed anew from all that came before it, and the rules are those of the
docstrings, written out with their numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from naive_windows import path_between, segments

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    Matrix = NDArray[np.float64]

#: Spans of time are compared to the microsecond: frame times are rounded.
_MICROSECOND = 1e-6
#: Lead, in log distance times thirtieths of a second, after which the guess changes.
LEAD = 0.6
#: Seconds over which log distances are averaged before classes are compared, and again before a motion is judged.
COMPARED_OVER, KNOWN_OVER = 0.1, 0.3
#: How far a named motion may fall behind the threshold, and how far before it one is known without waiting.
HELD, CLEAR = 0.3, 0.1
#: Events: seconds of no class until an end, the longest hop that counts, and what is added before the logarithm.
ENDED_AFTER, LONGEST_HOP, ALIKE = {"still": 0.4, "unknown": 0.8, "ambiguous": 0.4}, 0.1, 0.3


# --- windows -----------------------------------------------------------------------------------------------------


def last_rows(times: Matrix, rows: Matrix, now: float, seconds: float) -> Matrix:
    """Pick the rows of the last seconds up to now."""
    return rows[[index for index, time in enumerate(times) if now - time < seconds - _MICROSECOND and time <= now]]


class NaiveBody:
    """Which pairs are segments, and which segments lie between the joints of each pair."""

    def __init__(self, pairs: Sequence[tuple[int, int]], parents: Sequence[int]) -> None:
        places = {pair: index for index, pair in enumerate(pairs)}
        self.segments = [places[segment] for segment in segments(parents)]
        self.paths = [[places[crossed] for crossed in path_between(a, b, parents)] for a, b in pairs]

    def measured(self, kind: str, window: Matrix, basis: Matrix) -> Matrix:
        """Measure one window's rows."""
        if kind == "shape":
            return _shape(window @ basis)
        means = np.mean(window, axis=0)
        if kind == "posture":
            return np.array([mean / sum(means[path]) for mean, path in zip(means, self.paths, strict=True)])
        logs = np.log(np.std(window, axis=0, ddof=1) / np.mean(means[self.segments]) + 1 / 60)
        return logs - np.mean(logs) / 2


def _shape(seen: Matrix) -> Matrix:
    """Write the triangle that rows of trace 1 with a thousandth in every direction reduce to, as a vector."""
    centred, size = seen - seen.mean(axis=0), seen.shape[1]
    total = math.sqrt(float(np.sum(centred**2)))
    if total < 1e-7 * math.sqrt(float(np.sum(seen**2))):
        return np.zeros(size * (size + 1) // 2)  # nothing moves: no shape
    triangle = np.linalg.qr(np.vstack([centred / total, math.sqrt(0.001) * np.eye(size)]), mode="r")
    lower = (triangle * np.sign(np.diagonal(triangle))[:, None]).T
    return np.array([lower[i, j] for i in range(size) for j in range(i + 1)])


@dataclass(frozen=True)
class NaiveMetric:
    """What one measure is compared by: its origin, its axes, the weight of what lies off them, and its own weight."""

    kind: str
    seconds: float
    origin: Matrix
    axes: Matrix
    outside: float
    weight: float

    def vector(self, measure: Matrix) -> tuple[Matrix, float]:
        """Map a measure to the kept axes; the second number is what lies off them, squared."""
        difference = measure - self.origin
        vector = difference @ self.axes
        off = max(self.outside * float(np.sum(difference**2)) - float(np.sum(vector**2)), 0.0) if self.outside else 0.0
        return vector * math.sqrt(self.weight), off * self.weight


def log_distances(
    measures: Sequence[Sequence[tuple[NaiveMetric, Matrix]]],
    windows: Sequence[Matrix],
    classes: NDArray[np.intp],
    actors: NDArray[np.str_],
) -> list[float]:
    """Compare measures with every window, one difference at a time: for each class the mean of its two nearest people.

    Parameters
    ----------
    measures
        For each group its metrics, each with the measure of the asking window.
    windows
        For each group the library's vectors.
    classes, actors
        Of each of the library's windows.
    """
    far = np.zeros(len(classes))
    for group, vectors in zip(measures, windows, strict=True):
        parts = [metric.vector(measure) for metric, measure in group]
        asked, off = np.concatenate([vector for vector, _ in parts]), sum(off for _, off in parts)
        far += np.log(np.sum((vectors - asked) ** 2, axis=1) + off + 0.01) / len(windows)
    found = []
    for index in sorted(set(classes.tolist())):
        people = sorted(set(actors[classes == index].tolist()))
        least = sorted(float(min(far[(classes == index) & (actors == person)])) for person in people)
        found.append(sum(least[:2]) / len(least[:2]))
    return found


@dataclass(frozen=True)
class NaiveReading:
    """What the twin makes of one hop."""

    guess: int
    known: bool


def readings(times: Sequence[float], distances: Matrix, threshold: float) -> list[NaiveReading]:
    """Guess and judge at every hop from the whole course up to it of averaged log distances, (hops, classes)."""
    spans = [1 / 30, *(after - before for before, after in pairwise(times))]
    leaders = [min(range(len(row)), key=row.__getitem__) for row in distances.tolist()]
    made: list[NaiveReading] = []
    for hop, leader in enumerate(leaders):
        led_since = next((k + 1 for k in range(hop, -1, -1) if leaders[k] != leader), 0)
        lead = 30 * sum((sorted(distances[k])[1] - distances[k][leader]) * spans[k] for k in range(led_since, hop + 1))
        guess = leader if not made or lead >= LEAD else made[-1].guess
        beyond = averaged(times[: hop + 1], distances[: hop + 1, guess], KNOWN_OVER) - threshold
        near = beyond <= (HELD if made and made[-1].known else 0.0)
        made.append(NaiveReading(guess, bool(near or distances[hop, guess] <= threshold - CLEAR)))
    return made


def averaged(times: Sequence[float], values: Matrix, seconds: float) -> float:
    """Average exponentially: each value weighs what has decayed since it began to hold until now."""
    ages = [math.exp(-(times[-1] - time) / seconds) for time in times]
    total = values[0] * ages[0]
    for before, after, value in zip(ages, ages[1:], values[1:], strict=False):
        total += value * (after - before)
    return float(total)


# --- events ------------------------------------------------------------------------------------------------------


def events(
    times: Sequence[float],
    scores: Sequence[Sequence[float]],
    named: Sequence[int],
    outcomes: Sequence[str],
    lead: float,
) -> Iterator[tuple[float, str, int]]:
    """Tell what starts and ends when; `named` is each hop's class, -1 for none, and `outcomes` why there is none."""
    going_on = -1
    for hop, leader in enumerate(named):
        led_since = next((k + 1 for k in range(hop, -1, -1) if named[k] != leader), 0)
        gathered = 0.0
        for k in range(led_since, hop + 1):
            span = min(times[k] - times[k - 1], LONGEST_HOP) if k else 0.0
            gathered += span * _pace(scores[k], leader, outcomes[k], lead)
        if leader != going_on and gathered >= lead:
            if going_on >= 0:
                yield times[hop], "end", going_on
            if leader >= 0:
                yield times[hop], "start", leader
            going_on = leader


def _pace(scores: Sequence[float], leader: int, outcome: str, lead: float) -> float:
    if leader < 0 or len(scores) == 1:
        return lead / ENDED_AFTER[outcome if leader < 0 else "still"]
    logs = [math.log(1 / max(score, 1e-9) - 1 + ALIKE) for score in scores]
    second = min(value for index, value in enumerate(logs) if index != leader)
    return 30 * max(second - logs[leader], 0.0)


# --- how streams are scored --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Moment:
    """One frame of a take: when, in which segment (its number, start, end and known class), what was answered."""

    time: float
    segment: int
    start: float
    end: float
    truth: int
    guess: int
    published: int
    event: int
    score: float


def share(of: Sequence[bool]) -> float | None:
    """Give the share that is true, None of nothing."""
    return sum(of) / len(of) if of else None


def percentile(values: Sequence[float], percent: float) -> float | None:
    """Find a percentile, in a straight line between neighbours."""
    if not values:
        return None
    ordered, place = sorted(values), percent / 100 * (len(values) - 1)
    below = math.floor(place)
    above = min(below + 1, len(values) - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


def roc_area(known: Sequence[float], unknown: Sequence[float]) -> float | None:
    """Count in how many pairs the known one scores higher, ties for a half; NaN never answered and is left out."""
    pairs = [(a, b) for a in known for b in unknown if not (math.isnan(a) or math.isnan(b))]
    return sum(1.0 if a > b else 0.5 if a == b else 0.0 for a, b in pairs) / len(pairs) if pairs else None


def stream_score(takes: Sequence[Sequence[Moment]], window: float, lasting: float) -> Mapping[str, float | None]:
    """Score takes by walking through their moments, one at a time."""
    moments = [moment for take in takes for moment in take]
    known = [m for m in moments if m.truth >= 0]
    unknown = [m for m in moments if m.truth < 0 and m.segment >= 0]
    inside = [m for m in known if m.time - window >= m.start]
    delays, seen, event_delays, sought = list[float](), list[float](), list[float](), 0
    for take in takes:
        for number in sorted({m.segment for m in take if m.truth >= 0}):
            performed = [m for m in take if m.segment == number]
            sought += 1
            delay = _delay(performed, lasting)
            delays += delay
            seen += [found / (performed[0].end - performed[0].start) for found in delay]
            event_delays += [m.time - m.start for m in performed if m.event == m.truth][:1]
    seconds = sum(take[-1].time - take[0].time for take in takes)
    unknown_seconds = sum(
        sum(m.truth < 0 <= m.segment for m in take) / len(take) * (take[-1].time - take[0].time) for take in takes
    )
    begun = sum(
        m.published >= 0 and m.truth < 0 <= m.segment and (index == 0 or take[index - 1].published != m.published)
        for take in takes
        for index, m in enumerate(take)
    )
    return {
        "frame_accuracy": share([m.guess == m.truth for m in known]),
        "segment_accuracy": share([m.guess == m.truth for m in inside]),
        "known_answered": share([m.published >= 0 for m in inside]),
        "segments_found": len(delays) / sought if sought else None,
        "median_delay_s": percentile(delays, 50),
        "p90_delay_s": percentile(delays, 90),
        "median_seen": percentile(seen, 50),
        "median_event_delay_s": percentile(event_delays, 50),
        "false_per_minute": begun / unknown_seconds * 60 if unknown else None,
        "unknown_answered": share([m.published >= 0 for m in unknown]),
        "changes_per_minute": 60 * sum(_changes([m.event for m in take]) for take in takes) / seconds,
        "true_changes_per_minute": 60 * sum(_changes([m.truth for m in take]) for take in takes) / seconds,
        "auc_unknown": roc_area([m.score for m in inside], [m.score for m in unknown if m.time - window >= m.start]),
    }


def _changes(track: Sequence[int]) -> int:
    """Walk along a track and count what changes once the first motion goes on."""
    changes, before = 0, -1
    begun = False
    for now in track:
        changes += begun and now != before
        begun = begun or now >= 0
        before = now
    return changes


def _delay(performed: Sequence[Moment], lasting: float) -> list[float]:
    """Give the delay of the first guess that stays right for long enough or to the end, if there is one."""
    for index, first in enumerate(performed):
        if index and performed[index - 1].guess == first.truth:
            continue
        wrong = [m.time for m in performed[index:] if m.guess != m.truth]
        if first.guess == first.truth and (not wrong or wrong[0] - first.time >= lasting):
            return [first.time - first.start]
    return []
