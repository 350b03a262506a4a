"""The command line of `kinespace camera`: its arguments, and the run that they ask for."""

from __future__ import annotations

import argparse
import threading
from pathlib import Path

from kinespace.tools.camera.models import fetched
from kinespace.tools.cli.arguments import OSC_IN, add_shared
from kinespace.tools.cli.entry import stop_on_signals
from kinespace.tools.programs.camera.session import CameraPlan, watch
from kinespace.tools.terminal.console import say
from kinespace.tools.terminal.files import require_place_for


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Finds bodies in the pictures of a camera or a film (BlazePose) and sends their joints as frames, until the "
        "film ends or Ctrl-C. Pictures stay in this process: nothing is stored or sent but numbers. The whole body "
        "must be in the picture. Exit status: 0 done, 2 could not be done, or a film without a body."
    )
    parser.add_argument(
        "source", nargs="?", default="0", metavar="0|FILE|URL", help="a camera, a film, a stream (default: camera 0)"
    )
    parser.add_argument("--osc", metavar="HOST:PORT", help=f"send OSC there (default {OSC_IN})")
    parser.add_argument(
        "--zmq", metavar="ENDPOINT", help="publish on ZeroMQ instead; connects, put @ before it to bind"
    )
    parser.add_argument("--performer", default="camera", help="name of the performer (default %(default)s)")
    add_shared(parser, "--people", "--show")
    parser.add_argument("--fast", action="store_true", help="every picture of a film, as fast as they can be read")
    parser.add_argument("--record", type=Path, metavar="CSV", help="keep the joints too, for kinespace build")
    add_shared(parser, "--overwrite")
    add_shared(parser, "--size")
    parser.add_argument(
        "--models", type=Path, metavar="FOLDER|FILE.task", help="where the models are (default: the cache)"
    )
    parser.add_argument("--get-models", action="store_true", help="fetch the models by npm or pip, and end")


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    if options.get_models:
        fetched(say)
        return 0
    if options.record:
        if options.people > 1:
            raise ValueError("--record: expected one body; kinespace live --record keeps the frames of several")
        require_place_for(options.record, overwrite=options.overwrite)
    plan = CameraPlan(
        options.source,
        osc=options.osc or (None if options.zmq else OSC_IN),
        zmq=options.zmq,
        performer=options.performer,
        people=options.people,
        models=options.models,
        size=options.size,
        fast=options.fast,
        record=options.record,
        show=options.show,
    )
    ended = threading.Event()
    stop_on_signals(ended.set)
    say(str(watch(plan, say, ended.is_set)))
    return 0
