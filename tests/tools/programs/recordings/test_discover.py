import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

from kinespace.library import MotionLibrary
from kinespace.tools.cli.main import main

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("wide")]

CLASSES = ("squat1Reps", "kickLFront1Reps")


@pytest.fixture(scope="module")
def rehearsal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a take in which a person does two motions three times each, standing still between."""
    library, frames = MotionLibrary.builtin(), list[np.ndarray]()
    for name in CLASSES * 3:
        motion = next(each for each in library.motions if (each.class_name, each.actor) == (name, "bd"))
        frames += [*[motion.positions[0]] * 60, *motion.positions, *[motion.positions[-1]] * 60]
    path = tmp_path_factory.mktemp("rehearsal") / "monday.npz"
    body = {"joints": library.skeleton.joints, "parents": library.skeleton.parents, "performer": "ann"}
    np.savez(path, time=np.arange(len(frames)) / 60, positions=np.array(frames), **body)
    return path


@pytest.fixture(scope="module")
def folder(rehearsal: Path) -> Path:
    """Find the groups of the take."""
    folder = rehearsal.with_name("found")
    assert main(["discover", str(rehearsal), "-o", str(folder)]) == 0
    return folder


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_groups_are_written(folder: Path) -> None:
    """Two groups came three times each; library, table and page have the same."""
    rows = _rows(folder / "pieces.csv")
    assert sorted(row["group"] for row in rows) == ["1", "1", "1", "2", "2", "2"]
    assert MotionLibrary.load(folder / "pieces.npz").classes == ("1", "2")
    assert {row["performer"] for row in rows} == {"ann"}
    found = re.search(r'<script type="application/json" id="shown">(.*)</script>', (folder / "groups.html").read_text())
    assert found
    groups = json.loads(found[1])["groups"]
    assert [(group["number"], group["came"]) for group in groups] == [(1, 3), (2, 3)]
    assert "/* " not in re.sub(r"/\*\*.*?\*/", "", (folder / "groups.html").read_text().split("<script>")[0])


def test_named_groups_become_classes(folder: Path, rehearsal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The others are left out or become nothing; the labels cut the recording into the same motions."""
    assert main(["discover", "-o", str(folder), "--name", "1=dip"]) == 0
    assert MotionLibrary.load(folder / "named.npz").classes == ("dip",)
    assert len(MotionLibrary.load(folder / "named.npz")) == 3
    assert main(["discover", "-o", str(folder), "--name", "1=dip", "2=kick <b>"]) == 0
    labels = folder / "labels" / "monday.csv"
    assert sorted(row["label"] for row in _rows(labels)) == ["dip"] * 3 + ["kick <b>"] * 3
    built = folder / "built.npz"
    assert main(["build", str(rehearsal), "--labels", str(labels), "-o", str(built)]) == 0
    assert MotionLibrary.load(built).classes == ("dip", "kick <b>")
    assert main(["discover", "-o", str(folder), "--name", "2=kick", "--rest-nothing"]) == 0
    library = MotionLibrary.load(folder / "named.npz")
    assert library.classes == ("kick",)
    assert len(library) == 6
    assert "kinespace live --teach" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("-o {folder}", "SOURCE, --name: expected recordings to look into"),
        ("-o {folder} --name 9=dip", "--name: expected numbers of groups, 1 to 2, got '9'"),
        ("-o {folder} --name 1=a/b", "class: expected a name without /"),
        ("-o {folder} --name 1=still", "another name"),
        ("-o {folder}/none --name 1=dip", "none"),
        ("{rehearsal} -o {folder}", "exists already; --overwrite"),
        ("/absent -o {folder}", "no such file or folder"),
    ],
)
def test_mistakes_are_one_line(
    arguments: str, said: str, folder: Path, rehearsal: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They say what is expected, and write nothing."""
    assert main(["discover", *arguments.format(folder=folder, rehearsal=rehearsal).split()]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


def test_a_recording_without_movement_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Somebody stands still."""
    library = MotionLibrary.builtin()
    body = {"joints": library.skeleton.joints, "parents": library.skeleton.parents, "performer": ""}
    stand = np.repeat(library.motions[0].positions[:1], 120, axis=0)
    np.savez(tmp_path / "a.npz", time=np.arange(120) / 60, positions=stand, **body)
    assert main(["discover", str(tmp_path / "a.npz"), "-o", str(tmp_path / "found")]) == 2
    assert "expected movement" in capsys.readouterr().err
