"""What carries a decision: shares by joint and the heaviest pairs, against plain loops; performers tell both."""

import numpy as np
import pytest
from synthetic import STICK, stick_clip

from kinespace.library import MotionLibrary
from kinespace.stream import Announcement, Frame, LiveSignature, Performers, Recognizer, Settings
from kinespace.stream.recognizer.joints.carried import MAX_PAIRS, carried_by


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
    assert mover in STICK.pairs[int(given.argmax())]
    assert np.abs(given[~(STICK.pairs == mover).any(axis=1)]).max() < 1e-6 * given.max()
    recognizer.reset()
    assert recognizer.pair_contributions() is None


def test_performers_tell_joints_in_the_senders_order(sticks: MotionLibrary) -> None:
    """Skeleton and shares have the order of the sender's frames, also when it is not the library's."""
    performers, order = Performers(sticks), [3, 1, 0, 5, 4, 2]
    assert (performers.skeleton_of("ann"), performers.carried("ann")) == (None, None)
    clip, names = stick_clip("wave", seed=70, frames=60), tuple(STICK.joints[joint] for joint in order)
    performers.announce(Announcement("ann", names), 0.0)
    for time, positions in zip(clip.times, clip.positions, strict=True):
        performers.push(Frame("ann", time, positions[order]), 0.0)
        performers.push(Frame("bob", time, positions), 0.0)
    skeleton, carried, other = performers.skeleton_of("ann"), performers.carried("ann"), performers.carried("bob")
    assert skeleton is not None
    assert skeleton == STICK.linked(names)
    assert carried.joints == tuple(other.joints[joint] for joint in order)
