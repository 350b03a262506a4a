"""Packets made to end, block or fill the service: refused by their size, counted, at a cost below 1 ms."""

from __future__ import annotations

import struct
import time
from contextlib import closing
from typing import TYPE_CHECKING

import msgpack
import numpy as np
import pytest
import zmq
from programs import LOOPBACK, PATIENCE
from synthetic import stick_clip

from kinespace.stream import Frame, Performers, osc, zeromq
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.feeds.decoder import FeedDecoder
from kinespace.stream.inputs import OscDecoder, Source, ZmqDecoder
from kinespace.stream.osc.packet import MAX_MESSAGES, MAX_VALUES
from kinespace.stream.service.loop import Service
from kinespace.stream.zeromq import MAX_MESSAGE, Endpoint, ZmqReceiver

if TYPE_CHECKING:
    from collections.abc import Callable

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.inputs import Decoder

BUFFER = np.zeros((3, 3), "<f4").tobytes()
HEADER = b'{"v":1,"seq":%s,"t":%s,"shape":%s,"dtype":"<f4"}'
NINES = b"9" * 4300


def message(**changes: bytes) -> list[bytes]:
    """Make a frame's parts, with some fields as they are given."""
    fields = {"seq": b"1", "t": b"1.0", "shape": b"[3,3]"} | changes
    return [b"frame/ann/", HEADER % (fields["seq"], fields["t"], fields["shape"]), BUFFER]


NUMBERS = [
    {"seq": NINES},
    {"seq": b"9" * 300},
    {"seq": b"%d" % 2**63},
    {"seq": b"-1"},
    {"t": NINES},
    {"t": b"1e400"},
    {"t": b"NaN"},
    {"t": b"Infinity"},
    {"shape": b"[" + NINES + b",3]"},
    {"shape": b"[4294967296,3]"},
]


@pytest.mark.parametrize("changes", NUMBERS, ids=lambda changes: "".join(f"{k} {v[:12]!r}" for k, v in changes.items()))
def test_numbers_beyond_their_bounds_are_malformed(changes: dict[str, bytes]) -> None:
    """A header with absurd numbers is counted as malformed, and changes no other counter."""
    decoder = ZmqDecoder()
    assert decoder.decode(message(**changes), 1.0, None) == ()
    assert (decoder.counts.malformed, decoder.counts.missing) == (1, 0)
    assert len(decoder.decode(message(), 1.0, None)) == 1


def nested(depth: int, opened: bytes = b"\x91") -> bytes:
    """Nest lists in lists, in msgpack."""
    return opened * depth + b"\x90"


def bundle(element: bytes, count: int) -> bytes:
    """Make a bundle of the same element again and again."""
    return b"#bundle\0" + bytes(8) + (struct.pack(">i", len(element)) + element) * count


TAGS = 60_000
HOSTILE: dict[str, tuple[Callable[[], Decoder], bytes]] = {
    "a million empty lists": (ZmqDecoder, msgpack.packb({"v": 1, "x": [[]] * (MAX_MESSAGE - 64)})),
    "deep lists": (ZmqDecoder, b"\x81\xa1x" + nested(MAX_MESSAGE - 64)),
    "deep JSON": (ZmqDecoder, b""),
    "8000 messages": (OscDecoder, bundle(b"/a\0\0,\0\0\0", 8000 // 2)),
    "8000 messages of a feed": (lambda: FeedDecoder(builtin_preset("osceleton")), bundle(b"/a\0\0", 8000)),
    "empty bundles": (OscDecoder, bundle(bundle(b"", 0), 3000)),
    "60000 values": (OscDecoder, b"/a\0\0," + b"T" * (TAGS - 1) + bytes(4)),
    "60000 arrays": (OscDecoder, b"/a\0\0," + b"[]" * (TAGS // 2 - 1) + bytes(5)),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_packet_is_refused_by_its_size(name: str) -> None:
    """A packet larger or more deeply nested than any sender's is refused before it is parsed."""
    make, packet = HOSTILE[name]
    whole = packet or [b"frame/ann/", b'{"x":' + b"[" * 60_000, BUFFER]
    seconds = []
    for _ in range(9):
        decoder = make()
        # Time of this thread alone: a busy machine does not count.
        begun = time.thread_time()
        assert not decoder.decode(whole, 1.0, None)
        seconds.append(time.thread_time() - begun)
        assert decoder.counts.malformed == 1
    assert min(seconds) < 0.002


def test_as_many_messages_and_values_as_allowed_are_read() -> None:
    """The limits themselves are still read."""
    assert len(osc.decode_packet(bundle(b"/a\0\0", MAX_MESSAGES))) == MAX_MESSAGES
    (message,) = osc.decode_packet(b"/a\0\0," + b"T" * MAX_VALUES + bytes(4 - (MAX_VALUES + 1) % 4))
    assert len(message.arguments) == MAX_VALUES
    for packet in (bundle(b"/a\0\0", MAX_MESSAGES + 1), b"/a\0\0," + b"T" * (MAX_VALUES + 1) + bytes(4)):
        with pytest.raises(osc.PacketError):
            osc.decode_packet(packet)


def test_a_message_of_a_hundred_thousand_parts_is_passed_over(sticks: MotionLibrary) -> None:
    """It is thrown away a little at a time, and frames before and after it are recognised."""
    receiver = ZmqReceiver(Endpoint(f"tcp://{LOOPBACK}:*", bind=True))
    source = Source(receiver, ZmqDecoder())
    positions = stick_clip("wave", seed=51, frames=2).positions
    publisher = zmq.Context.instance().socket(zmq.XPUB)
    publisher.linger = 0
    publisher.set_hwm(0)
    with closing(publisher), Service(Performers(sticks), [source], []) as service:
        publisher.connect(receiver.address)
        while not publisher.poll(10):
            service.step(0.01)
        publisher.send_multipart(zeromq.encode_frame(Frame("ann", 1.0, positions[0]), 0))
        publisher.send_multipart([b"x"] * 100_000)
        publisher.send_multipart(zeromq.encode_frame(Frame("ann", 1.01, positions[1]), 1))
        until = time.monotonic() + PATIENCE
        while service.status().outcomes.recognizers.frames < 2 and time.monotonic() < until:
            service.step(0.01)
        inputs = service.status().inputs
    assert (service.status().outcomes.recognizers.frames, inputs.received, inputs.foreign) == (2, 3, 1)
