"""One trial: a running `kinespace live`, an innocent performer, and an attack or a fault for some seconds."""

import math
import multiprocessing
import os
import re
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from multiprocessing.synchronize import Event, Semaphore
from pathlib import Path
from typing import NamedTuple

import numpy as np
import programs
from chaos.attacks import Place, place_of
from chaos.performer import FRAME_RATE, Fault, Performer, cues_of
from fakes import pushed
from numpy.typing import NDArray
from programs import Program

from kinespace.library import MotionLibrary
from kinespace.stream import Recognizer
from kinespace.stream.inputs.kinerec import RawFile

#: Runs until it is stopped.
Attack = Callable[[Place, Event], None]

#: Seconds a program may take to begin or end.
_PATIENCE = 60.0
#: Megabytes within which memory counts as given back.
_BACK_WITHIN = 50.0
#: Seconds before and after the attack, and after it until which memory is measured.
_BEFORE, _AFTER, _MEMORY = 2.0, 3.0, 10.0
#: Ports of the recogniser's own choice.
_ANY = Place(("127.0.0.1", 0), "tcp://127.0.0.1:*", "tcp://127.0.0.1:*")


class Trial(NamedTuple):
    """An attack or a fault.

    Attributes
    ----------
    name
        The name for people.
    attack
        Runs in a process of its own; None for none.
    over
        The transport of the performer's frames: "osc" or "zmq".
    first
        Whether the attack begins before the performer.
    fault
        The fault of the performer's feed; None for none.
    deed
        An action on the recogniser, from our own process, for about the given seconds, with a folder for files; gives
        a line about it for people.
    prepared
        Puts what the options name into the folder for files.
    killed
        Whether the recogniser is killed (`kill -9`) and started again on the same ports.
    options
        Options of `kinespace live`; `{folder}` is a folder for files, `{number}` counts the programs in it.
    lasts
        How many times as long as other attacks it lasts.
    """

    name: str
    attack: Attack | None = None
    over: str = "osc"
    first: bool = False
    fault: Fault | None = None
    deed: Callable[[Program, Path, float], str] | None = None
    prepared: Callable[[Path], object] = lambda _: None
    killed: bool = False
    options: str = ""
    lasts: float = 1.0


class Outcome(NamedTuple):
    """The result of a trial.

    Attributes
    ----------
    row
        For people: the trial's name; answers to the innocent performer during the attack, and how many were expected;
        their latency before the attack and during it, 99th percentile, milliseconds; resident megabytes of the
        recogniser before, at most, and afterwards; seconds from the end of the attack until all was well; the
        recogniser's counts.
    ended
        The program's exit status: 0 when it ended on demand.
    """

    row: list[str]
    ended: int


@contextmanager
def started(options: Sequence[str] = (), place: Place = _ANY) -> Iterator[Program]:
    """Start `kinespace live` with the usual limit of open files."""
    ends = ["--osc-in", "{}:{}".format(*place.osc), "--zmq-in", place.frames, "--zmq-out", place.answers]
    import resource  # noqa: PLC0415 - there is none on Windows

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(1024, hard), hard))
    with programs.started("live", *ends, "--plain", *options) as program:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        yield program


def memory_of(process: int) -> float:
    """Give a process's resident memory in megabytes, as Linux counts it; NaN elsewhere, and when it is gone."""
    try:
        pages = Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1]
    except (OSError, IndexError):
        return float("nan")
    return int(pages) * os.sysconf("SC_PAGE_SIZE") / (1 << 20)


def page_of(program: Program) -> int:
    """Give the number of the process of a program's page, as Linux tells."""
    place = Path(f"/proc/{program.process.pid}/task/{program.process.pid}/children")
    children = map(int, place.read_text(encoding="ascii").split())
    return next(each for each in children if "spawn_main" in Path(f"/proc/{each}/cmdline").read_text(encoding="utf-8"))


