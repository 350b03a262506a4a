"""How what was said is scored: counted by hand, and of random takes against a naive count."""

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import naive_score
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive_score import Moment
from synthetic import STICK_CLASSES, stick_clip

from kinespace.library import NOTHING, MotionLibrary, Skeleton
from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream import Done, Event, EventKind, Outcome, Recognition
from kinespace.tools.evaluation.annotations import is_annotation, write_annotations
from kinespace.tools.evaluation.evaluate_faults import FAULTS, LEFT_ARM
from kinespace.tools.evaluation.evaluate_teach import Reply, scored
from kinespace.tools.evaluation.harness import AskedTake, Feed, Protocol, Take, asked_by
from kinespace.tools.evaluation.scores import (
    AnsweredTake,
    answered_take,
    percentile,
    ratio,
    roc_area,
    score_takes,
    values_of,
)
from kinespace.tools.evaluation.words import DoneTake, Heard, Said, Span, by_class, score_done, score_words, word_rows

CLASSES = ("bow", "jump", "wave")
NONE, BOW, JUMP, WAVE = range(-1, 3)
#: Eight frames a second, whose times are whole in binary.
RATE = 8
TIMES = np.arange(64) / RATE
SECONDS = 7.875
SEGMENTS = (Segment(0, 2, "bow"), Segment(2.5, 5, "jump"), Segment(5, 7.5, "juggle"), Segment(7.5, 9, "wave"))


def _segment(times: np.ndarray, segments: Sequence[Segment]) -> np.ndarray:
    inside = [[index for index, each in enumerate(segments) if each.start <= time < each.end] for time in times]
    return np.array([found[0] if found else -1 for found in inside])


# --- bases of the figures ---------------------------------------------------------------------------------------


def test_a_class_is_found_that_is_named_at_some_time() -> None:
    """Of the classes that takes contain the share counts that was named, if only once; guesses do not count."""
    still = np.full(64, NONE)
    once = still.copy()
    once[40] = WAVE
    empty = replace(_laid_out([], segments=()), guess=np.full(64, BOW))
    takes = [
        replace(empty, name="one", published=once, contains=(WAVE, BOW), person="ann"),
        replace(empty, name="two", published=still, contains=(WAVE,), person="ann"),
        replace(empty, name="three", published=once, contains=()),
    ]
    figures, described = score_takes(takes, CLASSES, 1.0)
    values = values_of(figures)
    assert values["takes_found"] == pytest.approx(1 / 3)
    assert described["containing"] == {"seconds": pytest.approx(2 * SECONDS), "segments": 2, "persons": 1}
    assert (described["known"]["segments"], described["unknown"]["segments"]) == (0, 0)
    assert values["frame_accuracy"] is None


# --- against the twin --------------------------------------------------------------------------------------------


def _random_take(generator: np.random.Generator, frames: int, most_apart: int = 1) -> AnsweredTake:
    """Make a take whose frames are a thirtieth of a second apart, or up to so many."""
    times = np.cumsum(generator.integers(1, most_apart + 1, frames)) / 30
    edges = np.sort(generator.choice(times, size=12, replace=False)) + 0.005 * (most_apart - 1)
    stretches = [pair for pair, there in zip(pairwise(edges), generator.random(11), strict=True) if there > 0.2]
    names = (*CLASSES, "juggle", "sleep")
    segments = tuple(Segment(float(a), float(b), names[generator.integers(5)]) for a, b in stretches)
    segment = _segment(times, segments)
    known = np.array([CLASSES.index(each.label) if each.label in CLASSES else NONE for each in segments])
    truth = np.where(segment >= 0, known[segment], NONE)

    def flickering(right: float) -> np.ndarray:
        wrong = np.repeat(generator.integers(-1, 3, frames), generator.integers(1, 12, frames))[:frames]
        is_right = np.repeat(generator.random(frames) < right, generator.integers(1, 30, frames))[:frames]
        return np.where(is_right, truth, wrong)

    score = np.round(generator.random(frames) + 0.1 * (truth >= 0), 2)
    score[:10] = np.nan
    return AnsweredTake(
        "random", times, segments, truth, segment, flickering(0.7), flickering(0.6), flickering(0.8), score
    )


