"""`kinespace discover`: finds the motions that repeat in recordings without labels, and makes named ones classes.

Cuts recordings of one or several performers where the movement changes, groups what is alike, and writes the groups
into a folder: a page that shows them, a table of all pieces, and a library. Look at the page, then name groups:
kinespace discover -o FOLDER --name 3=bow 5=wave.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from kinespace.library.recordings import RecordingReader, find_recordings, performed
from kinespace.library.teaching import discovery
from kinespace.tools.cli.arguments import add_reading, add_shared, count, mapping, reading_of
from kinespace.tools.programs.recordings import found
from kinespace.tools.terminal.console import printable, progress, progress_console, say
from kinespace.tools.terminal.named_joints import NameNotes
from kinespace.tools.terminal.tables import counted, print_scores

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Sequence

    from kinespace.library import Clip, Reading

#: Groups that the table and the page show.
_SHOWN = 24
_COLUMNS = (
    ("first at", "{where}"),
    ("group", "{group}"),
    ("came", "{came}×"),
    ("seconds", "{seconds:.1f}"),
    ("longest", "{longest:.1f}"),
    ("performers", "{performers}"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("sources", nargs="*", type=Path, metavar="SOURCE", help="recordings, or folders of them")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="the folder to write")
    text = "make these groups classes, in FOLDER/named.npz"
    parser.add_argument("--name", nargs="+", action="extend", type=mapping, default=[], metavar="N=CLASS", help=text)
    text = "with --name: make all other groups examples of `nothing`, of which no motion is named"
    parser.add_argument("--rest-nothing", action="store_true", help=text)
    text = f"how far apart pieces of a group may be (default {discovery.ALIKE}; {discovery.ALIKE_SEVERAL} for persons)"
    parser.add_argument("--alike", type=float, metavar="LOG", help=text)
    text = "groups to show (default %(default)s); all are in FOLDER/pieces.csv"
    parser.add_argument("--most", type=count, default=_SHOWN, metavar="N", help=text)
    add_shared(parser, "--overwrite", "--feed", "--actor-in")
    add_reading(parser)


def run(options: argparse.Namespace) -> int:
    """Find groups, or name those that were found; return the exit status."""
    folder = options.output
    if options.sources:
        _find(options, folder)
    elif not options.name:
        raise ValueError("SOURCE, --name: expected recordings to look into, or names of groups, got neither")
    if options.name:
        library, labels = found.named(folder, dict(options.name), rest_nothing=options.rest_nothing)
        say(
            f"{folder / found.NAMED}: {counted(len(library), 'motion')} of {', '.join(map(printable, library.classes))}"
        )
        say(f"{folder / found.LABELS}: labels of {counted(labels, 'recording')} for kinespace build --labels")
        say(f"recognise them: kinespace live --teach {folder / found.NAMED} --library none")
    return 0


def _find(options: argparse.Namespace, folder: Path) -> None:
    paths = find_recordings(options.sources)
    found.require_room(folder, overwrite=options.overwrite)
    began, seconds, names, pieces = time.perf_counter(), 0.0, list[found.Source](), None
    for path, take in _read(paths, reading_of(options)):
        pieces = pieces or discovery.Pieces(take.skeleton.joints)
        pieces.add(take)
        names.append(found.Source(path.resolve(), take.actor))
        seconds += take.duration
    if pieces is None or not pieces.pieces:
        raise ValueError(f"expected movement in the recordings, got none in {seconds:.0f} s")
    with progress_console.status("Grouping"):
        groups = found.groups_of(pieces, [source.performer for source in names], options.alike)
    found.write(folder, groups, pieces, names, options.most)
    times = seconds / (time.perf_counter() - began)
    rows = []
    for group in groups[: options.most]:
        own = [pieces.pieces[place] for place in group.pieces]
        first = min(own)
        rows.append(
            {
                "where": f"{printable(names[first.take].path.name)} {first.start:.1f} s",
                "group": group.number,
                "came": len(own),
                "seconds": group.seconds,
                "longest": max(piece.seconds for piece in own),
                "performers": len({names[piece.take].performer for piece in own}),
            }
        )
    found_in = f"{counted(len(pieces.pieces), 'piece')} in {counted(len(groups), 'group')}"
    title = f"{found_in}: {seconds / 60:.1f} min of recordings, {times:.0f} × real time"
    print_scores(rows, _COLUMNS, title=title, names=1)
    say(f"name them: kinespace discover -o {folder} --name 1=bow{' 2=wave' if len(rows) > 1 else ''}")
    if further := groups[options.most :]:
        left = counted(sum(len(each.pieces) for each in further), "piece")
        say(f"{counted(len(further), 'further group')} of {left}: {folder / found.TABLE}")
    say(f"look at them: {folder / found.PAGE}")


def _read(paths: Sequence[Path], reading: Reading) -> Iterator[tuple[Path, Clip]]:
    """Read the takes of one recording after the other, over the first one's joints."""
    reader, named, joints = RecordingReader(reading), NameNotes(), None
    for path in progress(paths, "Looking", len(paths)):
        for clip in reader.clips(path):
            take = performed(named(clip), path, reading.actor_in)
            joints = joints or take.skeleton
            if missing := sorted({*joints.joints} - {*take.skeleton.joints}):
                raise ValueError(f"{path}: expected the joints of {paths[0].name}, no {', '.join(missing[:5])}")
            yield path, take.restricted_to(joints.joints).as_of(joints)
