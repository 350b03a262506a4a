from dataclasses import replace

import numpy as np
import pytest

from kinespace.library import WindowIndex
from kinespace.library.signature.parts import EIGEN_LONG, EIGEN_SHORT, PARTS, POSTURE, SPREAD_LONG, Kind, flattened
from kinespace.library.windows.comparison import (
    ACROSS_LABORATORIES,
    WITHIN_LABORATORY,
    Comparison,
    Lessons,
    Weighing,
    by_paper,
)
from kinespace.library.windows.cutting import CutWindows
from kinespace.library.windows.index import Measured

#: One view of two groups, and one that sees postures alone.
SMALL = Weighing(
    groups=((EIGEN_LONG, SPREAD_LONG), (EIGEN_SHORT,), (POSTURE,)),
    views=((0.5, 0.25, 0.25), (0.0, 0.0, 1.0)),
    first=0.5,
)


@pytest.mark.parametrize("views", [((0.5, 0.5),), ((0.5, 0.5, 0.5),), ((0.5, 0.25, 0.25), (1.0, 0.0, 0.1))])
def test_weights_that_do_not_add_up_are_refused(views: tuple[tuple[float, ...], ...]) -> None:
    """The message says how many weights there should be."""
    with pytest.raises(ValueError, match="3 weights that add up to 1"):
        replace(SMALL, views=views)


@pytest.mark.parametrize("weighing", [ACROSS_LABORATORIES, WITHIN_LABORATORY], ids=["across", "within"])
@pytest.mark.parametrize("kind", Kind)
def test_without_a_kind(weighing: Weighing, kind: Kind) -> None:
    """No part of the kind is left, all others are, each once, and the weights of each view add up to 1."""
    fewer = weighing.without(kind)
    expected = [part for part in PARTS if part in weighing.parts and part.kind is not kind]
    assert sorted(fewer.parts) == sorted(expected)
    assert 1 <= len(fewer.views) <= len(weighing.views)


def test_below_the_views_each_group_is_compared_alone() -> None:
    """Two views of three groups make five rows of weights; the views name a class, and the rest is evidence."""
    assert np.array_equal(SMALL.weights, [*SMALL.views, (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    logs = np.array([[3.0, 1.0], [2.0, 5.0], [7.0, 8.0], [0.0, 1.0], [2.0, 2.0]])
    assert SMALL.named(logs).tolist() == [2.0, 1.0]
    assert np.array_equal(SMALL.alone(logs), logs[2:])


def test_the_papers_weighing_names_by_products() -> None:
    """Negative |inner products| become log(1 − product²), and rounding above 1 makes no NaN."""
    paper = by_paper(0.7)
    assert paper.groups == (((Kind.EIGEN, 0.7),),)
    assert (paper.judges, paper.by_products, paper.eigenvectors) == (False, True, 1)
    named = paper.named(np.array([[-0.5, -1.0000001, 0.0], [0.0, 0.0, 0.0]]))
    assert named == pytest.approx(np.log([0.751, 0.001, 1.001]))


def test_windows_are_placed_by_metrics(small_index: WindowIndex) -> None:
    """An eigen part alone stays eigenvectors; another part has its own metric, and several parts one more."""
    clips, ends, motions = Measured.of(small_index.library, 0.4)
    numbers = CutWindows(clips, ends, small_index.body, small_index.basis).numbers
    classes, people = (
        np.unique([getattr(clip, name) for clip in clips], return_inverse=True)[1] for name in ("class_name", "actor")
    )
    comparison = Comparison.learned(SMALL, numbers, Lessons(classes[motions], people[motions]))
    joined, eigenvectors, postures = many = comparison.place(numbers)
    assert np.array_equal(eigenvectors, numbers[EIGEN_SHORT].astype(np.float32))
    assert np.array_equal(postures, comparison.parts[POSTURE].place(numbers[POSTURE]))
    assert EIGEN_SHORT not in comparison.parts
    long, spread, *others = comparison.groups[0], comparison.parts[SPREAD_LONG], *comparison.groups[1:]
    assert others == [None, None]
    assert long is not None
    vectors = [comparison.parts[EIGEN_LONG].place(flattened(numbers[EIGEN_LONG])), spread.place(numbers[SPREAD_LONG])]
    assert np.array_equal(joined, long.place(np.concatenate(vectors, axis=1)))
    for single, among in zip(comparison.place({part: each[3] for part, each in numbers.items()}), many, strict=True):
        assert np.allclose(single, among[3], atol=1e-4)
    taught = comparison.of_taught_classes()
    assert taught.groups[0] is not None
    assert np.array_equal(taught.groups[0].axes, long.axes[:, :32])