def _moments(one: AnsweredTake) -> list[Moment]:
    untils = [*one.times[1:].tolist(), one.times[-1] + one.seconds / (len(one.times) - 1)]
    tracks = (one.times, one.segment, one.truth, one.guess, one.published, one.event, one.score)
    moments = list[Moment]()
    for until, time, place, *answered in zip(untils, *(track.tolist() for track in tracks), strict=True):
        segment = one.segments[place]
        lasts = min(until, segment.end if place >= 0 else np.inf) - time
        moments.append(Moment(time, lasts, place, segment.start, segment.end, *answered))
    return moments


@pytest.mark.slow
@given(
    seed=st.integers(0, 2**32 - 1),
    takes=st.integers(1, 3),
    window=st.sampled_from([0.0, 0.5, 1.0]),
    most_apart=st.sampled_from([1, 6]),
)
@settings(max_examples=30)
def test_any_take_is_scored_as_a_walk_through_moments(seed: int, takes: int, window: float, most_apart: int) -> None:
    """Every figure of random takes, and of each class, is the one that walking through them by moments gives."""
    generator = np.random.default_rng(seed)
    answered = [_random_take(generator, int(generator.integers(100, 400)), most_apart) for _ in range(takes)]
    answered = [replace(one, name=f"{place}") for place, one in enumerate(answered)]
    walked, (figures, described) = [_moments(one) for one in answered], score_takes(answered, CLASSES, window)
    exact, values = naive_score.stream_score(walked, window, 0.3), values_of(figures)
    assert values.keys() == exact.keys()
    for name, value in exact.items():
        assert values[name] == (None if value is None else pytest.approx(value, rel=1e-9)), name
    for name, found in described["classes"].items():
        own = [moment for take in walked for moment in take if moment.truth == CLASSES.index(name)]
        inside = [moment for moment in own if moment.time - window >= moment.start]
        shares = [naive_score.time_share(lambda m: m.guess == m.truth, each) for each in (own, inside)]
        assert found["seconds"] == pytest.approx(sum(moment.lasts for moment in own))
        assert (found["right"], found["right_inside"]) == pytest.approx(tuple(each or 0.0 for each in shares))


# --- answers over time --------------------------------------------------------------------------------------------


def _recognition(time: float, best: int, score: float, outcome: Outcome = Outcome.NAMED) -> Recognition:
    scores = np.full(3, 0.01)
    scores[best] = score
    return Recognition("p", time, outcome, CLASSES, scores, guess=best, movement=0.1)


def test_a_take_holds_each_answer_until_the_next() -> None:
    """Answers of hops and events hold from their time until the next, at every frame."""
    told = ((0.5, BOW, 0.9, Outcome.UNKNOWN), (1.0, JUMP, 0.8, Outcome.NAMED), (3.0, BOW, 0.7, Outcome.NAMED))
    answers = [_recognition(*each) for each in told]
    happened = ((EventKind.START, JUMP, 1.5), (EventKind.END, JUMP, 3.5), (EventKind.START, WAVE, 3.5))
    events = tuple(Event("p", kind, CLASSES[index], index, 0.9, time) for kind, index, time in happened)
    one = _laid_out([replace(answers[0], events=events), *answers[1:]])
    assert one.guess.tolist() == [NONE] * 4 + [BOW] * 4 + [JUMP] * 16 + [BOW] * 40
    assert one.published.tolist() == [NONE] * 8 + [JUMP] * 16 + [BOW] * 40
    assert one.event.tolist() == [NONE] * 12 + [JUMP] * 16 + [WAVE] * 36
    assert np.array_equal(one.score, [np.nan] * 4 + [0.9] * 4 + [0.8] * 16 + [0.7] * 40, equal_nan=True)
    assert one.segment.tolist() == [0] * 16 + [NONE] * 4 + [1] * 20 + [2] * 20 + [3] * 4
    assert one.truth.tolist() == [BOW] * 16 + [NONE] * 4 + [JUMP] * 20 + [NONE] * 20 + [WAVE] * 4
    assert (one.name, one.segments, len(one.answers)) == ("take", SEGMENTS, 3)


