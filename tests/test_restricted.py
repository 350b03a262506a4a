"""A library restricted to fewer joints: the shared pairs, cut and renormalised, compared with a library built so."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import naive_windows
import numpy as np
import pytest
from synthetic import STICK, stick_clips

from library import MotionLibrary
from library.comparison import MEASURES
from library.distances import distance_rows
from library.hdm05 import SKELETON
from library.labels import read_labels, renamed
from library.measures import LEVEL_REMOVED, Kind, Measure, measured
from library.recordings import find_recordings, read_recordings
from library.skeleton import Skeleton, SkeletonMismatchError
from stream import Frame, Recognizer, Settings
from stream.feeds import builtin_names, builtin_preset
from tools.bench.recorded import NAMES

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from library import Clip
    from library.comparison import Comparison

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

#: How clear a direction must be in fewer distances, relative to the clearest, for them to tell of it.
CLEAR = 0.2
#: Relative error of a number rounded to half precision.
HALF = 2.0**-11

LIBRARY = MotionLibrary.of_clips(stick_clips())


def naive_cut(library: MotionLibrary, joints: Sequence[str]) -> dict[str, np.ndarray]:
    """Pick the shared pairs one by one, by their joints' names."""
    names = library.skeleton.joints
    columns = [
        column
        for column, (first, second) in enumerate(library.skeleton.pairs)
        if names[first] in joints and names[second] in joints
    ]
    axes = np.array([[axis[column] for column in columns] for axis in library.axes], dtype=np.float64)
    return {
        "means": np.array([[row[column] for column in columns] for row in library.means]),
        "deviations": np.array([[row[column] for column in columns] for row in library.deviations]),
        "axes": np.array([axis / np.sqrt(axis @ axis) for axis in axes]),
    }


@pytest.mark.parametrize("with_segments", [True, False])
def test_the_shared_pairs_are_kept(with_segments: bool) -> None:  # noqa: FBT001 - a parametrised test's argument
    """Means and deviations are those of the shared pairs, axes too, of unit length; joints in the library's order."""
    skeleton = STICK if with_segments else STICK.without_segments()
    clips = stick_clips() if with_segments else [_of(clip, skeleton) for clip in stick_clips()]
    library = MotionLibrary.of_clips(clips)
    wanted = (STICK.joints[4], STICK.joints[0], STICK.joints[2], STICK.joints[5], "tail")
    restricted = library.restricted_to(wanted)
    assert restricted.skeleton.joints == tuple(STICK.joints[index] for index in (0, 2, 4, 5))
    assert restricted.skeleton.with_segments is with_segments
    for name, expected in naive_cut(library, wanted).items():
        kept = [
            tuple(sorted((restricted.skeleton.joints[a], restricted.skeleton.joints[b])))
            for a, b in restricted.skeleton.pairs
        ]
        every = [
            tuple(sorted((library.skeleton.joints[a], library.skeleton.joints[b])))
            for a, b in library.skeleton.pairs
            if library.skeleton.joints[a] in wanted and library.skeleton.joints[b] in wanted
        ]
        ours = getattr(restricted, name)
        columns = [every.index(pair) for pair in kept]
        if name == "axes" and len(columns) < len(every):
            expected = expected[:, columns] / np.linalg.norm(expected[:, columns], axis=1, keepdims=True)  # noqa: PLW2901
            columns = list(range(len(columns)))
        np.testing.assert_allclose(ours, expected[:, columns], atol=1e-6)
    assert (restricted.classes, len(restricted)) == (library.classes, len(library))
    assert restricted.windows is None


def _of(clip: Clip, skeleton: Skeleton) -> Clip:

    return replace(clip, skeleton=skeleton)


def test_all_joints_are_the_library_itself() -> None:
    """A feed that has every joint, and more, needs no other library."""
    assert LIBRARY.restricted_to([*reversed(STICK.joints), "tail"]) is LIBRARY


def test_two_joints_must_be_shared() -> None:
    """With one joint, or none, there is no distance, and that is said."""
    with pytest.raises(SkeletonMismatchError, match=r"joints: expected at least 2 of the library's 6 .*, got 1"):
        LIBRARY.restricted_to([STICK.joints[0], "tail"])


