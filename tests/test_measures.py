"""What is measured of a window: against loops, and what must not change it."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import naive_windows
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st
from synthetic import STICK, stick_clip, stick_clips

from library.comparison import MEASURES
from library.distances import distance_rows
from library.measures import (
    BASIS_SIZE,
    FEWEST_FRAMES,
    SHAPE_FLOOR,
    Basis,
    Body,
    Kind,
    Measure,
    learned_basis,
    measured,
    shape_of,
)
from library.motionlibrary import MotionLibrary
from library.retrieval import turned
from library.skeleton import Skeleton
from stream.feeds import builtin_preset

if TYPE_CHECKING:
    from collections.abc import Callable

    from library.clip import Clip

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

#: Measures that need no basis.
OF_DISTANCES = (Kind.SPREAD, Kind.POSTURE)
#: Relative error of a number that is kept in single precision.
SINGLE = 2.0**-23


def _rows(clip: Clip) -> np.ndarray:
    return distance_rows(clip.positions, clip.skeleton)


def _pairs(skeleton: Skeleton) -> list[tuple[int, int]]:
    return list(combinations(range(len(skeleton.joints)), 2))


def _random_covariance(generator: np.random.Generator, size: int) -> np.ndarray:
    return np.cov(generator.normal(size=(3 * size, size)) @ generator.normal(size=(size, size)), rowvar=False)


def _plain(directions: np.ndarray) -> Basis:
    """Make a basis of directions in which every pair counts as it is."""
    return Basis(directions, np.ones(len(directions)))


def _stick_basis(directions: int = 6) -> Basis:
    return _plain(np.random.default_rng(5).normal(size=(15, directions)))


def _all_measured(clip: Clip, ends: np.ndarray) -> dict[Measure, np.ndarray]:
    body, basis = Body.of(clip.skeleton), _stick_basis()
    return {
        measure: measured(_rows(clip), clip.frame_rate, ends, measure, body=body, basis=basis) for measure in MEASURES
    }


# --- the body ----------------------------------------------------------------------------------------------------


def test_the_bodys_segments_and_paths_are_those_walked(some_clips: tuple[Clip, ...]) -> None:
    """Of the 31 joints, 30 segments are named, and between two joints lie those met walking from one to the other."""
    skeleton = some_clips[0].skeleton
    body, pairs = Body.of(skeleton), _pairs(skeleton)
    segments = [pairs[index] for index in body.segments]
    assert sorted(segments) == sorted(naive_windows.segments(skeleton.parents))
    for path, (first, second) in zip(body.paths, pairs, strict=True):
        crossed = [segment for segment, there in zip(segments, path, strict=True) if there == 1.0]
        assert sorted(crossed) == sorted(naive_windows.path_between(first, second, skeleton.parents))
        assert set(path) <= {0.0, 1.0}


@given(st.integers(0, 2**32 - 1), st.integers(2, 9))
def test_paths_of_any_tree_are_those_walked(seed: int, joints: int) -> None:
    """However the joints hang together, and in whatever order they stand, paths are those of walking the tree."""
    generator = np.random.default_rng(seed)
    names = generator.permutation(joints)
    parents = [-1] * joints
    for place in range(1, joints):
        parents[names[place]] = int(names[generator.integers(place)])
    skeleton = Skeleton(tuple(f"joint {index}" for index in range(joints)), tuple(parents))
    body, pairs = Body.of(skeleton), _pairs(skeleton)
    for path, (first, second) in zip(body.paths, pairs, strict=True):
        crossed = [pairs[body.segments[index]] for index in np.flatnonzero(path)]
        assert sorted(crossed) == sorted(naive_windows.path_between(first, second, parents))


@pytest.mark.parametrize(
    "skeleton",
    [pytest.param(Skeleton(STICK.joints), id="no parents"), pytest.param(STICK.without_segments(), id="no segments")],
)
def test_a_skeleton_without_segments_has_no_measures(skeleton: Skeleton) -> None:
    """Without parents, or with the segments left out of its pairs, a skeleton is refused."""
    with pytest.raises(ValueError, match="skeleton: expected parents and segments among the pairs"):
        Body.of(skeleton)


@pytest.mark.parametrize(
    "parents",
    [
        pytest.param((-1, 0, 1, -1, 3, 0), id="two roots"),
        pytest.param((1, 2, 0, 0, 0, 0), id="no root"),
        pytest.param((-1, 2, 1, 1, 1, 0), id="a circle"),
        pytest.param((-1, 0, 3, 4, 2, 0), id="a circle of three"),
    ],
)
def test_parents_that_make_no_tree_are_refused(parents: tuple[int, ...]) -> None:
    """Joints in two pieces, or going round in a circle, are refused and not walked for ever."""
    with pytest.raises(ValueError, match="skeleton: expected parents that make one tree"):
        Body.of(Skeleton(STICK.joints, parents))


# --- the body of fewer joints ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def kinect() -> Skeleton:
    """Give the joints that a Kinect has of the built-in skeleton's."""
    skeleton = MotionLibrary.builtin().restricted_to(builtin_preset("kinectv2").joints).skeleton
    assert 15 < len(skeleton.joints) < 31
    return skeleton


