"""A service among fakes: a clock that a test turns, sources of what it puts in, sinks that keep what they get."""

import math
import socket
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import astuple, fields, is_dataclass
from types import UnionType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pythonosc.osc_packet import OscPacket

from kinespace.stream import Announcement, Frame, Outcome, Performers, Recognition, Recognizer
from kinespace.stream.outputs import Sink
from kinespace.stream.outputs.sink import Message
from kinespace.stream.recognition import Classes, Gone
from kinespace.stream.service.loop import Service
from kinespace.stream.status import InputCounts
from kinespace.stream.teaching import State, Step

_Kind = TypeVar("_Kind")


class FakeClock:
    """A clock that stands until a test sets it."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        """Tell the time."""
        return self.now


class FakeReceiver:
    """Takes the place of a receiver of either transport: gives the packets that a test puts in, with their senders."""

    waited = 0.0

    def __init__(self) -> None:
        self.counts = InputCounts()
        self.packets: deque[tuple[Any, tuple[str, int]]] = deque()
        self.sender: tuple[str, int] | None = None
        self.socket = self

    def receive(self) -> bytes | list[bytes] | None:
        """Give the next packet."""
        if not self.packets:
            return None
        packet, self.sender = self.packets.popleft()
        return packet


class FakeSource:
    """Packets from a list; each is the events it holds. Something seems always to be waiting on its socket."""

    place = ""
    has_put_aside = False
    notes = ()
    waited = lag = 0.0
    patience = math.inf

    def __init__(self, packets: Sequence[Sequence[Frame | Announcement]] = ()) -> None:
        self.waiting = deque(packets)
        self.arrivals: list[float] = []
        self.counts = InputCounts()
        self.pollable, self._other_end = socket.socketpair()
        self._other_end.send(b"!")

    def take(self, arrival: float) -> Sequence[Frame | Announcement] | None:
        """Give the next packet's events."""
        if not self.waiting:
            return None
        self.arrivals.append(arrival)
        self.counts.received += 1
        return self.waiting.popleft()

    def tend(self, now: float) -> Sequence[Frame]:  # noqa: ARG002 - as in a source
        """Give nothing: no work is due by the clock."""
        return ()

    def close(self) -> None:
        """Close both ends of its pair of sockets."""
        self.pollable.close()
        self._other_end.close()


class FakeSink(Sink):
    """Keeps everything it gets, in order."""

    def __init__(self) -> None:
        self.told: list[Message | tuple[str, ...]] = []
        self.gone: list[str] = []

    def send(self, message: Message) -> None:
        """Keep a message."""
        if isinstance(message, Gone):
            self.gone.append(message.performer)
        elif isinstance(message, Frame):
            super().send(message)
        else:
            self.told.append(message.names if isinstance(message, Classes) else message)

    def of(self, kind: type[_Kind] | UnionType) -> list[_Kind]:
        """Give what is of a kind; the names of classes, each time, are a tuple."""
        return [each for each in self.told if isinstance(each, kind)]

    def steps(self) -> list[Step]:
        """List the steps of the lessons that were told."""
        return [each.step for each in self.of(State)]


class Bench:
    """A service among fakes, with a clock that the test turns; every sink gets the same."""

    def __init__(self, performers: Performers, *sources: FakeSource) -> None:
        self.clock, self.sink, self.sources = FakeClock(), FakeSink(), sources
        self.service = Service(performers, sources, [self.sink], clock=self.clock)

    def step(self, seconds: float = 0.0) -> None:
        """Let some time pass, then make one step that does not wait."""
        self.clock.now += seconds
        self.service.step(0.0)

    def perform(self, frames: Sequence[Frame]) -> None:
        """Let all frames come in now."""
        (source,) = self.sources
        source.waiting.extend([frame] for frame in frames)
        while source.waiting:
            self.step()


# --- the answers of a recogniser, and answers that must be the same ---------------------------------------------------


#: The second of three classes is named.
NAMED = Recognition(
    "Ada", 4.0, Outcome.NAMED, ("bow", "jump", "wave"), np.array([0.25, 0.75, 0.5], dtype=np.float32), movement=0.2
)


def params_of(packet: bytes | None) -> dict[str, list[object]]:
    """Read a packet with python-osc: arguments by address."""
    return {timed.message.address: timed.message.params for timed in OscPacket(packet).messages}


def shown(
    positions: Iterable[NDArray[np.floating]], rate: float = 120.0, *, begin: float = 0.0, performer: str = "p"
) -> list[Frame]:
    """Make the frames of a performer from a moment on."""
    return [Frame(performer, begin + place / rate, each) for place, each in enumerate(positions)]


def pushed(recognizer: Recognizer, frames: Iterable[Frame]) -> list[Recognition]:
    """Push frames; give the answers."""
    return [answer for frame in frames if (answer := recognizer.push(frame)) is not None]


def assert_same(first: Sequence[Recognition], second: Sequence[Recognition], *others: str, within: float = 0.0) -> None:
    """Demand the same answers, bit for bit or within a share of each number, but for some fields."""
    assert len(first) == len(second) > 0
    for one, other in zip(first, second, strict=True):
        for each in fields(Recognition):
            if each.name not in others:
                _assert_near(getattr(one, each.name), getattr(other, each.name), within)


def _assert_near(one: object, other: object, within: float) -> None:
    if isinstance(one, tuple):
        assert isinstance(other, tuple)
        for first, second in zip(one, other, strict=True):
            _assert_near(first, second, within)
    elif is_dataclass(one) and is_dataclass(other) and not isinstance(one, type) and not isinstance(other, type):
        _assert_near(astuple(one), astuple(other), within)
    elif isinstance(one, float | np.ndarray):
        np.testing.assert_allclose(one, other, rtol=within, atol=within)
    else:
        assert one == other
