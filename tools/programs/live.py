"""`kinespace live`: recognise a feed until Ctrl-C."""

from __future__ import annotations

import gc
import ipaddress
import sys
import threading
import time
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from rich.live import Live

from kinespace.library.naming import Naming
from kinespace.stream import osc, zeromq
from kinespace.stream.background_opener import background_restricter, background_windows
from kinespace.stream.feeds.source import FeedSource
from kinespace.stream.inputs import Admission, OscDecoder, Source, ZmqDecoder
from kinespace.stream.outputs import LAYOUTS, LayoutSink, NativeLayout, ReplySink, Sink, ZmqSink
from kinespace.stream.recognizer import LiveSignature, Performers, Recognizer, SentJoints
from kinespace.stream.recording import RawWriter, Recorder, source_name
from kinespace.stream.service import Service
from kinespace.stream.zeromq import Endpoint, Keyring
from kinespace.tools.cli.address import host_and_port
from kinespace.tools.cli.arguments import (
    OSC_IN,
    add_inputs,
    add_keys,
    add_library,
    add_names,
    add_overwrite,
    add_sender,
    add_settings,
    library_at,
    names,
    settings_of,
)
from kinespace.tools.cli.interruption import stop_on_signals
from kinespace.tools.feeding.joint_sets import joints_in_order
from kinespace.tools.programs.feeds import preset_named
from kinespace.tools.teaching.desk import Start, as_performers, open_desk
from kinespace.tools.teaching.door import WEKINATOR_PORT, Allowed, RequestDoor, TaughtDecoder, WekinatorDoor
from kinespace.tools.teaching.keys import Keys
from kinespace.tools.terminal.console import console
from kinespace.tools.terminal.live_table import LiveTable, PlainLines, summary
from kinespace.tools.terminal.output_path import require_place_for

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from kinespace.library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.feeds import Preset
    from kinespace.stream.inputs.receiver import Networks
    from kinespace.stream.recognizer import Settings
    from kinespace.tools.teaching.desk import Desk

#: Where answers go by default: a port that no usual receiver uses.
OSC_OUT = "127.0.0.1:9311"
#: The addresses of all of a machine's networks, and of the machine itself.
_LOOPBACK = (ipaddress.ip_network("127.0.0.0/8"), ipaddress.ip_network("::1/128"))
_ANY_HOST, _THIS_MACHINE = ("0.0.0.0", "::"), ("127.0.0.1", "::1")  # noqa: S104 - compared, not bound
#: Times a second the table is drawn.
_REDRAWS = 5
#: Seconds for which a thread may keep Python's lock while another waits.
_SWITCH_INTERVAL = 0.0005
#: Files and connections that may be open at once, as far as the system allows.
MAX_CONNECTIONS = 16_384
#: In place of a library: only taught motions are known.
_NO_LIBRARY = Path("none")


@dataclass(frozen=True, slots=True)
class Addresses:
    """Addresses of frames and answers, as typed; None for none."""

    osc_in: str | None = None
    osc_out: str | None = None
    zmq_in: str | None = None
    zmq_out: str | None = None


@dataclass(frozen=True, slots=True)
class Feed:
    """Another product's feed, as typed, and the layouts of the answers.

    Attributes
    ----------
    preset
        Name or file of a preset; None for our own messages.
    sender
        Host that gets the messages of presets that have any.
    outs
        NAME or NAME=HOST:PORT of layouts; the host `sender` is each performer's own sender.
    joints
        The joints of our own messages' frames when the sender does not name them, as read by
        `tools.feeding.joint_sets.joints_in_order`; None for the library's joints.
    naming
        How announced joint names of our own messages are read.
    """

    preset: str | None = None
    sender: str = "127.0.0.1"
    outs: Sequence[str] = ()
    joints: str | None = None
    naming: Naming = field(default_factory=Naming)


