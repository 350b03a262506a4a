"""The motion library: built, matched, merged, and the one that comes with the package."""

from __future__ import annotations

import dataclasses
from importlib import resources
from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from synthetic import STICK, STICK_CLASSES, stick_clip, stick_clips

from library.distances import distance_rows
from library.motionlibrary import Motion, MotionLibrary
from library.signature import Moments, Signature, signature_of
from library.skeleton import Skeleton, SkeletonMismatchError

if TYPE_CHECKING:
    from pathlib import Path

    from library.clip import Clip

ARRAYS = ("means", "axes", "deviations")


def _signature(clip: Clip) -> Signature:
    return signature_of(Moments.of_rows(distance_rows(clip.positions, clip.skeleton)))


def _assert_equal(first: MotionLibrary, second: MotionLibrary) -> None:
    for name in ("skeleton", "motions", "classes", "licence", "attribution"):
        assert getattr(first, name) == getattr(second, name)
    for name in ARRAYS:
        assert np.array_equal(getattr(first, name), getattr(second, name))


@pytest.fixture
def library() -> MotionLibrary:
    return MotionLibrary.of_clips(stick_clips(), licence="CC0", attribution="nobody")


# --- building ----------------------------------------------------------------------------------------------------


def test_real_clips_become_their_signatures(some_clips: tuple[Clip, ...]) -> None:
    """Each motion holds its clip's labels and length, and the naive mean, deviation, axis, eigenvalue and share."""
    library = MotionLibrary.of_clips(some_clips)
    assert len(library) == len(some_clips)
    clips = {clip.class_name: clip for clip in some_clips}
    for motion, mean, axis, deviation in zip(
        library.motions, library.means, library.axes, library.deviations, strict=True
    ):
        clip = clips[motion.class_name]
        rows = distance_rows(clip.positions, clip.skeleton)
        variance, first_axis = naive.first_axis_by_svd(rows)
        assert (motion.actor, motion.take) == (clip.actor, clip.take)
        assert (motion.frames, motion.frame_rate, motion.duration) == (clip.frames, 120.0, clip.frames / 120.0)
        assert motion.eigenvalue == pytest.approx(variance)
        assert motion.share == pytest.approx(variance / rows.var(axis=0, ddof=1).sum())
        np.testing.assert_allclose(mean, rows.mean(axis=0), rtol=1e-6)
        np.testing.assert_allclose(deviation, rows.std(axis=0, ddof=1), rtol=1e-5, atol=1e-8)
        assert naive.score(axis, first_axis) == pytest.approx(1.0, abs=1e-6)


def test_motions_are_grouped_by_class_and_actor_in_the_given_order() -> None:
    """Mixed clips are sorted by class and actor, in the order given within those, numbers and labels together."""
    clips = stick_clips(takes=2)
    library = MotionLibrary.of_clips(clips)
    expected = [
        clip
        for class_name in STICK_CLASSES
        for actor in ("aa", "bb")
        for clip in clips
        if (clip.class_name, clip.actor) == (class_name, actor)
    ]
    assert [clip.class_name for clip in clips] != [clip.class_name for clip in expected]
    assert library.classes == STICK_CLASSES
    assert [(motion.class_name, motion.take) for motion in library.motions] == [
        (clip.class_name, clip.take) for clip in expected
    ]
    assert library.class_indices.tolist() == [0] * 4 + [1] * 4 + [2] * 4
    for index, clip in enumerate(expected):
        signature = _signature(clip)
        assert np.array_equal(library.means[index], signature.mean.astype(np.float32))
        assert np.array_equal(library.axes[index], signature.axis.vector.astype(np.float32))
        assert np.array_equal(library.deviations[index], signature.deviation.astype(np.float32))


def test_parts_in_any_order_make_the_same_library(library: MotionLibrary) -> None:
    """Motions given in another order, their numbers with them, are sorted by class and actor."""
    order = np.random.default_rng(4).permutation(len(library))
    mixed = MotionLibrary(
        skeleton=library.skeleton,
        motions=tuple(library.motions[index] for index in order),
        **{name: getattr(library, name)[order] for name in ARRAYS},
    )
    assert [(motion.class_name, motion.actor) for motion in mixed.motions] == [
        (motion.class_name, motion.actor) for motion in library.motions
    ]
    for index, motion in enumerate(mixed.motions):
        for name in ARRAYS:
            expected = getattr(library, name)[library.motions.index(motion)]
            assert np.array_equal(getattr(mixed, name)[index], expected)


