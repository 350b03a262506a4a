"""The command line: `kinespace <program>`. Parses, calls the program, and turns failures into one line."""

from __future__ import annotations

import argparse
import sys
from importlib.metadata import PackageNotFoundError, version
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING

from kinespace.stream.recognizer import LiveSignature
from kinespace.tools.cli.arguments import (
    OSC_IN,
    add_actor_in,
    add_changes,
    add_inputs,
    add_json,
    add_labels,
    add_library,
    add_overwrite,
    add_reading,
    add_sender,
    add_settings,
    count,
    mapping,
    not_negative,
    positive,
    reading_of,
    settings_of,
    share,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

#: Where answers go when nothing else is said: a port that none of the usual receivers uses.
OSC_OUT = "127.0.0.1:9311"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `kinespace`; give the exit status: 0 done, 1 ended by the user or not answered, 2 could not be done."""
    for stream in (sys.stdout, sys.stderr):
        # A performer's name that this terminal has no characters for must not end a recogniser.
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    parsed = _parser().parse_args(arguments)
    try:
        status: int = parsed.run(parsed)
    except KeyboardInterrupt:
        return 1
    except BrokenPipeError:
        # Whoever read our output has seen enough; say nothing more, at the interpreter's end either.
        sys.stderr.close()
        return 1
    except (OSError, ValueError, ImportError, MemoryError) as error:
        print(f"kinespace: {_one_line(error)}", file=sys.stderr)
        return 2
    return status


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f"{error.filename}: {error.strerror}"
    told = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return " ".join(told.split()) or type(error).__name__


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="kinespace",
        description="Names the movement a performer is doing, live, from joint positions arriving by OSC or ZeroMQ.",
    )
    parser.add_argument("--version", action="version", version=f"kinespace {_version()}")
    programs = parser.add_subparsers(title="programs", required=True, metavar="PROGRAM")
    for add in (
        _add_demo,
        _add_live,
        _add_replay,
        _add_record,
        _add_convert,
        _add_latency,
        _add_cut,
        _add_build,
        _add_learn,
        _add_info,
        _add_evaluate,
        _add_bench,
        _add_feeds,
        _add_listen,
    ):
        add(programs)
    return parser


def _version() -> str:
    try:
        return version("kinespace")
    except PackageNotFoundError:
        return "(not installed)"


Programs = argparse._SubParsersAction  # noqa: SLF001 - argparse has no public name for what add_subparsers returns


def _add_demo(programs: Programs[argparse.ArgumentParser]) -> None:
    demo = programs.add_parser(
        "demo",
        help="the whole loop on this machine, with nothing but the built-in library",
        description="Plays a recorded motion of every class of the built-in library over loopback into a recogniser in "
        "another process, and shows what it answers. The recogniser's library holds none of the motions played. Exit "
        "status: 0 every motion named, 1 one not, 2 could not be done.",
    )
    demo.add_argument("--seconds", type=positive, default=30.0, help="how long in all, at most (default %(default)s)")
    demo.add_argument("--transport", choices=("osc", "zmq"), default="osc")
    demo.add_argument("--picture", type=Path, metavar="SVG", help="write the final table as a picture")
    add_json(demo)
    demo.set_defaults(run=_run_demo)


def _run_demo(parsed: argparse.Namespace) -> int:
    from kinespace.tools.programs import demo  # noqa: PLC0415 - each program loads only what it needs

    return demo.run(parsed.transport, seconds=parsed.seconds, picture=parsed.picture, as_json=parsed.json)


def _add_live(programs: Programs[argparse.ArgumentParser]) -> None:
    live = programs.add_parser(
        "live",
        help="recognise a feed",
        description=f"Recognises frames and publishes answers until Ctrl-C. Unless told otherwise: OSC in on {OSC_IN}, "
        f"out to {OSC_OUT}. A ZeroMQ endpoint is bound; put > before it to connect instead.",
    )
    add_inputs(live)
    live.add_argument("--osc-out", metavar="HOST:PORT", help="send OSC answers there")
    live.add_argument("--zmq-out", metavar="ENDPOINT", help="publish ZeroMQ answers")
    live.add_argument("--feed", metavar="NAME", help="frames are another product's: see kinespace feeds; or FILE.toml")
    add_sender(live)
    live.add_argument(
        "--out",
        action="append",
        default=[],
        metavar="NAME[=HOST:PORT]",
        help="answer as touchdesigner, max, wekinator, vmc-thru, vrchat or native hear it; sender:PORT replies",
    )
    live.add_argument(
        "--joints",
        metavar="A,B,...",
        help="what frames hold, in order, whose sender never names their joints: the library's names, or a preset that "
        "lists them, like kinectv2, or FILE.toml (default: the library's joints)",
    )
    add_library(live)
    add_settings(live)
    live.add_argument("--performers", type=int, default=32, help="how many at once, at most (default %(default)s)")
    live.add_argument("--record", type=Path, metavar="FILE", help="keep every packet that comes, for replay")
    add_overwrite(live)
    live.add_argument(
        "--teach", type=Path, metavar="FILE", help="let people teach motions by showing them, and keep them there"
    )
    live.add_argument(
        "--control",
        action="append",
        default=[],
        metavar="wekinator|ENDPOINT",
        help="also obey Wekinator's control messages (=HOST:PORT; 6448), or ZeroMQ requests, like tcp://127.0.0.1:9330",
    )
    live.add_argument(
        "--allow-from", action="append", default=[], metavar="HOST", help="who may teach beside this machine"
    )
    live.add_argument("--plain", action="store_true", help="print a line per change instead of a table")
    live.set_defaults(run=_run_live)


def _run_live(parsed: argparse.Namespace) -> int:
    from kinespace.tools.programs import live  # noqa: PLC0415 - as above

    none_given = not any((parsed.osc_in, parsed.osc_out, parsed.zmq_in, parsed.zmq_out))
    usual_out = not (parsed.osc_out or parsed.zmq_out or parsed.out)
    usual_in = none_given and not parsed.feed
    addresses = live.Addresses(
        osc_in=OSC_IN if usual_in else parsed.osc_in,
        osc_out=OSC_OUT if usual_out else parsed.osc_out,
        zmq_in=parsed.zmq_in,
        zmq_out=parsed.zmq_out,
    )
    return live.run(
        addresses,
        library=parsed.library,
        settings=settings_of(parsed),
        most=parsed.performers,
        plain=parsed.plain,
        record=parsed.record,
        overwrite=parsed.overwrite,
        feed=live.Feed(parsed.feed, parsed.sender, tuple(parsed.out), parsed.joints),
        teaching=live.Teaching(parsed.teach, tuple(parsed.control), tuple(parsed.allow_from)),
    )


def _add_replay(programs: Programs[argparse.ArgumentParser]) -> None:
    replay = programs.add_parser(
        "replay",
        help="send recorded files, or the built-in library's motions, as a fake live feed",
        description="Sends recordings as live packets on an absolute schedule. With --listen it hears the answers and "
        "prints the share that was right; a clip's class is in its name (HDM05) or is its folder's name. Exit "
        "status: 0 sent (and, with --listen, answered), 1 with --listen and without any answer, 2 could not be done.",
    )
    replay.add_argument(
        "clips",
        nargs="*",
        type=Path,
        metavar="CLIP|CLASS",
        help="recordings, folders of them, or classes of the built-in library, whose motions are played; or one "
        ".kinerec (default: all motions of the built-in library)",
    )
    add_reading(replay)
    replay.add_argument("--osc", metavar="HOST:PORT", help=f"send OSC there (default {OSC_IN})")
    replay.add_argument(
        "--zmq", metavar="ENDPOINT", help="publish on ZeroMQ instead; connects, put @ before it to bind"
    )
    replay.add_argument("--listen", metavar="ADDRESS", help="HOST:PORT or ZeroMQ endpoint where the answers come")
    replay.add_argument("--performer", default="replay", help="who performs (default %(default)s)")
    replay.add_argument("--speed", type=positive, default=1.0, help="times as fast as recorded (default %(default)s)")
    replay.add_argument("--pause", type=not_negative, default=1.0, help="seconds between clips (default %(default)s)")
    replay.add_argument("--from", type=not_negative, default=0.0, dest="begin", metavar="S", help="begin there")
    replay.add_argument("--to", type=positive, dest="end", metavar="S", help="end there, seconds of each recording")
    replay.add_argument("--loop", action="store_true", help="begin again after the last clip, until Ctrl-C")
    replay.add_argument("--drop", type=share, default=0.0, metavar="SHARE", help="lose this share of frames")
    replay.add_argument("--jitter-ms", type=not_negative, default=0.0, metavar="MS", help="be late by up to this")
    replay.add_argument("--reorder", type=share, default=0.0, metavar="SHARE", help="swap this share with the next")
    replay.add_argument("--seed", type=int, default=0, help="of the faults (default %(default)s)")
    add_json(replay)
    replay.set_defaults(run=_run_replay)


def _run_replay(parsed: argparse.Namespace) -> int:
    from kinespace.tools.programs import replay  # noqa: PLC0415 - as above

    faults = replay.Faults(drop=parsed.drop, jitter=parsed.jitter_ms / 1000, reorder=parsed.reorder, seed=parsed.seed)
    return replay.run(
        parsed.clips,
        reading=reading_of(parsed),
        osc_to=parsed.osc or (None if parsed.zmq else OSC_IN),
        zmq_to=parsed.zmq,
        listen=parsed.listen,
        course=replay.Course(
            parsed.performer,
            speed=parsed.speed,
            pause=parsed.pause,
            loop=parsed.loop,
            begin=parsed.begin,
            end=parsed.end,
        ),
        faults=faults,
        as_json=parsed.json,
    )


def _add_record(programs: Programs[argparse.ArgumentParser]) -> None:
    record = programs.add_parser(
        "record",
        help="keep a feed's packets as they come, to replay them",
        description="Keeps every packet with its arrival time and sender until Ctrl-C. A crash costs the last second "
        "at most. kinespace replay sends the file again bit for bit; kinespace live --record keeps what it hears.",
    )
    record.add_argument("output", type=Path, metavar="FILE", help="to make, like tonight.kinerec")
    add_inputs(record)
    record.add_argument("--seconds", type=positive, help="how long (default: until Ctrl-C)")
    add_overwrite(record)
    record.set_defaults(run=_run_record)


def _run_record(parsed: argparse.Namespace) -> int:
    from kinespace.tools.programs import record  # noqa: PLC0415 - as above

    osc_in = parsed.osc_in or (None if parsed.zmq_in else OSC_IN)
    return record.run(
        parsed.output, osc_in=osc_in, zmq_in=parsed.zmq_in, seconds=parsed.seconds, overwrite=parsed.overwrite
    )


def _add_convert(programs: Programs[argparse.ArgumentParser]) -> None:
    convert = programs.add_parser(
        "convert",
        help="a raw recording or a motion file as plain numbers",
        description="Writes times and joint positions (seconds, metres) as .npz, or as CSV with a line for each frame.",
    )
    convert.add_argument("source", type=Path, metavar="FILE", help="a .kinerec or a motion file")
    convert.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="ending in .npz or .csv")
    convert.add_argument("--performer", help="whose frames, where there are several performers")
    add_overwrite(convert)
    _add_recorded_feed(convert)
    add_reading(convert)
    convert.set_defaults(run=_run_convert)


def _run_convert(parsed: argparse.Namespace) -> int:
    from kinespace.tools.programs import convert  # noqa: PLC0415 - as above

    return convert.run(
        parsed.source,
        parsed.output,
        performer=parsed.performer,
        feed=parsed.feed,
        reading=reading_of(parsed),
        overwrite=parsed.overwrite,
    )


def _add_recorded_feed(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--feed",
        metavar="NAME",
        help="read a .kinerec as this product's, see kinespace feeds; or FILE.toml (default: what it says of itself)",
    )


def _add_latency(programs: Programs[argparse.ArgumentParser]) -> None:
    latency = programs.add_parser(
        "latency",
        help="measure frame sent to answer received, beside a bare echo",
        description="Feeds a recogniser in another process over loopback and times its answers; the same packets go "
        "to a bare echo in the same run.",
    )
    latency.add_argument("--transport", choices=("osc", "zmq", "both"), default="both")
    latency.add_argument("--rate", type=positive, default=120.0, help="frames per second (default %(default)s)")
    latency.add_argument("--seconds", type=positive, default=20.0, help="of each run (default %(default)s)")
    add_settings(latency)
    latency.add_argument("--json", action="store_true", help="print one JSON object; needs one --transport")
    latency.set_defaults(run=_run_latency)


def _run_latency(parsed: argparse.Namespace) -> int:
    from kinespace.tools.programs import latency  # noqa: PLC0415 - as above

    if parsed.json and parsed.transport == "both":
        raise ValueError("--json: expected --transport osc or zmq with it, got both")
    return latency.run(
        ("osc", "zmq") if parsed.transport == "both" else (parsed.transport,),
        rate_hz=parsed.rate,
        seconds=parsed.seconds,
        settings=settings_of(parsed),
        as_json=parsed.json,
    )


def _add_cut(programs: Programs[argparse.ArgumentParser]) -> None:
    cut = programs.add_parser(
        "cut",
        help="propose labels for a recording: a row for each movement",
        description="Writes start_s,end_s,label,performer for each movement between two stillnesses, each label empty: "
        "fill in the classes, and kinespace build --labels makes a library of them.",
    )
    cut.add_argument("source", type=Path, metavar="FILE", help="a .kinerec or a motion file")
    cut.add_argument("-o", "--output", type=Path, metavar="CSV", help="default: beside the recording, called like it")
    cut.add_argument(
        "--stillness", type=positive, default=0.01, help="movement, relative to the body, of who stands still (0.01)"
    )
    add_overwrite(cut)
    _add_recorded_feed(cut)
    add_reading(cut)
    cut.set_defaults(run=_run_cut)


def _run_cut(parsed: argparse.Namespace) -> int:
    from kinespace.tools.programs import cut  # noqa: PLC0415 - as above

    return cut.run(
        parsed.source,
        parsed.output,
        reading=reading_of(parsed),
        stillness=parsed.stillness,
        overwrite=parsed.overwrite,
    )


def _add_build(programs: Programs[argparse.ArgumentParser]) -> None:
    build = programs.add_parser(
        "build",
        help="make a motion library from recordings and other libraries",
        description="Puts the motions of recordings and library files together, over the joints that all of them have. "
        "A recording's class is in its name (HDM05) or is its folder's name.",
    )
    build.add_argument("sources", nargs="+", type=Path, metavar="SOURCE", help="folders, recordings or libraries")
    build.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="the library to write")
    add_overwrite(build)
    add_changes(build)
    add_labels(build, "for each recording, in order: cut it into these motions")
    _add_recorded_feed(build)
    add_reading(build)
    add_actor_in(build)
    build.add_argument("--licence", help="terms of the recordings (default: HDM05's, of those that are named so)")
    build.add_argument("--attribution", help="whom to name (default: HDM05's, of those that are named so)")
    build.set_defaults(run=_run_build)


def _run_build(parsed: argparse.Namespace) -> int:
    from kinespace.tools.programs import build  # noqa: PLC0415 - as above

    return build.run(
        parsed.sources,
        parsed.output,
        nothing=parsed.nothing,
        labels=parsed.labels,
        reading=reading_of(parsed),
        terms=build.Terms(parsed.licence, parsed.attribution),
        changes=build.Changes(parsed.without, dict(parsed.rename)),
        overwrite=parsed.overwrite,
    )


def _add_learn(programs: Programs[argparse.ArgumentParser]) -> None:
    learn = programs.add_parser(
        "learn",
        help="teach a library what is unknown, by takes of strangers",
        description="Fits the numbers that tell known motion from unknown, by takes in which nothing known happens and "
        "takes that contain a known motion, and keeps them in the library's file.",
    )
    learn.add_argument("library", type=Path, metavar="LIBRARY", help="a library file")
    learn.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="the library to write")
    add_overwrite(learn)
    learn.add_argument(
        "--takes",
        dest="tables",
        nargs="+",
        type=Path,
        required=True,
        metavar="CSV",
        help="file,subject,contains,perhaps for each take; one with neither of the last shows nothing known",
    )
    for option, told in (("--subjects", "of these persons only"), ("--without-subjects", "not of these persons")):
        learn.add_argument(option, nargs="+", action="extend", default=[], metavar="NAME", help=f"takes {told}")
    add_reading(learn)
    add_json(learn)
    learn.set_defaults(run=_run_learn)


def _run_learn(parsed: argparse.Namespace) -> int:
    from kinespace.tools.evaluation import learn, takes  # noqa: PLC0415 - as above

    return learn.run(
        parsed.library,
        parsed.output,
        takes.Sources(tables=parsed.tables, persons=parsed.subjects, without_persons=parsed.without_subjects),
        reading=reading_of(parsed),
        overwrite=parsed.overwrite,
        as_json=parsed.json,
    )


def _add_info(programs: Programs[argparse.ArgumentParser]) -> None:
    info = programs.add_parser("info", help="say what is in a motion library or in recordings")
    info.add_argument(
        "file", nargs="?", type=Path, metavar="FILE", help="a library, a recording or a folder (default: built-in)"
    )
    _add_recorded_feed(info)
    add_reading(info)
    info.set_defaults(run=_run_info)


def _run_info(parsed: argparse.Namespace) -> int:
    from kinespace.tools.programs import info  # noqa: PLC0415 - as above

    return info.run(parsed.file, reading_of(parsed), feed=parsed.feed)


def _add_evaluate(programs: Programs[argparse.ArgumentParser]) -> None:
    evaluate = programs.add_parser("evaluate", help="measure how often the right class is found")
    kinds = evaluate.add_subparsers(title="experiments", required=True, metavar="EXPERIMENT")
    _add_evaluate_retrieval(kinds)
    _add_evaluate_stream(kinds)
    _add_evaluate_noise(kinds)
    _add_evaluate_teach(kinds)


def _add_evaluate_retrieval(kinds: Programs[argparse.ArgumentParser]) -> None:
    retrieval = kinds.add_parser(
        "retrieval",
        help="the paper's experiment: every motion's nearest neighbour, in three spaces",
        description="For every motion, counts whether its nearest other motion is of its class, and whether one of the "
        "two nearest is, in the spaces of joint distances, joint positions and joint rotations.",
    )
    retrieval.add_argument(
        "folder",
        nargs="*",
        type=Path,
        metavar="FOLDER",
        help="recordings, or folders of them (default: the built-in library's motions, which have no rotations)",
    )
    add_reading(retrieval)
    add_actor_in(retrieval)
    retrieval.add_argument("--space", choices=("distances", "positions", "rotations"), help="default: all")
    retrieval.add_argument("--signature", choices=("eigenvector", "spread"), help="default: both, for distances")
    retrieval.add_argument("--protocol", choices=("leave-one-out", "actor-held-out", "split"), help="default: all")
    retrieval.add_argument(
        "--skeleton",
        nargs="+",
        default=[],
        metavar="NAME",
        help="what these products' joints keep of it, like kinectv2",
    )
    retrieval.add_argument("--turned", action="store_true", help="first turn and shift every clip by chance")
    retrieval.add_argument("--seed", type=int, default=0, help="of --turned (default %(default)s)")
    retrieval.add_argument(
        "--picture",
        type=Path,
        metavar="FILE",
        help="draw the confusion matrices; their numbers go beside it as CSV",
    )
    retrieval.add_argument(
        "--json",
        action="store_true",
        help="print one JSON object and nothing else (default: distances, eigenvector, leave-one-out)",
    )
    retrieval.set_defaults(run=_run_retrieval)


def _add_evaluate_stream(kinds: Programs[argparse.ArgumentParser]) -> None:
    stream = kinds.add_parser(
        "stream",
        help="takes through the live recogniser, causally",
        description="Replays takes through the very recogniser that runs live, at full speed and without sockets, and "
        "compares what was published at each moment with what was performed at that moment.",
    )
    stream.add_argument(
        "takes",
        nargs="*",
        type=Path,
        metavar="TAKE",
        help="labelled takes, clips named as HDM05's, or folders of them (default: the library's own motions)",
    )
    stream.add_argument(
        "--takes",
        dest="tables",
        nargs="+",
        action="extend",
        type=Path,
        default=[],
        metavar="CSV",
        help="file,subject,contains,perhaps for each take; one with neither of the last shows nothing known",
    )
    stream.add_argument(
        "--unknown",
        nargs="+",
        action="extend",
        type=Path,
        default=[],
        metavar="TAKE",
        help="recordings in which nothing known happens, or folders of them",
    )
    stream.add_argument("--clips", action="store_true", help="a recording without labels is one motion, of its folder")
    add_reading(stream)
    add_actor_in(stream)
    add_labels(stream, "for each TAKE, in order (default: beside the take, ending in .csv)")
    add_library(stream)
    stream.add_argument(
        "--protocol",
        choices=("library", "leave-one-take-out", "leave-one-person-out", "one-person"),
        default="library",
        help="recognise with the library; with what is cut from the other takes, or from the other persons' takes; or "
        "with what is cut from one person's, for each person in turn",
    )
    for option, told in (("--subjects", "of these persons only"), ("--without-subjects", "not of these persons")):
        stream.add_argument(option, nargs="+", action="extend", default=[], metavar="NAME", help=f"takes {told}")
    stream.add_argument(
        "--map", nargs="+", action="extend", type=mapping, default=[], metavar="LABEL=CLASS", help="rename labels"
    )
    stream.add_argument("--skeleton", metavar="NAME", help="with the joints of this product alone, like kinectv2")
    add_settings(stream)
    stream.add_argument(
        "--without-part",
        choices=("eigen", "spread", "posture", "trend"),
        help="leave these parts of the signature out, to see what they are worth",
    )
    stream.add_argument("--timeline", type=Path, metavar="FILE", help="draw what was performed and answered over time")
    stream.add_argument("--confusion", type=Path, metavar="FILE", help="draw what was answered to what")
    add_json(stream)
    stream.set_defaults(run=_run_evaluate_stream)


def _run_evaluate_stream(parsed: argparse.Namespace) -> int:
    from kinespace.library.windows.parts import Kind  # noqa: PLC0415 - as above
    from kinespace.tools.evaluation import evaluate_stream, protocols, takes  # noqa: PLC0415 - as above

    return evaluate_stream.run(
        takes.Sources(
            parsed.takes,
            parsed.labels,
            clips=parsed.clips,
            unknown=parsed.unknown,
            tables=parsed.tables,
            names=dict(parsed.map),
            persons=parsed.subjects,
            without_persons=parsed.without_subjects,
            skeleton=parsed.skeleton,
        ),
        reading=reading_of(parsed),
        library=parsed.library,
        protocol=protocols.Protocol(parsed.protocol),
        settings=settings_of(parsed),
        without=Kind(parsed.without_part) if parsed.without_part else None,
        drawn=evaluate_stream.Pictures(parsed.timeline, parsed.confusion),
        as_json=parsed.json,
    )


def _add_evaluate_noise(kinds: Programs[argparse.ArgumentParser]) -> None:
    noise = kinds.add_parser(
        "noise",
        help="motions as a noisy sensor sees them, each left out of the library that names it",
        description="Plays motions at 30 frames per second with white noise on every coordinate into the live "
        "recogniser. Motions are left out of the library in groups, so that none is named by itself.",
    )
    noise.add_argument(
        "folder",
        nargs="*",
        type=Path,
        metavar="FOLDER",
        help="clips, or folders of them (default: the built-in library's motions)",
    )
    add_reading(noise)
    add_actor_in(noise)
    noise.add_argument(
        "--noise",
        nargs="+",
        type=not_negative,
        default=[0.0, 10.0, 20.0, 30.0],
        metavar="MM",
        help="standard deviations on each coordinate (default: 0 10 20 30)",
    )
    noise.add_argument("--groups", type=count, default=12, help="how many, at least two (default %(default)s)")
    noise.add_argument("--seed", type=int, default=0, help="of the noise (default %(default)s)")
    noise.add_argument("--skeleton", metavar="NAME", help="with the joints of this product alone, like kinectv2")
    add_settings(noise)
    add_json(noise)
    noise.set_defaults(run=_run_evaluate_noise)


def _run_evaluate_noise(parsed: argparse.Namespace) -> int:
    from kinespace.tools.evaluation import evaluate_noise  # noqa: PLC0415 - as above

    return evaluate_noise.run(
        parsed.folder,
        reading=reading_of(parsed),
        noises=parsed.noise,
        groups=parsed.groups,
        seed=parsed.seed,
        skeleton=parsed.skeleton,
        settings=settings_of(parsed),
        as_json=parsed.json,
    )


def _add_evaluate_teach(kinds: Programs[argparse.ArgumentParser]) -> None:
    teach = kinds.add_parser(
        "teach",
        help="what a few examples of one person teach",
        description="Draws examples of one person's motions, makes a library of them, and replays what was recorded "
        "apart from them, of the same person and of others, through the live recogniser.",
    )
    teach.add_argument(
        "takes",
        nargs="*",
        type=Path,
        metavar="TAKE",
        help="labelled takes, clips named as HDM05's, or folders of them (default: the built-in library's motions)",
    )
    add_labels(teach, "for each TAKE, in order (default: beside the take, ending in .csv)")
    teach.add_argument("--clips", action="store_true", help="a recording without labels is one motion, of its folder")
    add_reading(teach)
    add_actor_in(teach)
    teach.add_argument(
        "--person", default="", help="who performs in all takes, where nothing else says it (default: as they say)"
    )
    teach.add_argument(
        "--examples", nargs="+", type=count, default=[1, 2, 3], metavar="N", help="of each class (default: 1 2 3)"
    )
    teach.add_argument("--draws", type=count, default=20, help="of each person's examples (default %(default)s)")
    teach.add_argument("--seed", type=int, default=0, help="of the draws (default %(default)s)")
    teach.add_argument("--beside", action="store_true", help="teach beside the built-in library, which must give way")
    add_settings(teach)
    add_json(teach)
    teach.set_defaults(run=_run_evaluate_teach)


def _run_evaluate_teach(parsed: argparse.Namespace) -> int:
    from kinespace.tools.evaluation import evaluate_teach, takes  # noqa: PLC0415 - as above

    return evaluate_teach.run(
        takes.Sources(parsed.takes, parsed.labels, clips=parsed.clips),
        reading=reading_of(parsed),
        person=parsed.person,
        examples=parsed.examples,
        draws=parsed.draws,
        seed=parsed.seed,
        beside=parsed.beside,
        settings=settings_of(parsed),
        as_json=parsed.json,
    )


def _run_retrieval(parsed: argparse.Namespace) -> int:
    from kinespace.tools.evaluation import evaluate_retrieval  # noqa: PLC0415 - as above

    return evaluate_retrieval.run_retrieval(
        parsed.folder,
        reading=reading_of(parsed),
        space=parsed.space,
        signature=parsed.signature,
        protocol=parsed.protocol,
        skeletons=parsed.skeleton,
        turned_by=parsed.seed if parsed.turned else None,
        picture=parsed.picture,
        as_json=parsed.json,
    )


def _add_bench(programs: Programs[argparse.ArgumentParser]) -> None:
    bench = programs.add_parser(
        "bench",
        help="measure what everything costs, beside what a user would take instead",
        description="Times every step, the alternatives, growth, sockets and a long run, on real motions and one core. "
        "pip install kinespace[bench] lets it keep linear algebra to one thread. Everything takes an hour.",
    )
    parts = ("stages", "peers", "growth", "sockets", "soak")
    bench.add_argument("part", nargs="?", choices=(*parts, "all"), default="all", help="default: %(default)s")
    bench.add_argument(
        "--data",
        type=Path,
        metavar="FOLDER",
        help="play two minutes of these recordings (default: motions of the built-in library)",
    )
    bench.add_argument(
        "--signature",
        choices=[str(signature) for signature in LiveSignature],
        help="of which the figures of --json, growth and sockets tell (default: the recogniser's own)",
    )
    bench.add_argument("--rounds", type=count, default=9, help="medians are of so many (default %(default)s)")
    bench.add_argument("--seconds", type=positive, default=20.0, help="of a latency run (default %(default)s)")
    bench.add_argument("--frames", type=count, default=24 * 3600 * 120, help="of soak (default: a day, %(default)s)")
    bench.add_argument(
        "--minutes", type=not_negative, default=10.0, help="of soak over sockets, 0 for none (default %(default)s)"
    )
    bench.add_argument("--picture", type=Path, metavar="FILE", help="draw what was found")
    add_json(bench)
    bench.set_defaults(run=_run_bench)


def _run_bench(parsed: argparse.Namespace) -> int:
    from kinespace.tools.bench import run  # noqa: PLC0415 - as above

    return run.run(
        run.PARTS if parsed.part == "all" else (parsed.part,),
        data=parsed.data,
        signature=LiveSignature(parsed.signature) if parsed.signature else None,
        effort=run.Effort(rounds=parsed.rounds, seconds=parsed.seconds, frames=parsed.frames, minutes=parsed.minutes),
        picture=parsed.picture,
        as_json=parsed.json,
    )


def _add_feeds(programs: Programs[argparse.ArgumentParser]) -> None:
    feeds = programs.add_parser("feeds", help="list the products whose feeds are understood, and what to set in them")
    feeds.add_argument("name", nargs="?", metavar="NAME", help="print this preset, to be copied and edited")
    feeds.set_defaults(run=_run_feeds)


def _run_feeds(parsed: argparse.Namespace) -> int:
    from kinespace.tools.programs import feeds  # noqa: PLC0415 - as above

    return feeds.run(parsed.name)


def _add_listen(programs: Programs[argparse.ArgumentParser]) -> None:
    listen = programs.add_parser(
        "listen",
        help="show what arrives on a port, guess the feed, say what is missing",
        description="The first thing to try when nothing works: shows every kind of message that arrives, its types, "
        "rate, senders and gaps, which feed it looks like, which joints came, and what recognition lacks.",
    )
    listen.add_argument("port", nargs="?", metavar="[HOST:]PORT", help=f"default: the feed's port, else {OSC_IN}")
    listen.add_argument("--feed", metavar="NAME", help="look at it as this feed, and ask for it where it must be asked")
    add_sender(listen)
    listen.add_argument("--seconds", type=positive, default=5.0, help="how long (default %(default)s)")
    add_json(listen)
    listen.set_defaults(run=_run_listen)


def _run_listen(parsed: argparse.Namespace) -> int:
    from kinespace.tools.programs import listen  # noqa: PLC0415 - as above

    address = parsed.port or (None if parsed.feed else OSC_IN)
    return listen.run(address, feed=parsed.feed, sender=parsed.sender, seconds=parsed.seconds, as_json=parsed.json)