def _laid_out(
    recognitions: Sequence[Recognition], known: Sequence[str] = CLASSES, segments: Sequence[Segment] = SEGMENTS
) -> AnsweredTake:
    clip = replace(stick_clip("bow", frames=len(TIMES)), name="take", actor="")
    take = Take(clip, tuple(segments), contains=() if segments else ("wave", "bow"))
    return answered_take(take, TIMES, recognitions, classes=CLASSES, known=known)


def test_still_is_no_guess_and_unknown_is_one() -> None:
    """A still body has no guess; an unknown motion has a guess that is not named; an implausible one is doubted."""
    outcomes = (Outcome.STILL, Outcome.UNKNOWN, Outcome.IMPLAUSIBLE)
    one = _laid_out([_recognition(at, BOW, 0.9, each) for at, each in zip((1.0, 2.0, 6.0), outcomes, strict=True)])
    assert set(one.guess[:16]) == {NONE}
    assert set(one.guess[16:48]) == {BOW}
    assert set(one.published) == {NONE}
    assert one.doubted == 0.25


def test_classes_that_the_library_lacks_are_unknown() -> None:
    """A class of another take's library that this one's does not know is unknown here, in a segment or in a take."""
    one = _laid_out([], known=("bow", "wave"))
    assert set(one.truth[one.segment == 1]) == {NONE}
    assert set(one.truth[one.segment == 3]) == {WAVE}
    one = _laid_out([_recognition(1.0, BOW, 0.9)], known=("bow",), segments=())
    assert set(one.segment) == set(one.truth) == {NONE}
    assert (one.contains, one.seconds) == ((BOW,), SECONDS)
    assert set(one.published[8:]) == {BOW}


COMMANDS, SHOW = Span(commands=True), Span(early=0.125, late=1.0)
GESTURES = (Segment(0.0, 4.0, "jab"), Segment(4.0, 8.0, "kick"), Segment(9.0, 12.0, "jab"))
#: Words on a grid that is whole in binary, between the edges of segments: an edge is off by a thousandth.
WORDS = st.lists(
    st.tuples(st.integers(0, 60).map(lambda each: each / 4 + 0.0625), st.sampled_from(["jab", "kick", "duck"])),
    max_size=25,
    unique=True,
)
#: Edges of segments that follow each other, with or without a gap, and the labels between.
EDGES = st.lists(st.integers(0, 50), min_size=2, max_size=9, unique=True).map(sorted)
LABELS = st.lists(st.sampled_from(["jab", "kick", "nothing", ""]), min_size=8, max_size=8)


def said(*words: naive_score.Word) -> list[Said]:
    """Give words as the product has them."""
    return [Said(name, time, time, time) for time, name in words]


def heard(words: list[Said], segments: tuple[Segment, ...], span: Span, person: str = "ann") -> Heard:
    """Let both kinds say the same words in a minute."""
    ends = {each: each.end for each in segments}
    return Heard(person, 60.0, segments, *(dict.fromkeys(("done", "start"), each) for each in (words, span, ends)))


def counts(take: Heard) -> tuple[int, int, int]:
    """Give right words, false words and missed gestures."""
    return take.right("done"), take.false("done"), take.missed("done")


def test_commands_counted_by_hand() -> None:
    """The first jab is right, the second false; a wrong word misses the kick; a word between counts neither way."""
    words = said((1.0, "jab"), (2.0, "jab"), (5.0, "duck"), (6.0, "kick"), (8.5, "duck"))
    take = heard(words, GESTURES, COMMANDS)
    assert [each.right for each in take.verdicts["start"]] == [True, False, False, True, None]
    assert counts(take) == (2, 2, 2)
    score = score_words([take])["start"]
    assert (score["found"], score["right"], score["f1"]) == (0.5, 0.5, 0.5)
    assert score["false_per_hour"] == 120.0
    assert score["delay_s"] == pytest.approx(-2.5)
    assert score["intervals"]["f1"] == (0.5, 0.5)
    rows = [(each["kind"], each["verdict"], each["segment"]) for each in word_rows([take])]
    verdicts = [("right", "jab"), ("false", "jab"), ("false", "kick"), ("right", "kick"), ("", "")]
    assert rows[:5] == [("done", *each) for each in verdicts]


