"""The results of the bench, as its standard figures and as tables."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from kinespace.stream.recognizer import LiveSignature
from kinespace.tools.terminal.tables import narrow_table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rich.table import Table

    from kinespace.tools.bench.cases.capacity import Crowd
    from kinespace.tools.bench.cases.cluster_soak import Endured
    from kinespace.tools.bench.cases.peers import Peers
    from kinespace.tools.bench.cases.scale import Scale
    from kinespace.tools.bench.cases.scaling import Growth
    from kinespace.tools.bench.cases.soak import Soak
    from kinespace.tools.bench.cases.sockets import Sockets
    from kinespace.tools.bench.cases.stages import Stages

#: A table's cell without a measurement.
_NOTHING = "-"
#: The names of the alternatives in the standard figures.
_PEERS = {"svd": "SVD of the window", "eigh": "np.cov + eigh", "dtw": "DTW"}


@dataclass(slots=True)
class Report:
    """Results of the parts that were run; None for a part that was not.

    Attributes
    ----------
    signature
        The signature of the standard figures.
    """

    signature: LiveSignature
    stages: dict[str, Stages] | None = None
    peers: Peers | None = None
    growth: tuple[Growth, ...] | None = None
    sockets: Sockets | None = None
    soak: Soak | None = None
    scale: Scale | None = None
    cluster_soak: Endured | None = None
    notes: list[str] = field(default_factory=list)

    def figures(self) -> dict[str, float | int | None]:
        """Give the standard figures by name, always every name; None for a figure that was not measured."""
        found = {**self._of_stages(), **self._of_peers(), **self._of_growth(), **self._of_sockets(), **self._of_soak()}
        found |= self._of_scale()
        return {name: _rounded(value) for name, value in found.items()}

    def _of_stages(self) -> dict[str, float | None]:
        stages = self.stages[self.signature] if self.stages else None
        return {
            "us_per_frame": stages.us_per_frame if stages else None,
            "us_per_frame_numpy": stages.us_per_frame_numpy if stages else None,
            "frames_per_second": stages.frames_per_second if stages else None,
            "osc_decode_us": stages.us["decode OSC"] if stages else None,
            "osc_decode_python_osc_us": stages.osc_decode_python_osc_us if stages else None,
        }

    def _of_peers(self) -> dict[str, float | None]:
        ours = self.peers.peer(self.signature) if self.peers else None
        found = {key: self.peers.peer(name) if self.peers else None for key, name in _PEERS.items()}
        return {
            **{f"ratio_{key}": peer.ratios[self.signature] if peer else None for key, peer in found.items()},
            "accuracy": ours.accuracy if ours else None,
            **{f"accuracy_{key}": peer.accuracy if peer else None for key, peer in found.items()},
        }

    def _of_growth(self) -> dict[str, float | None]:
        found = {each.of: each for each in self.growth or ()}
        joints, library = found.get("joints"), found.get("library")
        at_200k = dict(zip(library.sizes, library.us, strict=True)).get(200_000) if library else None
        return {
            "pairs_exponent": joints.exponent if joints else None,
            "match_200k_ms": at_200k / 1000 if at_200k else None,
        }

    def _of_sockets(self) -> dict[str, float | None]:
        sockets = self.sockets
        usual = sockets.latency("osc", 120.0) if sockets else None
        fastest = [each for each in sockets.latencies if each.rate_hz == 360.0] if sockets else []
        held, floor = (sockets.crowds["osc"], sockets.floors["osc"]) if sockets else (None, None)
        return {
            "latency_p99_ms": usual.percentile(99) if usual else None,
            "echo_p99_ms": usual.percentile(99, echo=True) if usual else None,
            "lost_360": sum(each.lost for each in fastest) if fastest else None,
            "performers_at_120hz": (held.performers if held else 0) if sockets else None,
            "floor_performers_at_120hz": (floor.performers if floor else 0) if sockets else None,
            "performers_share_of_floor": sockets.share("osc") if sockets else None,
            "rss_mb": sockets.running.resident_mb if sockets else None,
            "rss_100_mb": sockets.running.resident_100_mb if sockets else None,
            "startup_s": sockets.running.startup_s if sockets else None,
        }

    def _of_soak(self) -> dict[str, float | None]:
        return {"max_eigenvector_error": self.soak.day.max_error if self.soak else None}

    def _of_scale(self) -> dict[str, float | None]:
        scale = self.scale
        return {
            "added_p50_ms": scale.added_ms(50) if scale else None,
            "added_p99_ms": scale.added_ms(99) if scale else None,
            "performers_per_core_ratio": scale.ratio if scale else None,
            "workers_speedup": scale.speedup if scale else None,
            **{f"{what}_gap_s": scale.runs[what].gap if scale else None for what in ("kill", "hang", "leave", "join")},
            "gateway_gap_s": scale.gateway_gap_s if scale else None,
            "lost_events": scale.lost_events if scale else None,
            "false_events": scale.false_events if scale else None,
        }

    def tables(self) -> Iterator[Table]:
        """Give a table for each part that was run."""
        if self.stages:
            for signature, each in self.stages.items():
                yield _stages_table(signature, each)
        if self.peers:
            yield _peers_table(self.peers)
        if self.growth:
            yield _growth_table(self.growth)
        if self.sockets:
            yield _latency_table(self.sockets)
            yield _outside_table(self.sockets)
        if self.soak:
            yield _soak_table(self.soak)
        if self.scale:
            yield _scale_table(self.scale)
            yield _scale_summary(self.scale)
        if self.cluster_soak:
            yield _endured_table(self.cluster_soak)


def _rounded(value: float | None) -> float | int | None:
    """Keep four digits, because more would be noise; None for NaN and infinity."""
    if value is None or isinstance(value, int):
        return value
    return float(f"{value:.4g}") if math.isfinite(value) else None


def _table(title: str, names: Sequence[str], figures: Sequence[str]) -> Table:
    table = narrow_table(title)
    # Where the table does not fit, names break into lines, figures never.
    for name in names:
        table.add_column(name)
    for figure in figures:
        table.add_column(figure, justify="right", no_wrap=True)
    return table


def _stages_table(signature: str, stages: Stages) -> Table:
    headings = ("per frame, µs", "share of packet to answer")
    table = _table(f"From packet to answer, {signature}, one core", ("step",), headings)
    for step, us in stages.us.items():
        table.add_row(step, f"{us:.1f}", f"{stages.share(step):.1%}")
    table.add_section()
    bought = stages.us_per_frame_numpy / stages.us_per_frame
    table.add_row("recognised frames a second", "", f"{stages.frames_per_second:,.0f}")
    table.add_row("recognise, nothing compiled", f"{stages.us_per_frame_numpy:.1f}", f"{bought:.1f} times that")
    table.add_row("python-osc decoding the same", f"{stages.osc_decode_python_osc_us:.1f}", "")
    return table


def _peers_table(peers: Peers) -> Table:
    headings = ("frames/s", *(f"times {signature}" for signature in LiveSignature), "right")
    title = (
        f"{peers.motions} motions of {peers.person}, compared with those of the others\n"
        f"Times: its cost in ours; right: of some {peers.answers:,} answers,\nthose after half a second of a motion"
    )
    table = _table(title, ("",), headings)
    for peer in peers.peers:
        table.add_row(
            f"ours, {peer.name}" if peer.name in list(LiveSignature) else peer.name,
            f"{peer.frames_per_second:,.0f}",
            *(f"{peer.ratios[signature]:,.2f}" for signature in LiveSignature),
            f"{peer.accuracy:.1%}",
        )
    return table


def _growth_table(growth: Sequence[Growth]) -> Table:
    table = _table("The cost of growing, one core", ("of", "size", "cost of"), ("µs", "exponent"))
    for each in growth:
        last = each.labels[-1]
        for label, us in zip(each.labels, each.us, strict=True):
            told = f"{each.exponent:.2f}" if label == last else ""
            table.add_row(each.of, label, each.cost, f"{us:,.1f}", told, end_section=label == last)
    return table


def _latency_table(sockets: Sockets) -> Table:
    percents = (50, 95, 99, 99.9)
    headings = (*(f"p{percent:g}" for percent in percents), "max", "sent", "answered", "lost")
    table = _table("Frame sent to answer received, milliseconds", ("", "Hz"), headings)
    for each in sockets.latencies:
        rate = f"{each.rate_hz:g}"
        ours, echo = ([f"{each.percentile(p, echo=e):.2f}" for p in (*percents, 100)] for e in (False, True))
        table.add_row(each.transport, rate, *ours, f"{each.sent}", f"{each.answered}", f"{each.lost}")
        table.add_row(f"{each.transport} echo", rate, *echo, end_section=True)
    return table


def _outside_table(sockets: Sockets) -> Table:
    table = _table("Seen from outside", ("",), ("", "more"))
    for transport, crowd in sockets.crowds.items():
        held = f"{crowd.performers}" if crowd else "0"
        table.add_row(f"performers at 120 Hz on one core, {transport}", held, _of_crowd(crowd) if crowd else "")
        floor = sockets.floors[transport]
        told = _of_crowd(floor) if floor else ""
        table.add_row("... of a loop that recognises nothing", f"{floor.performers}" if floor else "0", told)
        share = sockets.share(transport)
        table.add_row("... share of that", _NOTHING if share is None else f"{share:.1%}", "")
    running = sockets.running
    table.add_row("start of `kinespace live` to its first answer", f"{running.startup_s:.2f} s", "")
    table.add_row("resident memory, one performer", _megabytes(running.resident_mb), "")
    table.add_row("resident memory, 100 performers", _megabytes(running.resident_100_mb), "")
    return table


def _of_crowd(crowd: Crowd) -> str:
    told = f"p50 {crowd.percentile(50):.2f} ms, p99 {crowd.percentile(99):.2f} ms"
    share = "" if crowd.core_share is None else f"; {crowd.core_share:.0%} of the core"
    return f"{told}; {crowd.sent:,} frames, {crowd.lost} lost{share}"


def _soak_table(soak: Soak) -> Table:
    day = soak.day
    hours = day.frames / 120 / 3600
    table = _table(f"{day.frames:,} frames, {hours:.2f} hours of a 120 Hz feed", ("",), ("",))
    table.add_row("took", f"{day.seconds:,.0f} s, {day.frames / day.seconds:,.0f} frames/s")
    table.add_row("resident at start, middle, end", ", ".join(map(_megabytes, day.resident_mb)))
    error = _NOTHING if day.max_error is None else f"{day.max_error:.2e} in {day.checked:,} answers computed anew"
    table.add_row("largest error of the leading eigenvector", error)
    counts = day.counts
    told = f"{counts.frames:,} frames, {counts.hops:,} hops, {day.answers:,} answers"
    table.add_row("counters", f"{told}: {'consistent' if day.consistent else 'NOT consistent'}")
    if crowd := soak.over_sockets:
        seconds = crowd.sent / crowd.performers / 120
        table.add_row(f"over UDP, {crowd.performers} performers, {seconds:,.0f} s", _of_crowd(crowd))
        samples = crowd.resident_mb
        ends = (samples[0], samples[len(samples) // 2], samples[-1]) if samples else (None,) * 3
        table.add_row("its resident memory at start, middle, end", ", ".join(map(_megabytes, ends)))
    return table


def _scale_table(scale: Scale) -> Table:
    title = (
        f"{scale.crowd} performers; three workers when one comes, goes or is cut off\n"
        "p50, p99: milliseconds from a frame to its answer\n"
        "gap: the longest time after that without an answer to a performer, seconds\n"
        "none: answers that are missing; lost, false: events\n"
        "here, there: microseconds of a core, a frame, in this process and in others\n"
        "core: performers at 120 Hz that a core recognises, by their processor time"
    )
    table = _table(title, ("",), ("p50", "p99", "gap", "none", "lost", "false", "here", "there", "core"))
    for run in (scale.alone, scale.workers, *scale.runs.values(), *scale.at_once, *scale.held):
        lags = (f"{run.percentile(50):.2f}", f"{run.percentile(99):.2f}", _seconds(run.gap))
        counted = (f"{run.expected - run.answered}", f"{run.lost_events}", f"{run.false_events}")
        recognised = run.core_us or (run.loop_us if run.what.startswith("one") else math.nan)
        used = [_NOTHING if math.isnan(us) else f"{us:.0f}" for us in (run.loop_us, run.core_us or math.nan)]
        core = _NOTHING if math.isnan(recognised) else f"{1e6 / 120 / recognised:.0f}"
        table.add_row(run.what, *lags, *counted, *used, core)
    return table


def _scale_summary(scale: Scale) -> Table:
    tried, differ = scale.takeovers
    table = _table("A gateway and its workers", ("",), ("",))
    table.add_row("microseconds of a frame's recognition alone, frame after frame", f"{scale.recognised_us:.0f}")
    table.add_row("seconds without an answer when the gateway is started again", _seconds(scale.gateway_gap_s))
    table.add_row("seconds until a worker works again after a cut of 5 s", _seconds(scale.healed_s))
    table.add_row(f"of {tried} takeovers by themselves, with other events", f"{differ}")
    for name, value, goal in (
        ("what a worker's core holds, relative to one process over OSC", scale.ratio, 0.8),
        ("what live --workers 2 recognises, relative to one process", scale.speedup, 1.7),
    ):
        table.add_row(f"{name} (goal {goal})", f"{value:.2f}" if value else _NOTHING)
    return table


def _endured_table(endured: Endured) -> Table:
    title = f"{endured.minutes:g} minutes of {endured.performers} performers, three workers, {endured.kills} killed"
    table = _table(title, ("",), ("",))
    lags = ", ".join(f"{endured.percentile(percent):.1f}" for percent in (50, 99, 99.9))
    table.add_row("milliseconds from a frame to its answer, p50, p99, p99.9", lags)
    told = f"{endured.lost_events}, {endured.false_events} of {endured.events}"
    table.add_row(f"events lost, events more, in {endured.rounds} rounds of the motion", told)
    table.add_row("frames lost", endured.dropped)
    table.add_row("memory after a twelfth of the time, and at the end", ", ".join(map(_megabytes, endured.memory_mb)))
    return table


def _seconds(seconds: float) -> str:
    return _NOTHING if math.isnan(seconds) else f"{seconds:.2f}"


def _megabytes(megabytes: float | None) -> str:
    return _NOTHING if megabytes is None else f"{megabytes:.1f} MB"
