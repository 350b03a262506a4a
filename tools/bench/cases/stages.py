"""`kinespace bench stages`: the cost of each step from packet to answer."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pythonosc.osc_packet import OscPacket

from kinespace.library import MotionLibrary
from kinespace.library.kernels import compiled
from kinespace.stream import osc, zeromq
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.bench.recorded import FRAME_RATE, Feed
from kinespace.tools.bench.timing import in_turns, timed
from kinespace.tools.terminal.console import progress

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kinespace.stream.recognizer import LiveSignature

#: The steps from packet to answer; steps of one transport contain its name.
STEPS = ("decode OSC", "decode ZeroMQ", "recognise", "encode OSC", "encode ZeroMQ")
#: Frames that fill every window and every cache before measuring.
WARM_UP = 300
#: Frames of one round: four seconds.
ROUND = 480


@dataclass(frozen=True, slots=True)
class Stages:
    """The costs of one signature's steps.

    Attributes
    ----------
    us
        Microseconds per frame of each of `STEPS`, with its share of the hops; `recognise` is `Recognizer.push`.
    us_per_frame_numpy
        Microseconds of `Recognizer.push` without the compiled loops.
    osc_decode_python_osc_us
        Microseconds to decode a frame's datagram by python-osc.
    """

    us: dict[str, float]
    us_per_frame_numpy: float
    osc_decode_python_osc_us: float

    @property
    def us_per_frame(self) -> float:
        """Microseconds of `Recognizer.push` per frame."""
        return self.us["recognise"]

    @property
    def frames_per_second(self) -> float:
        """How many frames one core recognises in a second."""
        return 1e6 / self.us_per_frame

    def share(self, step: str) -> float:
        """Give a step's share, 0 to 1, of all steps between a packet and its answer on its transport."""
        other = "OSC" if "ZeroMQ" in step else "ZeroMQ"
        return self.us[step] / sum(us for name, us in self.us.items() if other not in name)


def measure(positions: NDArray[np.float32], *, signatures: Sequence[LiveSignature], rounds: int) -> dict[str, Stages]:
    """Time every step on recorded frames.

    Parameters
    ----------
    positions
        The positions of the feed, shape (frames, 31, 3), metres.
    signatures
        The recogniser's signatures, one after the other.
    rounds
        Rounds of four seconds of feed each.

    Returns
    -------
    By signature.
    """
    library = MotionLibrary.builtin()
    return {
        signature: _measured(library, positions, Settings(signature=signature), rounds)
        for signature in progress(signatures, "Stages", len(signatures))
    }


def _measured(library: MotionLibrary, positions: NDArray[np.float32], settings: Settings, rounds: int) -> Stages:
    jobs = {
        **_transports(library, positions, settings),
        "recognise": pushing(library, positions, settings),
        "recognise, numpy": pushing(library, positions, settings, by_numpy=True),
    }
    costs = {name: float(np.median(each)) for name, each in in_turns(jobs, rounds).items()}
    return Stages(
        us_per_frame_numpy=costs.pop("recognise, numpy"),
        osc_decode_python_osc_us=costs.pop("decode OSC, python-osc"),
        us={name: costs[name] for name in STEPS},
    )


def _transports(
    library: MotionLibrary, positions: NDArray[np.float32], settings: Settings
) -> dict[str, Callable[[], float]]:
    """Make jobs of decoding a frame and encoding its answer, microseconds per frame."""
    frames = Feed(positions).take(ROUND + WARM_UP)
    recognizer = Recognizer(library, settings)
    recognitions = [recognition for frame in frames if (recognition := recognizer.push(frame))]
    datagrams = [osc.encode_frame(frame) for frame in frames[:ROUND]]
    messages = [zeromq.encode_frame(frame, index) for index, frame in enumerate(frames[:ROUND])]
    hops = settings.hop * FRAME_RATE

    def each(work: Callable[[Any], object], on: Sequence[object], count: float) -> Callable[[], float]:
        def every() -> None:
            # The results are dropped, as the service drops frames and answers.
            for one in on:
                work(one)

        return lambda: timed(every) * 1e6 / count

    return {
        "decode OSC": each(lambda datagram: osc.decode(datagram, 0.0), datagrams, ROUND),
        "decode OSC, python-osc": each(lambda datagram: OscPacket(datagram).messages, datagrams, ROUND),
        "decode ZeroMQ": each(lambda message: zeromq.decode(message, 0.0), messages, ROUND),
        "encode OSC": each(osc.encode_recognition, recognitions, len(recognitions) * hops),
        "encode ZeroMQ": each(zeromq.encode_recognition, recognitions, len(recognitions) * hops),
    }


def pushing(
    library: MotionLibrary, positions: NDArray[np.floating], settings: Settings, *, by_numpy: bool = False
) -> Callable[[], float]:
    """Make a job of pushing the next four seconds of a feed through a recogniser, microseconds per frame.

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
    feed = Feed(positions)
    with arithmetic():
        recognizer = Recognizer(library, settings)
        for frame in feed.take(WARM_UP):
            recognizer.push(frame)

    def run() -> float:
        frames = feed.take(ROUND)

        def push() -> None:
            for frame in frames:
                recognizer.push(frame)

        with arithmetic():
            return timed(push) * 1e6 / ROUND

    return run
