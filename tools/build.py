"""`kinespace build`: recordings in, one motion library file out."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from typing import TYPE_CHECKING

from library import Clip, MotionLibrary, find_recordings, hdm05, read_recordings
from tools.console import console, progress

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path


def run(
    sources: Sequence[Path],
    output: Path,
    *,
    asf: Path | None,
    frame_rate: float | None,
    licence: str | None,
    attribution: str | None,
) -> int:
    """Build a library from recordings and libraries, save it, and say what it holds."""
    libraries = [MotionLibrary.load(source) for source in sources if source.suffix == ".npz"]
    places = [source for source in sources if source.suffix != ".npz"]
    if places:
        paths = find_recordings(places)
        from_hdm05 = all(hdm05.read_clip_name(path) for path in paths)
        clips = _named(read_recordings(paths, asf=asf, frame_rate=frame_rate), paths)
        library = MotionLibrary.of_clips(
            progress(clips, "Reading", len(paths)),
            licence=licence or (hdm05.LICENCE if from_hdm05 else ""),
            attribution=attribution or (hdm05.ATTRIBUTION if from_hdm05 else ""),
        )
        libraries.append(library)
    merged = reduce(MotionLibrary.merged_with, libraries)
    merged.save(output)
    console.print(
        f"{output}: {len(merged)} motions, {len(merged.classes)} classes, {output.stat().st_size / 1e6:.2f} MB"
    )
    return 0


def _named(clips: Iterator[Clip], paths: Sequence[Path]) -> Iterator[Clip]:
    """Give clips whose names tell no class their folder's name."""
    for clip, path in zip(clips, paths, strict=True):
        yield clip if clip.class_name else replace(clip, class_name=path.absolute().parent.name, take=clip.name)
