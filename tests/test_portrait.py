"""Portraits: what a library keeps of a class's looks, against loops; kept, merged, refused."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import naive
import naive_live
import naive_portrait
import numpy as np
import pytest
from naive_live import NaiveBody, NaiveMetric
from synthetic import STICK, STICK_CLASSES, stick_clip

from library import libraryfile
from library import portrait as portrait_module
from library.comparison import Comparison
from library.distances import distance_rows
from library.libraryfile import LibraryFileError
from library.motionlibrary import MotionLibrary
from library.portrait import AXES, Portrait, portraits_of
from library.windowtable import WindowTable

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from library.clip import Clip

PARTS = ("mean", "axes", "harmonics", "phases")
PAIRS = naive.pairs(6)


def _clips(class_names: Sequence[str] = STICK_CLASSES, *, frames: int = 300) -> list[Clip]:
    """Make two takes of each class by each of two people, long enough for several stretches of a second."""
    return [
        stick_clip(name, seed=10 * take + place, frames=frames, actor=actor)
        for name in class_names
        for place, actor in enumerate(("aa", "bb"))
        for take in range(2)
    ]


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return Comparison.learned(_clips())


@pytest.fixture(scope="module")
def library(comparison: Comparison) -> MotionLibrary:
    return MotionLibrary.of_clips(_clips(), comparison=comparison).portrayed(_clips())


def _of_class(library: MotionLibrary, class_name: str) -> Portrait:
    return library.portraits[library.classes.index(class_name)]


def _is_same(first: Portrait, second: Portrait) -> bool:
    return all(np.array_equal(getattr(first, name), getattr(second, name)) for name in PARTS)


def _twin_rows(rows: np.ndarray, cycles: np.ndarray) -> np.ndarray:
    moving = naive_portrait.swings(rows, axes=AXES, harmonics=3)
    return naive_portrait.swinging(rows.mean(axis=0).tolist(), moving, cycles.tolist())


# --- against the twin --------------------------------------------------------------------------------------------


def test_a_real_stretch_moves_as_the_loops_say(some_clips: tuple[Clip, ...]) -> None:
    """A portrait of a second of real motion moves, through two cycles and a half, as the twin's, rounding aside."""
    cycles = np.linspace(-0.5, 2.0, 23)
    for clip in some_clips[::2]:
        rows = distance_rows(clip.positions[:120], clip.skeleton)[:, ::5]
        portrayed = Portrait.of_rows(rows).rows(cycles)
        np.testing.assert_allclose(portrayed, _twin_rows(rows, cycles), atol=5e-3)
        assert np.abs(portrayed - rows.mean(axis=0)).max() > 0.03


@pytest.mark.parametrize("frames", [2, 3, 5, 6, 30])
def test_the_shortest_stretches_have_portraits(frames: int) -> None:
    """From two frames on there is a portrait, the axes that so few frames do not have at 0."""
    rows = np.random.default_rng(frames).uniform(0.5, 1.0, size=(frames, 15))
    portrait = Portrait.of_rows(rows)
    moving = np.linalg.norm(portrait.axes, axis=1)
    assert (moving[: min(frames - 1, AXES)] > 0.01).all()
    assert (moving[frames - 1 :] < 1e-6).all()
    assert set(portrait.harmonics.tolist()) <= {1.0, 2.0, 3.0}
    if frames > AXES:
        cycles = np.linspace(0.0, 1.0, 9)
        np.testing.assert_allclose(portrait.rows(cycles), _twin_rows(rows, cycles), atol=5e-3)


@pytest.mark.parametrize("harmonic", [1, 2, 3])
def test_a_swing_is_portrayed_as_itself(harmonic: int) -> None:
    """Distances that all swing as one sine, once to three times a second, are portrayed as they are, in their phase."""
    generator = np.random.default_rng(harmonic)
    mean, axis = generator.uniform(1.0, 2.0, 15), generator.uniform(-0.3, 0.3, 15)
    cycles = np.arange(120) / 120
    rows = mean + np.outer(np.sin(2 * np.pi * harmonic * cycles + generator.uniform(0, 6)), axis)
    portrait = Portrait.of_rows(rows)
    assert portrait.harmonics[0] == harmonic
    np.testing.assert_allclose(portrait.rows(cycles), rows, atol=5e-3)
    np.testing.assert_allclose(portrait.rows(cycles + 3), portrait.rows(cycles), atol=1e-9)


