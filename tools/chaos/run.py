"""`kinespace chaos`: attacks and faults, one after the other, and their effect on a performer."""

from __future__ import annotations

import json
import os
import platform
import re
import signal
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.box import MARKDOWN

from kinespace.library import MotionLibrary
from kinespace.stream import osc
from kinespace.tools.bench import recorded
from kinespace.tools.chaos import attacks
from kinespace.tools.chaos.pages import HEADINGS, row, with_tables
from kinespace.tools.chaos.performer import FRAME_RATE
from kinespace.tools.chaos.trial import Effort, Trial, kept, tried
from kinespace.tools.cli.arguments import names, positive
from kinespace.tools.feeding.feed import Cue, with_drops, with_jitter, with_reordering
from kinespace.tools.terminal.console import console, progress
from kinespace.tools.terminal.tables import narrow_table

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray
    from rich.table import Table

    from kinespace.tools.chaos.performer import Fault
    from kinespace.tools.chaos.trial import Live, Outcome

#: Indices of joints of the bodies that are played: both wrists, and the joints of an arm.
_JOINTS = MotionLibrary.builtin().skeleton.joints
_WRISTS = [_JOINTS.index(name) for name in ("lwrist", "rwrist")]
#: Seconds that a sender's clock jumps by, and bytes after which a disk is full.
_CLOCK, _FULL = 1000.0, 100_000
#: Seconds a program may take to begin.
_PATIENCE = 60.0


def _network(cues: list[Cue]) -> list[Cue]:
    """Lose 30 % of the frames, exchange and double a tenth, delay all by up to 50 ms."""
    generator = np.random.default_rng(3)
    kept = with_reordering(with_drops(cues, 0.3, generator), 0.1, generator)
    doubled = [each for cue in kept for each in ([cue, cue] if generator.random() < 0.1 else [cue])]
    return list(with_jitter(doubled, 0.05, generator))


def _each(change: Callable[[Cue], Cue]) -> Fault:
    return lambda cues: list(map(change, cues))


def _posed(change: Callable[[NDArray[np.floating]], NDArray[np.floating]]) -> Fault:
    """Change the positions of every frame."""
    return _each(lambda cue: replace(cue, frame=replace(cue.frame, positions=change(cue.frame.positions))))


def _exchanged(positions: NDArray[np.floating]) -> NDArray[np.floating]:
    changed = positions.copy()
    changed[_WRISTS] = positions[_WRISTS[::-1]]
    return changed


def _frozen(cues: list[Cue]) -> list[Cue]:
    """Keep a wrist where it was."""
    place, wrist = cues[0].frame.positions[_WRISTS[0]].copy(), _WRISTS[0]

    def keep(positions: NDArray[np.floating]) -> NDArray[np.floating]:
        changed = positions.copy()
        changed[wrist] = place
        return changed

    return _posed(keep)(cues)


def _stop_and_go(live: Live, seconds: float) -> str:
    live.process.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    live.process.send_signal(signal.SIGCONT)
    return ""


def _full_disk(live: Live, seconds: float) -> str:
    """Let no file grow, as on a full disk, and then again."""
    import resource  # noqa: PLC0415 - there is none on Windows

    usual = resource.prlimit(live.process.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(live.process.pid, resource.RLIMIT_FSIZE, (_FULL, usual[1]))
    time.sleep(seconds)
    resource.prlimit(live.process.pid, resource.RLIMIT_FSIZE, usual)
    return ""


def _kill_a_recorder(live: Live, seconds: float) -> str:
    """Record a feed beside the recogniser, kill the recorder (`kill -9`), and read its file."""
    recording, printed = live.folder / "killed.kinerec", live.folder / "recorder"
    command = [sys.executable, "-m", "kinespace", "record", str(recording), "--osc-in", "127.0.0.1:0"]
    with printed.open("wb") as output:
        recorder = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)  # noqa: S603 - our own command
    try:
        until = time.monotonic() + _PATIENCE
        while not (found := re.search(r"osc 127\.0\.0\.1:(\d+)", printed.read_text(encoding="utf-8"))):
            if recorder.poll() is not None or time.monotonic() > until:
                raise ChildProcessError(f"kinespace record did not begin: {printed.read_text(encoding='utf-8')}")
            time.sleep(0.02)
        with closing(osc.OscSender("127.0.0.1", int(found[1]))) as sender:
            sent, ending = 0, time.monotonic() + seconds
            while time.monotonic() < ending:
                sender.send(b"/a\0\0,\0\0\0")
                sent += 1
                time.sleep(1 / FRAME_RATE)
    finally:
        recorder.kill()
        recorder.wait()
    return f"{kept(recording)} of {sent:,}"


