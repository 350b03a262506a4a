"""Which joints can be believed: lengths, steps and frozen places, against the slow twin and on motions made wrong."""

from __future__ import annotations

import itertools
from contextlib import nullcontext
from typing import TYPE_CHECKING

import numpy as np
import pytest
from naive_bodies import (
    extremes,
    keeps_its_place,
    segment_lengths,
    squares_about_mean,
    step_length,
    steps_between,
)

from kinespace.library.kernels.compiled import left_aside
from kinespace.stream.recognizer.joints.plausibility import (
    SAME_PLACE,
    SPAN,
    Change,
    Plausibility,
    Step,
    expected_body,
    extremes_of,
    mirrored_places,
    steps_of,
)
from kinespace.tools.feeding.feed import resampled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.library.clip import Clip
    from kinespace.library.motion_library import MotionLibrary

RATE = 60.0
#: How many joints must step for a body of 31 to jump.
JUMPING = 6


@pytest.fixture(scope="module")
def kick(small_library: MotionLibrary) -> Clip:
    """Give a kick at 60 frames a second."""
    return resampled(next(m for m in small_library.motions if m.class_name.startswith("kick")), RATE)


def _watch(library: MotionLibrary) -> Plausibility:
    return Plausibility(expected_body(library), len(library.skeleton.joints))


def _doubted(library: MotionLibrary, positions: NDArray[np.float64]) -> set[str]:
    """Give the names of the joints that are doubted at some time."""
    watched, names = _watch(library), library.skeleton.joints
    watched.begin(positions[0])
    doubted: set[str] = set()
    for index, frame in enumerate(positions):
        watched.look(index / RATE, frame)
        doubted |= {names[joint] for joint in watched.doubted}
    return doubted


def test_lengths_equal_the_slow_twins(small_library: MotionLibrary, kick: Clip) -> None:
    """Every segment's length equals the one that the slow twin finds, joint by joint."""
    body = expected_body(small_library)
    lengths = body.lengths(kick.positions[:5])
    for found, frame in zip(lengths, kick.positions[:5].tolist(), strict=True):
        assert found == pytest.approx(segment_lengths(frame, small_library.skeleton.parents))
    assert (body.shortest <= lengths + 2e-3).all()
    assert (lengths <= body.longest + 2e-3).all()


@pytest.mark.parametrize("aside", [False, True], ids=["compiled", "numpy"])
def test_steps_and_extremes_equal_the_slow_twins(small_library: MotionLibrary, kick: Clip, *, aside: bool) -> None:
    """Of every joint and segment, also where a joint is lost in some frames or in all; NaN spoils the sum."""
    body, positions = expected_body(small_library), kick.positions[:7].copy()
    steps, lengths, moved = np.empty((6, 31, 3)), np.empty((2, len(body.children))), np.empty(31)
    with left_aside() if aside else nullcontext():
        squares = steps_of(positions[1:], positions[0], steps)
        positions[2:4, 5] = np.nan
        positions[:, 9] = np.nan
        extremes_of(positions, body, lengths, moved)
        assert np.isnan(steps_of(positions[1:], positions[0], np.empty_like(steps)))
    pairs = list(itertools.pairwise(kick.positions[:7].tolist()))
    np.testing.assert_allclose(steps, [steps_between(*pair) for pair in pairs])
    assert squares == pytest.approx(max(squares_about_mean(steps_between(*pair)) for pair in pairs))
    expected_lengths, expected_moved = extremes(positions.tolist(), small_library.skeleton.parents)
    np.testing.assert_allclose(lengths.T, expected_lengths, atol=1e-12)
    np.testing.assert_allclose(moved, expected_moved, atol=1e-12)


def test_no_jump_is_overlooked_for_its_small_sum(small_library: MotionLibrary, kick: Clip) -> None:
    """The quick sum asks for a closer look whenever a sixth of the joints step as far as a jump."""
    watched, generator = _watch(small_library), np.random.default_rng(5)
    watched.begin(kick.positions[0])
    for _ in range(300):
        step = generator.normal(0.0, 0.03, 3) + generator.normal(0.0, 0.01, (31, 3))
        some = generator.choice(31, generator.integers(5, 9), replace=False)
        step[some] += generator.normal(0.0, 0.12, 3)
        squares = steps_of(step[None], np.zeros((31, 3)), np.empty((1, 31, 3)))
        far = step_length(np.zeros((31, 3)).tolist(), step.tolist(), JUMPING) >= 0.12
        assert watched.may_jump(squares * watched._scale**2, 0.0) or not far  # noqa: SLF001 - in the library's metres


