from __future__ import annotations

import numpy as np
import pytest

from kinespace.library.windows.metric import Lessons, learned_metric, rounded, squared_distances


def _windows(*, people: int = 3, seed: int = 4) -> tuple[np.ndarray, Lessons]:
    """Make windows of four classes that differ along two axes; people differ along the third, and far more."""
    generator = np.random.default_rng(seed)
    classes = np.repeat(np.arange(4), 10 * people)
    who = np.tile(np.repeat(np.arange(people), 10), 4)
    means = generator.normal(size=(4, 6)) * [2, 2, 0, 0, 0, 0]
    own = generator.normal(size=(4, people, 6)) * [0, 0, 9, 0, 0, 0]
    noise = generator.normal(size=(len(classes), 6)) * 0.3
    return means[classes] + own[classes, who] + noise, Lessons(classes, who)


def _mean_square_between_people(vectors: np.ndarray, lessons: Lessons) -> float:
    """Take each window's squared distance to the nearest of its class by another person, mean over classes."""
    nearest = [
        min(
            float(np.sum((vector - other) ** 2))
            for other, other_class, other_person in zip(vectors, lessons.classes, lessons.people, strict=True)
            if other_class == own_class and other_person != own_person
        )
        for vector, own_class, own_person in zip(vectors, lessons.classes, lessons.people, strict=True)
    ]
    return float(np.mean([np.mean(np.array(nearest)[lessons.classes == each]) for each in np.unique(lessons.classes)]))


@pytest.mark.parametrize("shrinkage", [0.2, 1.0])
def test_the_same_motion_by_two_people_has_mean_squared_distance_1(shrinkage: float) -> None:
    """Distances of different parts can then be added up."""
    numbers, lessons = _windows()
    vectors = learned_metric(numbers, lessons, shrinkage=shrinkage, kept=6).place(numbers)
    assert _mean_square_between_people(vectors, lessons) == pytest.approx(1.0, rel=0.01)


def test_differences_between_people_count_less() -> None:
    """Shrunk little, the metric tells classes apart better than a metric without scatter."""
    numbers, lessons = _windows()
    ratios = []
    for shrinkage in (0.05, 1.0):
        axes = learned_metric(numbers, lessons, shrinkage=shrinkage, kept=6).axes
        ratios.append(np.square(axes[2]).sum() / np.square(axes[:2]).sum())
    assert ratios[0] < 0.3 * ratios[1]


def test_the_less_shrinkage_the_less_people_count() -> None:
    """The third number, in which people differ, loses weight step by step."""
    numbers, lessons = _windows()
    weights = []
    for shrinkage in (1.0, 0.5, 0.1, 0.01):
        axes = learned_metric(numbers, lessons, shrinkage=shrinkage, kept=6).axes
        weights.append(np.square(axes[2]).sum() / np.square(axes[:2]).sum())
    assert weights == sorted(weights, reverse=True)


def test_one_person_teaches_nothing_but_principal_axes() -> None:
    """All the axes have one length, and they are the windows' principal axes."""
    numbers, lessons = _windows(people=1)
    metric = learned_metric(numbers, lessons, shrinkage=0.2, kept=2)
    _, _, principal = np.linalg.svd(numbers - numbers.mean(axis=0))
    axes = metric.axes / np.linalg.norm(metric.axes, axis=0)
    assert np.abs(np.sum(axes * principal[:2].T, axis=0)) == pytest.approx([1.0, 1.0], abs=1e-3)
    lengths = np.linalg.norm(metric.axes, axis=0)
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-3)
    assert np.allclose(metric.origin, numbers.mean(axis=0), atol=1e-5)


def test_no_more_axes_are_kept_than_asked_for() -> None:
    """Nor more than there are numbers."""
    numbers, lessons = _windows()
    assert learned_metric(numbers, lessons, shrinkage=0.2, kept=3).axes.shape == (6, 3)
    assert learned_metric(numbers, lessons, shrinkage=0.2, kept=64).axes.shape == (6, 6)


def test_classes_that_two_people_perform() -> None:
    """Classes of one person teach nothing about people."""
    lessons = Lessons(np.array([0, 0, 1, 1, 2]), np.array([0, 1, 1, 1, 0]))
    assert [each.tolist() for each in lessons.shared] == [[0, 1]]


def test_squared_distances() -> None:
    """Squared distances equal those by subtraction, and are never below 0."""
    first, second = np.random.default_rng(2).normal(size=(2, 5, 3))
    assert np.allclose(squared_distances(first, second), np.square(first[:, None] - second).sum(axis=2))
    assert (squared_distances(first * 1e6, first * 1e6) >= 0).all()


def test_rounding_to_half_precision() -> None:
    """Eleven binary digits remain, and rounding twice changes nothing."""
    numbers = np.array([1.0, 1 / 3, 1 + 2**-12])
    once = rounded(numbers)
    assert once.dtype == np.float32
    assert np.abs(once / numbers - 1).max() < 2**-11
    assert once[2] == 1.0
    assert np.array_equal(rounded(once), once)
