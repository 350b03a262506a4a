"""The trials: attacks of strangers, faults of the performer's feed, and what befalls the recogniser's process."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np
from chaos import attacks
from chaos.attacks import flood, publish
from chaos.performer import FRAME_RATE
from chaos.trial import Trial, kept, page_of
from golden import bundle
from programs import Program, started

from kinespace.library import MotionLibrary
from kinespace.stream import osc
from kinespace.stream.osc.messages import MAX_FRAMES
from kinespace.tools.feeding.feed import Cue

#: Bytes after which a disk is full.
_FULL = 100_000


def _network(cues: list[Cue]) -> list[Cue]:
    """Lose 30 % of the frames, exchange a tenth with the next and double a tenth, delay all by up to 50 ms."""
    generator = np.random.default_rng(3)
    sent = [cue for cue in cues if generator.random() >= 0.3]
    for place in np.flatnonzero(generator.random(len(sent) - 1) < 0.1).tolist():
        one, other = sent[place : place + 2]
        sent[place : place + 2] = replace(other, due=one.due), replace(one, due=other.due)
    sent = [each for cue in sent for each in ([cue, cue] if generator.random() < 0.1 else [cue])]
    arrivals = np.maximum.accumulate([cue.due + generator.uniform(0.0, 0.05) for cue in sent]).tolist()
    return [replace(cue, due=due) for cue, due in zip(sent, arrivals, strict=True)]


def _late_clock(cues: list[Cue]) -> list[Cue]:
    return [replace(cue, frame=replace(cue.frame, time=cue.frame.time + 1000.0)) for cue in cues]


def _stop_and_go(program: Program, _: Path, seconds: float) -> str:
    program.process.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    program.process.send_signal(signal.SIGCONT)
    return ""


def slow(program: Program, _: Path, seconds: float) -> str:
    """Give the recogniser 15 ms of each tenth of a second, as a limit of CPU does."""
    ending = time.monotonic() + seconds
    while time.monotonic() < ending:
        time.sleep(0.015)
        program.process.send_signal(signal.SIGSTOP)
        time.sleep(0.085)
        program.process.send_signal(signal.SIGCONT)
    return ""


def _full_disk(program: Program, _: Path, seconds: float) -> str:
    """Let no file grow, as on a full disk, and then again."""
    import resource  # noqa: PLC0415 - there is none on Windows

    usual = resource.prlimit(program.process.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(program.process.pid, resource.RLIMIT_FSIZE, (_FULL, usual[1]))
    time.sleep(seconds)
    resource.prlimit(program.process.pid, resource.RLIMIT_FSIZE, usual)
    return ""


def _kill_the_page(program: Program, _: Path, seconds: float) -> str:
    """Kill the page's process (`kill -9`), and see whether it is begun again."""
    os.kill(page_of(program), signal.SIGKILL)
    time.sleep(seconds)
    program.expect(r"(?s)page: http.*page: http")
    return "the page was begun again"


def _kill_a_recorder(_: Program, folder: Path, seconds: float) -> str:
    """Record a feed beside the recogniser, kill the recorder (`kill -9`), and read its file."""
    recording, sent = folder / "killed.kinerec", 0
    with started("record", recording, "--osc-in", "127.0.0.1:0") as recorder:
        port = int(recorder.expect(r"osc 127\.0\.0\.1:(\d+)")[1])
        with closing(osc.OscSender("127.0.0.1", port)) as sender:
            ending = time.monotonic() + seconds
            while time.monotonic() < ending:
                sender.send(b"/a\0\0,\0\0\0")
                sent += 1
                time.sleep(1 / FRAME_RATE)
    return f"{kept(recording)} of {sent:,}"


def _large_library(folder: Path) -> None:
    """Make a library of four times as many classes as the built-in one's."""
    builtin = MotionLibrary.builtin()
    motions = [replace(each, class_name=f"{each.class_name} {n}") for n in range(4) for each in builtin.motions]
    replace(builtin, motions=tuple(motions)).save(folder / "large.npz", compressed=False)