@dataclass(frozen=True, slots=True)
class Guard:
    """The senders that are let in, as typed.

    Attributes
    ----------
    performers
        Names that are allowed; empty for all.
    networks
        Addresses or networks, like 192.168.0.0/24, whose packets are read; empty for all.
    merge
        Let several senders send frames of one performer.
    keyring
        Keys of all who are let in by ZeroMQ; None for no keys.
    """

    performers: Sequence[str] = ()
    networks: Sequence[str] = ()
    merge: bool = False
    keyring: Keyring | None = None


@dataclass(frozen=True, slots=True)
class Teaching:
    """Whether people may teach, and by which ways, as typed.

    Attributes
    ----------
    file
        The file for taught motions; None: nobody may teach.
    controls
        Further ways in: `wekinator`, `wekinator=HOST:PORT`, or the ZeroMQ endpoint of a socket that replies.
    """

    file: Path | None = None
    controls: Sequence[str] = ()

    def require_file(self, settings: Settings) -> None:
        """Refuse options that need a file, and settings that cannot be taught; ValueError."""
        if self.file is None and self.controls:
            raise ValueError("--control: expected --teach with it")
        if self.file and settings.signature is LiveSignature.PAPER:
            raise ValueError("--teach: expected --signature windows with it, got paper")


_NO_FEED = Feed()
_NO_GUARD = Guard()
_NO_TEACHING = Teaching()

_AnyReceiver = osc.OscReceiver | zeromq.ZmqReceiver


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        f"Recognises frames and publishes answers until Ctrl-C. Unless told otherwise: OSC in on {OSC_IN}, out to "
        f"{OSC_OUT}. A ZeroMQ endpoint is bound; put > before it to connect instead."
    )
    add_inputs(parser)
    parser.add_argument("--osc-out", metavar="HOST:PORT", help="send OSC answers there")
    parser.add_argument("--zmq-out", metavar="ENDPOINT", help="publish ZeroMQ answers")
    parser.add_argument(
        "--feed", metavar="NAME", help="read the feed of this product, see kinespace feeds; or FILE.toml"
    )
    add_sender(parser)
    parser.add_argument(
        "--out",
        action="append",
        default=[],
        metavar="NAME[=HOST:PORT]",
        help="answer as these programs hear it, several at once: " + ", ".join(LAYOUTS) + "; sender:PORT replies",
    )
    parser.add_argument(
        "--joints",
        metavar="A,B,...",
        help="the joints of frames whose sender never names them, in order: the library's names, or a preset that "
        "lists them, like kinectv2, or FILE.toml (default: the library's joints)",
    )
    add_names(parser, "senders")
    add_library(parser)
    add_settings(parser)
    parser.add_argument("--allow", type=names, default=(), metavar="A,B,...", help="recognise these performers only")
    parser.add_argument(
        "--allow-from",
        type=names,
        default=(),
        metavar="NETWORK,...",
        help="let in these networks alone: their packets are read, and they may teach and, as this machine may, hear "
        "the answers by ZeroMQ",
    )
    add_keys(parser)
    parser.add_argument("--merge", action="store_true", help="let several senders send frames of one performer")
    parser.add_argument("--performers", type=int, default=32, help="how many performers at most (default %(default)s)")
    parser.add_argument("--record", type=Path, metavar="FILE", help="keep every packet that comes in, for replay")
    add_overwrite(parser)
    parser.add_argument(
        "--teach", type=Path, metavar="FILE", help="let people teach motions by showing them, and keep them there"
    )
    parser.add_argument(
        "--control",
        action="append",
        default=[],
        metavar="wekinator|ENDPOINT",
        help="also obey Wekinator's control messages (=HOST:PORT; 6448), or ZeroMQ requests, like tcp://127.0.0.1:9330",
    )
    parser.add_argument("--plain", action="store_true", help="print a line per change instead of a table")


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    _allow_many_connections()
    # A library that is prepared in a thread, and the table that is drawn, must not hold a frame up.
    sys.setswitchinterval(_SWITCH_INTERVAL)
    none_given = not any((options.osc_in, options.osc_out, options.zmq_in, options.zmq_out))
    usual_out = not (options.osc_out or options.zmq_out or options.out)
    usual_in = none_given and not options.feed
    addresses = Addresses(
        osc_in=OSC_IN if usual_in else options.osc_in,
        osc_out=OSC_OUT if usual_out else options.osc_out,
        zmq_in=options.zmq_in,
        zmq_out=options.zmq_out,
    )
    with Keyring(options.keys) if options.keys else nullcontext() as keyring:
        return recognise(
            addresses,
            library=options.library,
            settings=settings_of(options),
            most=options.performers,
            plain=options.plain,
            record=options.record,
            overwrite=options.overwrite,
            feed=Feed(options.feed, options.sender, tuple(options.out), options.joints, Naming.asked(options.naming)),
            guard=Guard(options.allow, options.allow_from, options.merge, keyring),
            teaching=Teaching(options.teach, tuple(options.control)),
        )


