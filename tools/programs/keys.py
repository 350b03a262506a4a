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
        "Makes a pair of keys (CURVE) in a folder. Copy NAME.key into the folders of programs that must let NAME in; "
        "NAME.key_secret stays here. live, replay and record use the folder with --keys."
    )
    parser.add_argument("name", metavar="NAME", help="name of the keys' owner, like stage or ann")
    parser.add_argument(
        "--keys", type=Path, metavar="DIR", help="the folder, made if it does not exist (default: NAME)"
    )


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    public, secret = make_keys(options.keys or Path(options.name), options.name)
    for line in (f"{public}: public, for the others' folders", f"{secret}: secret, keep it here"):
        console.print(line, soft_wrap=True, markup=False, highlight=False)
    return 0
