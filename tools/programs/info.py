"""`kinespace info`: describes a motion library, or recordings.

Counts the motions of a library, or of a folder of recordings, by class and by person. Describes a single recording, or
a .kinerec.
"""

import argparse
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinespace.library import Clip, MotionLibrary, Reading, compiled, distance_rows, opened
from kinespace.library.recordings import find_recordings, instead_of_recording, is_recording, labelled, read_recordings
from kinespace.library.windows.courses import without_course
from kinespace.stream.feeds import Preset, builtin_names, builtin_preset
from kinespace.stream.inputs.kinerec import ENDING, RawFile, RawPacket
from kinespace.stream.inputs.takes import decoded, seen_in
from kinespace.stream.recognizer.fitting import TITLES, kinds_of
from kinespace.tools.cli import arguments
from kinespace.tools.cli.console import NameNotes, console, print_json, progress, say, scores_of

#: Headings of listed recordings and of a library's listed motions, and the form of each cell.
_LASTING = "seconds {seconds:.1f} | Hz {frame_rate:g}"
_MEASURED = "joints {joints} | metres across {metres_across:.2f} | filled in {filled:.1%}"
_OF_RECORDINGS = f"recording {{name}} | {_LASTING} | {_MEASURED}"
_OF_LIBRARY = f"class {{class}} | person {{person}} | take {{take}} | {_LASTING}"
#: Frame rates that are listed, at most.
_MOST_RATES = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    text = f"a library, a recording, a folder, or a class of the built-in library (default: {arguments.BUILT_IN})"
    parser.add_argument("file", nargs="?", type=Path, metavar="FILE|CLASS", help=text)
    parser.add_argument("--clips", action="store_true", help="list every motion or recording too")
    arguments.add_shared(parser, "--json", "--feed", "--actor-in")
    arguments.add_reading(parser)


def run(options: argparse.Namespace) -> None:
    """Describe a library or recordings."""
    file, feed = options.file, options.feed
    if feed and not (file and file.suffix.lower() == ENDING):
        raise ValueError(f"--feed: expected a {ENDING} file with it, got {file or 'none'}")
    show: Callable[[Mapping[str, Any]], None]
    if file and file.suffix.lower() == ENDING:
        described, show = _raw(file, arguments.preset_named(feed) if feed else None), _show_raw
    elif file and (is_recording(file) or (file.is_dir() and file.suffix != ".npz")):
        described, show = _recordings(file, arguments.reading_of(options), clips=options.clips), _show_recordings
    elif file and file.is_file() and file.suffix != ".npz":
        raise ValueError(f"{file}: expected a recording or a library, got {instead_of_recording(file)}")
    else:
        described, show = _library(file, clips=options.clips), _show_library
    if options.json:
        print_json(described)
    else:
        show(described)


# --- raw recordings ---


def _raw(file: Path, preset: Preset | None) -> dict[str, Any]:
    """Look through a raw recording: its senders with packets, its performers with frames, and whether it is cut off."""
    recording = RawFile(file)
    senders, arrivals = Counter[str](), list[float]()

    def noting() -> Iterator[RawPacket]:
        for packet in progress(recording.packets(), "Reading", None):
            senders[f"{recording.header.sources[packet.source]} from {packet.sender or 'unnamed senders'}"] += 1
            # The first and the last.
            arrivals[1 if arrivals else 0 :] = [packet.arrival]
            yield packet

    seen = seen_in(decoded(recording.header, noting(), preset))
    return {
        "file": str(file),
        "recorded": recording.header.began,
        "seconds": arrivals[-1] - arrivals[0] if arrivals else 0.0,
        "packets": senders,
        "presets": {
            name: name in builtin_names() and text == builtin_preset(name).text
            for name, text in recording.header.presets.items()
        },
        "frames": {name: each.frames for name, each in seen.items()},
        "damage": recording.damage() or None,
    }