def _kept(skeleton: Skeleton, fewer: Skeleton) -> np.ndarray:
    """Find the fewer joints' pairs among all by their names."""
    names = [(skeleton.joints[a], skeleton.joints[b]) for a, b in skeleton.pairs]
    return np.array([names.index((fewer.joints[a], fewer.joints[b])) for a, b in fewer.pairs])


def test_fewer_joints_have_the_whole_bodys_size(some_clips: tuple[Clip, ...], kinect: Skeleton) -> None:
    """On the rows learned from, sizes and ways through the body are in the mean the whole body's, and always near."""
    skeleton = some_clips[0].skeleton
    whole, pairs = Body.of(skeleton), _kept(skeleton, kinect)
    rows = np.array([_rows(clip).mean(axis=0) for clip in some_clips])
    fewer = whole.restricted_to(kinect, pairs, rows)
    sizes = whole.size(rows) / fewer.size(rows[:, pairs])
    lengths = whole.lengths(rows)[:, pairs] / fewer.lengths(rows[:, pairs])
    assert sizes.mean() == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(lengths.mean(axis=0), 1.0, rtol=SINGLE)
    np.testing.assert_allclose(sizes, 1.0, atol=0.02)
    assert Body.of(kinect).size(rows[:, pairs]) != pytest.approx(whole.size(rows), rel=0.02)


def test_one_row_is_measured_as_by_the_whole_body() -> None:
    """Learned from one person's row, postures are the whole body's to the last pair, and so is the twin's way."""
    row = _rows(stick_clip("bow"))[:1]
    whole, skeleton = Body.of(STICK), STICK.restricted_to([0, 2, 3, 4])
    pairs = _kept(STICK, skeleton)
    fewer = whole.restricted_to(skeleton, pairs, row)
    assert fewer.size(row[:, pairs]) == pytest.approx(whole.size(row), rel=1e-12)
    np.testing.assert_allclose(fewer.posture(row[:, pairs]), whole.posture(row)[:, pairs], rtol=SINGLE)
    means = dict(zip(_pairs(STICK), row[0].tolist(), strict=True))
    for length, pair in zip(fewer.lengths(row[:, pairs])[0], pairs, strict=True):
        way = naive_windows.path_between(*_pairs(STICK)[pair], STICK.parents)
        assert length == pytest.approx(sum(means[segment] for segment in way), rel=SINGLE)


def test_a_larger_body_of_fewer_joints_measures_the_same(some_clips: tuple[Clip, ...], kinect: Skeleton) -> None:
    """Somebody half as large again has the same spread and posture, with fewer joints too."""
    skeleton = some_clips[0].skeleton
    pairs = _kept(skeleton, kinect)
    rows = _rows(some_clips[0])[:, pairs]
    fewer = Body.of(skeleton).restricted_to(kinect, pairs, _rows(some_clips[1]))
    means, deviations = rows.mean(axis=0), rows.std(axis=0, ddof=1)
    np.testing.assert_allclose(fewer.posture(1.5 * means), fewer.posture(means), rtol=1e-12)
    np.testing.assert_allclose(fewer.spread(1.5 * means, 1.5 * deviations), fewer.spread(means, deviations), atol=1e-12)


