"""`kinespace bench sockets`: latency above an echo's, losses, and the performers that one core holds."""

from __future__ import annotations

import math
from contextlib import closing
from typing import get_args

from kinespace.stream.recognizer import Settings
from kinespace.tools.bench.crowd import (
    CROWD,
    Feed,
    Measured,
    core_seconds,
    performers_a_core,
    play,
    positions,
    shown,
)
from kinespace.tools.feeding.service import BackgroundService, Listener, Transport, answer_in
from kinespace.tools.programs import latency
from kinespace.tools.terminal.console import progress, table_of

FIGURES = ("latency_p99_ms", "echo_p99_ms", "lost_360", "performers_at_120hz")
RATES = (60.0, 120.0, 240.0, 360.0)
TRANSPORTS: tuple[Transport, ...] = get_args(Transport)
#: Seconds of a crowd, at most.
_CROWD_SECONDS = 8.0
#: The share of the answers that may be missing where a cost is measured.
_MISSING = 0.01


def measure(seconds: float) -> Measured:
    """Measure latencies, an echo's, and a crowd's cost, by OSC and by ZeroMQ, in runs of some seconds."""
    runs = [(transport, rate) for transport in TRANSPORTS for rate in RATES]
    latencies = [
        latency.measure(transport, rate_hz=rate, seconds=seconds, settings=Settings())
        for transport, rate in progress(runs, "Latency", len(runs))
    ]
    feed = Feed.of(positions(), CROWD, min(seconds, _CROWD_SECONDS))
    crowds = [(transport, echo) for transport in TRANSPORTS for echo in (False, True)]
    loads = {each: load(feed, *each) for each in progress(crowds, "Performers", len(crowds))}
    usual = next(each for each in latencies if (each.transport, each.rate_hz) == ("osc", 120.0))
    figures = {
        "latency_p99_ms": usual.percentile(99),
        "echo_p99_ms": usual.percentile(99, echo=True),
        "lost_360": sum(each.lost for each in latencies if each.rate_hz == 360.0),
        "performers_at_120hz": performers_a_core(loads["osc", False][0]),
    }
    title = f"Performers at 120 Hz that one core holds,\nby its time for {CROWD} whose frames come at once"
    rows = [
        (transport + " echo" * echo, shown(core_us, 1), shown(performers_a_core(core_us)), f"{missing}")
        for (transport, echo), (core_us, missing) in loads.items()
    ]
    made = table_of(title, ("", "µs a frame", "performers", "answers missing"), rows)
    return Measured(figures, [latency.table_for(latencies), made])


def load(feed: Feed, transport: Transport, echo: bool) -> tuple[float, int]:  # noqa: FBT001 - as the rows are named
    """Play a feed to a recogniser, or to an echo, which answers every frame and recognises nothing.

    Returns
    -------
    The microseconds of a core a frame, and the answers missing. Where more than `_MISSING` of them are, the cost is
    NaN: frames that were lost cost nothing.
    """
    with BackgroundService(transport, performers=CROWD, echo=echo) as service:
        sender, receiver = service.connect()
        with closing(sender), closing(Listener(receiver)) as listener:
            before = core_seconds(service.process_id)
            played = play(feed.cues(), sender, listener)
            core_us = (core_seconds(service.process_id) - before) * 1e6 / len(played.sent)
    due = len(played.sent) if echo else len(feed.answers)
    answered = len(played.received) if echo else sum(answer_in(each.packet) is not None for each in played.received)
    missing = max(due - answered, 0)
    return core_us if missing <= _MISSING * due else math.nan, missing
