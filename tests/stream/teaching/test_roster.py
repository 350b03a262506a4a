from dataclasses import replace

import numpy as np
import pytest
from programs import motions_of
from synthetic import gesture, stick_clip, stick_clips

from kinespace.library import Clip, MotionLibrary, WindowIndex, by_joints, opened
from kinespace.library.windows.courses import Courses
from kinespace.stream.teaching import movement as moving
from kinespace.stream.teaching.examples import Check, Example, Roster, TaughtWindows, checked
from kinespace.stream.teaching.movement import Movement, MovementMeter, StretchFinder

#: What is said of two classes that cannot be told apart.
CHANGE = "do one of the two with the other arm, in another direction, or larger, and teach it anew"


def _example(number: int, class_name: str, motion: Clip) -> Example:
    return Example(number, class_name, motion, 0.0, motion.duration)


def _roster(*taught: tuple[str, str, int]) -> Roster:
    """Teach classes by motions: (class, HDM05's class, which)."""
    roster = Roster()
    for name, shown, which in taught:
        roster = roster.with_example(_example(roster.next_number, name, motions_of(shown)[which]))
    return roster


def test_a_roster_comes_back_from_its_file(tmp_path: object) -> None:
    """The class taught first is the first one again, whatever its name."""
    roster = _roster(("zoo", "squat1Reps", 0), ("abc", "kickLFront1Reps", 0), ("zoo", "squat1Reps", 1))
    library = roster.library()
    path = tmp_path / "mine.npz"  # type: ignore[operator]
    library.save(path)
    again = Roster.of_library(MotionLibrary.load(path))
    assert [(each.number, each.class_name) for each in again.examples] == [(1, "zoo"), (2, "abc"), (3, "zoo")]
    assert all((each.begin, each.end) == (0.0, each.recording.duration) for each in again.examples)


@pytest.mark.slow
@pytest.mark.parametrize(("with_base", "either_side"), [(False, False), (True, True)])
def test_what_must_not_be_said_lowers_limits(*, with_base: bool, either_side: bool, small_index: WindowIndex) -> None:
    """Courses that are kept from change to change are those of a library opened anew; undone examples count no more."""
    windows = TaughtWindows(small_index, with_base=with_base, either_side=either_side)
    first = _roster(("squat", "squat1Reps", 0), ("kick", "kickLFront1Reps", 0))
    second = first.with_example(_example(3, "nothing", motions_of("squat1Reps")[1]))
    third = second.with_example(_example(4, "nothing", motions_of("kickLFront1Reps")[1]))
    more = third.with_example(_example(5, "kick", motions_of("kickLFront1Reps")[2]))
    for roster in (first, second, third, first, third, more):
        index = windows.index_of(roster)
        anew = Courses.of([index.library.motions[place] for place in np.unique(index.motions).tolist()])
        assert index.courses.classes == anew.classes
        # Windows that are compared together are rounded otherwise.
        assert index.courses.limits == pytest.approx(anew.limits, abs=1e-6)
        assert index.courses.crossed == pytest.approx(anew.crossed, rel=1e-4, nan_ok=True)
    low, high = (windows.index_of(each) for each in (third, first))
    assert low.courses.limits.min() < 0.9 * high.courses.limits.min()


@pytest.mark.slow
def test_windows_of_undone_examples_are_forgotten(people_index: WindowIndex) -> None:
    """Of examples that were taught and undone eleven are kept at most; one taught again is compared as before."""
    windows, motion = TaughtWindows(people_index, with_base=True), stick_clip("wave", frames=120)
    first, *_ = indices = [
        windows.index_of(Roster((Example(number, "mine", motion, 0.0, 1.0),))) for number in (*range(1, 16), 1)
    ]
    assert len(windows._known) <= 11  # noqa: SLF001 - unseen
    for index in indices:
        assert index.classes == first.classes
        for mine, other in zip(index.vectors, first.vectors, strict=True):
            np.testing.assert_array_equal(mine, other)


