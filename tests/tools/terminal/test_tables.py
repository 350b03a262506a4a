"""Tables on 80 characters: no name is broken in the middle, no heading cut off."""

from __future__ import annotations

from io import StringIO

import pytest
from rich.console import Console
from rich.table import Table

from kinespace.library import MotionLibrary
from kinespace.tools.cli.main import main
from kinespace.tools.terminal.console import console
from kinespace.tools.terminal.tables import add_names, csv_text, shortened

CLASSES = MotionLibrary.builtin().classes


@pytest.fixture(autouse=True)
def _narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "width", 80)


def drawn(table: Table) -> str:
    """Draw a table on 80 characters."""
    terminal = Console(file=StringIO(), width=80)
    terminal.print(table)
    assert isinstance(terminal.file, StringIO)
    return terminal.file.getvalue()


def test_the_built_in_library_keeps_its_names(capsys: pytest.CaptureFixture[str]) -> None:
    """Every class of the built-in library stands in one piece, with all its figures."""
    assert main(["info"]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if line.count("│") == 7]
    assert [row.split("│")[2].strip() for row in rows] == list(CLASSES)
    assert "…" not in "".join(rows)


def test_other_columns_give_way_before_a_name_is_broken() -> None:
    """Headings wrap between words to make room for names; only names longer than all there is are folded, not cut."""
    for longest, lines in ((40, 1), (70, 2)):
        name = "abcdefghij" * (longest // 10)
        table = Table()
        add_names(table, "name", [name], beside=32)
        for _ in range(3):
            table.add_column("a long heading")
        table.add_row(name, "1", "2", "3")
        found = [line.split("│")[1].strip() for line in drawn(table).splitlines() if line.startswith("│")]
        assert len(found) == lines
        assert "".join(found) == name


@pytest.mark.parametrize(("text", "cell"), [("=1+1", "'=1+1"), ("@x", "'@x"), ("-head", "'-head"), ("head", "head")])
def test_no_cell_is_computed(text: str, cell: str) -> None:
    """A name that a spreadsheet would take for a formula has an apostrophe before it."""
    assert csv_text(text) == cell


@pytest.mark.parametrize(("width", "told"), [(5, "ab…hi"), (6, "ab…ghi"), (9, "abcdefghi"), (8, "abc…fghi"), (1, "…")])
def test_names_are_shortened_in_their_middle(width: int, told: str) -> None:
    """At most so many characters are left, the end among them; a name that fits stays as it is."""
    assert shortened("abcdefghi", width) == told
