from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.library import MotionLibrary, distance_rows
from kinespace.library.motion_library import NOTHING
from kinespace.library.windows.index import WindowIndex
from kinespace.library.windows.paper import PaperIndex
from kinespace.library.windows.rejection import MAX_LEAD
from kinespace.stream.recognition import Outcome
from kinespace.stream.recognizer.decision import followed, usual_sensitivity
from kinespace.stream.recognizer.hysteresis import PER_SECOND, Hysteresis
from kinespace.stream.recognizer.matcher import Matcher, PaperMatcher, Reading, WindowMatcher

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library.clip import Clip

#: Seconds of one hop, of which thirty make a second.
HOP = 1 / PER_SECOND


@pytest.fixture(scope="module")
def stranger(builtin: MotionLibrary) -> dict[str, Clip]:
    """Give a motion of each class by a person whom the small library does not know."""
    return {clip.class_name: clip for clip in reversed(builtin.motions) if clip.actor == "bk"}


@pytest.fixture(scope="module")
def both_ways(small_library: MotionLibrary) -> WindowIndex:
    """Give an index in which motions of lying down, played backwards, are a class of getting up."""
    down = [clip for clip in small_library.motions if clip.class_name == "lieDownFloor"]
    return WindowIndex.of(replace(small_library, motions=(*down, *(_reversed(clip) for clip in down))))


@pytest.fixture(scope="module")
def paper(small_library: MotionLibrary) -> PaperIndex:
    """Give the small library's eigenvectors over a second."""
    return PaperIndex.of(small_library, 1.0)


def _reversed(clip: Clip) -> Clip:
    return replace(clip, positions=clip.positions[::-1], class_name="getUpFloor")


def _windows(index: WindowIndex, *, stillness: float = 0.0, sensitivity: float = 0.1) -> WindowMatcher:
    return WindowMatcher(index, stillness=stillness, sensitivity=sensitivity)


def _readings(matcher: Matcher, clip: Clip) -> list[Reading]:
    """Push a motion frame by frame, and read after every second one."""
    rows, readings = distance_rows(clip.positions, clip.skeleton), list[Reading | None]()
    for frame, time in enumerate(clip.times.tolist()):
        matcher.push([time], rows[frame : frame + 1])
        if frame % 2:
            readings.append(matcher.read())
    return [reading for reading in readings if reading is not None]


def _most(readings: Sequence[Reading]) -> int:
    """Give the index that was guessed most often."""
    return int(np.bincount([reading.guess for reading in readings]).argmax())


@pytest.mark.parametrize("class_name", ["kickLFront1Reps", "lieDownFloor", "squat1Reps"])
def test_a_motion_of_another_person_is_guessed(
    small_index: WindowIndex, stranger: dict[str, Clip], class_name: str
) -> None:
    """The class that is guessed for most of the time is the motion's."""
    readings = _readings(_windows(small_index), stranger[class_name])
    assert small_index.classes[_most(readings)] == class_name


def test_a_reading(small_index: WindowIndex, stranger: dict[str, Clip]) -> None:
    """Its numbers fit together."""
    for reading in _readings(_windows(small_index), stranger["squat1Reps"]):
        others = np.delete(reading.distances, reading.guess)
        assert reading.lead == pytest.approx(others.min() - reading.distances[reading.guess])
        assert 0 <= reading.share <= 1
        assert 0 <= reading.gap <= 1
        assert 0 <= reading.eigenvector_score <= 1 + 1e-6
        assert reading.evidence is not None
        assert all(-MAX_LEAD <= lead <= MAX_LEAD for lead in reading.evidence.leads)
        assert len(reading.evidence.distances) == len(small_index.comparison.weighing.groups)


