from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from naive_windows import NaiveComparison, NaiveMetric, as_vector, best_products, log_distances

from kinespace.library import MotionLibrary, Skeleton
from kinespace.library.motion_library import NOTHING
from kinespace.library.windows.comparison import ACROSS_LABORATORIES, WITHIN_LABORATORY
from kinespace.library.windows.cutting import CutWindows, window_ends
from kinespace.library.windows.index import Blocks, WindowIndex, opened, teacher_of
from kinespace.library.windows.parts import EIGENVECTORS, PARTS, Kind
from kinespace.library.windows.rejection import learned_rejection
from kinespace.tools.feeding.joint_sets import joints_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kinespace.library.clip import Clip
    from kinespace.library.windows.metric import Metric
    from kinespace.library.windows.parts import Part

#: Classes left out of the built-in library for a smaller one that keeps what was learned of it.
LEFT_OUT = (
    "elbowToKnee1RepsLelbowStart",
    "grabHighR",
    "hopBothLegs1hops",
    "jogLeftCircle4StepsRstart",
    "kickLFront1Reps",
    "rotateArmsBothBackward1Reps",
    "sneak2StepsLStart",
    "throwBasketball",
)


@pytest.fixture(scope="module")
def across(builtin: MotionLibrary) -> WindowIndex:
    """Give an index that weighs each part for itself: three classes by three people."""
    return WindowIndex.of(builtin.without(classes=LEFT_OUT, actors=("bk", "tr")))


@pytest.fixture(scope="module", params=["within", "across"])
def index(request: pytest.FixtureRequest, small_index: WindowIndex, across: WindowIndex) -> WindowIndex:
    """Give an index of either weighing."""
    return small_index if request.param == "within" else across


@pytest.fixture(scope="module")
def asking(builtin: MotionLibrary) -> tuple[Clip, ...]:
    """Give motions of another person, one of each of three classes."""
    first = {clip.class_name: clip for clip in builtin.motions if clip.actor == "bk"}
    return tuple(first[name] for name in ("kickLFront1Reps", "lieDownFloor", "squat1Reps"))


def _numbers(index: WindowIndex, clip: Clip, every: float = 0.4) -> list[Mapping[Part, np.ndarray]]:
    """Give the numbers of a motion's windows one by one."""
    ends = window_ends(clip, every)
    cut = CutWindows([clip], [ends], index.body, index.basis).numbers()
    return [{part: cut[part][place].copy() for part in PARTS} for place in range(len(ends))]


def _whose(index: WindowIndex) -> list[tuple[str, str]]:
    return [(index.library.motions[each].class_name, index.library.motions[each].actor) for each in index.motions]


def _naive(metric: Metric | None) -> NaiveMetric | None:
    return metric and NaiveMetric(metric.origin.astype(float), metric.axes.astype(float))


def _vectors(index: WindowIndex, numbers: Mapping[Part, np.ndarray]) -> list[np.ndarray]:
    """Place a window by the twin; eigen parts that stand alone stay scaled eigenvectors."""
    groups, comparison = index.comparison.weighing.groups, index.comparison
    parts = {part: _naive(metric) for part, metric in comparison.parts.items()}
    twin = NaiveComparison(groups, parts, [_naive(metric) for metric in comparison.groups], ())
    whole = {part: each.T @ each if part.kind is Kind.EIGEN else each for part, each in numbers.items()}
    placed = twin.place(whole)
    return [
        numbers[group[0]] if len(group) == 1 and group[0].kind is Kind.EIGEN else vector
        for group, vector in zip(groups, placed, strict=True)
    ]


def _mean_distances(index: WindowIndex, clip: Clip) -> np.ndarray:
    """Give the log distance of each class, mean over all windows of a motion."""
    views = np.array([index.log_distances(numbers) for numbers in _numbers(index, clip)])
    return views[:, : len(index.comparison.weighing.views)].min(axis=1).mean(axis=0)


def _guess(index: WindowIndex, clip: Clip) -> str:
    """Name the class nearest to a motion."""
    return index.classes[int(_mean_distances(index, clip).argmin())]


