"""The paper's experiment: its figures on the 288 clips, and its counting against loops and sorted lists."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING

import naive
import naive_retrieval
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import stick_clip

from kinespace.library import MotionLibrary
from kinespace.library.distances import distance_rows
from kinespace.tools.evaluation.retrieval.experiment import (
    SPLIT_LIBRARY_ACTORS,
    Labels,
    Protocol,
    Retrieval,
    Space,
    candidates,
    compare,
    compare_spreads,
    motion_axes,
    motion_spreads,
    retrieve,
    splits,
    turned,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kinespace.library.clip import Clip

#: 1-NN, measured independently on 287 of the 288 clips.
NEAREST = {
    (Space.DISTANCES, Protocol.LEAVE_ONE_OUT): 0.958,
    (Space.DISTANCES, Protocol.ACTOR_HELD_OUT): 0.906,
    (Space.DISTANCES, Protocol.SPLIT): 0.879,
    (Space.POSITIONS, Protocol.LEAVE_ONE_OUT): 0.951,
    (Space.POSITIONS, Protocol.ACTOR_HELD_OUT): 0.896,
    (Space.POSITIONS, Protocol.SPLIT): 0.879,
    (Space.ROTATIONS, Protocol.LEAVE_ONE_OUT): 0.840,
    (Space.ROTATIONS, Protocol.ACTOR_HELD_OUT): 0.697,
    (Space.ROTATIONS, Protocol.SPLIT): 0.677,
}
#: The same for either of the two nearest, leave-one-out.
TWO_NEAREST = {Space.DISTANCES: 0.965, Space.POSITIONS: 0.965, Space.ROTATIONS: 0.889}
ONE_POINT = 0.01
#: 1-NN by the spread, at least.
NEAREST_BY_SPREAD = {Protocol.LEAVE_ONE_OUT: 0.995, Protocol.ACTOR_HELD_OUT: 0.99, Protocol.SPLIT: 0.98}

Axes = dict[Space, np.ndarray]


#: Spaces in which the built-in library's motions have numbers.
IN_LIBRARY = (Space.DISTANCES, Space.POSITIONS)


@pytest.fixture(scope="module")
def motions() -> tuple[Clip, ...]:
    """Give the 288 motions of the built-in library."""
    return MotionLibrary.builtin().motions


@pytest.fixture(scope="module")
def some_motions(motions: tuple[Clip, ...]) -> tuple[Clip, ...]:
    """Give a motion of each class."""
    return tuple({motion.class_name: motion for motion in motions}.values())


@pytest.fixture(scope="module")
def labels(motions: tuple[Clip, ...]) -> Labels:
    """Give the motions' labels."""
    return Labels.of_clips(motions)


@pytest.fixture(scope="module")
def axes(motions: tuple[Clip, ...]) -> Axes:
    """Give the first principal axes of the 288 motions in each space."""
    return {space: motion_axes(motions, space) for space in IN_LIBRARY}


@pytest.fixture(scope="module")
def recorded_axes(hdm05_clips: tuple[Clip, ...]) -> Axes:
    """Give the first principal axes of the 288 clips as recorded in each space."""
    return {space: motion_axes(hdm05_clips, space) for space in Space}


@pytest.fixture(scope="module")
def turned_motions(motions: tuple[Clip, ...]) -> list[Clip]:
    """Give each motion in a heading drawn at random."""
    generator = np.random.default_rng(2012)
    return [turned(motion, generator) for motion in motions]


def _figures(axes: np.ndarray, labels: Labels) -> dict[Protocol, tuple[int, float, float]]:
    outcomes = {protocol: retrieve(compare(axes), labels, protocol) for protocol in Protocol}
    return {protocol: (found.motions, found.nearest, found.two_nearest) for protocol, found in outcomes.items()}


def _assert_as_tallied(found: Retrieval, tally: naive.Tally) -> None:
    """Compare an outcome with the loops' counts, confusion included."""
    assert found.motions == tally.asked
    assert found.nearest == pytest.approx(tally.nearest / tally.asked)
    assert found.two_nearest == pytest.approx(tally.two_nearest / tally.asked)
    for row, own in enumerate(found.classes):
        counts = [tally.taken_for.get((own, other), 0) for other in found.classes]
        expected = [count / max(sum(counts), 1) for count in counts]
        assert found.confusion[row].tolist() == pytest.approx(expected)


