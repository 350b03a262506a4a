"""Tables on 80 characters: no name is broken in the middle, no heading cut off."""

from io import StringIO

import pytest
from rich.console import Console

from kinespace.tools.terminal.console import console, csv_text, table_of


@pytest.fixture(autouse=True)
def _narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "width", 80)


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
