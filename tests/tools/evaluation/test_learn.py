from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.library import MotionLibrary
from kinespace.library.windows.rejection import RATES, Evidence, Rejection
from kinespace.tools.cli import main
from kinespace.tools.evaluation.learn import fitted

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.slow

_CLASSES = ("squat1Reps", "kickLFront1Reps")


def test_the_fit_tells_two_kinds_of_windows_apart() -> None:
    """Windows with a clear lead are known, windows with none are not; a class often guessed wrongly gets a malus."""
    generator = np.random.default_rng(1)
    known = [(Evidence(0.0, 1.0 + each, 0.0, -2.0, -2.0), "a") for each in generator.normal(0, 0.1, 50)]
    unknown = [(Evidence(0.0, each, 0.0, -2.0, -2.0), "b") for each in generator.normal(0, 0.1, 50)]
    rejection = fitted(known, unknown, ("a", "b"), np.ones(50))
    assert all(rejection.logit(*window) > 0 for window in known)
    assert all(rejection.logit(*window) < 0 for window in unknown)
    assert rejection.biases["a"] > rejection.biases["b"]


def test_weights_move_the_fit() -> None:
    """Known windows that count more are more likely to be known."""
    known = [(Evidence(0.0, lead, 0.0, -2.0, -2.0), "a") for lead in (0.1, 0.2, 0.9, 1.0)]
    unknown = [(Evidence(0.0, lead, 0.0, -2.0, -2.0), "a") for lead in (0.0, 0.1, 0.2, 0.3)]
    doubtful = Evidence(0.0, 0.15, 0.0, -2.0, -2.0)
    heavy = fitted(known, unknown, ("a",), np.array([8.0, 8.0, 1.0, 1.0]))
    light = fitted(known, unknown, ("a",), np.array([1.0, 1.0, 8.0, 8.0]))
    assert heavy.logit(doubtful, "a") > light.logit(doubtful, "a")


@pytest.fixture(scope="module")
def small_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two classes of three persons."""
    library = MotionLibrary.builtin()
    others = [name for name in library.classes if name not in _CLASSES]
    path = tmp_path_factory.mktemp("learn") / "small.npz"
    library.without(classes=others, actors=["mm", "tr"]).save(path)
    return path


@pytest.fixture(scope="module")
def takes_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Motions of two persons as takes: squats are known, sneaking is not."""
    folder = tmp_path_factory.mktemp("takes")
    library = MotionLibrary.builtin()
    rows = []
    for name, contains in (("squat1Reps", "squat1Reps"), ("sneak2StepsLStart", "")):
        for actor in ("mm", "tr"):
            clip = next(each for each in library.motions if (each.class_name, each.actor) == (name, actor))
            path = folder / f"{name}_{actor}.trc"
            _write_trc(path, clip.skeleton.joints, clip.positions, clip.frame_rate)
            rows.append({"file": path.name, "subject": actor, "contains": contains, "perhaps": ""})
    table = folder / "takes.csv"
    with table.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ["file", "subject", "contains", "perhaps"])
        writer.writeheader()
        writer.writerows(rows)
    return table


def _write_trc(path: Path, joints: tuple[str, ...], positions: np.ndarray, rate: float) -> None:
    lines = [f"PathFileType\t4\t(X/Y/Z)\t{path.name}"]
    lines.append("DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames")
    lines.append(f"{rate}\t{rate}\t{len(positions)}\t{len(joints)}\tm\t{rate}\t1\t{len(positions)}")
    lines.append("Frame#\tTime\t" + "\t\t\t".join(joints))
    lines.append("\t\t" + "\t".join(f"X{n}\tY{n}\tZ{n}" for n in range(1, len(joints) + 1)))
    lines.append("")
    for index, frame in enumerate(positions):
        numbers = "\t".join(f"{value:.4f}" for value in frame.ravel())
        lines.append(f"{index + 1}\t{index / rate:.5f}\t{numbers}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_learn_keeps_its_numbers_in_the_library(
    small_file: Path, takes_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The library that is written has the same motions, and a rejection that names less at a smaller rate."""
    output = tmp_path / "learned.npz"
    arguments = ["learn", str(small_file), "-o", str(output), "--takes", str(takes_file), "--json"]
    assert main.main(arguments) == 0
    told = json.loads(capsys.readouterr().out)
    assert [each["rate"] for each in told] == list(RATES)
    library = MotionLibrary.load(output)
    assert len(library) == len(MotionLibrary.load(small_file))
    assert library.learned is not None
    rejection = Rejection.of_kept(library.learned)
    assert set(rejection.biases) == set(_CLASSES)
    assert (np.diff(rejection.thresholds) <= 1e-6).all()
    assert all(each["unknown_named"] <= each["rate"] + 1e-9 for each in told)


def test_learn_needs_takes_in_which_nothing_known_happens(
    small_file: Path, takes_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without them nothing can be learned, and one line says so."""
    table = takes_file.parent / "known.csv"
    rows = takes_file.read_text(encoding="utf-8").splitlines()
    table.write_text("\n".join(row for row in rows if "sneak" not in row) + "\n", encoding="utf-8")
    arguments = ["learn", str(small_file), "-o", str(tmp_path / "x.npz"), "--takes", str(table)]
    assert main.main(arguments) == 2
    assert "nothing known happens" in capsys.readouterr().err


def test_learn_does_not_write_over_a_file(
    small_file: Path, takes_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that is there stays unless it may be written over."""
    arguments = ["learn", str(small_file), "-o", str(small_file), "--takes", str(takes_file)]
    assert main.main(arguments) == 2
    assert "--overwrite" in capsys.readouterr().err