# --- the figures -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_nearest_figures_are_the_reference(recorded_axes: Axes, hdm05_clips: tuple[Clip, ...]) -> None:
    """In each space and protocol the share found by the nearest is within a point of the independent measurement."""
    labels = Labels.of_clips(hdm05_clips)
    for (space, protocol), nearest in NEAREST.items():
        found = retrieve(compare(recorded_axes[space]), labels, protocol)
        assert found.nearest == pytest.approx(nearest, abs=ONE_POINT), (space, protocol)
        assert found.motions == (99 if protocol is Protocol.SPLIT else 288)


@pytest.mark.parametrize(("space", "protocol"), [key for key in NEAREST if key[0] in IN_LIBRARY])
def test_nearest_figures_of_the_library_are_the_reference(
    axes: Axes, labels: Labels, space: Space, protocol: Protocol
) -> None:
    """The library's motions, rounded and at half the frame rate, have the same figures within a point."""
    found = retrieve(compare(axes[space]), labels, protocol)
    assert found.nearest == pytest.approx(NEAREST[space, protocol], abs=ONE_POINT)
    assert found.motions == (99 if protocol is Protocol.SPLIT else 288)


def test_two_nearest_figures_are_the_reference(recorded_axes: Axes, hdm05_clips: tuple[Clip, ...]) -> None:
    """Leaving one out, the share found by either of two is within a point of the independent measurement."""
    labels = Labels.of_clips(hdm05_clips)
    for space, two_nearest in TWO_NEAREST.items():
        found = retrieve(compare(recorded_axes[space]), labels, Protocol.LEAVE_ONE_OUT)
        assert found.two_nearest == pytest.approx(two_nearest, abs=ONE_POINT), space


@pytest.mark.slow
def test_turning_every_clip_leaves_distances_alone(turned_motions: list[Clip], axes: Axes, labels: Labels) -> None:
    """Every clip facing and standing anywhere, the figures of the distances do not move at all."""
    assert _figures(motion_axes(turned_motions, Space.DISTANCES), labels) == _figures(axes[Space.DISTANCES], labels)


@pytest.mark.slow
def test_turning_every_clip_spoils_positions(turned_motions: list[Clip], axes: Axes, labels: Labels) -> None:
    """Every clip facing anywhere, positions leave-one-out fall from 95 % to below 90 %."""
    before = retrieve(compare(axes[Space.POSITIONS]), labels, Protocol.LEAVE_ONE_OUT).nearest
    after = retrieve(compare(motion_axes(turned_motions, Space.POSITIONS)), labels, Protocol.LEAVE_ONE_OUT).nearest
    assert after < 0.9 < before


# --- by the spread ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def spreads(motions: tuple[Clip, ...]) -> np.ndarray:
    """Give the motions' spreads."""
    return motion_spreads(motions)


@pytest.fixture(scope="module")
def spread_scores(spreads: np.ndarray, labels: Labels) -> dict[Protocol, np.ndarray]:
    """Give the scores by spreads for each protocol."""
    return {protocol: compare_spreads(spreads, labels, protocol) for protocol in Protocol}


@pytest.mark.slow
@pytest.mark.parametrize("protocol", list(Protocol))
def test_by_the_spread_nearly_all_are_found(
    spread_scores: dict[Protocol, np.ndarray], labels: Labels, protocol: Protocol
) -> None:
    """Compared by the spread, at least 99.5 % are found leaving one out, 99 % its actor, 98 % in the split."""
    found = retrieve(spread_scores[protocol], labels, protocol)
    assert found.nearest >= NEAREST_BY_SPREAD[protocol]
    tally = naive.retrieval(spread_scores[protocol], labels.classes.tolist(), labels.actors.tolist(), protocol)
    _assert_as_tallied(found, tally)


@pytest.mark.slow
@pytest.mark.parametrize("protocol", list(Protocol))
@pytest.mark.parametrize("asking", [5, 260])
def test_scores_by_the_spread_equal_the_inverted_scatters(
    spreads: np.ndarray, spread_scores: dict[Protocol, np.ndarray], labels: Labels, protocol: Protocol, asking: int
) -> None:
    """A motion's scores use the metric learned only from motions it may find, scatter written out and inverted."""
    found = naive.allowed(asking, labels.actors.tolist(), protocol)
    scores = spread_scores[protocol][asking]
    assert np.flatnonzero(np.isfinite(scores)).tolist() == found
    if found:
        matrix = naive_retrieval.within_class_metric(spreads[found], labels.classes[found].tolist(), 0.1)
        expected = [
            -(spreads[asking] - spreads[other]) @ matrix @ (spreads[asking] - spreads[other]) for other in found
        ]
        np.testing.assert_allclose(scores[found], expected, rtol=1e-6)


