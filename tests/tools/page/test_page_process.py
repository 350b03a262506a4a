"""The page's program: what is missing, or taken, is told in one line."""

import os
import signal
import socket
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable

import pytest
from programs import PATIENCE

from kinespace.tools.page.process import PagePlan, PageProcess

#: An endpoint at which nobody publishes: a page waits for it without complaint.
NOBODY = "tcp://127.0.0.1:9"


def test_a_port_that_is_taken_is_told() -> None:
    """The message names the address."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(OSError, match=address):
            PagePlan(address, NOBODY).serve(lambda _: None, lambda: True)


def test_a_page_is_served_until_it_is_to_end() -> None:
    """The address is told once the port is open, with a token where other machines reach it."""
    told: list[str] = []
    PagePlan("127.0.0.1:0", NOBODY).serve(told.append, lambda: bool(told))
    PagePlan("0.0.0.0:0", NOBODY).serve(told.append, lambda: len(told) > 1)
    assert told[0].startswith("http://127.0.0.1:")
    assert "token" not in told[0]
    assert "?token=" in told[1]


def _wait(true: Callable[[], bool]) -> None:
    until = time.monotonic() + PATIENCE
    while not true() and time.monotonic() < until:
        time.sleep(0.02)
    assert true()


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="Windows has other signals")
def test_a_page_whose_process_died_is_started_again_once() -> None:
    """At its address; both deaths are said, and nothing is left when it ends."""
    said: list[str] = []
    with PageProcess(PagePlan("127.0.0.1:0", NOBODY), said.append) as page:
        address, again = page.address, f"page: {page.address}"
        os.kill(page._child.process.pid or 0, signal.SIGKILL)  # noqa: SLF001 - as the system does when memory is short
        _wait(lambda: again in said)
        assert said == ["page: its process died (-9) and is started again", again]
        with urllib.request.urlopen(address) as reply:  # noqa: S310 - our own
            assert reply.status == 200
        os.kill(page._child.process.pid or 0, signal.SIGKILL)  # noqa: SLF001 - as above
        _wait(lambda: len(said) > 2)
        assert said[2:] == ["page: its process died again; kinespace goes on without it"]
    with PageProcess(PagePlan("127.0.0.1:0", NOBODY), said.append):
        pass
    assert len(said) == 3
    assert "kinespace page" not in {each.name for each in threading.enumerate()}
