"""`kinespace convert`: writes a raw recording or a motion file as plain numbers, `.npz` or CSV.

Writes times and joint positions (seconds, metres) as .npz, or as CSV with a line for each frame.
"""

import argparse
import codecs
import csv
import tempfile
from array import array
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Reading, Skeleton, find_recordings
from kinespace.library.library_file import replacing
from kinespace.library.recordings import RecordingReader
from kinespace.stream.feeds import Preset
from kinespace.stream.inputs.kinerec import ENDING, RawFile
from kinespace.stream.inputs.takes import decoded, ordered_frames, seen_in
from kinespace.tools.cli.arguments import add_reading, add_shared, preset_named, reading_of
from kinespace.tools.cli.console import NameNotes, csv_text, progress, require_place_for, say
from kinespace.tools.cli.values import printable

#: A frame's time in seconds and its positions, (joints, 3), metres.
_Posture = tuple[float, "NDArray[np.floating]"]


#: The body and the name of a performer, the number of frames that were seen, and the frames, one after the other.
_Motion = tuple[Skeleton, str, int, Iterator[_Posture]]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("source", type=Path, metavar="FILE", help="a .kinerec or a motion file")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="ends in .npz or .csv")
    parser.add_argument("--performer", help="the performer to convert, if there are several")
    add_shared(parser, "--overwrite", "--feed")
    add_reading(parser)


def run(options: argparse.Namespace) -> None:
    """Convert a file, frame by frame.

    An `.npz` holds `time` (frames,), seconds; `positions` (frames, joints, 3), metres; `joints`; `parents`, empty when
    they are not known; and `performer`. A `.csv` has a column for the time and three for each joint.
    """
    source, output, feed = options.source, options.output, options.feed
    if source.is_dir():
        raise ValueError(f"{source}: expected one recording, got a folder")
    write = {".csv": _write_csv, ".npz": _write_npz}.get(output.suffix.lower())
    if write is None:
        raise ValueError(f"{output}: expected a file that ends in .npz or .csv")
    require_place_for(output, overwrite=options.overwrite)
    damage = ""
    if source.suffix.lower() == ENDING:
        recording = RawFile(source)
        motion = _of_raw(recording, options.performer, preset_named(feed) if feed else None)
        damage = recording.damage()
    elif feed:
        raise ValueError(f"--feed: expected a {ENDING} file with it, got {source}")
    else:
        motion = _of_file(source, reading_of(options), options.performer)
    skeleton, performer, seen, postures = motion
    frames, joints = write(output, skeleton, performer, progress(postures, "Writing", seen)), len(skeleton.joints)
    refused = seen - frames
    left_out = f", {refused} frames of other joints left out" if refused else ""
    say(f"{output}: {frames} frames of {joints} joints{left_out}")
    if damage:
        say(damage)


def _of_file(source: Path, reading: Reading, performer: str | None) -> _Motion:
    clips = {clip.actor: clip for clip in RecordingReader(reading).clips(find_recordings([source])[0])}
    clip = NameNotes()(clips[_chosen(source, [*clips], performer if len(clips) > 1 else None)])
    return clip.skeleton, clip.actor, clip.frames, zip(clip.times.tolist(), clip.positions, strict=True)


def _chosen(path: Path, performing: Sequence[str], performer: str | None) -> str:
    """Give the performer that is asked for, or the only one."""
    if performer is None and len(performing) > 1:
        raise ValueError(f"{path}: expected --performer, one of {', '.join(map(printable, performing))}")
    chosen = performer if performer is not None else next(iter(performing), "")
    if chosen not in performing:
        raise ValueError(f"{path}: no frame{f' of {chosen!r}' if chosen else ''} in it")
    return chosen


def _of_raw(recording: RawFile, performer: str | None, preset: Preset | None) -> _Motion:
    """Look through a recording once for its performers, then give one performer's frames."""
    seen = seen_in(progress(decoded(recording.header, recording.packets(), preset), "Looking", None))
    chosen = _chosen(recording.path, [name for name, each in seen.items() if each.frames], performer)
    skeleton, frames = seen[chosen].skeleton(), ordered_frames(recording, preset, {chosen: seen[chosen]})
    postures = ((seconds, positions) for _, _, seconds, positions in frames)
    first = next(postures, None)
    if first is None:
        raise ValueError(f"{recording.path}: no frame of {chosen!r} has the {len(skeleton.joints)} announced joints")
    return skeleton, chosen, seen[chosen].frames, chain([first], postures)


def _write_csv(output: Path, skeleton: Skeleton, _: str, postures: Iterator[_Posture]) -> int:
    frames = 0
    with replacing(output) as file:
        rows = csv.writer(codecs.getwriter("utf-8")(file))
        rows.writerow(["time", *(csv_text(f"{joint}_{axis}") for joint in skeleton.joints for axis in "xyz")])
        for moment, positions in postures:
            # Nine digits give every 32-bit number back exactly.
            rows.writerow([repr(float(moment)), *(f"{number:.9g}" for number in positions.ravel().tolist())])
            frames += 1
    return frames


def _write_npz(output: Path, skeleton: Skeleton, performer: str, postures: Iterator[_Posture]) -> int:
    """Write the arrays piece by piece: positions go to a scratch file first, and from there into the zip."""
    times = array("d")
    with tempfile.TemporaryFile(dir=output.absolute().parent) as scratch:
        for moment, positions in postures:
            times.append(moment)
            scratch.write(np.ascontiguousarray(positions, dtype="<f8").tobytes())
        scratch.flush()
        shape = (len(times), len(skeleton.joints), 3)
        positions = np.memmap(scratch, dtype="<f8", mode="r", shape=shape)
        with replacing(output) as file:
            np.savez(
                file,
                allow_pickle=False,
                time=np.array(times),
                positions=positions,
                joints=np.array(skeleton.joints),
                parents=np.array(skeleton.parents, dtype=np.int64),
                performer=np.array(performer),
            )
    return len(times)
