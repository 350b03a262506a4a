"""`kinespace info`: what is in a motion library, or in recordings."""

from __future__ import annotations

from collections import Counter
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from kinespace.library import MotionLibrary, distance_rows, find_recordings
from kinespace.library.kernels import compiled
from kinespace.library.recordings import is_recording
from kinespace.stream.feeds import builtin_names, builtin_preset
from kinespace.stream.frame import Frame
from kinespace.stream.recording import decoded
from kinespace.stream.recording.kinerec import ENDING, RawFile
from kinespace.tools.cli.arguments import add_reading, add_recorded_feed, reading_of
from kinespace.tools.programs.feeds import preset_named
from kinespace.tools.terminal.console import console, printable, progress
from kinespace.tools.terminal.named_joints import read_and_tell
from kinespace.tools.terminal.tables import add_names, narrow_table

#: Characters that the figures beside names of recordings, and of classes, need.
_BESIDE_RECORDINGS, _BESIDE_CLASSES = 34, 52

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

    from kinespace.library import Reading
    from kinespace.stream.feeds import Preset
    from kinespace.stream.recording.kinerec import RawPacket


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument(
        "file", nargs="?", type=Path, metavar="FILE", help="a library, a recording or a folder (default: built-in)"
    )
    add_recorded_feed(parser)
    add_reading(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    return describe(options.file, reading_of(options), feed=options.feed)


def describe(file: Path | None, reading: Reading, *, feed: str | None = None) -> int:
    """Say what a file holds, or a folder's recordings.

    Parameters
    ----------
    file
        A library, a recording or a folder; None for the built-in library.
    reading
        How motion files are read.
    feed
        Name or file of the preset that a raw recording's packets are read by; None for what it says of itself.
    """
    if feed and not (file and file.suffix.lower() == ENDING):
        raise ValueError(f"--feed: expected a {ENDING} file with it, got {file or 'none'}")
    if file and file.suffix.lower() == ENDING:
        return _tell_raw(file, preset_named(feed) if feed else None)
    if file and (is_recording(file) or (file.is_dir() and file.suffix != ".npz")):
        return _tell_recordings(file, reading)
    return _tell_library(file)


def _tell_raw(file: Path, preset: Preset | None) -> int:
    """Print what a raw recording holds and, if it is cut off, where."""
    recording = RawFile(file)
    senders, performers = Counter[str](), Counter[str]()
    arrivals = list[float]()

    def noting() -> Iterator[RawPacket]:
        for packet in progress(recording.packets(), "Reading", None):
            senders[f"{recording.header.sources[packet.source]} from {packet.sender or 'unnamed senders'}"] += 1
            # The first and the last.
            arrivals[1 if arrivals else 0 :] = [packet.arrival]
            yield packet

    for each in decoded(recording.header, noting(), preset):
        performers.update(event.performer for event in each.events if isinstance(event, Frame))
    console.print(f"{file}: recorded {recording.header.began}, {arrivals[-1] - arrivals[0] if arrivals else 0:.1f} s")
    for sender, count in senders.items():
        console.print(f"{printable(sender)}: {count} packets", soft_wrap=True)
    for name, text in recording.header.presets.items():
        same = name in builtin_names() and text == builtin_preset(name).text
        console.print(
            f"preset {printable(name)}: kept in the recording, {'as' if same else 'not as'} it is built in",
            soft_wrap=True,
        )
    for performer, count in performers.items():
        console.print(f"performer {printable(performer)}: {count} frames", soft_wrap=True)
    if recording.damage():
        console.print(recording.damage(), soft_wrap=True)
    return 0


def _tell_recordings(place: Path, reading: Reading) -> int:
    """Print a row for each recording and, of a single one, its joints."""
    paths = find_recordings([place])
    table = narrow_table(str(place))
    table.padding = 0
    names = [str(path.relative_to(place)) if place.is_dir() else path.name for path in paths]
    add_names(table, "recording", names, beside=_BESIDE_RECORDINGS)
    for heading in ("seconds", "Hz", "joints", "metres across", "filled in"):
        table.add_column(heading, justify="right")
    for name, clip in zip(names, read_and_tell(paths, reading), strict=True):
        across = float(np.median(distance_rows(clip.positions, clip.skeleton).max(axis=1)))
        table.add_row(
            name,
            f"{clip.duration:.1f}",
            f"{clip.frame_rate:g}",
            str(len(clip.skeleton.joints)),
            f"{across:.2f}",
            f"{clip.filled / (clip.frames * len(clip.skeleton.joints)):.1%}",
        )
    console.print(table)
    if len(paths) == 1:
        console.print(f"joints: {', '.join(map(printable, clip.skeleton.joints))}", soft_wrap=True)
    return 0


def _tell_library(file: Path | None) -> int:
    """Print a library's classes with their indices and motions, its joints, licence and attribution."""
    library = MotionLibrary.load(file) if file else MotionLibrary.builtin()
    by_class = {name: list(group) for name, group in groupby(library.motions, key=lambda motion: motion.class_name)}
    table = Table(title=str(file or "the built-in library"), title_justify="left")
    table.add_column("index", justify="right")
    add_names(table, "class", by_class, beside=_BESIDE_CLASSES)
    for heading in ("motions", "persons", "seconds", "Hz"):
        table.add_column(heading, justify="right")
    indices = {name: str(index) for index, name in enumerate(library.classes)}
    for name, motions in by_class.items():
        rates = sorted({motion.frame_rate for motion in motions})
        table.add_row(
            # What is answered "unknown" has none.
            indices.get(name, ""),
            printable(name),
            str(len(motions)),
            str(len({motion.actor for motion in motions if motion.actor}) or "?"),
            f"{sum(motion.duration for motion in motions):.1f}",
            ", ".join(f"{rate:g}" for rate in rates),
        )
    console.print(table)
    seconds = sum(motion.duration for motion in library.motions)
    told = {
        "motions": f"{len(library)} of {len(library.classes)} classes, {seconds:.0f} s",
        "persons": ", ".join(library.actors) or "not stated",
        "joints": f"{len(library.skeleton.joints)}: {', '.join(library.skeleton.joints)}",
        "sources": ", ".join(dict.fromkeys(each.source for each in library.motions if each.source)) or "not stated",
        "arithmetic": compiled.kind(),
        "licence": library.licence or "not stated",
        "attribution": library.attribution or "none",
    }
    for heading, text in told.items():
        console.print(f"{heading}: {printable(text)}", soft_wrap=True)
    return 0