@pytest.mark.slow
def test_log_distances_by_brute_force(index: WindowIndex, asking: tuple[Clip, ...], arithmetic: str) -> None:
    """For each view, each group alone and each class they are the mean of the two nearest people's nearest windows."""
    windows = list(zip(*(each.astype(float) for each in index.vectors), strict=True))
    for clip in asking:
        for numbers in _numbers(index, clip)[::3]:
            twin = log_distances(_vectors(index, numbers), windows, index.comparison.weighing.weights, _whose(index))
            assert np.allclose(index.log_distances(numbers), twin, atol=2e-3), arithmetic


def test_eigenvector_scores_by_brute_force(index: WindowIndex, asking: tuple[Clip, ...], arithmetic: str) -> None:
    """A class's score is its largest |inner product|, for either sign of the eigenvector."""
    for clip in asking:
        cut = CutWindows([clip], [window_ends(clip, 0.4)], index.body, index.basis)
        vector = cut.eigenpairs[2.0].vectors[-1, 0].copy()
        twin = best_products(vector, index.eigenvectors, [name for name, _ in _whose(index)])
        assert tuple(twin) == index.classes
        assert index.eigenvector_scores(vector) == pytest.approx(list(twin.values()), abs=1e-4), arithmetic
        assert index.eigenvector_scores(-vector) == pytest.approx(list(twin.values()), abs=1e-4)


def test_own_distances_by_brute_force(index: WindowIndex) -> None:
    """A window of the library asks the others as a live one does, its own person left out."""
    whose = _whose(index)
    windows = list(zip(*(each.astype(float) for each in index.vectors), strict=True))
    asking = len(index) // 2
    others = [place for place, (_, person) in enumerate(whose) if person != whose[asking][1]]
    left_out = np.ones(len(index), dtype=bool)
    left_out[others] = False
    weights = index.comparison.weighing.weights
    twin = log_distances(windows[asking], [windows[each] for each in others], weights, [whose[each] for each in others])
    assert np.allclose(index.own_distances(asking, left_out), twin, atol=2e-3)


def test_a_class_without_windows_left_is_infinitely_far(small_index: WindowIndex) -> None:
    """So it is never the nearest."""
    left_out = np.array([name == "squat1Reps" for name, _ in _whose(small_index)])
    assert np.isinf(small_index.own_distances(0, left_out)).any(axis=0).tolist() == [False, False, True]


def test_motions_of_new_people_are_nearest_to_their_class(index: WindowIndex, asking: tuple[Clip, ...]) -> None:
    """Motions of a person whom the library does not know are nearest to their own class, if it has the class."""
    known = [clip for clip in asking if clip.class_name in index.classes]
    assert len(known) >= 2
    assert [_guess(index, clip) for clip in known] == [clip.class_name for clip in known]


def test_nothing_competes(small_library: MotionLibrary, asking: tuple[Clip, ...]) -> None:
    """Motions of the class `nothing` have windows, and similar motions are nearest to them."""
    index = WindowIndex.of(small_library.renamed({"squat1Reps": NOTHING}))
    assert index.library.classes == ("kickLFront1Reps", "lieDownFloor")
    assert index.classes == ("kickLFront1Reps", "lieDownFloor", NOTHING)
    assert [_guess(index, clip) for clip in asking] == ["kickLFront1Reps", "lieDownFloor", NOTHING]


def test_without_some_motions(small_index: WindowIndex, asking: tuple[Clip, ...], arithmetic: str) -> None:
    """The other classes keep their distances, and a class without motions is gone."""
    numbers = _numbers(small_index, asking[0])[-1]
    gone = [place for place, clip in enumerate(small_index.library.motions) if clip.class_name == "lieDownFloor"]
    fewer = small_index.without(gone)
    assert fewer.classes == ("kickLFront1Reps", "squat1Reps")
    assert not set(fewer.motions) & set(gone)
    assert np.allclose(fewer.log_distances(numbers), small_index.log_distances(numbers)[:, [0, 2]]), arithmetic


