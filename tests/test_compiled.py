"""The compiled loops: each against its slow twin, of every kind; whole streams beside numpy's; wrong arrays refused."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, cast

import naive
import naive_windows
import numpy as np
import pytest
from conftest import NO_LOOPS
from programs import ROOT

from library import MotionLibrary, compiled, hdm05
from library.distances import distance_rows
from library.measures import LEVEL_REMOVED, SHAPE_FLOOR, SPREAD_FLOOR, Body
from library.shortlist import DIRECTIONS, Shortlist
from stream.frame import Frame
from stream.recognizer import LiveSignature, Recognizer, Settings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from library.clip import Clip
    from library.measures import Measure
    from library.windowtable import WindowTable
    from stream.recognition import Recognition
    from tools.bench.recorded import Recorded

KINDS = ("any", "avx2", "avx512")
#: As `library.measures` has it.
NO_MOVEMENT = 1e-7
BODY = hdm05.SKELETON
PAIRS = np.ascontiguousarray(BODY.pairs)


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


def _sums(rows: np.ndarray, reference: np.ndarray) -> np.ndarray:
    relative = rows - reference
    return np.array([reference, relative.sum(axis=0), np.square(relative).sum(axis=0)])


# --- each loop ---------------------------------------------------------------------------------------------------


def test_as_many_kinds_are_tried_as_the_processor_has(loops: compiled.Loops) -> None:
    """What is in use is what was asked for, and what does not exist is refused by name."""
    kind = loops.kind()
    assert kind in KINDS
    assert compiled.kind() == f"compiled loops ({kind})"
    with pytest.raises(ValueError, match=r"kind: expected any, avx2 or avx512, .* got mmx"):
        loops.use("mmx")
    assert loops.kind() == kind


@pytest.mark.parametrize("frames", [1, 2, 3, 4, 5, 7, 16])
def test_distances_are_those_of_three_loops(loops: compiled.Loops, some_clips: tuple[Clip, ...], frames: int) -> None:
    """However many frames are measured side by side, each has the distances that three loops give."""
    for clip in some_clips:
        positions = np.ascontiguousarray(clip.positions[40 : 40 + frames], dtype=np.float64)
        rows = _with_room(np.zeros((frames, len(PAIRS))))
        loops.measure_distances(positions, PAIRS, rows)
        np.testing.assert_allclose(rows, naive.distance_rows(positions, PAIRS.tolist()), rtol=1e-14, atol=1e-15)
        for index in range(frames):
            alone = np.empty((1, len(PAIRS)))
            loops.measure_distances(positions[index : index + 1], PAIRS, alone)
            assert np.array_equal(alone[0], rows[index])


@pytest.mark.parametrize(("entered", "left"), [(4, 4), (1, 0), (0, 3), (9, 2), (0, 0)])
def test_sums_follow_rows(loops: compiled.Loops, some_clips: tuple[Clip, ...], entered: int, left: int) -> None:
    """What entered is added and what left is taken away; the largest sum of squares is told with its sum."""
    for clip in some_clips:
        rows = _with_room(distance_rows(clip.positions, BODY))
        reference = rows[:60].mean(axis=0)
        sums = _sums(rows[:60], reference)
        squares, total = loops.follow(sums, rows[60 : 60 + entered], rows[:left])
        expected = _sums(rows[left : 60 + entered], reference)
        np.testing.assert_allclose(sums, expected, atol=1e-12)
        assert squares == sums[2].max()
        assert total == sums[1, sums[2].argmax()]


def test_spread_is_the_slow_twins(loops: compiled.Loops, some_clips: tuple[Clip, ...]) -> None:
    """Of real windows, about any reference, the spread is as added up number by number, and so is the movement."""
    body = Body.of(BODY)
    for clip in some_clips:
        rows = distance_rows(clip.positions[30:130], BODY)
        spread = np.empty(len(PAIRS))
        movement = loops.read_spread(_sums(rows, rows[0]), len(rows), body.sizing, SPREAD_FLOOR, LEVEL_REMOVED, spread)
        pairs = [(int(a), int(b)) for a, b in PAIRS]
        np.testing.assert_allclose(spread, naive_windows.spread(rows, pairs, BODY.parents), rtol=1e-9, atol=1e-9)
        variances, means = rows.var(axis=0, ddof=1), rows.mean(axis=0)
        assert movement == pytest.approx(np.sqrt(variances.sum() / np.square(means).sum()), rel=1e-9)


@pytest.mark.parametrize("size", [1, 2, 7, 8, 9, 20, 24, 32])
@pytest.mark.parametrize("frames", [8, 31, 32, 33, 240])
def test_shape_is_the_slow_twins(loops: compiled.Loops, some_clips: tuple[Clip, ...], frames: int, size: int) -> None:
    """Of any number of frames and directions the shape is as taken out of the covariance number by number."""
    directions = np.random.default_rng(size).normal(size=(len(PAIRS), size)) / 20
    clip = max(some_clips, key=lambda each: each.frames)
    courses = _with_room(distance_rows(clip.positions[:frames], BODY) @ directions)
    shape = np.empty(size * (size + 1) // 2)
    loops.read_shape(courses, SHAPE_FLOOR, NO_MOVEMENT, shape)
    np.testing.assert_allclose(shape, naive_windows.shape(naive.covariance(courses)), atol=1e-10)


def test_what_does_not_move_has_no_shape(loops: compiled.Loops) -> None:
    """A single frame, and frames that are alike but for the eighth digit, have the shape of nothing."""
    still = np.tile(np.arange(1.0, 25.0), (100, 1))
    for courses in (still[:1], still, still * (1 + 1e-9 * np.random.default_rng(1).normal(size=still.shape))):
        shape = np.ones(300)
        loops.read_shape(np.ascontiguousarray(courses), SHAPE_FLOOR, NO_MOVEMENT, shape)
        assert not shape.any()


@pytest.mark.parametrize("fewer", [1, 5, 16, 24])
def test_a_shape_is_turned_as_the_slow_twin_turns_it(loops: compiled.Loops, fewer: int) -> None:
    """In some other directions a shape is that of its covariance as seen along them; nothing stays nothing."""
    generator = np.random.default_rng(fewer)
    courses = generator.normal(size=(100, 24)) * np.geomspace(1, 0.01, 24)
    directions = np.ascontiguousarray(np.linalg.qr(generator.normal(size=(24, 24)))[0][:, :fewer])
    shape, turned = np.empty(300), np.empty(fewer * (fewer + 1) // 2)
    loops.read_shape(courses, SHAPE_FLOOR, NO_MOVEMENT, shape)
    loops.turn_shape(shape, directions, SHAPE_FLOOR, turned)
    np.testing.assert_allclose(turned, naive_windows.shape_shown(shape.tolist(), directions), atol=1e-10)
    loops.turn_shape(np.zeros(300), directions, SHAPE_FLOOR, turned)
    assert not turned.any()


@pytest.mark.parametrize("fresh", [1, 3, 4, 5, 9, 40])
def test_inner_products_of_new_frames_are_those_of_all(
    loops: compiled.Loops, some_clips: tuple[Clip, ...], fresh: int
) -> None:
    """Beside those that were there, the products of centred rows are the slow twin's, symmetric to the last bit."""
    for clip in some_clips:
        rows = _with_room(distance_rows(clip.positions[:40], BODY))
        reference = rows.mean(axis=0)
        square, of_each = _with_room(np.full((40, 40), np.nan)), np.full((2, 40), np.nan)
        room = np.empty((loops.TOGETHER, len(PAIRS)))
        for known in range(fresh, 41, fresh):
            loops.add_frames(rows[:known], fresh, reference, room, square[:known, :known], of_each[:, :known])
        there = square[:known, :known]
        assert np.array_equal(there, there.T)
        assert np.array_equal(of_each[0, :known], there.diagonal())
        np.testing.assert_allclose(of_each[1, :known], (rows[:known] - reference) @ reference, atol=1e-12)
        # Relative to the reference one row is as good as another: what is left is taken out with the mean.
        middle = np.eye(known) - 1 / known
        np.testing.assert_allclose(middle @ there @ middle, naive.gram(rows[:known]), atol=1e-12)