def test_a_label_may_be_off_by_its_rounding() -> None:
    """A label of thousandths is the frame that it was written for, at its start and at its end."""
    segments = (Segment(9.967, 14.5, "jab"), Segment(14.5, 20.933, "kick"))
    words = said((299 / 30, "jab"), (628 / 30, "kick"))
    assert [each.right for each in heard(words, segments, COMMANDS).verdicts["done"]] == [True, None]


@given(edges=EDGES, labels=LABELS, words=WORDS)
def test_random_words_count_as_by_the_twin(edges: list[int], labels: list[str], words: list[naive_score.Word]) -> None:
    """By both rules, for gestures that follow each other with or without gaps."""
    gestures = [(a / 4, b / 4, label) for (a, b), label in zip(pairwise(edges), labels, strict=False) if label]
    segments = tuple(Segment(*each) for each in gestures)
    assert counts(heard(said(*words), segments, COMMANDS)) == naive_score.of_commands(gestures, words)
    asked = [each for each in gestures if each[2] != "nothing"]
    segments = tuple(Segment(*each) for each in asked)
    assert counts(heard(said(*words), segments, SHOW)) == naive_score.in_a_show(asked, words, 0.125, 1.0)


#: A take of ten seconds.
CLIP = stick_clip("bow", frames=601, rate=60.0)
PERFORMED = (Segment(1.0, 3.0, "bow"), Segment(4.0, 6.0, "wave"), Segment(6.0, 7.0, "spin"))


def test_a_take_counted_by_hand() -> None:
    """A bow said half a second late belongs to its segment, twice said too; a wave in its place is false.

    A motion of which less than half lies in its segment is false. The library does not know spins.
    """
    right, again = Said("bow", 1.5, 3.4, 3.6), Said("bow", 1.0, 2.0, 2.2)
    false = [Said("wave", 1.0, 3.0, 3.2), Said("bow", 2.5, 4.0, 4.2), Said("bow", 5.0, 6.0, 6.2)]
    take = DoneTake(Take(CLIP, PERFORMED), {"bow", "wave"}, [again, right, *false], broken=[True, False])
    (bow, of_bow), (wave, of_wave) = take.shared()[0]
    assert (bow, of_bow, wave, of_wave, take.shared()[1]) == (*(PERFORMED[0], [again, right], PERFORMED[1], []), false)
    score = score_done([take])
    assert (score["found"], score["broken_done"]) == (0.5, 0.5)
    assert score["takes_found"] is score["counted_right"] is None
    assert score["delay_s"] == pytest.approx(0.6)
    assert score["unknown_hours"] == pytest.approx((CLIP.duration - 4) / 3600)
    assert score["false_per_hour"] == pytest.approx(3 * 3600 / CLIP.duration)
    counts = {"bow": (1.0, 1.0, 2.0), "wave": (1.0, 0.0, 1.0)}
    assert {name: tuple(each.values()) for name, each in by_class([take]).items()} == counts


def test_what_a_take_contains_somewhere_is_not_false() -> None:
    """A contained motion is found where it is said; in a take of nothing whatever is said is false."""
    said = [Said("bow", 1.0, 3.0, 3.2)]
    contains, nothing = Take(CLIP, (), ("bow",)), Take(CLIP, (Segment(0.0, CLIP.duration, NOTHING),))
    first, second = (score_done([DoneTake(take, {"bow", NOTHING}, said)]) for take in (contains, nothing))
    assert (first["takes_found"], first["false_per_hour"], first["unknown_hours"]) == (1.0, 0.0, 0.0)
    assert second["takes_found"] is None
    assert second["unknown_hours"] == pytest.approx(CLIP.duration / 3600)
    assert second["false_per_hour"] == pytest.approx(3600 / CLIP.duration)


