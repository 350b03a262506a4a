"""Attacks of strangers: each runs in a process of its own until it is told to stop."""

from __future__ import annotations

import socket
import struct
import time
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import zmq

from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Announcement, Frame

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from multiprocessing.synchronize import Event

#: The performer whom the attacks must not harm.
INNOCENT = "innocent"
#: Seconds between two bursts of a flood.
_HANDFUL = 0.002
_JOINTS = 31
#: Joints of the smallest body that is recognised.
_FEW = ("lhumerus", "rhumerus", "lfemur", "rfemur", "head")
#: ZeroMQ's greeting without security, and the flags of its frames: more to come, long, command.
_GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
_MORE, _LONG, _COMMAND = 1, 2, 4
#: Bits of a flood a second, and packets a second.
BITS, PACKETS = 30_000_000, 20_000


class Place(NamedTuple):
    """The addresses of a recogniser."""

    osc: tuple[str, int]
    frames: str
    answers: str


def _handfuls(rate: float, stop: Event) -> Iterator[int]:
    """Give the number to send now for a steady rate, until told to stop."""
    begun, sent = time.perf_counter(), 0
    while not stop.is_set():
        due = int((time.perf_counter() - begun) * rate) - sent
        sent += due
        # A delay is not made up for all at once.
        yield min(due, int(rate / 20) + 1)
        time.sleep(_HANDFUL)


def _flood(place: Place, stop: Event, packets: Iterator[bytes], rate: float) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for count in _handfuls(rate, stop):
            for _ in range(count):
                sender.sendto(next(packets), place.osc)


def _again_and_again(*packets: bytes) -> Iterator[bytes]:
    while True:
        yield from packets


def _body(performer: str, moment: float, joints: int = _JOINTS) -> bytes:
    return osc.encode_frame(Frame(performer, moment, np.full((joints, 3), 0.5, dtype=np.float32)))


def _bundle(elements: Sequence[bytes]) -> bytes:
    return b"#bundle\0" + bytes(8) + b"".join(struct.pack(">i", len(each)) + each for each in elements)


def _moving(performer: str, rate: float, joints: int) -> Iterator[bytes]:
    number = 0
    while True:
        number += 1
        yield _body(performer, 1.0 + number / rate, joints)


# --- OSC ---


def garbage(place: Place, stop: Event) -> None:
    """Send 20,000 packets a second of garbage."""
    generator = np.random.default_rng(1)
    _flood(place, stop, _again_and_again(*(generator.bytes(64) for _ in range(997))), PACKETS)


def new_names(place: Place, stop: Event) -> None:
    """Send 10,000 frames a second, each of another performer."""

    def named() -> Iterator[bytes]:
        number = 0
        while True:
            number += 1
            yield _body(f"n{number}", 1.0)

    _flood(place, stop, named(), PACKETS / 2)


def many_messages(place: Place, stop: Event) -> None:
    """Send 30 Mbit a second of datagrams with 4,000 messages each."""
    packet = _bundle([b"/a\0\0,\0\0\0"] * 4000)
    _flood(place, stop, _again_and_again(packet), BITS / 8 / len(packet))


def packed_frames(place: Place, stop: Event) -> None:
    """Send 30 Mbit a second of datagrams with 110 right frames each: more than are read."""
    _packed(place, stop, 110)


def full_datagrams(place: Place, stop: Event) -> None:
    """Send 30 Mbit a second of datagrams with as many right frames as are read."""
    _packed(place, stop, osc.MAX_FRAMES)


