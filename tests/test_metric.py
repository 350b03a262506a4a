"""How window measures are compared: the learned metric against dense matrices and loops."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive_windows
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from library.comparison import MEASURES, Comparison
from library.distances import distance_rows
from library.measures import LEVEL_REMOVED, Kind, Measure, measured
from library.metric import Metric, halved, learned_metric, squared_distances
from library.motionlibrary import MotionLibrary
from stream.feeds import builtin_preset

if TYPE_CHECKING:
    from collections.abc import Sequence

    from library.clip import Clip

#: Relative error of a number rounded to half precision.
HALF = 2.0**-11
#: Variance of a number below which its noise does not fall.
LEAST = 1e-5
#: Share of their mean that measures are freed from, by kind.
LEVELS = {Kind.SPREAD: LEVEL_REMOVED, Kind.POSTURE: 0.0}


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
        vector = np.empty(kept, dtype=np.float32)
        square = metric.place(measure, vector)
        residual = square - float(vector @ vector)
        np.testing.assert_allclose(vector, metric.embedded(measure), rtol=1e-5, atol=1e-6)
        several, squares = metric.placed_each(np.array([measure, measure + 1.0]))
        np.testing.assert_allclose(several[0], vector, rtol=1e-4, atol=1e-6)
        assert squares[0] == pytest.approx(square, rel=1e-4, abs=1e-5)
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
    vector = np.empty(2, dtype=np.float32)
    square = metric.place(far, vector)
    assert square == pytest.approx(float(vector @ vector))
    assert metric.placed_each(far[None])[1] == pytest.approx([square], rel=1e-5)


# --- fewer numbers -----------------------------------------------------------------------------------------------


def _freed(raw: np.ndarray, level: float) -> np.ndarray:
    """Take a share of their mean out of the numbers of each row."""
    return np.array([[number - level * naive_windows.mean(row) for number in row] for row in raw.tolist()])


def _seen_of(measures: np.ndarray, seen: Sequence[int], level: float) -> np.ndarray:
    """Give what is measured when some numbers are seen: the mean put back in, and that of the fewer taken out."""
    count = measures.shape[1]
    raw = measures @ np.linalg.inv(np.eye(count) - level / count * np.ones((count, count)))
    return _freed(raw[:, list(seen)], level)


def _exact_vectors(measures: np.ndarray, metric: Metric) -> np.ndarray:
    return (measures - measures.mean(axis=0)) @ metric.axes.astype(np.float64)


def _mean_squared(vectors: np.ndarray) -> float:
    return float(np.square(vectors).sum(axis=1).mean())


@pytest.mark.parametrize("seen", [(0, 1, 2, 3), (8, 2, 5, 3, 0), (4,), tuple(range(9))], ids=len)
@pytest.mark.parametrize("level", [0.0, 0.5])
@pytest.mark.parametrize("kept", [2, 4])
def test_vectors_of_fewer_numbers_are_the_conditional_mean(seen: tuple[int, ...], level: float, kept: int) -> None:
    """Estimated vectors are the mean, given what is seen, of one normal distribution over all, mean freed or not."""
    windows = _Windows(7, each=30)
    windows.measures = _freed(windows.measures, level)
    metric = windows.metric(kept=kept, together=True)
    asked = _seen_of(windows.measures[::5], seen, level)
    estimated = metric.restricted_to(np.array(seen), level).embedded(asked)
    expected = naive_windows.conditional_mean(
        windows.measures, _exact_vectors(windows.measures, metric), seen, asked, level=level, least=LEAST
    )
    assert estimated.shape == (len(asked), kept)
    np.testing.assert_allclose(estimated, expected, atol=0.01 * np.abs(expected).max())


@pytest.mark.parametrize("level", [0.0, 0.5])
def test_no_straight_line_estimates_much_better(level: float) -> None:
    """Least squares of the true vectors on the numbers seen, on these very windows, leaves little less of an error."""
    windows = _Windows(8, each=60)
    windows.measures = _freed(windows.measures, level)
    metric = windows.metric(kept=4, together=True)
    true, seen = metric.embedded(windows.measures), [0, 2, 3, 5, 6, 8]
    asked = _seen_of(windows.measures, seen, level)
    error = _mean_squared(metric.restricted_to(np.array(seen), level).embedded(asked) - true)
    known = np.column_stack([asked, np.ones(len(asked))])
    best = _mean_squared(known @ np.linalg.lstsq(known, true, rcond=None)[0] - true)
    unknown = _mean_squared(true - true.mean(axis=0))
    assert best <= error * (1 + 1e-3)
    assert error - best < 0.05 * (unknown - best)


@pytest.mark.parametrize("level", [0.0, 0.5])
def test_all_numbers_are_as_good_as_the_measure(level: float) -> None:
    """With every number seen the vectors are nearly those of the measure, and the order of numbers does not matter."""
    windows = _Windows(9, each=30)
    windows.measures = _freed(windows.measures, level)
    metric = windows.metric(kept=4, together=True)
    true, order = metric.embedded(windows.measures), np.random.default_rng(0).permutation(9)
    estimated = metric.restricted_to(np.arange(9), level).embedded(windows.measures)
    assert _mean_squared(estimated - true) < 0.02 * _mean_squared(true)
    shuffled = metric.restricted_to(order, level).embedded(windows.measures[:, order])
    np.testing.assert_allclose(shuffled, estimated, atol=0.01 * np.abs(true).max())


def test_numbers_that_never_vary_can_be_seen() -> None:
    """A number that is the same in every window, as a segment's posture is, tells nothing and does no harm."""
    windows = _Windows(10, each=30)
    windows.measures[:, 7:] = 1.0
    metric = windows.metric(kept=9, together=True)
    true = metric.embedded(windows.measures)
    for seen in ([*range(9)], [*range(8)], [0, 1, 2, 3, 4, 5, 6]):
        estimated = metric.restricted_to(np.array(seen), 0.0).embedded(windows.measures[:, seen])
        assert _mean_squared(estimated - true) < 0.02 * _mean_squared(true)