def _allow_many_connections() -> None:
    """Let strangers who connect and say nothing leave room for others until ZeroMQ has ended their connections."""
    if sys.platform == "win32":
        return
    import resource  # noqa: PLC0415 - there is none on Windows

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MAX_CONNECTIONS if hard == resource.RLIM_INFINITY else min(MAX_CONNECTIONS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


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
) -> int:
    """Open the addresses, recognise until interrupted, print the counts."""
    teaching.require_file(settings)
    if record:
        require_place_for(record, overwrite=overwrite)
    preset = preset_named(feed.preset) if feed.preset else None
    performers, desk = _performers(library, preset, feed, teaching=teaching, settings=settings, most=most)
    shown: PlainLines | LiveTable = PlainLines() if plain or not console.is_terminal else LiveTable(performers.classes)
    admission = Admission(silence=performers.silence, merge=guard.merge, allowed=guard.performers)
    networks = [ipaddress.ip_network(each, strict=False) for each in guard.networks]
    receivers, sinks, kept = _open(
        addresses, feed, preset, record, networks=networks, keyring=guard.keyring, admission=admission
    )
    recorders = [Recorder(kept, index) if kept else None for index in range(len(receivers))]
    sources = [_source(*each, preset, feed.sender, admission) for each in zip(receivers, recorders, strict=True)]
    feeds = [source for source in sources if isinstance(source, FeedSource)]
    doors = _doors(teaching, desk, sources, networks, guard.keyring) if desk else []
    with (
        kept or nullcontext(),
        Service(performers, [*sources, *doors], [*sinks, shown], admission=admission) as service,
    ):
        if desk:
            desk.sinks = service.sinks
        # Before anybody can know that the program runs.
        stop_on_signals(service.stop)
        _announce([*sources, *doors], sinks)
        if not guard.keyring:
            _warn_of_strangers([addresses.zmq_in, addresses.zmq_out, *teaching.controls])
        # All objects so far live as long as the program: the collector need not look at them again.
        gc.freeze()
        with Keys(desk, shown) if desk and isinstance(shown, LiveTable) else nullcontext():
            if isinstance(shown, LiveTable):
                _run_with_table(service, shown)
            else:
                service.run()
        if desk:
            desk.close()
        status = service.status()
    console.print(summary(status), soft_wrap=True)
    for source in feeds:
        console.print(frames_made(source), soft_wrap=True, markup=False)
    if kept:
        console.print(f"{record}: {kept.written} packets, {kept.failed} could not be written", soft_wrap=True)
    return 0


def _performers(
    library: Path | None,
    preset: Preset | None,
    feed: Feed,
    *,
    teaching: Teaching,
    settings: Settings,
    most: int,
) -> tuple[Performers, Desk | None]:
    """Make the recognisers, and the desk in front of them if people may teach."""
    nothing = library == _NO_LIBRARY
    if nothing and not teaching.file:
        raise ValueError("--library none: expected --teach with it")
    joints = _assumed_joints(feed)
    motions = library_at(None if nothing else library)
    if feed.naming.convention or feed.naming.finds:
        motions = motions.in_our_names(Naming())
    if nothing:
        joints = joints or (preset.joints if preset else ())
    elif preset:
        motions = fitted(motions, f"feed {preset.name}", preset.joints)
    elif joints:
        motions = fitted(motions, "--joints", joints)
    sent = SentJoints(joints, feed.naming, background_restricter(settings))
    if teaching.file:
        desk = _desk(teaching, None if nothing else motions, sent, settings, most)
        return as_performers(desk), desk
    _require_room_for(motions, settings)
    return Performers(motions, settings, most=most, joints=sent, opener=background_windows()), None


