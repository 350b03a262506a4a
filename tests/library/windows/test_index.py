from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import STICK, STICK_CLASSES, stick_clip, stick_clips
from threadpoolctl import threadpool_limits

from kinespace.library import Clip, MotionLibrary, Skeleton, SkeletonMismatchError, WindowIndex
from kinespace.library.library_file import TAUGHT
from kinespace.library.signature.parts import Part, Signature
from kinespace.library.windows.comparer import named_and_alone
from kinespace.library.windows.comparison import FIRST_WINDOW, Weighing
from kinespace.library.windows.cutting import cut_windows, window_ends
from kinespace.library.windows.opening import by_joints, has_view
from kinespace.library.windows.taught import WEIGHINGS, keeping_lessons, kept_of, teacher_of
from kinespace.tools.cli.arguments import joints_of


def _numbers(index: WindowIndex, clip: Clip) -> list[Mapping[Part, np.ndarray]]:
    """Give the numbers of a motion's windows one by one."""
    ends = window_ends(clip, 0.4)
    cut, _ = cut_windows([clip], [ends], index.body, index.basis, index.comparison.weighing)
    return [{part: numbers[place].copy() for part, numbers in cut.items()} for place in range(len(ends))]


def _logs(index: WindowIndex, numbers: Mapping[Part, np.ndarray]) -> np.ndarray:
    """Compare one window with every window of an index, as at each hop."""
    return index.distances([Signature(numbers, np.zeros(len(index.basis.directions.T)), 0.1, 0.5, 0.5)])[0].logs


def _guessed(index: WindowIndex, clips: Sequence[Clip]) -> list[str]:
    """Name the class that is nearest to each motion, in the mean of its windows."""
    weighing = index.comparison.weighing
    named = [[named_and_alone(_logs(index, one), weighing)[0] for one in _numbers(index, clip)] for clip in clips]
    return [index.classes[int(np.mean(each, axis=0).argmin())] for each in named]


def _assert_same_windows(index: WindowIndex, other: WindowIndex) -> None:
    """Demand the same windows, but for one step of half precision: processors sum in different orders."""
    assert index.motions.tolist() == other.motions.tolist()
    for one, another in zip((*index.vectors, index.eigenvectors), (*other.vectors, other.eigenvectors), strict=True):
        np.testing.assert_allclose(one, another, rtol=2.0**-10, atol=1e-6)


# --- kinds of libraries ------------------------------------------------------------------------------------------


def test_a_motion_too_short_for_a_window_stays(people: MotionLibrary) -> None:
    """It is in the library, and no window is its; a library without any window cannot be opened."""
    short = replace(people.motions[0].moved_to(people.motions[0].positions[:6]), class_name="blink")
    index = WindowIndex.of(replace(people, motions=(short, *people.motions)))
    assert index.library.motions[0] is short
    assert 0 not in index.motions
    assert "blink" in set(index.library.classes) - set(index.classes)
    with pytest.raises(ValueError, match="long enough for a window"):
        WindowIndex.of(replace(people, motions=tuple(each.moved_to(each.positions[:4]) for each in people.motions)))


def test_who_teaches_a_library(builtin: MotionLibrary, small_library: MotionLibrary, sticks: MotionLibrary) -> None:
    """Three persons who share classes teach their library; else the built-in persons do, if they have its joints."""
    assert teacher_of(small_library) is small_library
    alone = small_library.without(actors=("dg", "mm"))
    wanted = set(zip(small_library.classes, small_library.actors, strict=True))
    apart = tuple(clip for clip in small_library.motions if (clip.class_name, clip.actor) in wanted)
    for library in (alone, replace(small_library, motions=apart)):
        assert teacher_of(library).actors == builtin.actors
    assert teacher_of(sticks) is sticks
    fewer = alone.skeleton.restricted_to(range(20))
    turned = Skeleton(fewer.joints[::-1])
    motions = tuple(clip.restricted_to(fewer.joints).as_of(turned) for clip in alone.motions)
    for library in (alone.restricted_to(joints_of("kinectv2")), MotionLibrary(turned, motions)):
        taught = teacher_of(library)
        assert taught.actors == builtin.actors
        assert taught.skeleton.joints == library.skeleton.joints


