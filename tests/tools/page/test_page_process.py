"""The page's program: what is missing, or taken, is told in one line."""

import json
import os
import signal
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import closing

import pytest
from programs import PATIENCE
from websockets.sync.client import connect

from kinespace.stream.zeromq import Endpoint, ZmqReceiver
from kinespace.tools.page.process import PagePlan, PageProcess

#: An endpoint at which nobody publishes: a page waits for it without complaint.
NOBODY = "tcp://127.0.0.1:9"


@pytest.mark.slow
def test_what_a_pages_camera_sees_goes_to_the_recogniser() -> None:
    """The frame comes where `frames` says; a page without that says why it has no camera."""
    places = [[number / 40, (number * 7 % 33) / 40, (number * 5 % 33) / 40] for number in range(33)]
    sent = json.dumps({"body": {"camera": "0123456789abcdef", "at": 1.5, "places": places}})
    with closing(ZmqReceiver(Endpoint("tcp://127.0.0.1:*", bind=True))) as receiver:
        plan = PagePlan("127.0.0.1:0", NOBODY, frames=receiver.address)
        with PageProcess(plan) as page:
            origin = page.address.rstrip("/")
            with connect(f"{origin.replace('http', 'ws')}/live", origin=origin) as socket:
                parts, until = None, time.monotonic() + PATIENCE
                # ZeroMQ subscribes in its own time: what comes before is lost, as it is before a recogniser runs.
                while parts is None and time.monotonic() < until:
                    socket.send(sent)
                    time.sleep(0.05)
                    parts = receiver.receive()
    assert parts[0] == b"frame/browser/"
    with (
        PageProcess(PagePlan("127.0.0.1:0", NOBODY)) as page,
        pytest.raises(urllib.error.HTTPError, match="404") as refused,
    ):
        urllib.request.urlopen(f"{page.address}pose.js")  # noqa: S310 - the page's own address
    assert b"no camera here: start kinespace live with --page" in refused.value.read()


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
