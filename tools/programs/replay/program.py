"""`kinespace replay`: the feed is sent, and the answers are counted.

Sends recordings as live packets on an absolute schedule. With --listen it counts the answers and prints the share that
was right; a clip's class is in its name (HDM05) or is its folder's name. If a file of labels with a take's name lies
next to the take, the class is the label of the moment. Exit status: 0 sent (and, with --listen, answered), 1 the frames
reached no program, or no answer came to --listen, 2 could not be done.
"""

from __future__ import annotations

import argparse
import time
from contextlib import ExitStack, suppress
from itertools import chain
from pathlib import Path

from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Announcement
from kinespace.stream.inputs.kinerec import ENDING
from kinespace.stream.zeromq import Endpoint, Keyring
from kinespace.tools.cli.arguments import OSC_IN, add_reading, add_shared, not_negative, positive, reading_of
from kinespace.tools.cli.values import host_and_port, opening
from kinespace.tools.feeding import packets
from kinespace.tools.feeding.feed import FrameSender, OscFrameSender, ZmqFrameSender, piece_cues
from kinespace.tools.loopback.answers import Listener
from kinespace.tools.programs.replay.exchange import Exchange
from kinespace.tools.programs.replay.recordings import announced, pieces_of, recordings_in
from kinespace.tools.terminal.console import console, progress, progress_console

#: Seconds for ZeroMQ peers to connect before the first frame; a peer that connects later loses the first messages.
_MEETING = 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    text = (
        "recordings, folders of them, or classes of the built-in library, whose motions are played; or one .kinerec "
        "(default: built-in, all its motions)"
    )
    parser.add_argument("clips", nargs="*", type=Path, metavar="CLIP|CLASS", help=text)
    add_reading(parser)
    parser.add_argument("--osc", metavar="HOST:PORT", help=f"send OSC there (default: {OSC_IN})")
    text = "publish on ZeroMQ instead; connects, put @ before it to bind"
    parser.add_argument("--zmq", metavar="ENDPOINT", help=text)
    parser.add_argument("--listen", metavar="ADDRESS", help="HOST:PORT or ZeroMQ endpoint where the answers come")
    add_shared(parser, "--keys", "--open")
    parser.add_argument("--performer", default="replay", help="name of the performer (default %(default)s)")
    text = "factor on the recorded speed (default %(default)s)"
    parser.add_argument("--speed", type=positive, default=1.0, help=text)
    parser.add_argument("--pause", type=not_negative, default=1.0, help="seconds between clips (default %(default)s)")
    text = "begin each recording at this second"
    parser.add_argument("--from", type=not_negative, default=0.0, dest="begin", metavar="S", help=text)
    parser.add_argument("--to", type=positive, dest="end", metavar="S", help="end each recording at this second")
    parser.add_argument("--loop", action="store_true", help="begin again after the last clip, until Ctrl-C")
    add_shared(parser, "--json")


def run(options: argparse.Namespace) -> int:
    """Send the recordings; with `--listen`, print the share of right answers.

    Returns
    -------
    The exit status: 1 when the frames reached no program, or when listening and no answers came, else 0.

    Raises
    ------
    ValueError
        A place is no recording, folder or class, a recording cannot be used, or an option does not apply to the places.
    """
    places, reading = options.clips, reading_of(options)
    if options.end is not None and options.end <= options.begin:
        raise ValueError(f"--to: expected more than --from ({options.begin:g}), got {options.end:g}")
    zmq_to = Endpoint.parse(options.zmq, bind=False, to_anybody=options.open) if options.zmq else None
    is_raw = any(place.suffix.lower() == ENDING for place in places)
    if is_raw:
        if len(places) != 1:
            raise ValueError(f"replay: expected one {ENDING} alone, got {len(places)} recordings")
        if options.listen:
            raise ValueError(f"replay: {ENDING} is sent bit for bit: no --listen")
    with ExitStack() as opened:
        keyring = opened.enter_context(Keyring(options.keys)) if options.keys else None
        osc_to = options.osc or (None if zmq_to else OSC_IN)
        if is_raw:
            return packets.replay(places[0], _senders(opened, osc_to, zmq_to, keyring), options)
        recordings = recordings_in(places, reading)
        pieces = pieces_of(recordings, reading, options)
        with progress_console.status("Reading"):
            first = next(pieces)
        announcement = Announcement(options.performer, first.clip.skeleton.joints)
        played = piece_cues(chain([first], pieces), options.performer, speed=options.speed, pause=options.pause)
        listener = _listener(options.listen, keyring, to_anybody=options.open) if options.listen else None
        if listener:
            opened.callback(listener.close)
        sender = [*_senders(opened, osc_to, zmq_to, keyring).values()][-1]
        exchange = Exchange(sender, listener, announcement, zmq_to.address if zmq_to else osc_to or "")
        # Ctrl-C, or a recording that cannot be read, does not end the report.
        opened.callback(exchange.report, as_json=options.json)
        with suppress(KeyboardInterrupt):
            if not options.json:
                console.print(announced(recordings, options))
            exchange.play(progress(played, "Sending", None))
        in_vain = exchange.reached_nobody
    return 1 if in_vain or (listener and not exchange.answered) else 0


def _listener(listen: str, keyring: Keyring | None, *, to_anybody: bool) -> Listener:
    """Open the ZeroMQ endpoint, or HOST:PORT, on which answers come."""
    with opening("--listen"):
        if "://" in listen:
            endpoint = Endpoint.parse(listen, bind=False, to_anybody=to_anybody)
            return Listener(zeromq.ZmqReceiver(endpoint, b"class", keyring=keyring))
        return Listener(osc.OscReceiver(*host_and_port(listen)))


def _senders(
    opened: ExitStack, osc_to: str | None, zmq_to: Endpoint | None, keyring: Keyring | None
) -> dict[str, FrameSender]:
    """Open a sender for each kind of packets that has an address, ZeroMQ last; wait until its peers have connected."""
    senders: dict[str, FrameSender] = {}
    if osc_to:
        senders["osc"] = OscFrameSender(*host_and_port(osc_to), asks=True)
    if zmq_to:
        with opening("--zmq"):
            senders["zmq"] = ZmqFrameSender(zmq_to, keyring, asks=True)
        time.sleep(_MEETING)
    for sender in senders.values():
        opened.callback(sender.close)
    return senders
