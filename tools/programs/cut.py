"""`kinespace cut`: lists the movements between stillnesses of a recording, for a person to name.

Writes start_s,end_s,label,performer for each movement between two stillnesses, with an empty label. Fill in the
classes; kinespace build --labels makes a library of them. Motions that follow one another without a stillness of half a
second stay one row, to be divided by hand.
"""

import argparse
import csv
import math
from codecs import getwriter
from pathlib import Path

from kinespace.library.library_file import replacing
from kinespace.library.recordings import RecordingReader, find_recordings
from kinespace.stream.teaching.movement import STILLNESS, stretches_of
from kinespace.tools.cli.arguments import add_reading, add_shared, positive, reading_of
from kinespace.tools.cli.console import NameNotes, counted, csv_text, progress, require_place_for, say

COLUMNS = ("start_s", "end_s", "label", "performer")
#: Seconds: a longer row hardly is one motion; HDM05's longest cut clip has eight.
_MAX_SECONDS = 8.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("source", type=Path, metavar="FILE", help="a .kinerec or a motion file")
    text = "the labels to write (default: next to the recording, with its name)"
    parser.add_argument("-o", "--output", type=Path, metavar="CSV", help=text)
    text = "movement, relative to the body, that counts as rest; twice as much begins a motion (default %(default)s)"
    parser.add_argument("--stillness", type=positive, default=STILLNESS, help=text)
    add_shared(parser, "--overwrite", "--feed")
    add_reading(parser)


def run(options: argparse.Namespace) -> None:
    """Propose labels for a recording, every label empty."""
    source = options.source
    labels = options.output or source.with_suffix(".csv")
    if labels == source:
        raise ValueError(f"{source}: expected --output, because the labels would replace the recording")
    require_place_for(labels, overwrite=options.overwrite)
    takes = [*map(NameNotes(), RecordingReader(reading_of(options)).clips(find_recordings([source])[0]))]
    looked = progress(takes, "Looking", len(takes))
    found = sorted((each, take.actor) for take in looked for each in stretches_of(take, options.stillness))
    with replacing(labels) as file:
        rows = csv.writer(getwriter("utf-8")(file))
        rows.writerow(COLUMNS)
        # Rounded inwards: a gap may lie right before or behind a row.
        for each, performer in found:
            start, end = math.ceil(100 * each.start) / 100, math.floor(100 * each.end) / 100
            rows.writerow((f"{start:.2f}", f"{end:.2f}", "", csv_text(performer)))
    whose = ", ".join(take.actor or "one performer" for take in takes)
    many = counted(len(found), "movement")
    say(f"{labels}: {many} of {whose}; write a class behind each; a movement without one is left out")
    long = [each for each, _ in found if each.duration > _MAX_SECONDS]
    if long:
        advice = f"cut at quieter moments by --stillness above {options.stillness:g}"
        what = "divide these rows where the motions change"
        say(f"{len(long)} of them last longer than {_MAX_SECONDS:g} s, without a standstill: {what}, or {advice}")
