"""Pictures drawn with matplotlib."""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
import pytest

from kinespace.tools.evaluation import pictures
from kinespace.tools.evaluation.scoring.retrieval import Protocol, Retrieval, Space

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.slow

CLASSES = ("bow", "jump", "wave")


def results() -> dict[str, Retrieval]:
    """Make outcomes of three spaces."""
    right = np.tile([[True], [False]], (6, 2))
    return {
        space: Retrieval(CLASSES, np.roll(np.eye(3), place, axis=0), np.arange(12), right)
        for place, space in enumerate(Space)
    }


def test_the_picture_names_every_space_class_and_share(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A drawn SVG holds, as text, the protocol, each space with its figures, and each class's name."""
    monkeypatch.setitem(mpl.rcParams, "svg.fonttype", "none")
    path = tmp_path / "confusions.svg"
    pictures.draw_confusions(path, results(), Protocol.SPLIT)
    drawn = path.read_text(encoding="utf-8")
    assert drawn.startswith("<?xml")
    for text in ("Nearest neighbour, split", "distances", "50.0% of 12", "positions", "class performed"):
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


def test_the_error_without_matplotlib_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the extra is not installed, loading the module names the extra."""
    monkeypatch.delitem(sys.modules, "kinespace.tools.evaluation.pictures")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ImportError, match=r"pip install 'kinespace\[pictures\]'"):
        importlib.import_module("kinespace.tools.evaluation.pictures")


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