def _flooded(name: str, packets: Callable[[], Iterator[bytes]], rate: float, **more: Any) -> Trial:  # noqa: ANN401 - of a trial
    return Trial(name, partial(flood, packets, rate), **more)


def _crowded(name: str, performers: int, rate: float, **more: Any) -> Trial:  # noqa: ANN401 - as above
    return _flooded(name, partial(attacks.crowd, performers, rate), performers * rate, **more)


def _published(name: str, messages: Callable[[], Iterator[list[bytes]]], rate: float) -> Trial:
    return Trial(f"ZeroMQ: {name}", partial(publish, messages, rate), "zmq")


TRIALS: tuple[Trial, ...] = (
    Trial("nothing"),
    Trial("nothing, by ZeroMQ", over="zmq"),
    _flooded("20,000 packets of garbage a second", attacks.garbage, 20_000),
    _flooded("10,000 new names a second", attacks.new_names, 10_000),
    _flooded("30 Mbit/s, 4,000 messages a datagram", partial(repeat, bundle(*[b"/a\0\0,\0\0\0"] * 4000)), 0),
    # More than are read, and as many as are.
    _flooded("30 Mbit/s, 110 right frames a datagram", partial(attacks.packed, 110), 0),
    _flooded(f"30 Mbit/s, {MAX_FRAMES} right frames a datagram", partial(attacks.packed, MAX_FRAMES), 0),
    _flooded("20,000 right frames a second, one performer", attacks.right_frames, 20_000),
    _flooded("the performer's name from another port", attacks.impostor, 3 * 120),
    _flooded("joints announced from another port before the performer comes", attacks.foreign_joints, 10, first=True),
    _crowded("32 invented performers before the performer comes", 32, 8, first=True),
    _published("20,000 messages of garbage a second", partial(repeat, [b"hello/", b"x" * 64]), 20_000),
    _published("30 Mbit/s of empty lists in msgpack", attacks.zmq_lists, 0),
    _published("30 Mbit/s of deep and long headers", attacks.zmq_headers, 116),
    _published("20,000 parts a second", partial(repeat, [b"x"] * 1000), 20),
    _published("the performer's name from another connection", attacks.zmq_impostor, 240),
    Trial("ZeroMQ: 20 subscriptions of 1 MB", attacks.large_subscriptions, "zmq"),
    Trial("ZeroMQ: 1,300 silent connections before the performer's", attacks.silent_connections, "zmq", first=True),
    Trial("30 % lost, reordered, doubled, 50 ms late", fault=_network),
    Trial("the performer's clock jumps by 1,000 s and back", fault=_late_clock),
    Trial("stopped (SIGSTOP) and continued", deed=_stop_and_go, lasts=2.0),
    _crowded("15 % of a core, 20 more performers at 60 Hz", 20, 60, deed=slow, lasts=2.0),
    Trial("31 strangers, a port each, 500 right frames a second", attacks.many_ports),
    # As few frames as make a performer.
    _crowded("1,500 performers of one port, 12 frames a second", 1500, 12, options="--performers 3000"),
    _flooded("20 datagrams a second of 255 or 8 commands", attacks.commands, 20, options="--teach {folder}/mine.npz"),
    Trial("a library four times as large", prepared=_large_library, options="--library {folder}/large.npz"),
    Trial("answers to a closed port", options="--osc-out 127.0.0.1:9"),
    Trial("disk full while recording", deed=_full_disk, options="--record {folder}/a.kinerec"),
    Trial("killed while recording, begun again", killed=True, options="--record {folder}/a{number}.kinerec"),
    Trial("a recorder beside it killed (kill -9)", deed=_kill_a_recorder),
    Trial("the page's process killed (kill -9)", deed=_kill_the_page, options="--page 127.0.0.1:0"),
)
