"""The motion library: made of clips, changed, merged, and the one that comes with the package."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from synthetic import STICK, STICK_CLASSES, stick_clip, stick_clips

from kinespace.library import Clip, MotionLibrary, Skeleton, SkeletonMismatchError
from kinespace.library.motion_library.learned import Learned
from kinespace.library.naming import Naming, hdm05

SAID = ("name", "class_name", "actor", "take", "source", "licence", "attribution", "frame_rate")


def _assert_equal(first: MotionLibrary, second: MotionLibrary) -> None:
    assert first.skeleton == second.skeleton
    assert len(first) == len(second)
    for one, another in zip(first.motions, second.motions, strict=True):
        assert [getattr(one, name) for name in SAID] == [getattr(another, name) for name in SAID]
        assert np.array_equal(one.positions, another.positions)


def _shuffled(clip: Clip, seed: int = 5, *, parents: bool = True) -> Clip:
    """Give the same clip with its joints, and their parents, in another order."""
    order = np.random.default_rng(seed).permutation(len(clip.skeleton.joints))
    places = np.argsort(order)
    above = [clip.skeleton.parents[index] for index in order] if parents else []
    skeleton = Skeleton(
        tuple(clip.skeleton.joints[index] for index in order),
        tuple(-1 if each < 0 else int(places[each]) for each in above),
    )
    return dataclasses.replace(clip, skeleton=skeleton, positions=clip.positions[:, order])


@pytest.fixture(scope="module")
def builtin() -> MotionLibrary:
    """Give the built-in library, read anew."""
    return MotionLibrary.builtin()


@pytest.fixture
def library() -> MotionLibrary:
    """Give a library of a body of six joints."""
    return MotionLibrary.of_clips(stick_clips())


# --- made of clips -----------------------------------------------------------------------------------------------


def test_clips_become_motions(library: MotionLibrary) -> None:
    """A motion has its clip's labels; of 120 frames per second every second one is kept, in whole millimetres."""
    clips = {(clip.class_name, clip.take): clip for clip in stick_clips()}
    assert len(library) == len(clips) == 18
    for motion in library.motions:
        clip = clips[motion.class_name, motion.take]
        assert (motion.actor, motion.name, motion.frame_rate) == (clip.actor, clip.name, 60.0)
        assert np.abs(motion.positions - clip.positions[::2]).max() <= 0.000501
        assert np.array_equal(motion.positions, np.round(motion.positions, 3))
        assert not motion.positions.flags.writeable
        assert motion.skeleton == STICK


@pytest.mark.parametrize(
    ("rate", "every", "kept"),
    [
        *((rate, 1, rate) for rate in (30.0, 59.94, 75.0)),
        *((2 * kept, 2, kept) for kept in (38.0, 50.0, 59.94, 60.0)),
        *((240.0, 4, 60.0), (300.0, 4, 75.0), (1000.0, 14, 1000 / 14)),
    ],
)
def test_frame_rates_come_near_60(rate: float, every: int, kept: float) -> None:
    """Of clips above 75 frames per second every n-th frame is kept, others stay; seconds stay seconds."""
    clip = dataclasses.replace(stick_clip("wave", frames=280), frame_rate=rate)
    (motion,) = MotionLibrary.of_clips([clip]).motions
    assert motion.frame_rate == pytest.approx(kept)
    np.testing.assert_allclose(motion.positions, clip.positions[::every], atol=0.000501)
    assert motion.duration == pytest.approx(clip.duration, abs=1 / kept)
    two = clip.moved_to(clip.positions[: every + 1])
    assert MotionLibrary.of_clips([two]).motions[0].frames == 2


def test_the_order_of_hdm05s_joints_never_matters(builtin: MotionLibrary) -> None:
    """HDM05's joints in the order of the alphabet, or each clip in another, make the very same library."""
    motions = builtin.motions[::20]
    assert builtin.in_our_names(Naming()) is builtin
    mixed = MotionLibrary.of_clips([_shuffled(motion, seed) for seed, motion in enumerate(motions)])
    _assert_equal(mixed, MotionLibrary.of_clips(motions))
    unknown = MotionLibrary.of_clips([_shuffled(motion, seed, parents=False) for seed, motion in enumerate(motions)])
    assert unknown.skeleton == Skeleton(hdm05.SKELETON.joints)
    assert all(np.array_equal(a.positions, b.positions) for a, b in zip(unknown.motions, mixed.motions, strict=True))


