"""Joints that cannot be believed: mended or left out."""

from dataclasses import replace

import numpy as np
import pytest
from fakes import pushed, shown
from naive_courses import keeps_its_place, squares_about_mean, step_length, steps_between
from numpy.typing import NDArray
from synthetic import STICK

from kinespace.library import Clip, MotionLibrary, Skeleton, WindowIndex, by_joints, opened
from kinespace.library.signature.landmark_body import JOINTS, body_of
from kinespace.library.windows.segments import FLAT
from kinespace.stream import Announcement, Outcome, Performers, Recognition, Recognizer, Settings
from kinespace.stream.recognizer.carried import MAX_PAIRS, carried_by
from kinespace.stream.recognizer.fitting import NOTES, kind_of, kinds_of
from kinespace.stream.recognizer.joints import BELIEVED_AFTER, HELD, SAME_PLACE, Joints, Plausibility, steps_of
from kinespace.stream.recognizer.settings import sensitivity_for, threshold_for
from kinespace.tools.feeding.feed import resampled

RATE = 30.0
ARM = ("lhumerus", "lradius", "lwrist", "lhand", "lthumb", "lfingers")


@pytest.fixture(scope="module")
def squat(small_library: MotionLibrary) -> Clip:
    """Give a squat at 30 frames a second."""
    return resampled(next(m for m in small_library.motions if m.class_name.startswith("squat")), RATE)


def _played(recognizer: Recognizer, positions: NDArray[np.float64]) -> list[Recognition]:
    return pushed(recognizer, shown(positions, RATE, begin=1.0))


def _places(library: MotionLibrary, *names: str) -> list[int]:
    return [library.skeleton.joints.index(name) for name in names]


@pytest.mark.slow
def test_answers_are_implausible_until_fewer_joints_windows_are_open(small_library: MotionLibrary, squat: Clip) -> None:
    """While the windows of fewer joints are not open every hop is answered; then they hold the last seconds at once."""
    positions, lost = squat.positions.copy(), _places(small_library, "lthumb")
    positions[:, lost] = np.nan
    joints = tuple(np.delete(small_library.skeleton.joints, lost).tolist())
    view = by_joints(opened(small_library), joints)
    whole = _played(Recognizer(view), np.delete(squat.positions, lost, axis=1))
    asked = list[tuple[str, ...]]()

    def views(index: WindowIndex, joints: tuple[str, ...]) -> WindowIndex | None:
        asked.append(joints)
        return by_joints(index, joints) if len(asked) > 10 else None

    recognizer = Recognizer(small_library, views=views)
    answers = _played(recognizer, positions)
    assert {*asked} == {joints}
    # Less is named where a joint is missing than where there never was one.
    fewer = recognizer._fewer  # noqa: SLF001 - the limit itself
    assert fewer.threshold > threshold_for(view, Settings())
    assert len(answers) == len(whole) == len(_played(Recognizer(small_library), squat.positions))
    assert any(answer.outcome is Outcome.IMPLAUSIBLE for answer in answers)
    assert answers[-1].scores == pytest.approx(whole[-1].scores, abs=1e-6)

    def none(_: WindowIndex, joints: tuple[str, ...]) -> None:
        raise ValueError(f"no motion shows these {len(joints)} joints")

    answers = _played(Recognizer(small_library, views=none), positions)
    assert len(answers) == len(whole)
    assert answers[-1].outcome is Outcome.IMPLAUSIBLE


# --- joints alone ------------------------------------------------------------------------------------------------


def _mended(sticks: MotionLibrary, positions: np.ndarray, *, watched: bool = True) -> tuple[Joints, np.ndarray]:
    """Mend frames of a stick one by one, thirty a second."""
    memory, mended = np.empty((1, 6, 3)), positions.copy()
    joints = Joints(opened(sticks).segments, STICK.joints, memory, is_watched=watched)
    for index in range(len(positions)):
        memory[0] = positions[index]
        joints.mend([index / RATE])
        mended[index] = memory[0]
    return joints, mended


