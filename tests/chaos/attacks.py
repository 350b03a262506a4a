"""Attacks of strangers: each runs in a process of its own until it is stopped."""

import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from itertools import count, cycle, repeat
from multiprocessing.synchronize import Event
from typing import NamedTuple

import numpy as np
import zmq
from golden import bundle
from programs import Program

from kinespace.stream import Announcement, Frame, osc, zeromq

#: The performer whom the attacks must not harm.
INNOCENT = "innocent"
#: Seconds between two bursts of a flood.
_HANDFUL = 0.002
#: Joints of the smallest body that is recognised.
_FEW = ("lhumerus", "rhumerus", "lfemur", "rfemur", "head")
#: ZeroMQ's greeting without security, and the flags of its frames: long, command.
_GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
_LONG, _COMMAND = 2, 4
#: Bytes of a flood a second: 30 Mbit.
_BYTES = 30_000_000 / 8


class Place(NamedTuple):
    """Where a recogniser listens for frames by OSC and by ZeroMQ (empty: not), and where it answers by ZeroMQ."""

    osc: tuple[str, int]
    frames: str
    answers: str


def place_of(program: Program) -> Place:
    """Wait until `live` listens; give its addresses."""
    # A second ZeroMQ address is the one for commands.
    pattern = r"listening on OSC (\S+):(\d+)(?:, ZeroMQ ([^\s;,]+))?[^;]*; answering to .*?ZeroMQ ([^\s;,]+)"
    host, port, frames, answers = program.expect(pattern).groups()
    return Place((host, int(port)), frames or "", answers)


def _paced(send: Callable[[], object], rate: float, stop: Event) -> None:
    """Send at a steady rate, in bursts, until stopped."""
    begun, sent = time.perf_counter(), 0
    while not stop.is_set():
        due = int((time.perf_counter() - begun) * rate) - sent
        sent += due
        # A delay is not made up for all at once.
        for _ in range(min(due, int(rate / 20) + 1)):
            send()
        time.sleep(_HANDFUL)


def flood(packets: Callable[[], Iterator[bytes]], rate: float, place: Place, stop: Event) -> None:
    """Send so many datagrams a second; with rate 0, 30 Mbit a second."""
    made = packets()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        _paced(lambda: sender.sendto(next(made), place.osc), rate or _BYTES / len(next(made)), stop)


def publish(messages: Callable[[], Iterator[list[bytes]]], rate: float, place: Place, stop: Event) -> None:
    """Publish so many ZeroMQ messages a second; with rate 0, 30 Mbit a second."""
    made = messages()
    with zmq.Context() as context, context.socket(zmq.PUB) as publisher:
        publisher.linger = 0
        publisher.connect(place.frames)
        _paced(lambda: publisher.send_multipart(next(made)), rate or _BYTES / sum(map(len, next(made))), stop)


def many_ports(place: Place, stop: Event) -> None:
    """Send right frames of 31 performers, each from a port of its own, 500 a second of each."""
    with ExitStack() as opened:
        senders = [opened.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(31)]
        frames = [[_body(f"p{place}", 1.0 + number / 500) for number in range(5000)] for place in range(31)]
        turns = cycle([*zip(senders, each, strict=True)] for each in zip(*frames, strict=True))
        by_turns = (each for turn in turns for each in turn)

        def send() -> None:
            sender, packet = next(by_turns)
            sender.sendto(packet, place.osc)

        _paced(send, 31 * 500, stop)


# --- packets by OSC ---


def _body(performer: str, moment: float, joints: int = 31) -> bytes:
    return osc.encode_frame(Frame(performer, moment, np.full((joints, 3), 0.5, dtype=np.float32)))


def garbage() -> Iterator[bytes]:
    """Give packets of 64 random bytes."""
    generator = np.random.default_rng(1)
    return cycle([generator.bytes(64) for _ in range(997)])


def new_names() -> Iterator[bytes]:
    """Give frames, each of another performer."""
    return (_body(f"n{number}", 1.0) for number in count())


def packed(size: int) -> Iterator[bytes]:
    """Give datagrams of so many right frames each."""
    frames = [_body("loud", 1.0 + number / 8000) for number in range(16_000)]
    return cycle([bundle(*frames[first : first + size]) for first in range(0, 16_000 - size, size)])


