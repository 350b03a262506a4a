"""Answers counted_in one by one: noisy motions and faulty takes replayed by hand, and each fault by its name."""

import numpy as np
import pytest
from synthetic import stick_clip

from kinespace.library import MotionLibrary, Skeleton
from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream.recognition import Outcome, Recognition
from kinespace.tools.evaluation.evaluate_faults import FAULTS, LEFT_ARM
from kinespace.tools.evaluation.harness import Feed, Take
from kinespace.tools.evaluation.stream_score import counted_in

B, J, OF = "bow", "jump", Outcome
#: Time, outcome and guess of answers to a second of bowing, one of jumping and one of juggling.
ANSWERS = (
    (0.2, OF.NAMED, J),
    (0.6, OF.NAMED, B),
    (0.8, OF.UNKNOWN, B),
    (1.6, OF.STILL, J),
    (1.7, OF.IMPLAUSIBLE, J),
    (1.8, OF.NAMED, B),
    (2.6, OF.NAMED, B),
    (2.8, OF.UNKNOWN, J),
    (3.5, OF.NAMED, B),
)


def _answers() -> list[Recognition]:
    classes = (B, J)
    return [Recognition("p", time, each, classes, np.ones(2), 0.1, guess=classes.index(g)) for time, each, g in ANSWERS]


def test_answers_counted_by_hand() -> None:
    """Answers count by what is performed then; those at a segment's beginning, and outside of all, do not count."""
    take = Take(stick_clip("bow"), (Segment(0, 1, B), Segment(1, 2, J), Segment(2, 3, "juggle")))
    counts = counted_in(take, (B, J), _answers(), inside=0.5)
    expected = {"answers": 5, "right": 1, "guessed": 2, "wrong": 1, "implausible": 1, "unknown": 2, "unknown_named": 1}
    assert counts == expected
    assert not counted_in(take, (B, J), [])


def _played(fault: str) -> tuple[Feed, Feed]:
    clip = MotionLibrary.builtin().motions[0]
    feed = Feed.of(clip, clip.skeleton)
    return feed, FAULTS[fault](feed, np.random.default_rng(0))


def test_each_fault_does_what_its_name_says() -> None:
    """Frozen joints stay, exchanged joints are exchanged, lost joints are NaN; other joints do not change."""
    feed, frozen = _played("left arm frozen")
    joints = feed.skeleton.joints
    arm = [joints.index(name) for name in LEFT_ARM]
    assert (frozen.positions[:, arm] == feed.positions[0, arm]).all()
    np.testing.assert_array_equal(*(np.delete(each.positions, arm, axis=1) for each in (frozen, feed)))
    sides = _played("sides exchanged")[1].positions
    np.testing.assert_array_equal(sides[:, joints.index("lfoot")], feed.positions[:, joints.index("rfoot")])
    np.testing.assert_array_equal(sides[:, 0], feed.positions[:, 0])
    lost = np.isnan(_played("head and hand lost")[1].positions).any(axis=2)
    assert set(np.flatnonzero(lost.any(axis=0))) == {joints.index("head"), joints.index("rhand")}
    assert len(_played("half the frames dropped")[1].times) < 0.7 * len(feed.times)
    assert len(np.unique(_played("two postures, 1/4 s")[1].positions, axis=0)) == 2
    unsided = feed._replace(skeleton=Skeleton(tuple(f"joint {place}" for place in range(len(joints)))))
    with pytest.raises(ValueError, match="--fault: expected joints whose names say left or right"):
        FAULTS["sides exchanged"](unsided, np.random.default_rng(0))
