"""`kinespace convert`: writes a raw recording or a motion file as plain numbers, `.npz` or CSV."""

from __future__ import annotations

import csv
import os
import tempfile
from array import array
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import find_recordings
from kinespace.library.recordings import RecordingReader
from kinespace.stream.frame import Announcement
from kinespace.stream.inputs.recording.kinerec import ENDING, RawFile
from kinespace.tools.cli.arguments import (
    add_library,
    add_overwrite,
    add_reading,
    add_recorded_feed,
    library_at,
    reading_of,
)
from kinespace.tools.feeding.followed import Followed
from kinespace.tools.feeding.raw_takes import JointOrder, events_of, seen_in
from kinespace.tools.programs.feeds import preset_named
from kinespace.tools.terminal.console import console, printable, progress
from kinespace.tools.terminal.named_joints import NameTeller
from kinespace.tools.terminal.output_path import require_place_for
from kinespace.tools.terminal.tables import csv_text

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from kinespace.library import Clip, MotionLibrary, Reading
    from kinespace.library.skeleton import Skeleton
    from kinespace.stream.feeds import Preset
    from kinespace.tools.feeding.raw_takes import Seen

#: A frame's time in seconds and its positions, (joints, 3), metres.
_Posture = tuple[float, "NDArray[np.floating]"]


@dataclass(slots=True)
class _Motion:
    """Frames of one performer, one after the other; their number is known if they were counted."""

    skeleton: Skeleton
    performer: str
    frames: int | None
    postures: Iterator[_Posture]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Writes times and joint positions (seconds, metres) as .npz, or as CSV with a line for each frame. Of a folder "
        "every recording is converted."
    )
    parser.add_argument(
        "source", type=Path, metavar="FILE|FOLDER", help="a .kinerec, a motion file, or a folder of them"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="FILE|FOLDER",
        help="a file that ends in .npz or .csv; for a folder, the folder to write to",
    )
    parser.add_argument("--csv", action="store_true", help="for a folder: write CSV (default: .npz)")
    parser.add_argument("--performer", help="the performer to convert, if there are several")
    parser.add_argument(
        "--progress",
        action="store_true",
        help="recognise the motions, and write into the .npz how far in its motion each frame is",
    )
    add_library(parser)
    add_overwrite(parser)
    add_recorded_feed(parser)
    add_reading(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    ending = ".csv" if options.csv else ".npz"
    if options.source.is_dir():
        pairs = _in_folder(options.source, options.output, ending)
    elif options.csv:
        raise ValueError(f"--csv: expected a folder to convert with it, got {options.source}")
    else:
        pairs = [(options.source, options.output)]
    if options.library and not options.progress:
        raise ValueError(f"--library: expected --progress with it, got {options.library}")
    library = library_at(options.library) if options.progress else None
    for source, output in pairs:
        convert(
            source,
            output,
            library=library,
            performer=options.performer,
            feed=options.feed,
            reading=reading_of(options),
            overwrite=options.overwrite,
        )
    return 0


def _in_folder(folder: Path, output: Path, ending: str) -> list[tuple[Path, Path]]:
    """Pair each recording of a folder with the file to write, in the same layout below another, new folder."""
    if output.suffix.lower() in (".npz", ".csv"):
        raise ValueError(f"--output: expected a folder to write to, because {folder} is a folder, got {output}")
    if output.resolve() == folder.resolve():
        raise ValueError(f"--output: expected another folder than {folder}")
    found = [path for path in find_recordings([folder]) if output.resolve() not in path.resolve().parents]
    pairs = [(path, (output / path.relative_to(folder)).with_suffix(ending)) for path in found]
    written = {target for _, target in pairs}
    if len(written) < len(pairs):
        # Two files that differ only in their endings would become one.
        pairs = [(path, target.with_name(path.name + ending)) for path, target in pairs]
    for _, target in pairs:
        target.parent.mkdir(parents=True, exist_ok=True)
    return pairs


def convert(
    source: Path,
    output: Path,
    *,
    performer: str | None,
    feed: str | None,
    reading: Reading,
    overwrite: bool,
    library: MotionLibrary | None = None,
) -> None:
    """Convert one file, frame by frame.

    Parameters
    ----------
    source
        A raw recording or a motion file.
    output
        The file to write, ending in `.npz` (`time` (frames,), seconds; `positions` (frames, joints, 3), metres;
        `joints`; `parents`, empty when they are not known; `performer`) or `.csv` (a column for the time and three for
        each joint).
    performer
        The performer, if a raw recording has several.
    feed
        Name or file of the preset for a raw recording's packets; None for the preset that the recording names.
    reading
        How to read a motion file.
    overwrite
        Whether a file that is there may be written over.
    library
        The library that recognises the motions, so that an `.npz` holds the progress of each frame
        (`kinespace.tools.feeding.followed`); None for none.
    """
    if library and output.suffix.lower() != ".npz":
        raise ValueError(f"--progress: expected a file that ends in .npz, got {output}")
    if output.suffix.lower() not in (".npz", ".csv"):
        raise ValueError(f"{output}: expected a file that ends in .npz or .csv")
    require_place_for(output, overwrite=overwrite)
    damage = ""
    if source.suffix.lower() == ENDING:
        recording = RawFile(source)
        motion, refused = _of_raw(recording, performer, preset_named(feed) if feed else None)
        damage = recording.damage()
    elif feed:
        raise ValueError(f"--feed: expected a {ENDING} file with it, got {source}")
    else:
        motion, refused = _of_file(source, reading), 0
    motion.postures = progress(motion.postures, "Writing", motion.frames)
    followed = Followed(library, motion.skeleton.joints) if library else None
    if followed:
        motion.postures = followed.watch(motion.postures)
    frames = _write_csv(output, motion) if output.suffix.lower() == ".csv" else _write_npz(output, motion, followed)
    console.print(
        f"{output}: {frames} frames of {len(motion.skeleton.joints)} joints"
        + (f", {refused} frames of other joints left out" if refused else ""),
        soft_wrap=True,
    )
    if damage:
        console.print(damage, soft_wrap=True)


def _of_file(source: Path, reading: Reading) -> _Motion:
    clips = _clips(find_recordings([source])[0], reading)
    first = next(clips)
    return _Motion(first.skeleton, first.actor, None, _postures_of(chain([first], clips)))


def _clips(path: Path, reading: Reading) -> Iterator[Clip]:
    with RecordingReader(reading) as reader:
        yield from map(NameTeller(), reader.pieces(path))


def _postures_of(clips: Iterable[Clip]) -> Iterator[_Posture]:
    """Give the frames of clips that follow each other."""
    start = 0
    for clip in clips:
        times = np.arange(start, start + clip.frames) / clip.frame_rate
        start += clip.frames
        yield from zip(times.tolist(), clip.positions, strict=True)


def _of_raw(recording: RawFile, performer: str | None, preset: Preset | None) -> tuple[_Motion, int]:
    """Look through a recording once for its performers, then give one performer's frames, and how many are left out."""
    seen = seen_in(progress(events_of(recording, preset), "Looking", None))
    performing = [name for name, each in seen.items() if each.frames]
    if performer is None and len(performing) > 1:
        raise ValueError(f"{recording.path}: expected --performer, one of {', '.join(map(printable, performing))}")
    chosen = performer if performer is not None else next(iter(performing), "")
    if chosen not in performing:
        raise ValueError(f"{recording.path}: no frame{f' of {chosen!r}' if chosen else ''} in it")
    skeleton = seen[chosen].skeleton()
    frames = sum(1 for _ in _postures(recording, preset, chosen, seen[chosen]))
    if not frames:
        raise ValueError(f"{recording.path}: no frame of {chosen!r} has the {len(skeleton.joints)} announced joints")
    motion = _Motion(skeleton, chosen, frames, _postures(recording, preset, chosen, seen[chosen]))
    return motion, seen[chosen].frames - frames


def _postures(recording: RawFile, preset: Preset | None, performer: str, seen: Seen) -> Iterator[_Posture]:
    order, clock = JointOrder(seen.skeleton()), seen.times()
    for arrival, event in events_of(recording, preset):
        if event.performer != performer:
            continue
        if isinstance(event, Announcement):
            order.announce(event)
            continue
        seconds = clock.read(event.time, arrival)
        if (positions := order.ordered(event)) is not None:
            yield seconds, positions


def _write_csv(output: Path, motion: _Motion) -> int:
    frames = 0
    with _replacing(output) as part, part.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["time", *(csv_text(f"{joint}_{axis}") for joint in motion.skeleton.joints for axis in "xyz")])
        for moment, positions in motion.postures:
            # Nine digits give every 32-bit number back exactly.
            rows.writerow([repr(float(moment)), *(f"{number:.9g}" for number in positions.ravel().tolist())])
            frames += 1
    return frames