def _same_windows(index: WindowIndex, other: WindowIndex) -> None:
    """Demand the same windows, but for one step of half precision.

    Some processors' kernels sum a product of many rows in another order than a product of few.
    """
    for one, another in zip((*index.vectors, index.eigenvectors), (*other.vectors, other.eigenvectors), strict=True):
        np.testing.assert_allclose(one, another, rtol=2.0**-10, atol=1e-6)


@pytest.mark.slow
def test_motions_added_are_as_if_opened_with_them(small_library: MotionLibrary, builtin: MotionLibrary) -> None:
    """Where others teach, basis and metrics are the same, and so is every window."""
    alone = small_library.without(actors=("dg", "mm"))
    clips = [clip for clip in builtin.motions if clip.class_name == "sneak2StepsLStart" and clip.actor == "bd"]
    index = WindowIndex.of(alone, small_library).with_motions(clips[:2])
    anew = WindowIndex.of(alone.with_motions(clips[:2]), small_library)
    assert index.classes == anew.classes == ("kickLFront1Reps", "lieDownFloor", "sneak2StepsLStart", "squat1Reps")
    assert index.motions.tolist() == anew.motions.tolist()
    assert len(index.library) == len(alone) + 2
    _same_windows(index, anew)


def test_added_motions_use_the_learned_numbers(small_index: WindowIndex, asking: tuple[Clip, ...]) -> None:
    """A library that teaches itself keeps basis, metrics and rejection, and a new motion is nearest to itself."""
    taught = replace(asking[0], class_name="taught", actor="new")
    index = small_index.with_motions([taught])
    assert index.comparison is small_index.comparison
    assert index.basis is small_index.basis
    assert index.rejection is small_index.rejection
    assert _guess(index, taught) == "taught"
    kept = [place for place, motion in enumerate(index.library.motions) if motion.class_name != "taught"]
    assert index.of_some(kept).motions.tolist() == small_index.motions.tolist()
    assert index.of_some(kept).library.motions == small_index.library.motions
    numbers = _numbers(small_index, asking[1])[-1]
    assert np.allclose(index.of_some(kept).log_distances(numbers), small_index.log_distances(numbers))


def test_motions_too_short_are_not_added(small_index: WindowIndex) -> None:
    """Adding a clip that is too short for a window is refused."""
    clip = small_index.library.motions[0]
    with pytest.raises(ValueError, match="long enough for a window"):
        small_index.with_motions([replace(clip, positions=clip.positions[:6])])