@pytest.mark.parametrize("size", [4, 15, 16, 17, 40, 120])
def test_vectors_times_a_centred_matrix(loops: compiled.Loops, size: int) -> None:
    """A symmetric matrix, its mean taken out of rows and columns, times vectors of any mean."""
    generator = np.random.default_rng(size)
    square = _with_room(generator.normal(size=(size, size)))
    square += square.T.copy()
    vectors, images = generator.normal(size=(loops.TOGETHER, size)), np.empty((loops.TOGETHER, size))
    loops.times_centred(vectors, square, images)
    middle = np.eye(size) - 1 / size
    np.testing.assert_allclose(images, vectors @ middle @ square @ middle, atol=1e-12 * size)


@pytest.mark.parametrize("near", [1.0, 1e-4, 1e-9])
def test_bases_are_orthonormal_however_near_vectors_are(loops: compiled.Loops, near: float) -> None:
    """Vectors that hardly differ span an orthonormal basis all the same; what spans nothing is said to."""
    generator = np.random.default_rng(7)
    vectors = generator.normal(size=120) + near * generator.normal(size=(4, 120))
    basis = np.empty((4, 120))
    assert loops.orthonormal(vectors, basis)
    np.testing.assert_allclose(basis @ basis.T, np.eye(4), atol=1e-13)
    # Each lies in what it and those before it span.
    for count in range(1, 5):
        left = vectors[:count] - vectors[:count] @ basis[:count].T @ basis[:count]
        assert np.abs(left).max() < 1e-12
    for unfit in (np.zeros((2, 9)), np.ones((2, 9)), np.full((2, 9), np.nan)):
        assert not loops.orthonormal(unfit, np.empty((2, 9)))


