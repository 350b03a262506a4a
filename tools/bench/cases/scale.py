"""`kinespace bench scale`: the delay that workers add, the performers that they hold, and the cost of losing one.

Gateway and sender are this process; the workers are `kinespace work`, in processes of their own on this machine. How
many performers a core holds follows from the time for which the processes used a core, so that the crowd can be small
enough for the machine.
"""

from __future__ import annotations

import gc
import math
import select
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.library.windows.index import opened
from kinespace.stream.cluster.bus import open_session
from kinespace.stream.cluster.gateway import Gateway
from kinespace.stream.frame import Frame
from kinespace.stream.osc import OscReceiver
from kinespace.stream.recognizer import Performers, SentJoints, Settings
from kinespace.stream.workers.crew import Crew
from kinespace.stream.workers.ledger import Ledger
from kinespace.stream.workers.partition import PARTITIONS
from kinespace.stream.workers.wire import decode_frames, encode_frames
from kinespace.stream.workers.worker import HISTORY, Worker
from kinespace.tools.bench.cases import capacity
from kinespace.tools.bench.memory import core_seconds
from kinespace.tools.bench.network import Network
from kinespace.tools.bench.recorded import FRAME_RATE
from kinespace.tools.feeding.feed import Cue, OscFrameSender

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from kinespace.stream.recognition import Event, EventKind, Recognition
    from kinespace.stream.service.recognising import Recognising
    from kinespace.stream.workers.answer_source import AnswerSource
    from kinespace.stream.workers.wire import Answered, Entry, SentFrame

_LOOPBACK = "127.0.0.1"
#: Seconds in which workers must be there, and in which the last answers may still come.
_MAX_START, _LINGER = 60.0, 3.0
#: Performers over OSC while the gateway is started again.
_SEEN = 4
#: Frames of feed after a takeover, and between two takeovers, without a cluster.
_AFTER, _EVERY = 360, 80
#: As many performers show what a core holds as take this share of it to be recognised: recognisers that sleep often
#: between two frames take longer for each.
_BUSY = 0.4
#: Seconds in which workers must be back after a cut of the network.
_MAX_HEALING = 20.0


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a feed.

    Attributes
    ----------
    what
        The event in its middle.
    lags
        Seconds from the hand-over of a frame to its answer, of all answers, shape (answers,).
    gap
        The longest time after the middle without an answer to a performer, seconds, beyond the pauses of one process;
        usually a hop.
    expected, answered
        Answers of one process, and answers that came.
    lost_events, false_events
        Events of one process that did not come, and events that one process did not send.
    loop_us
        Microseconds of a core for each frame in this process, in all threads: to recognise it or, with workers, to
        send it and to receive its answer.
    core_us
        The same in all workers; None without workers, or if the system does not say.
    """

    what: str
    lags: NDArray[np.float64] = field(repr=False)
    gap: float
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

    Attributes
    ----------
    crowd
        The number of performers.
    alone, workers
        One process, and two workers of `live --workers 2`.
    runs
        A gateway and two workers, or three if something happens, by the event.
    at_once
        One process, and `live --workers 2` with twice as many performers, so that each core has as many: the processor
        time of recognition alone, where frames come all at once, as frames do that wait for a full core.
    held
        A service that receives and answers over OSC, and a gateway with one worker for as many performers: their
        processor time tells how many performers a core holds.
    gateway_gap_s
        Seconds without an answer when the gateway is started again.
    healed_s
        Seconds from the end of a cut of the network until the worker behind it works again; NaN where no network could
        be made.
    takeovers
        The number of takeovers that were tried without a cluster, and the number after which the events differed.
    recognised_us
        The recogniser's part of a frame's time in `held`: microseconds of a core where no frame is waited for.
    """

    crowd: int
    alone: Run
    workers: Run
    runs: dict[str, Run]
    at_once: tuple[Run, Run]
    held: tuple[Run, Run]
    gateway_gap_s: float
    healed_s: float
    takeovers: tuple[int, int]
    recognised_us: float

    @property
    def ratio(self) -> float | None:
        """Performers that a worker's core holds, relative to those that a core of a service over OSC holds."""
        return _relative(*self.held)

    @property
    def speedup(self) -> float | None:
        """Frames that the two workers of `live` recognise in a second, relative to those of one process."""
        ratio = _relative(*self.at_once)
        return 2 * ratio if ratio else None

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