def test_motions_keep_what_is_said_of_them() -> None:
    """Class, actor and take stay; eigenvalue and share are those of what is left, both still possible."""
    restricted = LIBRARY.restricted_to(STICK.joints[:4])
    for ours, theirs in zip(restricted.motions, LIBRARY.motions, strict=True):
        assert (ours.class_name, ours.actor, ours.take) == (theirs.class_name, theirs.actor, theirs.take)
        assert 0 < ours.eigenvalue < theirs.eigenvalue
        assert 0 < ours.share <= 1


@pytest.mark.parametrize("name", builtin_names())
def test_the_built_in_library_fits_every_preset(name: str) -> None:
    """The built-in library has at least nine joints in common with each preset, and parents that make a tree."""
    preset = builtin_preset(name)
    restricted = MotionLibrary.builtin().restricted_to(preset.joints)
    assert set(restricted.skeleton.joints) == set(preset.joints)
    np.testing.assert_allclose(np.linalg.norm(restricted.axes, axis=1), 1.0, atol=1e-6)
    for joint, parent in enumerate(restricted.skeleton.parents):
        assert -1 <= parent < len(preset.joints)
        assert parent != joint


def test_an_axis_cut_is_near_the_axis_of_the_fewer_distances() -> None:
    """On motions whose variance lies along one axis the cut axis is the one a library of fewer joints would have."""
    joints = STICK.joints[:5]
    smaller = Skeleton.of_joints(joints)
    clips = stick_clips()
    built = MotionLibrary.of_clips([_narrowed(clip, smaller) for clip in clips])
    products = np.abs(np.sum(built.axes * LIBRARY.restricted_to(joints).axes, axis=1))
    assert products.min() > 0.99


# --- windows -----------------------------------------------------------------------------------------------------


class Fewer(NamedTuple):
    """What the built-in library's windows are, and what fewer joints show of them."""

    whole: Comparison
    made: Comparison
    skeleton: Skeleton
    pairs: NDArray[np.intp]
    joints: list[int]


@pytest.fixture(scope="module", params=["kinectv2", "osceleton", "vrchat"])
def fewer(request: pytest.FixtureRequest) -> Fewer:
    """Restrict the built-in library to a product's joints."""
    library = MotionLibrary.builtin()
    restricted = library.restricted_to(builtin_preset(request.param).joints)
    assert library.windows is not None
    assert restricted.windows is not None
    joints = [SKELETON.joints.index(joint) for joint in restricted.skeleton.joints]
    pairs = library.skeleton.places_of(restricted.skeleton)
    return Fewer(library.windows.comparison, restricted.windows.comparison, restricted.skeleton, pairs, joints)


def _by_pair(row: Sequence[float]) -> dict[tuple[int, int], float]:
    return dict(zip(combinations(range(len(SKELETON.joints)), 2), row, strict=True))


def test_what_segments_lack_is_made_up_for(fewer: Fewer) -> None:
    """The fewer joints' body is as large, and its paths as long, as all joints', in the mean over the library."""
    means = MotionLibrary.builtin().means.astype(np.float64)[::9]
    body = fewer.whole.body.restricted_to(fewer.skeleton, fewer.pairs, means)
    scale, stretches = naive_windows.sizes_and_stretches(
        [_by_pair(row) for row in means.tolist()], SKELETON.parents, fewer.skeleton.parents, fewer.joints
    )
    assert body.scale == pytest.approx(scale)
    pairs = [(int(first), int(second)) for first, second in fewer.skeleton.pairs]
    np.testing.assert_allclose(body.stretches, [stretches[pair] for pair in pairs], rtol=1e-6)