def test_a_restricted_metric_keeps_what_a_file_keeps() -> None:
    """Origin and axes of fewer numbers are of half precision, nothing is off the axes, nothing more is known."""
    fewer = _Windows().metric(kept=4, together=True).restricted_to(np.array([1, 2, 5]), 0.5)
    assert fewer.axes.shape == (3, 4)
    assert np.array_equal(halved(fewer.origin), fewer.origin)
    assert np.array_equal(halved(fewer.axes), fewer.axes)
    assert (fewer.outside, fewer.together.size, fewer.spare.size) == (0.0, 0, 0)


def test_what_was_not_learned_together_is_not_restricted() -> None:
    """A metric learned without what varies together, or restricted before, is refused."""
    windows = _Windows()
    alone = windows.metric(kept=4)
    assert (alone.together.shape, alone.spare.shape) == ((0, 0), (0,))
    once = windows.metric(kept=4, together=True).restricted_to(np.arange(5), 0.5)
    for metric in (alone, once):
        with pytest.raises(ValueError, match="metric: expected one learned with what varies together, got one without"):
            metric.restricted_to(np.arange(3), 0.5)


def test_what_varies_together_changes_no_vector() -> None:
    """Learning it leaves origin, axes and weight as they are, and is the covariance and the noise of the twin."""
    windows = _Windows(11, each=20)
    plain, metric = windows.metric(kept=4), windows.metric(kept=4, together=True)
    assert np.array_equal(plain.origin, metric.origin)
    assert np.array_equal(plain.axes, metric.axes)
    vectors = _exact_vectors(windows.measures, metric)
    both = np.cov(np.column_stack([vectors, windows.measures]).T, bias=True)
    np.testing.assert_allclose(metric.together, both[:4, 4:], atol=4 * HALF * np.abs(both[:4, 4:]).max())
    noise = both[4:, 4:] - both[4:, :4] @ np.linalg.inv(both[:4, :4]) @ both[:4, 4:]
    np.testing.assert_allclose(metric.spare, np.maximum(noise.diagonal(), LEAST), rtol=2 * HALF, atol=1e-6)


# --- real windows of fewer joints --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole() -> Comparison:
    windows = MotionLibrary.builtin().windows
    assert windows is not None
    return windows.comparison


@pytest.fixture(scope="module")
def fewer() -> Comparison:
    """Give the built-in comparison as the joints of a Kinect show it."""
    windows = MotionLibrary.builtin().restricted_to(builtin_preset("kinectv2").joints).windows
    assert windows is not None
    return windows.comparison


