"""`kinespace gateway`: receive and answer as `kinespace live` does, and let workers anywhere recognise.

Receives and answers as kinespace live does, with the same options; kinespace work recognises, on any number of
machines. Teach with kinespace live, then give --library.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from kinespace.stream.recognizer import SentJoints
from kinespace.stream.workers.bus import LISTEN, open_session
from kinespace.stream.workers.gateway import Gateway
from kinespace.stream.workers.terms import Terms
from kinespace.tools.cli.arguments import settings_of
from kinespace.tools.programs.live import program as live
from kinespace.tools.programs.live.recognisers import Known
from kinespace.tools.terminal.console import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    live.add_shared_arguments(parser)
    # A gateway does not teach: --library takes a library that `live` was taught.
    parser.set_defaults(teach=None, control=[], workers=0)
    add_bus(parser)


def add_bus(parser: argparse.ArgumentParser) -> None:
    """Add the options of Zenoh."""
    for option, text in (
        ("--listen", f"let other machines connect to this endpoint (default of gateway: {LISTEN})"),
        ("--connect", f"connect to another machine or a router there (default of work: {LISTEN})"),
    ):
        parser.add_argument(option, action="append", default=[], metavar="ENDPOINT", help=text)
    parser.add_argument(
        "--zenoh", type=Path, metavar="FILE", help="a configuration of Zenoh's own: TLS, access rules, scouting"
    )


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    if Path(options.naming).suffix:
        raise ValueError(f"--names: expected a convention by its name, which workers know, too, got {options.naming}")
    return live.run(options, _gateway)


def _gateway(options: argparse.Namespace, library: Known, joints: SentJoints, _: Sequence[str]) -> Gateway:
    """Make recognisers wherever workers run."""
    listen = options.listen or ([] if options.connect or options.zenoh else [LISTEN])
    session = open_session(listen, options.connect, options.zenoh, options.keys, to_anybody=options.open)
    terms = Terms(settings=settings_of(options), most=options.performers, assumed=joints.assumed, naming=options.naming)
    gateway = Gateway(session, library, terms, connect=options.connect, show=say)
    say(f"gateway {gateway.name}; workers reach it by {', '.join([*listen, *options.connect]) or options.zenoh}")
    if options.open and options.listen:
        say("--open: any program that connects may work here, and gets the bodies")
    return gateway
