"""`kinespace evaluate faults`: the faults applied to takes, and the counts."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.tools.cli.main import main
from kinespace.tools.evaluation.faults import FAULTS, LEFT_ARM, Feed

if TYPE_CHECKING:
    from pathlib import Path

    from kinespace.library.clip import Clip


@pytest.fixture
def feed(some_clips: tuple[Clip, ...]) -> Feed:
    """Give a motion of the built-in library as a feed."""
    clip = some_clips[0]
    return Feed(clip.times, clip.positions, clip.skeleton)


def _played(feed: Feed, fault: str) -> Feed:
    return FAULTS[fault](feed, np.random.default_rng(0))


def test_each_fault_does_what_its_name_says(feed: Feed) -> None:
    """Frozen joints stay, exchanged joints are exchanged, lost joints are NaN; other joints do not change."""
    joints = feed.skeleton.joints
    arm = [joints.index(name) for name in LEFT_ARM]
    frozen = _played(feed, "left arm frozen").positions
    assert (frozen[:, arm] == feed.positions[0, arm]).all()
    np.testing.assert_array_equal(np.delete(frozen, arm, axis=1), np.delete(feed.positions, arm, axis=1))
    sides = _played(feed, "sides exchanged").positions
    np.testing.assert_array_equal(sides[:, joints.index("lfoot")], feed.positions[:, joints.index("rfoot")])
    np.testing.assert_array_equal(sides[:, 0], feed.positions[:, 0])
    lost = np.isnan(_played(feed, "head and hand lost").positions).any(axis=2)
    assert lost[:, joints.index("head")].all()
    assert set(np.flatnonzero(lost.any(axis=0))) == {joints.index("head"), joints.index("rhand")}
    assert len(_played(feed, "half the frames dropped").times) < 0.7 * len(feed.times)
    assert len(np.unique(_played(feed, "two postures, 1/4 s").positions, axis=0)) == 2


@pytest.mark.slow
def test_answers_and_seconds_of_alarm_are_counted(hdm05_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A take named in another's library: a sound feed is not alarmed, a frozen arm is noticed within a second."""
    squats = sorted((hdm05_folder / "squat1Reps").glob("HDM_bd*"))[:1]
    arguments = ("evaluate", "faults", str(squats[0]), "--fault", "none", "left arm frozen", "--json")
    assert main(arguments) == 0
    sound, frozen = json.loads(capsys.readouterr().out)["faults"]
    assert (sound["alarmed"], sound["noticed_s"]) == (0, None)
    assert frozen["noticed_s"] < 1
    assert frozen["answers"] == sound["answers"] > 0