def test_all_joints_are_the_body_itself() -> None:
    """A body restricted to all of its joints has scale 1 and stretches nothing; without parents there is none."""
    rows = _rows(stick_clip("wave"))
    same = Body.of(STICK).restricted_to(STICK, np.arange(15), rows)
    assert same.scale == 1.0
    assert (same.stretches == 1.0).all()
    with pytest.raises(ValueError, match="skeleton: expected parents and segments among the pairs"):
        Body.of(STICK).restricted_to(Skeleton(STICK.joints[:4]), np.arange(6), rows)


# --- against the slow twin ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", OF_DISTANCES)
def test_real_windows_measure_as_the_loops_say(some_clips: tuple[Clip, ...], kind: Kind) -> None:
    """Spread and posture of a window of each class are what adding up number by number gives."""
    twin = {Kind.SPREAD: naive_windows.spread, Kind.POSTURE: naive_windows.posture}[kind]
    for clip in some_clips:
        rows, body = _rows(clip), Body.of(clip.skeleton)
        end = min(40, clip.frames)
        (found,) = measured(
            rows, clip.frame_rate, np.array([end]), Measure(kind, 0.25), body=body, basis=_plain(np.zeros((465, 1)))
        )
        expected = twin(rows[end - 30 : end], _pairs(clip.skeleton), clip.skeleton.parents)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("size", [1, 2, 7, 24])
def test_shapes_are_those_of_the_triangular_factor(size: int) -> None:
    """A shape holds the Cholesky factor of the covariance over its trace, one at a time or many at once."""
    generator = np.random.default_rng(size)
    covariances = np.array([_random_covariance(generator, size).reshape(size, size) for _ in range(5)])
    shapes = shape_of(covariances)
    for covariance, shape in zip(covariances, shapes, strict=True):
        np.testing.assert_allclose(shape, naive_windows.shape(covariance), atol=1e-12)
        np.testing.assert_allclose(shape_of(covariance), shape, atol=1e-12)


def test_real_windows_have_the_shape_of_their_covariance(some_clips: tuple[Clip, ...]) -> None:
    """The shape of a window of each class is that of its covariance in the basis, found by numpy and loops."""
    basis = _plain(np.random.default_rng(2).normal(size=(465, 7)))
    for clip in some_clips:
        rows = _rows(clip)
        end = min(90, clip.frames)
        (found,) = measured(
            rows,
            clip.frame_rate,
            np.array([end]),
            Measure(Kind.SHAPE, 0.5),
            body=Body.of(clip.skeleton),
            basis=basis,
        )
        covariance = np.cov((rows[max(end - 60, 0) : end] @ basis.directions).T)
        np.testing.assert_allclose(found, naive_windows.shape(covariance), atol=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(1, 8))
def test_shapes_lie_as_far_apart_as_cholesky_factors(seed: int, size: int, frames: int) -> None:
    """The distance of two shapes is the Cholesky distance of covariances of trace 1 and a floor, few frames or many."""
    generator = np.random.default_rng(seed)
    few = generator.normal(size=(frames, size))
    covariances = [_random_covariance(generator, size).reshape(size, size), few.T @ few / frames]
    floor = SHAPE_FLOOR * np.eye(size)
    factors = [scipy.linalg.cholesky(each / np.trace(each) + floor, lower=True) for each in covariances]
    first, second = shape_of(np.array(covariances))
    assert np.linalg.norm(first - second) == pytest.approx(np.linalg.norm(factors[0] - factors[1]), abs=1e-9)
    assert first @ first == pytest.approx(1.0 + size * SHAPE_FLOOR)


def test_a_window_without_movement_has_no_shape() -> None:
    """Where nothing varies the shape is the zero vector, and warns of nothing."""
    assert shape_of(np.zeros((2, 3, 3))).tolist() == [[0.0] * 6] * 2


