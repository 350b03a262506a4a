"""Packets made to break a feed: golden packets cut, joined and changed, and noise that looks like OSC."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
import wrong
from fakes import NAMED, FakeReceiver
from golden import LAYOUTS, bundle, message, moments

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import Announcement, Frame, osc, zeromq
from kinespace.stream.feeds import Preset
from kinespace.stream.feeds.frame_assembler import MAX_PERFORMERS
from kinespace.stream.inputs import OwnDecoder, Source
from kinespace.stream.inputs.source import FeedSource
from kinespace.stream.zeromq.messages import decode_body, encode_body

#: Packets for each preset, for ZeroMQ and for each codec; `make fuzz` sends many more.
PACKETS = int(os.environ.get("PACKETS", "700"))
#: Bytes with a meaning in OSC are tried more often than others.
_TELLING = (b"\0", b",", b"/", b"#", b"#bundle\0", b"f", b"s", b"i", b"[", b"]", b"\xff\xff\xff\xff", b"\x7f\xc0\0\0")
_VALUES = (0, 1, -1, 2**31 - 1, -(2**31), 0.0, -0.0, 1.0, 1e30, 3e38, float("nan"), float("inf"), "", "x" * 70, "Hips")


@contextmanager
def named_if_it_fails(name: str, seed: int, packet: object) -> Iterator[None]:
    """Print what was pushed when something is raised."""
    try:
        yield
    except BaseException:
        print(f"{name}, seed {seed}: {packet!r}", file=sys.stderr)  # noqa: T201 - a person looks at it
        raise


def golden_packets(preset: str) -> list[bytes]:
    """Give a few frames of every layout of a preset."""
    generator = np.random.default_rng(1)
    packets: list[bytes] = []
    for name, (own, _) in LAYOUTS.items():
        if own == preset:
            packets += [packet for _, sent in moments(name, generator.normal(size=(3, 31, 3))) for packet in sent]
    return packets


def changed(whole: bytes, telling: Sequence[bytes], generator: np.random.Generator) -> bytes:
    """Change bytes: cut, others in their place, words put in or exchanged, pieces repeated, left out, put elsewhere."""
    changed = bytearray(whole)
    for _ in range(int(generator.integers(1, 5))):
        first, second = sorted(generator.integers(len(changed) + 1, size=2).tolist())
        word = telling[generator.integers(len(telling))]
        match generator.integers(8):
            case 0:
                del changed[first:]
            case 1:
                del changed[first : min(second, first + 200)]
            case 2 | 3:
                changed[first : first + len(word) % 100] = word
            case 4:
                words = bytes(changed).split(b" ")
                words[generator.integers(len(words))] = word
                changed = bytearray(b" ".join(words))
            case 5:
                changed[first:first] = changed[first : min(second, first + 500)] * int(generator.integers(1, 40))
            case _ if changed:
                changed[first % len(changed)] = generator.integers(256)
    return bytes(changed)


def broken(packets: list[bytes], generator: np.random.Generator) -> Iterator[bytes]:
    """Give packets without end: as they are, changed, joined, nested, with other arguments, noise."""
    while True:
        packet, other = (packets[generator.integers(len(packets))] for _ in range(2))
        match generator.integers(9):
            case 0:
                yield packet
            case 1:
                yield packet + other
            case 2:
                yield bundle(packet, other, bundle(packet))
            case 3:
                yield _with_other_arguments(packet, generator)
            case 4:
                yield generator.bytes(int(generator.integers(80)))
            case _:
                yield changed(packet, _TELLING, generator)


def _with_other_arguments(packet: bytes, generator: np.random.Generator) -> bytes:
    """Keep a message's address and types, and put in values of any kind."""
    address = packet.split(b"\0")[0].decode("latin-1")
    if not address.startswith("/"):
        return packet
    values = [_VALUES[generator.integers(len(_VALUES))] for _ in range(generator.integers(12))]
    tags = "".join({int: "i", float: "d", str: "s"}[type(value)] for value in values)
    return message(address, tags, *values)


