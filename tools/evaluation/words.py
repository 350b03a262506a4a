"""How rightly motions were found that were done: found, counted, false alarms an hour, the delay after the end."""

from bisect import bisect_right
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.special import gammaincinv

from kinespace.library import NOTHING
from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream import EventKind, Recognition
from kinespace.tools.evaluation.harness import Take
from kinespace.tools.evaluation.scores import Figure, intervals_of, percentile, ratio, values_of

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


#: The kinds of words.
KINDS = ("done", "start")
#: Seconds by which a label may be off, because tables give thousandths.
_ROUNDED = 0.001
#: How a table of both kinds is written.
COLUMNS = (
    "said by {name} | F1 {f1:.1%} | 95 % {interval} | found {found:.1%} | right {right:.1%} | "
    "false an hour {false_per_hour:.1f} | delay {delay_s:.2f} s"
)


class Judgement(NamedTuple):
    """A word, the gesture that it is matched with or in whose time it was said, and whether it is right.

    None: said in no gesture's time; the word counts neither way.
    """

    said: Said
    segment: Segment | None
    right: bool | None


class Span(NamedTuple):
    """The time in which a word for a gesture is right, and how other words count.

    Attributes
    ----------
    early, late
        Seconds before a gesture's segment, and after it.
    commands
        Whether segments are the times of commands, in which the gesture is done once. Then a wrong word in a command's
        time also counts as a gesture missed, and a word outside of all segments counts neither way; otherwise it is
        false.
    """

    early: float = 0.0
    late: float = 0.0
    commands: bool = False

    def judged(self, said: Iterable[Said], segments: Sequence[Segment]) -> list[Judgement]:
        """Match words with gestures, in the order of time: the first right word finds a gesture, a second is false."""
        verdicts, found = list[Judgement](), set["Segment"]()
        for word in sorted(said, key=lambda each: each.at):
            since, until = word.at + self.early + _ROUNDED, word.at - self.late + _ROUNDED
            near = [each for each in segments if each.start <= since and until < each.end]
            own = next((each for each in near if each.label == word.class_name and each not in found), None)
            if own:
                found.add(own)
            right = own is not None if near or not self.commands else None
            verdicts.append(Judgement(word, own or next(iter(near), None), right))
        return verdicts


# Without slots: words are matched once.
@dataclass(frozen=True, eq=False)
class Heard:
    """A long take, the gestures asked for in it, and what was said.

    Attributes
    ----------
    person
        The person who performs.
    seconds
        The time in which words count.
    segments
        The gestures asked for; segments of `nothing` ask for none.
    said
        The words of each of `KINDS`.
    spans
        For each kind how its words are matched.
    since
        For each kind and gesture the moment from which the delay counts, seconds.
    so_far
        How many gestures' class the answers' `so_far` said at the end of their movement.
    """

    person: str
    seconds: float
    segments: Sequence[Segment]
    said: Mapping[str, Sequence[Said]]
    spans: Mapping[str, Span]
    since: Mapping[str, Mapping[Segment, float]] = field(repr=False)
    so_far: int = 0

    @cached_property
    def verdicts(self) -> dict[str, list[Judgement]]:
        """The words of each kind, matched with the gestures."""
        return {kind: self.spans[kind].judged(self.said[kind], self.segments) for kind in KINDS}

    @property
    def asked(self) -> int:
        """The number of gestures asked for."""
        return sum(each.label != NOTHING for each in self.segments)

    def right(self, kind: str) -> int:
        """Count the words of a kind that are right."""
        return sum(each.right is True for each in self.verdicts[kind])

    def false(self, kind: str) -> int:
        """Count the words of a kind that are false."""
        return sum(each.right is False for each in self.verdicts[kind])

    def missed(self, kind: str) -> int:
        """Count the gestures that no word of a kind found; of commands also the wrong words in a gesture's time."""
        false = (each for each in self.verdicts[kind] if each.right is False)
        of_gestures = ((each.segment.label, each.said.class_name) for each in false if each.segment)
        wrong = [label for label, said in of_gestures if label not in (NOTHING, said)]
        return self.asked - self.right(kind) + (len(wrong) if self.spans[kind].commands else 0)

    def delays(self, kind: str) -> list[float]:
        """Give the seconds to each right word of a kind."""
        since = self.since[kind]
        return [each.said.at - since[each.segment] for each in self.verdicts[kind] if each.right and each.segment]


def said_in(answers: Iterable[Recognition]) -> dict[str, list[Said]]:
    """Give the words of answers by kind; a start ends when it begins."""
    said: dict[str, list[Said]] = {kind: [] for kind in KINDS}
    for answer in answers:
        if done := answer.done:
            said["done"].append(Said(done.label, done.start, done.end, answer.time))
        starts = (each for each in answer.events if each.kind is EventKind.START)
        said["start"] += [Said(each.label, each.time, each.time, each.time) for each in starts]
    return said


def right_so_far(answers: Sequence[Recognition], ends: Mapping[Segment, float]) -> int:
    """Count the gestures whose class `so_far` says at the end of their movement, seconds."""
    times = [answer.time for answer in answers]
    last = {each: answers[max(bisect_right(times, end) - 1, 0)] for each, end in ends.items()} if times else {}
    return sum(answer.classes[answer.so_far] == each.label for each, answer in last.items())


def score_words(takes: Sequence[Heard]) -> dict[str, dict[str, Any]]:
    """Score the words of some takes together, for each of `KINDS`.

    Returns
    -------
    `found`, right words among them and the gestures missed; `right`, right words among all that count; `f1`, the
    harmonic mean of both; `false_per_hour`; `delay_s`, the median; None where there is nothing to take a share of.
    `intervals` has the 95 % interval of each, where persons are drawn again.
    """
    scores, persons = dict[str, dict[str, "Any"]](), [[each.person for each in takes]]
    for kind in KINDS:
        counts = [(each.right(kind), each.false(kind), each.missed(kind)) for each in takes]
        right, false, missed = np.array(counts, dtype=np.float64).reshape(-1, 3).T
        figures: dict[str, Figure] = {
            "f1": ratio(2 * right, 2 * right + false + missed, persons=persons),
            "found": ratio(right, right + missed, persons=persons),
            "right": ratio(right, right + false, persons=persons),
            "false_per_hour": ratio(false, [each.seconds for each in takes], 3600, persons=persons),
            "delay_s": percentile([each.delays(kind) for each in takes], 50, persons=persons),
        }
        scores[kind] = {**values_of(figures), "intervals": intervals_of(figures, by_person=True)}
    return scores


def word_rows(takes: Iterable[Heard]) -> Iterator[dict[str, Any]]:
    """Give a row for each word: person, time, kind, class, verdict (empty: counts neither way), and its segment."""
    for take in takes:
        for kind, verdicts in take.verdicts.items():
            for said, segment, right in verdicts:
                yield {
                    "person": take.person,
                    "time": said.at,
                    "kind": kind,
                    "class": said.class_name,
                    "verdict": "" if right is None else "right" if right else "false",
                    "segment": segment.label if segment else "",
                    "segment_start": segment.start if segment else "",
                }