def test_a_still_clip_makes_no_motion() -> None:
    """A clip in which nothing moves is refused by name: its axis would be made of rounding errors."""
    still = stick_clip("wave").moved_to(np.tile(np.arange(18.0).reshape(6, 3) ** 2, (10, 1, 1)))
    with pytest.raises(ValueError, match="clip 'wave_0': expected a motion, got a body that does not move"):
        MotionLibrary.of_clips([stick_clip("bow"), still])


@pytest.mark.parametrize(
    ("clips", "error", "message"),
    [
        pytest.param([], ValueError, "clips: expected at least one, got none", id="no clip"),
        pytest.param(
            [stick_clip("bow"), stick_clip("wave", seed=3, frames=1)],
            ValueError,
            "clip 'wave_3': expected at least 2 frames, got 1",
            id="one frame",
        ),
        pytest.param(
            [stick_clip("bow"), dataclasses.replace(stick_clip("wave"), class_name="")],
            ValueError,
            "clip 'wave_0': expected a class name, got none",
            id="no class",
        ),
        pytest.param(
            [stick_clip("bow"), stick_clip("bow", skeleton=Skeleton(STICK.joints[::-1]))],
            SkeletonMismatchError,
            r"skeleton: expected 6 joints and 15 pairs \(root \.\.\. foot\), got .*\(foot \.\.\. root\)",
            id="another skeleton",
        ),
        pytest.param(
            [stick_clip("bow"), stick_clip("bow", skeleton=STICK.without_segments())],
            SkeletonMismatchError,
            "expected 6 joints and 15 pairs .*got 6 joints and 10 pairs",
            id="other pairs",
        ),
    ],
)
def test_clips_that_make_no_library_are_refused(clips: list[Clip], error: type[Exception], message: str) -> None:
    """Without clips, with one too short, without class or of another skeleton there is no library."""
    with pytest.raises(error, match=message):
        MotionLibrary.of_clips(iter(clips))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        pytest.param("motions", (), "motions: expected at least one, got none", id="no motion"),
        pytest.param("means", np.zeros((18, 14)), r"means: expected shape \(18, 15\), got \(18, 14\)", id="pairs"),
        pytest.param("axes", np.zeros((17, 15)), r"axes: expected shape \(18, 15\), got \(17, 15\)", id="motions"),
        pytest.param("axes", np.zeros(270), r"axes: expected shape \(18, 15\), got \(270,\)", id="flat"),
        pytest.param("deviations", np.full((18, 15), np.nan), "deviations: expected finite numbers", id="NaN"),
        pytest.param("means", np.full((18, 15), np.inf), "means: expected finite numbers", id="infinity"),
    ],
)
def test_parts_that_do_not_fit_are_refused(library: MotionLibrary, field: str, value: object, message: str) -> None:
    """Arrays of another shape than motions times pairs, or not finite, are refused by name."""
    parts = {name: getattr(library, name) for name in ("skeleton", "motions", *ARRAYS)}
    with pytest.raises(ValueError, match=message):
        MotionLibrary(**{**parts, field: value})


# --- saving ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("skeleton", [STICK, STICK.without_segments(), Skeleton(STICK.joints)])
def test_a_library_comes_back_from_its_file_as_it_was(tmp_path: Path, skeleton: Skeleton) -> None:
    """Saved and loaded, every label, number and word is what it was, the set of pairs included."""
    clips = [
        dataclasses.replace(stick_clip(name, seed=seed, skeleton=skeleton), actor="Ü ß", frame_rate=59.94)
        for seed, name in enumerate(reversed(STICK_CLASSES))
    ]
    library = MotionLibrary.of_clips(clips, licence="CC BY-SA 3.0", attribution="Müller et al., „HDM05“\n2007")
    library.save(tmp_path / "library.npz")
    _assert_equal(MotionLibrary.load(tmp_path / "library.npz"), library)


def test_a_loaded_library_matches_bit_for_bit(library: MotionLibrary, tmp_path: Path) -> None:
    """A window scores the same against a library and against its file."""
    library.save(tmp_path / "library.npz")
    window = _signature(stick_clip("jump", seed=77))
    expected, match = library.match(window), MotionLibrary.load(tmp_path / "library.npz").match(window)
    assert np.array_equal(match.motion_scores, expected.motion_scores)
    assert np.array_equal(match.class_scores, expected.class_scores)


# --- matching ----------------------------------------------------------------------------------------------------