TRIALS: tuple[Trial, ...] = (
    Trial("nothing", [attacks.nothing]),
    Trial("nothing, by ZeroMQ", [attacks.nothing], over="zmq"),
    Trial("20,000 packets of garbage a second", [attacks.garbage]),
    Trial("10,000 new names a second", [attacks.new_names]),
    Trial("30 Mbit/s, 4,000 messages a datagram", [attacks.many_messages]),
    Trial("30 Mbit/s, 110 right frames a datagram", [attacks.packed_frames]),
    Trial(f"30 Mbit/s, {osc.MAX_FRAMES} right frames a datagram", [attacks.full_datagrams]),
    Trial("20,000 right frames a second, one performer", [attacks.right_frames]),
    Trial("the performer's name from another port", [attacks.impostor]),
    Trial("32 invented performers before the performer comes", [attacks.many_performers], first=True),
    Trial("ZeroMQ: 20,000 messages of garbage a second", [attacks.zmq_garbage], over="zmq"),
    Trial("ZeroMQ: 30 Mbit/s of empty lists in msgpack", [attacks.zmq_lists], over="zmq"),
    Trial("ZeroMQ: 30 Mbit/s of deep and long headers", [attacks.zmq_headers], over="zmq"),
    Trial("ZeroMQ: 20,000 parts a second", [attacks.zmq_parts], over="zmq"),
    Trial("ZeroMQ: the performer's name from another connection", [attacks.zmq_impostor], over="zmq"),
    Trial("ZeroMQ: 20 subscriptions of 1 MB", [attacks.large_subscriptions], over="zmq"),
    Trial("ZeroMQ: 200,000 subscriptions", [attacks.many_subscriptions], over="zmq"),
    Trial("ZeroMQ: 400 MB of an unfinished message", [attacks.unfinished_message], over="zmq"),
    Trial(
        "ZeroMQ: 1,300 silent connections before the performer's", [attacks.silent_connections], over="zmq", first=True
    ),
    Trial("30 % lost, reordered, doubled, 50 ms late", fault=_network),
    Trial(
        "the performer's clock jumps by 1,000 s and back",
        fault=_each(lambda cue: replace(cue, frame=replace(cue.frame, time=cue.frame.time + _CLOCK))),
    ),
    Trial("stopped (SIGSTOP) and continued", deed=_stop_and_go, lasts=2.0),
    Trial("stopped and continued, by ZeroMQ", deed=_stop_and_go, over="zmq", lasts=2.0),
    Trial("answers to a closed port", [attacks.nothing], options=("--osc-out", "127.0.0.1:9")),
    Trial("disk full while recording", deed=_full_disk, options=("--record", "{folder}/a.kinerec")),
    Trial("killed while recording, begun again", killed=True, options=("--record", "{folder}/a{number}.kinerec")),
    Trial("a recorder beside it killed (kill -9)", deed=_kill_a_recorder),
    Trial("two wrists exchanged", fault=_posed(_exchanged)),
    Trial("a wrist frozen", fault=_frozen),
    Trial("unit changed to millimetres", fault=_posed(lambda positions: positions * 1000)),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Runs kinespace live and an innocent performer, attacks them in one way after the other, and prints the "
        "effect on the performer's answers and on the program. Takes eight minutes and loads the machine."
    )
    parser.add_argument("--seconds", type=positive, default=5.0, help="seconds of each attack (default %(default)s)")
    parser.add_argument(
        "--only", type=names, default=(), metavar="TEXT,...", help="only trials whose names contain one of these"
    )
    parser.add_argument(
        "--write",
        type=Path,
        nargs="+",
        default=(),
        metavar="PAGE",
        help="put the tables into these pages, like README.md, where their comments say so",
    )
    parser.add_argument("--json", action="store_true", help="print a JSON object for each trial, as they end")


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status: 1 when the program ended by itself."""
    wanted = [each for each in TRIALS if not options.only or any(text in each.name for text in options.only)]
    if not wanted:
        raise ValueError(f"--only: expected part of a name, like {TRIALS[2].name!r}, got {', '.join(options.only)}")
    for page in options.write:
        with_tables(page.read_text(encoding="utf-8"), [], "")  # before the minutes that the trials take
    outcomes: list[Outcome] = []
    for outcome in measured(wanted, Effort(during=options.seconds)):
        outcomes.append(outcome)
        if options.json:
            print(json.dumps(asdict(outcome)), flush=True)
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    machine = f"{os.cpu_count()} cores{load}, Python {platform.python_version()}, {platform.system()}"
    if not options.json:
        console.print(table(outcomes))
        console.print(machine)
    for page in options.write:
        page.write_text(with_tables(page.read_text(encoding="utf-8"), outcomes, machine), encoding="utf-8")
    return 0 if all(each.ended == 0 for each in outcomes) else 1


def measured(trials: Sequence[Trial], effort: Effort) -> Iterator[Outcome]:
    """Run some trials, one after the other."""
    positions = recorded.positions()
    for each in progress(trials, "Trials", len(trials)):
        yield tried(each, effort, positions, _JOINTS)


def table(outcomes: Sequence[Outcome]) -> Table:
    """Draw a row for each trial."""
    drawn = narrow_table("")
    drawn.box = MARKDOWN
    drawn.add_column(HEADINGS[0])
    for heading in HEADINGS[1:-1]:
        drawn.add_column(heading, justify="right")
    drawn.add_column(HEADINGS[-1])
    for each in outcomes:
        drawn.add_row(*row(each))
    return drawn
