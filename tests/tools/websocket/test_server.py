"""`kinespace live --ws`: a client that is not ours sends a body by WebSocket and gets its class back."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from programs import LOOPBACK, PATIENCE, Program, free_udp_port, ghost_cues, started
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from kinespace.library import MotionLibrary
from kinespace.tools.page.requests import Gate
from kinespace.tools.websocket.server import answer


@contextmanager
def live(library: MotionLibrary, folder: Any, *options: str) -> Iterator[tuple[Program, str]]:  # noqa: ANN401 - a path
    """Run a recogniser that is reached by WebSocket; give its address."""
    library.save(folder / "small.npz")
    ends = ("--osc-in", f"{LOOPBACK}:{free_udp_port()}", "--osc-out", f"{LOOPBACK}:{free_udp_port()}")
    with started("live", *ends, "--ws", f"{LOOPBACK}:0", "--library", folder / "small.npz", "--plain", *options) as it:
        yield it, it.expect(r"WebSocket: (ws://\S+)")[1]


def until(client: ClientConnection, kind: str, **fields: object) -> dict[str, Any]:
    """Read answers until one of a kind has these fields."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        read: dict[str, Any] = json.loads(client.recv(timeout=PATIENCE))
        if read["type"] == kind and all(read[name] == value for name, value in fields.items()):
            return read
    raise AssertionError(f"no {kind} with {fields}")


@pytest.mark.slow
def test_frames_go_in_and_answers_come_out(small_library: MotionLibrary, tmp_path: Any) -> None:  # noqa: ANN401 - as above
    """JSON frames are recognised; every client gets the answers; rubbish is counted and ends nothing."""
    with live(small_library, tmp_path) as (program, address), connect(address) as client, connect(address) as other:
        assert set(until(client, "classes")["classes"]) == set(small_library.classes)
        client.send("no frame")
        cues = ghost_cues("squat1Reps", 2.0)[::4]
        for number, cue in enumerate(cues):
            named = {} if number else {"joints": small_library.skeleton.joints}
            frame = {"performer": "ann", "t": cue.frame.time, "positions": cue.frame.positions.tolist(), **named}
            client.send(json.dumps(frame))
        for each in (client, other):
            assert until(each, "event", performer="ann", event="start", **{"class": "squat1Reps"})
        assert until(client, "status")["inputs"]["foreign"] == 1
        assert program.interrupt() == 0


@pytest.mark.slow
def test_pages_of_other_sites_are_refused(small_library: MotionLibrary, tmp_path: Any) -> None:  # noqa: ANN401 - as above
    """A browser's page of another site gets 403, unless its site is named."""
    with live(small_library, tmp_path, "--ws-origin", "https://editor.p5js.org") as (_, address):
        with pytest.raises(InvalidStatus, match="403"), connect(address, origin="https://evil.example"):  # type: ignore[arg-type]
            pass
        with connect(address, origin="https://editor.p5js.org") as client:  # type: ignore[arg-type] # its own type of text
            assert until(client, "classes")


@pytest.mark.parametrize(
    ("origin", "host", "status"),
    [
        (None, "127.0.0.1:9313", None),
        ("http://localhost:5500", "127.0.0.1:9313", None),
        ("http://127.0.0.1:8000", "localhost:9313", None),
        ("http://10.0.0.5:8000", "10.0.0.5:9313", None),
        ("https://editor.p5js.org", "127.0.0.1:9313", None),
        ("null", "127.0.0.1:9313", 403),
        ("http://10.0.0.6", "10.0.0.5:9313", 403),
        ("https://evil.example", "127.0.0.1:9313", 403),
        ("http://localhost.evil.example", "127.0.0.1:9313", 403),
        ("http://[", "127.0.0.1:9313", 403),
        (None, "evil.example:9313", 403),
        (None, "", 403),
    ],
)
def test_origins_and_hosts(origin: str | None, host: str, status: int | None) -> None:
    """Pages of this machine, of the name they ask for, and of named sites may connect; rebound names may not."""
    headers = {"host": host} | ({} if origin is None else {"origin": origin})
    response = answer(Gate(), ("https://editor.p5js.org",), "/", headers)
    assert (response.status_code if response else None) == status


def test_beyond_this_machine_a_token_is_needed() -> None:
    """Without the token that is printed, or with another, the answer is 401."""
    gate = Gate.for_host("0.0.0.0")  # noqa: S104 - not opened
    for target, status in (("/", 401), ("/?token=x", 401), (f"/?token={gate.token}", None)):
        response = answer(gate, (), target, {"host": "10.0.0.5:9313"})
        assert (response.status_code if response else None) == status
