"""`kinespace bench scale`: what workers add, what they hold, and what their deaths cost.

Gateway and sender are this process; the workers are `kinespace work`, in processes of their own on this machine.
"""

from __future__ import annotations

import math
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.library.windows.index import opened
from kinespace.stream.cluster.bus import open_session
from kinespace.stream.cluster.gateway import Gateway
from kinespace.stream.frame import Frame
from kinespace.stream.osc import OscReceiver
from kinespace.stream.recognizer import Performers, SentJoints, Settings
from kinespace.stream.workers.ledger import Ledger
from kinespace.stream.workers.partition import PARTITIONS
from kinespace.stream.workers.wire import decode_frames, encode_frames
from kinespace.stream.workers.worker import HISTORY, Worker
from kinespace.tools.bench.memory import core_seconds
from kinespace.tools.bench.recorded import FRAME_RATE
from kinespace.tools.feeding.feed import Cue, OscFrameSender

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from kinespace.stream.recognition import Event, EventKind, Recognition
    from kinespace.stream.service.recognising import Recognising
    from kinespace.stream.workers.wire import Answered, Entry, SentFrame

_LOOPBACK = "127.0.0.1"
#: Seconds in which workers must be there, and in which the last answers may still come.
_MAX_START, _LINGER = 60.0, 3.0
#: Performers over OSC while the gateway is started again.
_SEEN = 4
#: Frames of feed that are looked at after a takeover, and between two takeovers, without a cluster.
_AFTER, _EVERY = 360, 80
#: Seconds of frames that a worker might take a performer over with, beside those that it does.
_SHORTER = 2.5


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a feed.

    Attributes
    ----------
    what
        What happened in its middle.
    lags
        Seconds from the hand-over of a frame to its answer, of all answers, shape (answers,).
    worst
        The longest of these after the middle: until performers were answered again.
    expected, answered
        Answers of one process, and answers that came.
    lost_events, false_events
        Events of one process that did not come, and events that came beside these.
    loop_us
        Microseconds of a core that a frame took in this process, to be sent or to be recognised.
    core_us
        The same in all workers; None where there are none, or where the system does not tell.
    """

    what: str
    lags: NDArray[np.float64] = field(repr=False)
    worst: float
    expected: int
    answered: int
    lost_events: int
    false_events: int
    loop_us: float
    core_us: float | None = None

    def percentile(self, percent: float) -> float:
        """Give a percentile of the lags in milliseconds; NaN when there is none."""
        return float(np.percentile(self.lags, percent)) * 1000 if self.lags.size else float("nan")


@dataclass(frozen=True, slots=True)
class Scale:
    """All results.

    `takeovers` says for seconds of history how many takeovers were tried without a cluster, and after how many another
    event came than without one.
    """

    crowd: int
    alone: Run
    runs: dict[str, Run]
    gateway_gap_s: float
    takeovers: dict[float, tuple[int, int]]

    @property
    def ratio(self) -> float | None:
        """Performers that a worker's core holds, relative to those of a core that does everything itself."""
        workers = self.runs["nothing"].core_us
        return self.alone.loop_us / workers if workers else None

    @property
    def lost_events(self) -> int:
        """Events of one process that did not come, in all runs."""
        return sum(run.lost_events for run in self.runs.values())

    @property
    def false_events(self) -> int:
        """Events that came beside these, in all runs."""
        return sum(run.false_events for run in self.runs.values())

    def added_ms(self, percent: float) -> float:
        """Give a percentile of the lags beside that of one process, milliseconds."""
        return self.runs["nothing"].percentile(percent) - self.alone.percentile(percent)


@dataclass(frozen=True, slots=True)
class Feed:
    """So many performers doing the same motion, each at a moment of its own, and the answers of one process."""

    frames: tuple[tuple[Frame, ...], ...] = field(repr=False)
    due: int
    events: Counter[tuple[str, str, str]] = field(repr=False)

    @classmethod
    def of(cls, positions: NDArray[np.float32], performers: int, seconds: float) -> Feed:
        """Make a feed, and recognise it."""
        moments, shift = round(seconds * FRAME_RATE), len(positions) // performers + 1
        frames = tuple(
            tuple(
                Frame(f"p{index}", 1.0 + k / FRAME_RATE, positions[(k + index * shift) % len(positions)])
                for index in range(performers)
            )
            for k in range(moments)
        )
        recognisers = Performers(opened(MotionLibrary.builtin()), most=performers)
        answers = [each for together in frames for each in recognisers.push_all(together, together[0].time) if each]
        return cls(frames, len(answers), _counted(answers))