def test_nothing_is_read_before_the_first_window(small_index: WindowIndex, stranger: dict[str, Clip]) -> None:
    """0.15 seconds of at least three frames must have come."""
    clip, matcher = stranger["squat1Reps"], _windows(small_index)
    rows = distance_rows(clip.positions, clip.skeleton)
    matcher.push([0.0, 0.1], rows[:2])
    assert matcher.read() is None
    matcher.push([0.14], rows[2:3])
    assert matcher.read() is None
    matcher.push([0.15], rows[3:4])
    assert matcher.read() is not None
    matcher.clear()
    matcher.push([5.0, 6.0], rows[:2])
    assert matcher.read() is None


def test_a_cleared_matcher_reads_as_a_new_one(small_index: WindowIndex, stranger: dict[str, Clip]) -> None:
    """After clearing, the motion before has no influence."""
    used, new = _windows(small_index), _windows(small_index)
    _readings(used, stranger["kickLFront1Reps"])
    used.clear()
    for one, other in zip(*(_readings(each, stranger["squat1Reps"]) for each in (used, new)), strict=True):
        assert np.allclose(one.distances, other.distances, atol=1e-5)
        assert (one.guess, one.outcome) == (other.guess, other.outcome)


def test_motions_and_their_reverse_are_told_apart(both_ways: WindowIndex, stranger: dict[str, Clip]) -> None:
    """A second class is the first one played backwards: covariances are the same, the trend is not."""
    down = stranger["lieDownFloor"]
    assert both_ways.classes == ("getUpFloor", "lieDownFloor")
    guesses = [both_ways.classes[_most(_readings(_windows(both_ways), clip))] for clip in (down, _reversed(down))]
    assert guesses == ["lieDownFloor", "getUpFloor"]


def test_eigenvectors_do_not_tell_a_motion_from_its_reverse(both_ways: WindowIndex, stranger: dict[str, Clip]) -> None:
    """A whole motion has one leading eigenvector, forwards and backwards."""
    down = stranger["lieDownFloor"]
    short = replace(down, positions=down.positions[:118])
    forwards, backwards = (
        _readings(_windows(both_ways), clip)[-1].eigenvector_score for clip in (short, _reversed(short))
    )
    assert forwards == pytest.approx(backwards, abs=1e-3)


def test_nothing_is_answered_unknown(small_library: MotionLibrary, stranger: dict[str, Clip]) -> None:
    """Motions like those of the class `nothing` have it as their guess, and are answered unknown."""
    index = WindowIndex.of(small_library.renamed({"squat1Reps": NOTHING}))
    readings = _readings(_windows(index, sensitivity=0.4), stranger["squat1Reps"])
    of_nothing = [reading for reading in readings if index.classes[reading.guess] == NOTHING]
    assert len(of_nothing) > len(readings) / 2
    assert {reading.outcome for reading in of_nothing} == {Outcome.UNKNOWN}


def test_with_more_sensitivity_more_is_named(builtin_index: WindowIndex, stranger: dict[str, Clip]) -> None:
    """The threshold falls."""
    clip = stranger["throwBasketball"]
    few, many = (
        sum(
            reading.outcome is Outcome.NAMED
            for reading in _readings(_windows(builtin_index, sensitivity=sensitivity), clip)
        )
        for sensitivity in (0.01, 0.4)
    )
    assert few <= many
    assert many > 0


def test_a_body_that_does_not_move_is_still(small_index: WindowIndex, stranger: dict[str, Clip]) -> None:
    """One posture held for a second is still, even if it is near to a motion."""
    clip = stranger["squat1Reps"]
    held = clip.moved_to(np.repeat(clip.positions[:1], 60, axis=0))
    readings = _readings(_windows(small_index, stillness=0.01), held)
    assert {reading.outcome for reading in readings} == {Outcome.STILL}
    assert all(np.isfinite(reading.distances).all() for reading in readings)


def test_the_first_class_is_followed_at_once() -> None:
    """The first guess needs no lead."""
    assert followed(Hysteresis(9.0), np.array([3.0, 1.0, 1.5]), HOP) == (1, 0.5)


