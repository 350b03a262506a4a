"""What carries a decision: shares by joint and the heaviest pairs, against plain loops; performers tell both."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic import STICK, stick_clip

from kinespace.library.naming import hdm05
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.recognizer import LiveSignature, Performers, Recognizer, Settings
from kinespace.stream.recognizer.joints.carried import MAX_PAIRS, carried_by

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary


def _naive(weights: list[float], pairs: list[list[int]], order: list[int], joints: int) -> list[float]:
    shares = [0.0] * joints
    for weight, (first, second) in zip(weights, pairs, strict=True):
        for end in (first, second):
            shares[order[end]] += weight * weight / 2
    return [share / sum(shares) for share in shares]


@pytest.mark.parametrize("seed", range(5))
def test_shares_are_those_of_plain_loops(seed: int) -> None:
    """The shares add up to 1, are those of a loop over the pairs, and the pairs told are the heaviest."""
    generator = np.random.default_rng(seed)
    weights = generator.normal(size=len(STICK.pairs))
    order = generator.permutation(8)[: len(STICK.joints)]
    carried = carried_by(weights, STICK.pairs, order, 8)
    assert carried is not None
    expected = _naive(weights.tolist(), STICK.pairs.tolist(), order.tolist(), 8)
    assert carried.joints == pytest.approx(expected, abs=1e-4)
    by_weight = sorted(range(len(weights)), key=lambda place: -abs(weights[place]))[:MAX_PAIRS]
    assert carried.pairs == tuple(tuple(order[STICK.pairs[place]].tolist()) for place in by_weight)
    assert carried_by(np.zeros(len(STICK.pairs)), STICK.pairs, None, 6) is None


@pytest.mark.parametrize("signature", LiveSignature)
def test_pair_weights_are_the_leading_eigenvector_over_the_pairs(
    sticks: MotionLibrary, signature: LiveSignature
) -> None:
    """A recogniser tells a unit eigenvector of its last window, number by pair; nothing before the first answer."""
    recognizer = Recognizer(sticks, Settings(signature=signature))
    assert recognizer.pair_weights() is None
    clip = stick_clip("wave", seed=70, frames=120)
    for time, positions in zip(clip.times, clip.positions, strict=True):
        recognizer.push(Frame("ann", time, positions))
    weights = recognizer.pair_weights()
    assert weights is not None
    assert weights.shape == (len(STICK.pairs),)
    # Projected on it, the window's rows vary more than on any single pair's direction of the same length.
    rows = np.linalg.norm(clip.positions[:, STICK.pairs[:, 0]] - clip.positions[:, STICK.pairs[:, 1]], axis=2)[-60:]
    along = (rows @ (weights / np.linalg.norm(weights))).var()
    assert along > 0.5 * np.linalg.eigvalsh(np.cov(rows, rowvar=False))[-1]


def test_performers_tell_joints_in_the_senders_order(sticks: MotionLibrary) -> None:
    """Skeleton and shares have the order of the sender's frames, also when it is not the library's."""
    performers = Performers(sticks)
    assert performers.skeleton_of("ann") is None
    assert performers.carried("ann") is None
    clip = stick_clip("wave", seed=70, frames=120)
    order = [3, 1, 0, 5, 4, 2]
    names = tuple(STICK.joints[joint] for joint in order)
    performers.announce(Announcement("ann", names), 0.0)
    for time, positions in zip(clip.times, clip.positions, strict=True):
        performers.push(Frame("ann", time, positions[order]), 0.0)
        performers.push(Frame("bob", time, positions), 0.0)
    skeleton, carried, other = performers.skeleton_of("ann"), performers.carried("ann"), performers.carried("bob")
    assert skeleton is not None
    assert carried is not None
    assert other is not None
    assert skeleton.joints == names
    assert carried.joints == tuple(other.joints[joint] for joint in order)


def test_the_parent_of_a_joint_is_the_nearest_above_it() -> None:
    """Joints in another order, some of them missing: hands hang on what is left above; strangers on nothing."""
    skeleton = hdm05.SKELETON.linked(("rhand", "nose", "rradius", "head", "thorax", "lhand"))
    assert skeleton.parents == (2, -1, 4, 4, -1, 4)
