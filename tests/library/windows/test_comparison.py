"""Tests of the linear head: its probabilities, what teaches it, and where it helps to name."""

from dataclasses import replace

import numpy as np
import pytest
from naive_windows import unlikely
from synthetic import stick_clips

from kinespace.library import MotionLibrary, WindowIndex
from kinespace.library.signature.parts import EIGEN_LONG, EIGEN_SHORT, PARTS, POSTURE, SPREAD_LONG, Kind, Signature
from kinespace.library.windows import comparison
from kinespace.library.windows.comparer import Comparer, Head, named_and_alone
from kinespace.library.windows.comparison import ACROSS_LABORATORIES, Weighing, learned_metric
from kinespace.library.windows.cutting import Measured, window_ends
from kinespace.library.windows.paper import PaperComparer, by_paper

#: One blend of two groups, and one that sees postures alone.
SMALL = Weighing(
    groups=((EIGEN_LONG, SPREAD_LONG), (EIGEN_SHORT,), (POSTURE,)),
    blends=((0.5, 0.25, 0.25), (0.0, 0.0, 1.0)),
    first=0.5,
)


@pytest.mark.parametrize("blends", [((0.5, 0.5),), ((0.5, 0.5, 0.5),), ((0.5, 0.25, 0.25), (1.0, 0.0, 0.1))])
def test_weights_that_do_not_add_up_are_refused(blends: tuple[tuple[float, ...], ...]) -> None:
    """The message says how many weights there should be."""
    with pytest.raises(ValueError, match="3 weights that add up to 1"):
        replace(SMALL, blends=blends)


@pytest.mark.parametrize("weighing", [ACROSS_LABORATORIES, comparison.WITHIN_LABORATORY], ids=["across", "within"])
@pytest.mark.parametrize("kind", Kind)
def test_without_a_kind(weighing: Weighing, kind: Kind) -> None:
    """No part of the kind is left, all others are, each once, and the weights of each blend add up to 1."""
    fewer = weighing.without(kind)
    expected = [part for part in PARTS if part in weighing.parts and part.kind is not kind]
    assert sorted(fewer.parts) == sorted(expected)
    assert 1 <= len(fewer.blends) <= len(weighing.blends)


