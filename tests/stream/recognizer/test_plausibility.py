"""Which joints can be believed: lengths, steps and frozen places, against the slow twin and on motions made wrong."""

import numpy as np
import pytest
from naive_bodies import keeps_its_place, squares_about_mean, step_length, steps_between
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.recognizer.plausibility import SAME_PLACE, SPAN, Plausibility, Step, steps_of
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
    assert not watched.may_jump(steps_of(kick.positions[0], kick.positions[1:20])[1], 1 / RATE)
    assert watched.may_jump(np.nan, 0.0)


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
