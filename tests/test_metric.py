"""How window measures are compared: the learned metric against dense matrices and loops."""

from __future__ import annotations

import naive_windows
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from library.metric import Metric, halved, learned_metric, squared_distances

#: Relative error of a number rounded to half precision.
HALF = 2.0**-11


class _Windows:
    """Windows of three classes by three people: people differ in the first two numbers, classes in the next two."""

    def __init__(self, seed: int = 0, *, numbers: int = 9, each: int = 6) -> None:
        generator = np.random.default_rng(seed)
        labels = [(index, actor) for index in range(3) for actor in "abc" for _ in range(each)]
        self.classes = np.array([index for index, _ in labels])
        self.actors = np.array([actor for _, actor in labels])
        self.measures = generator.normal(scale=0.2, size=(len(labels), numbers)) + 0.3
        self.measures[:, :2] += generator.normal(scale=2.0, size=(3, 2))[
            [("abc").index(actor) for actor in self.actors]
        ]
        self.measures[:, 2:4] += generator.normal(scale=1.0, size=(3, 2))[self.classes]

    def metric(self, *, shrinkage: float = 0.3, kept: int = 9, together: bool = False) -> Metric:
        return learned_metric(
            self.measures, self.classes, self.actors, shrinkage=shrinkage, kept=kept, together=together
        )


def _matrix(metric: Metric) -> np.ndarray:
    axes = metric.axes.astype(np.float64)
    return axes @ axes.T


# --- distances ---------------------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(1, 6), st.integers(1, 5))
def test_squared_distances_are_added_up(seed: int, first: int, second: int, numbers: int) -> None:
    """Every row's squared distance to every other is what adding up squares gives, and never below 0."""
    generator = np.random.default_rng(seed)
    rows, others = generator.normal(size=(first, numbers)), generator.normal(size=(second, numbers))
    others[0] = rows[0]
    found = squared_distances(rows, others)
    expected = [[naive_windows.squared_distance(a, b) for b in others.tolist()] for a in rows.tolist()]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert found.min() >= 0.0


def test_equal_rows_are_never_nearer_than_0() -> None:
    """In single precision, far from the origin, where rounding would, no squared distance falls below 0."""
    rows = np.random.default_rng(0).normal(loc=30.0, size=(200, 64)).astype(np.float32)
    lengths = np.square(rows).sum(axis=1)
    assert (lengths + lengths - 2 * (rows @ rows.T).diagonal()).min() < 0
    assert squared_distances(rows, rows).min() >= 0.0


@given(st.floats(-6e4, 6e4))
def test_half_precision_survives_a_file(number: float) -> None:
    """A halved number is near what it was, and halving it again, as a file does, changes nothing."""
    once = halved(np.array([number]))
    assert once[0] == pytest.approx(number, rel=HALF, abs=2.0**-24)
    assert once.dtype == np.float32
    assert np.array_equal(halved(once), once)


# --- learning ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shrinkage", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("kept", [3, 9])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_metric_is_that_of_dense_matrices(shrinkage: float, kept: int, seed: int) -> None:
    """Squared distances are those of the inverted scatter between people, up to the rounding of the file."""
    windows = _Windows(seed)
    found = _matrix(windows.metric(shrinkage=shrinkage, kept=kept))
    expected = naive_windows.metric_between_people(
        windows.measures, windows.classes.tolist(), windows.actors.tolist(), shrinkage, kept
    )
    np.testing.assert_allclose(found, expected, atol=4 * HALF * np.abs(expected).max())


def test_a_class_of_one_person_teaches_nothing_of_people() -> None:
    """Windows of a class that one person alone performs enter the axes kept, not the scatter nor the scale."""
    windows = _Windows(2)
    windows.actors[windows.classes == 1] = "a"
    found = _matrix(windows.metric(kept=9))
    expected = naive_windows.metric_between_people(
        windows.measures, windows.classes.tolist(), windows.actors.tolist(), 0.3, 9
    )
    np.testing.assert_allclose(found, expected, atol=4 * HALF * np.abs(expected).max())


