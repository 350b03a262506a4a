"""Windows cut from motions: embedded, compared and thresholded as loops would, kept, merged and refused."""

from __future__ import annotations

import dataclasses
from collections import Counter
from typing import TYPE_CHECKING

import naive_windows
import numpy as np
import pytest
from synthetic import STICK, STICK_CLASSES, stick_clip, stick_clips

from library.comparison import FOR_ANYBODY, FOR_ONE_PERSON, MEASURES, Comparison
from library.distances import distance_rows
from library.measures import FEWEST_FRAMES, Basis, Body, Kind, Measure, measured
from library.metric import squared_distances
from library.motionlibrary import MotionLibrary
from library.skeleton import Skeleton, SkeletonMismatchError
from library.windowtable import NEAREST, RATES, WindowTable
from stream.feeds import builtin_preset

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from library.clip import Clip

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

#: What a window at no distance scores: logarithms begin here.
NO_DISTANCE = np.log(NEAREST)


def _long_clips(*, takes: int = 2, actors: Sequence[str] = ("aa", "bb"), frames: int = 200) -> list[Clip]:
    """Make takes of every class by people of different sizes, by class and actor, long enough for several windows."""
    generator = np.random.default_rng(12)
    sizes = {actor: generator.uniform(0.8, 1.2, (6, 1)) for actor in actors}
    clips = [
        stick_clip(name, seed=10 * take + place, frames=frames, actor=actor)
        for name in STICK_CLASSES
        for place, actor in enumerate(actors)
        for take in range(takes)
    ]
    return [clip.moved_to(clip.positions * sizes[clip.actor]) for clip in clips]


@pytest.fixture(scope="module")
def comparison(arithmetic: str) -> Comparison:  # noqa: ARG001 - rounded as the tests round
    return Comparison.learned(_long_clips())


@pytest.fixture(scope="module")
def anybody(comparison: Comparison) -> MotionLibrary:
    return MotionLibrary.of_clips(_long_clips(), comparison=comparison)


@pytest.fixture(scope="module")
def each_their_own(comparison: Comparison) -> MotionLibrary:
    """Build a library of two people's motions in which each class is performed by one of them alone."""
    return MotionLibrary.of_clips(_each_their_own(), comparison=comparison)


def _each_their_own() -> list[Clip]:
    return [clip for clip in _long_clips() if clip.actor == ("bb" if clip.class_name == "jump" else "aa")]


@pytest.fixture(scope="module")
def one_person(comparison: Comparison) -> MotionLibrary:
    return MotionLibrary.of_clips(_long_clips(actors=["aa"]), comparison=comparison)


def _table(library: MotionLibrary) -> WindowTable:
    assert library.windows is not None
    return library.windows


def _asking(clip: Clip, end: int, comparison: Comparison) -> dict[Measure, np.ndarray]:
    """Measure one window of a clip as a live one is measured."""
    rows, body = distance_rows(clip.positions, clip.skeleton), Body.of(clip.skeleton)
    return {
        measure: measured(rows, clip.frame_rate, np.array([end]), measure, body=body, basis=comparison.basis)[0]
        for measure in MEASURES
    }


def _ends(frames: int, frame_rate: float, *, several: bool) -> list[int]:
    """Count off where windows end: every .4 s from the first second on, or a thirtieth from a tenth on."""
    every, first = (frame_rate * 0.4, frame_rate) if several else (frame_rate / 30, frame_rate / 10)
    end, ends = max(8, min(round(first), frames - 3)), []
    while end <= frames:
        ends.append(end)
        end += max(1, round(every))
    return ends