def test_a_last_motion_may_fill_a_piece(
    small_library: MotionLibrary, small_index: WindowIndex, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Motions whose windows are cut one motion at a time equal those cut all at once."""
    index = small_index
    clips = [replace(clip, class_name="mine", actor="") for clip in small_library.motions[:3]]
    whole = index.with_motions(clips)
    monkeypatch.setattr("kinespace.library.windows.index._PIECE", 1)
    pieces = index.with_motions(clips)
    _same_windows(pieces, whole)


@pytest.mark.slow
def test_a_large_library_is_opened_in_pieces(
    small_library: MotionLibrary, small_index: WindowIndex, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Windows cut a few motions at a time equal windows cut all at once; lessons are a share of them."""
    alone = small_library.without(actors=("dg", "mm"))
    whole = WindowIndex.of(alone, small_library)
    monkeypatch.setattr("kinespace.library.windows.index._PIECE", 20)
    pieces = WindowIndex.of(alone, small_library)
    assert pieces.motions.tolist() == whole.motions.tolist()
    for one, other in zip((*pieces.vectors, pieces.eigenvectors), (*whole.vectors, whole.eigenvectors), strict=True):
        np.testing.assert_allclose(np.abs(one), np.abs(other), atol=2e-3)
    monkeypatch.setattr("kinespace.library.windows.index._MAX_LESSONS", len(small_index) // 3)
    fewer = WindowIndex.of(small_library)
    assert fewer.motions.tolist() == small_index.motions.tolist()
    assert [_guess(fewer, clip) for clip in small_library.motions[::3]] == [
        clip.class_name for clip in small_library.motions[::3]
    ]


def test_some_motions_and_the_others_are_all(small_index: WindowIndex) -> None:
    """Every window is of one of the two."""
    some = [0, 5, 17]
    own, others = small_index.of_some(some), small_index.without(some)
    assert own.library.motions == tuple(small_index.library.motions[place] for place in some)
    assert set(own.motions) == {0, 1, 2}
    assert len(own) + len(others) == len(small_index)


def test_a_second_person_must_agree(small_index: WindowIndex) -> None:
    """A motion that one person of the library performs is no nearer than the mean with the next person allows."""
    place = 4
    clip = small_index.library.motions[place]
    numbers = _numbers(small_index, clip)[-1]
    class_index = small_index.classes.index(clip.class_name)
    motions = small_index.library.motions
    by_person = sorted(
        small_index.of_some(
            [each for each, own in enumerate(motions) if (own.class_name, own.actor) == (clip.class_name, actor)]
        ).log_distances(numbers)[0, 0]
        for actor in small_index.library.actors
    )
    assert by_person[0] < by_person[1] - 0.1
    agreed = small_index.log_distances(numbers)[0, class_index]
    assert agreed == pytest.approx((by_person[0] + by_person[1]) / 2, abs=1e-3)


def test_blocks() -> None:
    """Two classes, one of three people and one of one person."""
    blocks = Blocks.of(np.array([0, 0, 0, 0, 1, 1]), ["a", "a", "b", "c", "a", "a"])
    assert blocks.starts.tolist() == [0, 2, 3, 4]
    assert blocks.class_starts.tolist() == [0, 4]
    nearest = blocks.nearest(np.array([[5.0, 3.0, 1.0, 9.0, 7.0, 8.0]]))
    assert nearest.tolist() == [[3.0, 1.0, 9.0, 7.0]]
    assert blocks.agreed(nearest).tolist() == [[2.0, 7.0]]
    assert blocks.agreed(np.array([np.inf, 1.0, np.inf, np.inf])).tolist() == [1.0, np.inf]


def test_fewer_joints(small_library: MotionLibrary, asking: tuple[Clip, ...]) -> None:
    """A library of Kinect 1's twenty joints is opened and recognises as before."""
    joints = joints_of("kinect20")
    index = WindowIndex.of(small_library.restricted_to(joints))
    assert len(index.library.skeleton.joints) == 20
    assert [_guess(index, clip.restricted_to(joints)) for clip in asking] == [clip.class_name for clip in asking]


def test_a_library_without_parents(small_library: MotionLibrary, asking: tuple[Clip, ...]) -> None:
    """Its distances stand in for segments, and it recognises as before."""
    skeleton = Skeleton(small_library.skeleton.joints)
    motions = tuple(replace(clip, skeleton=skeleton) for clip in small_library.motions)
    index = WindowIndex.of(MotionLibrary(skeleton, motions))
    assert not len(index.body.segments)
    assert [_guess(index, replace(clip, skeleton=skeleton)) for clip in asking] == [clip.class_name for clip in asking]


def test_one_class(small_library: MotionLibrary, asking: tuple[Clip, ...], arithmetic: str) -> None:
    """There is one distance for each view, and it says how near a motion is."""
    index = WindowIndex.of(small_library.without(classes=("lieDownFloor", "squat1Reps")))
    assert index.classes == ("kickLFront1Reps",)
    assert index.log_distances(_numbers(index, asking[0])[-1]).shape == (len(index.comparison.weighing.weights), 1)
    near, *far = (float(_mean_distances(index, clip)[0]) for clip in asking)
    assert near < min(far), arithmetic


def test_one_motion(sticks: MotionLibrary, arithmetic: str) -> None:
    """It is nearest to itself: no window is nearer than the one that asks."""
    index = WindowIndex.of(replace(sticks, motions=sticks.motions[:1]))
    assert set(index.motions) == {0}
    own = index.log_distances(_numbers(index, sticks.motions[0])[-1])
    other = index.log_distances(_numbers(index, sticks.motions[-1])[-1])
    assert (own < other).all(), arithmetic


def test_a_motion_too_short_for_a_window_stays(small_library: MotionLibrary) -> None:
    """It is in the library, and no window is its."""
    first = small_library.motions[0]
    short = replace(first, positions=first.positions[:6], class_name="blink")
    index = WindowIndex.of(replace(small_library, motions=(short, *small_library.motions)))
    assert index.library.motions[0] is short
    assert 0 not in index.motions
    assert "blink" in index.library.classes
    assert "blink" not in index.classes


def test_nothing_but_motions_too_short(sticks: MotionLibrary) -> None:
    """A library without a window cannot be opened."""
    short = tuple(replace(clip, positions=clip.positions[:4]) for clip in sticks.motions)
    with pytest.raises(ValueError, match="long enough for a window"):
        WindowIndex.of(replace(sticks, motions=short))


def test_the_persons_who_teach_a_library(
    builtin: MotionLibrary, small_library: MotionLibrary, sticks: MotionLibrary
) -> None:
    """Three persons who share classes teach their library; else the built-in persons do, if they have its joints."""
    assert teacher_of(small_library) is small_library
    alone = small_library.without(actors=("dg", "mm"))
    assert teacher_of(alone).actors == builtin.actors
    assert teacher_of(sticks) is sticks
    joints = joints_of("kinect20")
    taught = teacher_of(alone.restricted_to(joints))
    assert taught.actors == builtin.actors
    assert taught.skeleton.joints == alone.restricted_to(joints).skeleton.joints


def test_people_who_share_no_class_do_not_teach(builtin: MotionLibrary, small_library: MotionLibrary) -> None:
    """Without a shared class nobody shows how people differ in the same motion."""
    only = zip(small_library.classes, small_library.actors, strict=True)
    wanted = set(only)
    motions = tuple(clip for clip in small_library.motions if (clip.class_name, clip.actor) in wanted)
    assert teacher_of(replace(small_library, motions=motions)).actors == builtin.actors


def test_a_teacher_knows_joints_in_any_order(small_library: MotionLibrary) -> None:
    """The built-in people's joints are put in the order of the library that they teach."""
    alone = small_library.without(actors=("dg", "mm"))
    skeleton = alone.skeleton.restricted_to(range(20))
    turned = Skeleton(skeleton.joints[::-1])
    motions = tuple(clip.restricted_to(skeleton.joints).as_of(turned) for clip in alone.motions)
    assert teacher_of(MotionLibrary(turned, motions)).skeleton.joints == turned.joints


def test_weighings(small_library: MotionLibrary, across: WindowIndex, small_index: WindowIndex) -> None:
    """A library learned in another laboratory brings its own weighing; any weighing may be asked for."""
    assert small_index.comparison.weighing is WITHIN_LABORATORY
    assert across.comparison.weighing is ACROSS_LABORATORIES
    asked = WindowIndex.of(small_library, weighing=ACROSS_LABORATORIES)
    assert [each.ndim for each in asked.vectors] == [3, 3, 2, 2, 2]
    assert asked.vectors[0].shape[1] == EIGENVECTORS


def test_without_some_parts_the_own_motions_teach_rejection(across: WindowIndex) -> None:
    """Numbers that strangers taught are for all groups; with fewer groups the library's own motions teach them."""
    asked = WindowIndex.of(across.library, weighing=ACROSS_LABORATORIES.without(Kind.EIGEN))
    assert np.array_equal(asked.rejection.weights, learned_rejection(asked).weights)
    assert len(asked.rejection.typical) == 6


def test_a_library_is_opened_once(small_library: MotionLibrary) -> None:
    """Several recognisers share its windows."""
    assert opened(small_library) is opened(small_library)


def test_vectors_of_flattened_matrices_fit_the_twins() -> None:
    """The twin writes a matrix as the product does: upper triangle, row by row."""
    assert as_vector(np.array([[1.0, 2.0], [2.0, 3.0]])) == pytest.approx([1.0, 2.0 * np.sqrt(2.0), 3.0])