def right_frames() -> Iterator[bytes]:
    """Give right frames of one performer with five joints."""
    named = osc.encode_announcement(Announcement("loud", _FEW))
    return cycle([named, *(_body("loud", 1.0 + number / 20_000, len(_FEW)) for number in range(100_000))])


def impostor() -> Iterator[bytes]:
    """Give frames in the innocent performer's name: another clock, times of 1e18, other joints."""
    other = osc.encode_announcement(Announcement(INNOCENT, ("a", "b")))
    for number in count():
        yield from (_body(INNOCENT, 5000.0 + number / 120), _body(INNOCENT, 1e18), other)


def foreign_joints() -> Iterator[bytes]:
    """Give announcements of other joints in the innocent performer's name, and no frame."""
    return repeat(osc.encode_announcement(Announcement(INNOCENT, ("a", "b"))))


def crowd(performers: int, rate: float) -> Iterator[bytes]:
    """Give frames of invented performers by turns, so many a second of each."""
    return (_body(f"p{number % performers}", 1.0 + number // performers / rate) for number in count())


def commands() -> Iterator[bytes]:
    """Give datagrams of 255 commands, and of 8."""
    said = [("/motion/teach/last", INNOCENT, 3.0, "bow")], [("/motion/teach/undo",)]
    return cycle([bundle(*[osc.encode_message(*each)] * times) for (each,) in said for times in (255, 8)])


# --- messages by ZeroMQ ---


def zmq_lists() -> Iterator[list[bytes]]:
    """Give msgpack of a quarter of a million empty lists."""
    return repeat([b"\x82\xa1v\x01\xa1x\xdd" + struct.pack(">I", 250_000) + b"\x90" * 250_000])


def zmq_headers() -> Iterator[list[bytes]]:
    """Give frames with headers of 60 kB, and numbers of 4,300 digits."""
    deep = [b"frame/x/", b'{"v":1,"joints":' + b"[" * 60_000, b""]
    long = [b"frame/x/", b'{"v":1,"seq":' + b"9" * 4300 + b',"t":1,"shape":[1,3],"dtype":"<f4"}', bytes(12)]
    return cycle([deep, long])


def zmq_impostor() -> Iterator[list[bytes]]:
    """Give frames in the innocent performer's name: another clock, and times of 1e18."""
    for number in count(1):
        for moment in (5000.0 + number / 120, 1e18):
            yield zeromq.encode_frame(Frame(INNOCENT, moment, np.full((31, 3), 0.5)), number)


# --- connections by ZeroMQ ---


def large_subscriptions(place: Place, stop: Event) -> None:
    """Subscribe twenty times to a topic of a megabyte, and again whenever that was refused."""
    # By ZeroMQ itself it could not be done: it breaks down on such a topic.
    subscription = bytes([_LONG]) + struct.pack(">Q", 1_000_001) + b"\x01" + b"x" * 1_000_000
    while not stop.is_set():
        with ExitStack() as opened:
            for _ in range(20):
                with suppress(OSError):
                    opened.enter_context(greeted(place.answers, b"SUB")).sendall(subscription)
            stop.wait(0.5)


def silent_connections(place: Place, stop: Event) -> None:
    """Open 1,300 silent connections, and open them again when they are closed."""
    opened: list[socket.socket] = []
    while not stop.is_set():
        with suppress(OSError):
            while len(opened) < 1300 and not stop.is_set():
                opened.append(_tcp(place.answers if len(opened) % 2 else place.frames))
        opened = [each for each in opened if not is_ended(each)]
        stop.wait(0.1)
    for each in opened:
        each.close()


def is_ended(peer: socket.socket) -> bool:
    """Say whether the other end has closed a connection; then it is closed here, too."""
    try:
        peer.setblocking(False)  # noqa: FBT003 - the socket's own
        while peer.recv(4096):
            pass
    except BlockingIOError:
        return False
    except OSError:
        pass
    peer.close()
    return True


def _tcp(address: str) -> socket.socket:
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    return socket.create_connection((host, int(port)), 1.0)


def greeted(address: str, kind: bytes) -> socket.socket:
    """Connect as a ZeroMQ socket of some kind does."""
    peer = _tcp(address)
    ready = b"\x05READY\x0bSocket-Type" + struct.pack(">I", len(kind)) + kind
    peer.sendall(_GREETING)
    peer.recv(64)
    peer.sendall(bytes([_COMMAND, len(ready)]) + ready)
    return peer
