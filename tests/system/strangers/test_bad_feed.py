"""Bad feeds: everything that a sender does wrong is counted, and valid frames are recognised all the same."""

from __future__ import annotations

import time
from collections import Counter
from contextlib import ExitStack, closing
from dataclasses import replace
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import wrong
from fakes import FakeSink

from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Announcement, Frame
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


class Line:
    """One sender and one service over a real socket of some transport, the clock standing still."""

    _sender: Any

    def __init__(self, library: MotionLibrary, source: Source) -> None:
        self.now = 1000.0
        self.sink = FakeSink()
        self._source = source
        self.service = Service(Performers(library, SETTINGS), [source], [self.sink], clock=lambda: self.now)
        self._sent = 0

    def frame(self, frame: Frame) -> None:
        """Send a valid frame."""
        raise NotImplementedError

    def announce(self, performer: str, joints: Sequence[str]) -> None:
        """Name the joints in the next frame of any performer."""
        raise NotImplementedError

    def raw(self, *packets: object) -> None:
        """Send packets unchanged."""
        for packet in packets:
            self._sender.send(packet)
            self._arrive()
        assert self._sender.failed == 0

    def _arrive(self) -> None:
        """Wait until the service has handled all packets."""
        self._sent += 1
        until = time.monotonic() + PATIENCE
        while self._source.counts.received < self._sent:
            assert time.monotonic() < until
            self.service.step(0.1)


class OscLine(Line):
    """Over UDP."""

    def __init__(self, library: MotionLibrary, opened: ExitStack) -> None:
        source = opened.enter_context(closing(Source(osc.OscReceiver(LOOPBACK, 0), OscDecoder())))
        self._sender = opened.enter_context(closing(osc.OscSender(*source.receiver.address)))
        super().__init__(library, source)

    def frame(self, frame: Frame) -> None:
        """Send `/motion/frame`."""
        self.raw(osc.encode_frame(frame))

    def announce(self, performer: str, joints: Sequence[str]) -> None:
        """Send `/motion/skeleton`."""
        self.raw(osc.encode_announcement(Announcement(performer, tuple(joints))))


class ZmqLine(Line):
    """Over ZeroMQ within the process, which delivers at once; frames are numbered."""

    def __init__(self, library: MotionLibrary, opened: ExitStack) -> None:
        address = f"inproc://line-{next(_NUMBERS)}"
        receiver = zeromq.ZmqReceiver(Endpoint(address, bind=True))
        source = opened.enter_context(closing(Source(receiver, ZmqDecoder())))
        endpoint = Endpoint(address, bind=False)
        self._sender = opened.enter_context(closing(zeromq.ZmqSender(endpoint)))
        self.seq = 0
        self._joints: Sequence[str] | None = None
        super().__init__(library, source)
        while not self.service.status().inputs.received:
            self._sender.send([b"hello/", b""])
            self.service.step(0.05)
        self._sent = self.service.status().inputs.received

    def frame(self, frame: Frame) -> None:
        """Send the next frame."""
        self.raw(zeromq.encode_frame(frame, self.seq, self._joints))
        self.seq += 1
        self._joints = None

    def announce(self, performer: str, joints: Sequence[str]) -> None:
        """Name the joints in the next frame of any performer."""
        del performer
        self._joints = joints


LINES = {"osc": OscLine, "zmq": ZmqLine}
#: For what does not depend on the transport.
by_osc = pytest.mark.parametrize("transport", ["osc"])
both_transports = pytest.mark.parametrize("transport", sorted(LINES))


@pytest.fixture(scope="module")
def library(small_library: MotionLibrary) -> MotionLibrary:
    """Give the library of these tests."""
    return small_library


@pytest.fixture
def line(library: MotionLibrary, transport: str) -> Iterator[Line]:
    """Open a feed to a service by one transport."""
    with ExitStack() as opened:
        yield LINES[transport](library, opened)


@pytest.fixture(scope="module")
def clip(some_clips: tuple[Clip, ...]) -> Clip:
    """Give a clip that is named right."""
    return next(clip for clip in some_clips if clip.class_name == "squat1Reps")


