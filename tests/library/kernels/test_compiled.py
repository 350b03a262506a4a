"""The compiled loops: each beside numpy on the library's own motions, of every kind; wrong arrays refused."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import naive
import numpy as np
import pytest
from conftest import NO_LOOPS
from programs import ROOT

from kinespace.library import MotionLibrary
from kinespace.library.distances import distance_rows
from kinespace.library.kernels import compiled
from kinespace.library.progress.phase_table import Moments as Moments_
from kinespace.library.progress.phase_table import PhaseTable
from kinespace.library.windows.basis import Basis
from kinespace.library.windows.body import Body
from kinespace.library.windows.comparison import ACROSS_LABORATORIES, WITHIN_LABORATORY
from kinespace.library.windows.cutting import eigenpairs_of, window_covariances
from kinespace.library.windows.index import WindowIndex, opened
from kinespace.library.windows.parts import (
    EIGENVECTORS,
    LEVEL_REMOVED,
    NOISE_FLOOR,
    Eigenpairs,
    Moments,
    eigen,
    movement,
    posture,
    spread,
    trend,
)
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import LiveSignature, Recognizer, Settings
from kinespace.stream.recognizer.progress import STEP, ProgressFollower
from kinespace.stream.recognizer.windows.live_windows import LiveWindows
from kinespace.stream.recognizer.windows.rolling import EPSILON

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from kinespace.library.clip import Clip
    from kinespace.stream.recognition import Recognition

KINDS = ("any", "avx2", "avx512")
#: As many joints as the library has, and every other.
BODIES = pytest.mark.parametrize("every", [1, 2], ids=["31 joints", "16 joints"])
BUILTIN = MotionLibrary.builtin()
CLIPS = BUILTIN.motions[::29]
PAIRS = np.ascontiguousarray(BUILTIN.skeleton.pairs)


@pytest.fixture(scope="module", params=KINDS)
def loops(request: pytest.FixtureRequest) -> Iterator[compiled.Loops]:
    """Give the loops of one kind."""
    if compiled.loops is None:
        pytest.skip(NO_LOOPS)
    before = compiled.loops.kind()
    try:
        compiled.loops.use(request.param)
    except ValueError as error:
        pytest.skip(str(error))
    yield compiled.loops
    compiled.loops.use(before)


def _with_room(rows: np.ndarray, room: int = 7) -> np.ndarray:
    """Lay rows out with room between them, as a sliding window has them."""
    wide = np.full((len(rows), rows.shape[1] + room), np.nan)
    wide[:, : rows.shape[1]] = rows
    return wide[:, : rows.shape[1]]


def _library(every: int) -> MotionLibrary:
    joints = BUILTIN.skeleton.joints
    return BUILTIN if every == 1 else BUILTIN.restricted_to(joints[::every])


def _covariances(clip: Clip) -> np.ndarray:
    """Take the covariances of a motion's windows of half a second and less, in the built-in library's basis."""
    points = distance_rows(clip.positions, clip.skeleton) @ opened(BUILTIN).basis.directions
    return window_covariances(points, clip, np.arange(3, clip.frames, 4), 0.5)


# --- each loop ---------------------------------------------------------------------------------------------------


def test_every_kind_of_loops_that_the_processor_has_is_tested(loops: compiled.Loops) -> None:
    """The loops in use are the kind that the test asked for; an unknown kind is refused by name."""
    kind = loops.kind()
    assert kind in KINDS
    assert compiled.kind() == f"compiled loops ({kind})"
    with pytest.raises(ValueError, match=r"kind: expected any, avx2 or avx512, .* got mmx"):
        loops.use("mmx")
    assert loops.kind() == kind


@pytest.mark.slow
@pytest.mark.parametrize("frames", [1, 2, 3, 4, 5, 7, 16])
def test_distances_equal_three_loops(loops: compiled.Loops, frames: int) -> None:
    """The distances equal those from three plain loops, for any number of frames measured side by side."""
    for clip in CLIPS:
        positions = np.ascontiguousarray(clip.positions[20 : 20 + frames])
        rows = _with_room(np.zeros((frames, len(PAIRS))))
        loops.measure_distances(positions, PAIRS, rows)
        np.testing.assert_allclose(rows, naive.distance_rows(positions, PAIRS.tolist()), rtol=1e-14, atol=1e-15)
        for index in range(frames):
            alone = np.empty((1, len(PAIRS)))
            loops.measure_distances(positions[index : index + 1], PAIRS, alone)
            assert np.array_equal(alone[0], rows[index])


def _sums(rows: np.ndarray, times: np.ndarray, reference: np.ndarray, begin: float) -> tuple[np.ndarray, np.ndarray]:
    relative, since = rows - reference, times - begin
    sums = [reference, relative.sum(axis=0), since @ relative, np.square(relative).sum(axis=0)]
    return np.array(sums), np.array([begin, since.sum(), np.square(since).sum()])


ROWS = np.random.default_rng(3).normal(size=(30, 5))
#: Rows that moved back in a window's memory.
MOVED = 70


class _Following(NamedTuple):
    """What the loops are told of a span in which `end` rows were, when some more entered and the first ones left."""

    times: np.ndarray
    places: np.ndarray
    drift: np.ndarray
    numbers: tuple[float, int, int, int]

    @classmethod
    def of(cls, end: int, entered: int, left: int, rows: int) -> _Following:
        times = np.arange(rows) / 60 + 1e3
        seconds = (end + entered - left - 0.5) / 60
        return cls(times, np.array([0, end]) + MOVED, np.zeros(2), (seconds, 10_000, end + entered, MOVED))

    def assert_followed(self, end: int, entered: int, left: int, largest: float) -> None:
        """Check that the span lies where the rows are now, and that its drift is the rounding of as many rows."""
        assert self.places.tolist() == [left + MOVED, end + entered + MOVED]
        assert self.drift[0] == pytest.approx(EPSILON * (entered + left) * largest)


@pytest.mark.parametrize(("entered", "left"), [(4, 4), (1, 0), (9, 2)])
def test_sums_follow_rows(loops: compiled.Loops, entered: int, left: int) -> None:
    """Rows that enter are added and rows that leave are subtracted; the bound of the rounding grows with both."""
    for clip in CLIPS:
        rows = _with_room(distance_rows(clip.positions, clip.skeleton))
        end = len(rows) - 9
        following = _Following.of(end, entered, left, len(rows))
        times = following.times
        reference, begin = rows[:end].mean(axis=0), times[end]
        sums, clock = _sums(rows[:end], times[:end], reference, begin)
        assert not _call(loops, "follow", rows, *following[:3], sums, clock, *following.numbers)
        expected = _sums(rows[left : end + entered], times[left : end + entered], reference, begin)
        for ours, theirs in zip((sums, clock), expected, strict=True):
            np.testing.assert_allclose(ours, theirs, atol=1e-10)
        following.assert_followed(end, entered, left, sums[3].max())


@pytest.mark.parametrize("size", [1, 2, 7, 8, 20, 32])
@pytest.mark.parametrize(("entered", "left"), [(4, 4), (1, 0), (40, 17)])
def test_products_follow_points(loops: compiled.Loops, entered: int, left: int, size: int) -> None:
    """In any number of directions sums and products are those of the rows that are left, symmetric to the last bit."""
    directions = np.random.default_rng(size).normal(size=(len(PAIRS), size)) / 20
    rows = _with_room(distance_rows(CLIPS[0].positions, CLIPS[0].skeleton) @ directions)
    reference, end = rows.mean(axis=0), len(rows) - 40
    relative = rows - reference
    total, products = relative[:end].sum(axis=0), relative[:end].T @ relative[:end]
    products = np.tril(products) + np.tril(products, -1).T
    following = _Following.of(end, entered, left, len(rows))
    assert not _call(loops, "follow_products", rows, *following[:3], reference, total, products, *following.numbers)
    kept = relative[left : end + entered]
    np.testing.assert_allclose(total, kept.sum(axis=0), atol=1e-12)
    np.testing.assert_allclose(products, kept.T @ kept, atol=1e-12)
    assert np.array_equal(products, products.T)
    following.assert_followed(end, entered, left, products.trace())


@pytest.mark.parametrize("place", [0, 12, 2**60])
def test_a_span_of_new_rows_alone_is_computed_afresh(loops: compiled.Loops, place: int) -> None:
    """Wherever a span was before, the loops begin anew from the mean of its rows when none of them were in it."""
    generator = np.random.default_rng(place % 7)
    places, rows, times = np.array([0, place]), _with_room(generator.normal(size=(30, 5))), np.arange(30.0)
    sums, clock, drift = np.ones((4, 5)), np.ones(3), np.ones(2)
    arrays = rows, times, places, drift, sums, clock
    assert _call(loops, "follow", *arrays, 12.0, 100, 30, 0) is (place < 30)
    assert places.tolist() == [18, 30]
    if place < 30:
        expected = _sums(rows[18:], times[18:], rows[18:].mean(axis=0), 29.0)
        for ours, theirs in zip((sums, clock), expected, strict=True):
            np.testing.assert_allclose(ours, theirs, atol=1e-12)
        assert drift == pytest.approx([EPSILON * 12 * sums[3].max(), (1e-6 * sums[0].mean()) ** 2])
    before = sums.copy()
    assert not _call(loops, "follow", *arrays, 12.0, 100, 30, 0)
    assert not _call(loops, "follow", *arrays, 12.0, 100, 0, 0)
    assert np.array_equal(sums, before)


def test_sums_that_lost_digits_are_computed_afresh(loops: compiled.Loops) -> None:
    """When the bound of the rounding is large the loops compute sums and products anew from the rows."""
    rows, times, drift = ROWS.copy(), np.arange(30.0), np.array([1.0, 0.0])
    sums, clock = np.ones((4, 5)), np.ones(3)
    assert _call(loops, "follow", rows, times, np.array([16, 29]), drift, sums, clock, 12.0, 100, 30, 0)
    np.testing.assert_allclose(sums, _sums(rows[18:], times[18:], rows[18:].mean(axis=0), 29.0)[0], atol=1e-12)
    drift[0], reference, total, products = 1.0, np.ones(5), np.ones(5), np.ones((5, 5))
    arrays = rows, times, np.array([16, 29]), drift, reference, total, products
    assert _call(loops, "follow_products", *arrays, 12.0, 100, 30, 0)
    relative = rows[18:] - rows[18:].mean(axis=0)
    np.testing.assert_allclose(products, relative.T @ relative, atol=1e-12)
    np.testing.assert_allclose(reference, rows[18:].mean(axis=0), atol=1e-12)
    assert drift == pytest.approx([EPSILON * 12 * products.trace(), 1e-12 * reference @ reference])


def _call(loops: compiled.Loops, name: str, *arguments: Any) -> Any:  # noqa: ANN401 - as the loop has them
    return loops.Bound(name, *arguments).run()


@BODIES
@pytest.mark.parametrize("parents", [True, False], ids=["segments", "no segments"])
def test_parts_equal_numpys_parts(loops: compiled.Loops, every: int, parents: bool) -> None:  # noqa: FBT001 - a parameter
    """Spread, posture, trend, movement and size of real windows equal the values that numpy reads off the moments."""
    library = _library(every)
    for clip in library.motions[::29]:
        body = Body.of(clip.skeleton if parents else type(clip.skeleton)(clip.skeleton.joints))
        rows = distance_rows(clip.positions, clip.skeleton)
        times = np.arange(len(rows)) / 60
        moments = Moments(rows.mean(axis=0)[None], rows.std(axis=0)[None], _trend(rows, times)[None])
        expected = [read(moments, body)[0] for read in (spread, posture, trend)]
        sums, clock = _sums(rows, times, rows[0], times[-1])
        parts, alone = np.full((2, 3, rows.shape[1]), np.nan)
        of_body = body.sizing, body.segments, body.above, body.ends
        arrays = sums, clock, np.array([7, 7 + len(rows)]), *of_body, NOISE_FLOOR, LEVEL_REMOVED
        moved, size = _call(loops, "read_parts", *arrays, *parts)
        for ours, theirs in zip(parts, expected, strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-7)
        assert _call(loops, "read_parts", *arrays, alone[0], alone[1, :0], alone[2, :0]) == (moved, size)
        assert np.array_equal(alone[0], parts[0])
        assert moved == pytest.approx(float(movement(moments)[0]), rel=1e-9)
        assert size == pytest.approx(float(body.size(moments.mean)[0]), rel=1e-9)


def _trend(rows: np.ndarray, times: np.ndarray) -> np.ndarray:
    since = (times - times.mean()) / times.std()
    return np.asarray(since @ rows / len(rows))


def test_a_body_in_one_point_has_numbers(loops: compiled.Loops) -> None:
    """For a body in one point that never moved no division by zero takes place."""
    body = Body.of(BUILTIN.skeleton)
    parts, sums, clock = np.full((3, len(PAIRS)), np.nan), np.zeros((4, len(PAIRS))), np.zeros(3)
    of_body, constants = (body.sizing, body.segments, body.above, body.ends), (NOISE_FLOOR, LEVEL_REMOVED)
    read = _call(loops, "read_parts", sums, clock, np.array([0, 1]), *of_body, *constants, *parts)
    assert read == (0.0, 0.0)
    still = Moments(*np.zeros((3, 1, len(PAIRS))))
    np.testing.assert_allclose(parts[0], spread(still, body)[0], rtol=1e-12)
    assert not parts[1:].any()


def test_eigenpairs_equal_lapacks(loops: compiled.Loops) -> None:
    """Values and vectors of windows of every length, from two frames on, equal LAPACK's."""
    for clip in CLIPS:
        covariances = _covariances(clip)
        values, vectors = np.empty((len(covariances), 4)), np.empty((len(covariances), 4, 32))
        assert loops.eigenpairs(covariances, values, vectors)
        exact = np.linalg.eigvalsh(covariances)[:, :-5:-1]
        largest = exact[:, :1]
        np.testing.assert_allclose(values / largest, exact / largest, atol=1e-12)
        np.testing.assert_allclose(
            vectors @ vectors.transpose(0, 2, 1), np.broadcast_to(np.eye(4), (len(vectors), 4, 4)), atol=1e-12
        )
        outside = vectors @ covariances - values[:, :, None] * vectors
        assert np.abs(outside / largest[:, :, None]).max() < 1e-11