def test_the_course_is_found_by_least_squares(fewer: Fewer, some_clips: tuple[Clip, ...]) -> None:
    """Where real rows stand along the directions is what least squares over the fewer distances gives."""
    whole = fewer.whole.basis
    made = whole.restricted_to(fewer.pairs)
    for clip in some_clips[::5]:
        row = distance_rows(clip.positions[:1], clip.skeleton)[0, fewer.pairs]
        course = naive_windows.course_seen(row, whole.directions, whole.weights, fewer.pairs.tolist(), CLEAR)
        np.testing.assert_allclose(row @ made.directions, course, atol=1e-6 * np.abs(course).max())
        # What is kept of them is rounded to half precision, number by number.
        rounded = HALF * np.abs(row) @ np.abs(made.directions)
        assert (np.abs(row @ fewer.made.basis.directions - course) <= 1.01 * rounded + 1e-6).all()


@pytest.mark.parametrize("measure", [each for each in MEASURES if each.kind is not Kind.SHAPE], ids=lambda m: m.name)
def test_vectors_are_the_best_linear_estimates(fewer: Fewer, measure: Measure, some_clips: tuple[Clip, ...]) -> None:
    """A window's vector from fewer distances is the one expected of normally distributed vectors, given those."""
    whole, made = fewer.whole.metrics[measure], fewer.made.metrics[measure]
    for clip in some_clips[::5]:
        rows = distance_rows(clip.positions, clip.skeleton)[:, fewer.pairs]
        ends = np.array([clip.frames])
        (numbers,) = measured(rows, clip.frame_rate, ends, measure, body=fewer.made.body, basis=fewer.made.basis)
        expected = naive_windows.vector_seen(
            numbers,
            origin=whole.origin.astype(np.float64),
            axes=whole.axes.astype(np.float64),
            together=whole.together.astype(np.float64),
            spare=whole.spare.astype(np.float64),
            seen=fewer.pairs.tolist(),
            level_removed=LEVEL_REMOVED if measure.kind is Kind.SPREAD else 0.0,
        )
        # Origin and axes are rounded to half precision, number by number.
        rounded = np.abs(numbers - made.origin) @ np.abs(made.axes) + np.abs(made.origin) @ np.abs(made.axes)
        assert (np.abs(made.embedded(numbers) - expected) <= HALF * rounded + 1e-4).all()


def test_what_was_restricted_cannot_be_again(fewer: Fewer) -> None:
    """An estimate is not estimated from: a library restricted twice goes by the eigenvector, and the metric says so."""
    restricted = MotionLibrary.builtin().restricted_to(fewer.skeleton.joints)
    assert restricted.restricted_to(fewer.skeleton.joints[:5]).windows is None
    with pytest.raises(ValueError, match="metric: expected one learned with what varies together"):
        fewer.made.metrics[MEASURES[0]].restricted_to(np.arange(5), 0.5)


def test_a_takes_windows_are_named_nearly_as_by_all_joints(cmu_folder: Path) -> None:
    """With kinectv2's joints as good as every window is named that all 31 name, on takes nobody learned from."""
    whole = MotionLibrary.builtin()
    restricted = whole.restricted_to(builtin_preset("kinectv2").joints)
    right = {31: list[bool](), len(restricted.skeleton.joints): list[bool]()}
    paths = find_recordings([cmu_folder])
    for path, take in zip(paths, read_recordings(paths), strict=True):
        known = [each for each in renamed(read_labels(path.with_suffix(".csv")), NAMES) if each.label in whole.classes]
        for library in (whole, restricted):
            recognizer = Recognizer(library, Settings(hop=1 / 15))
            order = library.skeleton.order_from(take.skeleton.joints)
            for time, positions in zip(take.times[::4].tolist(), take.positions[::4, order], strict=True):
                answer = recognizer.push(Frame("p", 1.0 + time, positions))
                inside = [each for each in known if each.start + 1 <= time < each.end]
                if answer and inside:
                    guess = answer.classes[answer.guess_index]
                    right[len(library.skeleton.joints)].append(guess == inside[0].label)
    all_joints, fewer_joints = right.values()
    assert len(all_joints) == len(fewer_joints) > 300
    assert np.mean(fewer_joints) >= np.mean(all_joints) - 0.02


def _narrowed(clip: Clip, skeleton: Skeleton) -> Clip:

    return replace(clip, skeleton=skeleton, positions=clip.positions[:, : len(skeleton.joints)])