def test_large_libraries_are_opened_in_pieces_and_taught_by_some_windows(
    people_index: WindowIndex, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In pieces all windows are as in one; metrics of every third window name as those of all."""
    people = people_index.library
    alone = people.without(actors=("bb",))
    whole = WindowIndex.of(alone, people)
    monkeypatch.setattr("kinespace.library.windows.cutting._PIECE", 7)
    pieces = WindowIndex.of(alone, people)
    assert pieces.motions.tolist() == whole.motions.tolist()
    for one, other in zip((*pieces.vectors, pieces.eigenvectors), (*whole.vectors, whole.eigenvectors), strict=True):
        np.testing.assert_allclose(np.abs(one), np.abs(other), atol=2e-3)
    monkeypatch.setattr("kinespace.library.windows.taught._MAX_LESSONS", len(people_index) // 3)
    fewer, some = WindowIndex.of(people), people.motions[::3]
    assert fewer.motions.tolist() == people_index.motions.tolist()
    assert not np.array_equal(fewer.vectors[0], people_index.vectors[0])
    assert _guessed(fewer, some) == [clip.class_name for clip in some]


def test_motions_added_are_as_if_opened_with_them(people_index: WindowIndex) -> None:
    """Where others teach, every window is the same, added at once or one by one, and derived from the first index."""
    alone = people_index.library.without(actors=("bb",))
    clips = [replace(stick_clip("jump", seed=seed, frames=100), class_name="duck") for seed in (40, 41)]
    first = WindowIndex.of(alone, people_index.library)
    index, anew = first.with_motions(clips), WindowIndex.of(alone.with_motions(clips), people_index.library)
    assert index.classes == anew.classes == ("bow", "duck", "jump", "wave")
    assert len(index.library) == len(alone) + 2
    _assert_same_windows(index, anew)
    one_by_one = first.with_motions(clips[:1]).with_motions(clips[1:])
    _assert_same_windows(one_by_one, index)
    assert one_by_one.base is first
    assert len(first.with_motions(clips[:1]).with_motions(clips[1:], every=0.1)) > len(index)
    for learned in ("comparison", "basis", "rejection"):
        assert getattr(index, learned) is getattr(first, learned)


# --- derived indices ---------------------------------------------------------------------------------------------


def test_a_motion_that_stands_twice_keeps_its_windows_twice(people: MotionLibrary) -> None:
    """A library may be made of the same clip twice; and one cannot be added nothing."""
    index = WindowIndex.of(replace(people, motions=(people.motions[0], *people.motions)))
    windows = np.bincount(index.motions)
    assert windows[0] == windows[1]
    added = index.with_motions([people.motions[1]])
    assert np.bincount(added.motions).tolist() == [*windows.tolist(), windows[2]]
    with pytest.raises(ValueError, match="expected at least one"):
        index.with_motions([])


def test_views_by_fewer_joints(people: MotionLibrary) -> None:
    """They are the windows of the library restricted to these joints, kept without their frames, and kept open."""
    index, joints = WindowIndex.of(people), STICK.joints[:5]
    assert not has_view(index, joints)
    view = by_joints(index, joints)
    assert has_view(index, joints)
    assert by_joints(index, [*joints]) is view
    # By several threads sums differ in their last digit, and so may the sign of an axis.
    with threadpool_limits(1):
        _assert_same_windows(view, WindowIndex.of(people.restricted_to(joints)))
    assert {motion.frames for motion in view.library.motions} == {2}
    assert view.framed.motions[3].frames == people.motions[3].frames
    assert len(view.segments.parents) == len(joints)
    assert set(view.phases.classes) == {*STICK_CLASSES}
    other = STICK.joints[1:]
    assert by_joints(view, other) is by_joints(index, other)
    clip = replace(stick_clip("jump", seed=40, frames=100), class_name="taught", actor="")
    added = index.with_motions([clip])
    _assert_same_windows(by_joints(added, joints), view.with_motions([clip.restricted_to(joints)]))
    assert by_joints(added, joints).basis is view.basis
    _assert_same_windows(by_joints(index.of_some([1, 2, 20]), joints), view.of_some([1, 2, 20]))
    with pytest.raises(SkeletonMismatchError, match="expected at least 5"):
        by_joints(index, joints[:4])


def test_only_so_many_views_are_kept(people: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """The view that was opened longest ago makes room."""
    monkeypatch.setattr("kinespace.library.windows.opening.MAX_VIEWS", 2)
    index = WindowIndex.of(people)
    sets = [tuple(name for name in STICK.joints if name != left_out) for left_out in STICK.joints[:3]]
    for each in sets:
        by_joints(index, each)
    assert [has_view(index, each) for each in sets] == [False, True, True]


@pytest.fixture(scope="module")
def clip(builtin: MotionLibrary) -> Clip:
    """Give the longest motion, at 30 frames a second: it is longer than every window."""
    longest = max(builtin.motions, key=lambda motion: motion.frames)
    return replace(longest, positions=longest.positions[::2], frame_rate=30.0)


def test_the_last_window_ends_with_the_motion(clip: Clip) -> None:
    """The others end every so many seconds before it, the first not before its time."""
    ends = window_ends(clip, 0.4, first=0.5)
    assert ends[-1] == clip.frames
    assert set(np.diff(ends)) == {12}
    assert 15 <= ends[0] < 15 + 12
    assert window_ends(clip.moved_to(clip.positions[:27]), 0.4, first=0.5).tolist() == [15, 27]


def test_the_shortest_motion_with_a_window(clip: Clip) -> None:
    """It lasts as long as the shortest window and has two frames; its only window is the whole motion."""
    for rate, frames, ends in ((30, 13, [13]), (30, 5, [5]), (30, 4, []), (3, 1, []), (3, 2, [2])):
        cut = replace(clip.moved_to(clip.positions[:frames]), frame_rate=float(rate))
        assert (cut.duration >= FIRST_WINDOW) == (frames != 4)
        assert window_ends(cut, 0.4, first=1.0).tolist() == ends


# --- basis and metrics in a library's file ----------------------------------------------------------------------------


BOTH = pytest.mark.parametrize("weighing", WEIGHINGS.values(), ids=WEIGHINGS)


@pytest.fixture(scope="module")
def rounded(tmp_path_factory: pytest.TempPathFactory) -> MotionLibrary:
    """Give a library that three people teach, rounded as a file rounds it."""
    path = tmp_path_factory.mktemp("people") / "people.npz"
    MotionLibrary.of_clips(stick_clips(actors=("aa", "bb", "cc"))).save(path)
    return MotionLibrary.load(path)


@pytest.fixture(scope="module")
def keeping(rounded: MotionLibrary) -> MotionLibrary:
    """Give this library with the numbers learned from its motions."""
    return keeping_lessons(rounded)


@BOTH
def test_kept_numbers_are_the_learned_ones(
    rounded: MotionLibrary, keeping: MotionLibrary, weighing: Weighing, tmp_path: Path
) -> None:
    """A library that keeps its lessons, also in a file, has the windows, number for number, that it would learn."""
    keeping.save(tmp_path / "kept.npz")
    read = MotionLibrary.load(tmp_path / "kept.npz")
    assert kept_of(read, weighing) is not None
    learned = WindowIndex.of(rounded, rounded, weighing)
    for library in (keeping, read):
        kept = WindowIndex.of(library, library, weighing)
        for name in ("directions", "weights"):
            assert np.array_equal(getattr(kept.basis, name), getattr(learned.basis, name))
        assert kept.basis.share == pytest.approx(learned.basis.share, abs=1e-7)
        assert all(np.array_equal(*both) for both in zip(kept.vectors, learned.vectors, strict=True))
        assert np.array_equal(kept.eigenvectors, learned.eigenvectors)


@pytest.mark.slow
@BOTH
def test_the_built_in_file_keeps_its_metrics(builtin: MotionLibrary, weighing: Weighing) -> None:
    """Its windows are as far from each other as in metrics learned here; processors round differently."""
    kept = WindowIndex.of(builtin, builtin, weighing)
    learned = WindowIndex.of(replace(builtin, learned={}), weighing=weighing)
    assert kept_of(builtin, weighing) is not None
    none, ask, again = np.zeros(len(kept), dtype=np.bool_), kept.asked_by, learned.asked_by
    for window in range(0, len(kept), 197):
        np.testing.assert_allclose(ask(window, none), again(window, none), atol=0.05, err_msg=str(window))


def test_other_motions_teach_anew(keeping: MotionLibrary) -> None:
    """A library of other motions, classes, joints or weighing keeps nothing, nor does one with changed motions."""
    across = WEIGHINGS["across"]
    one, *others = keeping.motions
    without, some = (
        keeping.without(motions=[one]),
        ((), (replace(one, actor="somebody"),), (one.moved_to(one.positions + 0.001),)),
    )
    changed = [without, keeping.with_motions([one]), keeping.renamed({one.class_name: "other"})]
    changed += [keeping.restricted_to(keeping.skeleton.joints[:5]), keeping.merged_with(without)]
    changed += [replace(keeping, motions=(*each, *others)) for each in some]
    assert all(kept_of(each, across) is None for each in changed)
    assert kept_of(keeping, replace(across, first=1.0)) is None
    assert kept_of(replace(keeping, learned={}), across) is None
    # Numbers that hold for other motions too stay; the file of a derived library is not made larger for nothing.
    numbers = {**keeping.learned, "offset": np.ones(1, dtype=np.float32)}
    assert list(replace(keeping, learned=numbers).without(motions=[one]).learned) == ["offset"]


DIRECTIONS, AXES = (rf"\(15, at most {most}\) numbers, got \(" for most in (32, 128))


@pytest.mark.parametrize(
    ("name", "array", "said"),
    [
        ("basis weights", None, r"\(15,\) numbers, got none"),
        ("basis weights", np.ones(3), r"\(15,\) numbers, got \(3,\)"),
        ("basis share", np.ones(2), r"\(1,\) numbers, got \(2,\)"),
        *(("basis directions", np.ones(shape), DIRECTIONS) for shape in ((3, 2), (15, 33), (15, 0), 15, (15, 2, 2))),
        ("basis directions", None, r"\(15, at most 32\) numbers, got none"),
        *(("across posture 0.25 s axes", np.ones(shape), AXES) for shape in ((3, 2), (15, 129), (15, 0))),
        ("across posture 0.25 s origin", np.ones(3), r"\(15,\) numbers, got \(3,\)"),
        ("across posture 0.25 s origin", np.ones((1, 15)), r"\(15,\) numbers, got \(1, 15\)"),
    ],
)
def test_arrays_that_do_not_fit(keeping: MotionLibrary, name: str, array: np.ndarray | None, said: str) -> None:
    """An array of another shape raises ValueError with its name, the expectation and the value found."""
    arrays = {each: kept for each, kept in keeping.learned.items() if each != f"{TAUGHT}{name}"}
    if array is not None:
        arrays[f"{TAUGHT}{name}"] = array.astype(np.float32)
    with pytest.raises(ValueError, match=f"{TAUGHT}{name}: expected {said}"):
        kept_of(replace(keeping, learned=arrays), WEIGHINGS["across"])
