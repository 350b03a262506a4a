"""One run of `kinespace live`: everything is opened, the loop runs until Ctrl-C, the counts are printed."""

from __future__ import annotations

import gc
import ipaddress
import sys
import threading
import time
from contextlib import nullcontext
from typing import TYPE_CHECKING

from rich.live import Live

from kinespace.stream.feeds.source import FeedSource
from kinespace.stream.inputs import Admission
from kinespace.stream.outputs import ZmqSink
from kinespace.stream.outputs.body_sink import BodySink
from kinespace.stream.service.loop import Service
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.cli.interruption import stop_on_signals
from kinespace.tools.page.attach import NO_ENDS, ends_for_page
from kinespace.tools.programs.feeds import preset_named
from kinespace.tools.programs.live.endpoints import open_doors, open_ends
from kinespace.tools.programs.live.options import Feed, Guard, Teaching, Watched
from kinespace.tools.programs.live.recognisers import Where, recognisers
from kinespace.tools.teaching.commanded import RecordingDesk
from kinespace.tools.teaching.keys import Keys
from kinespace.tools.terminal.console import console
from kinespace.tools.terminal.live_table import LiveTable, PlainLines, summary
from kinespace.tools.terminal.output_path import require_place_for

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from kinespace.stream.feeds import Preset
    from kinespace.stream.outputs import Sink
    from kinespace.stream.recognizer import Settings
    from kinespace.stream.service.recognising import Recognising
    from kinespace.tools.page.attach import Ends
    from kinespace.tools.programs.live.options import Addresses
    from kinespace.tools.teaching.commanded import Commanded

#: Times a second the table is drawn.
_REDRAWS = 5
#: Seconds for which a thread may keep Python's lock while another waits.
_SWITCH_INTERVAL = 0.0005
#: Files and connections that may be open at once, as far as the system allows.
MAX_CONNECTIONS = 16_384
_NO_FEED = Feed()
_NO_GUARD = Guard()
_NO_TEACHING = Teaching()
_UNWATCHED = Watched()


def recognise(
    addresses: Addresses,
    *,
    library: Path | None,
    settings: Settings,
    most: int,
    plain: bool,
    record: Path | None = None,
    overwrite: bool = False,
    feed: Feed = _NO_FEED,
    guard: Guard = _NO_GUARD,
    teaching: Teaching = _NO_TEACHING,
    watched: Watched = _UNWATCHED,
    where: Where | None = None,
) -> int:
    """Open the addresses, recognise until interrupted, print the counts."""
    where = where or Where()
    _allow_many_connections()
    # A library that is prepared in a thread, and the table that is drawn, must not hold a frame up.
    sys.setswitchinterval(_SWITCH_INTERVAL)
    teaching.require_file(settings)
    watched.require_folder(record)
    if record:
        require_place_for(record, overwrite=overwrite)
    preset = preset_named(feed.preset) if feed.preset else None
    performers, desk = recognisers(
        library, preset, feed, teaching=teaching, settings=settings, most=most, make=where.make
    )
    shown: PlainLines | LiveTable = PlainLines() if plain or not console.is_terminal else LiveTable(performers.classes)
    admission = Admission(silence=performers.silence, merge=guard.merge, allowed=guard.performers)
    networks = [ipaddress.ip_network(each, strict=False) for each in guard.networks]
    # Before the sockets are open: no packet is to wait until the page runs.
    commanded = desk or RecordingDesk()
    ends = _page_ends(
        watched, addresses, preset, guard, performers=performers, desk=commanded if desk or watched.recordings else None
    )
    sources, sinks, kept = open_ends(
        addresses, feed, preset, record, networks=networks, keyring=guard.keyring, admission=admission
    )
    feeds = [source for source in sources if isinstance(source, FeedSource)]
    doors = open_doors(teaching, desk, sources, networks, guard.keyring) if desk else []
    if watched.bodies:
        sinks += [BodySink(sink.sender, performers) for sink in sinks if isinstance(sink, ZmqSink)]
    with (
        kept or nullcontext(),
        Service(
            performers,
            [*sources, *doors, *ends.doors, *where.sources],
            [*sinks, *where.sinks, shown, *ends.sinks],
            admission=admission,
        ) as service,
        ends.page or nullcontext() as page,
    ):
        if desk:
            desk.sinks = service.sinks
        commanded.recording = watched.session(sources, preset)
        # Before the program says that it runs.
        stop_on_signals(service.stop)
        _announce([*sources, *doors], sinks)
        if page:
            console.print(f"page: {page.address}", soft_wrap=True)
        if not guard.keyring:
            _warn_of_strangers([addresses.zmq_in, addresses.zmq_out, *teaching.controls])
        # All objects so far live as long as the program: the collector need not look at them again.
        gc.freeze()
        with Keys(desk, shown) if desk and isinstance(shown, LiveTable) else nullcontext():
            if isinstance(shown, LiveTable):
                _run_with_table(service, shown)
            else:
                service.run()
        commanded.close()
        status = service.status()
    console.print(summary(status, settings.hop), soft_wrap=True)
    for source in feeds:
        console.print(frames_made(source), soft_wrap=True, markup=False)
    if kept:
        console.print(f"{record}: {kept.written} packets, {kept.failed} could not be written", soft_wrap=True)
    return 0