def _assert_equal(first: WindowTable, second: WindowTable) -> None:
    assert first.comparison.is_same(second.comparison)
    assert first.groups == second.groups
    for name in ("motions", "classes", "actors", "thresholds"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name
    assert all(np.array_equal(mine, theirs) for mine, theirs in zip(first.vectors, second.vectors, strict=True))


# --- which windows, for whom -------------------------------------------------------------------------------------


def test_several_people_make_a_library_for_anybody(anybody: MotionLibrary, one_person: MotionLibrary) -> None:
    """Two people's clips are compared by what carries over, a single person's by what is their own."""
    assert _table(anybody).groups == FOR_ANYBODY
    assert _table(one_person).groups == FOR_ONE_PERSON
    assert {measure.kind for measure in _table(anybody).measures} == {Kind.SPREAD, Kind.SHAPE}
    assert {measure.kind for measure in _table(one_person).measures} == {Kind.SPREAD, Kind.POSTURE}


@pytest.mark.parametrize(("actor", "groups"), [("", FOR_ONE_PERSON), ("aa", FOR_ONE_PERSON), ("bb", FOR_ANYBODY)])
def test_clips_without_a_name_are_nobody_else(comparison: Comparison, actor: str, groups: object) -> None:
    """Clips whose actor nobody knows do not make a second person."""
    clips = [stick_clip("bow", actor="aa"), stick_clip("wave", actor=actor)]
    assert WindowTable.of_clips(clips, comparison).groups == groups


@pytest.mark.parametrize("frames", [8, 9, 11, 14, 119, 122, 123, 124, 200])
@pytest.mark.parametrize("frame_rate", [30.0, 100.0, 120.0])
@pytest.mark.parametrize("actors", [("aa",), ("aa", "bb")])
def test_windows_end_at_even_times(
    comparison: Comparison, frames: int, frame_rate: float, actors: tuple[str, ...]
) -> None:
    """Each motion has the windows counted off from its start, at least one from eight frames on."""
    clips = [
        dataclasses.replace(clip, frame_rate=frame_rate) for clip in _long_clips(takes=1, actors=actors, frames=frames)
    ]
    table = WindowTable.of_clips(clips, comparison)
    counts = Counter(table.motions.tolist())
    assert [counts[motion] for motion in range(len(clips))] == [
        len(_ends(frames, frame_rate, several=len(actors) > 1))
    ] * len(clips)
    assert len(table) == len(table.motions)


@pytest.mark.parametrize("actors", [("aa",), ("aa", "bb")])
def test_recordings_of_few_frames_per_second_have_windows(comparison: Comparison, actors: tuple[str, ...]) -> None:
    """At three frames per second, where a measure's seconds hold less than one frame, windows are made of two."""
    clips = [dataclasses.replace(clip, frame_rate=3.0) for clip in _long_clips(takes=1, actors=actors, frames=40)]
    table = WindowTable.of_clips(clips, comparison)
    assert len(table) == len(clips) * len(range(8, 41))
    assert np.isfinite(table.log_distances(_asking(clips[0], 20, comparison))).all()


@pytest.mark.parametrize("actors", [("aa",), ("aa", "bb")])
def test_windows_are_embedded_as_they_are_measured(comparison: Comparison, actors: tuple[str, ...]) -> None:
    """A window's vector is its measures' difference to the origin times the axes and the weight's root, rounded."""
    clips = _long_clips(takes=1, actors=actors)
    table = WindowTable.of_clips(clips, comparison)
    windows = [(clip, end) for clip in clips for end in _ends(clip.frames, 120.0, several=len(actors) > 1)]
    for group, vectors in zip(table.groups, table.vectors, strict=True):
        for (clip, end), vector in zip(windows, vectors, strict=True):
            asked = _asking(clip, end, comparison)
            expected = []
            for measure, weight in group:
                metric = comparison.metrics[measure]
                expected += list(np.sqrt(weight) * ((asked[measure] - metric.origin) @ metric.axes))
            np.testing.assert_allclose(vector, expected, rtol=2e-3, atol=2e-4)


def test_motions_too_short_for_a_window_have_none(comparison: Comparison) -> None:
    """A clip of seven frames has no window and is learned from without; a class of such clips alone is refused."""
    short = stick_clip("bow", seed=1, frames=FEWEST_FRAMES - 1)
    clips = [stick_clip("bow"), short, stick_clip("wave")]
    library = MotionLibrary.of_clips(clips, comparison=comparison)
    assert sorted(set(_table(library).motions.tolist())) == [0, 2]
    assert len(library) == 3
    assert Comparison.learned([*_long_clips(), short]).pairs == 15
    with pytest.raises(ValueError, match="expected windows of every class in order, of 8 frames at least"):
        MotionLibrary.of_clips([short, stick_clip("wave")], comparison=comparison)
    with pytest.raises(ValueError, match="expected windows of every class in order, of 8 frames at least"):
        MotionLibrary.of_clips([short], comparison=comparison)


# --- distances ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["anybody", "each_their_own", "one_person", "builtin"])
def test_distances_are_those_of_the_loops(name: str, request: pytest.FixtureRequest) -> None:
    """A class scores the log distance to the window nearest in all measures, mean over its two nearest people."""
    asking = [(stick_clip("jump", seed=70, frames=130), 130), (stick_clip("bow", seed=71), 20)]
    if name == "builtin":
        asking = [(clip, 60) for clip in request.getfixturevalue("some_clips")[:2]]
    table = _table(MotionLibrary.builtin() if name == "builtin" else request.getfixturevalue(name))
    of_window, whose = table.classes[table.motions].tolist(), table.actors[table.motions].tolist()
    for clip, end in asking:
        asked = _asking(clip, end, table.comparison)
        vectors, outside = [], []
        for group in table.groups:
            vector, off = [], 0.0
            for measure, weight in group:
                metric = table.comparison.metrics[measure]
                own = (asked[measure] - metric.origin) @ metric.axes
                vector += list(np.sqrt(weight) * own)
                whole = metric.outside * naive_windows.squared_distance(asked[measure], metric.origin.tolist())
                off += weight * max(whole - float(own @ own), 0.0) if metric.outside else 0.0
            vectors.append(vector)
            outside.append(off)
        expected = naive_windows.log_distances(vectors, outside, table.vectors, of_window, whose, floor=NEAREST)
        np.testing.assert_allclose(table.log_distances(asked), expected, atol=2e-3)


@pytest.mark.parametrize("name", ["builtin", "anybody", "one_person"])
def test_several_windows_are_compared_as_one_by_one(name: str, request: pytest.FixtureRequest) -> None:
    """Asked about several windows at once, also about some that are far off, it says of each what it says alone."""
    builtin = name == "builtin"
    table = _table(MotionLibrary.builtin() if builtin else request.getfixturevalue(name))
    clips = request.getfixturevalue("some_clips")[:5] if builtin else _long_clips()
    asked = [_asking(clip, 60, table.comparison) for clip in clips]
    for far in (1e6, 1e12):
        asked.append({measure: far * numbers for measure, numbers in asked[0].items()})
    for count in (1, 3, len(asked)):
        each = asked[-count:]
        found = table.log_distances({measure: np.array([one[measure] for one in each]) for measure in table.measures})
        assert found.shape == (count, len(np.unique(table.classes)))
        np.testing.assert_allclose(found, [table.log_distances(one) for one in each], atol=2e-3)


@pytest.mark.parametrize("name", ["each_their_own", "one_person"])
def test_a_librarys_own_window_is_at_no_distance(name: str, request: pytest.FixtureRequest) -> None:
    """A window of a class that one person performs lies at no distance from its class, and at some from every other."""
    library = request.getfixturevalue(name)
    several = name == "each_their_own"
    clips = _each_their_own() if several else _long_clips(actors=["aa"])
    for clip in clips:
        for end in _ends(clip.frames, 120.0, several=several):
            distances = _table(library).log_distances(_asking(clip, end, _table(library).comparison))
            own = library.classes.index(clip.class_name)
            assert distances[own] == pytest.approx(NO_DISTANCE, abs=0.05)
            assert np.delete(distances, own).min() > NO_DISTANCE + 1


def test_what_one_person_does_another_must_agree_to(anybody: MotionLibrary) -> None:
    """Where two perform a class, a window of one lies half way, in the logarithm, between none and the other's."""
    comparison = _table(anybody).comparison
    for clip in _long_clips(takes=1):
        (other,) = {"aa", "bb"} - {clip.actor}
        others = [each for each in _long_clips() if each.class_name != clip.class_name or each.actor == other]
        without = MotionLibrary.of_clips(others, comparison=comparison)
        assert _table(without).groups == FOR_ANYBODY
        own = anybody.classes.index(clip.class_name)
        asked = _asking(clip, _ends(clip.frames, 120.0, several=True)[-1], comparison)
        far = _table(without).log_distances(asked)[own]
        assert far > NO_DISTANCE + 0.5
        assert _table(anybody).log_distances(asked)[own] == pytest.approx((NO_DISTANCE + far) / 2, abs=0.05)


@pytest.mark.parametrize("times", [1e3, 1e6, 1e12])
def test_however_far_distances_are_numbers(anybody: MotionLibrary, times: float) -> None:
    """Measures beyond anything a body shows are far from every class, and not infinitely."""
    table = _table(anybody)
    asked = {measure: times * each for measure, each in _asking(_long_clips()[0], 150, table.comparison).items()}
    distances = table.log_distances(asked)
    assert np.isfinite(distances).all()
    assert distances.min() > 5


def test_real_windows_are_at_no_distance_from_themselves(hdm05_clips: tuple[Clip, ...]) -> None:
    """One person's real motions, compared as the built-in library compares, find themselves, and no other class."""
    clips = [clip for clip in hdm05_clips if clip.actor == "bk"][::4]
    comparison = _table(MotionLibrary.builtin()).comparison
    library = MotionLibrary.of_clips(clips, comparison=comparison)
    assert _table(library).groups == FOR_ONE_PERSON
    assert len(library.classes) == 11
    for clip in clips:
        end = _ends(clip.frames, 120.0, several=False)[-1]
        distances = _table(library).log_distances(_asking(clip, end, comparison))
        own = library.classes.index(clip.class_name)
        assert distances[own] == pytest.approx(NO_DISTANCE, abs=0.05)
        assert int(distances.argmin()) == own


def test_an_unknown_persons_windows_are_nearest_to_their_class(anybody: MotionLibrary) -> None:
    """Somebody of other proportions, larger and mirrored, doing a motion of the library's is nearest to its class."""
    for name in STICK_CLASSES:
        clip = stick_clip(name, seed=88, frames=150, actor="cc")
        sizes = np.random.default_rng(8).uniform(0.9, 1.1, (6, 1)) * [1.4, 1.4, -1.4]
        asked = _asking(clip.moved_to(clip.positions * sizes), 150, _table(anybody).comparison)
        assert anybody.classes[int(_table(anybody).log_distances(asked).argmin())] == name


# --- thresholds --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["anybody", "each_their_own", "one_person", "uneven"])
def test_thresholds_are_those_of_the_loops(name: str, comparison: Comparison, request: pytest.FixtureRequest) -> None:
    """Each class and whoever asks left out in turn, thresholds are the mean quantiles of the nearest that is found."""
    if name == "uneven":
        clips = [clip for clip in _long_clips() if clip.class_name != "jump" or clip.actor == "aa"]
        table = WindowTable.of_clips(clips, comparison)
    else:
        table = _table(request.getfixturevalue(name))
    expected = naive_windows.thresholds(
        table.vectors,
        table.classes[table.motions].tolist(),
        table.actors[table.motions].tolist(),
        RATES,
        floor=NEAREST,
    )
    assert table.thresholds.dtype == np.float32
    np.testing.assert_allclose(table.thresholds, expected, atol=2e-3)


@pytest.mark.parametrize("name", ["anybody", "one_person", "builtin"])
def test_thresholds_grow_with_the_rate(name: str, request: pytest.FixtureRequest) -> None:
    """The more false answers are allowed, the further a window may lie; beyond the rates kept nothing changes."""
    library = MotionLibrary.builtin() if name == "builtin" else request.getfixturevalue(name)
    table = _table(library)
    thresholds = np.array([table.threshold_at(rate) for rate in np.geomspace(1e-4, 1.0, 60)])
    assert np.isfinite(thresholds).all()
    assert (np.diff(thresholds) >= 0).all()
    assert thresholds[-1] > thresholds[0]
    for rate, kept in zip(RATES, table.thresholds.tolist(), strict=True):
        assert table.threshold_at(rate) == pytest.approx(kept, rel=1e-12)
    for rate, kept in ((0.0, table.thresholds[0]), (1.0, table.thresholds[-1])):
        assert table.threshold_at(rate) == kept
    between = table.threshold_at(np.sqrt(RATES[2] * RATES[3]))
    assert between == pytest.approx((float(table.thresholds[2]) + float(table.thresholds[3])) / 2)


@pytest.mark.parametrize("actors", [("aa",), ("aa", "bb")])
def test_a_single_class_answers_everything(comparison: Comparison, actors: tuple[str, ...]) -> None:
    """With one class nobody can be an impostor, and no window is too far."""
    clips = [clip for clip in _long_clips(actors=actors) if clip.class_name == "bow"]
    table = WindowTable.of_clips(clips, comparison)
    for rate in (0.001, 0.03, 0.1, 0.9):
        assert table.threshold_at(rate) == np.inf


# --- the comparison ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("actors", [["aa"], [""]])
def test_a_comparison_needs_two_people(actors: list[str]) -> None:
    """From one person's clips nothing is learned of what differs between people."""
    with pytest.raises(ValueError, match="actors: expected a class performed by two people, got none"):
        Comparison.learned(_long_clips(actors=actors))


def test_two_people_who_do_different_things_teach_nothing() -> None:
    """Two people are not enough when they share no class."""
    clips = [stick_clip("bow", actor="aa"), stick_clip("wave", actor="bb")]
    with pytest.raises(ValueError, match="actors: expected a class performed by two people, got none"):
        Comparison.learned(clips)


@pytest.mark.parametrize("skeleton", [Skeleton(STICK.joints), STICK.without_segments()])
def test_without_segments_nothing_is_compared(comparison: Comparison, skeleton: Skeleton) -> None:
    """Clips of a skeleton without parents or segments teach nothing, though they have motions."""
    clips = stick_clips(takes=1)
    clips = [dataclasses.replace(clip, skeleton=skeleton) for clip in clips]
    with pytest.raises(ValueError, match="skeleton: expected parents and segments"):
        Comparison.learned(clips)
    if len(skeleton.pairs) < 15:
        with pytest.raises(SkeletonMismatchError, match="comparison: expected one of 10 pairs, got 15"):
            MotionLibrary.of_clips(clips, comparison=comparison)
    assert MotionLibrary.of_clips(clips).windows is None


#: The stick body's joints, hanging together as nobody knows or otherwise than in the comparison.
OTHERWISE = [
    pytest.param(Skeleton(STICK.joints), id="no parents"),
    pytest.param(Skeleton(STICK.joints, (-1, 0, 1, 2, 3, 0)), id="other parents"),
]


@pytest.mark.parametrize("skeleton", OTHERWISE)
def test_windows_are_measured_by_the_comparisons_body(
    comparison: Comparison, anybody: MotionLibrary, skeleton: Skeleton, tmp_path: Path
) -> None:
    """How recordings say joints hang together does not matter: windows are the comparison's, and stay so in a file."""
    clips = [dataclasses.replace(clip, skeleton=skeleton) for clip in _long_clips()]
    library = MotionLibrary.of_clips(clips, comparison=comparison)
    _assert_equal(_table(library), _table(anybody))
    library.save(tmp_path / "library.npz")
    _assert_equal(_table(MotionLibrary.load(tmp_path / "library.npz")), _table(anybody))


def test_another_body_is_not_compared() -> None:
    """The built-in library's comparison, of 31 joints, is refused for a body of six, saying both numbers of pairs."""
    comparison = _table(MotionLibrary.builtin()).comparison
    with pytest.raises(SkeletonMismatchError, match="comparison: expected one of 15 pairs, got 465"):
        MotionLibrary.of_clips(stick_clips(), comparison=comparison)


def test_a_comparison_is_the_same_when_every_number_is(comparison: Comparison) -> None:
    """A comparison learned again is the same; another basis, origin, axis or weight makes it another."""
    assert comparison.is_same(Comparison.learned(_long_clips()))
    measure = MEASURES[-1]
    metric = comparison.metrics[measure]
    for other in (
        dataclasses.replace(metric, origin=metric.origin + 1),
        dataclasses.replace(metric, axes=-metric.axes),
        dataclasses.replace(metric, outside=metric.outside + 1),
    ):
        metrics = {**comparison.metrics, measure: other}
        assert not comparison.is_same(dataclasses.replace(comparison, metrics=metrics))
    body, basis = comparison.body, comparison.basis
    for turned in (
        dataclasses.replace(comparison, basis=dataclasses.replace(basis, directions=basis.directions[:, ::-1])),
        dataclasses.replace(comparison, body=dataclasses.replace(body, scale=1.01)),
        dataclasses.replace(comparison, body=dataclasses.replace(body, stretches=1.01 * body.stretches)),
        dataclasses.replace(comparison, body=Body.of(Skeleton(STICK.joints, (-1, 0, 1, 2, 3, 0)))),
    ):
        assert not comparison.is_same(turned)


@pytest.mark.parametrize(
    ("part", "value", "message"),
    [
        pytest.param(
            "body", Body.of(STICK.restricted_to(range(5))), "body: expected one of 15 pairs, got 10", id="body"
        ),
        pytest.param(
            "basis", Basis(np.zeros((10, 24)), np.ones(10)), "body: expected one of 10 pairs, got 15", id="basis"
        ),
        pytest.param(
            "basis", Basis(np.zeros((15, 3)), np.ones(15)), "shape1000: expected 6 numbers, got", id="directions"
        ),
    ],
)
def test_a_comparison_of_parts_of_another_is_refused(
    comparison: Comparison, part: str, value: object, message: str
) -> None:
    """A body of other pairs, a basis of other pairs and one of fewer directions are refused, with the numbers."""
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(comparison, **{part: value})


# --- fewer joints ------------------------------------------------------------------------------------------------


FEWER = ("root", "head", "left", "right", "foot")


@pytest.mark.parametrize("name", ["anybody", "one_person"])
@pytest.mark.parametrize("joints", [FEWER, FEWER[:4], FEWER[:3], FEWER[:2], FEWER[1:]], ids=" ".join)
def test_a_restricted_library_comes_back_bit_for_bit(
    name: str, joints: tuple[str, ...], tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """Restricted to some joints, even to two, windows say something of theirs, and the same when saved and loaded."""
    library = request.getfixturevalue(name).restricted_to(joints)
    clip = stick_clip("wave", seed=90, frames=150)
    kept = [STICK.joints.index(joint) for joint in joints]
    asked = _asked_with(
        dataclasses.replace(clip, skeleton=library.skeleton, positions=clip.positions[:, kept]), library
    )
    assert np.isfinite(_table(library).log_distances(asked)).all()
    library.save(tmp_path / "library.npz")
    loaded = MotionLibrary.load(tmp_path / "library.npz")
    _assert_equal(_table(loaded), _table(library))
    np.testing.assert_allclose(_table(loaded).log_distances(asked), _table(library).log_distances(asked), atol=1e-5)
    assert not _table(loaded).comparison.can_be_restricted


def _asked_with(clip: Clip, library: MotionLibrary) -> dict[Measure, np.ndarray]:
    """Measure a clip's end as a library's comparison does."""
    comparison, rows = _table(library).comparison, distance_rows(clip.positions, clip.skeleton)
    ends = np.array([clip.frames])
    return {
        measure: measured(rows, clip.frame_rate, ends, measure, body=comparison.body, basis=comparison.basis)[0]
        for measure in MEASURES
    }


def test_a_real_restricted_library_comes_back_bit_for_bit(tmp_path: Path) -> None:
    """The built-in library as a Kinect's joints show it is the same when saved and loaded."""
    library = MotionLibrary.builtin().restricted_to(builtin_preset("kinectv2").joints)
    library.save(tmp_path / "library.npz")
    _assert_equal(_table(MotionLibrary.load(tmp_path / "library.npz")), _table(library))


def test_fewer_joints_are_the_same_windows(anybody: MotionLibrary) -> None:
    """Restricting a library changes how live windows are compared, not the windows it keeps."""
    restricted = _table(anybody.restricted_to(FEWER))
    assert (_table(anybody).comparison.pairs, restricted.comparison.pairs) == (15, 10)
    assert all(map(np.array_equal, restricted.vectors, _table(anybody).vectors))
    assert np.array_equal(restricted.thresholds, _table(anybody).thresholds)
    assert not restricted.comparison.is_same(_table(anybody).comparison)


def test_each_kind_of_measure_is_restricted_in_its_way() -> None:
    """Of fewer joints spreads are freed of half their own mean, postures of none; shapes are compared as before."""
    builtin = MotionLibrary.builtin()
    comparison, fewer = _table(builtin).comparison, builtin.restricted_to(builtin_preset("kinectv2").joints)
    pairs = builtin.skeleton.places_of(fewer.skeleton)
    for measure, metric in _table(fewer).comparison.metrics.items():
        expected = comparison.metrics[measure]
        if measure.kind is not Kind.SHAPE:
            expected = expected.restricted_to(pairs, 0.5 if measure.kind is Kind.SPREAD else 0.0)
        assert np.array_equal(metric.origin, expected.origin)
        assert np.array_equal(metric.axes, expected.axes)
        assert metric.outside == expected.outside


def test_a_restricted_comparison_is_not_restricted_again(anybody: MotionLibrary) -> None:
    """What was made from another comparison is refused a second time, and such a library then has no windows."""
    comparison = _table(anybody).comparison
    assert comparison.can_be_restricted
    once = anybody.restricted_to(FEWER)
    fewer = _table(once).comparison
    assert not fewer.can_be_restricted
    assert {metric.together.size for metric in fewer.metrics.values() if metric.origin.shape == (10,)} == {0}
    skeleton = once.skeleton.restricted_to(range(4))
    with pytest.raises(ValueError, match="metric: expected one learned with what varies together, got one without"):
        fewer.restricted_to(skeleton, once.skeleton.places_of(skeleton), once.means.astype(np.float64))
    twice = once.restricted_to(FEWER[:4])
    assert twice.windows is None
    assert len(twice) == len(anybody)


def test_a_library_says_how_windows_of_its_joints_are_compared(anybody: MotionLibrary) -> None:
    """All of a library's joints are compared as it does, some as it does restricted, others not at all."""
    comparison = _table(anybody).comparison
    assert anybody.comparison_for(STICK) is comparison
    some = Skeleton.of_joints(FEWER)
    for skeleton in (some, STICK.restricted_to([STICK.joints.index(joint) for joint in FEWER])):
        found = anybody.comparison_for(skeleton)
        assert found is not None
        assert found.is_same(_table(anybody.restricted_to(FEWER)).comparison)


@pytest.mark.parametrize(
    "joints",
    [
        pytest.param((*STICK.joints, "tail"), id="one more"),
        pytest.param(("root", "chest", "tail"), id="another"),
        pytest.param(("nose", "tail"), id="none of its own"),
        pytest.param((*STICK.joints[1:], "root"), id="all in another order"),
        pytest.param(("head", "root", "left"), id="some in another order"),
    ],
)
def test_joints_a_library_has_not_are_not_compared(anybody: MotionLibrary, joints: tuple[str, ...]) -> None:
    """A skeleton with any other joint, or the same in another order, has no comparison."""
    assert anybody.comparison_for(Skeleton.of_joints(joints)) is None


def test_without_windows_nothing_is_compared(anybody: MotionLibrary) -> None:
    """A library without windows has no comparison; one restricted has its own, and none for fewer joints still."""
    assert MotionLibrary.of_clips(_long_clips()).comparison_for(STICK) is None
    once = anybody.restricted_to(FEWER)
    assert once.comparison_for(once.skeleton) is _table(once).comparison
    assert once.comparison_for(Skeleton.of_joints(FEWER[:3])) is None


def test_a_library_of_fewer_joints_is_built_with_the_comparison_for_them(hdm05_clips: tuple[Clip, ...]) -> None:
    """One person's clips of a Kinect's joints, compared as the built-in library says, find themselves and are right."""
    builtin = MotionLibrary.builtin()
    joints = builtin_preset("kinectv2").joints
    kept = [index for index, name in enumerate(builtin.skeleton.joints) if name in joints]
    skeleton = builtin.skeleton.restricted_to(kept)
    clips = [
        dataclasses.replace(clip, skeleton=skeleton, positions=clip.positions[:, kept])
        for clip in hdm05_clips
        if clip.actor == "bk"
    ][::4]
    library = MotionLibrary.of_clips(clips, comparison=builtin.comparison_for(skeleton))
    assert _table(library).groups == FOR_ONE_PERSON
    for clip in clips:
        end = _ends(clip.frames, 120.0, several=False)[-1]
        asked = _asked_with(dataclasses.replace(clip, positions=clip.positions[:end]), library)
        distances = _table(library).log_distances(asked)
        own = library.classes.index(clip.class_name)
        assert distances[own] == pytest.approx(NO_DISTANCE, abs=0.05)
        assert int(distances.argmin()) == own


# --- saving ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["anybody", "one_person"])
def test_windows_come_back_bit_for_bit(name: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """Saved and loaded, and once more, every number of the windows and every distance is what it was."""
    library = request.getfixturevalue(name)
    asked = _asking(stick_clip("wave", seed=90, frames=150), 150, _table(library).comparison)
    library.save(tmp_path / "first.npz")
    once = MotionLibrary.load(tmp_path / "first.npz")
    once.save(tmp_path / "second.npz")
    for loaded in (once, MotionLibrary.load(tmp_path / "second.npz")):
        _assert_equal(_table(loaded), _table(library))
        assert np.array_equal(_table(loaded).log_distances(asked), _table(library).log_distances(asked))


# --- merging -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("actors", [("aa",), ("aa", "bb")])
def test_merged_windows_are_those_built_together(comparison: Comparison, actors: tuple[str, ...]) -> None:
    """Libraries measured alike, classes of each in the other or not, merge to the library of all their clips."""
    clips = [*_long_clips(actors=actors), *(stick_clip("bow", seed=60 + i, actor=a) for i, a in enumerate(actors))]
    first = [clip for clip in clips if clip.class_name == "wave" or (clip.class_name, clip.take) == ("bow", "000")]
    first += [clip for clip in clips if (clip.class_name, clip.take) == ("bow", "001")]
    second = [clip for clip in clips if clip not in first and (clip.class_name, clip.take) != ("jump", "011")]
    merged = MotionLibrary.of_clips(first, comparison=comparison).merged_with(
        MotionLibrary.of_clips(second, comparison=comparison)
    )
    together = MotionLibrary.of_clips([*first, *second], comparison=comparison)
    assert merged.motions == together.motions
    _assert_equal(_table(merged), _table(together))


def test_of_an_overlapping_library_only_the_new_windows_are_taken(comparison: Comparison) -> None:
    """Motions both have, and motions without any window, are merged as if built together."""
    clips = _long_clips(takes=3)
    clips.insert(3, stick_clip("bow", seed=45, frames=5, actor="bb"))
    merged = MotionLibrary.of_clips(clips[:13], comparison=comparison).merged_with(
        MotionLibrary.of_clips(clips[2:], comparison=comparison)
    )
    together = MotionLibrary.of_clips(clips, comparison=comparison)
    assert merged.motions == together.motions
    _assert_equal(_table(merged), _table(together))


@pytest.mark.parametrize("name", ["anybody", "one_person"])
def test_merging_windows_with_themselves_changes_nothing(name: str, request: pytest.FixtureRequest) -> None:
    """A library merged with itself has the same motions and the same windows."""
    library = request.getfixturevalue(name)
    merged = library.merged_with(library)
    assert merged.motions == library.motions
    _assert_equal(_table(merged), _table(library))


def test_windows_in_one_library_alone_are_not_merged(anybody: MotionLibrary) -> None:
    """A library with windows and one without are not merged, in either order; two without are."""
    plain = MotionLibrary.of_clips([stick_clip("bow", seed=99)])
    for first, second in ((anybody, plain), (plain, anybody)):
        with pytest.raises(ValueError, match="windows: expected them in both libraries or in neither"):
            first.merged_with(second)
    assert plain.merged_with(plain).windows is None


def test_windows_measured_differently_are_not_merged(anybody: MotionLibrary, one_person: MotionLibrary) -> None:
    """A library for anybody and one for one person, or two of different comparisons, are not merged either way."""
    other = MotionLibrary.of_clips(_long_clips(), comparison=Comparison.learned(_long_clips(takes=1)))
    for first, second in ((anybody, one_person), (one_person, anybody), (anybody, other), (other, anybody)):
        with pytest.raises(ValueError, match="libraries: expected all of one person each, or all of sever"):
            first.merged_with(second)


# --- parts that do not fit ---------------------------------------------------------------------------------------


def test_windows_of_another_library_are_refused(anybody: MotionLibrary, one_person: MotionLibrary) -> None:
    """A library takes no windows of another number of motions or of other pairs."""
    with pytest.raises(ValueError, match="windows: expected those of 12 motions and 15 pairs"):
        dataclasses.replace(anybody, windows=one_person.windows)
    with pytest.raises(ValueError, match="windows: expected those of 12 motions and 15 pairs"):
        dataclasses.replace(anybody, windows=anybody.restricted_to(FEWER).windows)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        pytest.param("groups", (), "groups: expected those for anybody or", id="no group"),
        pytest.param("groups", FOR_ANYBODY[:1], "groups: expected those for anybody or", id="a group missing"),
        pytest.param("vectors", (), "vectors: expected as many windows", id="no vectors"),
        pytest.param("vectors", 1, "vectors: expected as many windows", id="narrower"),
        pytest.param("vectors", np.nan, "vectors: expected finite numbers", id="NaN"),
        pytest.param("motions", -1, "motions: expected indices", id="below"),
        pytest.param("motions", 12, "motions: expected indices", id="beyond"),
        pytest.param("motions", 0, "motions: expected windows of every class", id="classes without"),
        pytest.param("actors", "backwards", "actors: expected motions by class and, within", id="actors backwards"),
        pytest.param("thresholds", np.zeros(6, np.float32), "thresholds: expected 7 ascending", id="a rate missing"),
        pytest.param("thresholds", np.zeros((7, 3), np.float32), "thresholds: expected 7 ascending", id="by class"),
        *(
            pytest.param("thresholds", np.array(numbers, np.float32), "thresholds: expected 7 ascending", id=name)
            for name, numbers in {
                "no number": [np.nan] * 7,
                "one no number": [0, 1, 2, np.nan, 4, 5, 6],
                "descending": [0, 1, 2, 3, 4, 6, 5],
                "the last infinite": [0, 1, 2, 3, 4, 5, np.inf],
                "the first infinite": [-np.inf, 1, 2, 3, 4, 5, 6],
                "all below everything": [-np.inf] * 7,
            }.items()
        ),
    ],
)
def test_parts_that_do_not_fit_are_refused(anybody: MotionLibrary, field: str, value: object, message: str) -> None:
    """Other groups, vectors of another shape or not finite, and indices of no motion are refused by name."""
    table = _table(anybody)
    if field == "vectors" and value == 1:
        value = tuple(each[:, 1:] for each in table.vectors)
    elif field == "vectors" and value != ():
        value = tuple(each * np.float32(np.nan) for each in table.vectors)
    elif field == "actors":
        value = table.actors[::-1]
    elif field == "motions":
        value = np.full_like(table.motions, value)
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(table, **{field: value})


# --- the built-in library ----------------------------------------------------------------------------------------


def test_the_built_in_windows_are_those_of_the_clips(hdm05_library: MotionLibrary) -> None:
    """Learned and cut anew from the 288 clips, the windows are those in the package, up to half precision."""
    found, built = _table(MotionLibrary.builtin()), _table(hdm05_library)
    assert found.groups == built.groups == FOR_ANYBODY
    assert np.array_equal(found.motions, built.motions)
    assert [m.take for m in MotionLibrary.builtin().motions] == [m.take for m in hdm05_library.motions]
    for mine, theirs in zip(found.vectors, built.vectors, strict=True):
        some = slice(None, None, 7)
        squared = squared_distances(mine[some], mine[some])
        np.testing.assert_allclose(
            squared_distances(theirs[some], theirs[some]), squared, atol=5e-3 * float(squared.max())
        )
    np.testing.assert_allclose(found.thresholds, built.thresholds, atol=0.02)


def test_a_librarys_own_actor_is_known_live(hdm05_clips: tuple[Clip, ...], hdm05_library: MotionLibrary) -> None:
    """At the end of a clip of the library's, its class is the nearest of the eleven, whichever of the clips it is."""
    table = _table(hdm05_library)
    for clip in hdm05_clips[::11]:
        nearest = int(table.log_distances(_asking(clip, clip.frames, table.comparison)).argmin())
        assert hdm05_library.classes[nearest] == clip.class_name
