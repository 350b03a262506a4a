"""`kinespace info`: the contents of a motion library, and of folders of recordings."""

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
