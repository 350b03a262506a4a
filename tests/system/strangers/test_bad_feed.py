"""Bad feeds: everything that a sender does wrong is counted, and valid frames are recognised all the same."""

from __future__ import annotations

import json
import pickle
import struct
import time
from contextlib import ExitStack, closing
from dataclasses import replace
from itertools import count
from typing import TYPE_CHECKING, Protocol

import numpy as np
import pytest
from pythonosc.osc_message_builder import OscMessageBuilder

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.inputs import OscDecoder, Source, ZmqDecoder
from kinespace.stream.outputs import Sink
from kinespace.stream.recognizer import Performers, Recognizer, Settings
from kinespace.stream.service.loop import Service
from kinespace.stream.zeromq import Endpoint

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from kinespace.library.clip import Clip
    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.service.status import Status

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_waiting")]

LOOPBACK = "127.0.0.1"
#: Seconds a test waits for a packet that was sent, before it gives up.
PATIENCE = 20.0
JOINTS = SKELETON.joints
#: For addresses that nobody else has.
_NUMBERS = count()
SETTINGS = Settings(hop=0.04)


class Kept(Sink):
    """A sink that keeps all recognitions."""

    def __init__(self) -> None:
        self.failed = 0
        self.recognitions: list[Recognition] = []

    def publish(self, recognition: Recognition) -> None:
        """Keep one."""
        self.recognitions.append(recognition)

    def publish_event(self, event: Event) -> None:
        """Pass over events."""

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Pass over."""

    def publish_status(self, status: Status) -> None:
        """Pass over."""

    def close(self) -> None:
        """Do nothing."""


class Line(Protocol):
    """One sender and one service over a real socket of some transport, the clock standing still."""

    service: Service
    sink: Kept

    def frame(self, frame: Frame) -> None:
        """Send a valid frame."""

    def announce(self, performer: str, joints: Sequence[str]) -> None:
        """Name the joints in the next frame of any performer."""

    def raw(self, *packets: object) -> None:
        """Send packets unchanged."""


class _Line:
    def __init__(self, library: MotionLibrary, source: Source) -> None:
        self.now = 1000.0
        self.sink = Kept()
        self._source = source
        self.service = Service(Performers(library, SETTINGS), [source], [self.sink], clock=lambda: self.now)
        self._sent = 0

    def _arrive(self) -> None:
        """Wait until the service has handled all packets."""
        self._sent += 1
        until = time.monotonic() + PATIENCE
        while self._source.counts.received < self._sent:
            assert time.monotonic() < until
            self.service.step(0.1)


class OscLine(_Line):
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

    def raw(self, *packets: object) -> None:
        """Send datagrams."""
        for packet in packets:
            assert isinstance(packet, bytes)
            self._sender.send(packet)
            self._arrive()
        assert self._sender.failed == 0


class ZmqLine(_Line):
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

    def raw(self, *packets: object) -> None:
        """Send messages."""
        for packet in packets:
            assert isinstance(packet, list)
            self._sender.send(packet)
            self._arrive()
        assert self._sender.failed == 0


LINES = {"osc": OscLine, "zmq": ZmqLine}
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


def _message(address: str, *arguments: tuple[str, object]) -> bytes:
    builder = OscMessageBuilder(address)
    for kind, value in arguments:
        builder.add_arg(value, kind)
    return builder.build().dgram


def _osc_frame(numbers: Sequence[float], performer: str = "p", moment: float = 11.0) -> bytes:
    return _message("/motion/frame", ("s", performer), ("d", moment), *[("f", float(number)) for number in numbers])


def _zmq_frame(numbers: Sequence[float], performer: str = "p", **changes: object) -> list[bytes]:
    positions = np.array(numbers, dtype="<f4")
    header = {"v": 1, "t": 11.0, "shape": [len(positions) // 3, 3], "dtype": "<f4"} | changes
    return [f"frame/{performer}/".encode(), json.dumps(header).encode(), positions.tobytes()]


_RANDOM = np.random.default_rng(17)
_POSE = _RANDOM.normal(size=93).tolist()
_ALL_ARE_NAN, _ONE_IS_INFINITE = [float("nan")] * 93, [float("-inf"), *_POSE[1:]]
_BOTH_INFINITIES = [float("inf"), float("-inf"), *_POSE[2:]]
_MAX_FRAME = np.zeros(13_080)

OSC_PACKETS: dict[str, tuple[str, bytes]] = {
    "empty": ("malformed", b""),
    "random bytes": ("malformed", _RANDOM.bytes(300)),
    "random bytes of 64 kB": ("malformed", _RANDOM.bytes(65_507)),
    "a message of 64 kB": ("malformed", b"/motion/frame\0\0\0,sd" + b"f" * 65_488),
    "arrays in arrays of 64 kB": ("malformed", b"/motion/skeleton\0\0\0\0,%b\0\0\0" % (b"[" * 32_000 + b"]" * 32_000)),
    "a frame of 64 kB": ("other_joints", _osc_frame(_MAX_FRAME)),
    "bundles in bundles": ("malformed", b"#bundle\0\0\0\0\0\0\0\0\1\0\0\0\x10" * 100),
    "cut off": ("malformed", _osc_frame(_POSE)[:-3]),
    "a float too many": ("malformed", _osc_frame([*_POSE, 1.0])),
    "a float too few": ("malformed", _osc_frame(_POSE[:-1])),
    "a joint too many": ("other_joints", _osc_frame([*_POSE, 1.0, 2.0, 3.0])),
    "a joint too few": ("other_joints", _osc_frame(_POSE[:-3])),
    "no joint": ("other_joints", _osc_frame([])),
    "NaN": ("malformed", _osc_frame(_ALL_ARE_NAN)),
    "infinity": ("malformed", _osc_frame(_ONE_IS_INFINITE)),
    "both infinities": ("malformed", _osc_frame(_BOTH_INFINITIES)),
    "beyond any stage": ("malformed", _osc_frame([3e38] * 93)),
    "time is NaN": ("malformed", _osc_frame(_POSE, moment=float("nan"))),
    "no performer": ("malformed", _osc_frame(_POSE, performer="")),
    "joint names that are none": ("malformed", _message("/motion/skeleton", ("s", "p"), ("i", 1))),
    "a joint twice": ("malformed", _message("/motion/skeleton", ("s", "p"), ("s", "head"), ("s", "head"))),
    "out of date": ("out_of_order", _osc_frame(_POSE, moment=10.15)),
    "somebody else's": ("foreign", _message("/VMC/Ext/Bone/Pos", ("s", "Hips"), *[("f", 0.5)] * 7)),
}

ZMQ_PACKETS: dict[str, tuple[str, list[bytes]]] = {
    "empty": ("foreign", [b""]),
    "random bytes": ("foreign", [_RANDOM.bytes(300)]),
    "random bytes with our topic": ("malformed", [b"frame/p/", _RANDOM.bytes(300), _RANDOM.bytes(300)]),
    "64 kB": ("malformed", [b"frame/p/", _RANDOM.bytes(65_536), _RANDOM.bytes(65_536)]),
    "a topic alone": ("malformed", [b"frame/p/"]),
    "four parts": ("malformed", [*_zmq_frame(_POSE), b""]),
    "no performer": ("malformed", _zmq_frame(_POSE, performer="")),
    "a pickle": ("malformed", [b"frame/p/", pickle.dumps({"v": 1}), pickle.dumps(_POSE)]),
    "an array of objects": ("malformed", _zmq_frame(_POSE, dtype="O")),
    "another type": ("malformed", _zmq_frame(_POSE, dtype="<i4")),
    "a size that does not fit": ("malformed", _zmq_frame(_POSE, shape=[30, 3])),
    "a size beyond memory": ("malformed", _zmq_frame(_POSE, shape=[2**60, 3])),
    "another version": ("malformed", _zmq_frame(_POSE, v=2)),
    "JSON to exhaust the stack": ("malformed", [b"frame/p/", b"[" * 60_000, b""]),
    "a joint too many": ("other_joints", _zmq_frame([*_POSE, 1.0, 2.0, 3.0])),
    "a joint too few": ("other_joints", _zmq_frame(_POSE[:-3])),
    "NaN": ("malformed", _zmq_frame(_ALL_ARE_NAN)),
    "infinity": ("malformed", _zmq_frame(_ONE_IS_INFINITE)),
    "both infinities": ("malformed", _zmq_frame(_BOTH_INFINITIES)),
    "doubles beyond any stage": (
        "malformed",
        [b"frame/p/", _zmq_frame(_POSE, dtype="<f8")[1], np.full(93, 1e200).tobytes()],
    ),
    "time is infinite": ("malformed", _zmq_frame(_POSE, t=float("inf"))),
    "out of date": ("out_of_order", _zmq_frame(_POSE, t=10.15)),
    "an answer": ("foreign", [b"class/p/", b"{}"]),
}

_CASES = [
    *(("osc", name, counter, packet) for name, (counter, packet) in OSC_PACKETS.items()),
    *(("zmq", name, counter, packet) for name, (counter, packet) in ZMQ_PACKETS.items()),
]


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


@pytest.mark.parametrize(
    ("transport", "counter", "packet"),
    [(transport, counter, packet) for transport, _, counter, packet in _CASES],
    ids=[f"{transport}: {name}" for transport, name, _, _ in _CASES],
)
def test_a_bad_packet_is_counted_and_nothing_else(
    line: Line, library: MotionLibrary, clip: Clip, counter: str, packet: object
) -> None:
    """Sent thrice between valid frames it shows in its counter and in no other, and all answers are as without it."""
    frames = _frames(clip)
    line.frame(frames[0])
    before = _counters(line.service.status())
    for index, frame in enumerate(frames[1:], start=1):
        line.frame(frame)
        if index in (20, 70, 71):
            line.raw(packet)
    after = _counters(line.service.status())
    assert {name: after[name] - before[name] for name in after} == dict.fromkeys(after, 0) | {counter: 3}
    _assert_same(line.sink.recognitions, _alone(library, frames))
    assert clip.class_name in {answer.label for answer in line.sink.recognitions}


@pytest.mark.parametrize("transport", ["osc"])
def test_everything_at_once(line: Line, library: MotionLibrary, clip: Clip) -> None:
    """With something bad after every single frame, chosen by chance, every counter is right and no answer is lost."""
    generator = np.random.default_rng(18)
    frames, expected = _frames(clip), dict.fromkeys(_counters(line.service.status()), 0)
    names = list(OSC_PACKETS)
    line.raw(osc.encode_frame(frames[0]))
    for frame in frames[1:]:
        counter, packet = OSC_PACKETS[names[int(generator.integers(len(names)))]]
        if counter == "out_of_order":
            packet = osc.encode_frame(replace(frame, time=frame.time - 0.1))
        line.frame(frame)
        line.raw(packet)
        expected[counter] += 1
    assert _counters(line.service.status()) == expected
    assert min(expected[name] for name in ("malformed", "foreign", "other_joints", "out_of_order")) > 0
    _assert_same(line.sink.recognitions, _alone(library, frames))


# --- feeds that misbehave ----------------------------------------------------------------------------------------


@both_transports
def test_an_unknown_joint_is_announced(line: Line, library: MotionLibrary, clip: Clip) -> None:
    """Frames of a body of which four joints are known are counted and not used; other and later frames are."""
    frames = _frames(clip)
    line.announce("stranger", (*(f"tail {place}" for place in range(27)), *JOINTS[27:]))
    line.frame(replace(frames[0], performer="stranger"))
    for index, frame in enumerate(frames):
        line.frame(frame)
        if index % 10 == 0:
            line.frame(replace(frame, performer="stranger"))
    strange = 1 + (len(frames) + 9) // 10
    assert line.service.status().outcomes.other_joints == strange
    _assert_same(line.sink.recognitions, _alone(library, frames))
    line.sink.recognitions.clear()
    line.announce("stranger", JOINTS)
    again = _frames(clip, performer="stranger", start=50.0)
    for frame in again:
        line.frame(frame)
    assert line.service.status().outcomes.other_joints == strange
    _assert_same(line.sink.recognitions, _alone(library, again))


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


@both_transports
def test_every_frame_twice(line: Line, library: MotionLibrary, clip: Clip) -> None:
    """Of a feed that sends each frame twice, as two network paths do, one of each is used and one counted."""
    frames = _frames(clip)
    for frame in frames:
        line.frame(frame)
        line.frame(frame)
    assert _counters(line.service.status())["out_of_order"] == len(frames)
    _assert_same(line.sink.recognitions, _alone(library, frames))


@both_transports
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


@both_transports
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


@pytest.mark.parametrize("transport", ["zmq"])
@pytest.mark.parametrize("jump", [2, 50, 10**6, 2**62])
def test_skipped_numbers_are_missing_frames(line: Line, library: MotionLibrary, clip: Clip, jump: int) -> None:
    """Skipped numbers count as missing, all frames are used, and the status can still be sent."""
    assert isinstance(line, ZmqLine)
    frames = _frames(clip)
    for index, frame in enumerate(frames):
        line.seq += jump - 1 if index == 30 else 0
        line.frame(frame)
    status = line.service.status()
    assert status.inputs.missing == jump - 1 == status.lost
    assert osc.encode_status(status)[-4:] == struct.pack(">i", min(jump - 1, 2**31 - 1))
    assert json.loads(zeromq.encode_status(status)[1])["lost"] == jump - 1
    _assert_same(line.sink.recognitions, _alone(library, frames))


@both_transports
@pytest.mark.parametrize("unit", [1e3, 1e6, 1e9], ids=["ms", "us", "ns"])
def test_a_clock_in_other_units(line: Line, library: MotionLibrary, clip: Clip, unit: float) -> None:
    """A sender that counts milli-, micro- or nanoseconds shows in the restarts, and does not disturb another."""
    frames = _frames(clip)
    for frame in frames:
        line.frame(frame)
        if isinstance(line, ZmqLine):
            line.seq -= 1
        line.frame(replace(frame, performer="q", time=(1.7e9 + frame.time) * unit))
    assert _counters(line.service.status())["restarts"] == len(frames) - 1
    _assert_same(line.sink.recognitions, _alone(library, frames))


@both_transports
def test_too_many_performers(line: Line, library: MotionLibrary, clip: Clip) -> None:
    """Made-up names beyond the room are counted, and earlier performers are answered."""
    frames = _frames(clip)
    for index, frame in enumerate(frames):
        line.frame(frame)
        if isinstance(line, ZmqLine):
            line.seq -= 1
        line.frame(replace(frame, performer=f"made up {index}"))
    assert len(line.service.status().performers) == 32
    assert _counters(line.service.status())["no_room"] == len(frames) - 31
    _assert_same(line.sink.recognitions, _alone(library, frames))


@both_transports
def test_random_bytes_for_a_while(line: Line, library: MotionLibrary, clip: Clip) -> None:
    """Five hundred packets of random bytes that begin as ours do are all counted, and leave the feed alone."""
    generator = np.random.default_rng(19)
    frames = _frames(clip)

    def dressed() -> object:
        if isinstance(line, ZmqLine):
            return [b"frame/p/", generator.bytes(50), generator.bytes(372)]
        return osc.encode_frame(frames[0])[:40] + generator.bytes(300)

    before = line.service.status().inputs
    for frame in frames[:5]:
        line.frame(frame)
    for _ in range(500):
        line.raw(dressed())
    for frame in frames[5:]:
        line.frame(frame)
    inputs = line.service.status().inputs
    assert inputs.malformed - before.malformed == 500
    assert inputs.received - before.received == 500 + len(frames)
    _assert_same(line.sink.recognitions, _alone(library, frames))