@pytest.mark.parametrize("size", [1, 2, 3, 5, 31, 32])
def test_eigenpairs_of_any_size(loops: compiled.Loops, size: int) -> None:
    """Vectors are orthonormal and values the largest: of many directions, of few, of equal ones, of one, of none."""
    most = min(4, size)
    generator = np.random.default_rng(size)
    one, several = generator.normal(size=(size, size)), generator.normal(size=(size, 2))
    matrices = np.array(
        [one @ one.T, several @ several.T, np.eye(size), np.diag(np.eye(size)[-1]), np.zeros((size, size))]
    )
    values, vectors = np.empty((len(matrices), most)), np.empty((len(matrices), most, size))
    assert loops.eigenpairs(matrices, values, vectors)
    np.testing.assert_allclose(values, np.linalg.eigvalsh(matrices)[:, : -most - 1 : -1], atol=1e-11 * size)
    np.testing.assert_allclose(
        vectors @ vectors.transpose(0, 2, 1), np.broadcast_to(np.eye(most), (len(vectors), most, most)), atol=1e-12
    )
    np.testing.assert_allclose(vectors @ matrices, values[:, :, None] * vectors, atol=1e-10 * size)


def test_a_covariance_without_numbers_has_no_eigenpairs(loops: compiled.Loops) -> None:
    """The loop reports a covariance with NaN or infinity, and does not hang."""
    matrices = np.full((1, 8, 8), np.nan)
    assert not loops.eigenpairs(matrices, np.empty((1, 4)), np.empty((1, 4, 8)))


