"""Recorded files of any format we read, found in folders and opened by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from library import acclaim

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from library.clip import Clip

_ENDINGS = (".amc",)


class RecordingError(ValueError):
    """A recording cannot be found or used; the message names it."""


def find_recordings(places: Sequence[Path]) -> list[Path]:
    """List the recordings under some folders (at any depth) and files, sorted within each folder, each once.

    Raises
    ------
    RecordingError
        A place does not exist, or no recording is in any of them.
    """
    found = list[Path]()
    for place in places:
        if not place.exists():
            raise RecordingError(f"{place}: no such file or folder")
        if place.is_dir():
            found += sorted(path for path in place.rglob("*") if path.suffix.lower() in _ENDINGS and not path.is_dir())
        else:
            found.append(place)
    if not found:
        raise RecordingError(f"{', '.join(map(str, places))}: no recording ({', '.join(_ENDINGS)}) in it")
    return list(dict.fromkeys(found))


def read_recordings(
    paths: Sequence[Path], *, asf: Path | None = None, frame_rate: float | None = None
) -> Iterator[Clip]:
    """Read recordings one after the other, each skeleton once.

    Parameters
    ----------
    paths
        Files, as `find_recordings` lists them.
    asf
        The skeleton of all AMC files; each one's own, found by name, when not given.
    frame_rate
        Frames per second of all of them; what each says of itself when not given.

    Raises
    ------
    RecordingError
        A file of a kind we do not read.
    AcclaimError
        A file that cannot be used.
    OSError
        A file that cannot be opened.
    """
    bodies = dict[Path, acclaim.AcclaimSkeleton]()
    for path in paths:
        if path.suffix.lower() not in _ENDINGS:
            raise RecordingError(
                f"{path}: expected a recording ({', '.join(_ENDINGS)}), got {path.suffix or 'no ending'}"
            )
        skeleton_file = asf or acclaim.find_asf(path)
        if skeleton_file not in bodies:
            bodies[skeleton_file] = acclaim.read_asf(skeleton_file)
        yield acclaim.read_clip(path, bodies[skeleton_file], frame_rate=frame_rate)
