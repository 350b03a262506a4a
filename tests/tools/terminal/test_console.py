"""The terminal: progress that passes work through, and names that stay names."""

import pytest

from kinespace.tools.terminal.console import console, printable


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
