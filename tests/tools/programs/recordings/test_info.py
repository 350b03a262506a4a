"""`kinespace info`: the contents of a motion library, and of folders of recordings."""

import json

import pytest

from kinespace.library import MotionLibrary
from kinespace.library.naming import hdm05
from kinespace.library.windows.index import opened
from kinespace.tools.cli.main import main

pytestmark = pytest.mark.usefixtures("wide")


def _row(printed: str, class_name: str) -> list[str]:
    """Give the cells of a class's row: class, index, motions, persons, seconds, frames per second."""
    (row,) = [cells for line in printed.splitlines() if (cells := line.split())[:1] == [class_name] and len(cells) > 4]
    return row


def test_info_describes_the_built_in_library(capsys: pytest.CaptureFixture[str]) -> None:
    """Without a file, every class of the built-in library has its row, then come its terms."""
    assert main(["info"]) == 0
    printed = capsys.readouterr().out
    library = MotionLibrary.builtin()
    assert printed.startswith("built-in ")
    for index, class_name in enumerate(library.classes):
        motions = [motion for motion in library.motions if motion.class_name == class_name]
        seconds = sum(motion.frames / motion.frame_rate for motion in motions)
        assert _row(printed, class_name) == [
            *(class_name, str(index), str(len(motions)), str(len({motion.actor for motion in motions}))),
            *(f"{seconds:.1f}", "60"),
        ]
    for line in (
        "motions: 288 of 11 classes, 595 s",
        "persons: bd, bk, dg, mm, tr",
        f"joints: 31: {', '.join(hdm05.SKELETON.joints)}",
        "sources: HDM05",
        f"licence: {library.licence}",
        f"attribution: {library.attribution}",
        f"done, ≤ 6/h false: {opened(library).courses.missed_at(6.0):.0%} of these motions missed",
    ):
        assert f"\n{line}\n" in printed


def test_persons_are_summed_up_and_motions_listed(capsys: pytest.CaptureFixture[str]) -> None:
    """Each person has a row of motions, classes and seconds; --clips lists every motion; --json holds the same."""
    library = MotionLibrary.builtin()
    assert main(["info", "built-in", "--clips"]) == 0
    printed = capsys.readouterr().out
    own = [motion for motion in library.motions if motion.actor == "tr"]
    assert _row(printed, "tr")[:4] == ["tr", str(len(own)), "11", f"{sum(motion.duration for motion in own):.1f}"]
    assert len([line for line in printed.splitlines() if line.startswith("squat1Reps ")]) == 52 + 1
    assert main(["info", "--clips", "--json"]) == 0
    described = json.loads(capsys.readouterr().out)
    assert (described["library"], described["motions"], len(described["clips"])) == ("built-in", 288, 288)
    assert [row["person"] for row in described["persons"]] == ["bd", "bk", "dg", "mm", "tr"]
    assert [row["index"] for row in described["classes"]] == list(range(11))
    assert described["classes"][9] | {"seconds": 0} == {
        "class": "squat1Reps",
        "motions": 52,
        "persons": 5,
        "seconds": 0,
        "frame_rates": [60.0],
        "index": 9,
    }
