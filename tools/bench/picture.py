"""The bench in one picture, drawn with matplotlib, which is an extra: `pip install kinespace[pictures]`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

try:
    from matplotlib import colormaps
    from matplotlib.figure import Figure
except ImportError as error:
    raise ImportError("pictures need matplotlib: pip install kinespace[pictures]") from error

from kinespace.stream.recognizer import LiveSignature
from kinespace.tools.bench.cases.stages import STEPS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes

    from kinespace.tools.bench.cases.peers import Peers
    from kinespace.tools.bench.cases.scaling import Growth
    from kinespace.tools.bench.cases.sockets import Sockets
    from kinespace.tools.bench.cases.stages import Stages
    from kinespace.tools.bench.report import Report

_OURS, _THEIRS = "#b5367a", "#5f6a72"
#: Frames per second of the feed: a slower method cannot follow one performer.
_FEED = 120.0
_PERCENTS = (50, 99)


def draw(path: Path, report: Report) -> None:
    """Draw a panel for each part that was run.

    Parameters
    ----------
    path
        The picture's file; its ending sets the format (.png, .svg, .pdf).
    report
        The results.

    Raises
    ------
    ValueError
        No part was run that can be drawn, or matplotlib has no format of this ending.
    OSError
        The file cannot be written.
    """
    panels: list[Callable[[Axes], None]] = []
    if peers := report.peers:
        panels.append(lambda panel: _draw_peers(panel, peers))
    if stages := report.stages:
        panels.append(lambda panel: _draw_stages(panel, stages))
    if growth := report.growth:
        panels.append(lambda panel: _draw_growth(panel, growth))
    if sockets := report.sockets:
        panels.append(lambda panel: _draw_latencies(panel, sockets))
    if not panels:
        raise ValueError("--picture: expected stages, peers, growth or sockets to draw, got none of them")
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(6.8 * columns, 4.4 * rows), layout="constrained")
    places = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, draw_panel in zip(places, panels, strict=False):
        draw_panel(panel)
        panel.spines[["top", "right"]].set_visible(False)
    for empty in places[len(panels) :]:
        empty.set_visible(False)
    figure.savefig(path, dpi=110)


def _draw_peers(panel: Axes, peers: Peers) -> None:
    panel.set_title("Speed and accuracy on the same feed", loc="left")
    for place, peer in enumerate(sorted(peers.peers, key=lambda peer: peer.frames_per_second)):
        ours = peer.name in list(LiveSignature)
        name, colour = (f"kinespace, {peer.name}", _OURS) if ours else (peer.name, _THEIRS)
        at = (peer.frames_per_second, 100 * peer.accuracy)
        panel.plot(*at, "o", color=colour, markersize=8)
        # Peers that compute the same lie side by side: labels alternate above and below.
        offset = 12 if place % 2 == 0 else -18
        panel.annotate(name, at, xytext=(0, offset), textcoords="offset points", ha="center", fontsize=8, color=colour)
    panel.axvline(_FEED, color="lightgrey", zorder=0)
    panel.annotate("one performer\nat 120 Hz", (_FEED, 2), xytext=(4, 0), textcoords="offset points", fontsize=8)
    panel.set_xscale("log")
    panel.margins(x=0.25)
    panel.set_ylim(0, 105)
    panel.set_xlabel("frames per second, one core")
    panel.set_ylabel(f"answers right, motions of {peers.person}, %")


def _draw_stages(panel: Axes, stages: dict[str, Stages]) -> None:
    panel.set_title("Where a frame's time goes, OSC in to OSC out", loc="left")
    names = [name for name in STEPS if "ZeroMQ" not in name]
    for place, each in enumerate(stages.values()):
        left = 0.0
        for name, colour in zip(names, colormaps["tab10"](np.arange(len(names))), strict=True):
            panel.barh(place, each.us[name], 0.55, left, color=colour, label=None if place else name)
            left += each.us[name]
        panel.annotate(f"{left:.0f} µs", (left, place), xytext=(4, 0), textcoords="offset points", va="center")
    panel.set_yticks(range(len(stages)), list(stages))
    panel.set_ylim(-0.5, len(stages) + 0.4)
    panel.margins(x=0.12)
    panel.set_xlabel("µs per frame at 120 Hz, an answer every fourth")
    panel.legend(fontsize=8, ncols=4, loc="upper left", frameon=False)


def _draw_growth(panel: Axes, growth: Sequence[Growth]) -> None:
    panel.set_title("Growth, each from its smallest size", loc="left")
    colours = colormaps["magma"](np.linspace(0.1, 0.8, len(growth)))
    for each, colour in zip(growth, colours, strict=True):
        sizes, us = np.array(each.sizes), np.array(each.us)
        counted = " of their pairs" if each.of == "joints" else ""
        label = f"{each.of}, {each.labels[0]} to {each.labels[-1]}: exponent {each.exponent:.2f}{counted}"
        panel.plot(sizes / sizes[0], us / us[0], "o-", color=colour, label=label)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.margins(x=0.12)
    panel.set_xlabel("times as large")
    panel.set_ylabel("times as dear")
    panel.legend(fontsize=8, frameon=False)


def _draw_latencies(panel: Axes, sockets: Sockets) -> None:
    panel.set_title("Frame sent to answer received, beside a bare echo", loc="left")
    rates = sorted({each.rate_hz for each in sockets.latencies})
    styles = {"osc": ("OSC", "o-"), "zmq": ("ZeroMQ", "s--")}
    for transport, (name, style) in styles.items():
        runs = sorted((each for each in sockets.latencies if each.transport == transport), key=lambda run: run.rate_hz)
        shown = [each.rate_hz for each in runs]
        for percent, width in zip(_PERCENTS, (1.0, 2.0), strict=True):
            ours = [each.percentile(percent) for each in runs]
            echo = [each.percentile(percent, echo=True) for each in runs]
            panel.plot(shown, ours, style, color=_OURS, linewidth=width, label=f"{name}, p{percent}")
            panel.plot(shown, echo, style, color=_THEIRS, linewidth=width, label=f"{name} echo, p{percent}")
    panel.set_xticks(rates)
    panel.set_yscale("log")
    panel.set_xlabel("frames per second")
    panel.set_ylabel("milliseconds")
    # Room above the curves for their names.
    lowest, highest = panel.get_ylim()
    panel.set_ylim(lowest, highest * (highest / lowest) ** 0.35)
    panel.legend(fontsize=7.5, ncols=4, loc="upper left", frameon=False)