def _kinect_pairs() -> np.ndarray:
    builtin = MotionLibrary.builtin()
    kept = builtin.restricted_to(builtin_preset("kinectv2").joints).skeleton
    places = [builtin.skeleton.joints.index(joint) for joint in kept.joints]
    assert 15 < len(places) < 31
    return np.array([place for place, (a, b) in enumerate(builtin.skeleton.pairs) if a in places and b in places])


def _measures(clips: Sequence[Clip], comparison: Comparison, measure: Measure, pairs: np.ndarray) -> np.ndarray:
    """Measure a window every fifth of a second from the first half second on."""
    return np.concatenate(
        [
            measured(
                distance_rows(clip.positions, clip.skeleton)[:, pairs],
                clip.frame_rate,
                np.arange(min(60, clip.frames), clip.frames + 1, 24),
                measure,
                body=comparison.body,
                basis=comparison.basis,
            )
            for clip in clips
        ]
    )


def _vectors(clips: Sequence[Clip], comparison: Comparison, measure: Measure, pairs: np.ndarray) -> np.ndarray:
    metric = comparison.metrics[measure]
    return metric.embedded(_measures(clips, comparison, measure, pairs)).astype(np.float64)


@pytest.mark.parametrize("measure", MEASURES, ids=lambda measure: measure.name)
def test_real_vectors_of_fewer_joints_are_nearer_than_anybody_else(
    measure: Measure,
    whole: Comparison,
    fewer: Comparison,
    some_clips: tuple[Clip, ...],
    hdm05_clips: tuple[Clip, ...],
) -> None:
    """From a Kinect's joints a window's vector is found half as far off as the nearest window of somebody else."""
    every = np.arange(whole.pairs)
    others = [clip for clip in hdm05_clips if clip.actor != some_clips[0].actor][::5]
    true = _vectors(some_clips, whole, measure, every)
    nearest = np.sqrt(squared_distances(true, _vectors(others, whole, measure, every)).min(axis=1))
    off = np.linalg.norm(_vectors(some_clips, fewer, measure, _kinect_pairs()) - true, axis=1)
    assert len(true) > 60
    assert np.median(off) < 0.5 * np.median(nearest)
    assert np.mean(off < nearest) > 0.95
    assert np.median(off) > 0.01


@pytest.mark.parametrize("kind", LEVELS)
def test_real_vectors_are_the_conditional_mean(kind: Kind, whole: Comparison, hdm05_clips: tuple[Clip, ...]) -> None:
    """Of a metric learned from real windows, vectors estimated from a Kinect's pairs are those of dense matrices."""
    clips, level, pairs = hdm05_clips[::9], LEVELS[kind], _kinect_pairs()
    measures = [_measures([clip], whole, Measure(kind, 0.5), np.arange(whole.pairs)) for clip in clips]
    classes = np.repeat([index for index, _ in _labels(clips)], [len(each) for each in measures])
    actors = np.repeat([actor for _, actor in _labels(clips)], [len(each) for each in measures])
    numbers = np.concatenate(measures)
    metric = learned_metric(numbers, classes, actors, shrinkage=0.3, kept=24, together=True)
    asked = _seen_of(numbers[::7], pairs.tolist(), level)
    estimated = metric.restricted_to(pairs, level).embedded(asked)
    expected = naive_windows.conditional_mean(
        numbers, _exact_vectors(numbers, metric), pairs.tolist(), asked, level=level, least=LEAST
    )
    assert _mean_squared(estimated - expected) < 1e-3 * _mean_squared(expected)


def _labels(clips: Sequence[Clip]) -> list[tuple[int, str]]:
    names = sorted({clip.class_name for clip in clips})
    return [(names.index(clip.class_name), clip.actor) for clip in clips]


@pytest.mark.parametrize("measure", [each for each in MEASURES if each.kind in LEVELS], ids=lambda each: each.name)
def test_real_vectors_of_all_numbers_are_nearly_the_same(
    measure: Measure, whole: Comparison, some_clips: tuple[Clip, ...]
) -> None:
    """Estimated from all 465 numbers, real windows' vectors are off by less than a quarter of their length."""
    metric = whole.metrics[measure]
    measures = _measures(some_clips, whole, measure, np.arange(whole.pairs))
    true = metric.embedded(measures)
    again = metric.restricted_to(np.arange(whole.pairs), LEVELS[measure.kind]).embedded(measures)
    off = np.linalg.norm(again - true, axis=1) / np.linalg.norm(true, axis=1)
    assert np.median(off) < 0.25