# Where joints are not watched the origin is a place like any other.
@pytest.mark.parametrize(("none", "watched"), [(np.nan, True), (np.nan, False), (0.0, True)])
def test_lost_joints_stay_beside_their_parents(sticks: MotionLibrary, none: float, *, watched: bool) -> None:
    """One by one from the root; a joint whose parent is lost too moves with what is left; at first all are in one."""
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
    assert (joints.doubted, joints.believed, joints.note) == (("foot",), STICK.joints[:5], "joints: done without foot")
    joints, _ = _mended(sticks, lost)
    assert joints.left_out == ()
    assert 20 / RATE + BELIEVED_AFTER < 150 / RATE
    lost[10:20, 4:] = np.nan
    joints, _ = _mended(sticks, lost[:20])
    assert joints.believed == ()
    assert joints.note.startswith("joints: 2 of 6 are not seen")
    joints.clear()
    assert (joints.left_out, joints.note) == ((), "")


FAST = 60.0
#: How many joints must step for a body of 31 to jump.
JUMPING = 6


@pytest.fixture(scope="module")
def kick(small_index: WindowIndex) -> Clip:
    """Give a kick at 60 frames a second."""
    kick = resampled(next(m for m in small_index.library.motions if m.class_name.startswith("kick")), FAST)
    return kick.moved_to(kick.positions.astype(np.float64))


def _watch(index: WindowIndex) -> Plausibility:
    return Plausibility(index.segments, len(index.library.skeleton.joints))


def _doubted(index: WindowIndex, positions: NDArray[np.float64]) -> set[str]:
    """Give the names of the joints that are doubted at some time."""
    watched, names, doubted = _watch(index), index.library.skeleton.joints, set[str]()
    watched.begin(positions[0])
    for place, frame in enumerate(positions):
        watched.look(place / FAST, frame)
        doubted |= {names[joint] for joint in watched.doubted}
    return doubted


def test_steps_equal_the_slow_twins(kick: Clip) -> None:
    """Of every joint; a lost one spoils the sum."""
    positions = kick.positions[:7].copy()
    steps, squares = steps_of(positions[0], positions[1:])
    pairs = [steps_between(*pair) for pair in zip(positions[:-1].tolist(), positions[1:].tolist(), strict=True)]
    np.testing.assert_allclose(steps, pairs)
    assert squares == pytest.approx(max(map(squares_about_mean, pairs)))
    positions[2:4, 5] = np.nan
    assert np.isnan(steps_of(positions[0], positions[1:])[1])


def test_no_jump_is_overlooked_for_its_small_sum(small_index: WindowIndex, kick: Clip) -> None:
    """The quick sum asks for a closer look whenever a sixth of the joints step as far as a jump."""
    watched, generator = _watch(small_index), np.random.default_rng(5)
    watched.begin(kick.positions[0])
    for _ in range(100):
        step = generator.normal(0.0, 0.03, 3) + generator.normal(0.0, 0.01, (31, 3))
        some = generator.choice(31, generator.integers(5, 9), replace=False)
        step[some] += generator.normal(0.0, 0.12, 3)
        squares = steps_of(np.zeros((31, 3)), step[None])[1]
        far = step_length(np.zeros((31, 3)).tolist(), step.tolist(), JUMPING) >= 0.12
        assert watched.may_jump(squares * watched._scale**2, 0.0) or not far  # noqa: SLF001 - in the library's metres
    # A body's own steps need no closer look.
    assert not watched.may_jump(steps_of(kick.positions[0], kick.positions[1:20])[1], 1 / FAST)
    assert watched.may_jump(np.nan, 0.0)