@pytest.mark.parametrize("protocol", list(Protocol))
def test_the_metric_does_not_see_the_asking_motion(protocol: Protocol) -> None:
    """A motion's own class, and the other asking motions, do not change its scores."""
    generator = np.random.default_rng(3)
    spreads = generator.normal(size=(12, 9))
    labels = Labels(np.array(["bow", "jump", "wave"] * 4), np.array(["bd", "bk", "tr", "mm"] * 3))
    scores = compare_spreads(spreads, labels, protocol)
    asking = 2
    relabelled = labels.classes.copy()
    relabelled[asking] = "bow"
    again = compare_spreads(spreads, Labels(relabelled, labels.actors), protocol)
    assert np.isfinite(scores[asking]).any()
    assert np.array_equal(again[asking], scores[asking])
    assert np.array_equal(again, scores) == (protocol is Protocol.SPLIT)


# --- against the slow twin ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("space", list(Space))
def test_axes_equal_the_papers_svd(some_motions: tuple[Clip, ...], space: Space) -> None:
    """In each space a motion's axis is the first of the SVD of its centred numbers, whatever its sign."""
    generator = np.random.default_rng(3)
    turning = [replace(clip, rotations=generator.normal(size=(clip.frames, 59))) for clip in some_motions]
    for clip, axis in zip(turning, motion_axes(turning, space), strict=True):
        numbers: Mapping[Space, np.ndarray] = {
            Space.DISTANCES: distance_rows(clip.positions, clip.skeleton),
            Space.POSITIONS: clip.positions.reshape(clip.frames, 93),
            Space.ROTATIONS: clip.rotations,
        }
        _, expected = naive.first_axis_by_svd(numbers[space])
        assert abs(axis @ expected) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("protocol", list(Protocol))
@pytest.mark.parametrize("space", IN_LIBRARY)
def test_outcomes_equal_sorted_lists(axes: Axes, labels: Labels, space: Space, protocol: Protocol) -> None:
    """On the 288 motions every count and every entry of the confusion matrix equals that of sorted Python lists."""
    scores = compare(axes[space])
    tally = naive.retrieval(scores, labels.classes.tolist(), labels.actors.tolist(), protocol)
    _assert_as_tallied(retrieve(scores, labels, protocol), tally)


@given(st.integers(0, 2**32 - 1), st.integers(3, 14), st.sampled_from(list(Protocol)))
def test_any_outcome_equals_sorted_lists(seed: int, motions: int, protocol: Protocol) -> None:
    """For any scores, with ties, and any labels the outcome equals a count over sorted Python lists."""
    generator = np.random.default_rng(seed)
    scores = generator.integers(0, 5, size=(motions, motions)) / 4.0
    classes = generator.choice(["bow", "jump", "wave"], motions)
    actors = np.array(["bd", "bk", "tr", *generator.choice(["bd", "bk", "tr"], motions - 3)])
    _assert_as_tallied(
        retrieve(scores, Labels(classes, actors), protocol),
        naive.retrieval(scores, classes.tolist(), actors.tolist(), protocol),
    )


