"""Whole motions: cut, compared and judged by definition."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from naive_done import COURSE, SPREAD, course_of, fits, size_of, spread_of
from synthetic import stick_clip

from kinespace.library import NOTHING, MotionLibrary
from kinespace.library.progress.phase_table import points_of
from kinespace.library.windows import whole_motions
from kinespace.library.windows.index import WindowIndex, opened
from kinespace.library.windows.whole_motions import WEIGHTS, WholeMotions, without_course

SQUAT, JOG, GRAB = "squat1Reps", "jogLeftCircle4StepsRstart", "grabHighR"


@pytest.fixture(scope="module")
def index() -> WindowIndex:
    """Open three classes of HDM05 by four actors."""
    builtin = MotionLibrary.builtin()
    some = [each for each in builtin.motions if each.class_name in {SQUAT, JOG, GRAB} and each.actor != "bd"]
    return opened(replace(builtin, motions=tuple(some), guests=()))


def nearest_by_definition(whole: WholeMotions, points: np.ndarray, window: int) -> dict[str, tuple[float, float, int]]:
    """Give each class's squared distances of the nearest course and spread, and the motion of the course."""
    some, found = points[-window:], dict[str, tuple[float, float, int]]()
    vector = (course_of(some) - whole.metric.origin) @ whole.metric.axes
    for place, name in enumerate(whole.classes):
        own = [k for k in range(whole.starts[place], whole.starts[place + 1]) if fits(window, float(whole.facts[0, k]))]
        if own:
            away = {k: float(np.sum((whole.courses[:, k] - vector) ** 2)) for k in own}
            apart = min(float(np.sum((whole.spreads[:, k] - spread_of(some)) ** 2)) for k in own)
            nearest = min(own, key=away.__getitem__)
            found[name] = away[nearest], apart, nearest
    return found