def test_a_jump_is_judged_by_the_step_of_the_twin(small_index: WindowIndex, kick: Clip) -> None:
    """A body jumps when its sixth farthest joint steps too far, unlike before; its own frames have no such step."""
    watched, still, both = _watch(small_index), np.zeros_like(kick.positions[0]), (1 / FAST, 1 / FAST)
    for before, after in ((0, 1), (0, kick.frames // 2), (3, kick.frames - 1)):
        step = kick.positions[after] - kick.positions[before]
        far = step_length(kick.positions[before].tolist(), kick.positions[after].tolist(), JUMPING)
        assert watched._step_length(step) == pytest.approx(far)  # noqa: SLF001 - compared with the twin
        assert watched.jumped((still, step), both) == (far >= 0.12)
        # A body that goes on as before does not jump, back and forth it does, and slowly it does not.
        assert not watched.jumped((step, step), both)
        assert watched.jumped((-step, step), both) == (far >= 0.12)
        assert not watched.jumped((still, step), (1 / FAST, far / 6.9))


def test_a_frozen_arm_is_doubted_and_nothing_else(small_index: WindowIndex, kick: Clip) -> None:
    """Joints that keep their place while the body moves are doubted; the twin says which keep it."""
    names, positions = small_index.library.skeleton.joints, kick.positions.copy()
    places = _places(small_index.library, *ARM)
    positions[:, places] = positions[0, places]
    kept = {name for joint, name in enumerate(names) if keeps_its_place(positions[:, joint].tolist(), SAME_PLACE)}
    assert _doubted(small_index, positions) == kept == {*ARM}
    # A body that stands still as a whole is not frozen; one whose unit is millimetres is judged alike, to 0.02 mm.
    assert not _doubted(small_index, np.repeat(kick.positions[:1], 60, axis=0))
    positions[:, places] += np.random.default_rng(2).uniform(0.0, 1.5e-5, (len(positions), len(places), 3))
    assert _doubted(small_index, 1000 * positions) == {*ARM}


@pytest.mark.parametrize("tremble", [0.0, 0.01])
def test_exchanged_wrists_are_doubted(small_index: WindowIndex, kick: Clip, tremble: float) -> None:
    """Two joints in each other's place are at the ends of the broken segments; a hand may go with them, no more."""
    pair = _places(small_index.library, "lwrist", "rwrist")
    positions = np.concatenate([kick.positions, kick.positions[::-1]])
    positions += tremble * np.random.default_rng(1).normal(size=positions.shape)
    positions[:, pair] = positions[:, pair[::-1]]
    hands = {f"{side}{name}" for side in "lr" for name in ("wrist", "hand", "thumb", "fingers")}
    doubted = _doubted(small_index, positions)
    assert {"lwrist", "rwrist"} <= doubted <= hands or (tremble and doubted <= hands)


@pytest.mark.parametrize("sides", ["l", "lr"])
def test_a_marker_that_slips_is_believed(small_index: WindowIndex, kick: Clip, sides: str) -> None:
    """A knee that moves on the skin by 15 cm, in one leg or in both by turns, is no reason to leave the leg out."""
    positions, times = kick.positions.copy(), np.arange(kick.frames) / FAST
    for side, phase in zip(sides, (0.0, 2.0), strict=False):
        hip, knee = _places(small_index.library, f"{side}hipjoint", f"{side}femur")
        along = positions[:, knee] - positions[:, hip]
        slip = 0.075 * np.sin(2 * np.pi * times + phase)
        positions[:, knee] += along * (slip / np.linalg.norm(along, axis=1))[:, None]
    assert not _doubted(small_index, positions)


def _to_and_fro(positions: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    return np.resize(np.concatenate([positions, positions[::-1]]), (frames, *positions.shape[1:]))


def _played_for(recognizer: Recognizer, positions: NDArray[np.float64], seconds: float, begin: float = 0.0) -> None:
    """Play a motion forth and back for some seconds."""
    pushed(recognizer, shown(_to_and_fro(positions, round(seconds * RATE)), RATE, begin=begin))


def _short_thighs(clip: Clip) -> NDArray[np.float64]:
    positions, places = clip.positions.copy(), clip.skeleton.joints.index
    for side in "lr":
        hip, knee = places(f"{side}hipjoint"), places(f"{side}femur")
        positions[:, knee] = 0.4 * clip.positions[:, knee] + 0.6 * clip.positions[:, hip]
    return positions


@pytest.mark.slow
def test_a_body_is_decided_on_after_seconds_of_movement(small_library: MotionLibrary, squat: Clip) -> None:
    """The library's own body is like it, another or a trembling one is not, a still one is not decided on."""
    recognizer = Recognizer(small_library)
    _played_for(recognizer, squat.positions, 2.0)
    assert recognizer.fitting.unlike is None
    _played_for(recognizer, squat.positions, 2.0, 2.0)
    assert recognizer.fitting.unlike is False
    recognizer.reset()
    _played_for(recognizer, np.repeat(_short_thighs(squat)[:1], 2, axis=0), 10.0)
    assert recognizer.fitting.unlike is None
    _played_for(recognizer, _short_thighs(squat), 10.0, 10.0)
    assert recognizer.fitting.unlike is True
    recognizer.reset()
    clean = _to_and_fro(squat.positions, round(7 * RATE))
    _played(recognizer, clean + 0.04 * np.random.default_rng(3).standard_normal(clean.shape))
    assert recognizer.fitting.unlike is True


@pytest.mark.parametrize("seed", range(5))
def test_shares_equal_plain_loops(seed: int) -> None:
    """Half of what a pair gives is each of its joints', negative shares count as 0; the foremost pairs are told."""
    generator = np.random.default_rng(seed)
    given, order = generator.normal(1.0, size=len(STICK.pairs)), generator.permutation(8)[: len(STICK.joints)]
    shares = [0.0] * 8
    for each, pair in zip(given.tolist(), STICK.pairs.tolist(), strict=True):
        for end in pair:
            shares[order[end]] += max(each, 0.0) / 2
    carried = carried_by(given, STICK.pairs, order, 8)
    assert carried.joints == tuple(round(share / sum(shares), 4) for share in shares)
    foremost = sorted(range(len(given)), key=lambda place: -max(given[place], 0.0))[:MAX_PAIRS]
    assert carried.pairs == tuple(tuple(order[STICK.pairs[place]].tolist()) for place in foremost)
    assert carried_by(-np.abs(given), STICK.pairs, None, 6) is None


def _before_a_camera(clip: Clip) -> Clip:
    """Give a motion as a camera's body: the same directions, its own lengths."""
    some = [joint for joint in clip.skeleton.joints if joint in JOINTS]
    positions = np.array([body_of(some, landmarks) for landmarks in clip.restricted_to(some).positions])
    return replace(clip, positions=positions, skeleton=Skeleton(JOINTS), rotations=np.zeros((len(positions), 0)))


@pytest.fixture(scope="module")
def films(small_library: MotionLibrary) -> MotionLibrary:
    """Give the library as cameras would have taught it."""
    return MotionLibrary.of_clips(map(_before_a_camera, small_library.motions))


@pytest.mark.slow
def test_a_cameras_bodies_are_told_from_measured_ones(builtin: MotionLibrary, films: MotionLibrary) -> None:
    """By every motion of either; a library of both has both kinds; some joints may be absent, too few tell nothing."""
    assert kinds_of(builtin) == {"measured"}
    assert kinds_of(films) == {"guessed"}
    own = builtin.restricted_to(JOINTS).motions
    assert kinds_of(MotionLibrary.of_clips([*films.motions, *own[:3]])) == {"guessed", "measured"}
    assert {kind_of(each.skeleton.joints, each.positions) for each in own} == {"measured"}
    for motion in films.motions:
        # Whole millimetres, and every second body on a line between its neighbours.
        evened = motion.positions.round(3)
        evened[1:-1:2] = (evened[:-2:2] + evened[2::2])[: len(evened[1:-1:2])] / 2
        assert kind_of(JOINTS, evened) == "guessed"
    hidden = films.motions[0].positions.copy()
    hidden[:, [JOINTS.index(name) for name in ("ltoes", "rtoes", "lthumb")]] = np.nan
    assert kind_of(JOINTS, hidden) == "guessed"
    assert kind_of(JOINTS, np.full_like(hidden, np.nan)) == "measured"
    assert kind_of(JOINTS[:8], hidden[:, :8]) == "measured"


def _asks(library: MotionLibrary, positions: NDArray[np.float64], joints: tuple[str, ...]) -> str:
    performers = Performers(library)
    performers.announce(Announcement("p", joints), 0.0)
    for frame in shown(_to_and_fro(positions, 200), 30.0, begin=1.0):
        performers.push(frame, frame.time - 1)
    return performers.compared.get("p", "")


@pytest.mark.slow
def test_another_kind_of_feed_is_said_in_one_line(small_library: MotionLibrary, films: MotionLibrary) -> None:
    """Either way round; the kind that taught the library is not spoken of. A flat body is, once it has moved."""
    measured, seen = small_library.restricted_to(JOINTS), films.motions[0].positions
    body = measured.motions[0].positions
    assert _asks(measured, body * (1.0, 1.0, 0.0), measured.skeleton.joints) == FLAT
    assert NOTES["guessed"] in _asks(measured, seen, JOINTS)
    assert NOTES["measured"] in _asks(films, body, measured.skeleton.joints)
    for text in (_asks(films, seen, JOINTS), _asks(measured, body, measured.skeleton.joints)):
        assert not any(note in text for note in NOTES.values())


@pytest.mark.slow
def test_a_library_of_several_before_cameras_names_less(films: MotionLibrary) -> None:
    """One person's does not, and neither does one of both kinds."""
    assert len(films.actors) > 1
    assert sensitivity_for(films, Settings()) == 0.025
    assert sensitivity_for(films.restricted_to(JOINTS[:8]), Settings()) == 0.2
    assert sensitivity_for(films.without(actors=films.actors[1:]), Settings()) > 0.1