def test_a_window_is_read_as_numpy_reads_it(loops: compiled.Loops) -> None:
    """From sums and products come the covariance's trace, its eigenpairs, and the scaled eigenvectors."""
    points = distance_rows(CLIPS[1].positions, CLIPS[1].skeleton) @ opened(BUILTIN).basis.directions
    relative = points - points[0]
    covariance = np.cov(points.T, bias=True)
    values, vectors = np.empty(EIGENVECTORS), np.empty((2, EIGENVECTORS, 32))
    total, products = relative.sum(axis=0), relative.T @ relative
    block = np.zeros((32, 8))
    places, drift = np.array([5, 5 + len(points)]), np.zeros(2)
    trace = _call(loops, "read_eigen", total, products, places, drift, values, *vectors, block)
    with compiled.left_aside():
        pairs = eigenpairs_of(covariance[None])
    assert trace == pytest.approx(covariance.trace(), rel=1e-9)
    np.testing.assert_allclose(values, pairs.values[0], rtol=1e-9)
    scaled = eigen(Eigenpairs(values[None], vectors[:1]))[0]
    np.testing.assert_allclose(vectors[1], scaled, atol=1e-12)
    drift[1] = 2 * trace
    assert _call(loops, "read_eigen", total, products, places, drift, values, *vectors, block) == 0.0
    assert not vectors[1].any()