def test_every_number_of_examples_has_a_place_in_the_figures_of_teaching() -> None:
    """Where nobody could ask there is no figure: by one example one of four answers named a class that was left out."""
    reply = Reply(CLIP, ("bow",), 0.5, answers=4, named=1)
    figures = scored({("same", 1): [reply], ("unknown same", 1): [reply]}, [1, 2])
    assert {len(each) for each in figures.values()} == {2}
    assert (figures["same_first_right"], figures["unknown_named"]) == ([1.0, None], [0.25, None])
    assert "unknown_named" not in scored({("same", 1): [reply]}, [1, 2])


@pytest.mark.parametrize(("count", "right"), [(3, 0.0), (4, 1.0), (6, 1.0), (7, 0.0)])
def test_five_of_a_class_are_counted(count: int, right: float) -> None:
    """Of five bows the count may be off by one."""
    segments = tuple(Segment(float(place), place + 1.0, "bow") for place in range(5))
    said = [Said("bow", place * 0.7, place * 0.7 + 0.5, 5.0) for place in range(count)]
    assert score_done([DoneTake(Take(CLIP, segments), {"bow"}, said)])["counted_right"] == right


def _played(fault: str) -> tuple[Feed, Feed]:
    clip = MotionLibrary.builtin().motions[0]
    feed = Feed.of(clip, clip.skeleton)
    return feed, FAULTS[fault](feed, np.random.default_rng(0))


def test_each_fault_does_what_its_name_says() -> None:
    """Frozen joints stay, exchanged joints are exchanged, lost joints are NaN; other joints do not change."""
    feed, frozen = _played("left arm frozen")
    joints = feed.skeleton.joints
    arm = [joints.index(name) for name in LEFT_ARM]
    assert (frozen.positions[:, arm] == feed.positions[0, arm]).all()
    np.testing.assert_array_equal(*(np.delete(each.positions, arm, axis=1) for each in (frozen, feed)))
    sides = _played("sides exchanged")[1].positions
    np.testing.assert_array_equal(sides[:, joints.index("lfoot")], feed.positions[:, joints.index("rfoot")])
    np.testing.assert_array_equal(sides[:, 0], feed.positions[:, 0])
    lost = np.isnan(_played("head and hand lost")[1].positions).any(axis=2)
    assert set(np.flatnonzero(lost.any(axis=0))) == {joints.index("head"), joints.index("rhand")}
    assert len(_played("half the frames dropped")[1].times) < 0.7 * len(feed.times)
    assert len(np.unique(_played("two postures, 1/4 s")[1].positions, axis=0)) == 2
    unsided = feed._replace(skeleton=Skeleton(tuple(f"joint {place}" for place in range(len(joints)))))
    with pytest.raises(ValueError, match="--fault: expected joints whose names say left or right"):
        FAULTS["sides exchanged"](unsided, np.random.default_rng(0))


def _annotated() -> AnsweredTake:
    """Give a take of which a bow was said twice, once to the take's end, and done once."""
    said = ((0.05, EventKind.START), (0.2, EventKind.END), (0.3, EventKind.START))
    events = [(Event("p", kind, "bow", 0, 0.9, time),) for time, kind in said]
    answer = Recognition("p", 0.0, Outcome.NAMED, ("bow",), np.ones(1), 0.1)
    answers = [replace(answer, time=each[0].time, events=each) for each in events]
    answers[1] = replace(answers[1], done=Done("p", "bow", 0, 0.02, 0.13, 0.8, 1.0, 1.0))
    take = Take(replace(stick_clip("bow"), actor="ann"), (Segment(0, 0.35, "bow"),))
    return answered_take(take, take.clip.times, answers, classes=("bow",), known=("bow",))


