"""What fewer joints show of a library's windows, against the slow twin, and what it does for recognition."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import naive_live
import naive_windows
import numpy as np
import pytest
from synthetic import STICK, STICK_CLASSES, stick_clip

from library import MotionLibrary, windowtable
from library.comparison import Comparison
from library.distances import distance_rows
from library.fewerjoints import some_of, turned
from library.hdm05 import SKELETON
from library.measures import LEVEL_REMOVED, Kind, covariance_of, measured, shape_of
from library.recordings import read_recordings
from library.windowtable import NEAREST, RATES
from stream.feeds import builtin_preset
from stream.recognition import Outcome
from stream.windowmatcher import WindowMatcher

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from library.clip import Clip
    from library.measures import Measure
    from library.windowtable import WindowTable

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

#: Seconds between the windows that a library of several people keeps.
EVERY = 0.4
FEWER = ("root", "head", "left", "right", "foot")
PRESETS = ("kinectv2", "osceleton", "vrchat")


def _table(library: MotionLibrary) -> WindowTable:
    assert library.windows is not None
    return library.windows


def _clips(actors: tuple[str, ...]) -> list[Clip]:
    return [
        stick_clip(name, seed=10 * take + place, frames=200, actor=actor)
        for name in STICK_CLASSES
        for place, actor in enumerate(actors)
        for take in range(2)
    ]


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return Comparison.learned(_clips(("aa", "bb")))


@pytest.fixture(scope="module")
def anybody(comparison: Comparison) -> MotionLibrary:
    return MotionLibrary.of_clips(_clips(("aa", "bb")), comparison=comparison)


@pytest.fixture(scope="module")
def one_person(comparison: Comparison) -> MotionLibrary:
    return MotionLibrary.of_clips(_clips(("aa",)), comparison=comparison)


def _measured(clip: Clip, end: int, comparison: Comparison, measures: tuple[Measure, ...]) -> dict[Measure, np.ndarray]:
    rows = distance_rows(clip.positions, clip.skeleton)
    return {
        each: measured(rows, clip.frame_rate, np.array([end]), each, body=comparison.body, basis=comparison.basis)[0]
        for each in measures
    }


# --- what is shown -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", PRESETS)
def test_spreads_shown_are_those_of_the_measures_they_stand_for(preset: str) -> None:
    """A vector seen through fewer distances is what would be estimated from the measure that it stands for."""
    library = MotionLibrary.builtin()
    whole, fewer = _table(library), library.restricted_to(builtin_preset(preset).joints)
    shown = _table(fewer).shown
    assert shown is not None
    ((measure, weight),) = whole.groups[0]
    assert (measure.kind, weight) == (Kind.SPREAD, 1.0)
    metric = whole.comparison.metrics[measure]
    for window in range(0, len(whole), 211):
        expected = naive_windows.vector_shown(
            whole.vectors[0][window].astype(np.float64),
            origin=metric.origin.astype(np.float64),
            axes=metric.axes.astype(np.float64),
            together=metric.together.astype(np.float64),
            spare=metric.spare.astype(np.float64),
            seen=library.skeleton.places_of(fewer.skeleton).tolist(),
            level_removed=LEVEL_REMOVED,
        )
        np.testing.assert_allclose(shown.vectors[0][window], expected, atol=2e-3)


@pytest.mark.parametrize("preset", PRESETS)
def test_shapes_shown_are_those_in_the_directions_shown(preset: str) -> None:
    """Windows' shapes are looked at along the directions shown; what their own axes keep of that is at most all."""
    whole = _table(MotionLibrary.builtin())
    table = _table(MotionLibrary.builtin().restricted_to(builtin_preset(preset).joints))
    assert table.shown is not None
    assert table.directions_shown is not None
    for place, ((measure, _),) in list(enumerate(whole.groups))[1:]:
        metric, cut = whole.comparison.metrics[measure], table.shown.comparison.metrics[measure]
        for window in range(0, len(whole), 211):
            scaled = whole.vectors[place][window].astype(np.float64) / metric.outside
            shape = metric.origin + metric.axes.astype(np.float64) @ scaled
            expected = naive_windows.shape_shown(shape.tolist(), table.directions_shown)
            vector = (np.array(expected) - cut.origin) @ cut.axes
            np.testing.assert_allclose(table.shown.vectors[place][window], vector, atol=5e-3)
            assert vector @ vector <= cut.outside * np.sum((expected - cut.origin) ** 2) * 1.01


