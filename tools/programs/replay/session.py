"""One run of `kinespace replay`: the recordings and the addresses are opened, the feed is sent, the answers counted."""

from __future__ import annotations

import time
from contextlib import ExitStack, suppress
from itertools import chain
from typing import TYPE_CHECKING

from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Announcement
from kinespace.stream.inputs.recording.kinerec import ENDING
from kinespace.stream.zeromq import Endpoint, Keyring
from kinespace.tools.cli.address import host_and_port, opening
from kinespace.tools.feeding import packets
from kinespace.tools.feeding.feed import OscFrameSender, ZmqFrameSender, piece_cues
from kinespace.tools.feeding.prefetch import ReadAhead
from kinespace.tools.loopback.answer_listener import Listener
from kinespace.tools.programs.replay.exchange import Exchange, shown
from kinespace.tools.programs.replay.options import Faults
from kinespace.tools.programs.replay.recordings import announced, pieces_of, recordings_in
from kinespace.tools.terminal.console import console, progress_console

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from kinespace.library import Reading
    from kinespace.tools.feeding.feed import FrameSender
    from kinespace.tools.programs.replay.options import Course

#: Seconds for ZeroMQ peers to connect before the first frame; a peer that connects later loses the first messages.
_MEETING = 0.5


def play(
    places: Sequence[Path],
    *,
    reading: Reading,
    osc_to: str | None,
    zmq_to: str | None,
    listen: str | None,
    course: Course,
    faults: Faults,
    as_json: bool,
    keys: Path | None = None,
) -> int:
    """Send the recordings; with `listen`, print the share of right answers.

    Parameters
    ----------
    places
        Recordings, folders of them, and classes of the built-in library; all its motions when there are none.
    reading
        How to read recordings.
    osc_to, zmq_to, listen
        Where frames go, and where answers come in.
    course, faults
        How they are played, and the faults.
    as_json
        Print one JSON object and nothing else.
    keys
        Folder of the keys of the other ends of ZeroMQ; None for none.

    Returns
    -------
    The exit status: 1 when no program heard the frames, or when listening and no answers came, else 0.

    Raises
    ------
    ValueError
        A place is no recording, folder or class, a recording cannot be used, or an option does not apply to the places.
    """
    raw = [place for place in places if place.suffix.lower() == ENDING]
    if raw:
        return _run_raw(
            places,
            osc_to=osc_to,
            zmq_to=zmq_to,
            listen=listen,
            keys=keys,
            course=course,
            faults=faults,
            json=as_json,
        )
    recordings = recordings_in(places, reading)
    with ExitStack() as opened:
        keyring = opened.enter_context(Keyring(keys)) if keys else None
        pieces = opened.enter_context(ReadAhead(pieces_of(recordings, reading, course)))
        with progress_console.status("Reading"):
            first = next(iter(pieces))
        announcement = Announcement(course.performer, first.clip.skeleton.joints)
        played = piece_cues(chain([first], pieces), course.performer, speed=course.speed, pause=course.pause)
        listener = _listener(listen, keyring) if listen else None
        if listener:
            opened.callback(listener.close)
        sender = _sender(osc_to, zmq_to, keyring)
        opened.callback(sender.close)
        exchange = Exchange(sender, listener, announcement, zmq_to or osc_to or "")
        # Ctrl-C, or a recording that cannot be read, does not end the report.
        opened.callback(exchange.report, as_json=as_json)
        with suppress(KeyboardInterrupt):
            if zmq_to:
                time.sleep(_MEETING)
            if not as_json:
                console.print(announced(recordings, course))
            exchange.play(shown(faults.applied(played), None if course.loop else len(recordings)), pieces)
        unheard = exchange.was_unheard
    return 1 if unheard or (listener and not exchange.answered) else 0


def _run_raw(
    places: Sequence[Path],
    *,
    osc_to: str | None,
    zmq_to: str | None,
    listen: str | None,
    keys: Path | None,
    course: Course,
    faults: Faults,
    json: bool,
) -> int:
    """Send a raw recording; options that would change its packets, or need their contents, are refused."""
    if len(places) != 1:
        raise ValueError(f"replay: expected one {ENDING} alone, got {len(places)} recordings")
    if listen or faults != Faults(seed=faults.seed):
        raise ValueError(f"replay: {ENDING} is sent bit for bit: no --listen, --drop, --jitter-ms or --reorder")
    return packets.replay(
        places[0],
        osc_to=osc_to,
        zmq_to=zmq_to,
        keys=keys,
        speed=course.speed,
        loop=course.loop,
        begin=course.begin,
        end=course.end,
        as_json=json,
    )


def _listener(address: str, keyring: Keyring | None) -> Listener:
    with opening("--listen"):
        if "://" in address:
            endpoint = Endpoint.parse(address, bind=False)
            return Listener(zeromq.ZmqReceiver(endpoint, b"class/", keyring=keyring))
        return Listener(osc.OscReceiver(*host_and_port(address)))


def _sender(osc_to: str | None, zmq_to: str | None, keyring: Keyring | None) -> FrameSender:
    if zmq_to:
        with opening("--zmq"):
            return ZmqFrameSender(Endpoint.parse(zmq_to, bind=False), keyring, asks=True)
    return OscFrameSender(*host_and_port(osc_to or ""), asks=True)