def _show_raw(described: Mapping[str, Any]) -> None:
    say(f"{described['file']}: recorded {described['recorded']}, {described['seconds']:.1f} s")
    for sender, count in described["packets"].items():
        say(f"{sender}: {count} packets")
    for name, same in described["presets"].items():
        say(f"preset {name}: kept in the recording, {'same as' if same else 'other than'} the built-in one")
    for performer, count in described["frames"].items():
        say(f"performer {performer}: {count} frames")
    if described["damage"]:
        say(described["damage"])


# --- libraries and folders ---


def _row(clip: Clip, name: str) -> dict[str, Any]:
    """Describe one motion of a library, or one recording, without its positions."""
    named = {"name": name, "class": clip.class_name, "person": clip.actor, "take": clip.take}
    return {**named, "seconds": round(clip.duration, 3), "frame_rate": clip.frame_rate}


def _sums(motions: Sequence[Mapping[str, Any]], what: str, other: str, others: str) -> list[dict[str, Any]]:
    """Sum up motions by class or by person: number, number of the other names, seconds, frame rates."""
    groups = defaultdict[str, list[Mapping[str, Any]]](list)
    for motion in motions:
        groups[motion[what]].append(motion)
    sums = list[dict[str, Any]]()
    for name, group in sorted(groups.items()):
        seconds, rates = sum(each["seconds"] for each in group), sorted({each["frame_rate"] for each in group})
        named = {what: name, "motions": len(group), others: len({each[other] for each in group} - {""})}
        sums.append({**named, "seconds": round(seconds, 3), "frame_rates": rates})
    return sums


