"""What is said of a take: as live, by start events, and by the distance of whole motions alone."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from kinespace.library import MotionLibrary
from kinespace.library.recordings.formats.labels import Segment
from kinespace.library.windows.index import opened
from kinespace.stream import Settings
from kinespace.tools.evaluation.evaluate_done import by_distance, done_take, starts
from kinespace.tools.evaluation.harness import Asked
from kinespace.tools.evaluation.takes import Take

SQUAT, ARMS, DOWN = "squat1Reps", "rotateArmsBothBackward1Reps", "lieDownFloor"


@pytest.fixture(scope="module")
def asked() -> Asked:
    """Let three classes of four actors recognise a squat of another actor."""
    builtin = MotionLibrary.builtin()
    some = [each for each in builtin.motions if each.class_name in {SQUAT, ARMS, DOWN} and each.actor != "bd"]
    clip = next(each for each in builtin.motions if (each.class_name, each.actor) == (SQUAT, "bd"))
    take = Take(clip, (Segment(0.0, clip.duration, SQUAT),))
    return Asked(take, replace(builtin, motions=tuple(some), guests=()), "")


def test_a_take_is_judged_as_live(asked: Asked) -> None:
    """The squat is done once, its half is not; nothing is done where nothing is promised."""
    take = done_take(asked, Settings())
    assert [each.class_name for each in take.said] == [SQUAT]
    assert take.broken == [False]
    assert not done_take(asked, Settings(false_alarms=0.0)).said


def test_baselines_stand_in_its_place(asked: Asked) -> None:
    """A start comes before a motion's half; a larger distance lets more motions through, none lets none."""
    started = done_take(asked, Settings(), starts)
    assert [each.class_name for each in started.said] == [SQUAT]
    assert started.broken == [True]
    said = [len(done_take(asked, Settings(), partial(by_distance, most=most)).said) for most in (-0.01, 3.0, 1e3)]
    assert said == sorted(said)
    assert said[0] == 0 < said[1]


def test_a_distance_is_all_that_counts(asked: Asked) -> None:
    """By the distance alone the evidence is the negative logarithm of the nearest course's squared distance."""
    whole = opened(asked.library).whole
    alone = whole.by_distance(0.6)
    points, sizes = np.cumsum(np.random.default_rng(0).normal(size=(120, len(whole.spreads))), axis=0), np.ones(120)
    (judge, found), (judge_alone, found_alone) = whole.judging(points, sizes), alone.judging(points, sizes)
    judge(120.0)
    judge_alone(120.0)
    assert np.isfinite(found[0]).any()
    assert (np.isfinite(found[0]) == np.isfinite(found_alone[0])).all()
    np.testing.assert_array_equal(found[1:], found_alone[1:])
    assert alone.limit_at(6.0).tolist() == alone.limit_at(600.0).tolist() == [pytest.approx(-np.log(0.62))] * 3
    length, place = np.unravel_index(found_alone[0].argmax(), found_alone[0].shape)
    window = points[-whole.lengths[length] :]
    window = window - window.mean(axis=0)
    count = len(window)
    cosines = np.cos(np.pi * np.arange(1, 8)[:, None] * (np.arange(count) + 0.5) / count)
    numbers = (cosines @ window).ravel()
    vector = whole.metric.place(numbers / np.linalg.norm(numbers))
    own = slice(*whole.ranges[length, place])
    nearest = np.square(whole.courses[:, own].T - vector).sum(axis=1).min()
    assert found_alone[0, length, place] == pytest.approx(-np.log(nearest + 0.02), abs=1e-3)