@pytest.mark.slow
@pytest.mark.parametrize("begin", [0.0, 1.0, np.nan, np.inf])
def test_one_window_after_another_is_read_as_each_alone(loops: compiled.Loops, begin: float) -> None:
    """From hop to hop, and from one motion to the next, the loops find what they find of each window alone."""
    covariances, taken_over = np.concatenate([_covariances(clip) for clip in CLIPS]), 0
    values, vectors, block = np.empty(EIGENVECTORS), np.empty((2, EIGENVECTORS, 32)), np.full((32, 8), begin)
    for covariance in covariances:
        trace = _call(
            loops, "read_eigen", np.zeros(32), covariance, np.array([0, 1]), np.zeros(2), values, *vectors, block
        )
        pairs = eigenpairs_of(covariance[None])
        (scaled,) = eigen(pairs)
        np.testing.assert_allclose(values, pairs.values[0], atol=1e-9 * trace)
        np.testing.assert_allclose(vectors[1].T @ vectors[1], scaled.T @ scaled, atol=1e-6)
        taken_over += np.allclose(block.T @ block, np.eye(8))
    assert taken_over > len(covariances) / 2


# --- windows compared --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["across", "within", "fewer joints", "few motions"])
def index(request: pytest.FixtureRequest) -> WindowIndex:
    """Open libraries that are compared in every way."""
    if request.param == "few motions":
        return WindowIndex.of(MotionLibrary.of_clips(BUILTIN.motions[:3]))
    weighing = WITHIN_LABORATORY if request.param == "within" else ACROSS_LABORATORIES
    return WindowIndex.of(_library(2 if request.param == "fewer joints" else 1), weighing=weighing)


@pytest.mark.slow
@pytest.mark.usefixtures("loops")
def test_distances_to_windows_equal_numpys(index: WindowIndex) -> None:
    """At every hop of some motions log distances and scores equal numpy's, for every weighing."""
    for clip in index.library.motions[::82]:
        live = LiveWindows(index.body, index.basis)
        rows = distance_rows(clip.positions, clip.skeleton)
        for end in range(4, len(rows), 4):
            live.push((np.arange(end - 4, end) / clip.frame_rate).tolist(), rows[end - 4 : end])
            signature = live.read()
            ours = index.log_distances(signature.numbers), index.eigenvector_scores(signature.eigenvector)
            with compiled.left_aside():
                theirs = index.log_distances(signature.numbers), index.eigenvector_scores(signature.eigenvector)
            for mine, other in zip(ours, theirs, strict=True):
                np.testing.assert_allclose(mine, other, atol=1e-3)


@pytest.mark.usefixtures("loops")
def test_nan_and_infinity_are_never_near() -> None:
    """Infinite numbers and NaN get no small distance."""
    index = opened(BUILTIN)
    live = LiveWindows(index.body, index.basis)
    rows = distance_rows(CLIPS[0].positions[:20], CLIPS[0].skeleton)
    live.push((np.arange(20) / 60).tolist(), rows)
    numbers = live.read().numbers
    usual = index.log_distances(numbers)
    none = index.log_distances({part: np.full_like(each, np.nan) for part, each in numbers.items()})
    assert (none > usual + 10).all()
    far = {part: each if each.ndim == 2 else np.full_like(each, 1e30) for part, each in numbers.items()}
    # Those that look at eigenvectors alone stay as they were.
    weighing = index.comparison.weighing
    of_distances = [group[0].kind != "eigen" for group in weighing.groups]
    others = np.array(weighing.weights) @ of_distances > 0
    assert (index.log_distances(far)[others] > usual[others] + 1).all()


@pytest.mark.slow
@pytest.mark.usefixtures("loops")
def test_numpy_compares_views_that_the_loops_have_no_room_for() -> None:
    """A weighing with eight views, and each group alone, is not refused."""
    views = (ACROSS_LABORATORIES.views[0],) * 8
    weighing = type(ACROSS_LABORATORIES)(ACROSS_LABORATORIES.groups, views, first=0.5)
    index = WindowIndex.of(MotionLibrary.of_clips(BUILTIN.motions[:3]), weighing=weighing)
    numbers = {part: np.ones((4, 32) if part.kind == "eigen" else 465) for part in weighing.parts}
    assert index.log_distances(numbers).shape == (8 + len(weighing.groups), len(index.classes))


@pytest.mark.slow
@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])  # noqa: S301 - its own
def test_an_index_can_be_copied(copied: Callable[[object], Any]) -> None:
    """A deep copy, and a copy in another process, compare like the index."""
    index = WindowIndex.of(MotionLibrary.of_clips(BUILTIN.motions[:3]))
    eigenvector = np.eye(index.basis.directions.shape[1])[0]
    scores = index.eigenvector_scores(eigenvector)
    assert np.array_equal(copied(index).eigenvector_scores(eigenvector), scores)


# --- a body followed through a motion ------------------------------------------------------------------------------


def _moments(*, cyclic: bool, directions: int = 3) -> Moments_:
    """Make the moments of four recordings that wander at random."""
    generator = np.random.default_rng(directions)
    lengths = [17, 5, 23, 8]
    wandering = [np.cumsum(generator.normal(size=(length, 2 * directions)), axis=0) for length in lengths]
    count = sum(lengths)
    return Moments_(
        vectors=np.ascontiguousarray(np.concatenate(wandering).T, dtype=np.float32),
        phases=np.concatenate([np.linspace(0, 1, length) for length in lengths]),
        starts=np.cumsum([0, *lengths[:-1]]),
        speeds=generator.uniform(0.5, 2, count),
        usual_speeds=generator.uniform(0.5, 2, count),
        usual_swings=generator.normal(size=count),
        seconds=1.0,
        cyclic=cyclic,
    )