def _relative(one: Run, spread: Run) -> float | None:
    alone = one.core_us or one.loop_us
    return alone / spread.core_us if spread.core_us else None


@dataclass(frozen=True, slots=True)
class Feed:
    """So many performers doing the same motion, each at a moment of its own, and the answers of one process.

    They enter one after the other, a frame apart, so that their hops do not coincide.
    """

    frames: tuple[tuple[Frame, ...], ...] = field(repr=False)
    due: int
    events: Counter[tuple[str, str, str]] = field(repr=False)
    #: By performer and time of an answer, seconds beyond a hop for which one process gave none before: a body jumped.
    pauses: dict[tuple[str, float], float] = field(repr=False)
    #: Microseconds of a core for a frame's recognition, where no frame is waited for.
    recognised_us: float

    @classmethod
    def of(cls, positions: NDArray[np.float32], performers: int, seconds: float) -> Feed:
        """Make a feed, and recognise it."""
        moments, shift = round(seconds * FRAME_RATE), len(positions) // performers + 1
        frames = tuple(
            tuple(
                Frame(f"p{index}", 1.0 + k / FRAME_RATE, positions[(k + index * shift) % len(positions)])
                for index in range(min(k + 1, performers))
            )
            for k in range(moments)
        )
        recognisers = Performers(opened(MotionLibrary.builtin()), most=performers)
        begun = time.thread_time()
        answers = [each for together in frames for each in recognisers.push_all(together, together[0].time) if each]
        spent = (time.thread_time() - begun) / sum(map(len, frames)) * 1e6
        # Looking for garbage among so many frames would take a tenth of a second.
        gc.freeze()
        return cls(frames, len(answers), _counted(answers), _pauses(answers), spent)

    @property
    def performers(self) -> int:
        """The number of performers."""
        return len(self.frames[-1])


def _pauses(answers: Sequence[Recognition]) -> dict[tuple[str, float], float]:
    last: dict[str, float] = {}
    pauses = {}
    for each in answers:
        pause = each.time - last.get(each.performer, each.time) - Settings().hop
        if pause > 1 / FRAME_RATE:
            pauses[each.performer, each.time] = pause
        last[each.performer] = each.time
    return pauses


def _counted(answers: Sequence[Recognition]) -> Counter[tuple[str, str, str]]:
    return Counter((each.performer, str(event.kind), event.label) for each in answers for event in each.events)


class Troupe:
    """Performers' recognisers and the sources of their answers; this class recognises without workers."""

    def __init__(self, performers: Recognising, sources: Sequence[AnswerSource] = ()) -> None:
        self.performers, self.sources = performers, sources

    def answers(self, longest: float) -> Iterator[tuple[Recognition, float]]:
        """Wait for answers, at most so many seconds; give them, and how long each took."""
        pollables: list[Any] = [source.pollable for source in self.sources]
        if pollables:
            longest = min(longest, *(source.tended_within for source in self.sources))
            select.select(pollables, [], [], longest)
        else:
            time.sleep(longest)
        for source in self.sources:
            source.tend(time.monotonic())
            while (taken := source.take(time.monotonic())) is not None:
                for each in self.performers.push_all(taken, time.monotonic()):
                    if each:
                        yield each, source.waited

    @property
    def process_ids(self) -> Sequence[int | None]:
        """The numbers of the workers' processes."""
        return ()

    def core_seconds(self) -> float | None:
        """Give the core seconds that the workers have used; None without workers, or if the system does not say."""
        used = [core_seconds(number) for number in self.process_ids]
        return None if None in used or not used else float(sum(each or 0.0 for each in used))

    def close(self) -> None:
        """End everything."""
        for source in self.sources:
            source.close()


class Workers(Troupe):
    """The workers of `live --workers`."""

    def __init__(self, workers: int, performers: int) -> None:
        library = opened(MotionLibrary.builtin())
        self.crew = Crew(workers, library, Settings(), most=performers, joints=SentJoints())
        super().__init__(self.crew, self.crew.sources)

    @property
    def process_ids(self) -> Sequence[int | None]:
        """The numbers of the workers' processes."""
        return [source.process.process_id if source.process else None for source in self.crew.sources]


