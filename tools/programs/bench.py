"""`kinespace bench`: the cost of every step, and latencies and crowds over sockets, on real motions.

Times every step, and the way over sockets, on real motions. Everything takes five minutes.
"""

import argparse
import gc
import json
import math
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from itertools import count, islice
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from pythonosc.osc_packet import OscPacket
from rich.table import Table

from kinespace.library import MotionLibrary, compiled
from kinespace.stream import Frame, LiveSignature, Performers, Recognizer, Settings, osc, zeromq
from kinespace.tools.cli.arguments import add_shared, positive
from kinespace.tools.cli.console import console, progress, say, table_of
from kinespace.tools.feeding.feed import Cue, without_pause
from kinespace.tools.feeding.service import Listener, Transport, answer_in, background_service, play
from kinespace.tools.programs import latency

#: Frames per second of the feeds.
FRAME_RATE = 120.0
#: Performers whose frames come all at once, to see how many a core holds: frames do so that wait for a full core.
CROWD = 20


def positions() -> NDArray[np.float32]:
    """Give every eighth motion of the built-in library: shape (frames, 31, 3), metres, 120 frames per second."""
    return without_pause(MotionLibrary.builtin().motions[:: latency.EVERY], FRAME_RATE)


def endless(positions: NDArray[np.floating], performer: str = "bench", begin: int = 0) -> Iterator[Frame]:
    """Play positions, shape (frames, joints, 3), metres, 120 times a second without end, from one of them on."""
    # Time 0 would mean "on arrival".
    return (Frame(performer, 1.0 + k / FRAME_RATE, positions[(begin + k) % len(positions)]) for k in count())


def crowd_cues(positions: NDArray[np.float32], seconds: float) -> tuple[list[Cue], int]:
    """Cue a crowd that does the same motion, each performer at a moment of its own; and count the answers due.

    They enter one after the other, a frame apart, so that their hops do not coincide.
    """
    moments, shift = round(seconds * FRAME_RATE), len(positions) // CROWD + 1
    each = [list(islice(endless(positions, f"p{index}", index * shift), moments)) for index in range(CROWD)]
    frames = [[of[k] for of in each[: k + 1]] for k in range(moments)]
    recognisers = Performers(MotionLibrary.builtin(), Settings(), most=CROWD)
    due = sum(bool(each) for together in frames for each in recognisers.push_all(together, together[0].time))
    # Looking for garbage among all these frames would take a tenth of a second.
    gc.freeze()
    return [Cue(k / FRAME_RATE, frame) for k, together in enumerate(frames) for frame in together], due


