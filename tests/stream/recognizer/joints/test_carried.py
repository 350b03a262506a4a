"""What carries a decision: shares by joint and the heaviest pairs, against plain loops; performers tell both."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic import STICK, stick_clip

from kinespace.library.naming import hdm05
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.recognizer import LiveSignature, Performers, Recognizer, Settings
from kinespace.stream.recognizer.joints.carried import MAX_PAIRS, carried_by, contributions

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary


def _naive(rows: list[list[float]], weights: list[float]) -> list[float]:
    """Multiply each weight by the distance's scatter with what is seen along all weights."""
    means = [sum(column) / len(rows) for column in zip(*rows, strict=True)]
    along = [sum(w * (x - m) for w, x, m in zip(weights, row, means, strict=True)) for row in rows]
    return [
        weight * sum((row[place] - means[place]) * seen for row, seen in zip(rows, along, strict=True))
        for place, weight in enumerate(weights)
    ]


def _naive_shares(given: list[float], pairs: list[list[int]], order: list[int], joints: int) -> list[float]:
    shares = [0.0] * joints
    for each, (first, second) in zip(given, pairs, strict=True):
        for end in (first, second):
            shares[order[end]] += max(each, 0.0) / 2
    return [share / sum(shares) for share in shares]


@pytest.mark.parametrize("seed", range(5))
def test_shares_equal_plain_loops(seed: int) -> None:
    """What pairs give adds up to the scatter; shares are those of loops; the foremost pairs are told."""
    generator = np.random.default_rng(seed)
    rows, weights = generator.normal(size=(20, len(STICK.pairs))), generator.normal(size=len(STICK.pairs))
    given = contributions(rows, weights)
    assert given == pytest.approx(_naive(rows.tolist(), weights.tolist()))
    assert given.sum() == pytest.approx(19 * (rows @ weights).var(ddof=1))
    order = generator.permutation(8)[: len(STICK.joints)]
    carried = carried_by(given, STICK.pairs, order, 8)
    assert carried is not None
    expected = _naive_shares(given.tolist(), STICK.pairs.tolist(), order.tolist(), 8)
    assert carried.joints == pytest.approx(expected, abs=1e-4)
    foremost = sorted(range(len(given)), key=lambda place: -max(given[place], 0.0))[:MAX_PAIRS]
    assert carried.pairs == tuple(tuple(order[STICK.pairs[place]].tolist()) for place in foremost)
    assert carried_by(np.zeros(len(STICK.pairs)), STICK.pairs, None, 6) is None


@pytest.mark.parametrize("signature", LiveSignature)
def test_a_recogniser_gives_the_joints_of_its_eigenvector(sticks: MotionLibrary, signature: LiveSignature) -> None:
    """Of a stick that moves one arm, the pairs of this arm's end give most; nothing is told before the first answer."""
    recognizer = Recognizer(sticks, Settings(signature=signature))
    assert recognizer.pair_contributions() is None
    still = stick_clip("wave", seed=70, frames=2).positions[0]
    mover = len(still) - 1
    for index in range(120):
        positions = still.copy()
        positions[mover] += 0.2 * np.sin(index / 10)
        recognizer.push(Frame("ann", index / 60, positions))
    given = recognizer.pair_contributions()
    assert given is not None
    assert mover in STICK.pairs[int(given.argmax())]
    others = given[~(STICK.pairs == mover).any(axis=1)]
    assert np.abs(others).max() < 1e-6 * given.max()


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