# --- windows -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("measure", MEASURES, ids=lambda measure: measure.name)
def test_a_window_is_the_frames_before_its_end(measure: Measure) -> None:
    """Each window measures as a recording of its frames alone: those of its seconds, or as many as there are."""
    clip = stick_clip("wave", seed=3, frames=300)
    ends = np.array([FEWEST_FRAMES, 14, 15, 31, 120, 121, 240, 300])
    found = _all_measured(clip, ends)[measure]
    assert len(found) == len(ends)
    for end, numbers in zip(ends.tolist(), found, strict=True):
        start = max(0, end - round(measure.seconds * 120))
        alone = clip.moved_to(clip.positions[start:end])
        np.testing.assert_allclose(numbers, _all_measured(alone, np.array([end - start]))[measure][0], rtol=1e-12)
        if end < clip.frames:
            assert not np.array_equal(numbers, _all_measured(clip, np.array([end + 1]))[measure][0])


def test_measures_have_names_of_their_own() -> None:
    """No two of the measures compared are named alike, and a name says kind and milliseconds."""
    assert len({measure.name for measure in MEASURES}) == len(MEASURES)
    assert Measure(Kind.POSTURE, 0.125).name == "posture125"


# --- what must not matter ----------------------------------------------------------------------------------------


def _scaled(clip: Clip) -> Clip:
    return clip.moved_to(clip.positions * 1.7)


def _mirrored(clip: Clip) -> Clip:
    return clip.moved_to(clip.positions * [-1.0, 1.0, 1.0])


def _turned(clip: Clip) -> Clip:
    return turned(clip, np.random.default_rng(1))


def _carried(clip: Clip) -> Clip:
    """Walk away while turning: another rigid motion in every frame."""
    generator = np.random.default_rng(2)
    return clip.moved_to(
        np.concatenate([turned(clip.moved_to(frame[None]), generator).positions for frame in clip.positions])
    )


@pytest.mark.parametrize("change", [_scaled, _mirrored, _turned, _carried])
def test_size_place_heading_and_handedness_do_not_matter(change: Callable[[Clip], Clip]) -> None:
    """The body scaled, mirrored, turned or carried about, every measure of every window is the same."""
    clip = stick_clip("jump", seed=4, frames=200)
    ends = np.array([8, 50, 200])
    changed = _all_measured(change(clip), ends)
    for measure, numbers in _all_measured(clip, ends).items():
        np.testing.assert_allclose(changed[measure], numbers, atol=1e-7)


