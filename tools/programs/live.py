"""`kinespace live`: recognise a feed until Ctrl-C."""

from __future__ import annotations

import gc
import signal
import sys
import threading
import time
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from rich.live import Live

from kinespace.library import MotionLibrary
from kinespace.stream import osc, zeromq
from kinespace.stream.background_opener import BackgroundOpener
from kinespace.stream.connections import Endpoint
from kinespace.stream.feeds.source import FeedSource
from kinespace.stream.layouts import LAYOUTS, LayoutSink, ReplySender
from kinespace.stream.onepart import ZmqPackets
from kinespace.stream.rawfile import RawWriter
from kinespace.stream.recognizer import Performers, Recognizer
from kinespace.stream.service import OscSink, OscSource, Service, Sink, Source, ZmqSink, ZmqSource
from kinespace.stream.tap import Tap, TappedMessages, TappedPackets, TappedSource, described
from kinespace.tools.cli.address import host_and_port
from kinespace.tools.cli.arguments import (
    OSC_IN,
    add_inputs,
    add_library,
    add_overwrite,
    add_sender,
    add_settings,
    settings_of,
)
from kinespace.tools.feeding.joint_sets import joints_in_order
from kinespace.tools.programs.feeds import preset_named
from kinespace.tools.terminal.console import console
from kinespace.tools.terminal.live_table import LiveTable, PlainLines, summary
from kinespace.tools.terminal.output_path import require_place_for

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from kinespace.stream.feeds import Preset
    from kinespace.stream.recognizer import Settings

#: Where answers go when nothing else is said: a port that none of the usual receivers uses.
OSC_OUT = "127.0.0.1:9311"
#: Times a second the table is drawn.
_REDRAWS = 5
#: Seconds a thread may keep Python's lock while another waits. Drawing takes longer than a frame may wait.
_SWITCH_INTERVAL = 0.0005


@dataclass(frozen=True, slots=True)
class Addresses:
    """Where frames come in and answers go out, as typed; None for not at all."""

    osc_in: str | None = None
    osc_out: str | None = None
    zmq_in: str | None = None
    zmq_out: str | None = None


@dataclass(frozen=True, slots=True)
class Feed:
    """Another product's feed, as typed, and who hears the answer in which layout.

    Attributes
    ----------
    preset
        Name or file of a preset; None for our own messages.
    sender
        Host that is told to send, for presets that ask.
    outs
        NAME or NAME=HOST:PORT of layouts; the host `sender` is whoever sent last.
    joints
        What frames in our own messages hold whose sender does not say so, as
        `tools.feeding.joint_sets.joints_in_order` reads it; None for the library's joints.
    """

    preset: str | None = None
    sender: str = "127.0.0.1"
    outs: Sequence[str] = ()
    joints: str | None = None


_NO_FEED = Feed()

