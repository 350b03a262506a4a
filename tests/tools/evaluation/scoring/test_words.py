"""Words matched with gestures: counted by hand, and of random words against a naive count."""

from itertools import pairwise

import naive_words
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinespace.library.recordings.formats.labels import Segment
from kinespace.tools.evaluation.words import KINDS, Heard, Said, Span, score_words, word_rows

COMMANDS, SHOW = Span(commands=True), Span(early=0.125, late=1.0)
SEGMENTS = (Segment(0.0, 4.0, "jab"), Segment(4.0, 8.0, "kick"), Segment(9.0, 12.0, "jab"))
#: Words on a grid that is whole in binary, between the edges of segments: an edge is off by a thousandth.
WORDS = st.lists(
    st.tuples(st.integers(0, 60).map(lambda each: each / 4 + 0.0625), st.sampled_from(["jab", "kick", "duck"])),
    max_size=25,
    unique=True,
)
#: Edges of segments that follow each other, with or without a gap, and the labels between.
EDGES = st.lists(st.integers(0, 50), min_size=2, max_size=9, unique=True).map(sorted)
LABELS = st.lists(st.sampled_from(["jab", "kick", "nothing", ""]), min_size=8, max_size=8)


def said(*words: naive_words.Word) -> list[Said]:
    """Give words as the product has them."""
    return [Said(name, time, time, time) for time, name in words]


def heard(words: list[Said], segments: tuple[Segment, ...], span: Span, person: str = "ann") -> Heard:
    """Let both kinds say the same words in a minute."""
    ends = {each: each.end for each in segments}
    return Heard(
        person, 60.0, segments, dict.fromkeys(KINDS, words), dict.fromkeys(KINDS, span), dict.fromkeys(KINDS, ends)
    )


def counts(take: Heard) -> tuple[int, int, int]:
    """Give right words, false words and missed gestures."""
    return take.right("done"), take.false("done"), take.missed("done")


def test_commands_counted_by_hand() -> None:
    """The first jab is right, the second false; a wrong word misses the kick; a word between counts neither way."""
    words = said((1.0, "jab"), (2.0, "jab"), (5.0, "duck"), (6.0, "kick"), (8.5, "duck"))
    take = heard(words, SEGMENTS, COMMANDS)
    assert [each.right for each in take.verdicts["start"]] == [True, False, False, True, None]
    assert counts(take) == (2, 2, 2)
    score = score_words([take])["start"]
    assert (score["found"], score["right"], score["f1"]) == (0.5, 0.5, 0.5)
    assert score["false_per_hour"] == 120.0
    assert score["delay_s"] == pytest.approx(-2.5)
    assert score["intervals"]["f1"] == (0.5, 0.5)
    rows = [(each["kind"], each["verdict"], each["segment"]) for each in word_rows([take])]
    assert rows[:5] == [
        ("done", "right", "jab"),
        ("done", "false", "jab"),
        ("done", "false", "kick"),
        ("done", "right", "kick"),
        ("done", "", ""),
    ]


def test_a_label_may_be_off_by_its_rounding() -> None:
    """A label of thousandths is the frame that it was written for, at its start and at its end."""
    segments = (Segment(9.967, 14.5, "jab"), Segment(14.5, 20.933, "kick"))
    words = said((299 / 30, "jab"), (628 / 30, "kick"))
    assert [each.right for each in heard(words, segments, COMMANDS).verdicts["done"]] == [True, None]


@given(edges=EDGES, labels=LABELS, words=WORDS)
def test_random_words_are_counted_as_the_twin_counts(
    edges: list[int], labels: list[str], words: list[naive_words.Word]
) -> None:
    """By both rules, for gestures that follow each other with or without gaps."""
    gestures = [(a / 4, b / 4, label) for (a, b), label in zip(pairwise(edges), labels, strict=False) if label]
    segments = tuple(Segment(*each) for each in gestures)
    assert counts(heard(said(*words), segments, COMMANDS)) == naive_words.of_commands(gestures, words)
    asked = [each for each in gestures if each[2] != "nothing"]
    segments = tuple(Segment(*each) for each in asked)
    assert counts(heard(said(*words), segments, SHOW)) == naive_words.in_a_show(asked, words, 0.125, 1.0)
