import numpy as np
import pytest

from kinespace.library.windows import comparison
from kinespace.library.windows.comparison import Lessons, learned_metric, squared_distances


def _windows(*, people: int = 3, seed: int = 4) -> tuple[np.ndarray, Lessons]:
    """Make windows of four classes that differ along two axes; people differ along the third, and far more."""
    generator = np.random.default_rng(seed)
    classes = np.repeat(np.arange(4), 10 * people)
    who = np.tile(np.repeat(np.arange(people), 10), 4)
    means = generator.normal(size=(4, 6)) * [2, 2, 0, 0, 0, 0]
    own = generator.normal(size=(4, people, 6)) * [0, 0, 9, 0, 0, 0]
    noise = generator.normal(size=(len(classes), 6)) * 0.3
    return means[classes] + own[classes, who] + noise, Lessons(classes, who)


@pytest.mark.parametrize("shrinkage", [0.2, 1.0])
def test_the_same_motion_by_two_people_has_mean_squared_distance_1(shrinkage: float) -> None:
    """From each window to the nearest of its class by another person, mean over classes; so parts can be added up."""
    numbers, lessons = _windows()
    vectors = learned_metric(numbers, lessons, shrinkage=shrinkage, kept=6).place(numbers)
    squared = np.square(vectors[:, None] - vectors).sum(axis=2)
    others = (lessons.classes[:, None] == lessons.classes) & (lessons.people[:, None] != lessons.people)
    nearest = np.where(others, squared, np.inf).min(axis=1)
    assert np.mean([nearest[lessons.classes == each].mean() for each in range(4)]) == pytest.approx(1.0, rel=0.01)


def test_the_nearest_are_looked_for_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some windows after the others find the same nearest as all at once."""
    numbers, lessons = _windows()
    at_once = learned_metric(numbers, lessons, shrinkage=0.2, kept=6).place(numbers)
    monkeypatch.setattr(comparison, "_AT_ONCE", 7)
    parts = learned_metric(numbers, lessons, shrinkage=0.2, kept=6).place(numbers)
    np.testing.assert_allclose(
        squared_distances(parts, parts), squared_distances(at_once, at_once), rtol=1e-3, atol=1e-2
    )


@pytest.mark.parametrize("few", [False, True])
def test_one_person_teaches_nothing_but_principal_axes(*, few: bool) -> None:
    """All the axes have one length, and are the windows' principal axes, also of fewer windows than numbers."""
    numbers, lessons = _windows(people=1)
    if few:
        numbers, lessons = numbers[::10], Lessons(lessons.classes[::10], lessons.people[::10])
    metric = learned_metric(numbers, lessons, shrinkage=0.2, kept=2)
    _, _, principal = np.linalg.svd(numbers - numbers.mean(axis=0))
    lengths = np.linalg.norm(metric.axes, axis=0)
    assert np.abs(np.sum(metric.axes / lengths * principal[:2].T, axis=0)) == pytest.approx([1.0, 1.0], abs=1e-3)
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-3)
    assert np.allclose(metric.origin, numbers.mean(axis=0), atol=1e-5)
    placed = metric.place(numbers)
    assert placed.dtype == np.float32
    assert np.allclose(placed, (numbers - metric.origin) @ metric.axes, atol=1e-4)


def test_windows_that_are_all_the_same_teach_something_finite() -> None:
    """No division by a length of 0 takes place, and persons whose recordings are the same teach nothing."""
    for numbers in (
        np.ones((8, 12)),
        np.tile(np.random.default_rng(1).normal(size=(1, 4, 12)), (2, 1, 1)).reshape(8, 12),
    ):
        lessons = Lessons(np.tile(np.arange(4), 2), np.repeat([0, 1], 4))
        assert np.isfinite(learned_metric(numbers, lessons, shrinkage=0.2, kept=3).axes).all()


@pytest.mark.parametrize(("kept", "axes"), [(3, 3), (64, 6)])
def test_no_more_axes_are_kept_than_asked_for(kept: int, axes: int) -> None:
    """Nor more than there are numbers; all are of half precision."""
    numbers, lessons = _windows()
    metric = learned_metric(numbers, lessons, shrinkage=0.2, kept=kept)
    assert metric.axes.shape == (6, axes)
    assert np.array_equal(metric.axes.astype(np.float16), metric.axes)


def test_classes_that_two_people_perform() -> None:
    """Classes of one person teach nothing about people."""
    lessons = Lessons(np.array([0, 0, 1, 1, 2]), np.array([0, 1, 1, 1, 0]))
    assert [each.tolist() for each in lessons.shared] == [[0, 1]]


def test_squared_distances() -> None:
    """Squared distances equal those by subtraction, and are never below 0."""
    first, second = np.random.default_rng(2).normal(size=(2, 5, 3))
    assert np.allclose(squared_distances(first, second), np.square(first[:, None] - second).sum(axis=2))
    assert (squared_distances(first * 1e6, first * 1e6) >= 0).all()
