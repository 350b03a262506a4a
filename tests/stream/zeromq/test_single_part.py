"""ZeroMQ messages of one part: msgpack and OSC, believed no more than others, whole where several would be lost."""

from __future__ import annotations

import re
import time
from typing import TYPE_CHECKING

import msgpack
import numpy as np
import pytest
import zmq
from golden import LAYOUTS, Moment, message
from hypothesis import given
from hypothesis import strategies as st
from programs import LOOPBACK, PATIENCE, ROOT, ghost_cues

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import osc, zeromq
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.feeds.source import FeedSource
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.inputs import Source, ZmqDecoder
from kinespace.stream.zeromq import Endpoint, FormatError, ZmqReceiver, single_part

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

POSITIONS = np.random.default_rng(5).normal(size=(3, 3))
GOOD = msgpack.unpackb(single_part.encode(Frame("p", 1.5, POSITIONS), 7))


@given(
    performer=st.text(st.characters(codec="utf-8"), min_size=1, max_size=64),
    moment=st.floats(allow_nan=False, allow_infinity=False).filter(bool),
    seq=st.integers(0, 2**63 - 1),
    joints=st.none() | st.lists(st.text(min_size=1), min_size=1, max_size=5, unique=True),
)
def test_a_sent_frame_is_read_back(performer: str, moment: float, seq: int, joints: list[str] | None) -> None:
    """Performer, time, number, joint names and positions in single precision come back."""
    numbered = single_part.decode(single_part.encode(Frame(performer, moment, POSITIONS), seq, joints), 77.0)
    assert (numbered.frame.performer, numbered.frame.time, numbered.seq) == (performer, moment, seq)
    assert np.array_equal(numbered.frame.positions, POSITIONS.astype(np.float32))
    assert numbered.announcement == (None if joints is None else Announcement(performer, tuple(joints)))


def test_the_page_lists_every_key() -> None:
    """The table of the messages has the map's keys, and says which may be absent."""
    page = (ROOT / ".github/docs/messages.md").read_text(encoding="utf-8")
    table = page.partition("The map's keys:")[2].partition("\n#")[0]
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \|", table, re.MULTILINE)
    assert {key for key, _ in rows} == set(single_part.Packed.__struct_fields__)
    needed = {key: GOOD[key] for key, kind in rows if "absent" not in kind}
    assert single_part.decode(msgpack.packb(needed), 77.0).frame.time == 77.0
    for key in needed:
        with pytest.raises(FormatError, match=key):
            single_part.decode(msgpack.packb({name: value for name, value in needed.items() if name != key}), 77.0)


@pytest.mark.parametrize(
    "changes",
    [
        {"v": 2},
        {"v": None},
        {"performer": 7},
        {"performer": ""},
        {"performer": "x" * 65},
        {"data": "text"},
        {"data": b"short"},
        {"dtype": "|O"},
        {"dtype": None},
        {"shape": [3]},
        {"shape": [3, 3, 1]},
        {"shape": [-3, 3]},
        {"shape": [True, 3]},
        {"t": "now"},
        {"t": True},
        {"t": float("nan")},
        {"seq": -1},
        {"joints": "abc"},
        {"joints": ["a", "a"]},
    ],
    ids=str,
)
def test_a_map_that_is_wrong_is_refused(changes: dict[str, object]) -> None:
    """Every field is checked before the positions are looked at."""
    with pytest.raises(FormatError):
        single_part.decode(msgpack.packb(GOOD | changes), 0.0)


@given(st.one_of(st.binary(max_size=200), st.binary(max_size=40).map(lambda end: msgpack.packb(GOOD)[:-20] + end)))
def test_any_bytes_are_refused_alike(payload: bytes) -> None:
    """Any bytes give a frame or a FormatError."""
    try:
        single_part.decode(payload, 0.0)
    except FormatError as error:
        said = str(error)
    else:
        said = "a frame"
    assert said