@pytest.mark.slow
@pytest.mark.parametrize("beside", [False, True])
def test_the_first_example_finds_fewer_joints_opened(beside: bool) -> None:  # noqa: FBT001
    """For a body of fewer joints the base is opened before the first example, and an undo opens nothing."""
    base = WindowIndex.of(MotionLibrary.of_clips(stick_clips(actors=("aa", "bb", "cc"))))
    windows, joints = TaughtWindows(base, with_base=beside), base.library.skeleton.joints[:-1]
    example = Example(1, "mine", stick_clip("wave", frames=120), 0.0, 1.0)
    indices = [windows.index_of(roster) or base for roster in (Roster(), Roster((example,)), Roster())]
    fewer = [by_joints(index, joints) for index in indices]
    known = {*base.classes} if beside else set()
    for index, classes in zip(fewer, (set(base.classes), known | {"mine"}, set(base.classes)), strict=True):
        assert index.library.skeleton.joints == joints
        assert index.basis is fewer[0].basis
        assert set(index.classes) == classes


def test_a_check_compares_an_example_with_its_own_and_the_other_classes() -> None:
    """A kick among squats is as another's kick, and unlike them; with fewer than three of a class nobody knows."""
    windows = TaughtWindows(opened(MotionLibrary.builtin()), with_base=False)
    squats = [("a", "squat1Reps", which) for which in range(3)]
    index = windows.index_of(_roster(*squats, ("a", "kickLFront1Reps", 0), ("b", "kickLFront1Reps", 1)))
    windows_of_each = [10 * each.duration - 5 for each in index.library.motions]
    assert np.bincount(index.motions) == pytest.approx(windows_of_each, abs=1)
    found = [checked(index, number) or Check(0, "", 0) for number in range(1, 6)]
    assert [each.share_at_risk for each in found] == [0, 0, 0, 1, 0]
    assert [each.nearest for each in found] == ["b"] * 4 + ["a"]
    assert [each.to_own for each in found] == pytest.approx([0.9, 0.9, 1.2, 5.6, np.nan], abs=0.1, nan_ok=True)
    assert checked(index, 9) is None
    for count, alike in ((2, [np.nan] * 3), (3, [0.9, 0.9, 1.2, np.nan])):
        index = windows.index_of(_roster(*squats[:count], ("b", "kickLFront1Reps", 0)))
        found = [checked(index, number) or Check(0, "", 0) for number in range(1, count + 2)]
        assert [each.to_own for each in found] == pytest.approx(alike, abs=0.1, nan_ok=True)


@pytest.mark.parametrize(
    ("check", "words"),
    [
        (Check(0.0, "a", float("nan")), "good"),
        (Check(0.05, "a", 1.0), "good"),
        (Check(0.06, "a", 9.0), "close to a"),
        (Check(0.51, "a", 1.0), f"cannot be told from a: {CHANGE}"),
        (
            Check(0.51, "nothing", 1.0),
            "cannot be told from nothing: undo `nothing` if this gesture is in it, or show a larger one",
        ),
        (Check(0.05, "a", float("nan"), is_first=True), "good so far: show it again to be sure"),
        (Check(0.0, "", float("nan"), is_first=True), "good so far: show it again to be sure"),
        (Check(0.0, "a", 2.1), "unlike your other examples: show it as you will do it, or undo it"),
        (Check(1.0, "", 1.0), "good"),
    ],
)
def test_a_check_in_words(check: Check, words: str) -> None:
    """Every outcome of the check has the words of the page."""
    assert check.words == words


@pytest.mark.slow
def test_an_example_of_either_side_is_compared_mirrored_too(small_index: WindowIndex) -> None:
    """Its copy is in the index, no other example to a check, and not in the roster; without it a left kick is none."""
    roster = _roster(("kick", "kickLFront1Reps", 0), ("squat", "squat1Reps", 0), ("squat", "squat1Reps", 1))
    for base, known in ((small_index, True), (small_index, False), (None, False)):
        plain, both = (TaughtWindows(base, with_base=known, either_side=on).index_of(roster) for on in (False, True))
        taught = [motion for motion in both.library.motions if motion not in (base.library.motions if base else ())]
        assert len(taught) == 2 * len(roster.examples)
        assert len(both.library.motions) == len(plain.library.motions) + len(roster.examples)
    windows = TaughtWindows(small_index, with_base=False, either_side=True)
    index, plain = windows.index_of(roster), TaughtWindows(small_index, with_base=False).index_of(roster)
    for number in (1, 2, 3):
        ours, theirs = checked(index, number), checked(plain, number)
        assert ours.is_first == theirs.is_first
    fewer = windows.index_of(roster.without_class("squat"))
    assert [motion.take for motion in fewer.library.motions] == ["0001", "0001 mirrored"]