def test_differences_between_people_have_length_1() -> None:
    """With all axes kept, the mean squared distance to the nearest of one's class by somebody else is about 1."""
    windows = _Windows(3, each=20)
    vectors = windows.metric().embedded(windows.measures)
    squared = squared_distances(vectors, vectors)
    squared[windows.actors[:, None] == windows.actors] = np.inf
    squared[windows.classes[:, None] != windows.classes] = np.inf
    assert squared.min(axis=1).mean() == pytest.approx(1.0, abs=0.1)


def test_what_differs_between_people_weighs_less() -> None:
    """A difference along what tells people apart weighs less than half of any other."""
    diagonal = _matrix(_Windows(4).metric()).diagonal()
    assert diagonal[:2].max() < 0.5 * diagonal[2:].min()


def test_the_order_of_windows_does_not_matter() -> None:
    """Windows in another order, and people by other names, teach the same metric."""
    windows = _Windows(5)
    order = np.random.default_rng(0).permutation(len(windows.classes))
    names = np.char.add("person ", windows.actors[order])
    other = learned_metric(
        windows.measures[order], 7 - windows.classes[order], names, shrinkage=0.3, kept=5, together=False
    )
    plain = _matrix(windows.metric(kept=5))
    np.testing.assert_allclose(_matrix(other), plain, atol=4 * HALF * np.abs(plain).max())


def test_a_metric_keeps_what_a_file_keeps() -> None:
    """Origin and axes are numbers of half precision already, so that saving loses nothing."""
    metric = _Windows().metric()
    assert np.array_equal(halved(metric.origin), metric.origin)
    assert np.array_equal(halved(metric.axes), metric.axes)


@pytest.mark.parametrize("actors", [["a"] * 4, ["a", "a", "b", "b"]])
def test_nobody_doing_the_same_teaches_nothing(actors: list[str]) -> None:
    """One person alone, or two who share no class, are refused."""
    measures = np.random.default_rng(0).normal(size=(4, 3))
    with pytest.raises(ValueError, match="actors: expected a class performed by two people, got none"):
        learned_metric(measures, np.array([0, 0, 1, 1]), np.array(actors), shrinkage=0.3, kept=2, together=False)


# --- off the axes ------------------------------------------------------------------------------------------------


def test_vectors_are_products_with_the_axes() -> None:
    """A measure's vector is its difference to the origin times the axes, one at a time or many at once."""
    windows = _Windows()
    metric = windows.metric(kept=4)
    vectors = metric.embedded(windows.measures)
    assert vectors.shape == (len(windows.measures), 4)
    for measure, vector in zip(windows.measures.tolist(), vectors, strict=True):
        expected = [
            sum((number - origin) * weight for number, origin, weight in zip(measure, metric.origin, axis, strict=True))
            for axis in metric.axes.T
        ]
        np.testing.assert_allclose(vector, expected, atol=1e-5)
        np.testing.assert_allclose(metric.embedded(np.array(measure)), vector, atol=1e-5)


@pytest.mark.parametrize("kept", [2, 5, 9])
def test_vector_and_residual_are_the_whole_distance(kept: int) -> None:
    """Without whitening, squared length on the axes and residual off them add up to the scaled squared distance."""
    windows = _Windows(6)
    metric = windows.metric(shrinkage=1.0, kept=kept)
    assert metric.outside > 0
    for measure in windows.measures:
        vector = metric.embedded(measure)
        residual = metric.residual(measure, vector)
        whole = metric.outside * naive_windows.squared_distance(measure.tolist(), metric.origin.tolist())
        assert residual >= 0.0
        assert residual + float(vector @ vector) == pytest.approx(whole, rel=1e-2)
        if kept == 9:
            assert residual == pytest.approx(0.0, abs=8 * HALF * whole)


def test_a_whitened_metric_drops_what_is_off_its_axes() -> None:
    """With whitening there is no residual, however far a measure lies off the axes."""
    metric = _Windows().metric(shrinkage=0.3, kept=2)
    far = np.full(9, 1000.0)
    assert metric.outside == 0.0
    assert metric.residual(far, metric.embedded(far)) == 0.0
