"""`kinespace bench scale`: the delay that workers add, the performers that they hold, and the cost of losing one.

Sender and listener are this process. `kinespace live` runs as a person starts it, frames come by OSC, and answers by
ZeroMQ, which carry their frame's time. How many performers a core holds follows from the time for which the processes
use a core, so that the crowd can be small enough for the machine.
"""

from __future__ import annotations

import json
import math
import os
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from kinespace.stream.recognizer import Settings
from kinespace.stream.zeromq import Endpoint, ZmqReceiver
from kinespace.tools.bench.crowd import (
    CROWD,
    FRAME_RATE,
    Feed,
    Measured,
    Plan,
    Played,
    core_seconds,
    performers_a_core,
    play,
    positions,
    shown,
)
from kinespace.tools.feeding.feed import Cue, OscFrameSender
from kinespace.tools.loopback.answers import Listener
from kinespace.tools.loopback.service import Program
from kinespace.tools.terminal.console import progress
from kinespace.tools.terminal.tables import table_of

_LOOPBACK = "127.0.0.1"
#: Seconds until the first status, at most.
_MAX_START = 60.0


class Run(NamedTuple):
    """What came of a feed.

    Attributes
    ----------
    lags
        Seconds from each frame to its answer, shape (answers,).
    gap
        The longest time after the middle without an answer to a performer, seconds, beyond the pauses of one process;
        usually a hop.
    missing
        Answers of one process that did not come.
    lost_events, false_events
        Events of one process that did not come, and events that one process did not send.
    core_us, receiving_us
        Microseconds of a core for each frame in the busiest process, and in the process that receives and answers.
    """

    lags: NDArray[np.float64]
    gap: float
    missing: int
    lost_events: int
    false_events: int
    core_us: float
    receiving_us: float

    def percentile(self, percent: float) -> float:
        """Give a percentile of the lags in milliseconds; NaN when there is none."""
        return float(np.percentile(self.lags, percent)) * 1000 if self.lags.size else math.nan


class Stage:
    """`live`, perhaps with workers, with a sender of frames to it and a listener to its answers.

    Parameters
    ----------
    opened
        Ends the program, and closes the sockets.
    workers
        Their number; 0 for none.
    """

    def __init__(self, opened: ExitStack, workers: int = 0) -> None:
        ends = ("--osc-in", f"{_LOOPBACK}:0", "--zmq-out", f"tcp://{_LOOPBACK}:*")
        many = ("--workers", f"{workers}") if workers else ()
        self.main = opened.enter_context(Program("live", *many, "--plain", "--performers", f"{10 * CROWD}", *ends))
        place = self.main.place()
        self.sender = opened.enter_context(closing(OscFrameSender(*place.osc)))
        self.listener = opened.enter_context(closing(Listener(ZmqReceiver(Endpoint(place.answers, bind=False)))))
        # The first status says that this subscriber is known.
        until = time.perf_counter() + _MAX_START
        while not any(each.packet[0] == b"status/" for each in self.listener.listen_until(time.perf_counter())):
            if time.perf_counter() > until:
                raise TimeoutError(f"no status came within {_MAX_START:g} s")

    def signal(self, number: int) -> None:
        """Send a signal to one of the workers."""
        os.kill(_workers(self.main)[0], number)

    def play(self, feed: Feed, *, at_once: bool = False, happen: Callable[[], object] = lambda: None) -> Run:
        """Play a feed of which something happens in the middle."""
        processes = [self.main.process.pid, *_workers(self.main)]
        before, cues = list(map(core_seconds, processes)), feed.cues(at_once=at_once)
        middle = len(feed.frames) / FRAME_RATE / 2
        played = play(_with(happen, middle, cues), self.sender, self.listener)
        used = [(core_seconds(each) - then) * 1e6 / len(cues) for each, then in zip(processes, before, strict=True)]
        return run_of(feed, played, played.begun + middle, used)


def _with(happen: Callable[[], object], moment: float, cues: Sequence[Cue]) -> Iterator[Cue]:
    """Let something happen between two frames."""
    yield from (cue for cue in cues if cue.due < moment)
    happen()
    yield from (cue for cue in cues if cue.due >= moment)


def _workers(program: Program) -> list[int]:
    """Give the worker processes that a program has started, as Linux lists them; none elsewhere."""
    children = Path(f"/proc/{program.process.pid}/task").glob("*/children")
    numbers = [int(number) for each in children for number in each.read_text(encoding="ascii").split()]
    return [each for each in numbers if b"spawn_main" in Path(f"/proc/{each}/cmdline").read_bytes()]


