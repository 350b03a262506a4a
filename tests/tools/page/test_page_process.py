"""The page's program: what is missing, or taken, is told in one line."""

from __future__ import annotations

import socket
import sys

import pytest

from kinespace.tools.cli.main import main
from kinespace.tools.page.process import PagePlan, serve_page

#: An endpoint at which nobody publishes: a page waits for it without complaint.
NOBODY = "tcp://127.0.0.1:9"


def test_without_the_library_one_line_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The extra is named, and nothing is started."""
    monkeypatch.setitem(sys.modules, "websockets", None)
    assert main(["page", "--port", "0"]) == 2
    assert capsys.readouterr().err == "kinespace: the page needs websockets: pip install 'kinespace[page]'\n"


def test_a_port_that_is_taken_is_told() -> None:
    """The message names the address."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(OSError, match=address):
            serve_page(PagePlan(NOBODY, address), lambda _: None, lambda: True)


def test_a_page_is_served_until_it_is_to_end() -> None:
    """The address is told once the port is open, with a token where other machines reach it."""
    told: list[str] = []
    serve_page(PagePlan(NOBODY, "127.0.0.1:0"), told.append, lambda: bool(told))
    serve_page(PagePlan(NOBODY, "0.0.0.0:0"), told.append, lambda: len(told) > 1)
    assert told[0].startswith("http://127.0.0.1:")
    assert "token" not in told[0]
    assert "?token=" in told[1]
