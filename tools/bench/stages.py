"""`kinespace bench stages`: what each step from packet to answer costs, and what it leaves in memory."""

from __future__ import annotations

import tracemalloc
from collections import defaultdict
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pythonosc.osc_packet import OscPacket

from library import MotionLibrary, compiled
from library.distances import DistanceMeasurer
from stream import osc, zeromq
from stream.recognizer import LiveSignature, Recognizer, Settings
from tools.bench.inner import steps_of
from tools.bench.recorded import FRAME_RATE, Feed
from tools.bench.timing import clock, in_turns, timed
from tools.console import progress

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from stream.frame import Frame
    from stream.recognition import Recognition

#: Frames that fill every window and warm every cache before anything is counted.
WARM_UP = 300
#: Frames of one round: four seconds.
_ROUND = 480
#: Frames over which memory is watched, this many times.
_WATCHED = 600
_STRETCHES = 4

Per = Literal["frame", "hop"]


@dataclass(frozen=True, slots=True)
class Stage:
    """One step on the way of a packet.

    Attributes
    ----------
    name
        What is done.
    per
        Whether it is done for each frame or for each answer.
    us
        Microseconds each time.
    us_per_frame
        The same spread over all frames.
    share
        Of all that is done between a packet and its answer on its transport, 0 to 1.
    """

    name: str
    per: Per
    us: float
    us_per_frame: float
    share: float


@dataclass(frozen=True, slots=True)
class Memory:
    """What pushing frames leaves behind.

    Attributes
    ----------
    kept
        Bytes that a frame leaves behind for good, answers dropped by who got them; 0 but for rounding.
    frame, hop
        Bytes in use at most while a frame between two answers, or one that is answered, is dealt with (median).
    """

    kept: float
    frame: float
    hop: float


@dataclass(frozen=True, slots=True)
class Stages:
    """What one signature's steps cost.

    Attributes
    ----------
    stages
        In their order; the recogniser's own, whatever is not among the named, last but the encoding.
    us_per_frame
        Of `Recognizer.push`: distances to recognition, the hops' share included.
    us_per_frame_numpy
        The same where nothing is compiled.
    osc_decode_us, osc_decode_python_osc_us
        Of a frame's datagram, by ours and by python-osc.
    memory
        What is left behind.
    """

    stages: tuple[Stage, ...]
    us_per_frame: float
    us_per_frame_numpy: float
    osc_decode_us: float
    osc_decode_python_osc_us: float
    memory: Memory

    @property
    def frames_per_second(self) -> float:
        """How many frames one core recognises in a second."""
        return 1e6 / self.us_per_frame


def measure(positions: NDArray[np.float32], *, signatures: Sequence[LiveSignature], rounds: int) -> dict[str, Stages]:
    """Time every step on recorded frames.

    Parameters
    ----------
    positions
        What the feed plays, shape (frames, 31, 3), metres.
    signatures
        Of the recogniser, one after the other.
    rounds
        Of four seconds of feed each.

    Returns
    -------
    By signature.
    """
    library = MotionLibrary.builtin()
    settings = {signature: Settings(signature=signature) for signature in signatures}
    # Before anything draws progress, which would be seen in the memory as well.
    memories = {signature: memory_left(library, positions, each) for signature, each in settings.items()}
    return {
        signature: _measured(library, positions, settings[signature], rounds, memories[signature])
        for signature in progress(signatures, "Stages", len(signatures))
    }


def _measured(
    library: MotionLibrary, positions: NDArray[np.float32], settings: Settings, rounds: int, memory: Memory
) -> Stages:
    costs = {
        name: float(np.median(each))
        for name, each in in_turns(
            {
                **_transports(library, positions, settings),
                "push": _Pushing(library, positions, settings).round,
                "push, numpy": _Pushing(library, positions, settings, by_numpy=True).round,
                **_inner(library, positions, settings),
            },
            rounds,
        ).items()
    }
    return Stages(
        stages=tuple(_shared(costs, frames_per_hop=settings.hop * FRAME_RATE)),
        us_per_frame=costs["push"],
        us_per_frame_numpy=costs["push, numpy"],
        osc_decode_us=costs["decode OSC"],
        osc_decode_python_osc_us=costs["decode OSC, python-osc"],
        memory=memory,
    )


def _shared(costs: Mapping[str, float], frames_per_hop: float) -> list[Stage]:
    """Make stages of costs per frame; what the recogniser does beside the named steps is its own."""
    inner = [name for name in ("distances", "window", "covariance", "eigenvector", "match") if name in costs]
    own = max(costs["push"] - sum(costs[name] for name in inner), 0.0)
    whole = {name: costs[f"decode {name}"] + costs["push"] + costs[f"encode {name}"] for name in ("OSC", "ZeroMQ")}
    per_frame = {
        **{name: costs[name] for name in ("decode OSC", "decode ZeroMQ", *inner)},
        "recogniser's own": own,
        **{name: costs[name] for name in ("encode OSC", "encode ZeroMQ")},
    }
    stages = []
    for name, us in per_frame.items():
        per: Per = "frame" if name.startswith(("decode", "recog")) else "hop"
        share = us / whole["ZeroMQ" if "ZeroMQ" in name else "OSC"]
        stages.append(Stage(name, per, us if per == "frame" else us * frames_per_hop, us, share))
    return stages


