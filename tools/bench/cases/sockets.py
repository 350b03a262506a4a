"""`kinespace bench sockets`: latency, losses, performers, start-up and memory, over real sockets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, get_args

from kinespace.stream.recognizer import LiveSignature, Settings
from kinespace.tools.bench.cases import capacity, startup
from kinespace.tools.bench.recorded import FRAME_RATE
from kinespace.tools.loopback.service_process import Transport
from kinespace.tools.programs import latency
from kinespace.tools.terminal.console import progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from kinespace.tools.bench.cases.capacity import Crowd
    from kinespace.tools.bench.cases.startup import Running
    from kinespace.tools.programs.latency import Latency

RATES = (60.0, 120.0, 240.0, 360.0)
TRANSPORTS: tuple[Transport, ...] = get_args(Transport)
#: Seconds of each try of a crowd, with the time to fill its windows.
_CROWD_SECONDS = 6.0


@dataclass(frozen=True, slots=True)
class Sockets:
    """The measurements over real sockets on this machine.

    Attributes
    ----------
    latencies
        Latency by transport and frame rate, beside a bare echo of the same packets.
    crowds
        By transport the largest crowd that one core holds; None when one performer is too many.
    floors
        The same for a loop that only receives and answers, measured right after its crowd: a lower bound for any Python
        program. The sender's core may be its limit.
    running
        Start-up and memory.
    """

    latencies: tuple[Latency, ...]
    crowds: dict[Transport, Crowd | None]
    floors: dict[Transport, Crowd | None]
    running: Running

    def share(self, transport: Transport) -> float | None:
        """Give the ratio of the crowd's size to the empty loop's; None when no crowd was held."""
        crowd, floor = self.crowds[transport], self.floors[transport]
        return crowd.performers / floor.performers if crowd and floor else None

    def latency(self, transport: Transport, rate_hz: float) -> Latency | None:
        """Give one run; None when it was not made."""
        asked = (transport, rate_hz)
        return next((each for each in self.latencies if (each.transport, each.rate_hz) == asked), None)


def measure(
    positions: NDArray[np.float32],
    *,
    signature: LiveSignature,
    seconds: float,
    rates: Sequence[float] = RATES,
    most: int = 1024,
    starts: int = 5,
) -> Sockets:
    """Measure latencies, crowds, start-up and memory of one signature.

    Parameters
    ----------
    positions
        The performers' positions, shape (frames, joints, 3), metres; latency runs play a feed of their own.
    signature
        Of the recogniser.
    seconds
        Of each latency run.
    rates
        Frames per second of the latency runs.
    most
        The number of performers, at most.
    starts
        How often the program is started for the start-up time.
    """
    settings = Settings(signature=signature)
    runs = [(transport, rate) for transport in TRANSPORTS for rate in rates]
    latencies = tuple(
        latency.measure(transport, rate_hz=rate, seconds=seconds, settings=settings)
        for transport, rate in progress(runs, "Latency", len(runs))
    )
    played = positions[: round(_CROWD_SECONDS * FRAME_RATE)]
    crowds: dict[Transport, Crowd | None] = {}
    floors: dict[Transport, Crowd | None] = {}
    for transport in progress(TRANSPORTS, "Performers", len(TRANSPORTS)):
        crowds[transport] = capacity.most_performers(transport, played, settings, most=most)
        floors[transport] = capacity.most_performers(transport, played, settings, most=most, empty=True)
    return Sockets(latencies, crowds, floors, startup.measure(positions, signature, starts=starts, many=min(most, 100)))
