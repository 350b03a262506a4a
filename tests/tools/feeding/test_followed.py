"""`convert --progress`: how far in its motion each frame of a recording is."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.tools.cli.main import main

if TYPE_CHECKING:
    from pathlib import Path

    import pytest


def test_a_recording_says_how_far_each_frame_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Frames of a named motion have its class and a phase that grows; frames before have none; tables stay readable."""
    builtin = MotionLibrary.builtin()
    motions = [clip for clip in builtin.motions if clip.class_name in ("lieDownFloor", "squat1Reps")][::9]
    replace(builtin, motions=tuple(motions)).save(tmp_path / "few.npz")
    clip = next(each for each in motions if each.class_name == "lieDownFloor")
    np.savez(
        tmp_path / "take.npz",
        time=clip.times,
        positions=clip.positions,
        joints=np.array(clip.skeleton.joints),
        parents=np.array(clip.skeleton.parents),
        performer="ann",
    )
    asked = ["convert", str(tmp_path / "take.npz"), "--library", str(tmp_path / "few.npz"), "-o"]
    assert main([*asked, str(tmp_path / "told.npz"), "--progress"]) == 0
    with np.load(tmp_path / "told.npz", allow_pickle=False) as told:
        assert told["positions"].shape == clip.positions.shape
        named = told["class"] >= 0
        assert set(told["classes"][told["class"][named]].tolist()) == {"lieDownFloor"}
        assert not named[:5].any()
        assert named.mean() > 0.3
        assert np.isnan(told["phase"][~named]).all()
        phases = told["phase"][named]
        assert phases[-1] > phases[0] + 0.2
        assert all(np.isfinite(told[name][named]).all() for name in ("speed", "amplitude", "sure", "scrub", "cycles"))
    # The written file is a table that can be read again.
    assert main(["convert", str(tmp_path / "told.npz"), "-o", str(tmp_path / "again.npz")]) == 0
    capsys.readouterr()
    assert main([*asked, str(tmp_path / "other.npz")]) == 2
    assert "--library: expected --progress with it" in capsys.readouterr().err
    assert main([*asked, str(tmp_path / "told.csv"), "--progress"]) == 2
    assert "--progress: expected a file that ends in .npz" in capsys.readouterr().err