def tried(trial: Trial, seconds: float, positions: NDArray[np.float32]) -> Outcome:
    """Run a trial of some seconds on a performer of these positions, (frames, 31, 3), metres, 120 a second, again."""
    begin, end = _BEFORE, _BEFORE + trial.lasts * seconds
    cues = cues_of(np.resize(positions, (round((end + _AFTER + _MEMORY) * FRAME_RATE), 31, 3)))
    # After a jump of the body no answers come, without an attack, too.
    expected = pushed(Recognizer(MotionLibrary.builtin()), [cue.frame for cue in cues])
    due = sum(begin <= answer.time - cues[0].frame.time < end for answer in expected)
    if trial.fault:
        first, last = (round(moment * FRAME_RATE) for moment in (begin, end))
        cues[first:last] = trial.fault(cues[first:last])
    context = multiprocessing.get_context("spawn")
    with ExitStack() as opened:
        folder = Path(opened.enter_context(tempfile.TemporaryDirectory()))
        options = [trial.options.format(folder=folder, number=number).split() for number in (0, 1)]
        trial.prepared(folder)
        program = opened.enter_context(started(options[0]))
        place = place_of(program)
        ready, go, stop = context.Semaphore(0), context.Event(), context.Event()
        attacker = context.Process(target=_attack, args=(trial.attack, place, ready, go, stop), daemon=True)
        attacker.start()
        ready.acquire(timeout=_PATIENCE)
        if trial.first:
            go.set()
            time.sleep(begin)
        performer = Performer(place, cues, trial.over)
        begun = performer.begin()
        _wait(begun + begin)
        before = most = memory_of(program.process.pid)
        go.set()
        line = trial.deed(program, folder, end - begin) if trial.deed else ""
        if trial.killed:
            program.process.kill()
            program.process.wait()
            program = opened.enter_context(started(options[1], place))
        while time.perf_counter() < begun + end:
            most = max(most, memory_of(program.process.pid))
            time.sleep(0.1)
        stop.set()
        attacker.join(_PATIENCE)
        ended, most = time.perf_counter() - begun, max(most, memory_of(program.process.pid))
        _wait(begun + ended + _AFTER)
        while memory_of(program.process.pid) > before + _BACK_WITHIN and time.perf_counter() < begun + ended + _MEMORY:
            time.sleep(0.1)
        memory = (before, most, memory_of(program.process.pid))
        # Ctrl-C while a program starts ends it with 1.
        place_of(program)
        performance, status = performer.end(), ended_with(program)
        since = begin if trial.killed else end if trial.fault or trial.deed else ended
        latencies = performance.latencies(begin, end)
        said = [_counted(program.output), line, *map(kept, sorted(folder.glob("a*.kinerec")))]
        name, recovered = trial.name + (f" ENDED with {status}" if status else ""), performance.recovery(since)
        row = [name, f"{len(latencies)} / {due}", _p99(performance.latencies(0.5, begin)), _p99(latencies)]
        row += [" / ".join(f"{each:.0f}" for each in memory), "never" if math.isinf(recovered) else f"{recovered:.1f}"]
        return Outcome([*row, ", ".join(filter(None, said))], status)


def _attack(attack: Attack | None, place: Place, ready: Semaphore, go: Event, stop: Event) -> None:
    """Run in the attacker's process: wait for the signal, so that no attack begins with the start of a process."""
    ready.release()
    go.wait()
    if attack:
        attack(place, stop)


def _wait(moment: float) -> None:
    time.sleep(max(moment - time.perf_counter(), 0.0))


def ended_with(program: Program) -> int:
    """Ask a program to end; give its exit status, or the one with which it had ended before."""
    program.process.send_signal(signal.SIGTERM)
    try:
        return program.process.wait(_PATIENCE)
    except subprocess.TimeoutExpired:
        return -1


def kept(recording: Path) -> str:
    """Say how many packets can be read in a recording."""
    return f"{sum(1 for _ in RawFile(recording).packets()):,} packets recorded"


def _p99(latencies: NDArray[np.float64]) -> str:
    return f"{1000 * np.percentile(latencies, 99):.1f}" if latencies.size else "-"


def _counted(printed: str) -> str:
    """Give the counts apart from `received`: every count that is not 0."""
    summary = re.sub(r" \([^)]*\)", "", printed.rpartition("received ")[2])
    named = re.findall(r"([a-z][a-z ]*?) (\d+)(?=[,\n ])", summary.partition(" answers of")[0])
    found = [f"{name} {int(count):,}" for name, count in named if int(count)]
    late, lost = (re.findall(rf"([1-9]\d*) {what}", summary) for what in ("left out", "could not be written"))
    found += [f"{int(count):,} answers left out" for count in late] + [f"{int(count):,} frames lost" for count in lost]
    return ", ".join(found)
