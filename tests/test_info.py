"""`kinespace info`: what is in a motion library."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from synthetic import stick_clips

from library import MotionLibrary, hdm05
from tools.cli import main
from tools.console import console

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(autouse=True)
def _wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "_width", 200)


def test_the_built_in_library_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    """Without a file, every class of the built-in library has its row with its number of motions and actors."""
    assert main(["info"]) == 0
    printed = capsys.readouterr().out
    library = MotionLibrary.builtin()
    assert "the built-in library" in printed
    for class_name in library.classes:
        motions = [motion for motion in library.motions if motion.class_name == class_name]
        (row,) = [line for line in printed.splitlines() if "│" in line and class_name in line]
        cells = [cell.strip() for cell in row.split("│")[1:-1]]
        assert cells[:3] == [class_name, str(len(motions)), str(len({motion.actor for motion in motions}))]
        assert float(cells[3]) == round(sum(motion.frames / motion.frame_rate for motion in motions), 1)
        assert cells[4] == "120"
    (indices,) = [line for line in printed.splitlines() if line.startswith("index of each class: ")]
    assert indices.removeprefix("index of each class: ").split(", ") == [
        f"{index} {class_name}" for index, class_name in enumerate(library.classes)
    ]
    assert "288 motions of 31 joints, 465 pairs measured" in printed
    assert f"licence: {hdm05.LICENCE}\n" in printed
    assert f"attribution: {hdm05.ATTRIBUTION}\n" in printed


def test_a_file_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A library file is shown under its name with its own terms, in one unbroken line each."""
    path = tmp_path / "mine.npz"
    MotionLibrary.of_clips(stick_clips(takes=2), licence="CC0", attribution="A. " * 80 + "Dancer").save(path)
    assert main(["info", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "mine.npz" in "".join(printed.split("\n"))
    assert "12 motions of 6 joints, 15 pairs measured" in printed
    assert "licence: CC0\n" in printed
    assert "attribution: " + "A. " * 80 + "Dancer\n" in printed


def test_what_is_not_stated_is_said_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A library without actors, licence and attribution says that they are not known."""
    path = tmp_path / "mine.npz"
    MotionLibrary.of_clips(stick_clips(takes=1, actors=("",))).save(path)
    assert main(["info", str(path)]) == 0
    printed = capsys.readouterr().out
    (row,) = [line for line in printed.splitlines() if "│" in line and "wave" in line]
    assert [cell.strip() for cell in row.split("│")[1:4]] == ["wave", "1", "?"]
    assert "licence: not stated\n" in printed
    assert "attribution: none\n" in printed
