"""`kinespace live`: recognises a feed.

Recognises frames and publishes answers until Ctrl-C, by OSC unless other addresses are given. A ZeroMQ endpoint is
bound; put > before it to connect instead.
"""

import argparse
import gc
import os
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

from rich.live import Live

from kinespace.library import MotionLibrary, WindowIndex, opened
from kinespace.library.naming import Naming
from kinespace.stream import BackgroundViews
from kinespace.stream.feeds import Preset
from kinespace.stream.inputs import Admission, FeedSource
from kinespace.stream.outputs import LAYOUTS, BodySink, ZmqSink
from kinespace.stream.outputs.lsl_sink import LSL
from kinespace.stream.outputs.midi_sink import MIDI, MidiSink
from kinespace.stream.recognizer import LiveSignature, Performers, SentJoints, Settings
from kinespace.stream.service.loop import AnySource, Recognising, Service
from kinespace.stream.service.workers import Gateway, Terms
from kinespace.stream.teaching.movement import STILLNESS
from kinespace.tools.cli import arguments
from kinespace.tools.cli.console import console, log_as, require_place_for, say
from kinespace.tools.cli.entry import stop_on_signals
from kinespace.tools.cli.live_table import LiveTable, PlainLines, summary
from kinespace.tools.cli.values import meant
from kinespace.tools.programs.ends import Ends, supervisors
from kinespace.tools.teaching.keys import Keys
from kinespace.tools.teaching.lessons import Lessons, open_lessons

#: A library, perhaps opened already.
Known = MotionLibrary | WindowIndex

#: In place of a library: only taught motions are known.
_NO_LIBRARY = Path("none")
#: Where answers go by default: a port that no usual receiver uses.
OSC_OUT = "127.0.0.1:9311"
#: Where WebSocket clients come unless the user says otherwise.
WS = "127.0.0.1:9313"
#: Times a second the table is drawn.
_REDRAWS = 5
#: Files and connections that may be open at once, as far as the system allows.
MAX_CONNECTIONS = 16_384


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    arguments.add_shared(parser, "--osc-in", "--zmq-in")
    text = f"send OSC answers there (default {OSC_OUT}, unless --zmq-out or --out is given)"
    parser.add_argument("--osc-out", metavar="[HOST:]PORT", help=text)
    parser.add_argument("--zmq-out", metavar="ENDPOINT", help="publish ZeroMQ answers")
    text = "read the feed of this product, by default on its own port; or FILE.toml: see kinespace feeds"
    parser.add_argument("--feed", metavar="NAME", help=text)
    arguments.add_shared(parser, "--sender")
    text = (
        f"answer in the layouts of these programs instead of to {OSC_OUT} (native: as well as): "
        f"{', '.join((*LAYOUTS, LSL, MIDI))}; FILE.toml: messages of your own; sender:PORT replies"
    )
    parser.add_argument(
        "--out", type=arguments.names, action="extend", default=[], metavar="NAME[=HOST:PORT],...", help=text
    )
    text = (
        "joints of frames whose sender never names them, in order: the library's names, or a preset that lists them, "
        "like kinectv2, or FILE.toml (default: the library's joints)"
    )
    parser.add_argument("--joints", metavar="A,B,...", help=text)
    arguments.add_names(parser, "senders")
    arguments.add_shared(parser, "--library")
    arguments.add_settings(parser)
    parser.add_argument("--allow", type=arguments.names, default=(), metavar="A,B,...", help="these performers only")
    text = "read packets from these networks alone; let them teach; let them and this machine get the answers by ZeroMQ"
    parser.add_argument("--allow-from", type=arguments.names, default=(), metavar="NETWORK,...", help=text)
    arguments.add_shared(parser, "--keys", "--open")
    parser.add_argument("--performers", type=int, default=32, help="how many performers at most (default %(default)s)")
    parser.add_argument("--record", type=Path, metavar="FILE", help="keep every packet that comes in, for replay")
    arguments.add_shared(parser, "--overwrite")
    parser.add_argument("--bodies", action="store_true", help="publish bodies on --zmq-out, for a page elsewhere")
    text = f"show a page in the browser (default {arguments.PAGE})"
    parser.add_argument("--page", nargs="?", const=arguments.PAGE, metavar="[HOST:]PORT", help=text)
    text = f"also take frames and give answers by WebSocket, in JSON (default {WS})"
    parser.add_argument("--ws", nargs="?", const=WS, metavar="[HOST:]PORT", help=text)
    text = "let pages of these sites connect to --ws, like https://editor.p5js.org; pages of this machine may anyway"
    parser.add_argument("--ws-origin", type=arguments.names, default=(), metavar="ORIGIN,...", help=text)
    parser.add_argument("--plain", action="store_true", help="print a line per change instead of a table")
    parser.add_argument("--log", choices=("text", "json"), help="as --plain, each line with the wall clock and a level")
    text = "spread performers over processes (default: none)"
    parser.add_argument("--workers", type=workers, default=0, metavar="N|auto", help=text)
    parser.add_argument("--camera", metavar="0|FILE|URL", help="watch a camera, a film or a stream: kinespace camera")
    arguments.add_shared(parser, "--people", "--size")
    parser.add_argument("--lsl-in", metavar="NAME", help="read the positions of this LSL stream")
    parser.add_argument("--teach", type=Path, metavar="FILE", help="let people teach motions, and keep them there")
    text = "movement, relative to the body, that counts as rest; twice as much begins a motion (default %(default)s)"
    parser.add_argument("--stillness", type=arguments.positive, default=STILLNESS, help=text)
    text = "taught motions may be done by either side (default: with --camera)"
    parser.add_argument("--either-side", action=argparse.BooleanOptionalAction, help=text)
    text = 'answer a performer who is being taught as usual (default: "unknown", without events)'
    parser.add_argument("--loud-lessons", action="store_true", help=text)
    text = "also obey ZeroMQ requests, like tcp://127.0.0.1:9330"
    parser.add_argument("--control", action="append", default=[], metavar="ENDPOINT", help=text)