class Cluster(Troupe):
    """A gateway in this process, and workers in processes of their own, perhaps one behind another network."""

    def __init__(self, workers: int, performers: int, network: Network | None = None) -> None:
        places = [
            f"tcp/{host}:{_free_port(socket.SOCK_STREAM)}" for host in (_LOOPBACK, *(network.hosts if network else ()))
        ]
        self.place, self.network = places[0], network
        session = open_session(places, [], None)
        library = MotionLibrary.builtin()
        self.gateway = Gateway(session, library, Settings(), most=performers, joints=SentJoints(), naming="auto")
        super().__init__(self.gateway, [self.gateway.source])
        self.workers: list[subprocess.Popen[bytes]] = []
        try:
            if network:
                self.workers.append(_started("work", "--connect", places[1], within=network.within))
            while len(self.workers) < workers:
                self.add_worker()
            self.wait_for(workers)
        except BaseException:
            # An open session would keep this process alive for ever.
            self.close()
            raise

    def add_worker(self) -> None:
        """Start a worker."""
        self.workers.append(_started("work", "--connect", self.place))

    def wait_for(self, workers: int, longest: float = _MAX_START) -> None:
        """Wait until so many workers are there."""
        until = time.monotonic() + longest
        while not (self.gateway.notes[0].endswith(f": {workers}") and (self.network is None or self.network.is_whole)):
            if time.monotonic() > until:
                raise TimeoutError(f"{workers} workers were not there within {longest:g} s")
            for _ in self.answers(0.01):
                pass

    def cut(self) -> None:
        """Cut the network to the worker behind it for some seconds."""
        assert self.network  # noqa: S101 - for mypy
        self.network.cut()

    @property
    def process_ids(self) -> Sequence[int | None]:
        """The numbers of the workers' processes."""
        return [worker.pid for worker in self.workers]

    def close(self) -> None:
        """End everything."""
        end(self.workers)
        super().close()


def _started(*arguments: str, within: Sequence[str] = ()) -> subprocess.Popen[bytes]:
    command = [*within, sys.executable, "-m", "kinespace", *arguments]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)  # noqa: S603 - our own command