def test_distances_are_never_below_zero() -> None:
    """A distance whose swing goes beyond zero stays there meanwhile."""
    cycles = np.arange(60) / 60
    still = np.zeros((AXES, 2), dtype=np.float32)
    still[0] = [0.5, 0.1]
    mean, ones = np.array([0.2, 1.0], dtype=np.float32), np.ones(AXES, dtype=np.float32)
    rows = Portrait(mean, still, ones, 0 * ones).rows(cycles)
    np.testing.assert_allclose(rows[:, 0], np.maximum(0.2 + 0.5 * np.cos(2 * np.pi * cycles), 0.0), atol=1e-6)
    assert (rows[:, 0] == 0.0).any()
    assert rows[:, 1].min() > 0.85


def _unlike(rows: np.ndarray, index: int, table: WindowTable) -> float:
    """Let the twin say how far a moving portrait is from its class, and how little farther from the nearest other."""
    cycles = np.arange(150) / 60
    in_space = naive_portrait.distances_in_space(_twin_rows(rows, cycles), 6)
    body, metrics = NaiveBody(PAIRS, STICK.parents), table.comparison.metrics
    found = []
    for end in (120, 130, 140, 150):
        measures = []
        for group in table.groups:
            measures.append([])
            for measure, weight in group:
                own = metrics[measure]
                metric = NaiveMetric(
                    str(measure.kind),
                    measure.seconds,
                    own.origin.astype(float),
                    own.axes.astype(float),
                    own.outside,
                    weight,
                )
                window = in_space[max(end - round(measure.seconds * 60), 0) : end]
                measures[-1].append((metric, body.measured(metric.kind, window, table.comparison.basis.directions)))
        distances = naive_live.log_distances(
            measures,
            [each.astype(float) for each in table.vectors],
            table.classes[table.motions],
            table.actors[table.motions],
        )
        found.append(2 * distances[index] - min(distances[:index] + distances[index + 1 :]))
    return max(found)


def test_a_class_is_portrayed_by_its_clearest_stretch(library: MotionLibrary) -> None:
    """Of all seconds of a class, half a second apart, its portrait is of the one that moves most like it alone."""
    assert library.windows is not None
    cycles = np.arange(120) / 60
    for index, class_name in enumerate(STICK_CLASSES):
        rows = [distance_rows(clip.positions, STICK) for clip in _clips([class_name])]
        stretches = [each[begin : begin + 120] for each in rows for begin in (0, 60, 120, 180)]
        unlike = [_unlike(stretch, index, library.windows) for stretch in stretches]
        portrayed = _of_class(library, class_name).rows(cycles)
        far = [np.abs(portrayed - _twin_rows(stretch, cycles)).max() for stretch in stretches]
        chosen = int(np.argmin(far))
        assert far[chosen] < 5e-3
        # The product's distances are of half and single precision.
        assert unlike[chosen] <= min(unlike) + 0.05
        assert max(unlike) > min(unlike) + 0.1


