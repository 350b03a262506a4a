"""Which joints can be believed: lengths, steps and frozen places, against the slow twin and on motions made wrong."""

from collections import Counter
from statistics import median

import numpy as np
import pytest
from naive_bodies import keeps_its_place, squares_about_mean, step_length, steps_between
from numpy.typing import NDArray

from kinespace.library import Clip, WindowIndex
from kinespace.stream.recognizer.joints.plausibility import (
    ELSEWHERE_STEP,
    SAME_PLACE,
    SPAN,
    Change,
    Plausibility,
    Step,
    steps_of,
)
from kinespace.tools.feeding.feed import resampled

RATE = 60.0
#: How many joints must step for a body of 31 to jump.
JUMPING = 6


@pytest.fixture(scope="module")
def kick(small_index: WindowIndex) -> Clip:
    """Give a kick at 60 frames a second."""
    kick = resampled(next(m for m in small_index.library.motions if m.class_name.startswith("kick")), RATE)
    return kick.moved_to(kick.positions.astype(np.float64))


def _watch(index: WindowIndex) -> Plausibility:
    return Plausibility(index.segments, len(index.library.skeleton.joints))


def _places(index: WindowIndex, *names: str) -> list[int]:
    return [index.library.skeleton.joints.index(name) for name in names]


def _doubted(index: WindowIndex, positions: NDArray[np.float64]) -> set[str]:
    """Give the names of the joints that are doubted at some time."""
    watched, names, doubted = _watch(index), index.library.skeleton.joints, set[str]()
    watched.begin(positions[0])
    for place, frame in enumerate(positions):
        watched.look(place / RATE, frame)
        doubted |= {names[joint] for joint in watched.doubted}
    return doubted


def test_steps_equal_the_slow_twins(kick: Clip) -> None:
    """Of every joint; a lost one spoils the sum."""
    positions = kick.positions[:7].copy()
    steps, squares, farthest = steps_of(positions[0], positions[1:])
    pairs = [steps_between(*pair) for pair in zip(positions[:-1].tolist(), positions[1:].tolist(), strict=True)]
    np.testing.assert_allclose(steps, pairs)
    assert squares == pytest.approx(max(map(squares_about_mean, pairs)))
    assert farthest == pytest.approx(max(sum(sum(axis) ** 2 for axis in zip(*each, strict=True)) for each in pairs))
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
        assert watched.may_jump(squares * watched._scale**2, 0.0, 0.0) or not far  # noqa: SLF001 - in the library's metres
    # A body's own steps need no closer look.
    assert not watched.may_jump(steps_of(kick.positions[0], kick.positions[1:20])[1], 0.0, 1 / RATE)
    assert watched.may_jump(np.nan, 0.0, 0.0)