def _desk(teaching: Teaching, motions: MotionLibrary | None, sent: SentJoints, settings: Settings, most: int) -> Desk:
    """Open the taught library."""
    assert teaching.file is not None  # noqa: S101 - told to mypy

    def performers(index: WindowIndex, classes: Sequence[str]) -> Performers:
        covers = set(index.library.skeleton.joints) <= set(sent.assumed)
        joints = sent if covers else replace(sent, assumed=())
        opener = background_windows()
        return Performers(index, settings, most=most, joints=joints, opener=opener, classes=classes)

    return open_desk(Start(teaching.file, motions, sent.assumed), performers)


def _doors(
    teaching: Teaching, desk: Desk, sources: Sequence[Source], networks: Networks, keyring: Keyring | None
) -> list[WekinatorDoor | RequestDoor]:
    """Open the ways in for commands: the frames' own ports, and further ones."""
    allowed = Allowed(networks)
    for source in sources:
        source.decoder = TaughtDecoder(source.decoder, desk, allowed)
    doors: list[WekinatorDoor | RequestDoor] = []
    for control in teaching.controls:
        name, _, place = control.partition("=")
        if name == "wekinator":
            host, port = host_and_port(place) if place else ("127.0.0.1", WEKINATOR_PORT)
            doors.append(WekinatorDoor(osc.OscReceiver(host, port), desk, allowed))
        elif "://" in control:
            doors.append(RequestDoor(Endpoint.parse(control, bind=True), desk, allowed, keyring))
        else:
            raise ValueError(f"--control: expected wekinator or an endpoint like tcp://127.0.0.1:9330, got {control!r}")
    return doors


def _assumed_joints(feed: Feed) -> tuple[str, ...]:
    if feed.joints and feed.preset:
        raise ValueError("--joints: expected no --feed with it; a preset says which joints there are")
    return feed.naming.read(joints_in_order(feed.joints)).joints if feed.joints else ()


def fitted(motions: MotionLibrary, whose: str, joints: Sequence[str]) -> MotionLibrary:
    """Restrict a library to the joints a feed has, and print which.

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
    """Describe what happened to a feed's joints, and which were missing in refused frames."""
    counts = source.decoder.assembler.counts
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
    addresses: Addresses,
    feed: Feed,
    preset: Preset | None,
    record: Path | None,
    *,
    networks: Networks,
    keyring: Keyring | None,
    admission: Admission,
) -> tuple[list[_AnyReceiver], list[Sink], RawWriter | None]:
    """Open the addresses; after a failure the open ones are closed again."""
    if preset and not (addresses.osc_in or addresses.zmq_in):
        addresses = replace(addresses, osc_in=f"127.0.0.1:{preset.port}")
    if not (addresses.osc_in or addresses.zmq_in):
        raise ValueError("live: expected --osc-in or --zmq-in, got neither")
    receivers: list[_AnyReceiver] = []
    sinks: list[Sink] = []
    with ExitStack() as opened:
        if addresses.osc_in:
            receivers.append(osc.OscReceiver(*host_and_port(addresses.osc_in), networks))
            opened.callback(receivers[-1].close)
        if addresses.zmq_in:
            endpoint = Endpoint.parse(addresses.zmq_in, bind=True)
            receivers.append(zeromq.ZmqReceiver(endpoint, networks=networks, keyring=keyring))
            opened.callback(receivers[-1].close)
        if addresses.osc_out:
            sinks.append(LayoutSink(NativeLayout(), osc.OscSender(*host_and_port(addresses.osc_out))))
            opened.callback(sinks[-1].close)
        if addresses.zmq_out:
            endpoint = Endpoint.parse(addresses.zmq_out, bind=True)
            listeners = [*networks, *_LOOPBACK] if networks else ()
            known = bool(keyring or networks) or not endpoint.is_open_to_others
            sinks.append(ZmqSink(zeromq.ZmqSender(endpoint, keyring, listeners), named=known))
            opened.callback(sinks[-1].close)
        for out in feed.outs:
            sinks.append(_layout_sink(out, receivers, admission))
            opened.callback(sinks[-1].close)
        _require_no_loop(receivers, sinks)
        # Last, because it may take another file's place.
        writer = _writer(record, receivers, preset) if record else None
        opened.pop_all()
    return receivers, sinks, writer