def run_of(feed: Feed, played: Played, middle: float, core_us: Sequence[float]) -> Run:
    """Compare what came with what one process answers; the first of the processes receives and answers."""
    pauses = _pauses(feed)
    lags, gap, last = list[float](), 0.0, dict[str, float]()
    events: Counter[tuple[str, str, str]] = Counter()
    for each in played.received:
        topic, encoded = (bytes(part) for part in each.packet)
        reading = json.loads(encoded)
        if topic.startswith(b"event/"):
            events[reading["performer"], reading["event"], reading["class"]] += 1
        if not topic.startswith(b"class/") or "t" not in reading:
            continue
        performer = reading["performer"]
        lags.append(each.arrival - played.sent[performer, reading["t"]])
        if each.arrival > middle:
            pause = pauses.get((performer, reading["t"]), 0.0)
            gap = max(gap, each.arrival - last.get(performer, each.arrival) - pause)
        last[performer] = each.arrival
    expected = Counter(
        (each.performer, event.kind.value, event.label) for each in feed.answers for event in each.events
    )
    return Run(
        np.array(lags),
        gap,
        max(len(feed.answers) - len(lags), 0),
        (expected - events).total(),
        (events - expected).total(),
        max(core_us),
        core_us[0],
    )


def _pauses(feed: Feed) -> dict[tuple[str, float], float]:
    """Give, by performer and time of an answer, the seconds beyond a hop without one before it: a body jumped."""
    last: dict[str, float] = {}
    pauses = {}
    for each in feed.answers:
        pauses[each.performer, each.time] = max(each.time - last.get(each.performer, each.time) - Settings().hop, 0.0)
        last[each.performer] = each.time
    return pauses


#: The events in the middle of a run with three workers.
HAPPENINGS: dict[str, int] = {"kill": signal.SIGKILL, "hang": signal.SIGSTOP}
FIGURES = (
    *("added_p50_ms", "added_p99_ms", "workers_speedup"),
    *(f"{what}_gap_s" for what in HAPPENINGS),
    *("lost_events", "false_events"),
)


def run_with(feed: Feed, workers: int = 0, *, at_once: bool = False, happen: int = 0) -> Run:
    """Play a feed to `live`; in its middle a worker gets a signal."""
    with ExitStack() as opened:
        stage = Stage(opened, workers)
        return stage.play(feed, at_once=at_once, happen=partial(stage.signal, happen) if happen else lambda: None)


def measure(plan: Plan) -> Measured:
    """Run a crowd alone and with workers of which one dies or hangs, and a crowd whose frames come at once."""
    feed, many = (Feed.of(positions(), performers, plan.seconds) for performers in (plan.crowd, CROWD))
    plays: dict[str, Callable[[], Run]] = {
        "live": partial(run_with, feed),
        "two workers": partial(run_with, feed, 2),
        **{what: partial(run_with, feed, 3, happen=each) for what, each in HAPPENINGS.items()},
        "live, at once": partial(run_with, many, at_once=True),
        "two workers, at once": partial(run_with, many, 2, at_once=True),
    }
    runs = {name: run() for name, run in progress(plays.items(), "Scale", len(plays))}
    return Measured(_figures(runs), [_table(runs, plan.crowd)])


def _figures(runs: dict[str, Run]) -> dict[str, float]:
    alone, spread = runs["live"], runs["two workers"]
    held = {name: performers_a_core(run.core_us) for name, run in runs.items()}
    return {
        **{f"added_p{percent}_ms": spread.percentile(percent) - alone.percentile(percent) for percent in (50, 99)},
        "workers_speedup": held["two workers, at once"] / held["live, at once"],
        **{f"{what}_gap_s": runs[what].gap for what in HAPPENINGS},
        "lost_events": sum(run.lost_events for run in runs.values()),
        "false_events": sum(run.false_events for run in runs.values()),
    }


def _table(runs: dict[str, Run], crowd: int) -> Table:
    title = (
        f"{crowd} performers, {CROWD} when their frames come at once\n"
        "p50, p99: milliseconds from a frame to its answer\n"
        "gap: longest time then without an answer to a performer, seconds\n"
        "none: answers missing; lost, false: starts and ends of motions\n"
        "core: performers that the core of the busiest process holds\n"
        "µs: of a core, a frame, in the process that receives and answers"
    )
    rows = list[tuple[str, ...]]()
    for name, run in runs.items():
        lags = (shown(run.percentile(50), 2), shown(run.percentile(99), 2), shown(run.gap, 2))
        counts = (f"{run.missing}", f"{run.lost_events}", f"{run.false_events}")
        # A process that sleeps between two frames takes longer for each.
        cores = (shown(performers_a_core(run.core_us)), shown(run.receiving_us)) if "at once" in name else ()
        rows.append((name, *lags, *counts, *cores))
    return table_of(title, ("", "p50", "p99", "gap", "none", "lost", "false", "core", "µs"), rows)
