"""`kinespace keys`: a pair of keys for ZeroMQ."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from kinespace.stream.zeromq.keys import make_keys
from kinespace.tools.terminal.console import console

if TYPE_CHECKING:
    import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Makes a pair of keys (CURVE) in a folder: NAME.key is for the folders of all who are to let NAME in, "
        "NAME.key_secret stays here. live, replay, record and latency use a folder by --keys."
    )
    parser.add_argument("name", metavar="NAME", help="whose keys they are, like stage or ann")
    parser.add_argument(
        "--keys", type=Path, metavar="DIR", help="the folder, made when it is not there (default: called NAME)"
    )


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    public, secret = make_keys(options.keys or Path(options.name), options.name)
    for line in (f"{public}: public, for the others' folders", f"{secret}: secret, for nobody else"):
        console.print(line, soft_wrap=True, markup=False, highlight=False)
    return 0