def test_a_portrait_in_which_a_joint_flips_comes_last(library: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """When the clearest stretch's joints jump in space, another is shown; when all do, the clearest."""
    assert library.windows is not None
    clips = _clips(STICK_CLASSES)
    clearest = library.portraits
    jumping = {each.mean.tobytes() for each in clearest}
    monkeypatch.setattr(portrait_module, "_fastest", lambda each, _: 20.0 if each.mean.tobytes() in jumping else 1.0)
    for one, other in zip(clearest, portraits_of(clips, library.windows), strict=True):
        assert not _is_same(one, other)
    monkeypatch.setattr(portrait_module, "_fastest", lambda *_: 20.0)
    for one, other in zip(clearest, portraits_of(clips, library.windows), strict=True):
        assert _is_same(one, other)


def test_the_clearest_is_near_its_class_and_far_from_others(
    comparison: Comparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By hand: chosen is not the farthest from others, nor the nearest for itself, nor one that is good at times."""
    clips = [stick_clip(name, seed=3, frames=300, actor=actor) for name, actor in (("bow", "aa"), ("wave", "bb"))]
    table = MotionLibrary.of_clips(clips, comparison=comparison).windows
    assert table is not None
    # Of each stretch the distance to its own class and to the other, at four moments.
    apart, clearest, nearest = [(-3.0, 0.0)] * 4, [(-4.0, -1.5)] * 4, [(-4.2, -3.0)] * 4
    at_times = [(-6.0, 0.0), (-6.0, 0.0), (-2.5, 0.0), (-6.0, 0.0)]
    told = [*apart, *clearest, *nearest, *at_times]
    distances = iter([np.array(each) for each in told] + [np.array(each[::-1]) for each in told])
    monkeypatch.setattr(WindowTable, "log_distances", lambda *_: next(distances))
    for clip, portrait in zip(clips, portraits_of(clips, table), strict=True):
        expected = Portrait.of_rows(distance_rows(clip.positions, STICK)[60:180])
        assert _is_same(portrait, expected)
    assert next(distances, None) is None


def test_clips_shorter_than_a_second_are_portrayed_whole(comparison: Comparison) -> None:
    """Of a class whose clips are half a second long each clip is one stretch."""
    clips = _clips(frames=60)
    table = MotionLibrary.of_clips(clips, comparison=comparison).windows
    assert table is not None
    cycles = np.linspace(0, 1, 20)
    for class_name, portrait in zip(STICK_CLASSES, portraits_of(clips, table), strict=True):
        rows = [distance_rows(clip.positions, STICK) for clip in clips if clip.class_name == class_name]
        far = [np.abs(portrait.rows(cycles) - _twin_rows(each, cycles)).max() for each in rows]
        assert min(far) < 5e-3


def test_of_many_takes_two_dozen_stretches_are_tried(comparison: Comparison, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many recordings a class has, at most 24 of their stretches are portrayed and compared."""
    clips = [stick_clip("wave", seed=seed, frames=200, actor="ab"[seed % 2]) for seed in range(30)]
    clips.sort(key=lambda clip: clip.actor)
    table = MotionLibrary.of_clips(clips, comparison=comparison).windows
    assert table is not None
    portrayed = list[int]()
    of_rows = Portrait.of_rows

    def counted(rows: np.ndarray) -> Portrait:
        portrayed.append(len(rows))
        return of_rows(rows)

    monkeypatch.setattr(Portrait, "of_rows", counted)
    assert len(portraits_of(clips, table)) == 1
    assert 12 < len(portrayed) <= 24
    assert set(portrayed) == {120}


# --- in a library ------------------------------------------------------------------------------------------------


def test_a_portrait_is_of_its_own_class(library: MotionLibrary) -> None:
    """A recogniser's distances of each class's moving portrait are least to its own class."""
    assert len(library.portraits) == len(library.classes) == 3
    for index, class_name in enumerate(library.classes):
        assert library.windows is not None
        assert _unlike(_of_class(library, class_name).rows(np.arange(120) / 120), index, library.windows) < 0


def test_without_windows_there_are_no_portraits() -> None:
    """A library of whole motions has no way to say which stretch is clearest, and stays as it is."""
    clips = _clips()
    plain = MotionLibrary.of_clips(clips)
    assert plain.portraits == plain.portrayed(clips).portraits == ()


def test_the_built_in_library_has_a_portrait_of_every_class() -> None:
    """Each of the eleven classes has one, of all 465 pairs, and no two are alike."""
    builtin = MotionLibrary.builtin()
    assert len(builtin.portraits) == len(builtin.classes) == 11
    assert {portrait.mean.shape for portrait in builtin.portraits} == {(465,)}
    assert len({portrait.mean.tobytes() for portrait in builtin.portraits}) == 11


def test_the_built_in_portraits_are_those_of_the_clips(
    hdm05_clips: tuple[Clip, ...], hdm05_library: MotionLibrary
) -> None:
    """Made anew from the 288 clips the portraits are, in rounding, those in the package."""
    again = hdm05_library.portrayed(hdm05_clips)
    cycles = np.linspace(0, 1, 30)
    for built, kept in zip(again.portraits, MotionLibrary.builtin().portraits, strict=True):
        np.testing.assert_allclose(built.rows(cycles), kept.rows(cycles), atol=5e-3)


def test_fewer_pairs_show_the_same_portrait(library: MotionLibrary) -> None:
    """Restricted to some pairs, in any order, a portrait moves in them as the whole one does."""
    pairs, cycles = np.array([9, 0, 4, 13]), np.linspace(-0.5, 2.0, 40)
    for portrait in library.portraits:
        fewer = portrait.restricted_to(pairs)
        assert (fewer.mean.shape, fewer.axes.shape) == ((4,), (AXES, 4))
        np.testing.assert_allclose(fewer.rows(cycles), portrait.rows(cycles)[:, pairs], atol=1e-9)


def test_a_library_of_fewer_joints_is_portrayed_by_their_pairs() -> None:
    """The built-in library restricted to a dozen joints has all portraits, each of the distances between those."""
    builtin = MotionLibrary.builtin()
    restricted = builtin.restricted_to(builtin.skeleton.joints[::3])
    kept = set(restricted.skeleton.joints)
    names = builtin.skeleton.joints
    pairs = [k for k, (a, b) in enumerate(builtin.skeleton.pairs) if names[a] in kept and names[b] in kept]
    assert len(restricted.portraits) == 11
    for fewer, portrait in zip(restricted.portraits, builtin.portraits, strict=True):
        assert _is_same(fewer, portrait.restricted_to(np.array(pairs)))


# --- kept --------------------------------------------------------------------------------------------------------


def test_portraits_come_back_bit_for_bit(library: MotionLibrary, tmp_path: Path) -> None:
    """Saved and loaded, and once more, every number of every portrait is what it was."""
    library.save(tmp_path / "first.npz")
    once = MotionLibrary.load(tmp_path / "first.npz")
    once.save(tmp_path / "second.npz")
    for loaded in (once, MotionLibrary.load(tmp_path / "second.npz")):
        assert len(loaded.portraits) == 3
        assert all(map(_is_same, loaded.portraits, library.portraits))


def test_portraits_take_half_precision(library: MotionLibrary, tmp_path: Path) -> None:
    """A file holds four arrays of portraits, all float16; one without portraits holds none."""
    names = {f"portrait_{name}" for name in PARTS}
    library.save(tmp_path / "with.npz")
    _, arrays = libraryfile.read(tmp_path / "with.npz")
    assert {name: arrays[name].dtype for name in arrays if name.startswith("portrait")} == dict.fromkeys(names, "<f2")
    dataclasses.replace(library, portraits=()).save(tmp_path / "without.npz")
    _, arrays = libraryfile.read(tmp_path / "without.npz")
    assert not names & set(arrays)
    assert MotionLibrary.load(tmp_path / "without.npz").portraits == ()


def _spoilt(array: np.ndarray, number: float) -> np.ndarray:
    spoilt = array.copy()
    spoilt.flat[-1] = number
    return spoilt


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda _: None, id="missing"),
        pytest.param(lambda array: array[:-1], id="a class missing"),
        pytest.param(lambda array: array[:0], id="empty"),
        pytest.param(lambda array: array[..., None], id="deeper"),
        pytest.param(lambda array: array[:, 1:], id="narrower"),
        pytest.param(lambda array: _spoilt(array, np.nan), id="NaN"),
        pytest.param(lambda array: _spoilt(array, np.inf), id="infinite"),
    ],
)
@pytest.mark.parametrize("name", PARTS)
def test_files_of_broken_portraits_are_refused(
    name: str, change: Callable[[np.ndarray], np.ndarray | None], library: MotionLibrary, tmp_path: Path
) -> None:
    """A file in which one array of the portraits is missing, of another shape or not finite is refused by name."""
    path = tmp_path / "library.npz"
    library.save(path)
    header, arrays = libraryfile.read(path)
    changed = change(arrays.pop(f"portrait_{name}"))
    if changed is not None:
        arrays[f"portrait_{name}"] = changed
    libraryfile.write(path, header, arrays)
    with pytest.raises(LibraryFileError, match=r"library\.npz: not a usable motion library \("):
        MotionLibrary.load(path)