def core_seconds(process_id: int) -> float:
    """Give for how many seconds a process has used a core, all its threads; NaN where the system does not count it.

    Only Linux says it, in `/proc`.
    """
    try:
        status = Path(f"/proc/{process_id}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return math.nan
    # After the command's name, which may hold any character; user and system time are the 14th and 15th field.
    fields = status.rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def performers_a_core(core_us: float) -> float:
    """Give how many performers one core holds when each of their frames takes `core_us` microseconds."""
    return 1e6 / FRAME_RATE / core_us if core_us else math.nan


class Measurement(NamedTuple):
    """The results of a part: its figures by name, NaN for a figure that was not measured, and its tables."""

    figures: dict[str, float]
    tables: list[Table]


def rounded(value: float) -> float | int | None:
    """Keep four digits, because more would be noise; None for NaN and infinity."""
    if isinstance(value, int):
        return value
    return float(f"{value:.4g}") if math.isfinite(value) else None


def shown(value: float, digits: int = 0) -> str:
    """Write a number with some digits after the point; a dash for a number that was not measured."""
    return "-" if math.isnan(value) else f"{value:,.{digits}f}"


#: Gives its cost, microseconds per frame.
Job = Callable[[], float]

#: Recognition (`Recognizer.push`) by its settings.
RECOGNISING = {
    "recognise": Settings(),
    "recognise, --progress": Settings(progress=True),
    "recognise, --signature paper": Settings(signature=LiveSignature.PAPER),
}
_NUMPY = ", numpy"
#: The steps whose cost is a figure.
COSTS = {
    "us_per_frame": "recognise",
    "us_per_frame_numpy": "recognise" + _NUMPY,
    "osc_decode_us": "decode OSC",
    "osc_decode_python_osc_us": "decode OSC by python-osc",
}
STAGES = (*COSTS, "frames_per_second")
#: Frames that fill every window and every cache before measuring.
WARM_UP = 300
#: Frames of one round: four seconds.
ROUND = 480
#: Rounds, of which medians are taken.
ROUNDS = 9
#: Gives the seconds for which this thread has used a core; other programs' time does not count. Where the system counts
#: it too coarsely, the wall clock is used.
clock = time.thread_time if time.get_clock_info("thread_time").resolution <= 1e-6 else time.perf_counter


def measure_stages(_: float) -> Measurement:
    """Time every step on recorded frames, compiled and with numpy alone: medians of rounds of four seconds of feed."""
    library, played = MotionLibrary.builtin(), positions()
    transports = _transports(library, played)
    jobs = {**transports}
    for name, settings in RECOGNISING.items():
        jobs[name] = pushing(library, played, settings)
        jobs[name + _NUMPY] = pushing(library, played, settings, by_numpy=True)
    us = {name: float(np.median(each)) for name, each in in_turns(jobs, ROUNDS, "Stages").items()}
    figures = {name: us[step] for name, step in COSTS.items()}
    rows = [(name, f"{us[name]:.1f}", "") for name in transports]
    rows += [(name, f"{us[name]:.1f}", f"{us[name + _NUMPY]:.1f}") for name in RECOGNISING]
    table = table_of("From packet to answer, µs a frame", ("step", "compiled", "numpy"), rows)
    return Measurement(figures | {"frames_per_second": 1e6 / us["recognise"]}, [table])


def _transports(library: MotionLibrary, positions: NDArray[np.float32]) -> dict[str, Job]:
    """Make jobs of decoding a frame and encoding its answer; an answer's cost is shared by the frames of its hop.

    "python-osc" decodes the same by another library.
    """
    frames = list(islice(endless(positions), ROUND + WARM_UP))
    recognizer, hop = Recognizer(library), Settings().hop * FRAME_RATE
    answers = [answer for frame in frames if (answer := recognizer.push(frame))]
    datagrams = [osc.encode_frame(frame) for frame in frames[:ROUND]]
    messages = [zeromq.encode_frame(frame, index) for index, frame in enumerate(frames[:ROUND])]

    def each(work: Callable[[Any], object], on: Sequence[object], count: float) -> Job:
        def every() -> None:
            # The results are dropped, as the service drops frames and answers.
            for one in on:
                work(one)

        return lambda: timed(every) * 1e6 / count

    return {
        "decode OSC": each(lambda datagram: osc.decode(datagram, 0.0), datagrams, ROUND),
        "decode OSC by python-osc": each(lambda datagram: OscPacket(datagram).messages, datagrams, ROUND),
        "decode ZeroMQ": each(lambda message: zeromq.decode(message, 0.0), messages, ROUND),
        "encode OSC": each(osc.messages.encode_recognition, answers, len(answers) * hop),
        "encode ZeroMQ": each(zeromq.encode_recognition, answers, len(answers) * hop),
    }


def pushing(
    library: MotionLibrary, positions: NDArray[np.floating], settings: Settings, *, by_numpy: bool = False
) -> Job:
    """Make a job of pushing the next four seconds of a feed through a recogniser.

    Parameters
    ----------
    library, settings
        Of the recogniser.
    positions
        The positions of the feed, shape (frames, joints, 3), metres.
    by_numpy
        Disable the compiled loops.
    """
    arithmetic = compiled.left_aside if by_numpy else nullcontext
    feed = endless(positions)
    with arithmetic():
        recognizer = Recognizer(library, settings)
        for frame in islice(feed, WARM_UP):
            recognizer.push(frame)

    def run() -> float:
        frames = list(islice(feed, ROUND))

        def push() -> None:
            for frame in frames:
                recognizer.push(frame)

        with arithmetic():
            return timed(push) * 1e6 / ROUND

    return run


def timed(call: Callable[[], object]) -> float:
    """Give the seconds of a core that a call took."""
    start = clock()
    call()
    return clock() - start


def in_turns(jobs: Mapping[str, Callable[[], float]], rounds: int, what: str) -> dict[str, NDArray[np.float64]]:
    """Run jobs one after the other, in rounds, so that a disturbance of the machine meets all jobs alike.

    Parameters
    ----------
    jobs
        Each job returns its cost, in a unit of its own. The first turn of each job warms up and does not count.
    rounds
        Turns that count.
    what
        The title of the progress bar.

    Returns
    -------
    By job, the cost of each round, shape (rounds,).
    """
    turns = range(rounds + 1)
    costs = [{name: job() for name, job in jobs.items()} for _ in progress(turns, what, len(turns))]
    return {name: np.array([cost[name] for cost in costs[1:]]) for name in jobs}


SOCKETS = ("latency_p99_ms", "echo_p99_ms", "lost_360", "performers_at_120hz")
RATES = (60.0, 120.0, 240.0, 360.0)
TRANSPORTS: tuple[Transport, ...] = get_args(Transport)
#: Seconds of a crowd, at most.
_CROWD_SECONDS = 8.0
#: The share of the answers that may be missing where a cost is measured.
_MISSING = 0.01


def measure_sockets(seconds: float) -> Measurement:
    """Measure latencies, an echo's, and a crowd's cost, by OSC and by ZeroMQ, in runs of some seconds."""
    runs = [(transport, rate) for transport in TRANSPORTS for rate in RATES]
    played = progress(runs, "Latency", len(runs))
    latencies = [latency.measure(by, rate_hz=rate, seconds=seconds, settings=Settings()) for by, rate in played]
    cues, due = crowd_cues(positions(), min(seconds, _CROWD_SECONDS))
    crowds = [(transport, echo) for transport in TRANSPORTS for echo in (False, True)]
    loads = {each: load(cues, due, *each) for each in progress(crowds, "Performers", len(crowds))}
    usual = next(each for each in latencies if (each.transport, each.rate_hz) == ("osc", 120.0))
    figures = {
        "latency_p99_ms": usual.percentile(99),
        "echo_p99_ms": usual.percentile(99, echo=True),
        "lost_360": sum(each.lost for each in latencies if each.rate_hz == 360.0),
        "performers_at_120hz": performers_a_core(loads["osc", False][0]),
    }
    title = f"Performers at 120 Hz that one core holds,\nby its time for {CROWD} at once (-: answers are missing)"
    rows = [
        (transport + " echo" * echo, shown(core_us, 1), shown(performers_a_core(core_us)), f"{missing}")
        for (transport, echo), (core_us, missing) in loads.items()
    ]
    made = table_of(title, ("", "µs a frame", "performers", "answers missing"), rows)
    return Measurement(figures, [latency.table_for(latencies), made])


def load(cues: Sequence[Cue], due: int, transport: Transport, echo: bool) -> tuple[float, int]:  # noqa: FBT001 - as the rows are named
    """Play a feed to a recogniser, or to an echo, which answers every frame and recognises nothing.

    Returns
    -------
    The microseconds of a core a frame, and the answers missing. Where more than `_MISSING` of them are, the cost is
    NaN: frames that were lost cost nothing.
    """
    with background_service(transport, performers=CROWD, echoes=echo) as service:
        before = core_seconds(service.process_id)
        played = play(cues, [service.sender], Listener(service.receiver))
        core_us = (core_seconds(service.process_id) - before) * 1e6 / len(played.sent[0])
    expected = len(cues) if echo else due
    answered = sum(echo or answer_in(each.packet) is not None for each in played.received)
    missing = max(expected - answered, 0)
    return core_us if missing <= _MISSING * expected else math.nan, missing


#: The parts in the order in which a reader wants them: the names of their figures, and what measures them.
PARTS = {"stages": (STAGES, measure_stages), "sockets": (SOCKETS, measure_sockets)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("part", nargs="?", choices=(*PARTS, "all"), default="all", help="default: %(default)s")
    parser.add_argument("--seconds", type=positive, default=20.0, help="of a run of sockets (default %(default)s)")
    add_shared(parser, "--json")


def run(options: argparse.Namespace) -> None:
    """Run the program with these options."""
    figures = dict.fromkeys(name for names, _ in PARTS.values() for name in names)
    for measure in [measure for name, (_, measure) in PARTS.items() if options.part in (name, "all")]:
        measured = measure(options.seconds)
        figures |= {name: rounded(value) for name, value in measured.figures.items()}
        for table in () if options.json else measured.tables:
            console.print(table, "")
    say(json.dumps(figures) if options.json else f"{machine()}; {compiled.kind()}")


def machine() -> str:
    """Describe the machine of a measurement, and how busy it was otherwise."""
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{os.cpu_count()} cores{load}, Python {platform.python_version()}, {platform.system()}"