def workers(text: str) -> int:
    """Read a number of workers; `auto`: one for each core but one, which receives."""
    return max((os.cpu_count() or 1) - 1, 1) if text == "auto" else arguments.count(text)


def run(options: argparse.Namespace) -> int:
    """Open the addresses, recognise until interrupted, print the counts; return the exit status."""
    log_as(options.log)
    _allow_many_connections()
    settings = arguments.settings_of(options)
    preset = _checked(options, settings)
    performers, lessons = recognisers(options, preset)
    in_lines = options.plain or options.log or not console.is_terminal
    shown = PlainLines() if in_lines else LiveTable((lessons or performers).classes)
    admission = Admission(silence=performers.silence, allowed=options.allow)
    with Ends(options, admission) as ends:
        # What workers send is read as a source is.
        from_workers = [performers.source] if isinstance(performers, Gateway) else []
        listeners = [*([lessons] if lessons else ()), *supervisors()]
        for each in (*from_workers, *listeners):
            ends.callback(each.close)
        # Before the sockets are open: no packet is to wait until the page runs.
        ends.open_servers(performers, commands=lessons is not None)
        ends.open(preset)
        ends.open_controls()
        ends.open_senders()
        sources: list[AnySource] = [*ends.sources, *ends.controls, *ends.own_controls, *from_workers]
        to_zmq = [sink.sender for sink in ends.sinks if options.bodies and isinstance(sink, ZmqSink)]
        bodies = [BodySink(sender, performers.skeleton_of, performers.carried) for sender in to_zmq]
        sinks = [*ends.sinks, *bodies, shown, *ends.own_sinks, *listeners]
        service = Service(performers, sources, sinks, admission=admission, control=lessons)
        if isinstance(performers, Gateway):
            performers.publish = service.publish
        if lessons:
            lessons.sinks = service.sinks
        # Before the program says that it runs.
        stop_on_signals(service.stop)
        # Whoever reads README sends /motion/teach to port 9310, and a product's feed comes to another.
        teaching = ", also for /motion/teach" if lessons and preset else ""
        ways_in = ", ".join(map(str, [*(each for each in ends.sources if each.place), *ends.controls]))
        answering = ", ".join(map(str, ends.sinks)) or "nobody"
        say(f"listening on {ways_in}{teaching}; answering to {answering}; Ctrl-C ends")
        for server in ends.servers:
            say(f"{server.name}: {server.address}")
        # All objects so far live as long as the program: the collector need not look at them again.
        gc.freeze()
        _run(service, shown, lessons)
        if lessons:
            lessons.close()
        status = service.status()
    lines = summary(status, settings.hop, notes=not isinstance(shown, PlainLines))
    lines += [frames_made(source) for source in ends.sources if isinstance(source, FeedSource)]
    if kept := ends.recording:
        lines.append(f"{options.record}: {kept.written} packets, {kept.failed} could not be written")
    lacking = [note for each in ends.sinks if isinstance(each, MidiSink) and each.is_behind for note in each.notes]
    for line in dict.fromkeys([*lines, *lacking]):
        say(line)
    return 2 if lacking or (lessons and lessons.has_unsaved) else 0


def _made(options: argparse.Namespace, library: Known, joints: SentJoints, classes: Sequence[str] = ()) -> Recognising:
    """Make recognisers that the service's own loop calls, or that work in processes of their own."""
    settings = arguments.settings_of(options)
    if not options.workers:
        views = BackgroundViews()
        return Performers(library, settings, most=options.performers, joints=joints, views=views, classes=classes)
    if isinstance(library, MotionLibrary) and settings.signature is LiveSignature.WINDOWS:
        library = opened(library)
    return Gateway(options.workers, library, Terms(settings, options.performers, joints, tuple(classes)))


