"""The spread of a motion and its metric: against loops and dense matrices, and its invariances."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import naive_retrieval
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import STICK_CLASSES, stick_clip, stick_clips

from kinespace.library import MotionLibrary
from kinespace.library.distances import distance_rows
from kinespace.tools.evaluation.retrieval.experiment import motion_spreads, turned
from kinespace.tools.evaluation.retrieval.spread import FLOOR, SpreadMetric, spread_of

if TYPE_CHECKING:
    from kinespace.library.clip import Clip


@pytest.fixture(scope="module")
def some_motions() -> tuple[Clip, ...]:
    """Give a motion of each of the built-in library's classes."""
    return tuple({motion.class_name: motion for motion in MotionLibrary.builtin().motions}.values())


def _random(seed: int, motions: int = 12, pairs: int = 20) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    classes = np.array([STICK_CLASSES[index % 3] for index in range(motions)])
    return generator.normal(size=(motions, pairs)) * generator.uniform(0.1, 2.0, pairs), classes


# --- the spread --------------------------------------------------------------------------------------------------


def test_spreads_equal_the_loops(some_motions: tuple[Clip, ...]) -> None:
    """A motion's spread is the logarithm of each deviation over the body's size, plus the floor, less their mean."""
    for clip, spread in zip(some_motions, motion_spreads(some_motions), strict=True):
        columns = distance_rows(clip.positions, clip.skeleton).T.tolist()
        size = math.sqrt(naive_retrieval.mean([naive_retrieval.mean(column) ** 2 for column in columns]))
        logs = [math.log(naive_retrieval.deviation(column) / size + FLOOR) for column in columns]
        expected = [log - naive_retrieval.mean(logs) for log in logs]
        np.testing.assert_allclose(spread, expected, atol=1e-9)


def test_spreads_do_not_depend_on_size_place_and_handedness(some_motions: tuple[Clip, ...]) -> None:
    """The motion turned, mirrored and performed by a body half as large again has the same spread."""
    generator = np.random.default_rng(7)
    moved = [turned(clip.moved_to(clip.positions * [1.5, 1.5, -1.5]), generator) for clip in some_motions]
    np.testing.assert_allclose(motion_spreads(moved), motion_spreads(some_motions), atol=1e-6)


def test_a_larger_motion_has_nearly_the_same_spread() -> None:
    """Distances that swing twice as far change a spread far less than another class does; they sum to 0 in both."""
    rows = distance_rows(stick_clip("wave").positions, stick_clip("wave").skeleton)
    larger = rows.mean(axis=0) + 2 * (rows - rows.mean(axis=0))
    spread, doubled = (spread_of(each) for each in (rows, larger))
    (other,) = motion_spreads([stick_clip("bow")])
    assert spread.sum() == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.norm(doubled - spread) < 0.05 * np.linalg.norm(other - spread)


# --- the metric --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shrinkage", [0.01, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("pairs", [3, 20])
def test_the_metric_equals_the_inverted_scatter(shrinkage: float, pairs: int) -> None:
    """Squared distances equal those by the within-class scatter, shrunk and inverted, for few pairs and many."""
    spreads, classes = _random(1, pairs=pairs)
    others = np.random.default_rng(2).normal(size=(5, pairs))
    matrix = naive_retrieval.within_class_metric(spreads, classes.tolist(), shrinkage)
    found = SpreadMetric.learned(spreads, classes, shrinkage).squared_distances(others, spreads)
    expected = [[(a - b) @ matrix @ (a - b) for b in spreads] for a in others]
    np.testing.assert_allclose(found, expected, rtol=1e-8)


def test_classes_of_different_sizes_weigh_the_same() -> None:
    """A class of which every motion is there twice teaches the same."""
    spreads, classes = _random(3)
    twice = np.concatenate([np.arange(len(classes)), np.flatnonzero(classes == "bow")])
    plain = SpreadMetric.learned(spreads, classes).squared_distances(spreads, spreads)
    doubled = SpreadMetric.learned(spreads[twice], classes[twice]).squared_distances(spreads, spreads)
    np.testing.assert_allclose(doubled, plain, rtol=1e-8, atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_no_motion_is_nearer_than_itself(seed: int) -> None:
    """Distances are never below 0, about 0 from a motion to itself, and the same both ways."""
    spreads, classes = _random(seed)
    squared = SpreadMetric.learned(spreads, classes).squared_distances(spreads, spreads)
    assert squared.min() >= 0.0
    np.testing.assert_allclose(squared.diagonal(), 0.0, atol=1e-9 * squared.max())
    np.testing.assert_allclose(squared, squared.T, atol=1e-9 * squared.max())


def test_takes_are_nearest_to_their_class() -> None:
    """Every take of the stick body is nearest to another take of its class."""
    clips = stick_clips()
    classes = np.array([clip.class_name for clip in clips])
    spreads = motion_spreads(clips)
    squared = SpreadMetric.learned(spreads, classes).squared_distances(spreads, spreads)
    np.fill_diagonal(squared, np.inf)
    assert classes[squared.argmin(axis=1)].tolist() == classes.tolist()


@pytest.mark.parametrize("shrinkage", [0.0, -0.1, 1.01, math.nan])
def test_a_shrinkage_out_of_range_is_refused(shrinkage: float) -> None:
    """The shrinkage lies above 0 and is at most 1."""
    with pytest.raises(ValueError, match="shrinkage: expected above 0 and at most 1, got"):
        SpreadMetric.learned(*_random(0), shrinkage)


@pytest.mark.parametrize(
    ("spreads", "classes", "message"),
    [
        pytest.param(np.zeros((3, 4)), ["a", "b"], r"classes: expected one for each of \(3,\) motions", id="two of 3"),
        pytest.param(np.zeros(3), ["a", "b", "c"], "classes: expected one for each", id="flat"),
        pytest.param(np.eye(3), ["a", "b", "c"], "spreads: expected a class with two motions", id="one of each"),
        pytest.param(np.ones((4, 3)), ["a", "a", "b", "b"], "spreads: expected a class with two", id="all alike"),
    ],
)
def test_motions_that_teach_nothing_are_refused(spreads: np.ndarray, classes: list[str], message: str) -> None:
    """Labels that do not fit, and classes without two motions that differ, are refused by name."""
    with pytest.raises(ValueError, match=message):
        SpreadMetric.learned(spreads, np.array(classes))
