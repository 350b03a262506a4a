"""The command line of `kinespace replay`: its arguments, and the run that they ask for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from kinespace.tools.cli.arguments import (
    OSC_IN,
    add_json,
    add_keys,
    add_page,
    add_reading,
    not_negative,
    positive,
    reading_of,
    share,
)
from kinespace.tools.page.process import PagePlan, PageProcess
from kinespace.tools.programs.replay.options import Course, Faults
from kinespace.tools.programs.replay.session import play
from kinespace.tools.terminal.console import progress_console

if TYPE_CHECKING:
    import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Sends recordings as live packets on an absolute schedule. With --listen it hears the answers and prints the "
        "share that was right; a clip's class is in its name (HDM05) or is its folder's name. If a file of labels "
        "with a take's name lies beside the take, the class is the label of the moment. Exit status: 0 sent (and, with "
        "--listen, answered), 1 no program heard the frames, or no answer came to --listen, 2 could not be done."
    )
    parser.add_argument(
        "clips",
        nargs="*",
        type=Path,
        metavar="CLIP|CLASS",
        help="recordings, folders of them, or classes of the built-in library, whose motions are played; or one "
        ".kinerec (default: built-in, all its motions)",
    )
    add_reading(parser)
    parser.add_argument("--osc", metavar="HOST:PORT", help=f"send OSC there (default {OSC_IN})")
    parser.add_argument(
        "--zmq", metavar="ENDPOINT", help="publish on ZeroMQ instead; connects, put @ before it to bind"
    )
    parser.add_argument("--listen", metavar="ADDRESS", help="HOST:PORT or ZeroMQ endpoint where the answers come")
    add_page(parser)
    add_keys(parser)
    parser.add_argument("--performer", default="replay", help="name of the performer (default %(default)s)")
    parser.add_argument("--speed", type=positive, default=1.0, help="play so many times as fast (default %(default)s)")
    parser.add_argument("--pause", type=not_negative, default=1.0, help="seconds between clips (default %(default)s)")
    parser.add_argument(
        "--from", type=not_negative, default=0.0, dest="begin", metavar="S", help="begin each recording at this second"
    )
    parser.add_argument("--to", type=positive, dest="end", metavar="S", help="end each recording at this second")
    parser.add_argument("--loop", action="store_true", help="begin again after the last clip, until Ctrl-C")
    parser.add_argument("--drop", type=share, default=0.0, metavar="SHARE", help="lose this share of frames")
    parser.add_argument(
        "--jitter-ms", type=not_negative, default=0.0, metavar="MS", help="delay frames by at most this"
    )
    parser.add_argument(
        "--reorder", type=share, default=0.0, metavar="SHARE", help="swap this share of frames with the next frame"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the faults (default %(default)s)")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    if not options.page:
        return _played(options)
    if "://" not in (options.listen or ""):
        raise ValueError(f"--page: expected --listen with a recogniser's ZeroMQ endpoint, got {options.listen}")
    with PageProcess(PagePlan(options.listen, options.page, keys=options.keys)) as page:
        progress_console.print(f"page: {page.address}", soft_wrap=True)
        return _played(options)


def _played(options: argparse.Namespace) -> int:
    return play(
        options.clips,
        reading=reading_of(options),
        osc_to=options.osc or (None if options.zmq else OSC_IN),
        zmq_to=options.zmq,
        listen=options.listen,
        keys=options.keys,
        course=Course(
            options.performer,
            speed=options.speed,
            pause=options.pause,
            loop=options.loop,
            begin=options.begin,
            end=options.end,
        ),
        faults=Faults(drop=options.drop, jitter=options.jitter_ms / 1000, reorder=options.reorder, seed=options.seed),
        as_json=options.json,
    )
