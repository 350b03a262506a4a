"""The loop: packets of every source are counted and answered to every sink, and none stops the loop."""

from __future__ import annotations

import dataclasses
import json
import math
import socket
import sys
import threading
import time
from collections import deque
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import numpy as np
import pytest
import zmq
from pythonosc.osc_packet import OscPacket
from synthetic import STICK, STICK_CLASSES, stick_clip

from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.inputs import OscDecoder, Source, ZmqDecoder
from kinespace.stream.osc import udp
from kinespace.stream.outputs import LayoutSink, NativeLayout, Sink, ZmqSink
from kinespace.stream.recognition import Answer
from kinespace.stream.recognizer import Performers, Recognizer, Settings
from kinespace.stream.service import loop as service_module
from kinespace.stream.service.loop import CLASSES_EVERY, STATUS_EVERY, Service
from kinespace.stream.service.status import InputCounts
from kinespace.stream.zeromq import Endpoint

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.service.status import Status

LOOPBACK = "127.0.0.1"
ANY_PORT = Endpoint(f"tcp://{LOOPBACK}:*", bind=True)
#: Seconds a test waits for something that must happen, before it gives up.
PATIENCE = 20.0


@pytest.fixture(scope="module")
def library(sticks: MotionLibrary) -> MotionLibrary:
    """Give the library of these tests."""
    return sticks


def _frames(class_name: str, performer: str = "p", *, frames: int = 200, start: float = 1.0) -> list[Frame]:
    positions = stick_clip(class_name, seed=80, frames=frames).positions.astype(np.float32)
    return [Frame(performer, start + index / 120, each) for index, each in enumerate(positions)]


def _expected(library: MotionLibrary, frames: Sequence[Frame]) -> list[Recognition]:
    recognizer = Recognizer(library)
    return [answer for frame in frames if (answer := recognizer.push(frame)) is not None]


# --- fakes -------------------------------------------------------------------------------------------------------


class FakeClock:
    """A clock that stands until a test sets it."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        """Tell the time."""
        return self.now


class FakeSource:
    """Packets from a list; each is the events it holds. Something seems always to be waiting on its socket."""

    tended_within = math.inf
    has_put_aside = False
    notes = ()
    waited = 0.0

    def __init__(self, packets: Sequence[Sequence[Frame | Announcement]] = ()) -> None:
        self.waiting = deque(packets)
        self.arrivals: list[float] = []
        self.counts = InputCounts()
        self.pollable, self._other_end = socket.socketpair()
        self._other_end.send(b"!")
        self.closed = False

    def take(self, arrival: float) -> Sequence[Frame | Announcement] | None:
        """Give the next packet's events."""
        if not self.waiting:
            return None
        self.arrivals.append(arrival)
        self.counts.received += 1
        return self.waiting.popleft()

    def close(self) -> None:
        """Note that it was closed."""
        self.closed = True
        self.pollable.close()
        self._other_end.close()


class FakeSink(Sink):
    """Keeps everything it gets."""

    def __init__(self) -> None:
        self.recognitions: list[Recognition] = []
        self.classes: list[tuple[str, ...]] = []
        self.statuses: list[Status] = []
        self.events: list[Event] = []
        self.closed = False

    def publish(self, recognition: Recognition) -> None:
        """Keep a recognition."""
        self.recognitions.append(recognition)

    def publish_event(self, event: Event) -> None:
        """Keep an event."""
        self.events.append(event)

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Keep the classes."""
        self.classes.append(tuple(classes))

    def publish_status(self, status: Status) -> None:
        """Keep a status."""
        self.statuses.append(status)

    def close(self) -> None:
        """Close nothing, but remember it."""
        self.closed = True


class Bench:
    """A service among fakes, with a clock that the test turns."""

    def __init__(self, performers: Performers, *sources: FakeSource) -> None:
        self.clock, self.sink = FakeClock(), FakeSink()
        self.sources = sources
        self.service = Service(performers, sources, [self.sink], clock=self.clock)

    def step(self, seconds: float = 0.0) -> None:
        """Let some time pass, then make one step that does not wait."""
        self.clock.now += seconds
        self.service.step(0.0)


@pytest.fixture
def source() -> Iterator[FakeSource]:
    """Open a source that gives what a test puts into it."""
    source = FakeSource()
    yield source
    source.close()


@pytest.fixture
def bench(library: MotionLibrary, source: FakeSource) -> Bench:
    """Give a service with one source."""
    return Bench(Performers(library), source)


@pytest.fixture
def opened() -> Iterator[ExitStack]:
    """Close everything that a test opens, also when the test fails."""
    with ExitStack() as stack:
        yield stack


# --- the loop, among fakes ---------------------------------------------------------------------------------------


def test_all_that_waits_is_answered_to_all(library: MotionLibrary, source: FakeSource) -> None:
    """One step takes all waiting packets, and every sink gets the recogniser's answers."""
    frames = _frames("bow")
    source.waiting.extend([frame] for frame in frames)
    sinks = [FakeSink(), FakeSink()]
    Service(Performers(library), [source], sinks).step(0.0)
    expected = _expected(library, frames)
    for sink in sinks:
        assert [answer.time for answer in sink.recognitions] == [answer.time for answer in expected]
        assert [answer.label for answer in sink.recognitions] == ["bow"] * len(expected)