# --- windows and axes compared -----------------------------------------------------------------------------------


def _windows() -> WindowTable:
    table = MotionLibrary.builtin().windows
    assert table is not None
    return table


def _measures(seed: int, scale: float = 1.0) -> dict[Measure, np.ndarray]:
    """Make measures about as far from the library's as people are."""
    generator, table = np.random.default_rng(seed), _windows()
    return {
        measure: table.comparison.metrics[measure].origin
        + scale * generator.normal(scale=0.2, size=len(table.comparison.metrics[measure].origin))
        for measure in table.measures
    }


@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize("scale", [0.0, 0.1, 1.0, 100.0, 1e10, np.nan])
def test_windows_are_as_far_as_numpy_finds_them(scale: float) -> None:
    """Near, far, too far to count, or no numbers at all: distances are numpy's, by class and window by window."""
    table, measures = _windows(), _measures(3, scale)
    near, squares = table.compared(measures), table.squared_distances(measures)
    with compiled.left_aside():
        numpys_near, numpys_squares = table.compared(measures), table.squared_distances(measures)
    np.testing.assert_allclose(near, numpys_near, atol=1e-5)
    for ours, theirs in zip(squares, numpys_squares, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-5, atol=1e-5)


@pytest.mark.usefixtures("loops")
def test_windows_finer_than_half_precision_are_left_to_numpy() -> None:
    """Numbers that would be rounded are not taken: nobody's library is compared less exactly than it is kept."""
    whole = np.ones((3, 2), dtype=np.float32)
    fine, large = whole.copy(), whole.copy()
    fine[1, 1] += np.float32(2**-12)
    large[1, 1] = 1e6
    origin, starts = np.zeros(4, dtype=np.float32), np.array([0])

    def laid_out(vectors: np.ndarray, axes: np.ndarray) -> object:
        groups = [[(origin, axes, 0.0, 1.0)]]
        return compiled.laid_out(groups, [vectors], starts, starts, nearest=0.01, farthest=1e9)

    axes = np.ones((4, 2), dtype=np.float32)
    assert laid_out(whole, axes) is not None
    for unfit in (fine, large):
        assert laid_out(unfit, axes) is None
    axes[0, 0] += np.float32(2**-12)
    assert laid_out(whole, axes) is None


@pytest.mark.usefixtures("loops")
def test_more_axes_than_there_is_room_for_are_left_to_numpy() -> None:
    """Of 257 axes a library is not refused."""
    starts, most = np.array([0]), 256

    def laid_out(axes: int) -> object:
        part = (np.zeros(4, np.float32), np.zeros((4, axes), np.float32), 0.0, 1.0)
        vectors = np.zeros((3, axes), np.float32)
        return compiled.laid_out([[part]], [vectors], starts, starts, nearest=0.01, farthest=1e9)

    assert laid_out(most) is not None
    assert laid_out(most + 1) is None