def recognisers(options: argparse.Namespace, preset: Preset | None) -> tuple[Recognising, Lessons | None]:
    """Make the recognisers, and the lessons if people may teach."""
    naming, nothing = arguments.naming_of(options), options.library == _NO_LIBRARY
    if nothing and not options.teach:
        raise ValueError("--library none: expected --teach with it")
    if options.joints and preset:
        raise ValueError("--joints: expected no --feed with it; a preset says which joints there are")
    joints = naming.read(arguments.joints_in_order(options.joints)).joints if options.joints else ()
    motions = arguments.library_at(None if nothing else options.library)
    if naming.convention or naming.finds:
        motions = motions.in_our_names(Naming())
    if nothing:
        joints = joints or (preset.joints if preset else ())
    elif preset:
        motions = fitted(motions, f"feed {preset.name}", preset.joints)
    elif joints:
        motions = fitted(motions, "--joints", joints)
    sent = SentJoints(joints, naming)
    if options.teach:
        lessons = _lessons(options, None if nothing else motions, sent)
        return lessons.performers, lessons
    return _made(options, motions, sent), None


def fitted(motions: MotionLibrary, whose: str, joints: Sequence[str]) -> MotionLibrary:
    """Restrict a library to the joints a feed has, and print which.

    Raises
    ------
    SkeletonMismatchError
        Library and feed share fewer than five joints.
    """
    shared, ours = motions.restricted_to(joints), motions.skeleton.joints
    if shared is not motions:
        if further := [name for name in joints if name not in ours]:
            named = "; ".join(f"{name}{meant(name, {*ours} - {*joints})}" for name in further)
            say(f"{whose}: not compared, because the library lacks them: {named}")
        say(f"{whose}: {len(shared.skeleton.joints)} of the library's {len(ours)} joints")
    return shared


def _lessons(options: argparse.Namespace, motions: MotionLibrary | None, sent: SentJoints) -> Lessons:
    """Open the taught library."""

    def performers(index: WindowIndex, classes: Sequence[str]) -> Recognising:
        covers = set(index.library.skeleton.joints) <= set(sent.assumed)
        joints = replace(sent, assumed=sent.assumed if covers else ())
        return _made(options, index, joints, classes)

    # People before a camera seldom think of their sides.
    either_side = bool(options.camera) if options.either_side is None else options.either_side
    lessons = open_lessons(options.teach, motions, sent.assumed, performers, options.stillness, either_side=either_side)
    lessons.is_loud = options.loud_lessons
    return lessons


def _checked(options: argparse.Namespace, settings: Settings) -> Preset | None:
    """Refuse options that need others, and files that cannot be written; add addresses; give the preset of the feed."""
    if options.control and not options.teach:
        raise ValueError("--control: expected --teach with it")
    if options.teach and settings.signature is LiveSignature.PAPER:
        raise ValueError("--teach: expected --signature windows with it, got paper")
    for option, wanted in (("--camera", options.camera), ("--lsl-in", options.lsl_in)):
        if wanted and options.feed:
            raise ValueError(f"{option}: expected no --feed with it; another feed needs a kinespace live of its own")
    if options.camera or options.lsl_in:
        options.osc_in = options.osc_in or arguments.OSC_IN
    midi = [Path(each.partition("=")[2]) for each in options.out if each.startswith(MIDI) and each.endswith(".mid")]
    # `--overwrite` is no leave to write over what this program reads or teaches.
    used = [Path(each).resolve() for each in (options.teach, options.library, options.feed) if each]
    for each in filter(None, (options.record, *midi)):
        require_place_for(each, overwrite=options.overwrite)
        if each.resolve() in used:
            raise ValueError(f"{each}: expected a file for each purpose, got one for several")
        used.append(each.resolve())
    preset = arguments.preset_named(options.feed) if options.feed else None
    if not (options.osc_in or options.zmq_in):
        options.osc_in = f"127.0.0.1:{preset.port}" if preset else arguments.OSC_IN
    if not (options.osc_out or options.zmq_out or options.out):
        options.osc_out = OSC_OUT
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


def _run(service: Service, shown: PlainLines | LiveTable, lessons: Lessons | None) -> None:
    """Run, and draw the table in a second thread: the feed waits at most for the lock, never for a picture."""
    if isinstance(shown, PlainLines):
        service.run()
        return
    loop = threading.Thread(target=service.run, name="kinespace service")
    loop.start()
    try:
        keys = Keys(lessons, shown, service.ask) if lessons else nullcontext()
        with keys, Live(console=console, auto_refresh=False) as live:
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