def test_real_windows_do_not_depend_on_size_and_handedness(some_clips: tuple[Clip, ...]) -> None:
    """Spread and posture of real motion are those of the same motion mirrored and done by somebody twice as large."""
    for clip in some_clips:
        body, ends = Body.of(clip.skeleton), np.array([clip.frames // 2, clip.frames])
        other = clip.moved_to(clip.positions * [2.0, 2.0, -2.0])
        for kind in OF_DISTANCES:
            first, second = (
                measured(_rows(each), 120.0, ends, Measure(kind, 0.25), body=body, basis=_plain(np.zeros((465, 1))))
                for each in (clip, other)
            )
            np.testing.assert_allclose(second, first, atol=1e-9)


def test_shapes_do_not_depend_on_the_motions_size() -> None:
    """Distances that swing twice as far about the same means have the same shape, and another spread."""
    rows = _rows(stick_clip("wave", frames=60))
    larger = rows.mean(axis=0) + 2 * (rows - rows.mean(axis=0))
    first, second = (
        {
            kind: measured(each, 120.0, np.array([60]), Measure(kind, 1.0), body=Body.of(STICK), basis=_stick_basis())
            for kind in Kind
        }
        for each in (rows, larger)
    )
    np.testing.assert_allclose(second[Kind.SHAPE], first[Kind.SHAPE], atol=1e-9)
    np.testing.assert_allclose(second[Kind.POSTURE], first[Kind.POSTURE], atol=1e-12)
    assert (second[Kind.SPREAD] - first[Kind.SPREAD]).mean() > 0.1


def test_postures_are_shares_of_the_way_through_the_body(some_clips: tuple[Clip, ...]) -> None:
    """A segment's own posture is 1, and no distance is longer than the way along the segments."""
    for clip in some_clips:
        body = Body.of(clip.skeleton)
        posture = body.posture(_rows(clip).mean(axis=0))
        np.testing.assert_allclose(posture[body.segments], 1.0, rtol=1e-12)
        assert 0 < posture.min() < 0.5
        assert posture.max() <= 1 + 1e-12


# --- the basis ---------------------------------------------------------------------------------------------------


def test_the_basis_is_that_of_the_textbook(hdm05_clips: tuple[Clip, ...]) -> None:
    """The 24 directions learned from real motion are the correlations' leading axes, whatever their signs."""
    skeleton = hdm05_clips[0].skeleton
    body = Body.of(skeleton)
    by_class: dict[str, list[np.ndarray]] = {}
    for clip in hdm05_clips[::9]:
        by_class.setdefault(clip.class_name, []).append(_rows(clip))
    lengths = [[skeleton.pairs.tolist().index(list(pair)) for pair in naive_windows.segments(skeleton.parents)]] * 99
    sizes = [
        [float(rows.mean(axis=0)[own].mean()) for rows, own in zip(motions, lengths, strict=False)]
        for motions in by_class.values()
    ]
    basis = learned_basis(list(by_class.values()), body).directions
    expected = naive_windows.basis(list(by_class.values()), sizes, 24)
    assert basis.shape == (465, BASIS_SIZE)
    signs = np.sign((basis * expected).sum(axis=0))
    np.testing.assert_allclose(basis * signs, expected, atol=1e-5 * np.abs(expected).max())


def test_rigid_pairs_are_not_in_the_basis(some_clips: tuple[Clip, ...]) -> None:
    """The distances of the 30 segments, which do not move, have no part in any direction; others have."""
    body = Body.of(some_clips[0].skeleton)
    basis = learned_basis([[_rows(clip)] for clip in some_clips], body)
    assert not basis.directions[body.segments].any()
    assert not basis.weights[body.segments].any()
    assert (np.abs(basis.directions).sum(axis=1) > 0).sum() > 300
    assert np.array_equal(basis.weights > 0, basis.directions.any(axis=1))


def test_a_class_counts_once_and_a_body_by_its_own_measure() -> None:
    """A class given twice over, and bodies scaled, change the basis in nothing but signs; a class left out does."""
    clips = stick_clips(takes=1)
    rows = [[_rows(clip) for clip in clips if clip.class_name == name] for name in ("bow", "jump", "wave")]
    body = Body.of(STICK)
    plain = np.abs(learned_basis(rows, body).directions)
    twice = np.abs(learned_basis([rows[0] * 2, *rows[1:]], body).directions)
    scaled = np.abs(learned_basis([[2.5 * each for each in rows[0]], *rows[1:]], body).directions)
    np.testing.assert_allclose(twice, plain, atol=1e-6 * plain.max())
    np.testing.assert_allclose(scaled, plain, atol=1e-6 * plain.max())
    assert np.abs(np.abs(learned_basis(rows[1:], body).directions) - plain).max() > 0.01 * plain.max()


# --- the basis of fewer pairs ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def real_basis(hdm05_clips: tuple[Clip, ...]) -> Basis:
    body = Body.of(hdm05_clips[0].skeleton)
    return learned_basis([[_rows(clip)] for clip in hdm05_clips[::26]], body)


def _in_the_span(basis: Basis, courses: np.ndarray) -> np.ndarray:
    """Make the rows whose course in the basis is told: where pairs count nothing they are anything."""
    counting = basis.weights > 0
    rows = np.random.default_rng(3).normal(size=(len(courses), len(basis.weights)))
    orthonormal = basis.directions[counting] / basis.weights[counting, None]
    rows[:, counting] = courses @ orthonormal.T / basis.weights[counting]
    return rows


def test_directions_over_weights_are_orthonormal(real_basis: Basis) -> None:
    """Divided by what makes pairs swing alike, the 24 directions are orthonormal, so that courses can be told back."""
    counting = real_basis.weights > 0
    orthonormal = real_basis.directions[counting] / real_basis.weights[counting, None]
    np.testing.assert_allclose(orthonormal.T @ orthonormal, np.eye(BASIS_SIZE), atol=1e-10)
    courses = np.random.default_rng(1).normal(size=(5, BASIS_SIZE))
    np.testing.assert_allclose(_in_the_span(real_basis, courses) @ real_basis.directions, courses, atol=1e-9)


def test_the_course_of_fewer_pairs_is_that_of_least_squares(real_basis: Basis, kinect: Skeleton) -> None:
    """From a Kinect's pairs, rows in the span have the course that least squares finds: their own."""
    pairs = _kept(MotionLibrary.builtin().skeleton, kinect)
    courses = np.random.default_rng(2).normal(size=(7, BASIS_SIZE))
    rows = _in_the_span(real_basis, courses)[:, pairs]
    fewer = real_basis.restricted_to(pairs)
    counting = fewer.weights > 0
    assert 0 < (~counting).sum() < counting.sum()
    orthonormal = real_basis.directions[pairs][counting] / fewer.weights[counting, None]
    expected, *_ = np.linalg.lstsq(orthonormal, (rows[:, counting] * fewer.weights[counting]).T, rcond=None)
    np.testing.assert_allclose(rows @ fewer.directions, expected.T, atol=1e-8)
    np.testing.assert_allclose(rows @ fewer.directions, courses, atol=1e-8)
    assert np.array_equal(fewer.weights, real_basis.weights[pairs])


def test_rows_off_the_span_have_the_course_of_least_squares(real_basis: Basis, some_clips: tuple[Clip, ...]) -> None:
    """Real rows of a dozen joints have the course that least squares finds among what those joints clearly show."""
    skeleton = some_clips[0].skeleton
    few = skeleton.restricted_to(range(0, 31, 3))
    pairs = _kept(skeleton, few)
    fewer = real_basis.restricted_to(pairs)
    orthonormal = real_basis.directions[pairs] / np.where(fewer.weights > 0, fewer.weights, 1.0)[:, None]
    singular = np.linalg.svd(orthonormal, compute_uv=False)
    assert (singular < 0.2 * singular[0]).any()
    rows = _rows(some_clips[3])[:, pairs]
    expected, *_ = np.linalg.lstsq(orthonormal, (rows * fewer.weights).T, rcond=0.2)
    np.testing.assert_allclose(rows @ fewer.directions, expected.T, atol=1e-8)


def test_directions_that_hardly_show_are_not_measured() -> None:
    """A direction of which the fewer pairs show too little is left out rather than blown up; all pairs keep all."""
    angle = np.arcsin(0.1)
    directions = np.array([[1.0, 0.0], [0.0, np.sin(angle)], [0.0, np.cos(angle)]])
    basis = Basis(directions, np.ones(3))
    np.testing.assert_allclose(basis.restricted_to(np.arange(3)).directions, directions, atol=1e-12)
    np.testing.assert_allclose(basis.restricted_to(np.array([0, 1])).directions, [[1, 0], [0, 0]], atol=1e-12)
    clearer = Basis(np.array([[1.0, 0.0], [0.0, 0.3], [0.0, np.sqrt(0.91)]]), np.ones(3))
    np.testing.assert_allclose(clearer.restricted_to(np.array([0, 1])).directions, [[1, 0], [0, 1 / 0.3]], atol=1e-12)


@pytest.mark.parametrize(
    ("directions", "weights", "message"),
    [
        pytest.param(np.zeros(15), np.ones(15), r"basis: expected finite \(pairs, directions\)", id="flat"),
        pytest.param(np.full((15, 2), np.nan), np.ones(15), "basis: expected finite", id="no numbers"),
        pytest.param(np.zeros((15, 2)), np.ones(14), "weights: expected one for each of 15 pairs, got", id="fewer"),
        pytest.param(np.zeros((15, 2)), np.ones((15, 1)), "weights: expected one for each of 15 pairs", id="deeper"),
        pytest.param(np.zeros((15, 2)), np.full(15, np.inf), "weights: expected one for each", id="infinite"),
    ],
)
def test_a_basis_that_does_not_fit_is_refused(directions: np.ndarray, weights: np.ndarray, message: str) -> None:
    """Directions of another shape, weights of another number, and numbers that are not finite are refused by name."""
    with pytest.raises(ValueError, match=message):
        Basis(directions, weights)
