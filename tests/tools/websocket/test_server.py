"""`kinespace live --ws`: a client that is not ours sends a body by WebSocket and gets its class back."""

import json
import time
from typing import Any

import pytest
from programs import LOOPBACK, PATIENCE, free_udp_port, ghost_cues, started
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from kinespace.library import MotionLibrary
from kinespace.tools.page.server import Gate, answer

#: A page of another site that may connect.
EDITOR = "https://editor.p5js.org"


def until(client: ClientConnection, kind: str, **fields: object) -> dict[str, Any]:
    """Read answers until one of a kind has these fields."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        read: dict[str, Any] = json.loads(client.recv(timeout=PATIENCE))
        if read["type"] == kind and all(read[name] == value for name, value in fields.items()):
            return read
    raise AssertionError(f"no {kind} with {fields}")


@pytest.mark.slow
def test_frames_go_in_and_answers_come_out(builtin: MotionLibrary) -> None:
    """JSON frames are recognised; every client gets the answers; rubbish is counted; pages of other sites get 403."""
    ends = ("--osc-in", f"{LOOPBACK}:{free_udp_port()}", "--osc-out", f"{LOOPBACK}:{free_udp_port()}")
    options = ("--ws", f"{LOOPBACK}:0", "--ws-origin", EDITOR, "--plain")
    with started("live", *ends, *options) as program:
        address = program.expect(r"WebSocket: (ws://\S+)")[1]
        for strange in ("https://evil.example", "null"):
            with pytest.raises(InvalidStatus, match="403"), connect(address, origin=Origin(strange)):
                pass
        # A client that does not read at once takes all the same, so that the end of the program reaches it.
        with (
            connect(address, max_queue=None) as client,
            connect(address, origin=Origin(EDITOR), max_queue=None) as other,
        ):
            client.send("no frame")
            for number, cue in enumerate(ghost_cues("squat1Reps", 2.0)[::4]):
                named = {} if number else {"joints": builtin.skeleton.joints}
                frame = {"performer": "ann", "t": cue.frame.time, "positions": cue.frame.positions.tolist(), **named}
                client.send(json.dumps(frame))
            for each in (client, other):
                assert until(each, "event", performer="ann", event="start", **{"class": "squat1Reps"})
            assert until(client, "status")["inputs"]["foreign"] == 1
            assert set(until(client, "classes")["classes"]) == set(builtin.classes)
            assert program.interrupt() == 0
        assert "a page opened as a file was refused: --ws-origin null lets it in" in program.errors


@pytest.mark.parametrize(
    ("origin", "host", "status"),
    [
        (None, "127.0.0.1:9313", None),
        ("http://localhost:5500", "127.0.0.1:9313", None),
        ("http://127.0.0.1:8000", "localhost:9313", None),
        ("http://10.0.0.5:8000", "10.0.0.5:9313", None),
        (EDITOR, "127.0.0.1:9313", None),
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
    response = answer(Gate(), (EDITOR,), "/", headers)
    assert (response.status_code if response else None) == status