def test_a_guess_is_held_until_another_has_gathered_a_lead() -> None:
    """While it is held its lead is below 0."""
    hysteresis = Hysteresis(1.0 - 1e-9)
    followed(hysteresis, np.array([0.0, 2.0]), HOP)
    behind = np.array([1.0, 0.5])
    assert [followed(hysteresis, behind, HOP) for _ in range(3)] == [(0, -0.5), (1, 0.5), (1, 0.5)]


def test_the_only_class_leads_without_bound() -> None:
    """It has no other to lead."""
    assert followed(Hysteresis(1.0), np.array([0.7]), HOP) == (0, np.inf)


def test_the_papers_signature_guesses(paper: PaperIndex, stranger: dict[str, Clip]) -> None:
    """By the leading eigenvector alone a kick and a squat of another person are guessed."""
    for class_name in ("kickLFront1Reps", "squat1Reps"):
        readings = _readings(PaperMatcher(paper, stillness=0.0, smallest_gap=0.0), stranger[class_name])
        assert paper.classes[_most(readings)] == class_name
        for reading in readings:
            assert reading.eigenvector_score == pytest.approx(paper_score(reading), abs=1e-6)


def paper_score(reading: Reading) -> float:
    """Find the best |inner product| again in the distances, log(1 + 0.001 − its square)."""
    return float(np.sqrt(1.001 - np.exp(reading.distances.min())))


@pytest.mark.parametrize(
    ("stillness", "smallest_gap", "outcome"),
    [(0.0, 0.0, Outcome.NAMED), (0.0, 1.1, Outcome.AMBIGUOUS), (1e9, 1.1, Outcome.STILL)],
)
def test_reasons_why_the_papers_signature_names_no_class(
    paper: PaperIndex, stranger: dict[str, Clip], stillness: float, smallest_gap: float, outcome: Outcome
) -> None:
    """Nearly equal eigenvalues make the eigenvector arbitrary, and a still body has none."""
    matcher = PaperMatcher(paper, stillness=stillness, smallest_gap=smallest_gap)
    assert {reading.outcome for reading in _readings(matcher, stranger["kickLFront1Reps"])} == {outcome}


def test_the_papers_signature_answers_nothing_unknown(small_library: MotionLibrary, stranger: dict[str, Clip]) -> None:
    """As the default signature does."""
    index = PaperIndex.of(small_library.renamed({"squat1Reps": NOTHING}), 1.0)
    readings = _readings(PaperMatcher(index, stillness=0.0, smallest_gap=0.0), stranger["squat1Reps"])
    of_nothing = {reading.outcome for reading in readings if index.classes[reading.guess] == NOTHING}
    assert of_nothing == {Outcome.UNKNOWN}


def test_with_fewer_joints_less_is_named(small_index: WindowIndex) -> None:
    """The matcher of fewer joints asks for as much evidence as a matcher with three fifths of the sensitivity."""
    for sensitivity in (None, 0.1):
        whole = WindowMatcher(small_index, stillness=0.0, sensitivity=sensitivity)
        fewer, own = (
            whole.over(small_index),
            WindowMatcher(
                small_index, stillness=0.0, sensitivity=0.6 * (sensitivity or usual_sensitivity(small_index.library))
            ),
        )
        clip = small_index.library.motions[0]
        told = [[each.outcome for each in _readings(matcher, clip)] for matcher in (fewer, own)]
        assert told[0] == told[1]


def test_a_library_of_one_motion_does_not_name_all_others(builtin: MotionLibrary) -> None:
    """The only class is named in its own person's next motion, and not in that person's other motions."""
    squats = [clip for clip in builtin.motions if (clip.class_name, clip.actor) == ("squat1Reps", "mm")]
    others = [clip for clip in builtin.motions if clip.actor == "mm" and clip.class_name != "squat1Reps"][::10]
    index = WindowIndex.of(MotionLibrary.of_clips(squats[:1]))
    named = [
        sum(
            each.outcome is Outcome.NAMED
            for each in _readings(WindowMatcher(index, stillness=0.02, sensitivity=None), clip)
        )
        for clip in (squats[1], *others)
    ]
    assert named[0] > 10
    assert sum(named[1:]) <= 5