def _require_no_loop(receivers: Sequence[_AnyReceiver], sinks: Sequence[Sink]) -> None:
    """Refuse answers to a port on which frames come in: they would be taken for frames."""
    heard = [receiver.address for receiver in receivers if isinstance(receiver, osc.OscReceiver)]
    for sink in sinks:
        for own, listening in heard:
            if _reaches(sink, own, listening):
                raise ValueError(f"--out: expected another place than {own}:{listening}, where frames come in: {sink}")


def _reaches(sink: Sink, own: str, listening: int) -> bool:
    """Say whether what a sink sends comes to one of our own addresses."""
    if isinstance(sink, ReplySink):
        # The sender may be on this machine.
        return sink.port == listening
    sender = sink.sender if isinstance(sink, LayoutSink) else None
    if not isinstance(sender, osc.OscSender):
        return False
    host, port = sender.target[:2]
    return port == listening and (host == own or (own in _ANY_HOST and (host in _ANY_HOST or osc.is_ours(host))))


def _writer(record: Path, receivers: Sequence[_AnyReceiver], preset: Preset | None) -> RawWriter:
    record.unlink(missing_ok=True)
    presets = {preset.name: preset.text} if preset else {}
    return RawWriter(record, [source_name(receiver, preset) for receiver in receivers], presets)


def _source(
    receiver: _AnyReceiver, recorder: Recorder | None, preset: Preset | None, sender: str, admission: Admission
) -> Source:
    if preset:
        return FeedSource(receiver, preset, sender=sender, recorder=recorder, admission=admission)
    decoder = OscDecoder() if isinstance(receiver, osc.OscReceiver) else ZmqDecoder()
    return Source(receiver, decoder, recorder, admission)


def _layout_sink(text: str, receivers: Sequence[_AnyReceiver], admission: Admission) -> Sink:
    """Open NAME, NAME=HOST:PORT or NAME=sender:PORT."""
    name, _, target = text.partition("=")
    if name not in LAYOUTS:
        raise ValueError(f"--out: expected one of {', '.join(LAYOUTS)}, got {name!r}")
    layout = LAYOUTS[name]()
    if target.partition(":")[0] != "sender":
        host, port = host_and_port(target) if target else ("127.0.0.1", layout.port)
        return LayoutSink(layout, osc.OscSender(host, port))
    heard = [receiver for receiver in receivers if isinstance(receiver, osc.OscReceiver)]
    if not heard:
        raise ValueError("--out: expected an OSC feed to reply to, got none")
    port = host_and_port(target)[1] if ":" in target else layout.port
    return ReplySink(layout, heard[0], port, admission)


def _announce(sources: Sequence[object], sinks: Sequence[Sink]) -> None:
    listening, answering = ", ".join(map(str, sources)), ", ".join(map(str, sinks)) or "nobody"
    console.print(f"listening on {listening}; answering to {answering}; Ctrl-C ends", soft_wrap=True)


def _warn_of_strangers(places: Sequence[str | None]) -> None:
    """List the ZeroMQ endpoints that other machines reach."""
    endpoints = [Endpoint.parse(place, bind=True) for place in places if place and "://" in place]
    if reached := [endpoint.address for endpoint in endpoints if endpoint.is_open_to_others]:
        console.print(
            f"no --keys: whoever is at the other end of {', '.join(reached)} is believed and hears the answers",
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