def test_real_windows_match_as_the_loops_say(hdm05_clips: tuple[Clip, ...]) -> None:
    """Windows of real motion score against each motion, and against the best of each class, what the loops give."""
    library = MotionLibrary.of_clips(hdm05_clips[::6])
    names = [motion.class_name for motion in library.motions]
    assert len(library.classes) == 11
    for clip in hdm05_clips[3::24]:
        window = _signature(clip.moved_to(clip.positions[:120]))
        match = library.match(window)
        scores, best = naive.match(library.axes, names, window.axis.vector)
        np.testing.assert_allclose(match.motion_scores, scores, atol=1e-6)
        np.testing.assert_allclose(match.class_scores, [best[name] for name in library.classes], atol=1e-6)


def test_a_motion_matches_itself(library: MotionLibrary) -> None:
    """The window that is a library's own clip scores 1 with its motion and its class, and no motion scores more."""
    for clip in stick_clips():
        match = library.match(_signature(clip))
        index = [(motion.class_name, motion.take) for motion in library.motions].index((clip.class_name, clip.take))
        assert match.motion_scores[index] == pytest.approx(1.0, abs=1e-6)
        assert match.class_scores[library.classes.index(clip.class_name)] == pytest.approx(1.0, abs=1e-6)
        assert match.motion_scores.max() <= 1.0 + 1e-6


def test_an_unknown_take_is_of_its_class(library: MotionLibrary) -> None:
    """A take the library has not seen scores best with its class."""
    for class_name in STICK_CLASSES:
        match = library.match(_signature(stick_clip(class_name, seed=1234)))
        assert library.classes[int(np.argmax(match.class_scores))] == class_name


def test_one_motion_of_one_class_is_a_library() -> None:
    """The smallest library gives one score, which is the class's too."""
    match = MotionLibrary.of_clips([stick_clip("bow")]).match(_signature(stick_clip("wave")))
    assert match.class_scores.tolist() == match.motion_scores.tolist()
    assert len(match.class_scores) == 1


@pytest.mark.parametrize("skeleton", [STICK.without_segments(), Skeleton.of_joints(["a", "b", "c"])])
def test_a_window_over_other_pairs_is_refused(library: MotionLibrary, skeleton: Skeleton) -> None:
    """A signature of another number of pairs is refused, saying both."""
    pairs = len(skeleton.pairs)
    signature = signature_of(Moments.of_rows(np.random.default_rng(0).normal(size=(9, pairs))))
    with pytest.raises(SkeletonMismatchError, match=f"signature: expected 15 pairs, got {pairs}"):
        library.match(signature)


# --- merging -----------------------------------------------------------------------------------------------------


def test_a_merged_library_holds_both() -> None:
    """Merging gives the classes and motions of both, sorted by class, the first library's before the second's."""
    first = MotionLibrary.of_clips([stick_clip("wave", seed=1), stick_clip("bow", seed=2)])
    second = MotionLibrary.of_clips([stick_clip("wave", seed=3), stick_clip("jump", seed=4)])
    merged = first.merged_with(second)
    assert [(motion.class_name, motion.take) for motion in merged.motions] == [
        ("bow", "002"),
        ("jump", "004"),
        ("wave", "001"),
        ("wave", "003"),
    ]
    _assert_equal(merged, MotionLibrary.of_clips([stick_clip(m.class_name, seed=int(m.take)) for m in merged.motions]))


def test_a_merged_library_scores_the_better_of_both() -> None:
    """A class in both libraries scores what it scores in the one where it scores more."""
    first, second = (MotionLibrary.of_clips(stick_clips(takes=2, actors=[actor])) for actor in ("aa", "bb"))
    second = dataclasses.replace(second, axes=second.axes[:, ::-1])
    window = _signature(stick_clip("jump", seed=50))
    best = np.maximum(first.match(window).class_scores, second.match(window).class_scores)
    np.testing.assert_allclose(first.merged_with(second).match(window).class_scores, best, atol=1e-7)


def test_merging_with_itself_changes_nothing(library: MotionLibrary) -> None:
    """A library merged with itself, licence and attribution included, is itself."""
    _assert_equal(library.merged_with(library), library)


def test_merging_again_changes_nothing() -> None:
    """What has been merged in already adds nothing, to the motions or to the words."""
    first = MotionLibrary.of_clips([stick_clip("wave")], licence="CC0", attribution="us")
    second = MotionLibrary.of_clips([stick_clip("bow")], licence="CC BY-SA 3.0", attribution="them")
    merged = first.merged_with(second)
    _assert_equal(merged.merged_with(second), merged)