def _counted(answers: Sequence[Recognition]) -> Counter[tuple[str, str, str]]:
    return Counter((each.performer, str(event.kind), event.label) for each in answers for event in each.events)


class Cluster:
    """A gateway in this process, and workers in processes of their own."""

    def __init__(self, workers: int, performers: int) -> None:
        self.place = f"tcp/{_LOOPBACK}:{_free_port(socket.SOCK_STREAM)}"
        library = MotionLibrary.builtin()
        session = open_session([self.place], [], None)
        self.gateway = Gateway(session, library, Settings(), most=performers, joints=SentJoints(), naming="auto")
        self.workers: list[subprocess.Popen[bytes]] = []
        for _ in range(workers):
            self.add_worker()
        self.wait_for(workers)

    def add_worker(self) -> None:
        """Start a worker."""
        self.workers.append(_started("work", "--connect", self.place))

    def wait_for(self, workers: int) -> None:
        """Wait until so many workers are there."""
        until = time.monotonic() + _MAX_START
        while not self.gateway.notes[0].endswith(f": {workers}"):
            if time.monotonic() > until:
                raise TimeoutError(f"{workers} workers were not there within {_MAX_START:g} s")
            self.gateway.source.tend(time.monotonic())
            time.sleep(0.01)

    def answers(self, now: float) -> Iterator[tuple[Recognition, float]]:
        """Give the answers that have come, and how long each took."""
        self.gateway.source.tend(now)
        while (taken := self.gateway.source.take(time.monotonic())) is not None:
            for each in self.gateway.push_all(taken, now):
                if each:
                    yield each, self.gateway.source.waited

    def core_seconds(self) -> float | None:
        """Give the seconds of a core that the workers have used."""
        used = [core_seconds(worker.pid) for worker in self.workers]
        return None if None in used else float(sum(each or 0.0 for each in used))

    def close(self) -> None:
        """End everything."""
        _end(self.workers)
        self.gateway.close()


def _started(*arguments: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "kinespace", *arguments]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)  # noqa: S603 - our own command


