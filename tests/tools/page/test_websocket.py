"""Frames and answers as WebSocket messages: what a browser sends is the frame that ZeroMQ's decoder reads."""

import json
import time
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from programs import LOOPBACK, PATIENCE, free_udp_port, ghost_cues, started
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from kinespace.library import MotionLibrary
from kinespace.stream import Announcement
from kinespace.stream.inputs import ZmqDecoder
from kinespace.stream.recognition import Classes, Gone
from kinespace.stream.zeromq import messages as answers
from kinespace.tools.page.server import Gate, answer, as_text, packed


def _decoded(message: str | bytes) -> tuple[ZmqDecoder, list[object]]:
    decoder = ZmqDecoder()
    return decoder, [*decoder.decode([packed(message)[0]], 7.0, None)]


def test_a_frame_in_json_is_read_as_a_frame() -> None:
    """Names are announced, a lost coordinate is NaN, a frame without time has its arrival."""
    positions = [[0.1, 1.0, -2.0], [None, 1.5, 0.25], [3, 4, 5]]
    sent = {"performer": "ann", "positions": positions, "joints": ["a", "b", "c"]}
    decoder, (announced, frame) = _decoded(json.dumps(sent))
    assert announced == Announcement("ann", ("a", "b", "c"))
    assert (frame.performer, frame.time) == ("ann", 7.0)
    np.testing.assert_array_equal(frame.positions, np.array(positions, dtype=np.float32))
    assert decoder.counts.malformed == decoder.counts.foreign == 0
    _, (timed,) = _decoded(json.dumps({"performer": "ann", "positions": positions, "t": 1.5}))
    assert timed.time == 1.5


def test_places_may_be_objects_or_null() -> None:
    """A joint is {x, y, z}, or null where it is lost; so is a time of null."""
    text = '{"performer":"ann","positions":[{"x":1,"y":2,"z":3},null,{"x":null,"y":0,"z":1}],"t":null}'
    _, (frame,) = _decoded(text)
    np.testing.assert_array_equal(frame.positions, [[1, 2, 3], [np.nan] * 3, [np.nan, 0, 1]])


@pytest.mark.parametrize(
    "message",
    ["", "{}", "null", "[" * 5000, '{"performer":"","positions":[[1,2,3]]}', '{"performer":"a","positions":[]}', "ü",
     '{"performer":"a","positions":[[1,2]]}', '{"performer":"a","positions":[[1,2,1e999]]}', b"\x80", b"", "\ud800",
     '{"performer":"a","positions":[[1,2,1e300]]}'],
)  # fmt: skip
def test_what_is_no_frame_is_counted_by_the_recogniser(message: str | bytes) -> None:
    """Nothing is raised, no frame comes of it, and exactly one packet is refused."""
    decoder, events = _decoded(message)
    assert events == []
    assert decoder.counts.malformed + decoder.counts.foreign == 1


def test_answers_are_one_object_with_their_type() -> None:
    """The JSON of ZeroMQ, and its topic as the type."""
    parts = answers.encode(Classes(("bow", "wave")))
    assert json.loads(as_text(parts)) == {"type": "classes", **json.loads(parts[1])}
    assert json.loads(as_text(answers.encode(Gone("Zoë"))))["performer"] == "Zoë"


#: A page of another site that may connect.
EDITOR = "https://editor.p5js.org"


def until(client: ClientConnection, kind: str, patience: float = PATIENCE, **fields: object) -> dict[str, Any]:
    """Read answers until one of a kind has these fields."""
    end = time.monotonic() + patience
    while (left := end - time.monotonic()) > 0:
        read: dict[str, Any] = json.loads(client.recv(timeout=left))
        if read["type"] == kind and all(read[name] == value for name, value in fields.items()):
            return read
    raise TimeoutError(f"no {kind} with {fields}")


def danced(client: ClientConnection, joints: tuple[str, ...]) -> None:
    """Send squats until one begins: a busy machine leaves out frames that came at once and waited."""
    for again in range(10):
        for number, cue in enumerate(ghost_cues("squat1Reps", 2.0)[::4]):
            named = {} if number else {"joints": joints}
            placed = {"t": 100 * again + cue.frame.time, "positions": cue.frame.positions.tolist()}
            client.send(json.dumps({"performer": "ann", **placed, **named}))
        with suppress(TimeoutError):
            until(client, "event", PATIENCE / 10, performer="ann", event="start", **{"class": "squat1Reps"})
            return
    raise AssertionError("no squat has begun")


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
            danced(client, builtin.skeleton.joints)
            assert until(other, "event", performer="ann", event="start", **{"class": "squat1Reps"})
            assert until(client, "status")["inputs"]["foreign"] == 1
            assert set(until(client, "classes")["classes"]) == set(builtin.classes)
            assert program.interrupt() == 0
        assert "a page opened as a file was refused: --ws-origin null lets it in" in program.errors


@pytest.mark.parametrize(
    ("origin", "host", "status"),
    [
        (None, "127.0.0.1:9313", None),
        ("http://127.0.0.1:8000", "localhost:9313", None),
        ("http://10.0.0.5:8000", "10.0.0.5:9313", None),
        (EDITOR, "127.0.0.1:9313", None),
        ("null", "127.0.0.1:9313", 403),
        ("http://10.0.0.6", "10.0.0.5:9313", 403),
        ("http://localhost.evil.example", "127.0.0.1:9313", 403),
        ("http://[", "127.0.0.1:9313", 403),
        (None, "evil.example:9313", 403),
    ],
)
def test_origins_and_hosts(origin: str | None, host: str, status: int | None) -> None:
    """Pages of this machine, of the name they ask for, and of named sites may connect; rebound names may not."""
    headers = {"host": host} | ({} if origin is None else {"origin": origin})
    response = answer(Gate(), (EDITOR,), "/", headers)
    assert (response.status_code if response else None) == status
