"""The page's program: what is missing, or taken, is told in one line."""

import os
import signal
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
