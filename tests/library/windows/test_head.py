"""Tests of the linear head: its probabilities, what teaches it, and where it helps to name."""

from dataclasses import replace

import numpy as np
import pytest
from naive_windows import unlikely
from synthetic import stick_clips

from kinespace.library import MotionLibrary, WindowIndex
from kinespace.library.signature.parts import Kind, Signature
from kinespace.library.windows.comparer import Head
from kinespace.library.windows.comparison import ACROSS_LABORATORIES
from kinespace.library.windows.cutting import window_ends
from kinespace.library.windows.index import Measured


@pytest.fixture(scope="module")
def people() -> MotionLibrary:
    """Give three classes by three people."""
    return MotionLibrary.of_clips(stick_clips(actors=("aa", "bb", "cc")))


def test_it_adds_how_unlikely_a_class_is() -> None:
    """Log distances grow by .06 of each class's negative log probability; parts lie one after another."""
    draw, names = np.random.default_rng(3), [*"aabbbccccc", *"abc" * 5]
    windows = draw.normal(size=(len(names), 4)) + np.array([[ord(name) - 97, 0, 0, 0] for name in names])
    head, asked = Head.learned(windows.astype(np.float32), names), draw.normal(size=4)
    added = head.added([asked[:3], asked[3:]])
    expected = unlikely(asked, windows, names)
    assert np.allclose(added, [0.06 * expected[name] for name in "abc"], atol=1e-5)


def test_windows_that_are_the_same_teach() -> None:
    """Where no class spreads at all, its own windows are still the likeliest."""
    head = Head.learned(np.repeat(np.eye(3, dtype=np.float32), 4, axis=0), [*"aaaabbbbcccc"])
    added = head.added([np.eye(3)[1]])
    assert np.isfinite(added).all()
    assert added.argmin() == 1


def test_of_some_classes() -> None:
    """Classes that are left compete as if no other had taught; of a class that did not teach nothing is known."""
    draw, names = np.random.default_rng(4), [*"abc" * 9]
    head = Head.learned(draw.normal(size=(27, 5)).astype(np.float32), names)
    some = head.of_classes(("c", "a"))
    assert some is not None
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


def test_where_it_helps(people: MotionLibrary, builtin: MotionLibrary) -> None:
    """Only where a library's own people teach all parts together, and while all classes are theirs."""
    index = WindowIndex.of(people)
    assert index.head
    assert index.head.classes == people.classes
    assert WindowIndex.of(people, weighing=ACROSS_LABORATORIES).head is None
    assert WindowIndex.of(MotionLibrary.of_clips(stick_clips(actors=("aa", "bb")))).head is None
    assert WindowIndex.of(people, teacher=replace(people)).head is None
    assert builtin.judged_by_strangers  # so that it is compared across laboratories
    fresh = replace(people.motions[0], class_name="fresh")
    more, another = index.with_motions([people.motions[0]]), index.with_motions([fresh])
    for compared, helps in ((index, True), (more, True), (another, False)):
        generator, directions, weighing = (
            np.random.default_rng(5),
            compared.basis.directions,
            compared.comparison.weighing,
        )
        numbers = {
            part: generator.normal(size=(4, directions.shape[1]) if part.kind is Kind.EIGEN else len(directions))
            for part in weighing.parts
        }
        found = compared.distances(Signature(numbers, np.zeros(directions.shape[1]), 0.1, 0.5, 0.5))
        assert np.allclose(found.named, weighing.named(found.logs)) != helps