def test_elan_reads_what_was_said(tmp_path: Path) -> None:
    """Starts, done motions and labels stand in three tiers of their person, in milliseconds."""
    path, one = tmp_path / "events.eaf", _annotated()
    assert is_annotation(path, 1)
    write_annotations(path, [one])
    root = ET.parse(path).getroot()  # noqa: S314 - we wrote it
    slots = {each.attrib["TIME_SLOT_ID"]: int(each.attrib["TIME_VALUE"]) for each in root.iter("TIME_SLOT")}
    tiers = {
        tier.attrib["TIER_ID"]: [
            (slots[each.attrib["TIME_SLOT_REF1"]], slots[each.attrib["TIME_SLOT_REF2"]], each.findtext("*"))
            for each in tier.iter("ALIGNABLE_ANNOTATION")
        ]
        for tier in root.iter("TIER")
    }
    last = round(1000 * float(one.times[-1]))
    assert tiers == {
        "started": [(50, 200, "bow"), (300, last, "bow")],
        "done": [(20, 150, "bow")],
        "performed": [(0, 350, "bow")],
    }
    assert {tier.attrib["PARTICIPANT"] for tier in root.iter("TIER")} == {"ann"}
    # A motion that begins and ends at once is none, and no name makes another file than XML.
    at_once = replace(one.answers[0], events=[Event("p", kind, "bow", 0, 0.9, 0.05) for kind in EventKind])
    write_annotations(path, [replace(one, answers=[at_once], segments=(Segment(0, 0.35, "b\bow"),))])
    assert [each.text for each in ET.parse(path).iter("ANNOTATION_VALUE")] == ["b\ufffdow"]  # noqa: S314 - as above
    with pytest.raises(ValueError, match="expected one take in a file of ELAN, got 2"):
        is_annotation(path, 2)


def test_boris_reads_what_was_said(tmp_path: Path) -> None:
    """Of several takes each is an observation; each state event begins with a row and ends with the next."""
    path, one = tmp_path / "events.boris", _annotated()
    assert is_annotation(path, 2)
    assert not is_annotation(Path("rows.csv"), 2)
    write_annotations(path, [one, replace(one, name="again")])
    project = json.loads(path.read_text(encoding="utf-8"))
    codes = {each["code"]: each["type"] for each in project["behaviors_conf"].values()}
    assert codes == dict.fromkeys(("done bow", "performed bow", "started bow"), "State event")
    assert set(project["observations"]) == {one.name, "again"}
    events = project["observations"]["again"]["events"]
    assert [time for time, *_ in events] == sorted(time for time, *_ in events)
    assert [time for time, person, code, *_ in events if (person, code) == ("ann", "done bow")] == [0.02, 0.15]


FIRST, SECOND = 2012, 2013


def _repeated(values: list[list[float]], counts: list[int]) -> list[float]:
    return [value for each, count in zip(values, counts, strict=True) for value in each * count]


# --- shares and rates --------------------------------------------------------------------------------------------


@settings(max_examples=8)
@given(st.integers(0, 2**32 - 1), st.sampled_from([50.0, 90.0]))
def test_a_percentile_is_drawn_by_units(seed: int, percent: float) -> None:
    """A percentile of drawn units is the percentile of all their values; a unit without values adds none."""
    generator = np.random.default_rng(seed)
    values = [generator.random(generator.integers(0, 3)).tolist() for _ in range(6)]
    figure = percentile(values, percent)
    exact = naive_score.percentile([each for unit in values for each in unit], percent)
    assert figure.value() == (None if exact is None else pytest.approx(exact))
    drawn = [naive_score.percentile(_repeated(values, counts), percent) for counts in naive_score.drawn_again(6, FIRST)]
    expected = naive_score.middle(drawn)
    assert figure.interval() == (expected and pytest.approx(expected))


@pytest.mark.parametrize("seed", range(3))
def test_a_roc_area_is_drawn_by_units(seed: int) -> None:
    """Both kinds are drawn again, each by itself, and every pair of values is compared; ties count half."""
    draw = np.random.default_rng(seed)
    kinds = [[(draw.integers(0, 6, draw.integers(0, 4)) + shift).astype(float) for _ in range(4)] for shift in (1, 0)]
    figure = roc_area(*kinds)
    higher, lower = ([each.tolist() for each in kind] for kind in kinds)
    flat = [[value for each in kind for value in each] for kind in (higher, lower)]
    assert figure.value() == pytest.approx(naive_score.roc_area(*flat))
    areas = [
        naive_score.roc_area(_repeated(higher, first), _repeated(lower, second))
        for first, second in zip(naive_score.drawn_again(4, FIRST), naive_score.drawn_again(4, SECOND), strict=True)
    ]
    assert figure.interval() == pytest.approx(naive_score.middle(areas))


