"""`kinespace work`: recognise for gateways until Ctrl-C.

Recognises performers for the first gateway that it reaches, with the gateway's library and settings; when that is gone,
for the next one.
"""

from __future__ import annotations

import argparse
import gc
from contextlib import closing

from kinespace.stream.workers.bus import LISTEN, open_session
from kinespace.stream.workers.worker import Worker
from kinespace.tools.cli.arguments import add_shared
from kinespace.tools.cli.interruption import stop_on_signals
from kinespace.tools.programs.gateway import add_bus
from kinespace.tools.terminal.console import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    add_bus(parser)
    add_shared(parser, "--keys", "--open")


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    connect = options.connect or ([] if options.listen or options.zenoh else [LISTEN])
    session = open_session(options.listen, connect, options.zenoh, options.keys, to_anybody=options.open)
    worker = Worker(session, say, connect=connect)
    with closing(worker):
        stop_on_signals(worker.stop)
        reached = ", ".join([*options.listen, *connect]) or options.zenoh
        say(f"worker {worker.name} tries to reach {reached}; Ctrl-C ends")
        gc.freeze()
        worker.run()
        counts = worker.counts
    say(", ".join(f"{name} {count}" for name, count in counts.items()))
    return 0
