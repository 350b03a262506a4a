"""`kinespace keys`: a pair of keys for ZeroMQ.

Makes a pair of keys (CURVE) in a folder. Copy NAME.key into the folders of programs that must let NAME in;
NAME.key_secret stays here. live, replay and record use the folder with --keys.
"""

import argparse
from pathlib import Path

from kinespace.stream.zeromq.keys import make_keys
from kinespace.tools.cli.console import say

_ADVICE = "public, for the others' folders", "secret, keep it here"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("name", metavar="NAME", help="name of the keys' owner, like stage or ann")
    parser.add_argument("--keys", type=Path, metavar="DIR", help="the folder, made if it is not there (default: NAME)")


def run(options: argparse.Namespace) -> None:
    """Run the program with these options."""
    for path, advice in zip(make_keys(options.keys or Path(options.name), options.name), _ADVICE, strict=True):
        say(f"{path}: {advice}")