@settings(max_examples=25)
@given(st.lists(st.tuples(st.sampled_from("abcd"), st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=12))
def test_a_ratio_is_drawn_by_units_or_persons(units: list[tuple[str, int, int]]) -> None:
    """It is the quotient of the sums over what is drawn; a person, drawn as persons alone would be, has all units."""
    persons, counted, among = zip(*units, strict=True)
    figure, everyone = ratio(counted, among, 60.0, persons=(persons,)), sorted(set(persons))
    assert figure.value() == (pytest.approx(60 * sum(counted) / sum(among)) if sum(among) else None)
    for by, of in ((False, [[each] for each in units]), (True, [[u for u in units if u[0] == p] for p in everyone])):
        sums = np.array([np.sum([each[1:] for each in own], axis=0) for own in of])
        drawn = [np.array(counts) @ sums for counts in naive_score.drawn_again(len(of), FIRST)]
        expected = naive_score.middle([60 * above / below if below else None for above, below in drawn])
        assert figure.interval(by_person=by) == (expected and pytest.approx(expected))


# --- nothing to take a figure of ---------------------------------------------------------------------------------


def test_of_nothing_there_is_no_figure() -> None:
    """Without units, or with empty ones, there is neither a figure nor an interval: None, not zero."""
    figures = [ratio([], []), ratio([0.0, 0.0], [0.0, 0.0]), percentile([[], []], 50)]
    figures += [roc_area([np.ones(3)], []), roc_area([np.zeros(0)], [np.ones(2)])]
    figures += [roc_area([np.ones(3)], [], persons=(["ann"], []))]
    for figure in figures:
        assert (figure.value(), figure.interval(by_person=bool(figure.persons))) == (None, None)


def _take(person: str, number: int, label: str = "") -> Take:
    """Make a take of half a second of each of two classes, or of one thing throughout."""
    clip = replace(stick_clip("wave", seed=number, frames=120, actor=person), class_name="", name=f"{person}{number}")
    if label:
        return Take(clip, (Segment(0.0, clip.duration, label),))
    first, second = STICK_CLASSES[number % 3], STICK_CLASSES[(number + 1) % 3]
    return Take(clip, (Segment(0.0, 0.5, first), Segment(0.5, 1.0, second)))


@pytest.fixture
def takes() -> list[Take]:
    """Give two takes each of ann and ben, one of cid."""
    return [_take(*each) for each in (("ann", 1), ("ann", 2), ("ben", 3), ("ben", 4), ("cid", 5))]


def _sources(asked: AskedTake) -> set[str]:
    """Name the takes that a library was cut from."""
    return {motion.take for motion in asked.library.motions}


def test_each_take_is_recognised_by_the_others(takes: list[Take]) -> None:
    """Leaving one take out its library is cut from all others, the same person's among them."""
    asked = asked_by(takes, Protocol.LEAVE_ONE_TAKE_OUT)
    everybody = {take.clip.name for take in takes}
    assert [each.take for each in asked] == takes
    assert [_sources(each) for each in asked] == [everybody - {take.clip.name} for take in takes]
    assert {each.person for each in asked} == {""}
    assert len(asked[0].library) == 8


@pytest.mark.parametrize("protocol", [Protocol.LEAVE_ONE_PERSON_OUT, Protocol.ONE_PERSON])
def test_no_library_has_motions_of_a_person_who_asks(takes: list[Take], protocol: Protocol) -> None:
    """Each person is recognised by all others together, or recognises all others: one library for all their takes."""
    own = {"ann": ["ann1", "ann2"], "ben": ["ben3", "ben4"], "cid": ["cid5"]}
    asked = asked_by(takes, protocol)
    assert [*dict.fromkeys(each.person for each in asked)] == [*own]
    for person, takes_of_person in own.items():
        of_person = [each for each in asked if each.person == person]
        others = [name for each in own if each != person for name in own[each]]
        asking, library = (others, takes_of_person) if protocol is Protocol.ONE_PERSON else (takes_of_person, others)
        assert [each.take.clip.name for each in of_person] == asking
        assert {id(each.library) for each in of_person} == {id(of_person[0].library)}
        assert _sources(of_person[0]) == {*library}