# --- merged ------------------------------------------------------------------------------------------------------


def test_merged_libraries_keep_every_classs_portrait(library: MotionLibrary, comparison: Comparison) -> None:
    """Of a class both have the first library's portrait is kept; classes of one alone keep theirs, in their order."""
    clips = [clip.moved_to(clip.positions * 1.2) for clip in _clips(["bow", "wave"])]
    two = MotionLibrary.of_clips(clips, comparison=comparison).portrayed(clips)
    jumps = MotionLibrary.of_clips(_clips(["jump"]), comparison=comparison).portrayed(_clips(["jump"]))
    for first, second in ((library, two), (two, library), (jumps, two), (two, jumps)):
        merged = first.merged_with(second)
        assert merged.classes == STICK_CLASSES
        for class_name, portrait in zip(merged.classes, merged.portraits, strict=True):
            kept = first if class_name in first.classes else second
            assert _is_same(portrait, _of_class(kept, class_name))
    assert not _is_same(_of_class(two, "bow"), _of_class(library, "bow"))


def test_merged_with_a_library_without_there_are_none(library: MotionLibrary, comparison: Comparison) -> None:
    """When one of two libraries has no portraits some class could not be shown: the merged one has none."""
    without = MotionLibrary.of_clips(_clips(["bow"], frames=200), comparison=comparison)
    assert library.merged_with(without).portraits == without.merged_with(library).portraits == ()