def _allow_many_connections() -> None:
    """Raise the limit of open files: silent connections of strangers must leave room until ZeroMQ has ended them."""
    if sys.platform == "win32":
        return
    import resource  # noqa: PLC0415 - there is none on Windows

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MAX_CONNECTIONS if hard == resource.RLIM_INFINITY else min(MAX_CONNECTIONS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def _page_ends(
    watched: Watched,
    addresses: Addresses,
    preset: Preset | None,
    guard: Guard,
    *,
    performers: Recognising,
    desk: Commanded | None,
) -> Ends:
    """Start the page that is asked for, and open the ends of the link to it."""
    if not watched.page:
        return NO_ENDS
    osc_to = addresses.osc_in or (f"127.0.0.1:{preset.port}" if preset else None)
    return ends_for_page(
        watched.page,
        performers,
        desk,
        keyring=guard.keyring,
        keys=watched.keys,
        recordings=watched.recordings,
        # A port on all of this machine's addresses is reached on this one.
        osc_to=osc_to.replace("0.0.0.0:", "127.0.0.1:") if osc_to else None,
        zmq_to=addresses.zmq_in,
    )


def _announce(sources: Sequence[object], sinks: Sequence[Sink]) -> None:
    listening, answering = ", ".join(map(str, sources)), ", ".join(map(str, sinks)) or "nobody"
    console.print(f"listening on {listening}; answering to {answering}; Ctrl-C ends", soft_wrap=True)


def _warn_of_strangers(places: Sequence[str | None]) -> None:
    """List the ZeroMQ endpoints that other machines reach."""
    endpoints = [Endpoint.parse(place, bind=True) for place in places if place and "://" in place]
    if reached := [endpoint.address for endpoint in endpoints if endpoint.is_open_to_others]:
        console.print(
            f"no --keys: any program at the other end of {', '.join(reached)} can send frames and hear the answers",
            soft_wrap=True,
            markup=False,
        )


def _run_with_table(service: Service, shown: LiveTable) -> None:
    """Draw in a second thread, so that the feed waits at most for the lock, never for a picture."""
    loop = threading.Thread(target=service.run, name="kinespace service")
    loop.start()
    try:
        with Live(console=console, auto_refresh=False) as live:
            while loop.is_alive():
                live.update(shown.drawn(), refresh=True)
                time.sleep(1 / _REDRAWS)
            live.update(shown.drawn(), refresh=True)
    finally:
        # The thread must be out of the sockets before they are closed, also after an error in drawing.
        service.stop()
        loop.join()


def frames_made(source: FeedSource) -> str:
    """Count a feed's frames and joints by their fate, and name the joints missing in refused frames."""
    counts = source.decoder.assembler.counts
    closed = ", ".join(f"{count} by {closing}" for closing, count in counts.closed_by.most_common())
    line = (
        f"feed {source.preset.name}: {counts.frames} frames made ({closed or 'none closed'}), "
        f"{counts.incomplete} refused, joints held {counts.held}, late {counts.late}, unsure {counts.unsure}, "
        f"beyond any stage {counts.absurd}, no room {counts.no_room}, requests not sent {source.unasked}"
    )
    absent = ", ".join(name for name, _ in counts.absent.most_common(5))
    return f"{line}; absent: {absent}" if absent else line