def _transports(
    library: MotionLibrary, positions: NDArray[np.float32], settings: Settings
) -> dict[str, Callable[[], float]]:
    """Make jobs of decoding a frame and encoding its answer, microseconds per frame."""
    frames = Feed(positions).take(_ROUND + WARM_UP)
    recognitions = _recognitions(library, settings, frames)
    datagrams = [osc.encode_frame(frame) for frame in frames[:_ROUND]]
    messages = [zeromq.encode_frame(frame, index) for index, frame in enumerate(frames[:_ROUND])]
    hops = settings.hop * FRAME_RATE

    def each(work: Callable[[Any], object], on: Sequence[object], count: float) -> Callable[[], float]:
        def every() -> None:
            # What comes of it is dropped, as the service drops frames that are taken in and answers that are sent.
            for one in on:
                work(one)

        return lambda: timed(every) * 1e6 / count

    return {
        "decode OSC": each(lambda datagram: osc.decode(datagram, 0.0), datagrams, _ROUND),
        "decode OSC, python-osc": each(lambda datagram: OscPacket(datagram).messages, datagrams, _ROUND),
        "decode ZeroMQ": each(lambda message: zeromq.decode(message, 0.0), messages, _ROUND),
        "encode OSC": each(osc.encode_recognition, recognitions, len(recognitions) * hops),
        "encode ZeroMQ": each(zeromq.encode_recognition, recognitions, len(recognitions) * hops),
    }


def _recognitions(library: MotionLibrary, settings: Settings, frames: Sequence[Frame]) -> list[Recognition]:
    recognizer = Recognizer(library, settings)
    return [recognition for frame in frames if (recognition := recognizer.push(frame))]


class _Pushing:
    """The whole recogniser, round after round of one feed."""

    def __init__(
        self, library: MotionLibrary, positions: NDArray[np.float32], settings: Settings, *, by_numpy: bool = False
    ) -> None:
        self._arithmetic = compiled.left_aside if by_numpy else nullcontext
        with self._arithmetic():
            self._recognizer = Recognizer(library, settings)
        self._feed = Feed(positions)
        self._push(WARM_UP)

    def round(self) -> float:
        """Push the next four seconds; microseconds per frame."""
        return self._push(_ROUND)

    def _push(self, count: int) -> float:
        frames = self._feed.take(count)

        def push() -> None:
            for frame in frames:
                self._recognizer.push(frame)

        with self._arithmetic():
            return timed(push) * 1e6 / count


class _Stepping:
    """The steps inside, each with a clock around it."""

    def __init__(self, library: MotionLibrary, positions: NDArray[np.float32], settings: Settings) -> None:
        self._feed = Feed(positions)
        self._steps = steps_of(library, settings)
        self.names = ("distances", "window", *self._steps.steps)
        self._frames_per_hop = max(round(settings.hop * FRAME_RATE), 1)
        self._measurer = DistanceMeasurer(library.skeleton, self._frames_per_hop)
        self._rows = np.empty((self._frames_per_hop, len(library.skeleton.pairs)))
        self._costs: Mapping[str, float] = {}
        self._run(WARM_UP)

    def round(self) -> None:
        """Take the next four seconds."""
        self._costs = self._run(_ROUND)

    def cost(self, name: str) -> float:
        """Give what a step cost in the last round, microseconds per frame."""
        return self._costs[name]

    def _run(self, count: int) -> dict[str, float]:
        seconds: dict[str, float] = defaultdict(float)
        for _ in range(0, count, self._frames_per_hop):
            frames = self._feed.take(self._frames_per_hop)
            times, positions = [frame.time for frame in frames], np.array([frame.positions for frame in frames])
            start = clock()
            self._measurer.measure(positions, self._rows)
            seconds["distances"] += clock() - start
            start = clock()
            self._steps.push(times, self._rows)
            seconds["window"] += clock() - start
            if not self._steps.ready:
                continue
            for name, step in self._steps.steps.items():
                start = clock()
                step()
                seconds[name] += clock() - start
        return {name: each * 1e6 / count for name, each in seconds.items()}


def _inner(
    library: MotionLibrary, positions: NDArray[np.float32], settings: Settings
) -> dict[str, Callable[[], float]]:
    """Make jobs of the steps inside the recogniser, microseconds per frame: the first of them runs the round of all."""
    stepping = _Stepping(library, positions, settings)
    first, *others = stepping.names

    def run() -> float:
        stepping.round()
        return stepping.cost(first)

    return {first: run, **{name: partial(stepping.cost, name) for name in others}}


def memory_left(library: MotionLibrary, positions: NDArray[np.float32], settings: Settings) -> Memory:
    """Watch Python's and numpy's allocations while frames are pushed and answers dropped.

    Parameters
    ----------
    library, settings
        Of the recogniser.
    positions
        What it is fed, shape (frames, 31, 3), metres.
    """
    recognizer = Recognizer(library, settings)
    frames = Feed(positions).take(2 * WARM_UP + _STRETCHES * _WATCHED)
    # Python and numpy keep small blocks for later use: their stores fill in some thousand frames, then no more.
    _recognitions(library, settings, frames)
    # Arrays made beforehand: watching must not leave anything in memory itself.
    peaks, answered = np.zeros(len(frames)), np.zeros(len(frames), dtype=bool)
    in_use = np.zeros(_STRETCHES + 1)
    tracemalloc.start()
    try:
        for index, frame in enumerate(frames):
            stretch, into = divmod(index - 2 * WARM_UP, _WATCHED)
            if not into:
                in_use[stretch] = tracemalloc.get_traced_memory()[0]
            now, _ = tracemalloc.get_traced_memory()
            tracemalloc.reset_peak()
            answered[index] = recognizer.push(frame) is not None
            peaks[index] = tracemalloc.get_traced_memory()[1] - now
        in_use[-1] = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    warm = np.arange(len(frames)) >= 2 * WARM_UP
    frame_peak, hop_peak = (float(np.median(peaks[warm & which])) for which in (~answered, answered))
    # What piles up does so in every stretch; those stores do not.
    kept = float(np.diff(in_use).min())
    return Memory(max(kept, 0.0) / _WATCHED, frame_peak, hop_peak)