# --- refused -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("part", "value", "message"),
    [
        pytest.param("axes", np.zeros((AXES, 14)), r"expected \(pairs,\), \(4, pairs\), .* got \[\(15,\), \(4, 14\)"),
        pytest.param("axes", np.zeros((AXES - 1, 15)), r"expected .* got \[\(15,\), \(3, 15\)"),
        pytest.param("mean", np.zeros((15, 1)), r"expected .* got \[\(15, 1\)"),
        pytest.param("harmonics", np.zeros(3), r"expected .* got .* \(3,\), \(4,\)\]"),
        pytest.param("phases", np.zeros(5), r"expected .* got .* \(4,\), \(5,\)\]"),
        *(
            pytest.param(part, _spoilt(np.zeros(shape), number), "expected finite numbers, got NaN or infinity")
            for part, shape in (("mean", 15), ("axes", (AXES, 15)), ("harmonics", AXES), ("phases", AXES))
            for number in (np.nan, np.inf)
        ),
    ],
)
def test_parts_that_do_not_fit_are_refused(part: str, value: np.ndarray, message: str) -> None:
    """Another shape of any part, or a number that is not finite, is refused, with the shapes."""
    parts: dict[str, Any] = dict(
        zip(PARTS, map(np.zeros, (15, (AXES, 15), AXES, AXES)), strict=True),
    )
    Portrait(**parts)
    with pytest.raises(ValueError, match=f"portrait: {message}"):
        Portrait(**{**parts, part: value.astype(np.float32)})


def test_portraits_of_another_library_are_refused(library: MotionLibrary) -> None:
    """A library takes one portrait for each class, of its own pairs, or none."""
    others = MotionLibrary.builtin().portraits[:3]
    for portraits in (library.portraits[:2], (*library.portraits, library.portraits[0]), others):
        with pytest.raises(ValueError, match="portraits: expected one of 15 pairs for each of 3 classes"):
            dataclasses.replace(library, portraits=portraits)
