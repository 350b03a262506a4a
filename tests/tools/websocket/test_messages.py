"""Frames and answers as WebSocket messages: what a browser sends is the frame that ZeroMQ's decoder reads."""

import json

import numpy as np
import pytest

from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.inputs import ZmqDecoder
from kinespace.stream.zeromq import messages as answers
from kinespace.tools.page.server import as_text, packed


def _decoded(message: str | bytes) -> tuple[ZmqDecoder, list[object]]:
    decoder = ZmqDecoder()
    return decoder, [*decoder.decode([packed(message)[0]], 7.0, None)]


def test_a_frame_in_json_is_read_as_a_frame() -> None:
    """Names are announced, a lost coordinate is NaN, a frame without time has its arrival."""
    positions = [[0.1, 1.0, -2.0], [None, 1.5, 0.25], [3, 4, 5]]
    sent = {"performer": "ann", "positions": positions, "joints": ["a", "b", "c"]}
    decoder, (announced, frame) = _decoded(json.dumps(sent))
    assert announced == Announcement("ann", ("a", "b", "c"))
    assert isinstance(frame, Frame)
    assert (frame.performer, frame.time) == ("ann", 7.0)
    np.testing.assert_array_equal(frame.positions, np.array(positions, dtype=np.float32))
    assert decoder.counts.malformed == decoder.counts.foreign == 0
    _, (timed,) = _decoded(json.dumps({"performer": "ann", "positions": positions, "t": 1.5}))
    assert isinstance(timed, Frame)
    assert timed.time == 1.5


def test_places_may_be_objects_or_null() -> None:
    """A joint is {x, y, z}, or null where it is lost; so is a time of null."""
    text = '{"performer":"ann","positions":[{"x":1,"y":2,"z":3},null,{"x":null,"y":0,"z":1}],"t":null}'
    _, (frame,) = _decoded(text)
    assert isinstance(frame, Frame)
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
    parts = answers.encode_classes(("bow", "wave"))
    assert json.loads(as_text(parts)) == {"type": "classes", **json.loads(parts[1])}
    assert json.loads(as_text(answers.encode_gone("Zoë")))["performer"] == "Zoë"