def test_a_motion_both_have_is_kept_once() -> None:
    """Of libraries that overlap, a motion the same in labels and numbers is kept once, one that differs is kept."""
    common, own = stick_clip("wave", seed=1), stick_clip("wave", seed=2)
    other = dataclasses.replace(stick_clip("wave", seed=3), take=own.take)
    merged = MotionLibrary.of_clips([common, own]).merged_with(MotionLibrary.of_clips([other, common]))
    _assert_equal(merged, MotionLibrary.of_clips([common, own, other]))


def test_motions_alike_in_all_but_their_axis_are_both_kept(library: MotionLibrary) -> None:
    """A motion of the same labels and eigenvalue but another axis is another motion."""
    other = dataclasses.replace(library, axes=library.axes[:, ::-1])
    assert len(library.merged_with(other)) == 2 * len(library)


@pytest.mark.parametrize(
    ("first", "second", "joined"),
    [("CC0", "CC BY-SA 3.0", "CC0 / CC BY-SA 3.0"), ("CC0", "CC0", "CC0"), ("", "CC0", "CC0"), ("", "", "")],
)
def test_licences_and_attributions_are_joined(first: str, second: str, joined: str) -> None:
    """A merged library stands under both licences and names both sources, each said once."""
    merged = MotionLibrary.of_clips([stick_clip("wave")], licence=first, attribution=first).merged_with(
        MotionLibrary.of_clips([stick_clip("bow")], licence=second, attribution=second)
    )
    assert (merged.licence, merged.attribution) == (joined, joined)


@pytest.mark.parametrize(
    "skeleton", [STICK.without_segments(), Skeleton(STICK.joints[::-1]), Skeleton((*STICK.joints[:-1], "tail"))]
)
def test_libraries_of_different_skeletons_are_not_merged(library: MotionLibrary, skeleton: Skeleton) -> None:
    """Merging across skeletons is refused in either direction."""
    other = MotionLibrary.of_clips([stick_clip("bow", skeleton=skeleton)])
    for one, another in ((library, other), (other, library)):
        with pytest.raises(SkeletonMismatchError, match="skeleton: expected 6 joints and"):
            one.merged_with(another)


# --- the built-in library ----------------------------------------------------------------------------------------


def test_the_built_in_library_says_what_it_is() -> None:
    """The library in the package has HDM05's 288 motions of 11 classes and 31 joints, its licence and its authors."""
    library = MotionLibrary.builtin()
    assert (len(library), len(library.classes)) == (288, 11)
    assert (len(library.skeleton.joints), len(library.skeleton.pairs)) == (31, 465)
    assert library.licence == "CC BY-SA 3.0"
    assert "HDM05" in library.attribution
    assert "Mueller" in library.attribution
    np.testing.assert_allclose(np.linalg.norm(library.axes, axis=1), 1.0, rtol=1e-6)


def test_the_built_in_library_is_small() -> None:
    """The library in the package takes at most four megabytes."""
    assert len(resources.files("library").joinpath("hdm05.npz").read_bytes()) <= 4_000_000


def test_the_built_in_library_is_that_of_the_clips(hdm05_clips: tuple[Clip, ...]) -> None:
    """Built anew from the 288 clips the library is the one in the package, up to rounding and the axes' signs."""
    builtin = MotionLibrary.builtin()
    places = {(motion.class_name, motion.actor, motion.take): place for place, motion in enumerate(builtin.motions)}
    assert builtin.skeleton == hdm05_clips[0].skeleton
    for clip in hdm05_clips:
        place = places.pop((clip.class_name, clip.actor, clip.take))
        signature, motion = _signature(clip), builtin.motions[place]
        assert (motion.frames, motion.frame_rate) == (clip.frames, clip.frame_rate)
        assert (motion.eigenvalue, motion.share) == pytest.approx((signature.axis.value, signature.axis.share))
        np.testing.assert_allclose(builtin.means[place], signature.mean, rtol=1e-6)
        np.testing.assert_allclose(builtin.deviations[place], signature.deviation, rtol=1e-5, atol=1e-7)
        assert abs(builtin.axes[place] @ signature.axis.vector) == pytest.approx(1.0, abs=1e-5)
    assert not places


def test_a_motions_duration_is_in_seconds() -> None:
    """90 frames at 60 per second last a second and a half."""
    assert Motion("wave", "aa", "001", 90, 60.0, 1.0, 0.5).duration == pytest.approx(1.5)