@pytest.mark.usefixtures("loops")
def test_directions_may_lie_column_by_column() -> None:
    """A body of fewer joints from a file that has its directions so is compared all the same."""
    library = MotionLibrary.builtin()
    table = library.restricted_to(library.skeleton.joints[::2]).windows
    assert table is not None
    assert table.directions_shown is not None
    column_by_column = replace(table, directions_shown=np.asfortranarray(table.directions_shown))
    measures = {each: table.comparison.metrics[each].origin.astype(np.float64) for each in table.measures}
    assert np.array_equal(column_by_column.compared(measures), table.compared(measures))


@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])  # noqa: S301 - its own
def test_a_library_can_be_copied(copied: Callable[[object], Any]) -> None:
    """A deep copy, and what another process is handed, compare as the library does."""
    table, measures = _windows(), _measures(4)
    assert np.array_equal(copied(MotionLibrary.builtin()).windows.compared(measures), table.compared(measures))
    shortlist = Shortlist(_axes(500, 1), np.array([0, 100]))
    asked = _axes(3, 2)
    assert np.array_equal(copied(shortlist).class_scores(asked), shortlist.class_scores(asked))


def _axes(count: int, seed: int) -> np.ndarray:
    """Make unit vectors that fill few of their directions, as bodies' do."""
    generator = np.random.default_rng(seed)
    axes = generator.normal(size=(count, 465)) * np.geomspace(1, 0.001, 465)
    return np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True), dtype=np.float32)