def check(source: FeedSource, packet: bytes, arrival: float) -> None:
    """Push one packet: nothing is raised, the packet is counted, and every frame that comes out is sound."""
    receiver, before = source.receiver, source.counts.received
    receiver.packets.append((packet, (f"10.0.0.{len(packet) % 3}", 5000)))  # type: ignore[attr-defined]  # a stand-in
    events = source.take(arrival)
    assert source.counts.received == before + 1
    for event in [*events, *source.tend(arrival)]:
        if isinstance(event, Frame):
            # Joints that are absent are NaN throughout.
            absent = np.isnan(event.positions).all(axis=1)
            assert np.isfinite(event.positions[~absent]).all()
            assert not absent.all()
            some = source.preset.closings.some
            assert event.positions.shape == (len(event.positions) if some else len(source.preset.joints), 3)
            assert np.isfinite(event.time)
        else:
            joints = [each for each in source.preset.joints if not source.preset.closings.some or each in event.joints]
            assert event == Announcement(event.performer, tuple(joints))
    counts = source.decoder.assembler.counts
    assert len(source.decoder.assembler._bodies) <= MAX_PERFORMERS  # noqa: SLF001 - unseen
    assert sum(counts.closed_by.values()) == counts.frames + counts.incomplete


def run(preset: Preset, packets: int, seed: int) -> FeedSource:
    """Push so many broken packets through a preset's feed; give the source as it is afterwards."""
    generator = np.random.default_rng(seed)
    source = FeedSource(FakeReceiver(), preset)  # type: ignore[arg-type]  # a stand-in
    arrival = 0.0
    for packet, _ in zip(broken(golden_packets(preset.name), generator), range(packets), strict=False):
        arrival += float(generator.exponential(0.005))
        with named_if_it_fails(preset.name, seed, packet):
            check(source, packet, arrival)
    return source


def golden_messages() -> list[list[bytes]]:
    """Give our ZeroMQ messages, of three parts and of one, and OSC packets as they are."""
    generator = np.random.default_rng(2)
    frames = [Frame("jan", 1.0 + number / 30, generator.normal(size=(31, 3))) for number in range(3)]
    made = [zeromq.encode_frame(frame, number, SKELETON.joints) for number, frame in enumerate(frames)]
    made += [[wrong.in_one_part(frame, number, SKELETON.joints)] for number, frame in enumerate(frames)]
    return made + [[packet] for packet in golden_packets("native")]


def broken_parts(golden: list[list[bytes]], generator: np.random.Generator) -> Iterator[list[bytes]]:
    """Give messages without end: of their parts one broken, or every; or parts missing, repeated, in another order."""
    most = max(map(len, golden))
    streams = [broken([each[place] for each in golden if place < len(each)], generator) for place in range(most)]
    while True:
        good = golden[generator.integers(len(golden))]
        parts = [next(streams[place]) if generator.integers(2) else part for place, part in enumerate(good)]
        if not generator.integers(4):
            parts = [parts[place] for place in generator.integers(len(parts), size=generator.integers(1, 5))]
        yield parts


def run_messages(messages: int, seed: int) -> Source:
    """Push so many broken ZeroMQ messages through our source; give the source as it is afterwards."""
    receiver = FakeReceiver()
    source = Source(receiver, OwnDecoder())  # type: ignore[arg-type]  # a stand-in
    stream = broken_parts(golden_messages(), np.random.default_rng(seed))
    for number, parts in zip(range(messages), stream, strict=False):
        receiver.packets.append((parts, ("10.0.0.7", 5000)))
        with named_if_it_fails("ZeroMQ", seed, parts):
            events = source.take(number / 100)
            assert source.counts.received == number + 1
            for event in events:
                if isinstance(event, Frame):
                    lost = np.isnan(event.positions).any(axis=1)
                    assert np.isfinite(event.positions[~lost]).all()
    return source


class Reader(NamedTuple):
    """What a codec reads: good messages, and the function that reads one, which gives nothing for a broken one."""

    golden: list[list[bytes]]
    read: Callable[[list[bytes]], object]


#: What reads a message beside a feed's decoders, and is never to raise.
READERS = {
    "OSC answers": Reader([[osc.messages.encode_recognition(NAMED)]], lambda parts: osc.decode_answer(parts[0])),
    "ZeroMQ answers": Reader([zeromq.encode_recognition(NAMED)], zeromq.decode_answer),
    "bodies": Reader([encode_body(Frame("jan", 1.0, np.ones((31, 3))), SKELETON)], decode_body),
}


def read_broken(name: str, messages: int, seed: int) -> tuple[int, int]:
    """Read so many broken messages with a codec; give how many were a value, and how many were refused."""
    codec, read = READERS[name], 0
    for parts, _ in zip(broken_parts(codec.golden, np.random.default_rng(seed)), range(messages), strict=False):
        with named_if_it_fails(name, seed, parts):
            read += bool(codec.read(parts))
    return read, messages - read