def test_a_jump_is_judged_by_the_step_of_the_twin(small_index: WindowIndex, kick: Clip) -> None:
    """A body jumps when its sixth farthest joint steps too far, unlike before; its own frames have no such step."""
    watched, still = _watch(small_index), Step(np.zeros_like(kick.positions[0]), 1 / RATE)
    for before, after in ((0, 1), (0, kick.frames // 2), (3, kick.frames - 1)):
        step = Step(kick.positions[after] - kick.positions[before], 1 / RATE)
        far = step_length(kick.positions[before].tolist(), kick.positions[after].tolist(), JUMPING)
        assert watched._step_length(step.step) == pytest.approx(far)  # noqa: SLF001 - compared with the twin
        assert watched.jumped(still, step) == (far >= 0.12)
        # A body that goes on as before does not jump, back and forth it does, and slowly it does not.
        assert not watched.jumped(step, step)
        assert watched.jumped(Step(-step.step, 1 / RATE), step) == (far >= 0.12)
        assert not watched.jumped(still, Step(step.step, far / 6.9))


def test_no_step_elsewhere_is_overlooked_by_the_mean(small_index: WindowIndex, kick: Clip) -> None:
    """The quick look asks for a closer one whenever the median of the steps is too far and no joint jumps by itself."""
    watched, generator = _watch(small_index), np.random.default_rng(6)
    watched.begin(kick.positions[0])
    seen = Counter[bool]()
    for _ in range(300):
        step = generator.normal(0.0, 0.25, 3) + generator.normal(0.0, 0.02, (31, 3))
        step[generator.choice(31, 4, replace=False)] += generator.normal(0.0, 0.1, 3)
        exact = watched.is_elsewhere(Step(step, 1 / 60))
        middle = np.linalg.norm([median(axis) for axis in step.T.tolist()]) * watched._scale  # noqa: SLF001 - in metres
        assert exact == (middle > ELSEWHERE_STEP)
        farthest = steps_of(np.zeros((31, 3)), np.stack([0 * step, step]))[2]
        assert watched.may_jump(0.0, farthest, 1 / 60) or not exact
        seen[exact] += 1
    assert min(seen.values()) > 50
    # Slowly, no step leads elsewhere; a joint that jumps alone moves no middle.
    assert not watched.is_elsewhere(Step(np.full((31, 3), 0.3), 0.05))
    alone = np.zeros((31, 3))
    alone[3] = 30.0
    assert not watched.is_elsewhere(Step(alone, 1 / 60))
    assert not watched.may_jump(0.0, 0.0, 1 / 60)


def test_a_frozen_arm_is_doubted_and_nothing_else(small_index: WindowIndex, kick: Clip) -> None:
    """Joints that keep their place while the body moves are doubted; the twin says which keep it."""
    names, arm = small_index.library.skeleton.joints, ("lhumerus", "lradius", "lwrist", "lhand", "lthumb", "lfingers")
    positions, places = kick.positions.copy(), _places(small_index, *arm)
    positions[:, places] = positions[0, places]
    kept = {name for joint, name in enumerate(names) if keeps_its_place(positions[:, joint].tolist(), SAME_PLACE)}
    assert _doubted(small_index, positions) == kept == {*arm}
    # A body that stands still as a whole is not frozen; one whose unit is millimetres is judged alike, to 0.02 mm.
    assert not _doubted(small_index, np.repeat(kick.positions[:1], 60, axis=0))
    positions[:, places] += np.random.default_rng(2).uniform(0.0, 1.5e-5, (len(positions), len(places), 3))
    assert _doubted(small_index, 1000 * positions) == {*arm}


@pytest.mark.parametrize("tremble", [0.0, 0.01])
def test_exchanged_wrists_are_doubted(small_index: WindowIndex, kick: Clip, tremble: float) -> None:
    """Two joints in each other's place are at the ends of the broken segments; a hand may go with them, no more."""
    names = small_index.library.skeleton.joints
    pair, positions = _places(small_index, "lwrist", "rwrist"), np.concatenate([kick.positions, kick.positions[::-1]])
    positions += tremble * np.random.default_rng(1).normal(size=positions.shape)
    positions[:, pair] = positions[:, pair[::-1]]
    hands = {f"{side}{name}" for side in "lr" for name in ("wrist", "hand", "thumb", "fingers")}
    doubted = _doubted(small_index, positions)
    assert {"lwrist", "rwrist"} <= doubted <= hands or (tremble and doubted <= hands)
    assert len(names) == 31


def test_a_hand_that_is_thrown_away_is_doubted(small_index: WindowIndex, kick: Clip) -> None:
    """A segment that breaks alone parts the body, and the smaller part is wrong."""
    positions = kick.positions.copy()
    positions[::2, _places(small_index, "lradius", "lwrist", "lhand", "lfingers", "lthumb")] += [2.0, 0.0, 0.0]
    arm = {f"l{name}" for name in ("radius", "wrist", "hand", "fingers", "thumb")}
    # The first span of a rigid body says so.
    assert _doubted(small_index, positions[: round(1.2 * SPAN * RATE)]) == arm


@pytest.mark.parametrize("sides", ["l", "lr"])
def test_a_marker_that_slips_is_believed(small_index: WindowIndex, kick: Clip, sides: str) -> None:
    """A knee that moves on the skin by 15 cm, in one leg or in both by turns, is no reason to leave the leg out."""
    positions, times = kick.positions.copy(), np.arange(kick.frames) / RATE
    for side, phase in zip(sides, (0.0, 2.0), strict=False):
        hip, knee = _places(small_index, f"{side}hipjoint", f"{side}femur")
        along = positions[:, knee] - positions[:, hip]
        slip = 0.075 * np.sin(2 * np.pi * times + phase)
        positions[:, knee] += along * (slip / np.linalg.norm(along, axis=1))[:, None]
    assert not _doubted(small_index, positions)


def test_joints_in_another_order_are_all_doubted(small_index: WindowIndex, kick: Clip) -> None:
    """When the ends of the segments are any two joints, all joints are doubted within a second."""
    order = np.random.default_rng(5).permutation(31)
    shown = kick.positions[: round(2.5 * SPAN * RATE), order]
    assert _doubted(small_index, shown) == {*small_index.library.skeleton.joints}
    assert _doubted(small_index, shown[: round(1.2 * SPAN * RATE)]) < {*small_index.library.skeleton.joints}


def test_a_jump_has_one_of_three_causes(small_index: WindowIndex, kick: Clip) -> None:
    """Exchanged sides, another unit and another posture are told apart; a little larger is no other unit."""
    watched, before, after = _watch(small_index), kick.positions[0], kick.positions[1]
    mirrored = small_index.segments.mirrored
    assert watched.explained(before, after[mirrored]).change is Change.EXCHANGED
    change, factor = watched.explained(before, 1000 * after)
    assert (change, factor) == (Change.UNIT, pytest.approx(1e-3, rel=1e-2))
    assert watched.explained(1.2 * before, before) == (Change.POSTURE, 1.0)
    assert watched.explained(before, small_index.library.motions[-1].positions[5]) == (Change.POSTURE, 1.0)