def test_relative_movement_is_the_textbook_formula() -> None:
    """Deviation over distance, less the noise that second differences tell, row by row."""
    rows = 1 + np.random.default_rng(2).normal(0, 0.1, (7, 5))
    mean = [sum(rows[:, pair]) / 7 for pair in range(5)]
    swing = sum((rows[frame, pair] - mean[pair]) ** 2 for frame in range(7) for pair in range(5)) / 7
    bends = sum(
        (rows[frame + 1, pair] - 2 * rows[frame, pair] + rows[frame - 1, pair]) ** 2
        for frame in range(1, 6)
        for pair in range(5)
    )
    expected = max(swing - bends / 5 / 6, 0) / sum(each**2 for each in mean)
    assert moving.relative_movement(rows) == pytest.approx(expected**0.5)


def test_hysteresis() -> None:
    """Between the two thresholds no motion begins and none ends; too short a movement or stillness changes nothing."""
    finder, found, began = StretchFinder(0.01), {}, {}
    shown = ((30, 0.0199), (3, 0.02), (3, 0.0), (30, 0.02), (30, 0.0101), (14, 0.01), (1, 0.0101), (20, 0.01))
    for step, movement in enumerate(movement for count, movement in shown for _ in range(count)):
        found[step], began[step] = finder.push(step / 30, Movement(movement)), finder.began
    assert {step: each for step, each in found.items() if each} == {125: pytest.approx((1.1, 110 / 30 - 0.1))}
    assert {step for step, each in began.items() if each == 1.2} == set(range(39, 125))
    assert set(began.values()) == {None, 1.2}


def test_a_limb_begins_a_motion_that_the_whole_body_does_not() -> None:
    """The nod of a head moves the whole body by less than it trembles; the head alone begins it."""
    nod = gesture("nod")
    assert moving.moved_at_all(nod) == (pytest.approx(1.0, abs=0.35), pytest.approx(3.0, abs=0.2))
    meter = MovementMeter(nod.skeleton)
    movements = [each for time, body in zip(nod.times, nod.positions, strict=True) if (each := meter.push(time, body))]
    assert max(each.body for each in movements) < 0.01 < max(each.limb for each in movements)


@pytest.mark.parametrize("name", ["nod", "hand wave", "bow"])
@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_a_small_gesture_begins_after_standing(name: str, noise: float) -> None:
    """The trembling of the second before says how little is needed; a feed that trembles by 2 mm is still quiet."""
    shown = gesture(name)
    trembling = noise * np.random.default_rng(0).normal(size=shown.positions.shape)
    meter, standing, began = MovementMeter(shown.skeleton), list[tuple[float, Movement]](), list[float]()
    finder = StretchFinder()
    for time, body in zip(shown.times.tolist(), shown.positions + trembling, strict=True):
        movement = meter.push(time, body)
        if movement and time < 1:
            standing.append((time, movement))
            finder = StretchFinder(moving.stillness_of(standing))
        elif movement:
            finder.push(time, movement)
            began += [finder.began] if finder.began is not None else []
    assert 1.0 < began[0] < 1.5


def test_the_limb_speed_is_that_of_its_joint() -> None:
    """One of four joints goes at a steady speed against the others; the joint not seen does not matter."""
    corners = np.array([[0, 0, 0], [0, 2, 0], [1, 0, 0], [1, 2, 0], [9, 9, 9]], dtype=float)
    times, bodies = np.arange(7) / 30, np.repeat(corners[None], 7, axis=0)
    bodies[:, 0, 2] = 0.3 * times
    bodies[3, 4] = np.nan
    # The centre goes along with a quarter of the speed; in such a body the mean squared distance is 10/3.
    assert moving.limb_speed(times, bodies) == pytest.approx(0.3 * 0.75 / (10 / 3) ** 0.5, rel=1e-3)


def test_a_joint_that_jumps_begins_no_motion() -> None:
    """A depth sensor's joints jump for a moment; a limb counts after a tenth of a second."""
    nod = gesture("nod")
    standing = np.repeat(nod.positions[:1], 120, axis=0)
    standing[60:64, 18] += 0.1
    assert [*moving.moved_in(replace(nod, positions=standing))] == []
