"""`kinespace keys`: a pair of keys for ZeroMQ, and a certificate for Zenoh.

Makes a pair of keys (CURVE) and a certificate (TLS) in a folder. Copy NAME.key and NAME.pem into the folders of
programs that must let NAME in; NAME.key_secret and NAME.pem_secret stay here. live, replay, record, gateway and work
use the folder with --keys.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path

from kinespace.stream.workers.certificates import make_certificate
from kinespace.stream.zeromq.keys import make_keys
from kinespace.tools.terminal.console import say

_ADVICE = "public, for the others' folders", "secret, keep it here"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("name", metavar="NAME", help="name of the keys' owner, like stage or ann")
    parser.add_argument(
        "--keys", type=Path, metavar="DIR", help="the folder, made if it does not exist (default: NAME)"
    )


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    made, there = list[tuple[Path, Path]](), list[FileExistsError]()
    for make in (make_keys, make_certificate):
        # The certificate's package is an extra: only gateways and workers use it, and it may have come later.
        with suppress(ImportError):
            try:
                made.append(make(options.keys or Path(options.name), options.name))
            except FileExistsError as error:
                there.append(error)
    if not made:
        raise there[0]
    for line in (f"{each}: {advice}" for pair in made for each, advice in zip(pair, _ADVICE, strict=True)):
        say(line)
    return 0
