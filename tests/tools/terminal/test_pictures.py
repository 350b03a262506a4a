"""Pictures drawn with matplotlib."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
import pytest

from kinespace.tools.evaluation.retrieval.experiment import Protocol, Retrieval, Space
from kinespace.tools.terminal import pictures

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.slow

CLASSES = ("bow", "jump", "wave")


def results() -> dict[str, Retrieval]:
    """Make outcomes of three spaces."""
    return {
        space: Retrieval(
            12 + place, 0.5, 0.75, CLASSES, np.roll(np.eye(3), place, axis=0), np.arange(3), np.ones((3, 2), bool)
        )
        for place, space in enumerate(Space)
    }


def test_the_picture_names_every_space_class_and_share(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A drawn SVG holds, as text, the protocol, each space with its figures, and each class's name."""
    monkeypatch.setitem(mpl.rcParams, "svg.fonttype", "none")
    path = tmp_path / "confusions.svg"
    pictures.draw_confusions(path, results(), Protocol.SPLIT)
    drawn = path.read_text(encoding="utf-8")
    assert drawn.startswith("<?xml")
    for text in ("Nearest neighbour, split", "distances", "50.0% of 12", "positions", "50.0% of 13", "class performed"):
        assert f">{text}</text>" in drawn
    # Below each of three panels, and beside the first.
    assert [drawn.count(f">{name}</text>") for name in CLASSES] == [4, 4, 4]


@pytest.mark.parametrize(("ending", "begins"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml")])
def test_the_ending_gives_the_kind_of_file(ending: str, begins: bytes, tmp_path: Path) -> None:
    """The picture's file is of the kind its ending names, and not an empty one."""
    path = tmp_path / f"confusions{ending}"
    pictures.draw_confusions(path, results(), Protocol.LEAVE_ONE_OUT)
    assert path.read_bytes().startswith(begins)
    assert path.stat().st_size > 4000


def test_different_outcomes_are_different_pictures(tmp_path: Path) -> None:
    """Another matrix gives another picture, the same matrix the same picture."""
    same, again, other = tmp_path / "same.png", tmp_path / "again.png", tmp_path / "other.png"
    outcome = results()
    pictures.draw_confusions(same, outcome, Protocol.SPLIT)
    pictures.draw_confusions(again, outcome, Protocol.SPLIT)
    turned = {space: replace(each, confusion=each.confusion.T) for space, each in outcome.items()}
    pictures.draw_confusions(other, turned, Protocol.SPLIT)
    assert same.read_bytes() == again.read_bytes()
    assert same.read_bytes() != other.read_bytes()


def test_one_space_can_be_drawn_alone(tmp_path: Path) -> None:
    """A single space is a picture of one panel, narrower than three."""
    wide, narrow = tmp_path / "wide.png", tmp_path / "narrow.png"
    outcome = results()
    pictures.draw_confusions(wide, outcome, Protocol.SPLIT)
    pictures.draw_confusions(narrow, {"distances": outcome["distances"]}, Protocol.SPLIT)
    widths = [int.from_bytes(path.read_bytes()[16:20]) for path in (wide, narrow)]
    assert widths[0] > widths[1] > 0


def test_an_unknown_ending_is_refused(tmp_path: Path) -> None:
    """An unknown ending raises an error that names it, and no file is written."""
    with pytest.raises(ValueError, match="'doc'"):
        pictures.draw_confusions(tmp_path / "confusions.doc", results(), Protocol.SPLIT)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    """A picture in a missing folder raises the system's error with the path."""
    with pytest.raises(FileNotFoundError, match="missing"):
        pictures.draw_confusions(tmp_path / "missing" / "confusions.png", results(), Protocol.SPLIT)


def test_the_error_without_matplotlib_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the extra is not installed, loading the module names the extra."""
    monkeypatch.delitem(sys.modules, "kinespace.tools.terminal.pictures")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ImportError, match=r"pip install kinespace\[pictures\]"):
        importlib.import_module("kinespace.tools.terminal.pictures")


def test_phases_are_drawn_for_each_speed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A drawn SVG names the motion, each speed and the true phase."""
    monkeypatch.setitem(mpl.rcParams, "svg.fonttype", "none")
    times = np.linspace(0, 2, 9)
    path = tmp_path / "phases.svg"
    pictures.draw_phases(path, "bow", {speed: (times / speed, times / 2, times / 2) for speed in (0.5, 2.0)})
    drawn = path.read_text(encoding="utf-8")
    for text in (
        "bow of a person who is not in the library",
        "0.5 × its speed",
        "2 × its speed",
        "true phase",
        "seconds",
    ):
        assert f">{text}</text>" in drawn