@pytest.mark.slow
def test_scores_are_absolute_inner_products(axes: Axes) -> None:
    """Every motion is scored against every other by the product of their axes, signs aside, itself by 1."""
    some = axes[Space.DISTANCES][::40]
    scores = compare(some)
    expected = [[naive.score(first, second) for second in some.tolist()] for first in some.tolist()]
    np.testing.assert_allclose(scores, expected, atol=1e-12)
    np.testing.assert_allclose(scores.diagonal(), 1.0, atol=1e-12)
    flipped = some * np.random.default_rng(1).choice([-1.0, 1.0], size=(len(some), 1))
    np.testing.assert_allclose(compare(flipped), scores, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("protocol", list(Protocol))
@pytest.mark.parametrize("space", IN_LIBRARY)
def test_confusion_rows_are_shares(axes: Axes, labels: Labels, space: Space, protocol: Protocol) -> None:
    """Rows of the confusion matrix sum to one where the class asked, and its weighted diagonal is the figure."""
    found = retrieve(compare(axes[space]), labels, protocol)
    assert found.classes == tuple(sorted(set(labels.classes.tolist())))
    np.testing.assert_allclose(found.confusion.sum(axis=1), 1.0)
    assert found.confusion.min() >= 0.0
    asked = np.isin(labels.actors, SPLIT_LIBRARY_ACTORS, invert=True) if protocol is Protocol.SPLIT else slice(None)
    counts = [np.count_nonzero(labels.classes[asked] == name) for name in found.classes]
    assert found.confusion.diagonal() @ counts / sum(counts) == pytest.approx(found.nearest)


def test_a_class_that_never_asks_has_a_row_of_zeros() -> None:
    """In the split a class that only the library's actors perform has a row of zeros, the others one of shares."""
    labels = Labels(np.array(["bow", "bow", "jump", "jump"]), np.array(["bd", "bk", "tr", "dg"]))
    found = retrieve(np.eye(4), labels, Protocol.SPLIT)
    assert found.motions == 1
    assert found.confusion.tolist() == [[0.0, 0.0], [1.0, 0.0]]


# --- candidates -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("protocol", list(Protocol))
def test_candidates_equal_the_loops(labels: Labels, protocol: Protocol) -> None:
    """The motions that each of the 288 may find equal those of loops, and never contain the motion itself."""
    allowed = candidates(labels, protocol)
    actors = labels.actors.tolist()
    assert not allowed.diagonal().any()
    for asking in range(len(actors)):
        assert np.flatnonzero(allowed[asking]).tolist() == naive.allowed(asking, actors, protocol)


def test_there_are_ten_splits_of_five_actors() -> None:
    """Three of five actors are the library in each of ten ways; of other numbers of actors there is no such split."""
    actors = {"bd", "bk", "dg", "mm", "tr"}
    assert splits(actors) == list(combinations(sorted(actors), 3))
    assert len(splits(actors)) == 10
    assert splits(actors - {"tr"}) == splits(actors | {"xx"}) == []


@pytest.mark.parametrize("library_actors", [("bd", "bk", "tr"), ("dg", "mm", "tr")])
def test_another_split_asks_other_actors(labels: Labels, spreads: np.ndarray, library_actors: tuple[str, ...]) -> None:
    """The actors named are found, by a metric learned from them alone, and all others ask."""
    allowed = candidates(labels, Protocol.SPLIT, library_actors)
    in_library = [actor in library_actors for actor in labels.actors.tolist()]
    for asking, row in enumerate(allowed.tolist()):
        assert row == ([False] * len(row) if in_library[asking] else in_library)
    scores = compare_spreads(spreads, labels, Protocol.SPLIT, library_actors)
    assert np.array_equal(np.isfinite(scores), allowed)
    found = retrieve(scores, labels, Protocol.SPLIT, library_actors)
    assert found.asking.tolist() == np.flatnonzero(~np.array(in_library)).tolist()
    renamed = np.array([dict(zip(library_actors, ("bd", "bk", "dg"), strict=True)).get(a, "zz") for a in labels.actors])
    usual = Labels(labels.classes, renamed)
    assert np.array_equal(compare_spreads(spreads, usual, Protocol.SPLIT), scores)
    assert retrieve(scores, usual, Protocol.SPLIT).nearest == found.nearest > 0.9


def test_the_outcome_lists_right_answers() -> None:
    """For each asking motion the outcome says whether the nearest, and whether one of two, is of its class."""
    labels = Labels(np.array(["bow", "jump", "jump", "bow"]), np.array(["aa", "aa", "bb", "bb"]))
    scores = np.array([[9, 3, 2, 1], [3, 9, 2, 1], [1, 2, 9, 3], [3, 2, 1, 9]], dtype=float)
    found = retrieve(scores, labels, Protocol.LEAVE_ONE_OUT)
    assert found.asking.tolist() == [0, 1, 2, 3]
    assert found.right.tolist() == [[False, False], [False, True], [False, True], [True, True]]
    assert (found.nearest, found.two_nearest) == (0.25, 0.75)


def test_labels_are_read_off_clips() -> None:
    """Classes and actors stand in the order of the clips."""
    labels = Labels.of_clips([stick_clip("wave", actor="bb"), stick_clip("bow", actor="aa")])
    assert labels.classes.tolist() == ["wave", "bow"]
    assert labels.actors.tolist() == ["bb", "aa"]


# --- turning -----------------------------------------------------------------------------------------------------


def test_turning_keeps_the_motion_and_the_vertical(some_motions: tuple[Clip, ...]) -> None:
    """A turned clip has the same distances, heights and labels, all its frames moved alike, and stands elsewhere."""
    generator = np.random.default_rng(4)
    for clip in some_motions:
        moved = turned(clip, generator)
        distances = distance_rows(clip.positions, clip.skeleton)
        np.testing.assert_allclose(distance_rows(moved.positions, clip.skeleton), distances, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(moved.positions[..., 1], clip.positions[..., 1], atol=1e-12)
        first, again = (np.linalg.norm(np.diff(c.positions[:, 0], axis=0), axis=1) for c in (clip, moved))
        np.testing.assert_allclose(again, first, atol=1e-12)
        assert np.abs(moved.positions - clip.positions).max() > 0.05
        assert (moved.name, moved.class_name, moved.actor) == (clip.name, clip.class_name, clip.actor)


def test_turning_does_not_mirror(some_motions: tuple[Clip, ...]) -> None:
    """A turn keeps handedness: the volume spanned by three bones keeps its sign."""
    for clip in some_motions:
        moved = turned(clip, np.random.default_rng(6))
        before, after = (np.linalg.det(c.positions[0, [4, 8, 12]] - c.positions[0, 0]) for c in (clip, moved))
        assert after == pytest.approx(before)


def test_turning_is_repeatable(some_motions: tuple[Clip, ...]) -> None:
    """The same generator turns the same way, and goes on to another."""
    clip = some_motions[0]
    first, second = np.random.default_rng(8), np.random.default_rng(8)
    assert np.array_equal(turned(clip, first).positions, turned(clip, second).positions)
    assert not np.array_equal(turned(clip, first).positions, turned(clip, np.random.default_rng(8)).positions)


# --- bad arguments -----------------------------------------------------------------------------------------------


def test_rotations_of_a_clip_without_any_are_refused() -> None:
    """When a clip's source has no rotations, asking for them is refused with the clip's name."""
    with pytest.raises(ValueError, match="space: clip 'wave_3' has no rotations"):
        motion_axes([stick_clip("wave", seed=3)], Space.ROTATIONS)


@pytest.mark.parametrize("shape", [(3, 2), (2, 3), (2, 2), (3,)])
def test_scores_that_do_not_fit_the_labels_are_refused(shape: tuple[int, ...]) -> None:
    """Three labelled motions need three by three scores."""
    labels = Labels(np.array(["a", "b", "a"]), np.array(["bd", "bk", "tr"]))
    with pytest.raises(ValueError, match=r"scores: expected \(3, 3\), got \(" + str(shape[0])):
        retrieve(np.zeros(shape), labels, Protocol.LEAVE_ONE_OUT)


@pytest.mark.parametrize(
    ("actors", "protocol"),
    [
        pytest.param(("bd", "bd", "bd"), Protocol.ACTOR_HELD_OUT, id="one actor alone"),
        pytest.param(("bd", "bk", "dg"), Protocol.SPLIT, id="nobody asks"),
        pytest.param(("mm", "tr", "mm"), Protocol.SPLIT, id="nobody is asked"),
        pytest.param(("mm", "tr", "bd"), Protocol.SPLIT, id="one motion in the library"),
        pytest.param(("bd", "bk"), Protocol.LEAVE_ONE_OUT, id="two motions"),
        pytest.param((), Protocol.LEAVE_ONE_OUT, id="no motion"),
    ],
)
def test_a_protocol_without_candidates_is_an_error(actors: tuple[str, ...], protocol: Protocol) -> None:
    """The error says that the protocol leaves a motion fewer than two others."""
    count = len(actors)
    labels = Labels(np.array(["wave"] * count, dtype=np.str_), np.array(actors, dtype=np.str_))
    with pytest.raises(ValueError, match=f"protocol: {protocol} leaves no motion two others"):
        retrieve(np.eye(count), labels, protocol)