@pytest.fixture
def opened() -> Iterator[tuple[ZmqReceiver, Callable[[list[bytes]], None]]]:
    """Give a receiver and a sender to it that loses no message."""
    receiver = ZmqReceiver(Endpoint.parse(f"tcp://{LOOPBACK}:*", bind=True))
    publisher = zmq.Context.instance().socket(zmq.XPUB)
    publisher.linger = 0
    publisher.connect(receiver.address)
    receiver.socket.poll(200)
    assert publisher.poll(int(PATIENCE * 1000))
    publisher.recv()
    yield receiver, publisher.send_multipart
    publisher.close()
    receiver.close()


def taken(source: Source, count: int) -> list[Frame | Announcement]:
    """Take so many messages, waiting for them."""
    events: list[Frame | Announcement] = []
    until = time.monotonic() + PATIENCE
    while count and time.monotonic() < until:
        came = source.take(5.0)
        if came is None:
            time.sleep(0.001)
            continue
        events += came
        count -= 1
    assert not count
    return events


def test_msgpack_and_osc_come_in_beside_three_parts(
    opened: tuple[ZmqReceiver, Callable[[list[bytes]], None]],
) -> None:
    """One source reads all three; gaps in the numbers are counted over all, and other messages are counted."""
    receiver, send = opened
    source = Source(receiver, ZmqDecoder())
    frames = [Frame("p", 1.0 + number, POSITIONS.astype(np.float32)) for number in range(3)]
    send(zeromq.encode_frame(frames[0], 0))
    send([single_part.encode(frames[1], 3, ("a", "b", "c"))])
    send([osc.encode_frame(frames[2])])
    send([b"junk"])
    send([b"/junk"])
    send([message("/elsewhere")])
    send([b""])
    send([msgpack.packb({"v": 1})])
    events = taken(source, 8)
    assert [event.time for event in events if isinstance(event, Frame)] == [1.0, 2.0, 3.0]
    assert [event for event in events if isinstance(event, Announcement)] == [Announcement("p", ("a", "b", "c"))]
    counts = source.counts
    assert (counts.received, counts.malformed, counts.foreign, counts.missing) == (8, 2, 3, 2)


def test_a_feed_may_come_by_zeromq(opened: tuple[ZmqReceiver, Callable[[list[bytes]], None]]) -> None:
    """Another product's OSC packets in ZeroMQ messages, with a topic or without, make its frames."""
    receiver, send = opened
    source = FeedSource(receiver, builtin_preset("vmc"))
    (cue,) = ghost_cues("squat1Reps", 0.5)[:1]
    packets = LAYOUTS["vmc"][1](Moment(dict(zip(SKELETON.joints, cue.frame.positions, strict=True)), 1.0, 0))
    for packet in packets:
        send([b"topic", packet] if packet is packets[0] else [packet])
    announced, frame = taken(source, len(packets))
    assert isinstance(announced, Announcement)
    assert isinstance(frame, Frame)
    assert (len(frame.positions), source.counts.malformed) == (22, 0)
    assert str(source).startswith("vmc tcp://127.0.0.1:")


def test_the_newest_of_one_part_survives_conflation() -> None:
    """A socket that keeps one message only gives the newest map whole: of three parts it would give the last alone."""
    receiver = zmq.Context.instance().socket(zmq.PULL)
    receiver.setsockopt(zmq.CONFLATE, 1)
    receiver.bind(f"tcp://{LOOPBACK}:*")
    sender = zmq.Context.instance().socket(zmq.PUSH)
    sender.linger = 0
    sender.connect(receiver.getsockopt_string(zmq.LAST_ENDPOINT))
    for number in range(20):
        sender.send(single_part.encode(Frame("p", 1.0 + number, POSITIONS), number))
    until = time.monotonic() + PATIENCE
    seq = -1
    while seq != 19 and time.monotonic() < until:
        if receiver.poll(50):
            seq = single_part.decode(receiver.recv(), 0.0).seq or 0
    sender.close()
    receiver.close()
    assert seq == 19