@pytest.mark.parametrize("preset", PRESETS)
def test_directions_shown_are_those_that_the_course_is_found_in(preset: str) -> None:
    """Directions are orthonormal, as many as show clearly; no course found has a part across them."""
    library = MotionLibrary.builtin()
    fewer = library.restricted_to(builtin_preset(preset).joints)
    directions, basis = _table(fewer).directions_shown, _table(library).comparison.basis
    assert directions is not None
    np.testing.assert_allclose(directions.T @ directions, np.eye(directions.shape[1]), atol=1e-6)
    pairs = library.skeleton.places_of(fewer.skeleton).tolist()
    rows = np.random.default_rng(3).normal(size=(40, len(pairs)))
    courses = np.array([naive_windows.course_seen(row, basis.directions, basis.weights, pairs, 0.2) for row in rows])
    assert np.linalg.matrix_rank(courses, tol=1e-6 * np.abs(courses).max()) == directions.shape[1]
    np.testing.assert_allclose(courses @ directions @ directions.T, courses, atol=1e-5 * np.abs(courses).max())


def test_a_shape_comes_from_the_covariance_it_is_of(some_clips: tuple[Clip, ...]) -> None:
    """What a shape is made of comes back from it, trace 1 and a thousandth in each direction; turned, its own shape."""
    basis = _table(MotionLibrary.builtin()).comparison.basis
    rows = [distance_rows(clip.positions, clip.skeleton) @ basis.directions for clip in some_clips[:4]]
    covariances = np.array([np.cov(each.T) for each in rows])
    expected = [each / np.trace(each) + 0.001 * np.eye(len(each)) for each in covariances]
    shapes = shape_of(covariances)
    np.testing.assert_allclose(covariance_of(shapes), expected, atol=1e-12)
    directions = np.linalg.qr(np.random.default_rng(4).normal(size=(len(expected[0]), 7)))[0]
    for shape, seen in zip(shapes, turned(shapes, directions), strict=True):
        np.testing.assert_allclose(seen, naive_windows.shape_shown(shape.tolist(), directions), atol=1e-9)


# --- how it is compared ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["anybody", "one_person", "builtin"])
def test_a_window_is_named_and_known_as_by_the_twin(name: str, request: pytest.FixtureRequest) -> None:
    """Named by estimates, shapes by what is left of them too, and known by what is shown, window by window."""
    if name == "builtin":
        library = MotionLibrary.builtin().restricted_to(builtin_preset("vrchat").joints)
        clips = [clip.restricted_to(library.skeleton.joints) for clip in request.getfixturevalue("some_clips")[:2]]
    else:
        library = request.getfixturevalue(name).restricted_to(FEWER)
        clips = [stick_clip("jump", seed=70, frames=130).restricted_to(FEWER)]
    table = _table(library)
    shown, directions = table.shown, table.directions_shown
    assert shown is not None
    assert directions is not None
    for clip in clips:
        asked = _measured(clip, clip.frames, table.comparison, table.measures)
        cut = {
            measure: np.array(naive_windows.shape_shown(each.tolist(), directions))
            if measure.kind is Kind.SHAPE
            else each
            for measure, each in asked.items()
        }
        expected = naive_windows.named_and_known(
            *_placed(asked, table),
            table.vectors,
            **dict(zip(("cut", "cut_outside"), _placed(cut, shown), strict=True)),
            cut_vectors=shown.vectors,
            shapes=[group[0][0].kind is Kind.SHAPE for group in table.groups],
            told=directions.shape[1] / directions.shape[0],
            classes=table.classes[table.motions].tolist(),
            actors=table.actors[table.motions].tolist(),
            floor=NEAREST,
        )
        np.testing.assert_allclose(table.compared(asked), expected, atol=2e-3)
        assert np.array_equal(table.log_distances(asked), table.compared(asked)[0])


