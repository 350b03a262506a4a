"""Recordings read while a person looks on: how far, and whose names their joints had."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinespace.library import find_recordings, read_recordings
from kinespace.library.naming import told
from kinespace.library.recordings import labelled
from kinespace.tools.terminal.console import progress, progress_console

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from kinespace.library import Clip, Reading


class NameTeller:
    """Says, once each, whose names clips' joints had and how many of ours they mean."""

    def __init__(self) -> None:
        self._told = set[str]()

    def __call__(self, clip: Clip) -> Clip:
        """Say it of a clip, where it is news; give the clip."""
        line = told(clip.naming, clip.skeleton.joints) if clip.naming else ""
        if line and line not in self._told:
            self._told.add(line)
            # Not among the results, which another program may read.
            progress_console.print(line, markup=False, highlight=False, soft_wrap=True)
        return clip


def read_and_tell(paths: Sequence[Path], reading: Reading) -> Iterator[Clip]:
    """Read recordings one after the other, showing how many are read, and say whose names their joints had."""
    return progress(map(NameTeller(), read_recordings(paths, reading)), "Reading", len(paths))


def read_labelled(places: Sequence[Path], reading: Reading) -> list[Clip]:
    """Read clips, or folders of them, with the class and the actor that their places tell."""
    paths = find_recordings(places)
    clips = read_and_tell(paths, reading)
    return [labelled(clip, path, reading.actor_in) for clip, path in zip(clips, paths, strict=True)]