def test_below_the_blends_each_group_is_compared_alone() -> None:
    """Two blends of three groups make five rows of weights; the blends name a class, and the rest is evidence."""
    assert np.array_equal(SMALL.weights, [*SMALL.blends, (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    logs = np.array([[3.0, 1.0], [2.0, 5.0], [7.0, 8.0], [0.0, 1.0], [2.0, 2.0]])
    named, alone = named_and_alone(logs, SMALL)
    assert named.tolist() == [2.0, 1.0]
    assert np.array_equal(alone, logs[2:])


def test_the_papers_weighing_names_by_products() -> None:
    """A class is the mean of its two nearest persons' products, as log(1 − product²); rounding above 1 makes no NaN."""
    paper = by_paper(0.7)
    assert paper.groups == (((Kind.EIGEN, 0.7),),)
    assert (paper.as_in_paper, paper.eigenvectors) == (True, 1)
    axes = np.array([[0.6, 0], [0.4, 0], [0.2, 0.9], [-1.0000001, 0], [0, 1]], dtype=np.float32)
    # Two persons and a third in the first class, of whom the third is far; one person each in the others.
    whose = np.array([[0, 0], [0, 1], [0, 2], [1, 0], [2, 0]])
    comparer = PaperComparer(Comparer.of(paper, [axes[:, None].astype(np.float16)], axes, whose))
    (found,) = comparer.distances(np.array([[1, 0]], dtype=np.float32))
    assert found.named == pytest.approx(np.log([0.751, 0.001, 1.001]))
    assert found.scores == pytest.approx([0.6, 1.0000001, 0.0])
    assert not found.judged.size


def _windows(*, people: int = 3, seed: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Make windows of four classes that differ along two axes; people differ along the third, and far more."""
    generator = np.random.default_rng(seed)
    classes = np.repeat(np.arange(4), 10 * people)
    who = np.tile(np.repeat(np.arange(people), 10), 4)
    means = generator.normal(size=(4, 6)) * [2, 2, 0, 0, 0, 0]
    own = generator.normal(size=(4, people, 6)) * [0, 0, 9, 0, 0, 0]
    noise = generator.normal(size=(len(classes), 6)) * 0.3
    return means[classes] + own[classes, who] + noise, np.stack([classes, who], axis=1)


@pytest.mark.parametrize("shrinkage", [0.2, 1.0])
def test_the_same_motion_by_two_people_has_mean_squared_distance_1(shrinkage: float) -> None:
    """From each window to the nearest of its class by another person, mean over classes; so parts can be added up."""
    numbers, whose = _windows()
    vectors = learned_metric(numbers, whose, shrinkage=shrinkage, kept=6).place(numbers)
    squared = np.square(vectors[:, None] - vectors).sum(axis=2)
    same = whose[:, None] == whose
    nearest = np.where(same[..., 0] & ~same[..., 1], squared, np.inf).min(axis=1)
    assert np.mean([nearest[whose[:, 0] == each].mean() for each in range(4)]) == pytest.approx(1.0, rel=0.01)


def test_the_nearest_are_looked_for_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some windows after the others find the same nearest as all at once."""
    numbers, whose = _windows()
    at_once = learned_metric(numbers, whose, shrinkage=0.2, kept=6).place(numbers)
    monkeypatch.setattr(comparison, "_AT_ONCE", 7)
    parts = learned_metric(numbers, whose, shrinkage=0.2, kept=6).place(numbers)
    squared = [comparison.squared_distances(each, each) for each in (parts, at_once)]
    np.testing.assert_allclose(*squared, rtol=1e-3, atol=1e-2)


@pytest.mark.parametrize("few", [False, True])
def test_one_person_teaches_nothing_but_principal_axes(*, few: bool) -> None:
    """All the axes have one length, and are the windows' principal axes, also of fewer windows than numbers."""
    numbers, whose = _windows(people=1)
    if few:
        numbers, whose = numbers[::10], whose[::10]
    metric = learned_metric(numbers, whose, shrinkage=0.2, kept=2)
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
    same = np.tile(np.random.default_rng(1).normal(size=(1, 4, 12)), (2, 1, 1)).reshape(8, 12)
    for numbers in (np.ones((8, 12)), same):
        whose = np.stack([np.tile(np.arange(4), 2), np.repeat([0, 1], 4)], axis=1)
        assert np.isfinite(learned_metric(numbers, whose, shrinkage=0.2, kept=3).axes).all()


@pytest.mark.parametrize(("kept", "axes"), [(3, 3), (64, 6)])
def test_no_more_axes_are_kept_than_asked_for(kept: int, axes: int) -> None:
    """Nor more than there are numbers; all are of half precision."""
    numbers, whose = _windows()
    metric = learned_metric(numbers, whose, shrinkage=0.2, kept=kept)
    assert metric.axes.shape == (6, axes)
    assert np.array_equal(metric.axes.astype(np.float16), metric.axes)


def test_classes_of_one_person_teach_nothing_about_people() -> None:
    """Between the windows of two people the distance is 1, wherever one person's other classes lie."""
    numbers, whose = _windows(people=2)
    shared = whose[:, 0] < 2
    numbers[~shared] *= 50
    kept = shared | (whose[:, 1] == 0)
    vectors = learned_metric(numbers[kept], whose[kept], shrinkage=0.2, kept=6).place(numbers[shared])
    same = whose[shared][:, None] == whose[shared]
    squared = np.square(vectors[:, None] - vectors).sum(axis=2)
    assert np.where(same[..., 0] & ~same[..., 1], squared, np.inf).min(axis=1).mean() == pytest.approx(1.0, rel=0.05)


def test_it_adds_how_unlikely_a_class_is() -> None:
    """Log distances grow by .06 of each class's negative log probability; parts lie one after another."""
    draw, names = np.random.default_rng(3), [*"aabbbccccc", *"abc" * 5]
    windows = draw.normal(size=(len(names), 4)) + np.array([[ord(name) - 97, 0, 0, 0] for name in names])
    head, asked = Head.learned(windows.astype(np.float32), names), draw.normal(size=4)
    added, expected = head.added([asked[:3], asked[3:]]), unlikely(asked, windows, names)
    assert np.allclose(added, [0.06 * expected[name] for name in "abc"], atol=1e-5)


def test_of_some_classes() -> None:
    """Classes that are left compete as if no other had taught; of a class that did not teach nothing is known."""
    draw, names = np.random.default_rng(4), [*"abc" * 9]
    head = Head.learned(draw.normal(size=(27, 5)).astype(np.float32), names)
    some = head.of_classes(("c", "a"))
    added = some.added([draw.normal(size=5)])
    assert np.exp(-added / 0.06).sum() == pytest.approx(1)
    assert np.array_equal(some.factors, head.factors[:, [2, 0]])
    assert head.of_classes(("a", "d")) is None


def test_motions_stand_behind_others_of_the_same_person(people: MotionLibrary) -> None:
    """At most two seconds of another motion of the person come first, and windows that hold none of it are left out."""
    long = replace(people.motions[0], positions=np.tile(people.motions[0].positions, (4, 1, 1)))
    measured = Measured.of(replace(people, motions=(long, *people.motions[1:])), 0.4)
    behind, others = measured.behind_others(), set[int]()
    for place, (clip, joined) in enumerate(zip(measured.clips, behind.clips, strict=True)):
        before = joined.frames - clip.frames
        assert np.array_equal(joined.positions[before:], clip.positions)
        own = [each for each in measured.clips if each.actor == clip.actor]
        last = joined.positions[:before]
        from_place = next(i for i, each in enumerate(own) if np.array_equal(each.positions[-before:], last))
        others.add(from_place)
        assert 0 < before <= 2 * clip.frame_rate
        ends = window_ends(clip, 0.4)
        assert (behind.ends[place] - before).tolist() == [end for end in ends if end <= 2 * clip.frame_rate]
    assert len(others) > 1
    assert len(behind.motions) == sum(map(len, behind.ends)) < len(measured.motions)


def test_where_it_helps(people_index: WindowIndex, builtin: MotionLibrary) -> None:
    """Only where a library's own people teach all parts together, and while all classes are theirs."""
    index, people = people_index, people_index.library
    assert index.head.classes == people.classes
    assert WindowIndex.of(people, weighing=ACROSS_LABORATORIES).head is None
    assert WindowIndex.of(MotionLibrary.of_clips(stick_clips(actors=("aa", "bb")))).head is None
    assert WindowIndex.of(people, teacher=replace(people)).head is None
    assert builtin.judged_by_strangers  # so that it is compared across laboratories
    fresh = replace(people.motions[0], class_name="fresh")
    more, another = index.with_motions([people.motions[0]]), index.with_motions([fresh])
    for compared, helps in ((index, True), (more, True), (another, False)):
        directions, weighing = compared.basis.directions, compared.comparison.weighing
        generator = np.random.default_rng(5)
        numbers = {
            part: generator.normal(size=(4, directions.shape[1]) if part.kind is Kind.EIGEN else len(directions))
            for part in weighing.parts
        }
        (found,) = compared.distances([Signature(numbers, np.zeros(directions.shape[1]), 0.1, 0.5, 0.5)])
        assert np.allclose(found.named, named_and_alone(found.logs, weighing)[0]) != helps