@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize("cyclic", [True, False])
@pytest.mark.parametrize("directions", [1, 3, 32])
def test_a_body_is_followed_as_numpy_follows_it(directions: int, cyclic: bool) -> None:  # noqa: FBT001 - a parameter
    """At every step phase, certainty, speed and amplitude are numpy's, near the library's moments and far from them."""
    moments = _moments(cyclic=cyclic, directions=directions)
    whitening = np.eye(2 * directions)
    points = np.cumsum(np.random.default_rng(7).normal(scale=0.3, size=(80, directions)), axis=0)
    points[60:] *= 10
    basis = Basis(np.zeros((1, directions)), np.ones(1), np.zeros((directions, 1)), 1.0)
    table = PhaseTable({"motion": moments}, whitening, basis)
    followers = [ProgressFollower(table), ProgressFollower(table)]
    for index, point in enumerate(points):
        ours = followers[0].push(index * STEP, point, "motion")
        with compiled.left_aside():
            theirs = followers[1].push(index * STEP, point, "motion")
        assert ours
        assert theirs
        for name in ("phase", "sure", "speed", "amplitude"):
            assert getattr(ours, name) == pytest.approx(getattr(theirs, name), rel=1e-3, abs=1e-4), (index, name)


# --- whole streams -----------------------------------------------------------------------------------------------


def _answers(signature: LiveSignature, every: int) -> list[Recognition]:
    library = _library(every)
    recognizer = Recognizer(library, Settings(signature=signature))
    positions = np.concatenate([clip.positions for clip in library.motions[5::94]])
    frames = (Frame("p", index / 60, each) for index, each in enumerate(positions))
    return [answer for frame in frames if (answer := recognizer.push(frame))]


@cache
def _numpys_answers(signature: LiveSignature, every: int) -> list[Recognition]:
    """Give the answers that every kind of loops is compared with."""
    with compiled.left_aside():
        return _answers(signature, every)


@pytest.mark.slow
@pytest.mark.usefixtures("loops")
@BODIES
@pytest.mark.parametrize("signature", list(LiveSignature))
def test_a_stream_is_answered_as_numpy_answers_it(signature: LiveSignature, every: int) -> None:
    """At every hop of some motions outcome, guess and events are the same, scores to three digits."""
    ours, theirs = _answers(signature, every), _numpys_answers(signature, every)
    assert len(ours) == len(theirs) > 0
    for mine, other in zip(ours, theirs, strict=True):
        assert (mine.outcome, mine.guess, mine.time) == (other.outcome, other.guess, other.time)
        assert [event.kind for event in mine.events] == [event.kind for event in other.events]
        np.testing.assert_allclose(mine.scores, other.scores, atol=1e-3)
        assert mine.movement == pytest.approx(other.movement, rel=1e-6)


@pytest.mark.slow
@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize("signature", list(LiveSignature))
def test_a_recogniser_is_copied_in_full(signature: LiveSignature) -> None:
    """A copy made in the middle of a feed goes on as the recogniser does that it was made of."""
    recognizer = Recognizer(BUILTIN, Settings(signature=signature))
    frames = [Frame("p", index / 60, each) for index, each in enumerate(CLIPS[0].positions)]
    half = len(frames) // 2
    for frame in frames[:half]:
        recognizer.push(frame)
    copied = copy.deepcopy(recognizer)
    for frame in frames[half:]:
        ours, theirs = recognizer.push(frame), copied.push(frame)
        assert (ours is None) == (theirs is None)
        if ours and theirs:
            assert np.array_equal(ours.scores, theirs.scores)


# --- left aside --------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("loops")
def test_the_loops_can_be_switched_off_for_a_while() -> None:
    """Inside the block numpy does the arithmetic; after it, even after an error, the compiled loops do."""
    before, meanwhile = compiled.loops, list[str]()

    def fail() -> None:
        with compiled.left_aside():
            meanwhile.append(compiled.kind())
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert meanwhile == ["numpy"]
    assert compiled.loops is before is not None


@pytest.mark.slow
def test_a_module_built_from_older_sources_is_not_used() -> None:
    """Numpy does the arithmetic if the compiled module lacks one of the loops."""
    lacking = (
        "import sys, types; old = types.ModuleType('kinespace.library.kernels._compiled'); old.follow = None; "
        "sys.modules['kinespace.library.kernels._compiled'] = old; "
        "from kinespace.library.kernels import compiled; print(compiled.kind())"
    )
    asked = [sys.executable, "-c", lacking]
    told = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60)
    assert told.stdout == "numpy\n"


@pytest.mark.slow
def test_an_environment_variable_switches_the_loops_off() -> None:
    """With KINESPACE_COMPILED=0 numpy does the arithmetic."""
    asked = [sys.executable, "-c", "from kinespace.library.kernels import compiled; print(compiled.kind())"]
    environment = os.environ | {"KINESPACE_COMPILED": "0"}
    told = subprocess.run(asked, cwd=ROOT, env=environment, capture_output=True, text=True, check=True, timeout=60)
    assert told.stdout == "numpy\n"


# --- refused arrays ---------------------------------------------------------------------------------------------

_F, _H = np.float32, np.float16
_ONE = np.array([0])
_WINDOWS = np.zeros((3, 2), _F)
_SIX_ROWS, _INDICES = np.zeros((6, 5)), np.zeros(60, np.intp)
_NO_ORIGIN, _NO_AXES = np.zeros(0, _F), np.zeros((0, 0), _H)


def _table(loops: compiled.Loops, parts: int = 1, groups: int = 1) -> compiled.Table:
    """Lay out three windows of one class, with parts of four numbers and two axes."""
    table = loops.Table(_WINDOWS, _ONE, _ONE, np.ones((1, groups), _F), 0.01)
    for _ in range(parts):
        table.add_part(0, 0, np.zeros(4, _F), np.zeros((4, 2), _H))
    return table


def _with_group(loops: compiled.Loops) -> compiled.Table:
    table = _table(loops)
    table.add_group(_ONE, _NO_ORIGIN, _NO_AXES, np.zeros((3, 2), _H), np.zeros(3, _F))
    return table


