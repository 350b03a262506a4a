from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from kinespace.library.naming import ConventionError, convention_named
from kinespace.library.naming.convention import parse_convention

if TYPE_CHECKING:
    from pathlib import Path

GOOD = """
title = "Mine"
sides = [["left", "right"], ["L", "R"]]
prefixes = ["rig"]

[joints]
Pelvis = "root"
"*Knee" = "*femur"
"""


def test_sides_and_spelling() -> None:
    """A star stands for every way to say a side, in our name for its letter."""
    convention = parse_convention(GOOD, "folder/mine.toml")
    assert (convention.name, convention.title) == ("mine", "Mine")
    assert convention.targets == {
        "pelvis": "root",
        "leftknee": "lfemur",
        "rightknee": "rfemur",
        "lknee": "lfemur",
        "rknee": "rfemur",
    }
    assert convention.joints == ("root", "lfemur", "rfemur")
    assert convention.spelled(["rig12_Left Knee", "Rig:Pelvis"]) == ["leftknee", "pelvis"]


def test_users_file(tmp_path: Path) -> None:
    """A user's own table is asked for by its file."""
    file = tmp_path / "mine.toml"
    file.write_text(GOOD, encoding="utf-8")
    assert convention_named(str(file)) == parse_convention(GOOD, str(file))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('title = ""\n[joints]\na = "root"\nb = "head"', "title: expected text, got ''"),
        ('[joints]\na = "root"', "at least two"),
        ('[joints]\na = "hip"\nb = "head"', "expected one of HDM05's joints or nothing, got 'hip'"),
        ('[joints]\na_b = "root"\n"a b" = "head"', "expected each name once, got 'a b' twice"),
        ('sides = ["l"]\n[joints]\na = "root"\nb = "head"', "sides 1: expected a list of length 2"),
        ('prefixes = "rig"\n[joints]\na = "root"\nb = "head"', "prefixes: expected a list, got 'rig'"),
    ],
)
def test_mistakes_are_reported(text: str, message: str) -> None:
    """A mistake is reported in one line that names the file and the mistake."""
    with pytest.raises(ConventionError, match="mine.toml: .*" + message.replace("[", r"\[")):
        parse_convention(text, "mine.toml")


def test_no_text(tmp_path: Path) -> None:
    """A file that is no text is reported; a missing file is the system's error."""
    file = tmp_path / "mine.toml"
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(ConventionError, match="expected UTF-8 text, got byte 0"):
        convention_named(str(file))
    with pytest.raises(FileNotFoundError):
        convention_named(str(tmp_path / "other.toml"))