def _placed(asked: dict[Measure, np.ndarray], table: WindowTable) -> tuple[list[list[float]], list[float]]:
    """Put a window's measures along the axes: for each group its vector, and what lies off them, squared."""
    vectors, outside = [], []
    for group in table.groups:
        vector, off = list[float](), 0.0
        for measure, weight in group:
            metric = table.comparison.metrics[measure]
            own = (asked[measure] - metric.origin) @ metric.axes
            vector += (math.sqrt(weight) * own).tolist()
            lies = metric.outside * float(np.sum((asked[measure] - metric.origin) ** 2)) - float(own @ own)
            off += weight * max(lies, 0.0) if metric.outside else 0.0
        vectors.append(vector)
        outside.append(off)
    return vectors, outside


def test_all_joints_are_named_and_known_by_the_same(anybody: MotionLibrary) -> None:
    """A table that was not restricted compares once."""
    table = _table(anybody)
    asked = _measured(stick_clip("wave", seed=90, frames=150), 150, table.comparison, table.measures)
    assert table.compared(asked).shape == (1, len(anybody.classes))
    assert table.known_by is table


# --- thresholds --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["anybody", "one_person"])
def test_thresholds_are_set_by_what_is_shown(name: str, request: pytest.FixtureRequest) -> None:
    """They are those of any library, of the windows shown, and further by the share of joints that are missing."""
    library: MotionLibrary = request.getfixturevalue(name)
    library = replace(library, windows=replace(_table(library), further=0.3))
    table = _table(library.restricted_to(FEWER))
    expected = naive_windows.thresholds(
        table.known_by.vectors,
        table.classes[table.motions].tolist(),
        table.actors[table.motions].tolist(),
        RATES,
        floor=NEAREST,
    )
    missing = (len(STICK.joints) - len(FEWER)) / len(STICK.joints)
    np.testing.assert_allclose(table.known_by.thresholds, np.array(expected) + 0.3 * missing, atol=2e-3)
    assert table.threshold_at(RATES[3]) == pytest.approx(float(table.known_by.thresholds[3]))