def _write_npz(output: Path, motion: _Motion, followed: Followed | None) -> int:
    """Write the arrays piece by piece: positions go to a scratch file first, and from there into the zip."""
    times = array("d")
    with tempfile.TemporaryFile(dir=output.absolute().parent) as scratch:
        for moment, positions in motion.postures:
            times.append(moment)
            scratch.write(np.ascontiguousarray(positions, dtype="<f8").tobytes())
        scratch.flush()
        shape = (len(times), len(motion.skeleton.joints), 3)
        positions = np.memmap(scratch, dtype="<f8", mode="r", shape=shape)
        with _replacing(output) as part, part.open("wb") as file:
            np.savez(
                file,
                allow_pickle=False,
                time=np.array(times),
                positions=positions,
                joints=np.array(motion.skeleton.joints),
                parents=np.array(motion.skeleton.parents, dtype=np.int64),
                performer=np.array(motion.performer),
                **(followed.arrays() if followed else {}),
            )
    return len(times)


@contextmanager
def _replacing(output: Path) -> Iterator[Path]:
    """Give a file to write beside the output, which takes its place when it is whole."""
    handle, name = tempfile.mkstemp(dir=output.absolute().parent, prefix=f".{output.name}.", suffix=".part")
    os.close(handle)
    part = Path(name)
    try:
        yield part
        mask = os.umask(0)
        os.umask(mask)
        part.chmod(0o666 & ~mask)
        part.replace(output)
    finally:
        part.unlink(missing_ok=True)
