"""Joints that cannot be believed: mended or left out."""

import numpy as np
import pytest
from numpy.typing import NDArray
from performed import pushed, shown
from synthetic import STICK

from kinespace.library import Clip, MotionLibrary, WindowIndex, opened
from kinespace.stream import EventKind, Outcome, Recognition, Recognizer, Settings
from kinespace.stream.recognizer.joints.mending import BELIEVED_AFTER, HELD, Joints
from kinespace.stream.recognizer.settings import threshold_for
from kinespace.tools.feeding.feed import resampled

RATE = 30.0
ARM = ("lhumerus", "lradius", "lwrist", "lhand", "lthumb", "lfingers")


@pytest.fixture(scope="module")
def squat(small_library: MotionLibrary) -> Clip:
    """Give a squat at 30 frames a second."""
    return resampled(next(m for m in small_library.motions if m.class_name.startswith("squat")), RATE)


@pytest.fixture(scope="module")
def sound(small_library: MotionLibrary, squat: Clip) -> list[Recognition]:
    """Give the answers to the squat as it is."""
    return _played(Recognizer(small_library), squat.positions)


def _played(recognizer: Recognizer, positions: NDArray[np.float64]) -> list[Recognition]:
    return pushed(recognizer, shown(positions, RATE, begin=1.0))


def _places(library: MotionLibrary, *names: str) -> list[int]:
    return [library.skeleton.joints.index(name) for name in names]


@pytest.mark.slow
def test_answers_are_implausible_until_fewer_joints_windows_are_ready(
    small_library: MotionLibrary, squat: Clip, sound: list[Recognition]
) -> None:
    """While the windows of fewer joints are not open every hop is answered; then they hold the last seconds at once."""
    positions, lost = squat.positions.copy(), _places(small_library, "lthumb")
    positions[:, lost] = np.nan
    joints = tuple(np.delete(small_library.skeleton.joints, lost).tolist())
    view = opened(small_library).by_joints(joints)
    whole = _played(Recognizer(view), np.delete(squat.positions, lost, axis=1))
    asked = list[tuple[str, ...]]()

    def views(index: WindowIndex, joints: tuple[str, ...]) -> WindowIndex | None:
        asked.append(joints)
        return index.by_joints(joints) if len(asked) > 10 else None

    recognizer = Recognizer(small_library, views=views)
    answers = _played(recognizer, positions)
    assert {*asked} == {joints}
    # Less is named where a joint is missing than where there never was one.
    fewer = recognizer._fewer  # noqa: SLF001 - the limit itself
    assert fewer.threshold > threshold_for(view, Settings())
    assert len(answers) == len(whole) == len(sound)
    assert any(answer.outcome is Outcome.IMPLAUSIBLE for answer in answers)
    assert answers[-1].scores == pytest.approx(whole[-1].scores, abs=1e-6)

    def none(_: WindowIndex, joints: tuple[str, ...]) -> None:
        raise ValueError(f"no motion shows these {len(joints)} joints")

    answers = _played(Recognizer(small_library, views=none), positions)
    assert len(answers) == len(sound)
    assert answers[-1].outcome is Outcome.IMPLAUSIBLE


