from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.library.windows.comparison import ACROSS_LABORATORIES, WITHIN_LABORATORY, Comparison, Weighing
from kinespace.library.windows.cutting import CutWindows
from kinespace.library.windows.index import measured_clips
from kinespace.library.windows.metric import Lessons
from kinespace.library.windows.parts import EIGEN_LONG, EIGEN_SHORT, PARTS, POSTURE, SPREAD_LONG, Kind, flattened

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kinespace.library.windows.index import WindowIndex
    from kinespace.library.windows.parts import Part

BOTH = pytest.mark.parametrize("weighing", [ACROSS_LABORATORIES, WITHIN_LABORATORY], ids=["across", "within"])
#: One view of two groups, and one that sees postures alone.
SMALL = Weighing(
    groups=((EIGEN_LONG, SPREAD_LONG), (EIGEN_SHORT,), (POSTURE,)),
    views=((0.5, 0.25, 0.25), (0.0, 0.0, 1.0)),
    first=0.5,
)


@pytest.fixture(scope="module")
def numbers(small_index: WindowIndex) -> Mapping[Part, np.ndarray]:
    """Give the numbers of a small library's windows."""
    clips, ends, _ = measured_clips(small_index.library, 0.4)
    return CutWindows(clips, ends, small_index.body, small_index.basis).numbers()


@pytest.fixture(scope="module")
def comparison(small_index: WindowIndex, numbers: Mapping[Part, np.ndarray]) -> Comparison:
    """Give a comparison that the small library's people taught."""
    clips, _, motions = measured_clips(small_index.library, 0.4)
    classes = np.unique([clip.class_name for clip in clips], return_inverse=True)[1]
    people = np.unique([clip.actor for clip in clips], return_inverse=True)[1]
    return Comparison.learned(SMALL, numbers, Lessons(classes[motions], people[motions]))


@BOTH
def test_the_weights_of_a_view_add_up(weighing: Weighing) -> None:
    """Each view has one weight for each group."""
    for view in weighing.views:
        assert len(view) == len(weighing.groups)
        assert sum(view) == pytest.approx(1.0)
    assert len(weighing.views) >= 1


@pytest.mark.parametrize("views", [((0.5, 0.5),), ((0.5, 0.5, 0.5),), ((0.5, 0.25, 0.25), (1.0, 0.0, 0.1))])
def test_weights_that_do_not_add_up_are_refused(views: tuple[tuple[float, ...], ...]) -> None:
    """The message says how many weights there should be."""
    with pytest.raises(ValueError, match="3 weights that add up to 1"):
        replace(SMALL, views=views)


@BOTH
@pytest.mark.parametrize("kind", Kind)
def test_without_a_kind(weighing: Weighing, kind: Kind) -> None:
    """No part of the kind is left, all others are, and weights keep their proportions."""
    fewer = weighing.without(kind)
    assert set(fewer.parts) == {part for part in weighing.parts if part.kind is not kind}
    assert all(sum(view) == pytest.approx(1.0) for view in fewer.views)
    assert 1 <= len(fewer.views) <= len(weighing.views)


def test_weights_keep_their_proportions() -> None:
    """Without postures a half and a quarter become two thirds and one, and the view of postures is gone."""
    fewer = SMALL.without(Kind.POSTURE)
    assert fewer.groups == SMALL.groups[:2]
    assert np.allclose(fewer.views, [(2 / 3, 1 / 3)])


def test_a_group_may_lose_one_of_its_parts() -> None:
    """The group stays with its weight."""
    fewer = SMALL.without(Kind.SPREAD)
    assert fewer.groups == ((EIGEN_LONG,), (EIGEN_SHORT,), (POSTURE,))
    assert np.allclose(fewer.views, SMALL.views)


def test_below_the_views_each_group_is_compared_alone() -> None:
    """Two views of three groups make five rows of weights; the views name a class, and the rest is evidence."""
    assert np.array_equal(SMALL.weights, [*SMALL.views, (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    logs = np.array([[3.0, 1.0], [2.0, 5.0], [7.0, 8.0], [0.0, 1.0], [2.0, 2.0]])
    assert SMALL.named(logs).tolist() == [2.0, 1.0]
    assert np.array_equal(SMALL.alone(logs), logs[2:])


def test_nothing_left_to_name_a_class_by() -> None:
    """A weighing of one kind cannot do without it."""
    alone = Weighing(groups=((POSTURE,),), views=((1.0,),), first=0.5)
    with pytest.raises(ValueError, match="beside posture"):
        alone.without(Kind.POSTURE)


def test_parts_are_listed_once() -> None:
    """A part in two groups is one part."""
    assert sorted(WITHIN_LABORATORY.parts) == sorted(PARTS)


def test_a_group_of_an_eigen_part_stays_eigenvectors(
    comparison: Comparison, numbers: Mapping[Part, np.ndarray]
) -> None:
    """It has no metric; a single other part has its own, and several parts have one more."""
    joined, eigenvectors, postures = comparison.place(numbers)
    assert np.array_equal(eigenvectors, numbers[EIGEN_SHORT].astype(np.float32))
    assert np.array_equal(postures, comparison.parts[POSTURE].place(numbers[POSTURE]))
    assert EIGEN_SHORT not in comparison.parts
    assert [metric is None for metric in comparison.groups] == [False, True, True]
    parts = (flattened(numbers[EIGEN_LONG]), numbers[SPREAD_LONG])
    metrics = (comparison.parts[EIGEN_LONG], comparison.parts[SPREAD_LONG])
    vectors = [metric.place(part) for metric, part in zip(metrics, parts, strict=True)]
    assert np.array_equal(joined, comparison.groups[0].place(np.concatenate(vectors, axis=1)))


def test_one_window_is_placed_as_among_many(comparison: Comparison, numbers: Mapping[Part, np.ndarray]) -> None:
    """Numbers without an axis of windows give vectors without one."""
    many = comparison.place(numbers)
    one = comparison.place({part: each[3] for part, each in numbers.items()})
    for single, among in zip(one, many, strict=True):
        assert single.shape == among[3].shape
        assert np.allclose(single, among[3], atol=1e-4)
