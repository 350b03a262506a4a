"""`kinespace page`: a page in the browser that shows a recogniser's bodies and answers, and teaches it.

Serves a page that shows the bodies, the guesses and the past minute of a recogniser that publishes over ZeroMQ
(kinespace live --zmq-out ENDPOINT --bodies), until Ctrl-C. kinespace live --page starts it by itself.
"""

import argparse

from kinespace.tools.cli.arguments import PAGE, add_shared
from kinespace.tools.cli.console import say
from kinespace.tools.cli.entry import end_wanted
from kinespace.tools.cli.values import host_and_port
from kinespace.tools.page.process import PagePlan

#: Where `kinespace live --zmq-out` usually publishes.
SOURCE = "tcp://127.0.0.1:9321"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("--from", dest="source", default=SOURCE, metavar="ENDPOINT", help="default %(default)s")
    parser.add_argument("--control", metavar="ENDPOINT", help="teach through this socket of kinespace live --control")
    host, port = host_and_port(PAGE)
    text = "pages on other machines need the token that is printed (default %(default)s)"
    parser.add_argument("--host", default=host, help=text)
    parser.add_argument("--port", type=int, default=port, help="port of the page (default %(default)s)")
    add_shared(parser, "--keys")


def run(options: argparse.Namespace) -> None:
    """Run the program with these options."""
    plan = PagePlan(f"{options.host}:{options.port}", options.source, options.keys, options.control)
    plan.serve(lambda address: say(f"page: {address}; Ctrl-C ends"), end_wanted())
