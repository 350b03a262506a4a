"""`kinespace bench stages`: the cost of each step from packet to answer."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pythonosc.osc_packet import OscPacket
from rich.table import Table

from kinespace.library import MotionLibrary, compiled
from kinespace.stream import osc, zeromq
from kinespace.stream.recognizer import LiveSignature, Recognizer, Settings
from kinespace.tools.bench.crowd import FRAME_RATE, Measured, endless, positions
from kinespace.tools.terminal.console import progress, table_of

#: Gives its cost, microseconds per frame.
Job = Callable[[], float]

#: The steps of which none is recognition, in the order of the table; "python-osc" decodes the same by another library.
_OTHERS = ("decode OSC", "decode OSC by python-osc", "decode ZeroMQ", "encode OSC", "encode ZeroMQ")
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
FIGURES = (*COSTS, "frames_per_second")
#: Frames that fill every window and every cache before measuring.
WARM_UP = 300
#: Frames of one round: four seconds.
ROUND = 480
#: Rounds, of which medians are taken.
ROUNDS = 9
#: Whether the system counts a thread's own time finely enough.
_FINE = time.get_clock_info("thread_time").resolution <= 1e-6


def measure(_: float) -> Measured:
    """Time every step on recorded frames, compiled and with numpy alone: medians of rounds of four seconds of feed."""
    library, played = MotionLibrary.builtin(), positions()
    jobs = _transports(library, played)
    for name, settings in RECOGNISING.items():
        jobs[name] = pushing(library, played, settings)
        jobs[name + _NUMPY] = pushing(library, played, settings, by_numpy=True)
    us = {name: float(np.median(each)) for name, each in in_turns(jobs, ROUNDS, "Stages").items()}
    figures = {name: us[step] for name, step in COSTS.items()}
    return Measured(figures | {"frames_per_second": 1e6 / us["recognise"]}, [_table(us)])


def _table(us: dict[str, float]) -> Table:
    rows = [(name, f"{us[name]:.1f}", "") for name in _OTHERS]
    rows += [(name, f"{us[name]:.1f}", f"{us[name + _NUMPY]:.1f}") for name in RECOGNISING]
    return table_of("From packet to answer, µs a frame", ("step", "compiled", "numpy"), rows)


def _transports(library: MotionLibrary, positions: NDArray[np.float32]) -> dict[str, Job]:
    """Make jobs of decoding a frame and encoding its answer; an answer's cost is shared by the frames of its hop."""
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
        "encode OSC": each(osc.encode_recognition, answers, len(answers) * hop),
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


def clock() -> float:
    """Give the seconds for which this thread has used a core; other programs' time does not count.

    Where the system counts it too coarsely, the wall clock is used.
    """
    return time.thread_time() if _FINE else time.perf_counter()


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