WAVE = stick_clip("wave")
#: Clips that make no motion, and why.
REFUSED: list[tuple[Clip, str]] = [
    (stick_clip("wave", frames=2), "clip 'wave_0': expected at least 3 frames, got 2"),
    (dataclasses.replace(stick_clip("wave", frames=1), frame_rate=30.0), "expected at least 2 frames, got 1"),
    (dataclasses.replace(WAVE, class_name=""), "class_name: expected a class name for clip 'wave_0', got none"),
    *(
        (WAVE.moved_to(np.arange(18.0).reshape(6, 3) ** 1.5 + way), "expected a motion, got a body that does not move")
        for way in (np.zeros((60, 1, 1)), np.linspace(0, 5, 60)[:, None, None] * np.array([1, 0.3, 0.1]))
    ),
    (WAVE.moved_to(WAVE.positions + 1001.0), "clip 'wave_0': expected joints within 1000 m of the origin"),
    (dataclasses.replace(WAVE, frame_rate=0.5), "clip 'wave_0': expected 1 to 75 frames per second, got 0.5"),
    (
        stick_clip("wave", skeleton=Skeleton((*STICK.joints[:-1], "tail"))),
        "clip 'wave_0': expected the other recordings' 6 joints, got tail as well",
    ),
]


@pytest.mark.parametrize(("clip", "message"), REFUSED, ids=range(len(REFUSED)))
def test_a_clip_that_makes_no_motion_is_refused(clip: Clip, message: str) -> None:
    """A clip too short, still, far away, without class or of other joints is refused by name, added later too."""
    error = SkeletonMismatchError if "joints, got tail" in message else ValueError
    with pytest.raises(error, match=message):
        MotionLibrary.of_clips(iter([stick_clip("bow"), clip]))
    with pytest.raises(error, match=message):
        MotionLibrary.of_clips([stick_clip("bow")]).with_motions(iter([clip]))


def test_parts_that_do_not_fit_are_refused(library: MotionLibrary) -> None:
    """Motions of another skeleton, of too many frames per second or without class are refused."""
    with pytest.raises(SkeletonMismatchError, match="expected 6 joints"):
        MotionLibrary(Skeleton(STICK.joints[::-1]), library.motions)
    with pytest.raises(ValueError, match="expected 1 to 75 frames per second, got 120"):
        MotionLibrary(STICK, (stick_clip("bow"),))
    with pytest.raises(ValueError, match="expected at least 2 frames, got 1"):
        MotionLibrary(STICK, (library.motions[0].moved_to(library.motions[0].positions[:1]),))
    with pytest.raises(ValueError, match="class_name: expected"):
        MotionLibrary(STICK, (dataclasses.replace(library.motions[0], class_name=""),))
    mixed = MotionLibrary(STICK, library.motions[::-1])
    assert [motion.class_name for motion in mixed.motions] == [motion.class_name for motion in library.motions]


# --- saved -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("skeleton", [STICK, Skeleton(STICK.joints)])
def test_a_library_comes_back_from_its_file_unchanged(tmp_path: Path, skeleton: Skeleton) -> None:
    """Saved and loaded, a library has the same words and numbers."""
    clips = [
        dataclasses.replace(
            stick_clip(name, seed=seed, skeleton=skeleton),
            actor="Ü ß",
            frame_rate=59.94,
            source="x\ny",
            licence="CC0",
            attribution="Müller et al., „HDM05“",
        )
        for seed, name in enumerate((*STICK_CLASSES, "wave"))
    ]
    learned = Learned({"weights": np.arange(6, dtype=np.float32).reshape(2, 3), "one": np.array(0.5, np.float32)})
    library = MotionLibrary.of_clips(clips, learned=learned)
    library.save(tmp_path / "library.npz")
    loaded = MotionLibrary.load(tmp_path / "library.npz")
    _assert_equal(loaded, library)
    arrays, expected = loaded.learned.named, learned.named
    assert list(arrays) == list(expected)
    assert all(np.array_equal(arrays[name], expected[name]) for name in expected)
    assert not loaded.motions[0].positions.flags.writeable


# --- changed -----------------------------------------------------------------------------------------------------


def test_motions_are_added(library: MotionLibrary) -> None:
    """Added clips become motions like all others; the library they were added to does not change."""
    learned = Learned({"one": np.zeros(1, np.float32)})
    before = dataclasses.replace(library, learned=learned)
    more = before.with_motions([stick_clip("jump", seed=70), dataclasses.replace(stick_clip("bow"), class_name="ab")])
    assert (len(before), len(more)) == (18, 20)
    assert more.classes == ("ab", *STICK_CLASSES)
    assert more.learned is learned
    _assert_equal(more, MotionLibrary.of_clips([*more.motions]))
    (jump,) = (motion for motion in more.motions if motion.name == "jump_70")
    _assert_equal(more.without(classes=["ab"], motions=[jump]), before)