def test_a_motion_that_comes_to_others_is_cut_alone(index: WindowIndex, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was cut from the motions before is kept, in the same basis; the same comes out as of all at once."""
    assert len(index.whole.classes) == 3
    cut, points = list[str](), whole_motions.points_of
    monkeypatch.setattr(whole_motions, "points_of", lambda clip, *of: cut.append(clip.class_name) or points(clip, *of))
    added = replace(index.library.motions[0], class_name="mine", actor="ann")
    more = index.with_motions([added])
    whole = more.whole
    assert cut == ["mine"]
    copies = [replace(each) for each in more.library.motions]
    anew = WholeMotions.of(copies, copies, index.body, index.basis)
    assert len(cut) == len(copies) + 1
    assert whole.classes == anew.classes
    # An axis of the metric may point either way.
    for one, other in ((whole.courses, anew.courses), (whole.spreads, anew.spreads), (whole.raised, anew.raised)):
        np.testing.assert_allclose(np.abs(one), np.abs(other), rtol=1e-4, atol=1e-5)


@pytest.mark.slow
def test_evidence_by_definition(index: WindowIndex) -> None:
    """Evidence for each class and length at every ninth look of four squats, as its definition says.

    Speed and amplitude are relative to the nearest course, and cost evidence whichever way they differ. Windows longer
    than what was seen are not compared.
    """
    squats = [each for each in MotionLibrary.builtin().motions if (each.class_name, each.actor) == (SQUAT, "bd")]
    past = np.vstack([points_of(each, index.body, index.basis) for each in squats[:4]])
    whole, compared = index.whole, 0
    sizes = np.full(len(past), 1.25)
    judge, found = whole.judging(past, sizes)
    for end in range(8, len(past) + 1, 9):
        judge(end)
        points = past[max(end - whole.lengths[-1], 0) : end] / 1.25
        lengths = [window for window in whole.lengths if window <= end]
        nearest = [nearest_by_definition(whole, points, window) for window in lengths]
        best = {
            name: min((math.log(each[name][1] + SPREAD) for each in nearest if name in each), default=math.inf)
            for name in whole.classes
        }
        assert (found[0, len(lengths) :] == -math.inf).all()
        for (length, each), (place, name) in itertools.product(enumerate(nearest), enumerate(whole.classes)):
            if name not in each:
                assert found[0, length, place] == -math.inf
                continue
            away, apart = math.log(each[name][0] + COURSE), math.log(each[name][1] + SPREAD)
            lead = min(best[other] for other in whole.classes if other != name) - apart
            log_speed = float(whole.facts[0, each[name][2]]) - math.log((lengths[length] - 1) / 15)
            larger = size_of(points[-lengths[length] :]) - float(whole.facts[1, each[name][2]])
            expected = WEIGHTS.offset + WEIGHTS.course * away + WEIGHTS.spread * apart
            expected += WEIGHTS.lead * min(max(lead, -2.0), 2.0)
            expected += WEIGHTS.speed * abs(log_speed) + WEIGHTS.amplitude * min(abs(larger), 2.0)
            judged = whole.judged(found, length, place)
            assert judged.evidence == pytest.approx(expected, abs=5e-3)
            assert (judged.speed, judged.amplitude) == pytest.approx((math.exp(log_speed), math.exp(larger)), rel=2e-3)
            compared += 1
    assert compared > 100


def test_motions_are_cut_into_rounds_and_trimmed(index: WindowIndex) -> None:
    """Jogs become rounds of two steps; a squat stays whole, without the stillness before and behind it."""
    jogs = index.whole.starts[index.whole.classes.index(JOG) :][:2]
    seconds = np.exp(index.whole.facts[0, jogs[0] : jogs[1]])
    assert len(seconds) > sum(each.class_name == JOG for each in index.library.motions)
    assert np.median(seconds) == pytest.approx(0.85, abs=0.1)
    clip = next(each for each in index.library.motions if each.class_name == SQUAT)
    still = [np.repeat(clip.positions[place : place + 1], 60, axis=0) for place in (0, -1)]
    longer = clip.moved_to(np.concatenate([still[0], clip.positions, still[1]]))
    two = WholeMotions.of([clip, longer], [clip, longer], index.body, index.basis)
    assert np.ptp(np.exp(two.facts[0, :2])) <= 0.14
    assert np.exp(two.facts[0, :2]).max() <= clip.duration + 0.1


def test_classes_without_a_course_are_named() -> None:
    """A motion that is too short, or is one posture, has none; a library without any finds nothing."""
    bow = stick_clip("bow", frames=121, rate=60.0)
    short = replace(stick_clip("wave", frames=20, rate=60.0), class_name="short")
    shaken = np.random.default_rng(0).normal(scale=1e-3, size=bow.positions.shape)
    held = replace(bow.moved_to(bow.positions[:1] + shaken), class_name="held")
    index = WindowIndex.of(MotionLibrary.of_clips([bow, short, held]))
    assert index.whole.classes == ("bow",)
    assert without_course([bow, short, held, replace(short, class_name=NOTHING)]) == ["held", "short"]
    none = WholeMotions.of([short], [short], index.body, index.basis)
    assert (none.classes, none.lengths) == ((), ())


def test_nothing_is_cut_everywhere(index: WindowIndex) -> None:
    """An example of nothing may be resembled by any of its parts that is as long as a window; alone it has no part."""
    squat = next(each for each in index.library.motions if each.class_name == SQUAT)
    long = replace(squat, positions=np.concatenate([squat.positions] * 5), class_name=NOTHING)
    short = replace(squat, positions=squat.positions[: squat.frames // 2], class_name=NOTHING)
    whole, alone = (
        WholeMotions.of(motions, motions, index.body, index.basis) for motions in ([long, squat, short], [long])
    )
    assert whole.classes == (NOTHING, SQUAT)
    parts, one = np.exp(whole.facts[0, : whole.starts[1]]), math.exp(whole.facts[0, whole.starts[1]])
    assert len(parts) > 20
    assert min(parts) == pytest.approx(short.duration, abs=0.1)
    assert max(parts) <= 1.3 * one + 0.1
    assert sum(parts < 0.75 * one - 0.1) == 1
    assert np.isnan(whole.crossed[: len(parts)]).all()
    assert (alone.classes, alone.lengths) == ((), ())


def test_a_lower_promise_needs_more_evidence(index: WindowIndex) -> None:
    """The fewer false alarms are accepted, the higher the limits, and the more motions are missed."""
    promises = 0.1, 1, 3, 6, 60, 600, 1e4
    limits = np.array([index.whole.limit_at(each) for each in promises])
    assert limits.shape == (len(promises), 3)
    assert (np.diff(limits, axis=0) <= 0).all()
    assert limits[0].tolist() == limits[1].tolist() > limits[2].tolist()
    missed = [index.whole.missed_at(each) for each in promises]
    assert missed == sorted(missed, reverse=True)
    assert 0 <= missed[-2] < missed[1] < 1


def test_limits_are_higher_where_classes_are_alike(index: WindowIndex) -> None:
    """A class that another one resembles needs more evidence, `nothing` as little as any; a class alone is usual."""
    clips = [each for each in index.library.motions if each.class_name == SQUAT]
    jogs = [each for each in index.library.motions if each.class_name == JOG]
    names = {"sit": clips[::2], "squat": clips[1::2], NOTHING: jogs[:1], JOG: jogs[1:]}
    alike = [replace(clip, class_name=name) for name, own in names.items() for clip in own]
    several, one = (WholeMotions.of(each, each, index.body, index.basis) for each in (alike, clips))
    raised = dict(zip(several.classes, several.raised, strict=True))
    assert raised["sit"] == raised["squat"] == 2.0
    assert raised[NOTHING] == raised[JOG] < 1.0
    assert one.raised.tolist() == [0.0]
    assert math.isnan(one.missed_at(6.0))
    assert (several.limit_at(6.0) - one.limit_at(6.0)).tolist() == several.raised.tolist()


def test_motions_are_missed_by_definition(index: WindowIndex) -> None:
    """Of the library's own motions those are missed which are not near enough to another person's."""
    whole = index.whole
    of_class = np.repeat(np.arange(3), np.diff(whole.starts))
    # As if each were guessed and named all the time.
    limits = whole.limit_at(60.0) - 3.0
    missed = [bool(own < limits[place]) for own, place in zip(whole.crossed, of_class, strict=True)]
    assert whole.missed_at(60.0) == pytest.approx(sum(missed) / len(missed))
    people = {name: [] for name in whole.classes}
    for place in range(0, len(of_class), 7):
        people[whole.classes[of_class[place]]].append(whole.crossed[place])
    assert all(len(each) > 2 and max(each) > 1.65 for each in people.values())


def test_only_motions_with_windows_are_found(index: WindowIndex) -> None:
    """A class whose windows are left out is not said to be done: answers do not know it."""
    jogs = [place for place, motion in enumerate(index.library.motions) if motion.class_name == JOG]
    assert index.whole.classes == (GRAB, JOG, SQUAT)
    assert index.without(jogs).whole.classes == (GRAB, SQUAT)
