"""What `live` says of an odd body, the programs that read a recording of it say, too."""

from pathlib import Path

import numpy as np
import pytest

from kinespace.library import MotionLibrary
from kinespace.tools.cli.main import main


@pytest.mark.slow
@pytest.mark.parametrize("program", ["info", "build -o out.npz", "convert -o out.npz", "cut -o out.csv"])
def test_a_flat_body_is_remarked_on(
    program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Once, where progress is shown."""
    monkeypatch.chdir(tmp_path)
    squat = next(each for each in MotionLibrary.builtin().motions if each.class_name == "squat1Reps")
    flat, joints = squat.positions * [1.0, 1.0, 0.0], squat.skeleton
    described = {"joints": np.array(joints.joints), "parents": np.array(joints.parents), "performer": np.array("ann")}
    np.savez("take.npz", time=squat.times, positions=flat, **described)
    name, *options = program.split()
    assert main([name, "take.npz", *options]) == 0
    assert capsys.readouterr().err.count(": flat: all joints lie in one plane") == 1