def _end(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    for each in processes:
        with suppress(ProcessLookupError):
            # A stopped process is ended, too.
            each.kill()
        each.wait()


def _free_port(kind: int) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind((_LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


#: What can happen in the middle of a run.
HAPPENINGS: dict[str, Callable[[Cluster], None]] = {
    "nothing": lambda _: None,
    "kill": lambda cluster: cluster.workers[0].kill(),
    "hang": lambda cluster: cluster.workers[0].send_signal(signal.SIGSTOP),
    "leave": lambda cluster: cluster.workers[0].send_signal(signal.SIGINT),
    "join": Cluster.add_worker,
}


def play(feed: Feed, what: str) -> Run:
    """Play a feed through two workers, or through three of which one does something in the middle."""
    performers = len(feed.frames[0])
    with ExitStack() as stack:
        cluster = Cluster(2 if what == "nothing" else 3, performers)
        stack.callback(cluster.close)
        before = cluster.core_seconds()
        run = _played(feed, cluster.gateway, cluster.answers, what, partial(HAPPENINGS[what], cluster))
        after = cluster.core_seconds() if what == "nothing" else None
    used = None if before is None or after is None else (after - before) / (len(feed.frames) * performers) * 1e6
    return replace(run, core_us=used)


def alone(feed: Feed) -> Run:
    """Play a feed through the recognisers of this process."""
    recognisers = Performers(opened(MotionLibrary.builtin()), most=len(feed.frames[0]))
    return _played(feed, recognisers, lambda _: iter(()), "one process", lambda: None)


def _played(
    feed: Feed,
    performers: Recognising,
    answers: Callable[[float], Iterator[tuple[Recognition, float]]],
    what: str,
    happen: Callable[[], None],
) -> Run:
    """Send every frame at its time, each performer's at an even share of the frame time; collect the answers."""
    heard: list[Recognition] = []
    lags: list[float] = []
    late: list[float] = []
    used = 0.0
    happened = False
    count = len(feed.frames[0])
    begun = time.monotonic() + 0.1

    def collect() -> None:
        for each, lag in answers(time.monotonic()):
            heard.append(each)
            lags.append(lag)
            if happened:
                late.append(lag)

    for k, together in enumerate(feed.frames):
        if k == len(feed.frames) // 2:
            happen()
            happened = True
        for index, frame in enumerate(together):
            due = begun + (k + index / count) / FRAME_RATE
            while time.monotonic() < due:
                collect()
            came, busy = time.monotonic(), time.thread_time()
            own = performers.push_all([frame], came)
            used += time.thread_time() - busy
            if own[0]:
                heard.append(own[0])
                lags.append(time.monotonic() - came)
    until = time.monotonic() + _LINGER
    while len(heard) < feed.due and time.monotonic() < until:
        collect()
    told = _counted(heard)
    return Run(
        what,
        np.array(lags),
        max(late, default=float("nan")),
        feed.due,
        len(heard),
        (feed.events - told).total(),
        (told - feed.events).total(),
        used / (count * len(feed.frames)) * 1e6,
    )


def gateway_gap(positions: NDArray[np.float32]) -> float:
    """Kill `kinespace gateway` and start it again; give the seconds without an OSC answer."""
    place, port = f"tcp/{_LOOPBACK}:{_free_port(socket.SOCK_STREAM)}", _free_port(socket.SOCK_DGRAM)
    receiver, sender = OscReceiver(_LOOPBACK, 0), OscFrameSender(_LOOPBACK, port)
    options = ("--osc-in", f"{_LOOPBACK}:{port}", "--osc-out", f"{_LOOPBACK}:{receiver.address[1]}", "--plain")
    gateway = ("gateway", *options, "--listen", place)
    with ExitStack() as stack:
        stack.callback(receiver.close)
        stack.callback(sender.close)
        running = [_started(*gateway), _started("work", "--connect", place)]
        stack.callback(_end, running)
        heard: list[float] = []
        ends, killed = time.monotonic() + _MAX_START, 0.0
        for k in range(round(_MAX_START * FRAME_RATE)):
            for index in range(_SEEN):
                frame = Frame(f"p{index}", 1.0 + k / FRAME_RATE, positions[(k + 50 * index) % len(positions)])
                sender.send(sender.encode(Cue(0.0, frame, k)))
            time.sleep(1 / FRAME_RATE)
            while receiver.receive() is not None:
                heard.append(time.monotonic())
            if not killed and len(heard) > 10 * FRAME_RATE:
                killed = time.monotonic()
                running[0].kill()
                running[0].wait()
                running[0] = _started(*gateway)
                heard.clear()
            elif killed and heard:
                return heard[0] - killed
            if time.monotonic() > ends:
                break
    raise TimeoutError("the gateway that was started again answered nothing")


def takeovers(positions: NDArray[np.float32], seconds: float) -> tuple[int, int]:
    """Let another worker take a performer over at many moments; give how many, and after how many an event differs."""
    index = opened(MotionLibrary.builtin())
    former, ledger = Worker(Performers(index)), Ledger(most=1, silence=math.inf, keeps_frames=True)
    history = round(seconds * FRAME_RATE)
    frames: list[SentFrame] = []
    events: list[list[Event]] = []
    cuts: dict[int, tuple[list[Entry], int]] = {}
    for k, each in enumerate(positions):
        numbered = ledger.send(Frame("p", 1.0 + k / FRAME_RATE, each), k / FRAME_RATE)
        frames += [numbered[1]] if numbered else []
        answers = _pushed(former, frames[-1:])
        events.append([event for answer in answers for event in ledger.note(answer) or ()])
        if k in range(history, len(positions) - _AFTER, _EVERY):
            entries = ledger.entries(range(PARTITIONS))
            cuts[k + 1] = entries, max(entries[0].answered - history, 0)
    differ = 0
    for cut, (entries, first) in cuts.items():
        worker = Worker(Performers(index))
        worker.take_over(entries, 0.0)
        found = _pushed(worker, frames[first : cut + _AFTER])
        expected = [event for each in events[cut : cut + _AFTER] for event in each]
        differ += _named([event for answer in found for event in answer.events]) != _named(expected)
    return len(cuts), differ


def _pushed(worker: Worker, frames: Sequence[SentFrame]) -> list[Answered]:
    return [answer for each in frames for answer in worker.push(decode_frames(encode_frames([each])), each.at)]


def _named(events: Sequence[Event]) -> list[tuple[EventKind, str]]:
    return [(event.kind, event.label) for event in events]


def measure(positions: NDArray[np.float32], *, seconds: float, crowd: int) -> Scale:
    """Run everything.

    Parameters
    ----------
    positions
        The motion, shape (frames, joints, 3), metres.
    seconds
        Of each run.
    crowd
        The number of performers where nothing happens; where something does they are half as many.
    """
    usual, smaller = Feed.of(positions, crowd, seconds), Feed.of(positions, max(crowd // 2, 2), seconds)
    runs = {what: play(usual if what == "nothing" else smaller, what) for what in HAPPENINGS}
    return Scale(
        crowd,
        alone(usual),
        runs,
        gateway_gap(positions),
        {each: takeovers(positions, each) for each in (_SHORTER, HISTORY)},
    )