_AnyReceiver = osc.OscReceiver | zeromq.ZmqReceiver


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Say which options the program takes."""
    parser.description = (
        f"Recognises frames and publishes answers until Ctrl-C. Unless told otherwise: OSC in on {OSC_IN}, out to "
        f"{OSC_OUT}. A ZeroMQ endpoint is bound; put > before it to connect instead."
    )
    add_inputs(parser)
    parser.add_argument("--osc-out", metavar="HOST:PORT", help="send OSC answers there")
    parser.add_argument("--zmq-out", metavar="ENDPOINT", help="publish ZeroMQ answers")
    parser.add_argument(
        "--feed", metavar="NAME", help="frames are another product's: see kinespace feeds; or FILE.toml"
    )
    add_sender(parser)
    parser.add_argument(
        "--out",
        action="append",
        default=[],
        metavar="NAME[=HOST:PORT]",
        help="answer as touchdesigner, max, wekinator, vmc-thru, vrchat or native hear it; sender:PORT replies",
    )
    parser.add_argument(
        "--joints",
        metavar="A,B,...",
        help="what frames hold, in order, whose sender never names their joints: the library's names, or a preset that "
        "lists them, like kinectv2, or FILE.toml (default: the library's joints)",
    )
    add_library(parser)
    add_settings(parser)
    parser.add_argument("--performers", type=int, default=32, help="how many at once, at most (default %(default)s)")
    parser.add_argument("--record", type=Path, metavar="FILE", help="keep every packet that comes, for replay")
    add_overwrite(parser)
    parser.add_argument("--plain", action="store_true", help="print a line per change instead of a table")


def run(options: argparse.Namespace) -> int:
    """Run the program as its options say; the exit status."""
    none_given = not any((options.osc_in, options.osc_out, options.zmq_in, options.zmq_out))
    usual_out = not (options.osc_out or options.zmq_out or options.out)
    usual_in = none_given and not options.feed
    addresses = Addresses(
        osc_in=OSC_IN if usual_in else options.osc_in,
        osc_out=OSC_OUT if usual_out else options.osc_out,
        zmq_in=options.zmq_in,
        zmq_out=options.zmq_out,
    )
    return recognise(
        addresses,
        library=options.library,
        settings=settings_of(options),
        most=options.performers,
        plain=options.plain,
        record=options.record,
        overwrite=options.overwrite,
        feed=Feed(options.feed, options.sender, tuple(options.out), options.joints),
    )


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
) -> int:
    """Open the addresses, recognise until interrupted, print the counts."""
    if record:
        require_place_for(record, overwrite=overwrite)
    motions = MotionLibrary.load(library) if library else MotionLibrary.builtin()
    preset = preset_named(feed.preset) if feed.preset else None
    joints = _assumed_joints(feed)
    if preset:
        motions = fitted(motions, f"feed {preset.name}", preset.joints)
    elif joints:
        motions = fitted(motions, "--joints", joints)
    _require_room_for(motions, settings)
    performers = Performers(motions, settings, most=most, joints=joints, opener=BackgroundOpener())
    shown: PlainLines | LiveTable = PlainLines() if plain or not console.is_terminal else LiveTable(motions.classes)
    receivers, sinks, kept = _open(addresses, feed, preset, record)
    taps = [Tap(kept, index) if kept else None for index in range(len(receivers))]
    sources = [_source(receiver, preset, feed.sender, tap) for receiver, tap in zip(receivers, taps, strict=True)]
    feeds = [source for source in sources if isinstance(source, FeedSource)]
    tapped = [TappedSource(source, tap) if tap else source for source, tap in zip(sources, taps, strict=True)]
    with kept or nullcontext(), Service(performers, tapped, [*sinks, shown]) as service:
        _announce(sources, sinks)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: service.stop())
        # What was loaded so far lives as long as we do: the collector need not look at it again.
        gc.freeze()
        if isinstance(shown, LiveTable):
            _run_with_table(service, shown)
        else:
            service.run()
        status = service.status()
    console.print(summary(status), soft_wrap=True)
    for source in feeds:
        console.print(frames_made(source), soft_wrap=True, markup=False)
    if kept:
        console.print(f"{record}: {kept.written} packets, {kept.failed} could not be written", soft_wrap=True)
    return 0


def _assumed_joints(feed: Feed) -> tuple[str, ...]:
    if feed.joints and feed.preset:
        raise ValueError("--joints: expected no --feed with it; a preset says which joints there are")
    return joints_in_order(feed.joints) if feed.joints else ()


def fitted(motions: MotionLibrary, whose: str, joints: Sequence[str]) -> MotionLibrary:
    """Restrict a library to the joints a feed has, and say so.

    Raises
    ------
    SkeletonMismatchError
        Library and feed share fewer than five joints.
    """
    shared = motions.restricted_to(joints)
    if shared is not motions:
        for name in joints:
            near = [] if name in motions.skeleton.joints else get_close_matches(name, motions.skeleton.joints, n=1)
            if near and near[0] not in joints:
                console.print(f"{whose}: the library has no joint {name!r}, perhaps {near[0]} is meant", soft_wrap=True)
        further = [name for name in joints if name not in motions.skeleton.joints]
        if further:
            console.print(f"{whose}: not compared, for the library has none: {', '.join(further)}", soft_wrap=True)
        console.print(
            f"{whose}: {len(shared.skeleton.joints)} of the library's {len(motions.skeleton.joints)} joints",
            soft_wrap=True,
        )
    return shared


def frames_made(source: FeedSource) -> str:
    """Say what became of a feed's joints, and which were lacking where frames were refused."""
    counts = source.assembler.counts
    closed = ", ".join(f"{count} by {closing}" for closing, count in counts.closed_by.most_common())
    line = (
        f"feed {source.preset.name}: {counts.frames} frames made ({closed or 'none closed'}), "
        f"{counts.incomplete} refused, joints held {counts.held}, late {counts.late}, unsure {counts.unsure}, "
        f"beyond any stage {counts.absurd}, no room {counts.no_room}, asked in vain {source.unasked}"
    )
    absent = ", ".join(name for name, _ in counts.absent.most_common(5))
    return f"{line}; absent: {absent}" if absent else line


def _require_room_for(motions: MotionLibrary, settings: Settings) -> None:
    """Refuse a window that this machine has no memory for now, not at the first performer's first frame."""
    try:
        Recognizer(motions, settings)
    except MemoryError as error:
        if settings.window is None:
            raise
        raise ValueError(f"--window: expected seconds that memory has room for, got {settings.window:g}") from error