def _parts(loops: compiled.Loops, **other: np.ndarray) -> object:
    """Read the parts of five pairs, with another array or two."""
    usual = {
        "sums": np.ones((4, 5)),
        "clock": np.zeros(3),
        "sizing": np.ones(5),
        "segments": _ONE,
        "above": np.ones((1, 4)),
        "ends": np.full((3, 5), 255, np.uint8),
        "spread": np.zeros(5),
        "posture": np.zeros(5),
        "trend": np.zeros(0),
    }
    sums, clock, sizing, segments, above, ends, *parts = cast("Any", (usual | other).values())
    return _call(loops, "read_parts", sums, clock, np.array([0, 2]), sizing, segments, above, ends, 0.1, 0.5, *parts)


def _sums_followed(loops: compiled.Loops, **other: object) -> object:
    """Let sums follow nine rows of five distances, with another argument or two."""
    usual = {
        "rows": np.zeros((9, 5)),
        "times": np.arange(9.0),
        "places": np.zeros(2, np.intp),
        "drift": np.zeros(2),
        "sums": np.zeros((4, 5)),
        "clock": np.zeros(3),
        "seconds": 1.0,
        "most": 9,
        "end": 9,
        "moved": 0,
    }
    return _call(loops, "follow", *cast("Any", (usual | other).values()))


def _products_followed(loops: compiled.Loops, directions: int, products: np.ndarray) -> object:
    points, places = np.zeros((9, directions)), np.zeros(2, np.intp)
    sums = np.zeros(directions), np.zeros(directions), products
    return _call(loops, "follow_products", points, np.arange(9.0), places, np.zeros(2), *sums, 1.0, 9, 9, 0)


def _followed(loops: compiled.Loops, **other: np.ndarray) -> object:
    """Follow a body through two moments in two numbers, with another array or two."""
    usual = {
        "course": np.ones((4, 2)),
        "indices": np.array([[0, 1], [0, 1]]),
        "starts": _ONE,
        "vectors": np.zeros((2, 2), _F),
        "lengths": np.zeros(2, _F),
        "expected": np.zeros((1, 2)),
        "constants": np.ones(8) / 8,
        "live": np.zeros(2, _F),
        "belief": np.ones(2) / 2,
        "after": np.zeros(2),
        "room": np.zeros(18, _F),
        "told": np.zeros(3),
    }
    return loops.follow_phase(*(usual | other).values())


