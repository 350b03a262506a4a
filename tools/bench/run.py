"""`kinespace bench`: run parts, and print their tables or their figures.

Times every step, and the way over sockets, on real motions. Everything takes five minutes.
"""

from __future__ import annotations

import argparse
import json
import os
import platform

from kinespace.library import compiled
from kinespace.tools.bench import sockets, stages
from kinespace.tools.bench.crowd import rounded
from kinespace.tools.cli.arguments import add_shared, positive
from kinespace.tools.terminal.console import console, say

#: The parts in the order in which a reader wants them; each module has `FIGURES`, their names, and `measure`.
PARTS = {"stages": stages, "sockets": sockets}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("part", nargs="?", choices=(*PARTS, "all"), default="all", help="default: %(default)s")
    text = "seconds of a run of sockets (default %(default)s)"
    parser.add_argument("--seconds", type=positive, default=20.0, help=text)
    add_shared(parser, "--json")


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    figures = dict.fromkeys(name for part in PARTS.values() for name in part.FIGURES)
    for part in [part for name, part in PARTS.items() if options.part in (name, "all")]:
        measured = part.measure(options.seconds)
        figures |= {name: rounded(value) for name, value in measured.figures.items()}
        for table in () if options.json else measured.tables:
            console.print(table, "")
    say(json.dumps(figures) if options.json else f"{machine()}; {compiled.kind()}")
    return 0


def machine() -> str:
    """Describe the machine of a measurement, and how busy it was otherwise."""
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{os.cpu_count()} cores{load}, Python {platform.python_version()}, {platform.system()}"
