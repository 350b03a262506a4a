"""`kinespace bench sockets`: latency above an echo's, losses, and the performers that one core holds."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING, NamedTuple, get_args

from kinespace.stream import osc, zeromq
from kinespace.stream.recognizer import Settings
from kinespace.tools.bench.crowd import CROWD, Feed, core_seconds, performers_a_core, play
from kinespace.tools.bench.recorded import FRAME_RATE
from kinespace.tools.bench.report import Measured, shown, table
from kinespace.tools.loopback.answer_listener import Listener, answer_in
from kinespace.tools.loopback.service_process import BackgroundService, Transport
from kinespace.tools.programs import latency
from kinespace.tools.terminal.console import progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from kinespace.tools.bench.report import Plan
    from kinespace.tools.feeding.feed import Packet
    from kinespace.tools.programs.latency import Latency

FIGURES = (
    *("latency_p99_ms", "echo_p99_ms", "lost_360"),
    *("performers_at_120hz", "floor_performers_at_120hz", "performers_share_of_floor"),
)
RATES = (60.0, 120.0, 240.0, 360.0)
TRANSPORTS: tuple[Transport, ...] = get_args(Transport)
#: Seconds of a crowd, at most.
_CROWD_SECONDS = 8.0


class EmptyLoop:
    """Takes a recogniser's place: answers one packet in so many with the same answer, whatever the packets say."""

    def __init__(self, answer: Packet, every: int) -> None:
        self._answer, self._every, self._count = answer, every, 0

    def answer(self, packet: Packet) -> Packet | None:
        """Give the answer when it is due, and to a greeting."""
        self._count += 1
        return self._answer if packet[0] == b"hello/" or self._count % self._every == 0 else None


class Load(NamedTuple):
    """What a crowd costs a process: microseconds of a core a frame (NaN: unknown), and answers that did not come."""

    core_us: float
    missing: int

    @property
    def performers(self) -> float:
        """The performers that one core holds."""
        return performers_a_core(self.core_us)


def measure(plan: Plan) -> Measured:
    """Measure latencies beside an echo's, and a crowd's cost beside an empty loop's, by OSC and by ZeroMQ."""
    settings = Settings(signature=plan.signature)
    runs = [(transport, rate) for transport in TRANSPORTS for rate in RATES]
    latencies = [
        latency.measure(transport, rate_hz=rate, seconds=plan.seconds, settings=settings)
        for transport, rate in progress(runs, "Latency", len(runs))
    ]
    feed = Feed.of(plan.positions, CROWD, min(plan.seconds, _CROWD_SECONDS), settings)
    tries = [(transport, empty) for transport in TRANSPORTS for empty in (False, True)]
    loads = {each: load(feed, *each, settings) for each in progress(tries, "Performers", len(tries))}
    return Measured(_figures(latencies, loads), [latency.table_of(latencies), _loads_table(loads)])


def load(feed: Feed, transport: Transport, empty: bool, settings: Settings) -> Load:  # noqa: FBT001 - one of a table's keys
    """Play a feed to a recogniser, or to a loop that receives and answers and recognises nothing."""
    encode = osc.encode_recognition if transport == "osc" else zeromq.encode_recognition
    stand_in = EmptyLoop(encode(feed.answers[-1]), round(settings.hop * FRAME_RATE)) if empty else None
    with BackgroundService(transport, settings=settings, performers=CROWD, stand_in=stand_in) as service:
        sender, receiver = service.connect()
        number = service.process_id
        with closing(sender), closing(Listener(receiver)) as listener:
            before = core_seconds(number)
            played = play(feed.cues(at_once=True), sender, listener)
            core_us = (core_seconds(number) - before) * 1e6 / len(played.sent)
    answered = sum(answer_in(each.packet) is not None for each in played.heard)
    due = len(played.sent) // round(settings.hop * FRAME_RATE) if empty else len(feed.answers)
    return Load(core_us, max(due - answered, 0))


def _figures(latencies: Sequence[Latency], loads: dict[tuple[Transport, bool], Load]) -> dict[str, float]:
    usual = next(each for each in latencies if (each.transport, each.rate_hz) == ("osc", 120.0))
    ours, floor = loads["osc", False].performers, loads["osc", True].performers
    return {
        "latency_p99_ms": usual.percentile(99),
        "echo_p99_ms": usual.percentile(99, echo=True),
        "lost_360": sum(each.lost for each in latencies if each.rate_hz == 360.0),
        "performers_at_120hz": ours,
        "floor_performers_at_120hz": floor,
        "performers_share_of_floor": ours / floor,
    }


def _loads_table(loads: dict[tuple[Transport, bool], Load]) -> Table:
    title = (
        f"Performers at 120 Hz that one core holds,\nby its time for {CROWD} whose frames come at once\n"
        "empty loop: receives and answers, recognises nothing"
    )
    made = table(title, ("",), ("µs a frame", "performers", "share of empty loop", "answers missing"))
    for (transport, empty), each in loads.items():
        share = "" if empty else f"{each.performers / loads[transport, True].performers:.1%}"
        name = f"{transport}, empty loop" if empty else transport
        made.add_row(name, shown(each.core_us, 1), shown(each.performers), share, f"{each.missing}")
    return made
