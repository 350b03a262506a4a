"""`kinespace live`: recognises a feed.

Recognises frames and publishes answers until Ctrl-C, by OSC unless other addresses are given. A ZeroMQ endpoint is
bound; put > before it to connect instead.
"""

from __future__ import annotations

import argparse
import os
from contextlib import nullcontext
from pathlib import Path

from kinespace.library.teaching.movement import STILLNESS
from kinespace.stream.outputs import LAYOUTS
from kinespace.stream.outputs.lsl_sink import LSL
from kinespace.stream.outputs.midi_sink import MIDI
from kinespace.stream.zeromq import Keyring
from kinespace.tools.cli.arguments import OSC_IN, add_names, add_settings, add_shared, count, names, positive
from kinespace.tools.programs.live.session import recognise
from kinespace.tools.terminal.console import log_as

#: Where answers go by default: a port that no usual receiver uses.
OSC_OUT = "127.0.0.1:9311"
#: Where WebSocket clients come unless the user says otherwise.
WS = "127.0.0.1:9313"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    add_shared(parser, "--osc-in", "--zmq-in")
    text = f"send OSC answers there (default {OSC_OUT}, unless --zmq-out or --out is given)"
    parser.add_argument("--osc-out", metavar="[HOST:]PORT", help=text)
    parser.add_argument("--zmq-out", metavar="ENDPOINT", help="publish ZeroMQ answers")
    text = "read the feed of this product, by default on its own port; or FILE.toml: see kinespace feeds"
    parser.add_argument("--feed", metavar="NAME", help=text)
    add_shared(parser, "--sender")
    text = (
        f"answer in the layouts of these programs instead of to {OSC_OUT} (native: as well as): "
        f"{', '.join((*LAYOUTS, LSL, MIDI))}; FILE.toml: messages of your own; sender:PORT replies"
    )
    parser.add_argument("--out", type=names, action="extend", default=[], metavar="NAME[=HOST:PORT],...", help=text)
    text = (
        "the joints of frames whose sender never names them, in order: the library's names, or a preset that lists "
        "them, like kinectv2, or FILE.toml (default: the library's joints)"
    )
    parser.add_argument("--joints", metavar="A,B,...", help=text)
    add_names(parser, "senders")
    add_shared(parser, "--library")
    add_settings(parser)
    parser.add_argument("--allow", type=names, default=(), metavar="A,B,...", help="recognise these performers only")
    text = "read packets from these networks alone; let them teach; let them and this machine get the answers by ZeroMQ"
    parser.add_argument("--allow-from", type=names, default=(), metavar="NETWORK,...", help=text)
    add_shared(parser, "--keys", "--open")
    parser.add_argument("--performers", type=int, default=32, help="how many performers at most (default %(default)s)")
    parser.add_argument("--record", type=Path, metavar="FILE", help="keep every packet that comes in, for replay")
    add_shared(parser, "--overwrite")
    text = "publish bodies on --zmq-out, for kinespace page elsewhere"
    parser.add_argument("--bodies", action="store_true", help=text)
    add_shared(parser, "--page")
    text = f"also take frames and give answers by WebSocket, in JSON (default {WS})"
    parser.add_argument("--ws", nargs="?", const=WS, metavar="[HOST:]PORT", help=text)
    text = "let pages of these sites connect to --ws, like https://editor.p5js.org; pages of this machine may anyway"
    parser.add_argument("--ws-origin", type=names, default=(), metavar="ORIGIN,...", help=text)
    parser.add_argument("--plain", action="store_true", help="print a line per change instead of a table")
    parser.add_argument("--log", choices=("text", "json"), help="as --plain, each line with the wall clock and a level")
    text = "spread performers over processes (default: none)"
    parser.add_argument("--workers", type=workers, default=0, metavar="N|auto", help=text)
    text = "watch a camera, a film or a stream, as kinespace camera does"
    parser.add_argument("--camera", metavar="0|FILE|URL", help=text)
    add_shared(parser, "--people", "--show", "--size")
    parser.add_argument("--lsl-in", metavar="NAME", help="read the positions of this LSL stream")
    text = "let people teach motions by showing them, and keep them there"
    parser.add_argument("--teach", type=Path, metavar="FILE", help=text)
    text = "movement, relative to the body, that counts as rest; twice as much begins a motion (default %(default)s)"
    parser.add_argument("--stillness", type=positive, default=STILLNESS, help=text)
    text = "taught motions may be done by either side (default: with --camera)"
    parser.add_argument("--either-side", action=argparse.BooleanOptionalAction, help=text)
    text = 'answer a performer who is being taught as usual (default: "unknown", without events)'
    parser.add_argument("--loud-lessons", action="store_true", help=text)
    text = "also obey ZeroMQ requests, like tcp://127.0.0.1:9330"
    parser.add_argument("--control", action="append", default=[], metavar="ENDPOINT", help=text)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    if options.log:
        log_as(options.log)
    if not (options.osc_in or options.zmq_in or options.feed):
        options.osc_in = OSC_IN
    if not (options.osc_out or options.zmq_out or options.out):
        options.osc_out = OSC_OUT
    with Keyring(options.keys) if options.keys else nullcontext() as keyring:
        return recognise(options, keyring)


def workers(text: str) -> int:
    """Read a number of workers; `auto`: one for each core but one, which receives."""
    return max((os.cpu_count() or 1) - 1, 1) if text == "auto" else count(text)
