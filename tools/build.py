"""`kinespace build`: recordings in, one motion library file out."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

from library import Clip, MotionLibrary, find_recordings, hdm05, read_recordings
from library.comparison import Comparison
from library.labels import cut, read_labels
from library.recordings import labelled
from library.rigidtree import with_parents
from tools.console import console, progress
from tools.output import require_place_for

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from library import Reading

#: People from whom it can be learned what differs between people doing the same.
_TEACHERS = 3
#: Seconds that one motion hardly lasts; HDM05's longest cut clip has eight.
_LONG = 15.0


def run(
    sources: Sequence[Path],
    output: Path,
    *,
    labels: Sequence[Path],
    reading: Reading,
    licence: str | None,
    attribution: str | None,
    overwrite: bool,
) -> int:
    """Build a library from recordings and libraries, save it, and say what it holds.

    Parameters
    ----------
    sources
        Folders, recordings and library files.
    output
        The file to write.
    labels
        For each recording, in their order, what is performed when: its segments become the motions. None: each
        recording is one motion.
    reading
        How recordings are read.
    licence, attribution
        Of the numbers; HDM05's when not given and all recordings are named so.
    overwrite
        Whether a file that is there may be written over.
    """
    if labels and not any(source.suffix != ".npz" for source in sources):
        raise ValueError("--labels: expected recordings to cut, got libraries only")
    require_place_for(output, overwrite=overwrite)
    told = list[str]()
    libraries = [MotionLibrary.load(source) for source in sources if source.suffix == ".npz"]
    places = [source for source in sources if source.suffix != ".npz"]
    if places:
        paths = find_recordings(places)
        from_hdm05 = all(hdm05.read_clip_name(path) for path in paths)
        takes = progress(read_recordings(paths, reading), "Reading", len(paths))
        clips = list(_cut(takes, paths, labels) if labels else _labelled(takes, paths, reading))
        known = with_parents([clip.as_of(clips[0].skeleton) for clip in clips])
        comparison = _comparison(known)
        told = _lacking(known, comparison)
        if not labels:
            told += _long(known)
        library = MotionLibrary.of_clips(
            known,
            comparison=comparison,
            licence=licence or (hdm05.LICENCE if from_hdm05 else ""),
            attribution=attribution or (hdm05.ATTRIBUTION if from_hdm05 else ""),
        )
        libraries.append(library.portrayed(known))
    merged = reduce(MotionLibrary.merged_with, libraries)
    merged.save(output)
    console.print(
        f"{output}: {len(merged)} motions, {len(merged.classes)} classes, {output.stat().st_size / 1e6:.2f} MB",
        soft_wrap=True,
    )
    for line in told:
        console.print(line, soft_wrap=True)
    return 0


def _comparison(clips: Sequence[Clip]) -> Comparison | None:
    """Choose how windows are compared: as several people's clips teach, else as the built-in library does.

    Several people teach when there are three of them and two share a class. A skeleton with joints that the built-in
    library's has not, performed by too few, leaves whole motions only.
    """
    people = {clip.actor for clip in clips if clip.actor}
    performed = {(clip.class_name, clip.actor) for clip in clips if clip.actor}
    if len(people) >= _TEACHERS and len(performed) > len({class_name for class_name, _ in performed}):
        return Comparison.learned(clips)
    return MotionLibrary.builtin().comparison_for(clips[0].skeleton)


def _lacking(clips: Sequence[Clip], comparison: Comparison | None) -> list[str]:
    """Say what the recordings lacked, and what the library will lack."""
    told = list[str]()
    filled = sum(clip.filled for clip in clips)
    if filled:
        every = sum(clip.frames * len(clip.skeleton.joints) for clip in clips)
        told.append(f"{filled} of {every} joint positions were missing and stand on straight lines")
    if comparison is None:
        told.append(
            "whole motions only, no windows: the joints are not the built-in library's, and how people differ must be "
            f"learned from {_TEACHERS} of them or more who share classes (--actor-in says where their names stand)"
        )
    return told


def _long(clips: Sequence[Clip]) -> list[str]:
    """Say that takes which look like several motions were taken as one each."""
    long = [clip for clip in clips if clip.duration > _LONG]
    if not long:
        return []
    longest = max(long, key=lambda clip: clip.duration)
    told = (
        f"{len(long)} of {len(clips)} recordings are longer than {_LONG:g} s, {longest.name} ({longest.duration:.0f} s)"
    )
    return [f"{told} the longest; each is taken as one motion: --labels cuts takes into theirs"]


def _labelled(clips: Iterator[Clip], paths: Sequence[Path], reading: Reading) -> Iterator[Clip]:
    for clip, path in zip(clips, paths, strict=True):
        yield labelled(clip, path, reading.actor_in)


def _cut(takes: Iterator[Clip], paths: Sequence[Path], labels: Sequence[Path]) -> Iterator[Clip]:
    """Cut each take into the segments its labels name; their label is their class."""
    if len(labels) != len(paths):
        raise ValueError(f"--labels: expected one for each of {len(paths)} recordings, got {len(labels)}")
    for take, file in zip(takes, labels, strict=True):
        yield from cut(take, read_labels(file))