def _frames(clip: Clip, *, start: float = 10.0, performer: str = "p") -> list[Frame]:
    """Play a clip as the wire carries it."""
    return [
        Frame(performer, start + index / 120, positions.astype(np.float32))
        for index, positions in enumerate(clip.positions)
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


@both_transports
def test_everything_at_once(line: Line, library: MotionLibrary, clip: Clip, transport: str) -> None:
    """With all that is wrong between the frames, each in its counter and no other, all answers are as without it."""
    frames, before = _frames(clip), _counters(line.service.status())
    bad = [(counter, packet) for counter, packets in PACKETS[transport].items() for packet in packets.values()]
    shares = np.array_split(np.random.default_rng(18).permutation(len(bad)), len(frames))
    for frame, share in zip(frames, shares, strict=True):
        line.frame(frame)
        line.raw(*(bad[place][1] for place in share))
    line.raw(wrong.late(frames[-1].time - 0.1)[transport == "zmq"])
    after = _counters(line.service.status())
    expected = dict.fromkeys(after, 0) | Counter(counter for counter, _ in bad) | {"out_of_order": 1}
    assert {name: after[name] - before[name] for name in after} == expected
    _assert_same(line.sink.recognitions, _alone(library, frames))
    assert clip.class_name in {answer.label for answer in line.sink.recognitions}


# --- feeds that misbehave ----------------------------------------------------------------------------------------


@both_transports
@pytest.mark.parametrize("swap", ["neighbours", "three back"])
def test_frames_out_of_order(line: Line, library: MotionLibrary, clip: Clip, swap: str) -> None:
    """Late frames are counted, none is missing, and the others are answered."""
    frames = _frames(clip)
    distance = {"neighbours": 1, "three back": 3}[swap]
    order = list(range(len(frames)))
    for place in range(5, len(frames) - 5, 7):
        order.insert(place + distance, order.pop(place))
    newest, late = -1, 0
    in_time = list[Frame]()
    for index in order:
        if isinstance(line, ZmqLine):
            line.seq = index
        line.frame(frames[index])
        late += index < newest
        in_time += [frames[index]] if index > newest else []
        newest = max(newest, index)
    counters = _counters(line.service.status())
    assert counters["out_of_order"] == late > 15
    assert (counters["missing"], counters["restarts"]) == (0, 0)
    _assert_same(line.sink.recognitions, _alone(library, in_time))


@by_osc
def test_every_frame_twice(line: Line, library: MotionLibrary, clip: Clip) -> None:
    """Of a feed that sends each frame twice, as two network paths do, one of each is used and one counted."""
    frames = _frames(clip)
    for frame in frames:
        line.frame(frame)
        line.frame(frame)
    assert _counters(line.service.status())["out_of_order"] == len(frames)
    _assert_same(line.sink.recognitions, _alone(library, frames))


@by_osc
@pytest.mark.parametrize("pause", [2.0, 30.0])
def test_a_feed_that_stops_and_comes_back(line: Line, library: MotionLibrary, clip: Clip, pause: float) -> None:
    """After a pause, short or so long that the performer was dropped, the feed is answered like one that begins."""
    first = _frames(clip)
    second = _frames(clip, start=first[-1].time + pause)
    for frame in first:
        line.frame(frame)
    line.now += pause
    for _ in range(3):
        line.service.step(0.0)
    for frame in second:
        line.frame(frame)
    status = line.service.status()
    dropped = pause > 5.0
    assert (status.outcomes.dropped, status.outcomes.recognizers.restarts) == (int(dropped), int(not dropped))
    assert status.outcomes.recognizers.frames == len(first) + len(second)
    _assert_same(line.sink.recognitions, [*_alone(library, first), *_alone(library, second)])


@both_transports
@pytest.mark.parametrize("start", [0.0, 1e-3, 5.0])
def test_a_sender_that_was_restarted(line: Line, library: MotionLibrary, clip: Clip, start: float) -> None:
    """A sender that begins again with number 0 and an early time, or 0, is followed at once; nothing is lost."""
    first, second = _frames(clip, start=100.0), _frames(clip, start=start)
    for frame in first:
        line.frame(frame)
    if isinstance(line, ZmqLine):
        line.seq = 0
    for frame in second:
        line.frame(frame)
    counters = _counters(line.service.status())
    # A frame of time 0 is one that happened on arrival, by our clock: a clock of its own, and a restart more.
    assert counters["restarts"] == (1 if start else 2)
    assert (counters["missing"], counters["out_of_order"], counters["malformed"]) == (0, 0, 0)
    _assert_same(line.sink.recognitions, [*_alone(library, first), *_alone(library, second if start else second[1:])])


@by_osc
def test_time_running_backwards(line: Line, library: MotionLibrary, clip: Clip) -> None:
    """A feed whose time runs backwards is counted and not answered; forwards again it is recognised."""
    frames = _frames(clip)
    for frame in frames[::-1]:
        line.frame(frame)
    status = line.service.status()
    recognizers = status.outcomes.recognizers
    assert not line.sink.recognitions
    assert recognizers.out_of_order + recognizers.frames == len(frames)
    assert recognizers.out_of_order > recognizers.frames
    assert status.lost == recognizers.out_of_order
    forwards = _frames(clip, start=20.0)
    for frame in forwards:
        line.frame(frame)
    _assert_same(line.sink.recognitions, _alone(library, forwards))


@by_osc
@pytest.mark.parametrize("unit", [1e3, 1e6, 1e9], ids=["ms", "us", "ns"])
def test_a_clock_in_other_units(line: Line, library: MotionLibrary, clip: Clip, unit: float) -> None:
    """A sender that counts milli-, micro- or nanoseconds shows in the restarts, and does not disturb another."""
    frames = _frames(clip)
    for frame in frames:
        line.frame(frame)
        line.frame(replace(frame, performer="q", time=(1.7e9 + frame.time) * unit))
    assert _counters(line.service.status())["restarts"] == len(frames) - 1
    _assert_same(line.sink.recognitions, _alone(library, frames))


@by_osc
def test_too_many_performers(line: Line, library: MotionLibrary, clip: Clip) -> None:
    """Made-up names beyond the room are counted, and earlier performers are answered."""
    frames = _frames(clip)
    for index, frame in enumerate(frames):
        line.frame(frame)
        line.frame(replace(frame, performer=f"made up {index}"))
    assert len(line.service.status().performers) == 32
    assert _counters(line.service.status())["no_room"] == len(frames) - 31
    _assert_same(line.sink.recognitions, _alone(library, frames))
