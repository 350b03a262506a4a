"""How streams are scored: each figure of a course with known answers, and of random courses against a naive count."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import naive_score
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive_score import Moment
from synthetic import stick_clip

from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream.recognition import Event, EventKind, Outcome, Recognition
from kinespace.tools.evaluation.harness import Take
from kinespace.tools.evaluation.stream_score import LASTING, NONE, Course, course_of, score_courses

CLASSES = ("bow", "jump", "wave")
BOW, JUMP, WAVE = range(3)
#: Eight frames a second, whose times are whole in binary.
RATE = 8
TIMES = np.arange(64) / RATE
SECONDS = 7.875
SEGMENTS = (Segment(0, 2, "bow"), Segment(2.5, 5, "jump"), Segment(5, 7.5, "juggle"), Segment(7.5, 9, "wave"))
#: From when on which class is the guess, is published, has its event.
GUESSES = {0.5: BOW, 0.625: WAVE, 0.875: BOW, 2.75: JUMP, 3.5: BOW, 3.625: JUMP, 5.25: WAVE, 7.5: BOW}
HELD_BACK = ((4.0, 4.5), (6.0, 6.5), (7.0, 8.0))
EVENTS = {1.0: BOW, 3.0: JUMP, 6.625: WAVE}
SCORES = {0.5: 0.9, 2.5: 0.8, 6.75: 0.95}


def _held(values: Mapping[float, float], before: float, times: np.ndarray = TIMES) -> np.ndarray:
    """Lay out values that each hold until the next."""
    return np.array([([before] + [value for since, value in values.items() if since <= time])[-1] for time in times])


def _segment(times: np.ndarray, segments: Sequence[Segment]) -> np.ndarray:
    inside = [[index for index, each in enumerate(segments) if each.start <= time < each.end] for time in times]
    return np.array([found[0] if found else -1 for found in inside])


def _course() -> Course:
    """Write a course by hand."""
    segment = _segment(TIMES, SEGMENTS)
    guess = _held(GUESSES, NONE)
    published = guess.copy()
    for begin, end in HELD_BACK:
        published[(begin <= TIMES) & (end > TIMES)] = NONE
    return Course(
        name="take",
        times=TIMES,
        segments=SEGMENTS,
        truth=np.array([BOW, JUMP, NONE, WAVE, NONE])[segment],
        segment=segment,
        guess=guess,
        published=published,
        event=_held(EVENTS, NONE),
        score=_held(SCORES, np.nan),
    )


#: Counted with paper and pencil.
KNOWN_ANSWERS = {
    "frame_accuracy": (10 + 17 + 0) / 40,
    "segment_accuracy": (8 + 11) / 20,
    "known_answered": (8 + 8) / 20,
    "segments_found": 2 / 3,
    "median_delay_s": (0.875 + 0.25) / 2,
    "p90_delay_s": 0.25 + 0.9 * 0.625,
    "median_seen": (0.875 / 2 + 0.25 / 2.5) / 2,
    "median_event_delay_s": 0.5,
    "false_per_minute": 2 * 60 / (20 / RATE),
    "unknown_answered": 12 / 20,
    "changes_per_minute": 2 * 60 / SECONDS,
    "true_changes_per_minute": 4 * 60 / SECONDS,
    "auc_unknown": 0.35,
    "doubted": 0.0,
    "unlike": None,
    "segment_majority": 2 / 3,
    "false_starts_per_minute": 60 / (20 / RATE),
    "takes_found": None,
}


def _figures(courses: Sequence[Course], window: float = 1.0) -> dict[str, float | None]:
    return score_courses(courses, CLASSES, window).values


# --- a course with known answers ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", KNOWN_ANSWERS)
def test_a_course_counted_by_hand(name: str) -> None:
    """Each figure of a take of eight seconds equals one counted by hand."""
    assert _figures([_course()])[name] == (KNOWN_ANSWERS[name] and pytest.approx(KNOWN_ANSWERS[name], rel=1e-12))


def test_classes_counted_by_hand() -> None:
    """Each class has its seconds, the share guessed right, and of that the share with the last second inside."""
    expected = {"bow": (16, 10 / 16, 1.0), "jump": (20, 17 / 20, 11 / 12), "wave": (4, 0.0, 0.0)}
    scores = score_courses([_course()], CLASSES, 1.0).classes
    assert list(scores) == list(CLASSES)
    for name, (frames, right, right_inside) in expected.items():
        exact = {"seconds": frames / RATE, "right": right, "right_inside": right_inside}
        assert scores[name] == pytest.approx(exact)


# --- bases of the figures ---------------------------------------------------------------------------------------


def _basis(seconds: float, segments: int, persons: int | None) -> dict[str, object]:
    return {"seconds": pytest.approx(seconds), "segments": segments, "persons": persons}


def test_a_class_is_found_that_is_named_at_some_time() -> None:
    """Of the classes that takes contain the share counts that was named, if only once; guesses do not count."""
    still = np.full(64, NONE)
    once = still.copy()
    once[40] = WAVE
    empty = replace(_course(), segments=(), segment=still, truth=still, guess=np.full(64, BOW))
    takes = [
        replace(empty, name="one", published=once, contains=(WAVE, BOW), person="ann"),
        replace(empty, name="two", published=still, contains=(WAVE,), person="ann"),
        replace(empty, name="three", published=once),
    ]
    score = score_courses(takes, CLASSES, 1.0)
    assert score.values["takes_found"] == pytest.approx(1 / 3)
    assert score.containing == _basis(2 * SECONDS, 2, 1)
    assert (score.known["segments"], score.unknown["segments"]) == (0, 0)
    assert score.values["frame_accuracy"] is None


# --- against the twin --------------------------------------------------------------------------------------------


def _random_course(generator: np.random.Generator, frames: int, most_apart: int = 1) -> Course:
    """Make a course whose frames are a thirtieth of a second apart, or up to so many."""
    times = np.cumsum(generator.integers(1, most_apart + 1, frames)) / 30
    edges = np.sort(generator.choice(times, size=12, replace=False)) + 0.01 * (most_apart - 1)
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
    return Course(
        "random",
        times,
        segments,
        truth,
        segment,
        flickering(0.7),
        flickering(0.6),
        flickering(0.8),
        score,
    )


def _moments(course: Course) -> list[Moment]:
    untils = [*course.times[1:].tolist(), course.times[-1] + course.seconds / (len(course.times) - 1)]
    tracks = (course.times, course.segment, course.truth, course.guess, course.published, course.event, course.score)
    moments = list[Moment]()
    for until, time, place, *answered in zip(untils, *(track.tolist() for track in tracks), strict=True):
        segment = course.segments[place]
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
def test_any_course_is_scored_as_a_walk_through_its_moments(
    seed: int, takes: int, window: float, most_apart: int
) -> None:
    """Every figure of random courses is the one that walking through them moment by moment gives."""
    generator = np.random.default_rng(seed)
    courses = [_random_course(generator, int(generator.integers(100, 400)), most_apart) for _ in range(takes)]
    exact = naive_score.stream_score([_moments(course) for course in courses], window, LASTING)
    figures = _figures(courses, window)
    assert figures.keys() == exact.keys()
    for name, value in exact.items():
        assert figures[name] == (None if value is None else pytest.approx(value, rel=1e-9)), name


# --- answers over time --------------------------------------------------------------------------------------------


def _recognition(time: float, best: int, score: float, outcome: Outcome = Outcome.NAMED) -> Recognition:
    scores = np.full(3, 0.01)
    scores[best] = score
    return Recognition(
        performer="p", time=time, outcome=outcome, classes=CLASSES, scores=scores, guess=best, movement=0.1
    )


def test_a_course_holds_each_answer_until_the_next() -> None:
    """Answers of hops and events hold from their time until the next, at every frame."""
    changes = sorted({*GUESSES, *SCORES, *(edge for stretch in HELD_BACK for edge in stretch)} - {2.5, 8.0})
    hand = _course()
    recognitions = [
        _recognition(
            time,
            hand.guess[round(time * RATE)],
            hand.score[round(time * RATE)],
            Outcome.NAMED if hand.published[round(time * RATE)] >= 0 else Outcome.UNKNOWN,
        )
        for time in [*changes, 2.5]
    ]
    recognitions.sort(key=lambda each: each.time)
    events = [Event("p", EventKind.START, "bow", BOW, 0.9, 1.0)]
    for time, index in list(EVENTS.items())[1:]:
        events.append(Event("p", EventKind.END, events[-1].label, events[-1].index, 0.9, time))
        events.append(Event("p", EventKind.START, CLASSES[index], index, 0.9, time))
    recognitions[0] = replace(recognitions[0], events=tuple(events))
    course = _laid_out(recognitions)
    assert course.answers is recognitions
    for name in Course.__dataclass_fields__.keys() - {"answers"}:
        assert np.array_equal(getattr(course, name), getattr(hand, name), equal_nan=name == "score"), name


def _laid_out(
    recognitions: Sequence[Recognition], known: Sequence[str] = CLASSES, segments: Sequence[Segment] = SEGMENTS
) -> Course:
    clip = replace(stick_clip("bow", frames=len(TIMES)), name="take", actor="")
    take = Take(clip, tuple(segments), contains=() if segments else ("wave", "bow"))
    return course_of(take, TIMES, recognitions, classes=CLASSES, known=known)


def test_still_is_no_guess_and_unknown_is_one() -> None:
    """A still body has no guess; an unknown motion has a guess that is not named; an implausible one is doubted."""
    outcomes = (Outcome.STILL, Outcome.UNKNOWN, Outcome.IMPLAUSIBLE)
    course = _laid_out(
        [_recognition(time, BOW, 0.9, each) for time, each in zip((1.0, 2.0, 6.0), outcomes, strict=True)]
    )
    assert set(course.guess[:16]) == {NONE}
    assert set(course.guess[16:48]) == {BOW}
    assert set(course.published) == {NONE}
    assert course.doubted == 0.25


def test_classes_that_the_library_lacks_are_unknown() -> None:
    """A class of another take's library that this one's does not know is unknown here, in a segment or in a take."""
    course = _laid_out([], known=("bow", "wave"))
    assert set(course.truth[course.segment == 1]) == {NONE}
    assert set(course.truth[course.segment == 3]) == {WAVE}
    course = _laid_out([_recognition(1.0, BOW, 0.9)], known=("bow",), segments=())
    assert set(course.segment) == set(course.truth) == {NONE}
    assert (course.contains, course.seconds) == ((BOW,), SECONDS)
    assert set(course.published[8:]) == {BOW}
