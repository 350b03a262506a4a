"""The notebook, cell by cell, as Jupyter runs it."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from programs import ROOT, small_library
from recorded import write_clips

from kinespace.library import MotionLibrary


@pytest.mark.slow
def test_the_notebook_goes_from_files_to_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It prints the paper's table as `evaluate retrieval` has it, draws two figures and keeps a taught library."""
    import matplotlib.pyplot as plt  # noqa: PLC0415 - it takes a second, which the other tests need not wait

    monkeypatch.chdir(tmp_path)
    drawn = list[int]()
    monkeypatch.setattr(plt, "show", lambda: (drawn.append(len(plt.gcf().axes)), plt.close()))
    plt.switch_backend("agg")
    notebook = (ROOT / "tools" / "examples" / "from_files_to_figures.ipynb").read_text(encoding="utf-8")
    cells = json.loads(notebook)["cells"]
    write_clips(tmp_path)
    first = "".join(next(cell for cell in cells if cell["cell_type"] == "code")["source"])
    exec(first.replace('folder = ""', f"folder = {str(tmp_path)!r}"), {})  # noqa: S102 - our own cell
    assert "12 motions of 3 classes by 2 persons" in capsys.readouterr().out
    names = dict[str, Any]()
    for cell in cells:
        if cell["cell_type"] == "code":
            assert not cell["outputs"]
            exec("".join(cell["source"]), names)  # noqa: S102 - our own cells
        if drawn:
            # The cells with a live feed, and with a library of one's own, get few motions: they open fast.
            names |= {"library": small_library(), "clips": small_library().motions}
    printed = capsys.readouterr().out
    assert "288 motions of 11 classes by 5 persons" in printed
    assert re.search(r"any other +95\.8\nanother person's +90\.6\n", printed)
    assert drawn == [2, 1]
    guessed, asked = re.search(r"(\d+) of (\d+) squats of other persons are guessed bend", printed).groups()  # type: ignore[union-attr]
    assert int(guessed) >= 0.9 * int(asked) > 0
    assert "bend" in MotionLibrary.load("taught.npz").classes
