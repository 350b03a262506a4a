"""The slow twin of the scores of streams: a walk through the moments of takes, one at a time, and of words: the rules.

Nothing here calls the product.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Moment:
    """One frame of a take: its time, how long it lasts, its segment (number, start, end, known class), its answer."""

    time: float
    lasts: float
    segment: int
    start: float
    end: float
    truth: int
    guess: int
    published: int
    event: int
    score: float


def share(of: Sequence[bool], lasts: Sequence[float] | None = None) -> float | None:
    """Give the share of true values, each weighed by how long it lasts; None for no values."""
    weights = lasts or [1.0] * len(of)
    return sum(weight for each, weight in zip(of, weights, strict=True) if each) / sum(weights) if of else None


def time_share(of: Callable[[Moment], bool], moments: Sequence[Moment]) -> float | None:
    """Give the share of the time of some moments in which something holds."""
    return share([of(m) for m in moments], [m.lasts for m in moments])


def percentile(values: Sequence[float], percent: float) -> float | None:
    """Find a percentile, in a straight line between neighbours."""
    return float(np.percentile(values, percent)) if values else None


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
    delays, seen, event_delays, sought, found_at_all = list[float](), list[float](), list[float](), 0, 0
    for take in takes:
        for number in sorted({m.segment for m in take if m.truth >= 0}):
            performed = [m for m in take if m.segment == number]
            sought += 1
            delay = _delay(performed, lasting)
            found_at_all += len(delay)
            if performed[0].truth in {m.truth for m in take if m.segment == number - 1}:
                continue
            delays += delay
            seen += [found / (performed[0].end - performed[0].start) for found in delay]
            event_delays += [m.time - m.start for m in performed if m.event == m.truth][:1]
    seconds = sum(take[-1].time - take[0].time for take in takes)
    unknown_seconds = sum(m.lasts for m in unknown)

    def begun(track: Callable[[Moment], int]) -> int:
        return sum(
            track(m) >= 0 and m.truth < 0 <= m.segment and (index == 0 or track(take[index - 1]) != track(m))
            for take in takes
            for index, m in enumerate(take)
        )

    majorities = [
        2 * sum(m.lasts for m in take if m.segment == number and m.guess == m.truth)
        > sum(m.lasts for m in take if m.segment == number) * (1 + 1e-9)
        for take in takes
        for number in sorted({m.segment for m in take if m.truth >= 0})
    ]
    return {
        "frame_accuracy": time_share(lambda m: m.guess == m.truth, known),
        "segment_accuracy": time_share(lambda m: m.guess == m.truth, inside),
        "known_answered": time_share(lambda m: m.published >= 0, inside),
        "segments_found": found_at_all / sought if sought else None,
        "median_delay_s": percentile(delays, 50),
        "p90_delay_s": percentile(delays, 90),
        "median_seen": percentile(seen, 50),
        "median_event_delay_s": percentile(event_delays, 50),
        "false_per_minute": begun(lambda m: m.published) / unknown_seconds * 60 if unknown else None,
        "unknown_answered": time_share(lambda m: m.published >= 0, unknown),
        "changes_per_minute": 60 * sum(_changes([m.event for m in take]) for take in takes) / seconds,
        "true_changes_per_minute": 60 * sum(_changes([m.truth for m in take]) for take in takes) / seconds,
        "auc_unknown": roc_area([m.score for m in inside], [m.score for m in unknown if m.time - window >= m.start]),
        "segment_majority": share(majorities),
        "false_starts_per_minute": begun(lambda m: m.event) / unknown_seconds * 60 if unknown else None,
        "takes_found": None,
        "doubted": 0.0,
        "unlike": None,
    }


def _changes(track: Sequence[int]) -> int:
    """Walk along a track and count changes after the first motion has begun."""
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


def drawn_again(units: int, seed: int) -> list[list[int]]:
    """Draw units with replacement a thousand times: how often each, by the product's own chance."""
    return np.random.default_rng(seed).multinomial(units, [1 / units] * units, size=1000).tolist()


def middle(values: Sequence[float | None]) -> tuple[float, float] | None:
    """Find the 2.5th and the 97.5th percentile of the values that there are."""
    there = [value for value in values if value is not None]
    low, high = percentile(there, 2.5), percentile(there, 97.5)
    return None if low is None or high is None else (low, high)


# --- the scores of words: gestures are (start, end, label), words (time, class) ---------------------------------------


Gesture = tuple[float, float, str]
Word = tuple[float, str]


def of_commands(gestures: Sequence[Gesture], words: Sequence[Word]) -> tuple[int, int, int]:
    """Count right words, false words and missed gestures where each gesture is asked for in a time of its own."""
    right = false = missed = 0
    for start, end, label in gestures:
        found = False
        for time, name in sorted(words):
            if not start <= time < end:
                continue
            if name == label and not found:
                found = True
                right += 1
            elif name == label:
                false += 1
            else:
                false += 1
                missed += label != "nothing"
        if not found and label != "nothing":
            missed += 1
    return right, false, missed


def in_a_show(gestures: Sequence[Gesture], words: Sequence[Word], early: float, late: float) -> tuple[int, int, int]:
    """Count right words, false words and missed gestures where all that is said elsewhere is false."""
    left, right, false = sorted(gestures), 0, 0
    for time, name in sorted(words):
        for gesture in left:
            start, end, label = gesture
            if name == label and start - early <= time < end + late:
                left.remove(gesture)
                right += 1
                break
        else:
            false += 1
    return right, false, len(left)
