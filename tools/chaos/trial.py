"""One trial: a running `kinespace live`, an innocent performer, and an attack or a fault for some seconds."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Frame
from kinespace.stream.inputs.recording import RawFile
from kinespace.stream.recognizer import Recognizer
from kinespace.tools.bench.memory import resident_mb
from kinespace.tools.chaos.attacks import INNOCENT, Place
from kinespace.tools.chaos.performer import ANSWER_RATE, FRAME_RATE, Performer, schedule

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from multiprocessing.synchronize import Event, Semaphore

    from numpy.typing import NDArray

    from kinespace.tools.chaos.performer import Fault, Performance

    #: Runs until it is told to stop.
    Attack = Callable[[Place, Event], None]

LOOPBACK = "127.0.0.1"
#: Seconds a program may take to begin or end.
_PATIENCE = 60.0
#: Megabytes within which memory counts as given back.
_BACK_WITHIN = 50.0
#: Seconds of answers that show that all is well again, and the share of them that must have come in time.
_WELL, _WELL_SHARE, _WELL_LATENCY = 0.5, 0.9, 0.05
#: The usual number of files that a process may open: the limit of the attacked recogniser.
_USUAL_FILES = 1024


@dataclass(frozen=True, slots=True)
class Effort:
    """Seconds before, during and after the attack; memory is measured until the end."""

    before: float = 2.0
    during: float = 5.0
    after: float = 3.0
    memory: float = 10.0

    @property
    def whole(self) -> float:
        """Seconds of a trial, at most."""
        return self.before + self.during + self.after + self.memory


@dataclass(frozen=True, slots=True)
class Trial:
    """An attack or a fault.

    Attributes
    ----------
    name
        The name for people.
    attacks
        Attacks, each run in a process of its own.
    fault
        The fault of the performer's feed; None for none.
    deed
        An action on the recogniser's process, from our own process, for about the given seconds; gives a
        line about it for people.
    over
        The transport of the performer's frames: "osc" or "zmq".
    killed
        Whether the recogniser is killed (`kill -9`) and started again on the same ports.
    options
        Options of `kinespace live`; `{folder}` is a folder for files, `{number}` counts them.
    first
        Whether the attack begins before the performer.
    lasts
        How many times as long as other attacks it lasts.
    """

    name: str
    attacks: Sequence[Attack] = ()
    fault: Fault | None = None
    deed: Callable[[Live, float], str] | None = None
    killed: bool = False
    over: str = "osc"
    options: Sequence[str] = ()
    first: bool = False
    lasts: float = 1.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a trial.

    Attributes
    ----------
    name
        The trial's name.
    answered, expected
        Answers to the innocent performer during the attack.
    p99, p99_before
        Their latency, 99th percentile, seconds, and the same before the attack.
    memory
        Resident megabytes of the recogniser: before, at most, and afterwards.
    recovered
        Seconds from the end of the attack until all was well; infinite for never.
    stale
        Answers that came more than a second after their frame.
    told
        The recogniser's counts.
    ended
        The program's exit status: 0 when it ended on demand.
    noticed
        Seconds from the beginning of a fault until an answer said that joints cannot be believed; None if none did
        while it lasted.
    """

    name: str
    answered: int
    expected: int
    p99: float
    p99_before: float
    memory: tuple[float, float, float]
    recovered: float
    stale: int
    told: str
    ended: int
    noticed: float | None


class Live(NamedTuple):
    """A running `kinespace live`."""

    process: subprocess.Popen[bytes]
    place: Place
    output: Path
    folder: Path

    def printed(self) -> str:
        """Give its output so far."""
        return self.output.read_text(encoding="utf-8", errors="replace")

    def memory(self) -> float:
        """Give its resident memory in megabytes; NaN when it is gone."""
        resident = resident_mb(self.process.pid)
        return float("nan") if resident is None else resident


