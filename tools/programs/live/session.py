"""One run of `kinespace live`: everything is opened, the loop runs until Ctrl-C, the counts are printed."""

from __future__ import annotations

import gc
import sys
import threading
import time
from contextlib import ExitStack, nullcontext
from typing import TYPE_CHECKING

from rich.live import Live

from kinespace.stream.inputs import Admission
from kinespace.stream.inputs.feed_source import FeedSource
from kinespace.stream.outputs import ZmqSink
from kinespace.stream.outputs.zeromq_sink import BodySink
from kinespace.stream.recognizer import LiveSignature
from kinespace.stream.service.loop import Service
from kinespace.tools.cli.arguments import settings_of
from kinespace.tools.cli.interruption import stop_on_signals
from kinespace.tools.cli.preset import preset_named
from kinespace.tools.programs.live.endpoints import open_controls, open_ends, open_page
from kinespace.tools.programs.live.recognisers import Where, recognisers
from kinespace.tools.teaching.keys import Keys
from kinespace.tools.terminal.console import console
from kinespace.tools.terminal.live_table import LiveTable, PlainLines, summary
from kinespace.tools.terminal.output_path import require_place_for

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence
    from contextlib import AbstractContextManager

    from kinespace.stream.feeds import Preset
    from kinespace.stream.outputs import Sink
    from kinespace.stream.recognizer import Settings
    from kinespace.stream.zeromq import Keyring
    from kinespace.tools.teaching.lessons import Lessons

#: Times a second the table is drawn.
_REDRAWS = 5
#: Files and connections that may be open at once, as far as the system allows.
MAX_CONNECTIONS = 16_384


def recognise(options: argparse.Namespace, keyring: Keyring | None, where: Where) -> int:
    """Open the addresses, recognise until interrupted, print the counts."""
    _allow_many_connections()
    settings, record = settings_of(options), options.record
    preset = _checked(options, settings)
    performers, lessons = recognisers(options, preset, where.make)
    shown: PlainLines | LiveTable = (
        PlainLines()
        if options.plain or not console.is_terminal
        else LiveTable(lessons.classes if lessons else performers.classes)
    )
    admission = Admission(silence=performers.silence, allowed=options.allow)
    # Before the sockets are open: no packet is to wait until the page runs.
    ends = open_page(options, keyring, performers, commands=lessons is not None)
    sources, sinks, kept = open_ends(options, preset, keyring, admission)
    feeds = [source for source in sources if isinstance(source, FeedSource)]
    with ExitStack() as opened:
        for close in [each.close for each in sources] + [each.close for each in sinks] + ([kept.close] if kept else []):
            opened.callback(close)
        controls = open_controls(options, sources, keyring) if lessons else []
        opened.pop_all()
    if options.bodies:
        sinks += [BodySink(sink.sender, performers) for sink in sinks if isinstance(sink, ZmqSink)]
    with (
        kept or nullcontext(),
        Service(
            performers,
            [*sources, *controls, *ends.sources, *where.sources],
            [*sinks, shown, *ends.sinks, *([lessons] if lessons else [])],
            admission=admission,
            control=lessons,
        ) as service,
        ends.page or nullcontext() as page,
    ):
        if lessons:
            lessons.sinks = service.sinks
        # Before the program says that it runs.
        stop_on_signals(service.stop)
        _announce([*sources, *controls], sinks)
        if page:
            console.print(f"page: {page.address}", soft_wrap=True)
        # All objects so far live as long as the program: the collector need not look at them again.
        gc.freeze()
        with _keys(lessons, shown):
            if isinstance(shown, LiveTable):
                _run_with_table(service, shown)
            else:
                service.run()
        if lessons:
            lessons.close()
        status = service.status()
    console.print(summary(status, settings.hop), soft_wrap=True)
    for source in feeds:
        console.print(frames_made(source), soft_wrap=True, markup=False)
    if kept:
        console.print(f"{record}: {kept.written} packets, {kept.failed} could not be written", soft_wrap=True)
    return 0


def _checked(options: argparse.Namespace, settings: Settings) -> Preset | None:
    """Refuse options that need others, and files that cannot be written; give the preset of the feed."""
    if options.control and not options.teach:
        raise ValueError("--control: expected --teach with it")
    if options.teach and settings.signature is LiveSignature.PAPER:
        raise ValueError("--teach: expected --signature windows with it, got paper")
    if options.record:
        require_place_for(options.record, overwrite=options.overwrite)
    preset = preset_named(options.feed) if options.feed else None
    if preset and not (options.osc_in or options.zmq_in):
        options.osc_in = f"127.0.0.1:{preset.port}"
    return preset


def _allow_many_connections() -> None:
    """Raise the limit of open files: silent connections of strangers must leave room until ZeroMQ has ended them."""
    if sys.platform == "win32":
        return
    import resource  # noqa: PLC0415 - there is none on Windows

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MAX_CONNECTIONS if hard == resource.RLIM_INFINITY else min(MAX_CONNECTIONS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def _keys(lessons: Lessons | None, shown: PlainLines | LiveTable) -> AbstractContextManager[object]:
    """Read keys where people may teach and a table is shown."""
    return Keys(lessons, shown) if lessons and isinstance(shown, LiveTable) else nullcontext()


def _announce(sources: Sequence[object], sinks: Sequence[Sink]) -> None:
    listening, answering = ", ".join(map(str, sources)), ", ".join(map(str, sinks)) or "nobody"
    console.print(f"listening on {listening}; answering to {answering}; Ctrl-C ends", soft_wrap=True)


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