def test_a_jump_is_judged_by_the_step_of_the_twin(small_library: MotionLibrary, kick: Clip) -> None:
    """A body jumps when its sixth farthest joint steps too far; none of its own frames has such a step."""
    watched, still = _watch(small_library), Step(np.zeros_like(kick.positions[0]), 1 / RATE)
    for before, after in ((0, 1), (0, kick.frames // 2), (3, kick.frames - 1)):
        one, other = kick.positions[before], kick.positions[after]
        far = step_length(one.tolist(), other.tolist(), JUMPING)
        assert watched._step_length(other - one) == pytest.approx(far)  # noqa: SLF001 - compared with the twin
        assert watched.jumped(still, Step(other - one, 1 / RATE)) == (far >= 0.12)


def test_a_sound_motion_is_believed(small_library: MotionLibrary) -> None:
    """No joint is doubted in any motion of the library."""
    for motion in small_library.motions:
        assert not _doubted(small_library, resampled(motion, RATE).positions)


def test_a_frozen_arm_is_doubted_and_nothing_else(small_library: MotionLibrary, kick: Clip) -> None:
    """Joints that keep their place while the body moves are doubted; the twin says which keep it."""
    arm = ("lhumerus", "lradius", "lwrist", "lhand", "lthumb", "lfingers")
    names = small_library.skeleton.joints
    places = [names.index(name) for name in arm]
    positions = kick.positions.copy()
    positions[:, places] = positions[0, places]
    kept = {name for joint, name in enumerate(names) if keeps_its_place(positions[:, joint].tolist(), SAME_PLACE)}
    assert _doubted(small_library, positions) == kept == {*arm}


def test_exchanged_wrists_are_doubted(small_library: MotionLibrary, kick: Clip) -> None:
    """Two joints in each other's place are at the ends of the broken segments; a hand may go with them, no more."""
    names = small_library.skeleton.joints
    pair = [names.index("lwrist"), names.index("rwrist")]
    positions = kick.positions.copy()
    positions[:, pair] = positions[:, pair[::-1]]
    hands = {f"{side}{name}" for side in "lr" for name in ("wrist", "hand", "thumb", "fingers")}
    assert {"lwrist", "rwrist"} <= _doubted(small_library, positions) <= hands


def test_joints_in_another_order_are_all_doubted(small_library: MotionLibrary, kick: Clip) -> None:
    """When the median segment has an impossible length, all joints are doubted within a second."""
    order = np.random.default_rng(5).permutation(31)
    assert _doubted(small_library, kick.positions[: round(2.5 * SPAN * RATE), order]) == {
        *small_library.skeleton.joints
    }


def test_a_jump_has_one_of_three_causes(small_library: MotionLibrary, kick: Clip) -> None:
    """Exchanged sides, another unit and another posture are told apart."""
    watched, before, after = _watch(small_library), kick.positions[0], kick.positions[1]
    mirrored = mirrored_places(small_library.skeleton.joints)
    assert watched.explained(before, after[mirrored]).change is Change.EXCHANGED
    change, factor = watched.explained(before, 1000 * after)
    assert (change, factor) == (Change.UNIT, pytest.approx(1e-3, rel=1e-2))
    assert watched.explained(before, small_library.motions[-1].positions[5]).change is Change.POSTURE


@pytest.mark.parametrize(
    ("joints", "others"),
    [
        (("root", "lowerback", "lwrist", "rwrist"), (0, 1, 3, 2)),
        (("Hips", "LeftHand", "RightHand"), (0, 2, 1)),
        (("hand.L", "hand.R", "knee_r", "knee_l"), (1, 0, 3, 2)),
    ],
)
def test_names_tell_the_other_side(joints: tuple[str, ...], others: tuple[int, ...]) -> None:
    """The joint on the other side has the same name but for the side."""
    found = mirrored_places(joints)
    assert found is not None
    assert tuple(found.tolist()) == others


def test_joints_without_sides_are_never_exchanged() -> None:
    """Markers without sides are never exchanged."""
    assert mirrored_places(("root", "a", "b")) is None