def _as_usual() -> None:
    """Limit the files that a process may open to the usual number."""
    import resource  # noqa: PLC0415 - there is none on Windows

    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(_USUAL_FILES, hard), hard))


@contextmanager
def running(folder: Path, options: Sequence[str], place: Place | None = None) -> Iterator[Live]:
    """Start `kinespace live` and wait until it listens, on ports of its own choice or on the given ones."""
    begun = place or Place((LOOPBACK, 0), f"tcp://{LOOPBACK}:*", f"tcp://{LOOPBACK}:*")
    ends = ["--osc-in", "{}:{}".format(*begun.osc), "--zmq-in", begun.frames, "--zmq-out", begun.answers]
    number = len(list(folder.iterdir()))
    chosen = [option.format(folder=folder, number=number) for option in options]
    command = [sys.executable, "-m", "kinespace", "live", *ends, "--plain", *chosen]
    output = folder / f"output{number}"
    surroundings = {**os.environ, "COLUMNS": "200", "PYTHONUTF8": "1"}
    with output.open("wb") as printed:
        process = subprocess.Popen(  # noqa: S603 - our own command
            command,
            env=surroundings,
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=subprocess.STDOUT,
            preexec_fn=_as_usual if os.name == "posix" else None,  # noqa: PLW1509 - no thread of ours holds a lock
        )
    try:
        pattern = re.compile(r"listening on OSC (\S+):(\d+), ZeroMQ (\S+); answering to .*?ZeroMQ ([^\s;,]+)")
        until = time.monotonic() + _PATIENCE
        while not (found := pattern.search(output.read_text(encoding="utf-8", errors="replace"))):
            if process.poll() is not None or time.monotonic() > until:
                raise ChildProcessError(f"kinespace live did not begin: {output.read_text(encoding='utf-8')}")
            time.sleep(0.02)
        host, port, frames, answers = found.groups()
        yield Live(process, Place((host, int(port)), frames, answers), output, folder)
    finally:
        process.kill()
        process.wait()


def tried(trial: Trial, effort: Effort, positions: NDArray[np.float32], joints: Sequence[str]) -> Outcome:
    """Run a trial.

    Parameters
    ----------
    trial
        The attack or fault.
    effort
        Its lengths.
    positions
        The performer's positions, shape (frames, joints, 3), metres, 120 a second, repeated.
    joints
        Their names.
    """
    effort = replace(effort, during=trial.lasts * effort.during)
    frames = np.resize(positions, (round(effort.whole * FRAME_RATE), *positions.shape[1:]))
    end = effort.before + effort.during
    befalls = (effort.before, end, trial.fault) if trial.fault else None
    packets = schedule(frames, joints, befalls=befalls, over=trial.over)
    due = _due(frames, effort.before, end)
    context = multiprocessing.get_context("spawn")
    with ExitStack() as opened:
        folder = Path(opened.enter_context(tempfile.TemporaryDirectory()))
        live = opened.enter_context(running(folder, trial.options))
        ready, go, stop = context.Semaphore(0), context.Event(), context.Event()
        attackers = [
            context.Process(target=_attack, args=(attack, live.place, ready, go, stop), daemon=True)
            for attack in trial.attacks
        ]
        for attacker in attackers:
            attacker.start()
        with Performer(live.place, packets, trial.over) as performer:
            for _ in attackers:
                ready.acquire(timeout=_PATIENCE)
            if trial.first:
                go.set()
                time.sleep(effort.before)
            begun = performer.begin()
            _wait(begun + effort.before)
            before = most = live.memory()
            go.set()
            told = trial.deed(live, effort.during) if trial.deed else ""
            if trial.killed:
                live.process.kill()
                live.process.wait()
                live = opened.enter_context(running(folder, trial.options, live.place))
            while time.perf_counter() < begun + end:
                most = max(most, live.memory())
                time.sleep(0.1)
            stop.set()
            for each in attackers:
                each.join(_PATIENCE)
            ended = time.perf_counter() - begun
            most = max(most, live.memory())
            _wait(begun + ended + effort.after)
            while live.memory() > before + _BACK_WITHIN and time.perf_counter() < begun + ended + effort.memory:
                time.sleep(0.1)
            memory = (before, most, live.memory())
            performance = performer.end()
        status = _ended(live)
        since = effort.before if trial.killed else end if trial.fault or trial.deed else ended
        return Outcome(
            name=trial.name,
            answered=performance.answered(effort.before, end),
            expected=due,
            p99=_p99(performance.latencies(effort.before, end)),
            p99_before=_p99(performance.latencies(0.5, effort.before)),
            memory=memory,
            recovered=recovery(performance, since),
            stale=performance.late(1.0),
            told=", ".join(
                filter(None, [_counted(live.printed()), told, *map(kept, sorted(folder.glob("a*.kinerec")))])
            ),
            ended=status,
            noticed=_noticed(performance, effort.before, end) if trial.fault else None,
        )


