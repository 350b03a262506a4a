"""`kinespace build`: recordings in, one motion library file out."""

from __future__ import annotations

import errno
import os
from dataclasses import replace
from functools import reduce
from typing import TYPE_CHECKING

from library import Clip, MotionLibrary, find_recordings, hdm05, read_recordings
from library.labels import cut, read_labels
from library.windowtable import Comparison
from tools.console import console, progress

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

#: People from whom it can be learned what differs between people doing the same.
_TEACHERS = 3


def run(
    sources: Sequence[Path],
    output: Path,
    *,
    labels: Sequence[Path],
    asf: Path | None,
    frame_rate: float | None,
    licence: str | None,
    attribution: str | None,
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
    asf, frame_rate
        Of all recordings; as they say themselves when not given.
    licence, attribution
        Of the numbers; HDM05's when not given and all recordings are named so.
    """
    if labels and not any(source.suffix != ".npz" for source in sources):
        raise ValueError("--labels: expected recordings to cut, got libraries only")
    _require_place_for(output)
    libraries = [MotionLibrary.load(source) for source in sources if source.suffix == ".npz"]
    places = [source for source in sources if source.suffix != ".npz"]
    if places:
        paths = find_recordings(places)
        from_hdm05 = all(hdm05.read_clip_name(path) for path in paths)
        recordings = read_recordings(paths, asf=asf, frame_rate=frame_rate)
        clips = progress(recordings, "Reading", len(paths))
        clips = _cut(clips, paths, labels) if labels else _named(clips, paths)
        known = list(clips)
        library = MotionLibrary.of_clips(
            known,
            comparison=_comparison(known),
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
    return 0


def _comparison(clips: Sequence[Clip]) -> Comparison | None:
    """Choose how windows are compared: as several people's clips teach, else as the built-in library does.

    Several people teach when there are three of them and two share a class. A skeleton of other joints than the
    built-in library's, performed by too few, leaves whole motions only.
    """
    people = {clip.actor for clip in clips if clip.actor}
    performed = {(clip.class_name, clip.actor) for clip in clips if clip.actor}
    if len(people) >= _TEACHERS and len(performed) > len({class_name for class_name, _ in performed}):
        return Comparison.learned(clips)
    builtin = MotionLibrary.builtin()
    same = clips[0].skeleton.joints == builtin.skeleton.joints
    return builtin.windows.comparison if same and builtin.windows else None


def _require_place_for(output: Path) -> None:
    """Refuse a place that cannot be written to before an archive is read for it, by its own name."""
    if output.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(output))
    if not output.absolute().parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(output.parent))


def _named(clips: Iterator[Clip], paths: Sequence[Path]) -> Iterator[Clip]:
    """Give clips whose names tell no class their folder's name."""
    for clip, path in zip(clips, paths, strict=True):
        yield clip if clip.class_name else replace(clip, class_name=path.absolute().parent.name, take=clip.name)


def _cut(takes: Iterator[Clip], paths: Sequence[Path], labels: Sequence[Path]) -> Iterator[Clip]:
    """Cut each take into the segments its labels name; their label is their class."""
    if len(labels) != len(paths):
        raise ValueError(f"--labels: expected one for each of {len(paths)} recordings, got {len(labels)}")
    for take, file in zip(takes, labels, strict=True):
        yield from cut(take, read_labels(file))
