"""`kinespace bench`: run parts, print their results, draw them."""

from __future__ import annotations

import json
import os
import platform
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from kinespace.library import MotionLibrary
from kinespace.library.kernels import compiled
from kinespace.stream.recognizer import LiveSignature, Settings
from kinespace.tools.bench import recorded
from kinespace.tools.bench.awake import awake_cores
from kinespace.tools.bench.cases import peers, scaling, soak, sockets, stages
from kinespace.tools.bench.report import Report
from kinespace.tools.bench.timing import one_thread
from kinespace.tools.cli.arguments import add_json, count, not_negative, positive
from kinespace.tools.terminal.console import console

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray

Part = Literal["stages", "peers", "growth", "sockets", "soak", "scale", "cluster-soak"]
PARTS: tuple[Part, ...] = get_args(Part)


@dataclass(frozen=True, slots=True)
class Effort:
    """How long the parts run, and how far they go.

    Attributes
    ----------
    rounds
        Turns, of which medians are taken.
    seconds
        Seconds of each latency run.
    person
        The person whose motions the peers recognise.
    frames
        Frames of the long run.
    minutes
        Minutes of the long run over sockets, 0 for none.
    sizes
        The sizes up to which joints and libraries grow.
    rates
        Frames per second of the latency runs.
    most
        The number of performers, at most.
    starts
        Number of starts of the program.
    crowd
        Performers on the bus; half as many when a worker is lost.
    """

    rounds: int = 9
    seconds: float = 20.0
    person: str = "bd"
    frames: int = soak.DAY
    minutes: float = 10.0
    sizes: scaling.Sizes = scaling.Sizes()  # noqa: RUF009 - frozen
    rates: tuple[float, ...] = sockets.RATES
    most: int = 1024
    starts: int = 5
    crowd: int = 12


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Times every step, the alternatives, growth, sockets, a long run, and workers on a bus for a while and for "
        "long, on real motions and one core. pip install kinespace[bench,cluster] lets it keep linear algebra to one "
        "thread. Everything takes an hour and a half."
    )
    parser.add_argument("part", nargs="?", choices=(*PARTS, "all"), default="all", help="default: %(default)s")
    parser.add_argument(
        "--data",
        type=Path,
        metavar="FOLDER",
        help="play two minutes of these recordings (default: motions of the built-in library)",
    )
    parser.add_argument(
        "--signature",
        choices=[str(signature) for signature in LiveSignature],
        help="the signature of --json, growth and sockets (default: the recogniser's own)",
    )
    parser.add_argument(
        "--rounds", type=count, default=9, help="rounds, of which medians are taken (default %(default)s)"
    )
    parser.add_argument(
        "--seconds",
        type=positive,
        default=20.0,
        help="seconds of a run of sockets or scale (default %(default)s)",
    )
    parser.add_argument("--frames", type=count, default=soak.DAY, help="frames of soak (default: a day, %(default)s)")
    parser.add_argument(
        "--minutes",
        type=not_negative,
        default=10.0,
        help="minutes of soak over sockets, 0 for none, and of cluster-soak (default %(default)s)",
    )
    parser.add_argument(
        "--crowd", type=count, default=12, help="performers of scale and cluster-soak (default %(default)s)"
    )
    parser.add_argument(
        "--awake",
        action="store_true",
        help="keep the cores of a virtual machine awake, by loops that run only where nothing else does (Linux)",
    )
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw the results")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    return bench(
        PARTS if options.part == "all" else (options.part,),
        data=options.data,
        signature=LiveSignature(options.signature) if options.signature else None,
        effort=Effort(
            rounds=options.rounds,
            seconds=options.seconds,
            frames=options.frames,
            minutes=options.minutes,
            crowd=options.crowd,
        ),
        awake=options.awake,
        picture=options.picture,
        as_json=options.json,
    )


def bench(
    parts: Sequence[Part],
    *,
    data: Path | None,
    signature: LiveSignature | None,
    effort: Effort,
    awake: bool = False,
    picture: Path | None,
    as_json: bool,
) -> int:
    """Run some parts and print the results.

    Parameters
    ----------
    parts
        The parts, in any order.
    data
        A folder of recordings to play in place of the built-in library's motions.
    signature
        The signature of the standard figures, of growth, of sockets and of the long run; the recogniser's default when
        not given.
    effort
        How long every part runs.
    awake
        Keep the cores awake.
    picture
        The file to draw the results in.
    as_json
        Print one JSON object of the standard figures and nothing else.
    """
    if picture:
        from kinespace.tools.terminal.pictures import require_place_for_picture  # noqa: PLC0415 - matplotlib is an extra, slow to load

        require_place_for_picture(picture)
    with one_thread() as note, awake_cores() if awake else nullcontext():
        report = measured(parts, recorded.positions(data), signature=signature, effort=effort)
    report.notes += [note] if note else []
    report.notes += ["all cores were kept awake"] if awake else []
    if picture:
        from kinespace.tools.bench import picture as drawing  # noqa: PLC0415 - matplotlib is an extra, and slow to load

        drawing.draw(picture, report)
    if as_json:
        print(json.dumps(report.figures()))
        return 0
    for table in report.tables():
        console.print(table)
    for line in (*report.notes, _machine()):
        console.print(line, soft_wrap=True)
    return 0


def measured(
    parts: Sequence[Part], positions: NDArray[np.float32], *, signature: LiveSignature | None, effort: Effort
) -> Report:
    """Run some parts, in the order in which a reader wants them; positions as `recorded.positions` gives them."""
    usual = signature or LiveSignature.WINDOWS
    report = Report(usual)

    def run_stages() -> None:
        report.stages = stages.measure(positions, signatures=tuple(LiveSignature), rounds=effort.rounds)

    def run_peers() -> None:
        report.peers = peers.measure(MotionLibrary.builtin(), person=effort.person, rounds=effort.rounds)

    def run_growth() -> None:
        report.growth = scaling.measure(Settings(signature=usual), sizes=effort.sizes, rounds=effort.rounds)

    def run_sockets() -> None:
        report.sockets = sockets.measure(
            positions,
            signature=usual,
            seconds=effort.seconds,
            rates=effort.rates,
            most=effort.most,
            starts=effort.starts,
        )

    def run_soak() -> None:
        report.soak = soak.measure(positions, signature=usual, frames=effort.frames, minutes=effort.minutes)

    def run_scale() -> None:
        from kinespace.tools.bench.cases import scale  # noqa: PLC0415 - Zenoh is an extra

        report.scale = scale.measure(positions, seconds=effort.seconds, crowd=effort.crowd)

    def run_cluster_soak() -> None:
        from kinespace.tools.bench.cases import cluster_soak  # noqa: PLC0415 - Zenoh is an extra

        report.cluster_soak = cluster_soak.measure(positions, minutes=effort.minutes, crowd=effort.crowd)

    runs: dict[Part, Callable[[], None]] = {
        "stages": run_stages,
        "peers": run_peers,
        "growth": run_growth,
        "sockets": run_sockets,
        "soak": run_soak,
        "scale": run_scale,
        "cluster-soak": run_cluster_soak,
    }
    for part, run_part in runs.items():
        if part in parts:
            run_part()
    return report


def _machine() -> str:
    """Describe the machine of the measurement, and how busy it was otherwise."""
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{os.cpu_count()} cores{load}, Python {platform.python_version()}, {platform.system()}; {compiled.kind()}"