def _due(frames: NDArray[np.float32], begin: float, end: float) -> int:
    """Count the answers to frames between two moments without an attack: after a jump of the body none come."""
    recognizer = Recognizer(MotionLibrary.builtin())
    answers = (recognizer.push(Frame(INNOCENT, 1.0 + k / FRAME_RATE, each)) for k, each in enumerate(frames))
    return sum(answer is not None and begin <= answer.time - 1.0 < end for answer in answers)


def _attack(attack: Attack, place: Place, ready: Semaphore, go: Event, stop: Event) -> None:
    """Run in an attacker's process: wait for the signal, so that no attack begins with the start of a process."""
    ready.release()
    go.wait()
    attack(place, stop)


def _wait(moment: float) -> None:
    while (left := moment - time.perf_counter()) > 0:
        time.sleep(left)


def _ended(live: Live) -> int:
    """Ask the program to end; give its exit status, or the one with which it had ended before."""
    live.process.send_signal(signal.SIGTERM)
    try:
        return live.process.wait(_PATIENCE)
    except subprocess.TimeoutExpired:
        return -1


def kept(recording: Path) -> str:
    """Say how many packets can be read in a recording."""
    return f"{sum(1 for _ in RawFile(recording).packets()):,} packets recorded"


def _p99(latencies: NDArray[np.float64]) -> float:
    return float(np.percentile(latencies, 99)) if latencies.size else float("nan")


def recovery(performance: Performance, end: float) -> float:
    """Give the seconds from a moment of the schedule until answers come again as they should; infinite for never."""
    last = max((at for at in performance.sent.values()), default=0.0) - performance.begun
    for moment in np.arange(end, last - _WELL, 0.05).tolist():
        latencies = performance.latencies(moment, moment + _WELL)
        if np.count_nonzero(latencies < _WELL_LATENCY) >= _WELL_SHARE * _WELL * ANSWER_RATE:
            return float(moment - end)
    return float("inf")


def _noticed(performance: Performance, begin: float, end: float) -> float | None:
    """Give the seconds from one moment of the schedule until an answer, before another, said that joints are wrong."""
    since = (answer.arrival - performance.begun for answer in performance.answers if answer.doubted)
    return next((seconds - begin for seconds in since if begin <= seconds < end), None)


def _counted(printed: str) -> str:
    """Give the counts apart from `received`: every count that is not 0."""
    summary = re.sub(r" \([^)]*\)", "", printed.rpartition("received ")[2])
    told = re.findall(r"([a-z][a-z ]*?) (\d+)(?=[,\n ])", summary.partition(" answers of")[0])
    found = [f"{name} {int(count):,}" for name, count in told if int(count)]
    found += [f"{int(each):,} too old to be sent" for each in re.findall(r"(\d+) too old to be sent", summary)]
    found += [f"{int(each):,} frames lost" for each in re.findall(r"(\d+) could not be written", summary) if int(each)]
    return ", ".join(found)