def test_how_much_further_is_measured(hdm05_clips: tuple[Clip, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """With sets of fewer joints, thresholds as set by windows measured so are further: per share of joints missing."""
    sets = some_of(len(SKELETON.joints))[::3]
    monkeypatch.setattr(windowtable, "some_of", lambda _: sets)
    chosen = {(clip.class_name, clip.actor): clip for clip in hdm05_clips}
    names = sorted({class_name for class_name, _ in chosen})[:4]
    clips = [clip for (class_name, _), clip in sorted(chosen.items()) if class_name in names]
    library = MotionLibrary.of_clips(clips, comparison=_table(MotionLibrary.builtin()).comparison)
    whole = _table(library)
    classes, actors = whole.classes[whole.motions].tolist(), whole.actors[whole.motions].tolist()
    further = []
    for joints in sets:
        kept = [SKELETON.joints[joint] for joint in joints]
        shown = _table(replace(library, windows=replace(whole, further=0.0)).restricted_to(kept)).known_by
        vectors, outside = [], []
        for window, motion in enumerate(whole.motions.tolist()):
            clip = clips[motion].restricted_to(kept)
            first = min(120, clip.frames - 3)
            end = first + round(EVERY * 120) * int((whole.motions[:window] == motion).sum())
            placed = _placed(_measured(clip, end, shown.comparison, shown.measures), shown)
            vectors.append(placed[0])
            outside.append(placed[1])
        asked = [np.array(each) for each in zip(*vectors, strict=True)]
        ways = {"really": (asked, outside), "shown": (shown.vectors, np.zeros((len(whole), len(whole.groups))))}
        found = {
            name: naive_windows.thresholds(
                shown.vectors, classes, actors, RATES, floor=NEAREST, asked=vectors, outside=outside
            )
            for name, (vectors, outside) in ways.items()
        }
        missing = 1 - len(joints) / len(SKELETON.joints)
        further.append(float(np.mean(np.subtract(found["really"], found["shown"]))) / missing)
    assert np.mean(further) > 0.05
    assert whole.further == pytest.approx(np.mean(further), abs=5e-3)


def test_the_built_in_library_has_measured_it() -> None:
    """Real windows are further; of a library of one class, or one restricted, it is not asked."""
    assert 0.02 < _table(MotionLibrary.builtin()).further < 0.5
    alone = [clip for clip in _clips(("aa", "bb")) if clip.class_name == "bow"]
    assert _table(MotionLibrary.of_clips(alone, comparison=Comparison.learned(_clips(("aa", "bb"))))).further == 0.0


@pytest.mark.parametrize(("joints", "sets"), [(31, 8), (6, 5), (5, 4), (3, 0), (2, 0)])
def test_a_library_asks_itself_with_each_joint_as_often(joints: int, sets: int) -> None:
    """Sets hold three joints at least, never all; of a large body each joint is as often in them as any other."""
    chosen = some_of(joints)
    assert len(chosen) == sets
    assert all(3 <= len(set(each)) == len(each) < joints and each == tuple(sorted(each)) for each in chosen)
    if joints > 8:
        assert {sum(joint in each for each in chosen) for joint in range(joints)} == {4}


# --- recognition -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", ["osceleton", "vrchat"])
def test_the_matcher_names_by_one_and_judges_by_the_other(preset: str, cmu_folder: Path) -> None:
    """At every hop scores rank as motions are named, and the guess's score says how near it is to being known."""
    library = MotionLibrary.builtin().restricted_to(builtin_preset(preset).joints)
    table = _table(library)
    (take,) = read_recordings([cmu_folder / "13_29.amc"])
    take = take.restricted_to(library.skeleton.joints)
    rows, times = distance_rows(take.positions[::4], take.skeleton)[:600], take.times[::4][:600]
    compared: list[NDArray[np.float64]] = []
    matcher = WindowMatcher(_Listening(table, compared), stillness=0.0, sensitivity=0.2)  # type: ignore[arg-type]
    hops = []
    for time, row in zip(times.tolist(), rows, strict=True):
        matcher.push([time], row[None])
        if matcher.ready:
            hops.append((time, matcher.read()))
    asked = [time for time, _ in hops]
    averaged = np.array(
        [
            [
                [naive_live.averaged(asked[: k + 1], each[: k + 1], naive_live.COMPARED_OVER) for each in one.T]
                for one in np.swapaxes(np.array(compared), 0, 1)
            ]
            for k in range(len(hops))
        ]
    )
    threshold = table.threshold_at(0.2)
    guesses = [each.guess for each in naive_live.readings(asked, averaged[:, 0], threshold)]
    known_before = False
    for k, (_, reading) in enumerate(hops):
        named, known = averaged[k]
        assert reading.best == guesses[k]
        np.testing.assert_allclose(np.log(1 / reading.scores - 1), named - named[guesses[k]] + known[guesses[k]])
        judged = naive_live.averaged(asked[: k + 1], averaged[: k + 1, 1, guesses[k]], naive_live.KNOWN_OVER)
        beyond = judged - threshold <= (naive_live.HELD if known_before else 0.0)
        known_before = bool(beyond or known[guesses[k]] <= threshold - naive_live.CLEAR)
        assert reading.outcome is (Outcome.NAMED if known_before else Outcome.UNKNOWN)
    assert {reading.outcome for _, reading in hops} == {Outcome.NAMED, Outcome.UNKNOWN}


class _Listening:
    """A table that keeps what it answered."""

    def __init__(self, table: WindowTable, heard: list[NDArray[np.float64]]) -> None:
        self._table, self._heard = table, heard

    def __getattr__(self, name: str) -> object:
        return getattr(self._table, name)

    def compared(self, measures: dict[Measure, NDArray[np.float64]]) -> NDArray[np.float64]:
        self._heard.append(self._table.compared(measures))
        return self._heard[-1]
