"""The words that a recogniser says of a long take, matched with the gestures asked for: scores of events.

A word is a class that is said at a moment: a `start` event, or a motion that was `done`. It is right, false, or counts
neither way. The figures are those of event scoring (`timescoring`; SHREC's tracks of online gestures): of the gestures
the share found, of the words the share that is right, their harmonic mean F1, and false words an hour.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from kinespace.library import NOTHING
from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream.recognition import EventKind, Recognition
from kinespace.tools.evaluation.scoring.bootstrap import Figure, Percentile, Ratio, intervals_of, values_of
from kinespace.tools.evaluation.scoring.done_score import Said

#: The kinds of words.
KINDS = ("done", "start")
#: Seconds by which a label may be off, because tables give thousandths.
_ROUNDED = 0.001
#: How a table of both kinds is written.
COLUMNS = (
    ("said by", "{name}"),
    ("F1", "{f1:.1%}"),
    ("95 %", "{interval}"),
    ("found", "{found:.1%}"),
    ("right", "{right:.1%}"),
    ("false an hour", "{false_per_hour:.1f}"),
    ("delay", "{delay_s:.2f} s"),
)


class Verdict(NamedTuple):
    """A word, the gesture that it is matched with or in whose time it was said, and whether it is right.

    None: said in no gesture's time; the word counts neither way.
    """

    said: Said
    segment: Segment | None
    right: bool | None


@dataclass(frozen=True, slots=True)
class Span:
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

    def judged(self, said: Iterable[Said], segments: Sequence[Segment]) -> list[Verdict]:
        """Match words with gestures, in the order of time: the first right word finds a gesture, a second is false."""
        verdicts, found = list[Verdict](), set["Segment"]()
        for word in sorted(said, key=lambda each: each.at):
            near = [
                each
                for each in segments
                if each.start - self.early - _ROUNDED <= word.at < each.end + self.late - _ROUNDED
            ]
            own = next((each for each in near if each.label == word.class_name and each not in found), None)
            if own:
                found.add(own)
            right = own is not None if near or not self.commands else None
            verdicts.append(Verdict(word, own or next(iter(near), None), right))
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
    def verdicts(self) -> dict[str, list[Verdict]]:
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
        wrong = [
            each
            for each in self.verdicts[kind]
            if each.right is False and each.segment and each.segment.label not in (NOTHING, each.said.class_name)
        ]
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
        right, false, missed = (
            [count(each, kind) for each in takes] for count in (Heard.right, Heard.false, Heard.missed)
        )
        words, gestures = ([a + b for a, b in zip(right, each, strict=True)] for each in (false, missed))
        twice, both = [2 * each for each in right], [a + b for a, b in zip(words, gestures, strict=True)]
        figures: dict[str, Figure] = {
            "f1": Ratio(twice, both, persons=persons),
            "found": Ratio(right, gestures, persons=persons),
            "right": Ratio(right, words, persons=persons),
            "false_per_hour": Ratio(false, [each.seconds for each in takes], 3600, persons=persons),
            "delay_s": Percentile([each.delays(kind) for each in takes], 50, persons=persons),
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
