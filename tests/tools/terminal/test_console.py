"""The terminal: progress that passes work through, and names that stay names."""

from io import StringIO

import pytest
from rich.console import Console

from kinespace.tools.terminal.console import console, printable, progress


def test_progress_passes_every_piece_through() -> None:
    """All pieces come out in order, with and without a total."""
    assert list(progress(range(5), "Counting", 5)) == [0, 1, 2, 3, 4]
    assert list(progress(iter("abc"), "Spelling", None)) == ["a", "b", "c"]
    assert list(progress((), "Idling", 0)) == []


def test_progress_shows_on_standard_error(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """On a terminal the bar shows how much is done, and standard output has only results."""
    terminal = StringIO()
    monkeypatch.setattr(
        "kinespace.tools.terminal.console.progress_console", Console(file=terminal, force_terminal=True, width=100)
    )
    assert list(progress(range(3), "Counting", 3)) == [0, 1, 2]
    assert "Counting" in terminal.getvalue()
    assert "3/3" in terminal.getvalue()
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["[/]", "[bold]me[/bold]", ":smile:", "[link=x]"])
def test_names_are_printed_as_they_are(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Markup and emoji codes in a name are printed character for character."""
    console.print(f"<{name}>")
    assert capsys.readouterr().out == f"<{name}>\n"


def test_names_cannot_steer_the_terminal() -> None:
    """Control characters, line ends and half pairs in a name are replaced, everything printable is kept."""
    assert printable("Zoë 舞 🕺") == "Zoë 舞 🕺"
    replaced = printable("a\x1b[2Jb\nc\rd\u202e\ud800")
    assert replaced == "a\N{REPLACEMENT CHARACTER}[2Jb\ufffdc\ufffdd\ufffd\ufffd"