def test_a_packet_may_hold_several_events(bench: Bench, library: MotionLibrary) -> None:
    """Announcements and frames of one packet are dealt with in their order."""
    order = [5, 4, 3, 2, 1, 0]
    frames = _frames("wave")
    announcement = Announcement("p", STICK.joints[::-1])
    turned = [dataclasses.replace(frame, positions=frame.positions[order]) for frame in frames]
    bench.sources[0].waiting.append([announcement, *turned])
    bench.step()
    expected = _expected(library, frames)
    assert [answer.time for answer in bench.sink.recognitions] == [answer.time for answer in expected]
    assert {answer.label for answer in bench.sink.recognitions} == {"wave"}


def test_one_busy_source_does_not_silence_the_others(library: MotionLibrary, opened: ExitStack) -> None:
    """When more waits than one step takes, each source gets its turn, and the rest is taken by the next steps."""
    feeds = [_frames("bow", name, frames=600) for name in ("a", "b")]
    sources = [opened.enter_context(closing(FakeSource([[frame] for frame in feed]))) for feed in feeds]
    bench = Bench(Performers(library), *sources)
    bench.step()
    assert {answer.performer for answer in bench.sink.recognitions} == {"a", "b"}
    assert 0 < len(sources[0].waiting) == len(sources[1].waiting) < 600
    for _ in range(3):
        bench.step()
    assert not sources[0].waiting
    assert bench.service.status().outcomes.recognizers.frames == 1200


def test_classes_and_status_are_sent_on_time(bench: Bench) -> None:
    """Both are sent at the start, then the status every second and the classes every five."""
    bench.step()
    assert (len(bench.sink.classes), len(bench.sink.statuses)) == (1, 1)
    for _ in range(100):
        bench.step(0.1)
    assert len(bench.sink.statuses) == pytest.approx(1 + 10 / STATUS_EVERY, abs=1)
    assert len(bench.sink.classes) == pytest.approx(1 + 10 / CLASSES_EVERY, abs=1)
    assert set(bench.sink.classes) == {STICK_CLASSES}


def test_after_a_long_sleep_nothing_is_made_up_for(bench: Bench) -> None:
    """When the clock jumps by an hour, one status is sent, not three thousand."""
    bench.step()
    bench.step(3600.0)
    for _ in range(5):
        bench.step(0.01)
    assert (len(bench.sink.classes), len(bench.sink.statuses)) == (2, 2)


def test_arrivals_are_stamped_by_the_clock(bench: Bench) -> None:
    """A source gets the moment of each call."""
    (source,) = bench.sources
    source.waiting.append([])
    bench.step(5.0)
    source.waiting.append([])
    bench.step(2.5)
    assert source.arrivals == [1005.0, 1007.5]


def test_the_status_counts_everything(bench: Bench) -> None:
    """Sources, performers, rates and sinks all have their numbers in the status."""
    (source,) = bench.sources
    bench.step()
    frames = [*_frames("jump", "a"), *_frames("jump", "b", frames=50), Frame("a", 9.0, np.zeros((2, 3)))]
    source.waiting.extend([frame] for frame in frames)
    source.counts = InputCounts(malformed=3)
    bench.sink.failed = 4
    bench.step(0.5)
    bench.step(0.5)
    status = bench.sink.statuses[-1]
    assert status.inputs == InputCounts(received=251, malformed=3)
    assert (status.outcomes.other_joints, status.outcomes.recognizers.frames) == (1, 250)
    assert status.outcomes.recognizers.hops == len(bench.sink.recognitions)
    assert status.unsent == 4
    assert status.performers == {"a": 201.0, "b": 50.0}
    assert 0.0 < status.hop_p50 <= status.hop_p99
    assert status.lost == 4