@pytest.mark.parametrize("fault", ["sides", "unit"])
def test_changes_in_mid_stream_are_corrected(
    small_library: MotionLibrary, squat: Clip, sound: list[Recognition], fault: str
) -> None:
    """Sides exchanged and a unit changed from one frame on, and back, give the answers of a sound feed."""
    positions, mirrored = squat.positions.copy(), opened(small_library).segments.mirrored
    assert mirrored is not None
    changed = slice(squat.frames // 3, 2 * squat.frames // 3)
    positions[changed] = positions[changed][:, mirrored] if fault == "sides" else 1000 * positions[changed]
    recognizer = Recognizer(small_library)
    answers = _played(recognizer, positions)
    for answer, expected in zip(answers, sound, strict=True):
        assert answer.label == expected.label
        assert answer.scores == pytest.approx(expected.scores, abs=0.02)
    assert ("left and right" if fault == "sides" else "the unit changed") in recognizer.doubt
    joints = recognizer._joints  # noqa: SLF001 - what it corrects now
    assert (joints._mirrored, joints._factor) == (False, pytest.approx(1.0, rel=0.01))  # noqa: SLF001 - as above


@pytest.mark.parametrize("every", [0.4, 1.1])
def test_a_sensor_that_loses_the_body_now_and_then_is_answered(
    small_library: MotionLibrary, squat: Clip, every: float
) -> None:
    """A trembling body that leaps by 40 cm at each joint and moves between is never implausible; no answer is lost."""
    generator = np.random.default_rng(3)
    positions = np.concatenate([squat.positions, squat.positions[::-1]])
    positions += 0.02 * generator.standard_normal(positions.shape)
    leaps = (np.arange(len(positions)) / RATE // every).astype(int)
    leapt = 0.23 * generator.standard_normal((leaps.max() + 1, *positions.shape[1:]))[leaps]
    recognizer = Recognizer(small_library)
    answers = _played(recognizer, positions + leapt * (leaps % 2)[:, None, None])
    assert "jumped" in recognizer.doubt
    assert len(answers) == len(_played(Recognizer(small_library), positions))
    assert not any(answer.is_doubted for answer in answers)


def test_after_a_jump_of_a_rigid_body_the_windows_begin_anew(small_library: MotionLibrary, squat: Clip) -> None:
    """A second motion that is shown from one frame to the next is recognised as if it were the first."""
    kick = resampled(next(m for m in small_library.motions if m.class_name.startswith("kick")), RATE)
    both = np.concatenate([squat.positions, kick.positions + np.array([3.0, 0.0, 1.0])])
    alone = _played(Recognizer(small_library), kick.positions)
    after = _played(Recognizer(small_library), both)[-len(alone) :]
    assert [answer.scores.tolist() for answer in after] == [pytest.approx(answer.scores.tolist()) for answer in alone]


def _two_exchanged(squat: Clip, library: MotionLibrary) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give a squat, as it stands and a metre and a half aside, going on where a kick was shown before: as exchanged."""
    kick = resampled(next(m for m in library.motions if m.class_name.startswith("kick")), RATE)
    aside = squat.positions + np.array([1.5, 0.0, 0.0]) + kick.positions[-1, 0] - squat.positions[0, 0]
    return np.concatenate([kick.positions, aside]), aside


@pytest.mark.parametrize("tremble", [0.0, 0.02])
def test_a_body_in_another_bodys_place_begins_anew(small_library: MotionLibrary, squat: Clip, tremble: float) -> None:
    """Said; the motion that goes on ends; the answers are the new body's alone, whether or not the feed trembles."""
    both, aside = _two_exchanged(squat, small_library)
    both += tremble * np.random.default_rng(4).standard_normal(both.shape)
    recognizer = Recognizer(small_library)
    answers, alone = _played(recognizer, both), _played(Recognizer(small_library), both[-len(aside) :])
    exchanged = 1 + (len(both) - len(aside)) / RATE
    assert recognizer.doubt == f"joints: the whole body jumped at {exchanged:.2f} s"
    after = [answer for answer in answers if answer.time >= exchanged]
    assert [answer.scores.tolist() for answer in after] == [pytest.approx(each.scores.tolist()) for each in alone]
    if not tremble:
        first = next(event for answer in answers for event in answer.events if event.kind is EventKind.END)
        assert first.label.startswith("kick")
        assert first.time == pytest.approx(exchanged, abs=1 / RATE)


def test_a_body_of_another_size_in_its_place_is_no_change_of_unit(small_library: MotionLibrary, squat: Clip) -> None:
    """A child half as large begins again; the feed's unit is not put right for it."""
    both = np.concatenate([squat.positions, 0.5 * squat.positions + np.array([2.0, 0.0, 0.0])])
    recognizer = Recognizer(small_library)
    _played(recognizer, both)
    assert recognizer._joints._factor == 1.0  # noqa: SLF001 - what it corrects now
    assert "the whole body jumped" in recognizer.doubt


def test_a_body_that_is_elsewhere_all_the_time_is_implausible(small_library: MotionLibrary, squat: Clip) -> None:
    """By metres at each frame; two seconds after the last such step, the feed is answered again."""
    positions = np.concatenate([squat.positions, *[squat.positions[::-1], squat.positions] * 2])
    places = 3.0 * np.random.default_rng(5).standard_normal((len(positions), 1, 3))
    places[len(squat.positions) :] = 0.0
    recognizer = Recognizer(small_library)
    answers = _played(recognizer, positions + places)
    before = [each for each in answers if each.time < 1 + squat.frames / RATE]
    assert {each.outcome for each in before[1:]} == {Outcome.IMPLAUSIBLE}
    assert answers[-1].outcome is not Outcome.IMPLAUSIBLE


def test_a_body_that_is_carried_is_no_jump(small_library: MotionLibrary, squat: Clip, sound: list[Recognition]) -> None:
    """At 10 m/s, as in a vehicle, and with frames that come in bursts; the answers are those of the body at rest."""
    travelled = 10.0 * np.arange(squat.frames)[:, None, None] / RATE * np.array([1.0, 0.0, 0.0])
    recognizer = Recognizer(small_library)
    answers = _played(recognizer, squat.positions + travelled)
    assert not recognizer.doubt
    assert [answer.label for answer in answers] == [answer.label for answer in sound]


def test_after_a_reset_another_body_may_follow(small_library: MotionLibrary, squat: Clip) -> None:
    """A segment did not stretch between the last frames of one body and the first of another with longer arms."""
    longer, (elbow, wrist) = squat.positions.copy(), _places(small_library, "lhumerus", "lradius")
    longer[:, _places(small_library, *ARM[1:])] += 4.0 * (squat.positions[:, [wrist]] - squat.positions[:, [elbow]])
    recognizer = Recognizer(small_library)
    # Fewer frames than a span has: those would be judged together with the next body's.
    _played(recognizer, squat.positions[:15])
    recognizer.reset()
    answers, fresh = _played(recognizer, longer), _played(Recognizer(small_library), longer)
    assert {answer.doubted for answer in fresh} == {()}
    assert [(answer.label, answer.doubted) for answer in answers] == [(answer.label, ()) for answer in fresh]


# --- joints alone ------------------------------------------------------------------------------------------------


def _mended(
    sticks: MotionLibrary, positions: NDArray[np.float64], *, watched: bool = True
) -> tuple[Joints, NDArray[np.float64]]:
    """Mend frames of a stick one by one, thirty a second."""
    memory, mended = np.empty((1, 6, 3)), positions.copy()
    joints = Joints(opened(sticks).segments, STICK.joints, memory, is_watched=watched)
    for index in range(len(positions)):
        memory[0] = positions[index]
        joints.mend([index / RATE])
        mended[index] = memory[0]
    return joints, mended


@pytest.mark.parametrize("none", [np.nan, 0.0])
@pytest.mark.parametrize("watched", [True, False])
def test_lost_joints_are_where_they_were_beside_their_parents(
    sticks: MotionLibrary, none: float, *, watched: bool
) -> None:
    """One by one from the root; a joint whose parent is lost too moves with what is left; at first all are in one."""
    if not none and not watched:
        return  # where joints are not watched the origin is a place like any other
    positions = np.tile(sticks.motions[0].positions[:1], (4, 1, 1)) + np.arange(4)[:, None, None] * 0.01
    lost = positions.copy()
    lost[2:, [1, 2]] = none
    _, mended = _mended(sticks, lost, watched=watched)
    np.testing.assert_allclose(mended, positions)
    lost[0, 3] = np.nan
    _, mended = _mended(sticks, lost, watched=watched)
    np.testing.assert_allclose(mended[0, 3], positions[0, 1])
    lost[0] = np.nan
    _, mended = _mended(sticks, lost, watched=watched)
    assert not mended[0].any()
    # Without a parent that is known a joint stays where it was; at first it is in the middle of the others.
    lost[0] = positions[0]
    lost[0, 0] = np.nan
    assert _mended(sticks, lost, watched=watched)[1][0, 0] == pytest.approx(positions[0, 1:].mean(axis=0))


def test_zeros_near_the_origin_are_a_place(sticks: MotionLibrary) -> None:
    """Beside a lost joint zeros are lost, too, where they are of a joint that was more than 5 cm from the origin."""
    for away, is_lost in ((0.045, False), (0.055, True)):
        positions = np.tile(sticks.motions[0].positions[:1], (2, 1, 1))
        positions[:, 3] = away, 0.0, 0.0
        positions[1, 3], positions[1, 5] = 0.0, np.nan
        assert _mended(sticks, positions)[1][1, 3].any() == is_lost


def test_a_joint_lost_for_long_is_left_out_for_some_seconds(sticks: MotionLibrary) -> None:
    """It is believed again three seconds after it came back; with only half of the joints left none is named."""
    clip = np.concatenate([each.positions[::4] for each in sticks.motions[:8:3]] * 4)
    lost = np.tile(clip[:1], (150, 1, 1)) + 0.001 * np.sin(np.arange(150) / 5)[:, None, None]
    lost[10:20, 5] = np.nan
    for frames, left_out in ((15, ()), (10 + int(HELD * RATE), ()), (11 + int(HELD * RATE), (5,)), (100, (5,))):
        joints, _ = _mended(sticks, lost[:frames])
        assert joints.left_out == left_out, frames
    assert (joints.doubted, joints.believed) == (("foot",), STICK.joints[:5])
    joints, _ = _mended(sticks, lost)
    assert joints.left_out == ()
    assert 20 / RATE + BELIEVED_AFTER < 150 / RATE
    lost[10:20, 4:] = np.nan
    joints, _ = _mended(sticks, lost[:20])
    assert joints.believed == ()
    assert joints.note.startswith("joints: 2 of 6 where no body has them")
    joints.clear()
    assert (joints.left_out, joints.note) == ((), "")


def test_unwatched_joints_are_never_left_out(small_library: MotionLibrary, squat: Clip) -> None:
    """Without plausibility a frozen arm is believed, and a lost hand is held for as long as it is lost."""
    positions = squat.positions.copy()
    positions[:, _places(small_library, *ARM)] = np.nan
    recognizer = Recognizer(small_library, Settings(plausibility=False))
    answers = _played(recognizer, positions)
    assert {answer.doubted for answer in answers} == {()}
    assert not recognizer.doubt
    assert np.isfinite([answer.scores for answer in answers]).all()
