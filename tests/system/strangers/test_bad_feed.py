"""Bad feeds: everything that a sender does wrong is counted, and valid frames are recognised all the same."""

from __future__ import annotations

import time
from collections import Counter
from contextlib import ExitStack, closing
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import wrong
from fakes import FakeSink

from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Frame
from kinespace.stream.inputs import OscDecoder, Source, ZmqDecoder
from kinespace.stream.recognizer import Performers, Recognizer, Settings
from kinespace.stream.service.loop import Service
from kinespace.stream.zeromq import Endpoint

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from kinespace.library.clip import Clip
    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognition import Recognition
    from kinespace.stream.status import Status

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_waiting")]

LOOPBACK = "127.0.0.1"
#: Seconds a test waits for a packet that was sent, before it gives up.
PATIENCE = 20.0
#: For addresses that nobody else has.
_NUMBERS = count()
SETTINGS = Settings(hop=0.04)
_DECODERS = {"osc": OscDecoder, "zmq": ZmqDecoder}


class Line:
    """One sender of numbered frames and one service over a real socket of some transport, the clock standing still."""

    def __init__(self, library: MotionLibrary, transport: str, opened: ExitStack) -> None:
        if transport == "osc":
            receiver: Any = osc.OscReceiver(LOOPBACK, 0)
            sender: Any = osc.OscSender(*receiver.address)
        else:
            # Within the process, which delivers at once.
            address = f"inproc://line-{next(_NUMBERS)}"
            receiver = zeromq.ZmqReceiver(Endpoint(address, bind=True))
            sender = zeromq.ZmqSender(Endpoint(address, bind=False))
        self.transport, self.seq, self.sink = transport, 0, FakeSink()
        self._source = opened.enter_context(closing(Source(receiver, _DECODERS[transport]())))
        self._sender = opened.enter_context(closing(sender))
        self.service = Service(Performers(library, SETTINGS), [self._source], [self.sink], clock=lambda: 1000.0)
        # Until the subscription has come a publisher sends nothing.
        while transport == "zmq" and not self._source.counts.received:
            self._sender.send([b"hello/", b""])
            self.service.step(0.05)

    def frame(self, frame: Frame) -> None:
        """Send the next frame."""
        self.raw(osc.encode_frame(frame) if self.transport == "osc" else zeromq.encode_frame(frame, self.seq))
        self.seq += 1

    def raw(self, *packets: object) -> None:
        """Send packets unchanged, and wait until the service has handled each."""
        for packet in packets:
            before, until = self._source.counts.received, time.monotonic() + PATIENCE
            self._sender.send(packet)
            while self._source.counts.received == before:
                assert time.monotonic() < until
                self.service.step(0.1)
        assert self._sender.failed == 0


@pytest.fixture(params=["osc", "zmq"])
def line(small_library: MotionLibrary, request: pytest.FixtureRequest) -> Iterator[Line]:
    """Open a feed to a service by one transport."""
    with ExitStack() as opened:
        yield Line(small_library, request.param, opened)


@pytest.fixture(scope="module")
def clip(some_clips: tuple[Clip, ...]) -> Clip:
    """Give a clip that is named right."""
    return next(clip for clip in some_clips if clip.class_name == "squat1Reps")


def _frames(clip: Clip, start: float = 10.0) -> list[Frame]:
    """Play a clip as the wire carries it."""
    return [
        Frame("p", start + index / 120, positions.astype(np.float32)) for index, positions in enumerate(clip.positions)
    ]


def _alone(library: MotionLibrary, frames: Sequence[Frame]) -> list[Recognition]:
    recognizer = Recognizer(library, SETTINGS)
    return [answer for frame in frames if (answer := recognizer.push(frame)) is not None]


def _assert_same(found: Sequence[Recognition], expected: Sequence[Recognition]) -> None:
    """Demand the same answers, bit for bit."""
    assert [answer.time for answer in found] == [answer.time for answer in expected]
    assert [answer.label for answer in found] == [answer.label for answer in expected]
    assert all(one.scores.tobytes() == other.scores.tobytes() for one, other in zip(found, expected, strict=True))
    assert len(found) > 15


# --- bad packets between good frames -----------------------------------------------------------------------------


#: What is counted, with packets that show there and nowhere else.
OSC_PACKETS = {"malformed": wrong.MALFORMED_OSC, "foreign": wrong.FOREIGN_OSC, "other_joints": wrong.OTHER_JOINTS_OSC}
ZMQ_PACKETS = {"malformed": wrong.MALFORMED_ZMQ, "foreign": wrong.FOREIGN_ZMQ, "other_joints": wrong.OTHER_JOINTS_ZMQ}
PACKETS = {"osc": OSC_PACKETS, "zmq": ZMQ_PACKETS}


def _counters(status: Status) -> dict[str, int]:
    """Give every counter in which something unused may show."""
    inputs, outcomes = status.inputs, status.outcomes
    return {
        "malformed": inputs.malformed,
        "foreign": inputs.foreign,
        "overrun": inputs.overrun,
        "missing": inputs.missing,
        "no_room": outcomes.no_room,
        "other_joints": outcomes.other_joints,
        "out_of_order": outcomes.recognizers.out_of_order,
        "restarts": outcomes.recognizers.restarts,
    }


def test_everything_at_once(line: Line, small_library: MotionLibrary, clip: Clip) -> None:
    """With all that is wrong between the frames, each in its counter and no other, all answers are as without it."""
    frames, before = _frames(clip), _counters(line.service.status())
    bad = [(counter, packet) for counter, packets in PACKETS[line.transport].items() for packet in packets.values()]
    shares = np.array_split(np.random.default_rng(18).permutation(len(bad)), len(frames))
    for frame, share in zip(frames, shares, strict=True):
        line.frame(frame)
        line.raw(*(bad[place][1] for place in share))
    line.raw(wrong.late(frames[-1].time - 0.1)[line.transport == "zmq"])
    after = _counters(line.service.status())
    expected = dict.fromkeys(after, 0) | Counter(counter for counter, _ in bad) | {"out_of_order": 1}
    assert {name: after[name] - before[name] for name in after} == expected
    _assert_same(line.sink.recognitions, _alone(small_library, frames))
    assert clip.class_name in {answer.label for answer in line.sink.recognitions}


# --- feeds that misbehave ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [0.0, 1e-3, 5.0])
def test_a_sender_that_was_restarted(line: Line, small_library: MotionLibrary, clip: Clip, start: float) -> None:
    """A sender that begins again with number 0 and an early time, or 0, is followed at once; nothing is lost."""
    first, second = _frames(clip, 100.0), _frames(clip, start)
    for frame in first:
        line.frame(frame)
    line.seq = 0
    for frame in second:
        line.frame(frame)
    counters = _counters(line.service.status())
    # A frame of time 0 is one that happened on arrival, by our clock: a clock of its own, and a restart more.
    assert counters["restarts"] == (1 if start else 2)
    assert (counters["missing"], counters["out_of_order"], counters["malformed"]) == (0, 0, 0)
    _assert_same(
        line.sink.recognitions, [*_alone(small_library, first), *_alone(small_library, second if start else second[1:])]
    )