def _packed(place: Place, stop: Event, count: int) -> None:
    frames = _moving("loud", 8000.0, _JOINTS)
    many = [_bundle([next(frames) for _ in range(count)]) for _ in range(16_000 // count)]
    _flood(place, stop, _again_and_again(*many), BITS / 8 / len(many[0]))


def right_frames(place: Place, stop: Event) -> None:
    """Send 20,000 right frames a second of one performer with five joints."""
    frames = _moving("loud", PACKETS, len(_FEW))
    many = [osc.encode_announcement(Announcement("loud", _FEW)), *(next(frames) for _ in range(100_000))]
    _flood(place, stop, _again_and_again(*many), PACKETS)


def impostor(place: Place, stop: Event) -> None:
    """Send frames in the innocent performer's name: another clock, times of 1e18, other joints."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        begun = time.perf_counter()
        for count in _handfuls(120.0, stop):
            now = 5000.0 + time.perf_counter() - begun
            for _ in range(count):
                sender.sendto(_body(INNOCENT, now), place.osc)
                sender.sendto(_body(INNOCENT, 1e18), place.osc)
                sender.sendto(osc.encode_announcement(Announcement(INNOCENT, ("a", "b"))), place.osc)


def many_performers(place: Place, stop: Event) -> None:
    """Invent 32 performers who send 8 packets a second each."""

    def invented() -> Iterator[bytes]:
        moment = 0
        while True:
            moment += 1
            yield from (_body(f"invented{number}", 1.0 + moment / 8) for number in range(32))

    _flood(place, stop, invented(), 32 * 8.0)


# --- ZeroMQ ---


def _publish(address: str, stop: Event, messages: Iterator[list[bytes]], rate: float) -> None:
    with zmq.Context() as context, context.socket(zmq.PUB) as publisher:
        publisher.linger = 0
        publisher.connect(address)
        for count in _handfuls(rate, stop):
            for _ in range(count):
                publisher.send_multipart(next(messages))


def _messages(*messages: list[bytes]) -> Iterator[list[bytes]]:
    while True:
        yield from messages


def zmq_garbage(place: Place, stop: Event) -> None:
    """Send 20,000 ZeroMQ messages a second of garbage."""
    _publish(place.frames, stop, _messages([b"hello/", b"x" * 64]), PACKETS)


def zmq_lists(place: Place, stop: Event) -> None:
    """Send 30 Mbit a second of msgpack: a quarter of a million empty lists in each message."""
    packet = b"\x82\xa1v\x01\xa1x\xdd" + struct.pack(">I", 250_000) + b"\x90" * 250_000
    _publish(place.frames, stop, _messages([packet]), BITS / 8 / len(packet))


def zmq_headers(place: Place, stop: Event) -> None:
    """Send 30 Mbit a second of frames with headers of 60 kB, and numbers of 4,300 digits."""
    deep = [b"frame/x/", b'{"v":1,"joints":' + b"[" * 60_000, b""]
    long = [b"frame/x/", b'{"v":1,"seq":' + b"9" * 4300 + b',"t":1,"shape":[1,3],"dtype":"<f4"}', bytes(12)]
    _publish(place.frames, stop, _messages(deep, long), 2 * BITS / 8 / 64_500)


def zmq_parts(place: Place, stop: Event) -> None:
    """Send 20,000 parts a second, in messages of a thousand."""
    _publish(place.frames, stop, _messages([b"x"] * 1000), PACKETS / 1000)


def zmq_impostor(place: Place, stop: Event) -> None:
    """Publish frames in the innocent performer's name: another clock, and times of 1e18."""

    def frames() -> Iterator[list[bytes]]:
        number = 0
        while True:
            number += 1
            for moment in (5000.0 + number / 120, 1e18):
                yield zeromq.encode_frame(Frame(INNOCENT, moment, np.full((_JOINTS, 3), 0.5)), number)

    _publish(place.frames, stop, frames(), 240.0)


def large_subscriptions(place: Place, stop: Event) -> None:
    """Subscribe twenty times to a topic of a megabyte, and again whenever that was refused."""
    # By ZeroMQ itself it could not be done: it breaks down on such a topic.
    subscription = bytes([_LONG]) + struct.pack(">Q", 1_000_001) + b"\x01" + b"x" * 1_000_000
    while not stop.is_set():
        with ExitStack() as opened:
            for _ in range(20):
                with suppress(OSError):
                    peer = opened.enter_context(_greeted(place.answers, b"SUB"))
                    peer.sendall(subscription)
            stop.wait(0.5)


def many_subscriptions(place: Place, stop: Event) -> None:
    """Subscribe to 200,000 topics."""
    with zmq.Context() as context, context.socket(zmq.SUB) as subscriber:
        subscriber.linger = 0
        subscriber.set_hwm(0)
        subscriber.connect(place.answers)
        for number in range(200_000):
            if stop.is_set():
                return
            subscriber.subscribe(b"topic %d" % number)
        stop.wait()


def _tcp(address: str) -> socket.socket:
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    return socket.create_connection((host, int(port)), 1.0)


def _greeted(address: str, kind: bytes) -> socket.socket:
    """Connect as a ZeroMQ socket of some kind does."""
    peer = _tcp(address)
    ready = b"\x05READY\x0bSocket-Type" + struct.pack(">I", len(kind)) + kind
    peer.sendall(_GREETING)
    peer.recv(64)
    peer.sendall(bytes([_COMMAND, len(ready)]) + ready)
    return peer


def unfinished_message(place: Place, stop: Event) -> None:
    """Send 400 MB of a message that never ends, in parts of 250 kB."""
    part = bytes([_MORE | _LONG]) + struct.pack(">Q", 250_000) + bytes(250_000)
    with suppress(OSError), _greeted(place.frames, b"PUB") as peer:
        for _ in range(1600):
            if stop.is_set():
                return
            peer.sendall(part)
        stop.wait()


def silent_connections(place: Place, stop: Event) -> None:
    """Open 1,300 silent connections, and open them anew when they are closed."""
    opened: list[socket.socket] = []
    while not stop.is_set():
        try:
            while len(opened) < 1300 and not stop.is_set():
                opened.append(_tcp(place.answers if len(opened) % 2 else place.frames))
                opened[-1].setblocking(False)  # noqa: FBT003 - the socket's own
        except OSError:
            stop.wait(0.1)
        still = [each for each in opened if not _is_ended(each)]
        opened = still
        stop.wait(0.1)
    for each in opened:
        each.close()


def _is_ended(peer: socket.socket) -> bool:
    try:
        while data := peer.recv(4096):
            del data
    except BlockingIOError:
        return False
    except OSError:
        pass
    peer.close()
    return True


def nothing(place: Place, stop: Event) -> None:  # noqa: ARG001 - as all attacks
    """Do nothing."""
    stop.wait()