def test_rates_count_the_last_second(bench: Bench) -> None:
    """A performer's rate is counted anew each second, and is 0 without frames."""
    (source,) = bench.sources
    bench.step()
    source.waiting.extend([frame] for frame in _frames("jump", frames=30))
    bench.step(0.1)
    for _ in range(2):
        bench.step(1.0)
    assert [status.performers for status in bench.sink.statuses] == [{}, {"p": pytest.approx(30 / 1.1)}, {"p": 0.0}]


def test_a_silent_performer_is_dropped(library: MotionLibrary, source: FakeSource) -> None:
    """After the silence a performer is no longer in the status, and the number of frames stays."""
    bench = Bench(Performers(library, silence=3.0), source)
    source.waiting.extend([frame] for frame in _frames("jump", frames=30))
    for _ in range(6):
        bench.step(1.0)
    assert [len(status.performers) for status in bench.sink.statuses] == [0, 1, 1, 1, 0, 0]
    assert bench.sink.statuses[-1].outcomes.dropped == 1
    assert bench.sink.statuses[-1].outcomes.recognizers.frames == 30


def test_a_stopped_service_ends_every_motion(bench: Bench) -> None:
    """A motion that goes on when the service is stopped ends for every sink, after its last answer."""
    (source,) = bench.sources
    source.waiting.extend([frame] for frame in _frames("jump", frames=240))
    bench.service.stop()
    bench.service.run()
    assert [(str(event.kind), event.label) for event in bench.sink.events] == [("start", "jump"), ("end", "jump")]