_REFUSED: dict[str, tuple[Callable[[compiled.Loops], object], str]] = {
    "distances: coordinates": (
        lambda loops: loops.measure_distances(np.zeros((2, 31, 2)), PAIRS, np.zeros((2, 465))),
        "positions: expected 3, got 2",
    ),
    "distances: single precision": (
        lambda loops: loops.measure_distances(np.zeros((2, 31, 3), _F), PAIRS, np.zeros((2, 465))),
        "positions: expected 3 dimensions of type d, got 3 of f",
    ),
    "distances: pairs": (
        lambda loops: loops.measure_distances(np.zeros((2, 30, 3)), PAIRS, np.zeros((2, 465))),
        "pairs: expected indices below 30, got 30",
    ),
    "distances: fewer rows": (
        lambda loops: loops.measure_distances(np.zeros((2, 31, 3)), PAIRS, np.zeros((1, 465))),
        "rows: expected 2, got 1",
    ),
    "distances: narrow rows": (
        lambda loops: loops.measure_distances(np.zeros((2, 31, 3)), PAIRS, np.zeros((2, 464))),
        "rows: expected 465, got 464",
    ),
    "distances: every other frame": (
        lambda loops: loops.measure_distances(np.zeros((4, 31, 3))[::2], PAIRS, np.zeros((2, 465))),
        "positions: expected numbers side by side",
    ),
    "distances: many joints": (
        lambda loops: loops.measure_distances(np.zeros((1, 257, 3)), PAIRS, np.zeros((1, 465))),
        "joints: expected 1 to 256, got 257",
    ),
    "distances: over the pairs": (
        lambda loops: loops.measure_distances(
            np.ones((1, 31, 3)), _INDICES[:40].reshape(20, 2), _INDICES[20:40].view(np.float64).reshape(1, 20)
        ),
        "rows: expected memory that is in no other array",
    ),
    "sums: three rows": (lambda loops: _sums_followed(loops, sums=np.zeros((3, 5))), "sums: expected 4, got 3"),
    "sums: wide rows": (lambda loops: _sums_followed(loops, rows=np.zeros((9, 6))), "sums: expected 6, got 5"),
    "sums: times": (lambda loops: _sums_followed(loops, times=np.zeros(8)), "times: expected 9, got 8"),
    "sums: end": (lambda loops: _sums_followed(loops, end=10), "end: expected 0 to 9"),
    "sums: no end": (lambda loops: _sums_followed(loops, end=np.nan), "end: expected 0 to 9"),
    "sums: moved": (lambda loops: _sums_followed(loops, moved=-1), "end: expected 0 to 9, moved not below 0"),
    "sums: no distance": (
        lambda loops: _sums_followed(loops, rows=np.zeros((9, 0)), sums=np.zeros((4, 0))),
        "rows: expected 1 to [0-9]*, got 0",
    ),
    "sums: among the rows": (
        lambda loops: _sums_followed(loops, rows=_SIX_ROWS[1:], times=np.zeros(5), sums=_SIX_ROWS[:4], end=5),
        "sums: expected memory that is in no other array",
    ),
    "products: many directions": (
        lambda loops: _products_followed(loops, 33, np.zeros((33, 33))),
        "directions: expected 1 to 32, got 33",
    ),
    "products: no square": (
        lambda loops: _products_followed(loops, 3, np.zeros((3, 4))),
        "products: expected 3, got 4",
    ),
    "parts: sizing": (lambda loops: _parts(loops, sizing=np.ones(4)), "sizing: expected 5, got 4"),
    "parts: segments": (
        lambda loops: _parts(loops, segments=np.array([5])),
        "segments: expected indices below 5, got 5",
    ),
    "parts: above": (lambda loops: _parts(loops, above=np.ones((2, 4))), "above: expected 1, got 2"),
    "parts: joints": (lambda loops: _parts(loops, above=np.ones((1, 257))), "joints: expected 1 to 256, got 257"),
    "parts: ends": (lambda loops: _parts(loops, ends=np.zeros((3, 4), np.uint8)), "ends: expected 5, got 4"),
    "parts: spread": (lambda loops: _parts(loops, spread=np.zeros(0)), "spread: expected 5, got 0"),
    "parts: posture": (lambda loops: _parts(loops, posture=np.zeros(6)), "posture: expected 5, got 6"),
    "parts: trend": (lambda loops: _parts(loops, trend=np.zeros(4)), "trend: expected 5, got 4"),
    "parts: between two numbers": (
        lambda loops: _parts(loops, sizing=cast("np.ndarray", memoryview(bytearray(41))[1:].cast("d"))),
        "sizing: expected numbers that begin at multiples of their size",
    ),
    "eigenpairs: many": (
        lambda loops: loops.eigenpairs(np.zeros((1, 8, 8)), np.zeros((1, 5)), np.zeros((1, 5, 8))),
        "values: expected 1 to 4, got 5",
    ),
    "eigenpairs: more than there are": (
        lambda loops: loops.eigenpairs(np.zeros((1, 2, 2)), np.zeros((1, 3)), np.zeros((1, 3, 2))),
        "values: expected 1 to 2, got 3",
    ),
    "eigen: no number": (
        lambda loops: _call(
            loops,
            "read_eigen",
            np.zeros(3),
            np.full((3, 3), np.nan),
            np.array([0, 2]),
            np.zeros(2),
            np.zeros(3),
            *np.zeros((2, 3, 3)),
            np.zeros((3, 8)),
        ),
        "products: expected finite numbers",
    ),
    "table: many groups": (
        lambda loops: loops.Table(_WINDOWS, _ONE, _ONE, np.ones((1, 9), _F), 0.01),
        "groups: expected 1 to 8, got 9",
    ),
    "table: blocks descend": (
        lambda loops: loops.Table(_WINDOWS, np.array([0, 2, 1]), _ONE, np.ones((1, 1), _F), 0.01),
        "blocks: expected to start at 0 and ascend below 3",
    ),
    "table: blocks beyond": (
        lambda loops: loops.Table(_WINDOWS, np.array([0, 3]), _ONE, np.ones((1, 1), _F), 0.01),
        "blocks: expected to start at 0 and ascend below 3",
    ),
    "table: classes": (
        lambda loops: loops.Table(_WINDOWS, _ONE, np.array([0, 1]), np.ones((1, 1), _F), 0.01),
        "classes: expected 1 to 1, got 2",
    ),
    "part: origin": (
        lambda loops: _table(loops).add_part(0, 0, np.zeros(3, _F), np.zeros((4, 2), _H)),
        "axes: expected 3, got 4",
    ),
    "part: many axes": (
        lambda loops: _table(loops).add_part(0, 0, np.zeros(4, _F), np.zeros((4, 257), _H)),
        "axes: expected 1 to 256, got 257",
    ),
    "part: eigenvectors": (
        lambda loops: _table(loops).add_part(4, 3, np.zeros(5, _F), np.zeros((5, 2), _H)),
        "origin: expected 6, got 5",
    ),
    "part: many": (
        lambda loops: _table(loops, parts=8).add_part(0, 0, np.zeros(4, _F), np.zeros((4, 2), _H)),
        "parts: expected 1 to 8, got 9",
    ),
    "group: members": (
        lambda loops: _table(loops).add_group(
            np.array([1]), _NO_ORIGIN, _NO_AXES, np.zeros((3, 2), _H), np.zeros(3, _F)
        ),
        "members: expected indices below 1, got 1",
    ),
    "group: windows": (
        lambda loops: _table(loops).add_group(_ONE, _NO_ORIGIN, _NO_AXES, np.zeros((2, 2), _H), np.zeros(2, _F)),
        "windows: expected 3, got 2",
    ),
    "group: axes": (
        lambda loops: _table(loops).add_group(_ONE, _NO_ORIGIN, _NO_AXES, np.zeros((3, 3), _H), np.zeros(3, _F)),
        "windows: expected 2, got 3",
    ),
    "group: metric": (
        lambda loops: _table(loops).add_group(
            _ONE, np.zeros(3, _F), np.zeros((3, 2), _H), np.zeros((3, 2), _H), np.zeros(3, _F)
        ),
        "origin: expected 2, got 3",
    ),
    "group: one too many": (
        lambda loops: _with_group(loops).add_group(_ONE, _NO_ORIGIN, _NO_AXES, np.zeros((3, 2), _H), np.zeros(3, _F)),
        "groups: expected 1 to 1, got 2",
    ),
    "compared: groups are missing": (
        lambda loops: _table(loops).compared(np.zeros(4), np.zeros((1, 1))),
        "groups: expected 1, got 0",
    ),
    "compared: numbers": (
        lambda loops: _with_group(loops).compared(np.zeros(3), np.zeros((1, 1))),
        "numbers: expected 4, got 3",
    ),
    "compared: logs": (
        lambda loops: _with_group(loops).compared(np.zeros(4), np.zeros((1, 2))),
        "classes: expected 1, got 2",
    ),
    "scores: eigenvector": (
        lambda loops: _table(loops).scores(np.zeros(3), np.zeros(1)),
        "eigenvector: expected 2, got 3",
    ),
    "scores: classes": (lambda loops: _table(loops).scores(np.zeros(2), np.zeros(2)), "scores: expected 1, got 2"),
    "moving: back": (
        lambda loops: loops.moving(np.zeros((3, 2)), 3, 1.0, np.zeros((4, 4)), np.zeros(4, _F)),
        "back: expected 0 to 2",
    ),
    "moving: whitening": (
        lambda loops: loops.moving(np.zeros((3, 2)), 1, 1.0, np.zeros((3, 4)), np.zeros(4, _F)),
        "whitening: expected 4, got 3",
    ),
    "steps: last": (
        lambda loops: loops.steps(np.zeros((2, 5, 3)), np.zeros((4, 3)), np.zeros((2, 5, 3))),
        "last: expected 5, got 4",
    ),
    "extremes: ends": (
        lambda loops: loops.extremes(np.zeros((2, 5, 3)), np.array([[0, 5]]), np.zeros((2, 1)), np.zeros(5)),
        "ends: expected indices below 5, got 5",
    ),
    "extremes: lengths": (
        lambda loops: loops.extremes(np.zeros((2, 5, 3)), np.array([[0, 1]]), np.zeros((2, 2)), np.zeros(5)),
        "lengths: expected 1, got 2",
    ),
    "followed: bins": (lambda loops: _followed(loops, indices=np.array([[0, 64], [0, 1]])), "indices: expected bins"),
    "followed: order": (lambda loops: _followed(loops, indices=np.array([[0, 1], [0, 2]])), "indices: expected bins"),
    "followed: starts": (lambda loops: _followed(loops, starts=np.array([1])), "indices: expected bins below 64"),
    "followed: room": (lambda loops: _followed(loops, room=np.zeros(17, _F)), "room: expected 18, got 17"),
    "followed: told": (lambda loops: _followed(loops, told=np.zeros(2)), "told: expected 3, got 2"),
    "followed: live": (lambda loops: _followed(loops, live=np.zeros(3, _F)), "live: expected 2, got 3"),
    "followed: constants": (lambda loops: _followed(loops, constants=np.zeros(7)), "constants: expected 8, got 7"),
    "table: no window": (
        lambda loops: loops.Table(_WINDOWS[:0], _ONE, _ONE, np.ones((1, 1), _F), 0.01),
        "windows: expected 1 to [0-9]*, got 0",
    ),
}