def test_classes_persons_and_motions_are_left_out(library: MotionLibrary) -> None:
    """Classes, persons and motions are left out; all other motions stay."""
    assert library.without(classes=["bow", "wave"]).classes == ("jump",)
    assert library.without(actors=["aa"]).actors == ("bb",)
    gone = library.motions[4]
    assert library.without(motions=[gone]).motions == (*library.motions[:4], *library.motions[5:])
    assert library.without().motions == library.motions


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda library: library.without(classes=["hop"]), "classes: expected some of bow, jump, wave, got 'hop'"),
        (lambda library: library.without(actors=["cc"]), "actors: expected some of aa, bb, got 'cc'"),
        (lambda library: library.without(motions=[stick_clip("bow")]), "motions: expected some of this library's own"),
        (lambda library: library.without(actors=["aa", "bb"]), "motions: expected at least one, got none"),
        (lambda library: library.renamed({"hop": "jump"}), "classes: expected some of bow, jump, wave, got 'hop'"),
        (lambda library: library.renamed({"bow": ""}), "expected a class name for clip"),
    ],
)
def test_changes_of_absent_classes_are_refused(
    library: MotionLibrary, change: Callable[[MotionLibrary], MotionLibrary], message: str
) -> None:
    """Leaving out or renaming a class that the library lacks is refused, and so is leaving out everything."""
    with pytest.raises(ValueError, match=message):
        change(library)


def test_classes_are_renamed(library: MotionLibrary) -> None:
    """A renamed class stands where its new name belongs; two of one name are one class."""
    renamed = library.renamed({"bow": "zeal", "jump": "wave"})
    assert renamed.classes == ("wave", "zeal")
    assert [motion.class_name for motion in renamed.motions] == ["wave"] * 12 + ["zeal"] * 6
    assert {motion.take for motion in renamed.motions} == {motion.take for motion in library.motions}


# --- fewer joints ------------------------------------------------------------------------------------------------


def test_fewer_joints_show_the_same_motions(builtin: MotionLibrary) -> None:
    """Restricted to some joints, in any order, motions hold these joints' positions, in the library's order."""
    names = ("head", "lhand", "rhand", "root", "lfoot", "rfoot", "nose")
    fewer = builtin.restricted_to(names)
    assert fewer.skeleton.joints == ("root", "lfoot", "rfoot", "head", "lhand", "rhand")
    assert fewer.skeleton.parents == (-1, 0, 0, 0, 0, 0)
    places = [builtin.skeleton.joints.index(name) for name in fewer.skeleton.joints]
    assert len(fewer) == 288
    for less, more in zip(fewer.motions[::30], builtin.motions[::30], strict=True):
        assert [getattr(less, name) for name in SAID] == [getattr(more, name) for name in SAID]
        assert np.array_equal(less.positions, more.positions[:, places])
    assert builtin.restricted_to((*builtin.skeleton.joints, "nose")) is builtin


# --- merged ------------------------------------------------------------------------------------------------------


def test_a_motion_both_have_is_kept_once(library: MotionLibrary) -> None:
    """A motion the same in words and numbers is kept once; one that differs by a millimetre, or a take, is kept."""
    _assert_equal(library.merged_with(library), library)
    first = library.motions[0]
    moved = first.positions.copy()
    moved[3, 2, 1] += 0.001
    other = MotionLibrary(STICK, (first, first.moved_to(moved), dataclasses.replace(first, take="other")))
    assert len(library.merged_with(other)) == 20


def test_libraries_are_merged_over_the_joints_that_both_have(builtin: MotionLibrary) -> None:
    """Libraries merge over their shared joints; in either direction the motions are the same."""
    small = builtin.without(actors=("bd", "bk", "dg", "mm"))
    fewer = small.restricted_to(builtin.skeleton.joints[::2])
    other = MotionLibrary.of_clips([_shuffled(motion) for motion in fewer.motions[::3]])
    merged = small.merged_with(other)
    assert merged.skeleton == fewer.skeleton
    _assert_equal(merged, fewer)
    again = other.merged_with(small)
    assert again.skeleton == other.skeleton
    assert len(again) == len(small)
    _assert_equal(again.merged_with(merged), again)


# --- the built-in library ----------------------------------------------------------------------------------------


def test_the_built_in_library_describes_itself(builtin: MotionLibrary) -> None:
    """The library in the package has HDM05's 288 motions of 11 classes by 5 persons, its licence and its authors."""
    assert (len(builtin), len(builtin.classes), builtin.actors) == (288, 11, ("bd", "bk", "dg", "mm", "tr"))
    assert builtin.skeleton == hdm05.SKELETON
    assert {motion.frame_rate for motion in builtin.motions} == {60.0}
    assert {motion.source for motion in builtin.motions} == {hdm05.SOURCE}
    assert (builtin.licence, builtin.attribution) == (hdm05.LICENCE, hdm05.ATTRIBUTION)
    assert "Mueller" in builtin.attribution
    assert sum(motion.duration for motion in builtin.motions) == pytest.approx(595, abs=1)


def test_the_built_in_library_is_that_of_the_clips(builtin: MotionLibrary, hdm05_clips: tuple[Clip, ...]) -> None:
    """Built anew from the 288 clips the library is the one in the package, to the millimetre."""
    terms = {"source": hdm05.SOURCE, "licence": hdm05.LICENCE, "attribution": hdm05.ATTRIBUTION}
    _assert_equal(MotionLibrary.of_clips([dataclasses.replace(clip, **terms) for clip in hdm05_clips]), builtin)