def end(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    """Kill processes, also stopped ones, and wait until they are gone."""
    for each in processes:
        with suppress(ProcessLookupError):
            each.kill()
        each.wait()


def _free_port(kind: int) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind((_LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


#: The events in the middle of a run.
HAPPENINGS: dict[str, Callable[[Cluster], None]] = {
    "nothing": lambda _: None,
    "kill": lambda cluster: cluster.workers[0].kill(),
    "hang": lambda cluster: cluster.workers[0].send_signal(signal.SIGSTOP),
    "leave": lambda cluster: cluster.workers[0].send_signal(signal.SIGINT),
    "join": Cluster.add_worker,
    "cut": Cluster.cut,
}


def play(feed: Feed, what: str, network: Network | None = None, *, workers: int = 3) -> Run:
    """Play a feed through workers of which one does something in the middle."""
    with closing(Cluster(workers, feed.performers, network)) as cluster:
        run = _played(feed, cluster, what, partial(HAPPENINGS[what], cluster), at_once=False)
        if network:
            cluster.wait_for(3, _MAX_HEALING)
        return run


def alone(feed: Feed, *, at_once: bool = False) -> Run:
    """Play a feed through the recognisers of this process."""
    recognisers = Performers(opened(MotionLibrary.builtin()), most=feed.performers)
    return _played(feed, Troupe(recognisers), "one process", at_once=at_once)


def with_workers(feed: Feed, *, at_once: bool = False) -> Run:
    """Play a feed through the two workers of `live --workers 2`."""
    with closing(Workers(2, feed.performers)) as workers:
        return _played(feed, workers, "live --workers 2", at_once=at_once)


def over_osc(positions: NDArray[np.float32], performers: int, seconds: float) -> Run:
    """Play to a process that receives and answers over OSC, as `kinespace live` does."""
    crowd = capacity.play("osc", performers, positions[: round(seconds * FRAME_RATE)], Settings())
    used = None if crowd.core_share is None else crowd.core_share / performers / FRAME_RATE * 1e6
    return Run("one process, OSC", crowd.seconds, math.nan, crowd.expected, crowd.answered, 0, 0, math.nan, used)


def network_cut(feed: Feed) -> tuple[Run, float] | None:
    """Cut the network to one of three workers; give the run, and the seconds until the worker was back."""
    with ExitStack() as stack:
        try:
            network = stack.enter_context(Network())
        except OSError:
            return None
        run = play(feed, "cut", network)
        return run, time.monotonic() - network.plugged


@dataclass(slots=True)
class _Heard:
    """The answers of a run, and how long each took; the longest time without one to a performer, from `middle` on."""

    pauses: dict[tuple[str, float], float]
    recognitions: list[Recognition] = field(default_factory=list)
    lags: list[float] = field(default_factory=list)
    last: dict[str, float] = field(default_factory=dict)
    middle: float = math.inf
    gap: float = 0.0

    def note(self, recognition: Recognition, lag: float) -> None:
        now = time.monotonic()
        if now > self.middle:
            pause = self.pauses.get((recognition.performer, recognition.time), 0.0)
            self.gap = max(self.gap, now - self.last.get(recognition.performer, now) - pause)
        self.last[recognition.performer] = now
        self.recognitions.append(recognition)
        self.lags.append(lag)


def _played(feed: Feed, troupe: Troupe, what: str, happen: Callable[[], None] = lambda: None, *, at_once: bool) -> Run:
    """Send all frames of a moment at once, or each at an even share of the frame time; collect the answers."""
    heard, count, used = _Heard(feed.pauses), feed.performers, 0.0
    before, others = troupe.core_seconds(), time.process_time() - time.thread_time()
    begun = time.monotonic() + 0.1

    def collect(until: float) -> None:
        nonlocal used
        while (left := until - time.monotonic()) > 0:
            busy = time.thread_time()
            for each, lag in troupe.answers(left):
                heard.note(each, lag)
            used += time.thread_time() - busy

    for k, together in enumerate(feed.frames):
        if k == len(feed.frames) // 2:
            happen()
            heard.middle = time.monotonic()
        for index, frames in enumerate([together] if at_once else [(frame,) for frame in together]):
            collect(begun + (k + index / count) / FRAME_RATE)
            came, busy = time.monotonic(), time.thread_time()
            own = troupe.performers.push_all(frames, came)
            used += time.thread_time() - busy
            for each in filter(None, own):
                heard.note(each, time.monotonic() - came)
    until = time.monotonic() + _LINGER
    while len(heard.lags) < feed.due and time.monotonic() < until:
        collect(min(until, time.monotonic() + 0.05))
    after = troupe.core_seconds()
    number = sum(map(len, feed.frames))
    # With workers Zenoh's threads send and receive, too.
    used += time.process_time() - time.thread_time() - others
    told = _counted(heard.recognitions)
    return Run(
        what,
        np.array(heard.lags),
        heard.gap,
        feed.due,
        len(heard.lags),
        (feed.events - told).total(),
        (told - feed.events).total(),
        used / number * 1e6,
        None if before is None or after is None else (after - before) / number * 1e6,
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
        stack.callback(end, running)
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
    former, ledger = Worker(Performers(index)), Ledger(most=1, silence=math.inf)
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
        The number of performers.
    """
    feed = Feed.of(positions, crowd, seconds)
    by_itself, by_two = alone(feed), with_workers(feed)
    runs = {what: play(feed, what, workers=2 if what == "nothing" else 3) for what in HAPPENINGS if what != "cut"}
    cut = network_cut(feed)
    if cut:
        runs["cut"] = cut[0]
    many = max(round(_BUSY / (feed.recognised_us * 1e-6 * FRAME_RATE)), crowd)
    busier, busiest = (Feed.of(positions, number, seconds) for number in (many, 2 * many))
    return Scale(
        crowd,
        by_itself,
        by_two,
        runs,
        (
            replace(alone(busier, at_once=True), what=f"one process, {many} at once"),
            replace(with_workers(busiest, at_once=True), what=f"live --workers 2, {2 * many} at once"),
        ),
        (
            replace(over_osc(positions, many, seconds), what=f"one process, OSC, {many}"),
            replace(play(busier, "nothing", workers=1), what=f"one worker, {many}"),
        ),
        gateway_gap(positions),
        cut[1] if cut else math.nan,
        takeovers(positions, HISTORY),
        busier.recognised_us,
    )