def test_waiting_ends_in_time_for_the_status(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step without packets waits no longer than asked, and no longer than until the next status."""
    waits = []

    def poll(_: zmq.Poller, timeout: int) -> list[tuple[object, int]]:
        waits.append(timeout)
        return []

    monkeypatch.setattr(zmq.Poller, "poll", poll)
    bench.service.step(0.0)
    bench.service.step(0.1)
    bench.clock.now += STATUS_EVERY - 0.02
    bench.service.step(0.1)
    assert waits == [0, 100, 20]


def test_leaving_closes_everything(library: MotionLibrary) -> None:
    """Leaving the block, by an exception too, gives all sockets back."""
    source, sink = FakeSource(), FakeSink()
    with pytest.raises(ZeroDivisionError), Service(Performers(library), [source], [sink]):
        _ = 1 / 0
    assert source.closed
    assert sink.closed


def test_a_stopped_service_answers_the_waiting_packets(
    bench: Bench, library: MotionLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A service stopped before or while it runs returns after it has answered all waiting packets."""
    monkeypatch.setattr(service_module, "MAX_ENDING", PATIENCE)
    frames = _frames("bow", frames=3000)
    bench.sources[0].waiting.extend([frame] for frame in frames)
    bench.service.stop()
    bench.service.run()
    assert not bench.sources[0].waiting
    assert len(bench.sink.recognitions) == len(_expected(library, frames))


def test_an_endless_feed_does_not_keep_it_from_stopping(library: MotionLibrary, opened: ExitStack) -> None:
    """When packets come faster than they are taken, it stops all the same."""

    class Endless(FakeSource):
        def take(self, arrival: float) -> Sequence[Frame | Announcement] | None:
            self.arrivals.append(arrival)
            return ()

    source = opened.enter_context(closing(Endless()))
    bench = Bench(Performers(library), source)
    bench.service.stop()
    bench.service.run()
    assert source.arrivals


# --- over real sockets -------------------------------------------------------------------------------------------


class Running:
    """A service in a thread of its own, stopped on leaving."""

    def __init__(self, service: Service) -> None:
        self.service = service
        self._thread = threading.Thread(target=service.run)

    def __enter__(self) -> Service:
        self._thread.start()
        return self.service

    def __exit__(self, *_: object) -> None:
        self.service.stop()
        self._thread.join(PATIENCE)
        self.service.close()
        assert not self._thread.is_alive()


def _answers(receive: Callable[[], Answer | None], count: int) -> list[Answer]:
    """Collect answers until there are enough."""
    found, until = list[Answer](), time.monotonic() + PATIENCE
    while len(found) < count and time.monotonic() < until:
        answer = receive()
        if answer is not None:
            found.append(answer)
    return found


def _assert_answered(answers: Sequence[Answer], expected: Sequence[Recognition]) -> None:
    """Demand the recogniser's own answers, to the digits of a 32-bit float."""
    assert [answer.label for answer in answers] == [recognition.label for recognition in expected]
    assert [answer.performer for answer in answers] == [recognition.performer for recognition in expected]
    assert [answer.class_index for answer in answers] == [recognition.class_index for recognition in expected]
    for name in ("score", "margin"):
        assert [getattr(each, name) for each in answers] == pytest.approx(
            [getattr(each, name) for each in expected], abs=1e-6
        )


def _next_packet(receiver: osc.OscReceiver) -> bytes:
    poller = zmq.Poller()
    poller.register(receiver.socket, zmq.POLLIN)
    poller.poll(100)
    return receiver.receive() or b""


def test_over_osc_frames_go_in_and_answers_come_out(library: MotionLibrary, opened: ExitStack) -> None:
    """Datagrams in are answered by datagrams out: the recogniser's own answers, the classes and the status."""
    listener = opened.enter_context(closing(osc.OscReceiver(LOOPBACK, 0)))
    source = opened.enter_context(closing(Source(osc.OscReceiver(LOOPBACK, 0), OscDecoder())))
    sink = opened.enter_context(closing(LayoutSink(NativeLayout(), osc.OscSender(*listener.address))))
    sender = opened.enter_context(closing(osc.OscSender(*source.receiver.address)))
    assert str(source) == f"OSC {LOOPBACK}:{source.receiver.address[1]}"
    assert str(sink) == f"native {LOOPBACK}:{listener.address[1]}"
    frames, addresses = _frames("wave"), set[str]()
    expected = _expected(library, frames)

    def receive() -> Answer | None:
        packet = _next_packet(listener)
        if packet:
            addresses.update(timed.message.address for timed in OscPacket(packet).messages)
        return osc.decode_answer(packet)

    with Running(Service(Performers(library), [source], [sink])) as service:
        sender.send(osc.encode_announcement(Announcement("p", STICK.joints)))
        sender.send(b"no osc")
        for frame in frames:
            sender.send(osc.encode_frame(frame))
        _assert_answered(_answers(receive, len(expected)), expected)
        while "/motion/status" not in addresses or "/motion/classes" not in addresses:
            receive()
    assert service.status().inputs == InputCounts(received=len(frames) + 2, malformed=1)
    assert addresses == {
        *(f"/motion/p/{each}" for each in ("class", "guess", "label", "scores", "event")),
        *("/motion/classes", "/motion/status"),
    }


@pytest.mark.slow
@pytest.mark.parametrize("frames_bound", [True, False])
@pytest.mark.parametrize("answers_bound", [True, False])
def test_over_zeromq_frames_go_in_and_answers_come_out(
    library: MotionLibrary, opened: ExitStack, *, frames_bound: bool, answers_bound: bool
) -> None:
    """With either end bound, ZeroMQ messages in give the recogniser's answers out."""
    if frames_bound:
        source = opened.enter_context(closing(Source(zeromq.ZmqReceiver(ANY_PORT), ZmqDecoder())))
        sender = opened.enter_context(closing(zeromq.ZmqSender(Endpoint(source.receiver.address, bind=False))))
    else:
        sender = opened.enter_context(closing(zeromq.ZmqSender(ANY_PORT)))
        receiver = zeromq.ZmqReceiver(Endpoint(sender.address, bind=False))
        source = opened.enter_context(closing(Source(receiver, ZmqDecoder())))
    if answers_bound:
        sink = opened.enter_context(closing(ZmqSink(zeromq.ZmqSender(ANY_PORT))))
        listener = opened.enter_context(closing(zeromq.ZmqReceiver(Endpoint(sink.sender.address, bind=False))))
    else:
        listener = opened.enter_context(closing(zeromq.ZmqReceiver(ANY_PORT)))
        sink = opened.enter_context(closing(ZmqSink(zeromq.ZmqSender(Endpoint(listener.address, bind=False)))))
    assert str(source) == f"ZeroMQ {source.receiver.address}"
    assert str(sink) == f"ZeroMQ {sink.sender.address}"
    frames, heard = _frames("wave"), list[list[bytes]]()
    expected = _expected(library, frames)

    def receive() -> Answer | None:
        listener.socket.poll(100)
        parts = listener.receive()
        if parts is None:
            return None
        heard.append(parts)
        return zeromq.decode_answer(parts)

    with Running(Service(Performers(library), [source], [sink])) as service:
        # A status that counts our messages shows that both pairs of peers have met.
        while not any(parts[0] == b"status/" and json.loads(parts[1])["inputs"]["foreign"] for parts in heard):
            sender.send([b"hello/", b""])
            receive()
        for seq, frame in enumerate(frames):
            sender.send(zeromq.encode_frame(frame, seq, STICK.joints if seq % 50 == 0 else None))
        _assert_answered(_answers(receive, len(expected)), expected)
    status = service.status()
    assert status.inputs.received == status.inputs.foreign + len(frames)
    assert (status.inputs.malformed, status.inputs.missing) == (0, 0)


def test_after_a_stall_all_that_waits_is_taken_in(library: MotionLibrary, opened: ExitStack) -> None:
    """For a slow reader ZeroMQ keeps the oldest: they are all taken in at the next turns, and none waits any more."""
    publisher = opened.enter_context(closing(zmq.Context.instance().socket(zmq.XPUB)))
    publisher.linger = 0
    publisher.bind("inproc://a-stall")
    source, sink = Source(zeromq.ZmqReceiver(Endpoint("inproc://a-stall", bind=False)), ZmqDecoder()), FakeSink()
    service = opened.enter_context(Service(Performers(library), [source], [sink]))
    assert publisher.poll(int(PATIENCE * 1000))
    assert publisher.recv() == b"\x01"
    frames = _frames("wave", frames=600)
    for seq, frame in enumerate(frames):
        if seq not in (100, 101, 102):
            publisher.send_multipart(zeromq.encode_frame(frame, seq))
    for _ in range(3):
        service.step(0.0)
    assert source.receiver.receive() is None
    assert (source.counts.received, source.counts.missing) == (597, 3)
    assert sink.recognitions[-1].time == _expected(library, frames[:100] + frames[103:])[-1].time > frames[-6].time


def test_sources_of_both_kinds_are_one_service(library: MotionLibrary, opened: ExitStack) -> None:
    """Frames by OSC and by ZeroMQ are each recognised, and the counts of both are added."""
    osc_source = Source(osc.OscReceiver(LOOPBACK, 0), OscDecoder())
    zmq_source = Source(zeromq.ZmqReceiver(ANY_PORT), ZmqDecoder())
    osc_sender = opened.enter_context(closing(osc.OscSender(*osc_source.receiver.address)))
    zmq_sender = opened.enter_context(closing(zeromq.ZmqSender(Endpoint(zmq_source.receiver.address, bind=False))))
    sink = FakeSink()
    with Service(Performers(library), [osc_source, zmq_source], [sink]) as service:
        while not service.status().inputs.foreign:
            zmq_sender.send([b"hello/", b""])
            service.step(0.1)
        met = service.status().inputs.received
        for seq, (one, other) in enumerate(zip(_frames("bow", "a"), _frames("jump", "b"), strict=True)):
            osc_sender.send(osc.encode_frame(one))
            zmq_sender.send(zeromq.encode_frame(other, seq))
        until = time.monotonic() + PATIENCE
        while service.status().outcomes.recognizers.frames < 400 and time.monotonic() < until:
            service.step(0.1)
        inputs = service.status().inputs
    assert {(answer.performer, answer.label) for answer in sink.recognitions} == {("a", "bow"), ("b", "jump")}
    assert inputs.received >= met + 400
    assert inputs.foreign == inputs.received - 400


def test_frames_without_a_time_are_timed_by_their_arrival(
    library: MotionLibrary, opened: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sender without a clock is recognised by ours: frames are answered once a window's time has passed."""
    # The clock stands still, so nothing has waited.
    monkeypatch.setattr(udp, "_MAX_WAITED", 0.0)
    source = Source(osc.OscReceiver(LOOPBACK, 0), OscDecoder())
    sender = opened.enter_context(closing(osc.OscSender(*source.receiver.address)))
    clock, sink = FakeClock(), FakeSink()
    with Service(Performers(library, Settings(hop=0)), [source], [sink], clock=clock) as service:
        for frame in _frames("jump"):
            sender.send(osc.encode_frame(dataclasses.replace(frame, time=0.0)))
            clock.now += 1 / 120
            service.step(1.0)
    assert [answer.time for answer in sink.recognitions] == pytest.approx(
        [1000.0 + (1 + index) / 120 for index in range(18, 200)]
    )
    assert {answer.label for answer in sink.recognitions} == {"jump"}


def test_a_listener_that_leaves_does_not_stop_the_service(library: MotionLibrary) -> None:
    """When nobody hears the answers any more, recognition goes on."""
    listener = osc.OscReceiver(LOOPBACK, 0)
    source, sink = FakeSource([[frame] for frame in _frames("bow")]), FakeSink()
    osc_sink = LayoutSink(NativeLayout(), osc.OscSender(*listener.address))
    listener.close()
    with Service(Performers(library), [source], [osc_sink, sink]) as service:
        service.step(0.0)
    assert len(sink.recognitions) > 10


def test_answers_that_cannot_be_sent_are_counted(library: MotionLibrary, opened: ExitStack) -> None:
    """Answers that the system does not send are counted as unsent in the status."""
    listener = opened.enter_context(closing(osc.OscReceiver(LOOPBACK, 0)))
    source, osc_sink = (
        FakeSource([[frame] for frame in _frames("bow")]),
        LayoutSink(NativeLayout(), osc.OscSender(*listener.address)),
    )
    zmq_sink = ZmqSink(zeromq.ZmqSender(ANY_PORT))
    with Service(Performers(library), [source], [osc_sink, zmq_sink]) as service:
        osc_sink.close()
        zmq_sink.close()
        service.step(0.0)
        status = service.status()
    # Each failed to send the classes, the first status, every answer and the start of the one motion.
    assert status.unsent == 2 * (2 + status.outcomes.recognizers.hops + 1)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells when a datagram arrived")
def test_packets_older_than_a_second_are_not_answered_as_present(
    library: MotionLibrary, opened: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a stop the backlog's newest answer is sent, older ones are counted; latency counts from the arrival."""
    monkeypatch.setattr(service_module, "MAX_AGE", 0.2)
    source = Source(osc.OscReceiver(LOOPBACK, 0), OscDecoder())
    sink, frames = FakeSink(), _frames("wave")
    sender = opened.enter_context(closing(osc.OscSender(*source.receiver.address)))
    expected = _expected(library, frames)
    with Service(Performers(library), [source], [sink]) as service:
        for frame in frames:
            sender.send(osc.encode_frame(frame))
        time.sleep(0.3)
        until = time.monotonic() + PATIENCE
        while source.counts.received < len(frames) and time.monotonic() < until:
            service.step(0.0)
        service.step(0.0)
        status = service.status()
    assert len(sink.recognitions) == 1
    assert sink.recognitions[0].time == expected[-1].time
    assert status.stale == len(expected) - 1
    assert len(sink.events) == sum(len(answer.events) for answer in expected)
    assert status.hop_p50 > 0.2


def test_after_a_pause_old_answers_are_not_sent(library: MotionLibrary, source: FakeSource) -> None:
    """The sender's own clock dates packets that waited while the process stood still; old ones get no answer."""
    clock, sink = FakeClock(), FakeSink()
    frames = [Frame("ann", 50.0 + k / 30, each.positions) for k, each in enumerate(_frames("wave")[:60])]
    with Service(Performers(library), [source], [sink], clock=clock) as service:
        for frame in frames[:6]:
            clock.now = 1000.0 + frame.time
            source.waiting.append([frame])
            service.step(0.0)
        before = len(sink.recognitions)
        assert before > 0
        # The process slept for two seconds; ZeroMQ hands over one half of the messages, then the other.
        clock.now = 1000.0 + frames[-1].time
        source.waiting.extend([frame] for frame in frames[6:20])
        service.step(0.0)
        service.step(0.0)
        assert len(sink.recognitions) == before
        source.waiting.extend([frame] for frame in frames[20:])
        service.step(0.0)
        told = [answer.time for answer in sink.recognitions[before:]]
        assert told
        assert min(told) >= frames[-1].time - 1.0 - 1e-6
        assert told[-1] == frames[-1].time
        assert service.status().stale > 0
        # Who sends nothing more has its newest answer after all.
        before, clock.now = len(sink.recognitions), clock.now + 10.0
        source.waiting.extend([Frame("ann", each.time + 5.0, each.positions)] for each in frames[:10])
        service.step(0.0)
        assert len(sink.recognitions) == before
        clock.now += 1.5
        source.pollable.recv(1)
        service.step(0.0)
        assert [answer.time for answer in sink.recognitions[before:]] == [frames[9].time + 5.0]