@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize("count", [200, 1000, 5001])
def test_a_short_list_misses_nobody(count: int) -> None:
    """From numbers in half precision, too, the best of each class is the best of the whole comparison."""
    axes, starts = _axes(count, 1), np.array([0, 1, count // 3, count - 1])
    asked = _axes(20, 2)
    scores = Shortlist(axes, starts).class_scores(asked)
    whole = np.maximum.reduceat(np.abs(asked @ axes.T), starts, axis=1)
    np.testing.assert_allclose(scores, whole, atol=1e-6)


def test_the_first_look_lists_whoever_may_be_good_enough(loops: compiled.Loops) -> None:
    """Products are those of rounded numbers, each class's best has the largest, whoever reaches the least is listed."""
    within = (_axes(1000, 3)[:, : DIRECTIONS[0]]).astype(np.float16)
    outside, doubt = np.linspace(0.0, 0.3, 1000, dtype=np.float32), np.linspace(0.01, 0.0, 1000, dtype=np.float32)
    starts = np.array([0, 64, 100, 999])
    look = loops.Look(within, outside, doubt, starts)
    axis = _axes(1, 4)[0, : DIRECTIONS[0]]
    products, best = np.empty(1000, dtype=np.float32), np.empty(4, dtype=np.intp)
    look.products(axis, products, best)
    scores = np.abs(within.astype(np.float64) @ axis)
    np.testing.assert_allclose(np.abs(products), scores, atol=1e-6)
    assert np.array_equal(np.abs(products)[best], np.maximum.reduceat(np.abs(products), starts))
    least = np.array([0.2, 0.4, 0.1, 2.0], dtype=np.float32)
    room = np.empty(1000, dtype=np.intp)
    listed = room[: look.listed(products, least, 0.5, room)]
    may_be = np.abs(products) + np.float32(0.5) * outside + doubt >= np.repeat(least, np.diff(starts, append=1000))
    assert listed.tolist() == np.flatnonzero(may_be).tolist()
    assert 0 < len(listed) < 1000


def test_products_of_listed_rows_are_added(loops: compiled.Loops) -> None:
    """Each row that is listed, in any order and as often as it is, adds its product to its own sum."""
    generator = np.random.default_rng(5)
    rows, vector = _axes(50, 5)[:, :61], _axes(1, 6)[0, :61]
    listed = generator.integers(0, 50, size=33)
    sums = np.ones(33, dtype=np.float32)
    loops.add_products(rows, vector, listed, sums)
    np.testing.assert_allclose(sums, 1 + rows[listed].astype(np.float64) @ vector, atol=1e-6)
    loops.add_products(rows, vector, listed[:0], sums[:0])


# --- whole streams -----------------------------------------------------------------------------------------------


def _answers(library: MotionLibrary, settings: Settings, take: Clip, joints: tuple[str, ...]) -> list[Recognition]:
    recognizer = Recognizer(library, settings)
    places = [take.skeleton.joints.index(joint) for joint in joints]
    positions = take.positions[: 10 * round(take.frame_rate), places]
    frames = (Frame("p", index / take.frame_rate, each) for index, each in enumerate(positions))
    return [answer for frame in frames if (answer := recognizer.push(frame))]


@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize("joints", [BODY.joints, BODY.joints[::2]], ids=["31 joints", "16 joints"])
@pytest.mark.parametrize("signature", list(LiveSignature))
def test_a_stream_is_answered_as_numpy_answers_it(
    recordings: Recorded, signature: LiveSignature, joints: tuple[str, ...]
) -> None:
    """Ten seconds of each take: at every hop outcome, guess and events are the same, scores to five digits."""
    library = MotionLibrary.builtin()
    library = library if joints == library.skeleton.joints else library.restricted_to(joints)
    settings = Settings(signature=signature)
    ours = [_answers(library, settings, take, joints) for take in recordings.takes]
    for take, answers in zip(recordings.takes, ours, strict=True):
        with compiled.left_aside():
            theirs = _answers(library, settings, take, joints)
        assert len(answers) == len(theirs) > 0
        for mine, other in zip(answers, theirs, strict=True):
            assert (mine.outcome, mine.guess, mine.time) == (other.outcome, other.guess, other.time)
            assert [event.kind for event in mine.events] == [event.kind for event in other.events]
            np.testing.assert_allclose(mine.scores, other.scores, atol=2e-5)
            assert mine.movement == pytest.approx(other.movement, rel=1e-6)


@pytest.mark.usefixtures("loops")
def test_they_can_be_left_aside_for_a_while() -> None:
    """While they are left aside numpy does the arithmetic; afterwards, even after an error, they are back."""
    before, meanwhile = compiled.loops, list[str]()

    def fail() -> None:
        with compiled.left_aside():
            meanwhile.append(compiled.kind())
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert meanwhile == ["numpy"]
    assert compiled.loops is before is not None


def test_what_was_built_from_older_sources_is_left_aside() -> None:
    """A module that lacks one of the loops is as good as none."""
    lacking = (
        "import sys, types; old = types.ModuleType('library._compiled'); old.follow = None; "
        "sys.modules['library._compiled'] = old; from library import compiled; print(compiled.kind())"
    )
    asked = [sys.executable, "-c", lacking]
    told = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60)
    assert told.stdout == "numpy\n"


def test_they_can_be_left_aside() -> None:
    """With KINESPACE_COMPILED=0 numpy does the arithmetic."""
    asked = [sys.executable, "-c", "from library import compiled; print(compiled.kind())"]
    environment = os.environ | {"KINESPACE_COMPILED": "0"}
    told = subprocess.run(asked, cwd=ROOT, env=environment, capture_output=True, text=True, check=True, timeout=60)
    assert told.stdout == "numpy\n"


@pytest.mark.usefixtures("loops")
@pytest.mark.parametrize("signature", list(LiveSignature))
def test_a_recogniser_is_copied_in_full(recordings: Recorded, signature: LiveSignature) -> None:
    """A copy made in the middle of a feed goes on as the recogniser does that it was made of."""
    recognizer = Recognizer(MotionLibrary.builtin(), Settings(signature=signature))
    take = recordings.takes[0]
    frames = [Frame("p", index / 120, each) for index, each in enumerate(take.positions[:200])]
    for frame in frames[:150]:
        recognizer.push(frame)
    copied = copy.deepcopy(recognizer)
    for frame in frames[150:]:
        ours, theirs = recognizer.push(frame), copied.push(frame)
        assert (ours is None) == (theirs is None)
        if ours and theirs:
            assert np.array_equal(ours.scores, theirs.scores)


# --- what is refused ---------------------------------------------------------------------------------------------

_F, _H = np.float32, np.float16
_ONE = np.array([0])
_SIX_ROWS, _INDICES = np.zeros((6, 5)), np.zeros(60, np.intp)


def _part(numbers: int = 4, axes: int = 2) -> tuple[compiled.Floats, compiled.Halves, float, float]:
    return (np.zeros(numbers, _F), np.zeros((numbers, axes), _H), 0.0, 1.0)


def _group(
    windows: int = 3, axes: int = 2, lengths: int = 3
) -> tuple[tuple[tuple[compiled.Floats, compiled.Halves, float, float], ...], compiled.Halves, compiled.Floats]:
    return ((_part(),), np.zeros((windows, axes), _H), np.zeros(lengths, _F))


_REFUSED: dict[str, tuple[Callable[[compiled.Loops], object], str]] = {
    "distances: coordinates": (
        lambda loops: loops.measure_distances(np.zeros((2, 31, 2)), PAIRS, np.zeros((2, 465))),
        "axes: expected 3, got 2",
    ),
    "distances: single precision": (
        lambda loops: loops.measure_distances(np.zeros((2, 31, 3), _F), PAIRS, np.zeros((2, 465))),
        "positions: expected 3 dimensions of type d, got 3 of f",
    ),
    "distances: pairs": (
        lambda loops: loops.measure_distances(np.zeros((2, 30, 3)), PAIRS, np.zeros((2, 465))),
        "pairs: expected indices of 30 joints, got 30",
    ),
    "distances: fewer rows": (
        lambda loops: loops.measure_distances(np.zeros((2, 31, 3)), PAIRS, np.zeros((1, 465))),
        "rows: expected 2, got 1",
    ),
    "distances: narrow rows": (
        lambda loops: loops.measure_distances(np.zeros((2, 31, 3)), PAIRS, np.zeros((2, 464))),
        "pairs: expected 465, got 464",
    ),
    "distances: every other frame": (
        lambda loops: loops.measure_distances(np.zeros((4, 31, 3))[::2], PAIRS, np.zeros((2, 465))),
        "positions: expected numbers side by side",
    ),
    "distances: many joints": (
        lambda loops: loops.measure_distances(np.zeros((1, 257, 3)), PAIRS, np.zeros((1, 465))),
        "joints: expected 1 to 256, got 257",
    ),
    "sums: two rows": (
        lambda loops: loops.follow(np.zeros((2, 5)), np.zeros((1, 5)), np.zeros((0, 5))),
        "sums: expected 3, got 2",
    ),
    "sums: wide rows": (
        lambda loops: loops.follow(np.zeros((3, 5)), np.zeros((1, 6)), np.zeros((0, 5))),
        "entered: expected 5, got 6",
    ),
    "sums: wide rows left": (
        lambda loops: loops.follow(np.zeros((3, 5)), np.zeros((1, 5)), np.zeros((0, 6))),
        "left: expected 5, got 6",
    ),
    "sums: no distance": (
        lambda loops: loops.follow(np.zeros((3, 0)), np.zeros((9, 0)), np.zeros((0, 0))),
        "sums: expected 1 to [0-9]*, got 0",
    ),
    "sums: among the rows": (
        lambda loops: loops.follow(_SIX_ROWS[:3], _SIX_ROWS[2:4], np.zeros((0, 5))),
        "sums: expected memory that is in no other array",
    ),
    "spread: sizing": (
        lambda loops: loops.read_spread(np.zeros((3, 5)), 2, np.zeros(4), 0.1, 0.5, np.zeros(5)),
        "sizing: expected 5, got 4",
    ),
    "spread: numbers": (
        lambda loops: loops.read_spread(np.zeros((3, 5)), 2, np.zeros(5), 0.1, 0.5, np.zeros(6)),
        "numbers: expected 5, got 6",
    ),
    "shape: no frame": (
        lambda loops: loops.read_shape(np.zeros((0, 3)), 0.1, 0.1, np.zeros(6)),
        "frames: expected 1 to",
    ),
    "shape: many directions": (
        lambda loops: loops.read_shape(np.zeros((9, 33)), 0.1, 0.1, np.zeros(561)),
        "directions: expected 1 to 32, got 33",
    ),
    "shape: numbers": (
        lambda loops: loops.read_shape(np.zeros((9, 3)), 0.1, 0.1, np.zeros(5)),
        "numbers: expected 6, got 5",
    ),
    "turned: numbers": (
        lambda loops: loops.turn_shape(np.zeros(6), np.zeros((3, 2)), 0.1, np.zeros(6)),
        "numbers: expected 3, got 6",
    ),
    "turned: shape": (
        lambda loops: loops.turn_shape(np.zeros(5), np.zeros((3, 2)), 0.1, np.zeros(3)),
        "shape: expected 6, got 5",
    ),
    "turned: between two numbers": (
        lambda loops: loops.turn_shape(
            cast("np.ndarray", memoryview(bytearray(49))[1:].cast("d")), np.zeros((3, 2)), 0.1, np.zeros(3)
        ),
        "shape: expected numbers that begin at multiples of their size",
    ),
    "table: axes beyond count": (
        lambda loops: loops.Table(
            cast("Any", ((((np.zeros(0, _F), np.zeros((0, 2**61 + 64), _H), 0.0, 1.0),) * 4, *_group(axes=256)[1:]),)),
            3,
            _ONE,
            _ONE,
            0.01,
            1e9,
        ),
        "axes: expected 1 to 256, got 2305843009213694016",
    ),
    "frames: none is new": (
        lambda loops: loops.add_frames(
            np.zeros((9, 5)), 0, np.zeros(5), np.zeros((4, 5)), np.zeros((9, 9)), np.zeros((2, 9))
        ),
        "fresh: expected 1 to 9, got 0",
    ),
    "frames: small square": (
        lambda loops: loops.add_frames(
            np.zeros((9, 5)), 1, np.zeros(5), np.zeros((4, 5)), np.zeros((8, 8)), np.zeros((2, 9))
        ),
        "square: expected 9, got 8",
    ),
    "frames: little room": (
        lambda loops: loops.add_frames(
            np.zeros((9, 5)), 1, np.zeros(5), np.zeros((3, 5)), np.zeros((9, 9)), np.zeros((2, 9))
        ),
        "relative: expected 4, got 3",
    ),
    "vectors: too few": (
        lambda loops: loops.times_centred(np.zeros((3, 9)), np.zeros((9, 9)), np.zeros((3, 9))),
        "vectors: expected 4, got 3",
    ),
    "vectors: no square": (
        lambda loops: loops.times_centred(np.zeros((4, 9)), np.zeros((9, 8)), np.zeros((4, 9))),
        "square: expected 9, got 8",
    ),
    "basis: small": (
        lambda loops: loops.orthonormal(np.zeros((4, 9)), np.zeros((4, 8))),
        "basis: expected 9, got 8",
    ),
    "table: no group": (lambda loops: loops.Table((), 3, _ONE, _ONE, 0.01, 1e9), "groups: expected 1 to 4, got 0"),
    "table: windows": (
        lambda loops: loops.Table((_group(windows=2),), 3, _ONE, _ONE, 0.01, 1e9),
        "vectors: expected 3, got 2",
    ),
    "table: axes": (
        lambda loops: loops.Table((_group(axes=3),), 3, _ONE, _ONE, 0.01, 1e9),
        "axes: expected 2, got 3",
    ),
    "table: lengths": (
        lambda loops: loops.Table((_group(lengths=2),), 3, _ONE, _ONE, 0.01, 1e9),
        "lengths: expected 3, got 2",
    ),
    "table: blocks descend": (
        lambda loops: loops.Table((_group(),), 3, np.array([0, 2, 1]), _ONE, 0.01, 1e9),
        "blocks: expected to start at 0 and ascend below 3",
    ),
    "table: blocks beyond": (
        lambda loops: loops.Table((_group(),), 3, np.array([0, 3]), _ONE, 0.01, 1e9),
        "blocks: expected to start at 0 and ascend below 3",
    ),
    "table: classes": (
        lambda loops: loops.Table((_group(),), 3, _ONE, np.array([0, 1]), 0.01, 1e9),
        "classes: expected 1 to 1, got 2",
    ),
    "compared: measure": (
        lambda loops: loops.Table((_group(),), 3, _ONE, _ONE, 0.01, 1e9).compared(np.zeros(3), np.zeros(1)),
        "measure: expected 4, got 3",
    ),
    "compared: logs": (
        lambda loops: loops.Table((_group(),), 3, _ONE, _ONE, 0.01, 1e9).compared(np.zeros(4), np.zeros(2)),
        "logs: expected 1, got 2",
    ),
    "squares": (
        lambda loops: loops.Table((_group(),), 3, _ONE, _ONE, 0.01, 1e9).squares(np.zeros(4), np.zeros((1, 2), _F)),
        "squares: expected 3, got 2",
    ),
    "look: outside": (
        lambda loops: loops.Look(np.zeros((3, 2), _H), np.zeros(2, _F), np.zeros(3, _F), _ONE),
        "outside: expected 3, got 2",
    ),
    "look: axis": (
        lambda loops: loops.Look(np.zeros((3, 2), _H), np.zeros(3, _F), np.zeros(3, _F), _ONE).products(
            np.zeros(3, _F), np.zeros(3, _F), np.zeros(1, np.intp)
        ),
        "axis: expected 2, got 3",
    ),
    "look: room": (
        lambda loops: loops.Look(np.zeros((3, 2), _H), np.zeros(3, _F), np.zeros(3, _F), _ONE).listed(
            np.zeros(3, _F), np.zeros(1, _F), 0.1, np.zeros(2, np.intp)
        ),
        "listed: expected 3, got 2",
    ),
    "look: one memory for both": (
        lambda loops: loops.Look(np.zeros((3, 2), _H), np.zeros(3, _F), np.zeros(3, _F), _ONE).products(
            np.zeros(2, _F), _INDICES[:2].view(_F)[:3], _INDICES[:1]
        ),
        "products: expected memory that is in no other array",
    ),
    "distances: over the pairs": (
        lambda loops: loops.measure_distances(
            np.ones((1, 31, 3)), _INDICES[:40].reshape(20, 2), _INDICES[20:40].view(np.float64).reshape(1, 20)
        ),
        "rows: expected memory that is in no other array",
    ),
    "products: over the indices": (
        lambda loops: loops.add_products(np.ones((3, 2), _F), np.ones(2, _F), _INDICES[:40], _INDICES[20:40].view(_F)),
        "sums: expected memory that is in no other array",
    ),
    "products: indices": (
        lambda loops: loops.add_products(np.zeros((3, 2), _F), np.zeros(2, _F), np.array([0, 3]), np.zeros(2, _F)),
        "listed: expected indices of 3 rows",
    ),
    "products: negative": (
        lambda loops: loops.add_products(np.zeros((3, 2), _F), np.zeros(2, _F), np.array([-1]), np.zeros(1, _F)),
        "listed: expected indices of 3 rows",
    ),
}


@pytest.mark.parametrize("name", _REFUSED)
def test_arrays_that_do_not_fit_are_refused(loops: compiled.Loops, name: str) -> None:
    """An array of another shape or type raises ValueError, saying which, what was expected and what was got."""
    call, told = _REFUSED[name]
    with pytest.raises(ValueError, match=told):
        call(loops)


@pytest.mark.parametrize(
    "function",
    [
        *("measure_distances", "follow", "read_spread", "read_shape", "turn_shape", "add_products"),
        *("add_frames", "times_centred", "orthonormal"),
    ],
)
def test_too_few_arguments_are_refused(loops: compiled.Loops, function: str) -> None:
    """A call without its arrays raises TypeError."""
    with pytest.raises(TypeError, match=r"expected \d arguments, got 1"):
        getattr(loops, function)(np.zeros(3))


@pytest.mark.parametrize("group", [[], ([], 0, 0), (([],), 0, 0)])
def test_a_table_is_of_tuples(loops: compiled.Loops, group: object) -> None:
    """Lists in place of groups and parts raise TypeError."""
    with pytest.raises(TypeError, match="tuple"):
        loops.Table(cast("Any", (group,)), 3, _ONE, _ONE, 0.01, 1e9)


def test_of_two_numbers_that_are_none_the_first_is_told(loops: compiled.Loops) -> None:
    """What is no number raises TypeError before the next, which may be a fraction, is asked for."""
    with pytest.raises(TypeError, match="must be real number, not str"):
        loops.read_spread(np.ones((3, 5)), cast("Any", "2"), np.ones(5), cast("Any", Fraction(1, 2)), 0.5, np.zeros(5))


def test_what_must_be_written_to_may_not_be_read_only(loops: compiled.Loops) -> None:
    """Rows that may not be written to are refused before anything is written."""
    rows = np.zeros((1, 465))
    rows.flags.writeable = False
    with pytest.raises(ValueError, match="read-only"):
        loops.measure_distances(np.ones((1, 31, 3)), PAIRS, rows)