@pytest.mark.parametrize("name", _REFUSED)
def test_arrays_that_do_not_fit_are_refused(loops: compiled.Loops, name: str) -> None:
    """An array of another shape or type raises ValueError with its name, the expectation and the value found."""
    call, told = _REFUSED[name]
    with pytest.raises(ValueError, match=told):
        call(loops)


@pytest.mark.parametrize(
    "function",
    [
        "measure_distances",
        "eigenpairs",
        "follow_phase",
        "moving",
        "steps",
        "extremes",
        "Table",
    ],
)
def test_too_few_arguments_are_refused(loops: compiled.Loops, function: str) -> None:
    """A call without its arrays raises TypeError."""
    with pytest.raises(TypeError, match=r"expected \d+ arguments, got 1"):
        getattr(loops, function)(np.zeros(3))


def test_a_bound_call_is_the_call_with_its_arguments(loops: compiled.Loops) -> None:
    """It reads and writes its arrays, though nothing else keeps them, with new numbers in the last places."""
    bound, direct = np.zeros((2, 4, 5))
    run = loops.Bound("follow", *_of_sums(bound), 12.0, 100, 0, 0).run
    for end in (12, 14, 30):
        assert run(end, 0) is (end != 14)
    arrays = _of_sums(direct)
    for end in (12, 14, 30):
        _call(loops, "follow", *arrays, 12.0, 100, end, 0)
    assert np.array_equal(bound, direct)
    assert bound.any()


def _of_sums(sums: np.ndarray) -> tuple[np.ndarray, ...]:
    return ROWS.copy(), np.arange(30.0), np.zeros(2, np.intp), np.zeros(2), sums, np.zeros(3)


def test_a_call_that_cannot_be_bound_is_refused(loops: compiled.Loops) -> None:
    """What does not fit raises when it is bound, or when it is called with more than numbers can stand for."""
    arrays, nothing = _of_sums(np.zeros((4, 5))), cast("Any", None)
    for name, given, error, told in (
        ("steps", arrays, ValueError, "name: expected a function of every hop, got steps"),
        ("follow", arrays, TypeError, "expected 10 arguments, got 6"),
        ("follow", (*arrays[:4], np.zeros((3, 5)), arrays[5], 1.0, 9, 0, 0), ValueError, "sums: expected 4, got 3"),
        (nothing, arrays, TypeError, "argument type"),
    ):
        with pytest.raises(error, match=told):
            loops.Bound(name, *given)
    run = loops.Bound("follow", *arrays, 12.0, 100, 0, 0).run
    for numbers, told in (((1.0,) * 5, "numbers only"), ((1.0,) * 11, "numbers only"), ((1.0, "2"), "real number")):
        with pytest.raises(TypeError, match=told):
            run(*numbers)
    with pytest.raises(ValueError, match="end: expected 0 to 30"):
        run(31, 0)


def test_the_error_names_the_first_of_two_bad_numbers(loops: compiled.Loops) -> None:
    """An argument that is no number raises TypeError before the loop asks for the next one, which may be a fraction."""
    none, fraction = cast("Any", "2"), cast("Any", Fraction(1, 2))
    arrays, ends = (np.ones((4, 5)), np.zeros(3)), np.zeros((3, 5), np.uint8)
    with pytest.raises(TypeError, match="must be real number, not str"):
        _call(
            loops,
            "read_parts",
            *arrays,
            np.array([0, 1]),
            np.ones(5),
            _ONE,
            np.ones((1, 2)),
            ends,
            none,
            fraction,
            *np.zeros((3, 5)),
        )


def test_read_only_rows_are_refused_before_anything_is_written(loops: compiled.Loops) -> None:
    """The loop refuses rows that it may not write to, and writes nothing."""
    rows = np.zeros((1, 465))
    rows.flags.writeable = False
    with pytest.raises(ValueError, match="read-only"):
        loops.measure_distances(np.ones((1, 31, 3)), PAIRS, rows)