def _summed_up(motions: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {
        "motions": len(motions),
        "seconds": round(sum(each["seconds"] for each in motions), 3),
        "classes": _sums(motions, "class", "person", "persons"),
        "persons": _sums(motions, "person", "class", "classes"),
    }


def _show_sums(title: str, rows: Sequence[Mapping[str, Any]], what: str, others: str) -> None:
    """Print a table of classes or of persons."""
    indexed = " | index {index}" if any("index" in row for row in rows) else ""
    figures = f"motions {{motions}} | {others} {{{others}}} | seconds {{seconds:.1f}} | Hz {{rates}}"
    shown = [
        {**row, what: row[what] or "?", others: row[others] or "?"}
        | {"rates": _in_short([*dict.fromkeys(f"{rate:g}" for rate in row["frame_rates"])])}
        for row in rows
    ]
    console.print(scores_of(shown, f"{what} {{{what}}}{indexed} | {figures}", title=title))


def _in_short(rates: Sequence[str]) -> str:
    """List few rates, ascending; of many the first and the last."""
    return ", ".join(rates) if len(rates) <= _MOST_RATES else f"{rates[0]} to {rates[-1]}"


def _recordings(place: Path, reading: Reading, *, clips: bool) -> dict[str, Any]:
    """Read recordings and sum them up; list them if there is one, or if asked for."""
    paths = find_recordings([place])
    names = [str(path.relative_to(place)) if place.is_dir() else path.name for path in paths]
    motions, listed = list[dict[str, Any]](), list[dict[str, Any]]()
    joints = dict[str, None]()
    every = progress(map(NameNotes(), read_recordings(paths, reading)), "Reading", len(paths))
    for name, path, read in zip(names, paths, every, strict=True):
        clip = labelled(read, path, reading.actor_in)
        joints |= dict.fromkeys(clip.skeleton.joints)
        motions.append(_row(clip, name))
        if clips or len(paths) == 1:
            # A few frames at a time: all pairs of all frames take many times the recording's memory.
            parts = np.array_split(clip.positions, 1 + clip.frames * len(clip.skeleton.pairs) // 1_000_000)
            across = float(np.median(np.concatenate([distance_rows(p, clip.skeleton).max(axis=1) for p in parts])))
            measured = {
                "joints": len(clip.skeleton.joints),
                "metres_across": round(across, 3),
                "filled": round(clip.filled / (clip.frames * len(clip.skeleton.joints)), 4),
            }
            listed.append(motions[-1] | measured)
    described = {"place": str(place), **_summed_up(motions), "joints": list(joints)}
    return described | ({"clips": listed} if listed else {})


def _show_recordings(described: Mapping[str, Any]) -> None:
    """Print recordings: a single one as a row with its joints; of several the sums, and their rows if asked for."""
    if "clips" in described:
        console.print(scores_of(described["clips"], _OF_RECORDINGS, title=described["place"]))
    if described["motions"] > 1:
        _show_sums(described["place"], described["classes"], "class", "persons")
        _show_sums("", described["persons"], "person", "classes")
        say(f"recordings: {described['motions']}, {described['seconds']:.0f} s")
    say(f"joints: {len(described['joints'])}: {', '.join(described['joints'])}")


def _library(file: Path | None, *, clips: bool) -> dict[str, Any]:
    """Sum up a library's motions, or a class of the built-in one; give its joints, licence and attribution."""
    chosen = arguments.class_at(file) if file and file != arguments.BUILT_IN and not file.suffix else ""
    library = arguments.library_at(None if chosen else file)
    kept = [clip for clip in library.motions if chosen in ("", clip.class_name)]
    motions = [_row(clip, f"{clip.class_name} {clip.actor} {clip.take}".strip()) for clip in kept]
    indices = {name: index for index, name in enumerate(library.classes)}
    described = {"library": str(file or arguments.BUILT_IN), **_summed_up(motions)}
    described["classes"] = [{**row, "index": indices.get(row["class"])} for row in described["classes"]]
    described |= {
        "joints": list(library.skeleton.joints),
        "sources": list(dict.fromkeys(each.source for each in kept if each.source)),
        "arithmetic": compiled.kind(),
        "licence": library.licence,
        "attribution": library.attribution,
        "feeds": sorted(kinds_of(library)),
        "without_course": without_course(kept),
        "missed": {} if chosen else _missed(library),
    }
    return described | ({"clips": motions} if clips else {})


def _missed(library: MotionLibrary) -> dict[str, float]:
    """Give for some false alarms an hour the share of a library's own motions that others' do not find."""
    try:
        courses = opened(library).courses
    except ValueError:
        # No motion is long enough for a window.
        return {}
    shares = {f"{each:g}": courses.missed_at(each) for each in (1.0, 6.0, 60.0)}
    return {each: round(share, 3) for each, share in shares.items() if not math.isnan(share)}


def _show_library(described: Mapping[str, Any]) -> None:
    """Print a library's classes with their indices, its persons, joints, licence and attribution."""
    if "clips" in described:
        clips = [each | {"person": each["person"] or "?"} for each in described["clips"]]
        console.print(scores_of(clips, _OF_LIBRARY, title=described["library"], names=3))
    _show_sums(described["library"], described["classes"], "class", "persons")
    _show_sums("", described["persons"], "person", "classes")
    classes = sum(row["index"] is not None for row in described["classes"])
    persons = [row["person"] for row in described["persons"] if row["person"]]
    say(f"motions: {described['motions']} of {classes} classes, {described['seconds']:.0f} s")
    say(f"persons: {', '.join(persons) or 'not stated'}")
    say(f"joints: {len(described['joints'])}: {', '.join(described['joints'])}")
    say(f"sources: {', '.join(described['sources']) or 'not stated'}")
    say(f"taught by: {', '.join(TITLES[each] for each in described['feeds'])}")
    say(f"arithmetic: {described['arithmetic']}")
    say(f"licence: {described['licence'] or 'not stated'}")
    say(f"attribution: {described['attribution'] or 'none'}")
    for each, share in described["missed"].items():
        say(f"done, ≤ {each}/h false: {share:.0%} of these motions missed")
    if lacking := described["without_course"]:
        say(f"too short, or one posture, to be found done: {', '.join(lacking)}")
