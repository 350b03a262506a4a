"""Tables on 80 characters: no name is broken in the middle, no heading cut off."""

from io import StringIO

import pytest
from rich.console import Console

from kinespace.library import MotionLibrary
from kinespace.tools.cli.main import main
from kinespace.tools.terminal.console import console, csv_text, shortened, table_of

CLASSES = MotionLibrary.builtin().classes


@pytest.fixture(autouse=True)
def _narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "width", 80)


def test_the_built_in_library_keeps_its_names(capsys: pytest.CaptureFixture[str]) -> None:
    """Every class of the built-in library stands in one piece, with all its figures."""
    assert main(["info"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[0] for line in lines if len(line) == 6 and line[0] in CLASSES] == list(CLASSES)


def test_other_columns_give_way_before_a_name_is_broken() -> None:
    """Headings wrap between words to make room for names; only names longer than all there is are folded, not cut."""
    for longest, lines in ((40, 1), (70, 2)):
        name, terminal = "abcdefghij" * (longest // 10), Console(file=StringIO(), width=80)
        terminal.print(table_of("", ("name", *["a rather long heading"] * 3), [(name, "1", "2", "3")]))
        assert isinstance(terminal.file, StringIO)
        found = [word for word in terminal.file.getvalue().split() if word in name and len(word) > 4]
        assert len(found) == lines
        assert "".join(found) == name


@pytest.mark.parametrize(("text", "cell"), [("=1+1", "'=1+1"), ("@x", "'@x"), ("-head", "'-head"), ("head", "head")])
def test_no_cell_is_computed(text: str, cell: str) -> None:
    """A name that a spreadsheet would take for a formula has an apostrophe before it."""
    assert csv_text(text) == cell


@pytest.mark.parametrize(("width", "short"), [(5, "ab…hi"), (6, "ab…ghi"), (9, "abcdefghi"), (8, "abc…fghi"), (1, "…")])
def test_names_are_shortened_in_their_middle(width: int, short: str) -> None:
    """At most so many characters are left, the end among them; a name that fits stays as it is."""
    assert shortened("abcdefghi", width) == short