def _open(
    addresses: Addresses, feed: Feed, preset: Preset | None, record: Path | None
) -> tuple[list[_AnyReceiver], list[Sink], RawWriter | None]:
    """Open what was asked for; what was opened before a failure is closed again."""
    if preset and not (addresses.osc_in or addresses.zmq_in):
        addresses = replace(addresses, osc_in=f"127.0.0.1:{preset.port}")
    if not (addresses.osc_in or addresses.zmq_in):
        raise ValueError("live: expected --osc-in or --zmq-in, got neither")
    receivers: list[_AnyReceiver] = []
    sinks: list[Sink] = []
    with ExitStack() as opened:
        if addresses.osc_in:
            receivers.append(osc.OscReceiver(*host_and_port(addresses.osc_in)))
            opened.callback(receivers[-1].close)
        if addresses.zmq_in:
            receivers.append(zeromq.ZmqReceiver(Endpoint.parse(addresses.zmq_in, bind=True)))
            opened.callback(receivers[-1].close)
        if addresses.osc_out:
            sinks.append(OscSink(osc.OscSender(*host_and_port(addresses.osc_out))))
            opened.callback(sinks[-1].close)
        if addresses.zmq_out:
            sinks.append(ZmqSink(zeromq.ZmqSender(Endpoint.parse(addresses.zmq_out, bind=True))))
            opened.callback(sinks[-1].close)
        for out in feed.outs:
            sinks.append(_layout_sink(out, receivers))
            opened.callback(sinks[-1].close)
        # Last, because it may take another file's place.
        writer = _writer(record, receivers, preset) if record else None
        opened.pop_all()
    return receivers, sinks, writer


def _writer(record: Path, receivers: Sequence[_AnyReceiver], preset: Preset | None) -> RawWriter:
    record.unlink(missing_ok=True)
    presets = {preset.name: preset.text} if preset else {}
    return RawWriter(record, [described(receiver, preset) for receiver in receivers], presets)


def _source(
    receiver: _AnyReceiver, preset: Preset | None, sender: str, tap: Tap | None
) -> FeedSource | OscSource | ZmqSource:
    """Make the source of what comes in at one place, through the tap where there is a recording."""
    if isinstance(receiver, osc.OscReceiver):
        packets = TappedPackets(receiver, tap) if tap else receiver
        return FeedSource(packets, preset, sender=sender) if preset else OscSource(packets)
    messages = TappedMessages(receiver, tap) if tap else receiver
    return FeedSource(ZmqPackets(messages), preset) if preset else ZmqSource(messages)


def _layout_sink(text: str, receivers: Sequence[_AnyReceiver]) -> LayoutSink:
    """Open NAME, NAME=HOST:PORT or NAME=sender:PORT."""
    name, _, target = text.partition("=")
    if name not in LAYOUTS:
        raise ValueError(f"--out: expected one of {', '.join(LAYOUTS)}, got {name!r}")
    layout = LAYOUTS[name]()
    if target.partition(":")[0] != "sender":
        host, port = host_and_port(target) if target else ("127.0.0.1", layout.port)
        return LayoutSink(name, layout, osc.OscSender(host, port))
    heard = [receiver for receiver in receivers if isinstance(receiver, osc.OscReceiver)]
    if not heard:
        raise ValueError("--out: expected an OSC feed to reply to, got none")
    port = host_and_port(target)[1] if ":" in target else layout.port
    return LayoutSink(name, layout, ReplySender(heard[0], port))


def _announce(sources: Sequence[Source], sinks: Sequence[Sink]) -> None:
    listening, answering = ", ".join(map(str, sources)), ", ".join(map(str, sinks)) or "nobody"
    console.print(f"listening on {listening}; answering to {answering}; Ctrl-C ends", soft_wrap=True)


def _run_with_table(service: Service, shown: LiveTable) -> None:
    """Draw in a second thread, so that the feed waits for a lock's turn at most, never for a picture."""
    sys.setswitchinterval(_SWITCH_INTERVAL)
    loop = threading.Thread(target=service.run, name="kinespace service")
    loop.start()
    try:
        with Live(console=console, auto_refresh=False) as live:
            while loop.is_alive():
                live.update(shown.drawn(), refresh=True)
                time.sleep(1 / _REDRAWS)
            live.update(shown.drawn(), refresh=True)
    finally:
        # The thread must be out of the sockets before they are closed, whatever became of the picture.
        service.stop()
        loop.join()
