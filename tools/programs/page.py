"""`kinespace page`: a page in the browser that shows what a recogniser publishes, and teaches it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from kinespace.tools.cli.arguments import add_keys
from kinespace.tools.cli.interruption import stop_on_signals
from kinespace.tools.page.process import PAGE, PagePlan, serve_page
from kinespace.tools.terminal.console import console

if TYPE_CHECKING:
    import argparse

#: Where `kinespace live --zmq-out` usually publishes.
SOURCE = "tcp://127.0.0.1:9321"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Serves a page that shows the bodies, the guesses and the past minute of a recogniser that publishes over "
        "ZeroMQ (kinespace live --zmq-out ENDPOINT --bodies), until Ctrl-C. kinespace live --page starts it by itself."
    )
    parser.add_argument("--from", dest="source", default=SOURCE, metavar="ENDPOINT", help="default %(default)s")
    parser.add_argument(
        "--control", metavar="ENDPOINT", help="teach through this door, which kinespace live --control opens"
    )
    parser.add_argument(
        "--at",
        default=PAGE,
        metavar="[HOST:]PORT",
        help="where the page is (default %(default)s); other machines need the token in the address that is printed",
    )
    add_keys(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    ended: list[bool] = []
    stop_on_signals(lambda: ended.append(True))
    plan = PagePlan(options.source, options.at, options.control, options.keys)
    serve_page(plan, lambda address: console.print(f"page: {address}; Ctrl-C ends", soft_wrap=True), lambda: bool(ended))
    return 0


def add_page(parser: argparse.ArgumentParser) -> None:
    """Add `--page` to a program that recognises."""
    parser.add_argument(
        "--page", nargs="?", const=PAGE, metavar="[HOST:]PORT", help=f"show a page in the browser (default {PAGE})"
    )


def plan_of(source: str, address: str, control: str | None = None, keys: Path | None = None) -> PagePlan:
    """Plan the page of a recogniser."""
    return PagePlan(source, address, control, keys)
