"""`kinespace record`: writes every packet of a feed to a file, as it came.

Keeps every packet with its arrival time and sender until Ctrl-C. A crash costs the last second at most. kinespace
replay sends the file again bit for bit; kinespace live --record records while it recognises.
"""

import argparse
import math
import time
from pathlib import Path

from rich.status import Status

from kinespace.stream.inputs import Admission
from kinespace.stream.inputs.source import taking
from kinespace.stream.status import InputCounts
from kinespace.tools.cli.arguments import OSC_IN, add_shared, positive
from kinespace.tools.cli.console import progress_console, require_place_for, say
from kinespace.tools.cli.entry import end_wanted
from kinespace.tools.programs.ends import Ends


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("output", type=Path, metavar="FILE", help="the recording to make, like tonight.kinerec")
    add_shared(parser, "--osc-in", "--zmq-in", "--keys", "--open", "--overwrite")
    parser.add_argument("--seconds", type=positive, help="seconds to record (default: until Ctrl-C)")
    # A recording has no answers, and lets everybody in.
    parser.set_defaults(osc_out=None, zmq_out=None, out=(), allow_from=(), sender="", camera=None, lsl_in=None)


def run(options: argparse.Namespace) -> None:
    """Record until interrupted, or for the seconds asked for; print the counts."""
    output = options.record = options.output
    require_place_for(output, overwrite=options.overwrite)
    if not options.zmq_in:
        options.osc_in = options.osc_in or OSC_IN
    with Ends(options, Admission()) as ends, Status("no packets yet", console=progress_console) as shown:
        ends.open()
        sources, writer = ends.sources, ends.recording
        assert writer  # noqa: S101 - for mypy
        wants_end, names = end_wanted(), ", ".join(source.receiver.place for source in sources)
        say(f"recording {names} to {output}; Ctrl-C ends")
        begun = time.monotonic()
        for now in taking(sources, options.seconds or math.inf, wants_end):
            if writer.written:
                shown.update(f"{writer.written} packets in {now - begun:.0f} s")
        counts = sum((source.counts for source in sources), InputCounts())
    say(
        f"{output}: {writer.written} packets, {output.stat().st_size / 1e6:.2f} MB; "
        f"{writer.failed} could not be written, {counts.overrun} were lost by the system before they came here"
        + (f", {counts.broken} connections broke (messages too large or too many?)" if counts.broken else "")
        + ("" if writer.written else f"; nothing came: does the sender send to {names}?")
    )
