"""`kinespace info`: what is in a motion library, or in recordings."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from library import MotionLibrary, distance_rows, find_recordings, read_recordings
from library.recordings import is_recording
from tools.console import console, printable, progress

if TYPE_CHECKING:
    from pathlib import Path

    from library import Reading


def run(file: Path | None, reading: Reading) -> int:
    """Say what a file holds, or a folder's recordings."""
    if file and (is_recording(file) or (file.is_dir() and file.suffix != ".npz")):
        return _tell_recordings(file, reading)
    return _tell_library(file)


def _tell_recordings(place: Path, reading: Reading) -> int:
    """Print a row for each recording and, of a single one, its joints."""
    paths = find_recordings([place])
    table = Table(title=str(place), title_justify="left")
    table.add_column("recording", overflow="fold")
    for heading in ("seconds", "frames/s", "joints", "metres across", "filled in"):
        table.add_column(heading, justify="right")
    for path, clip in zip(paths, progress(read_recordings(paths, reading), "Reading", len(paths)), strict=True):
        across = float(np.median(distance_rows(clip.positions, clip.skeleton).max(axis=1)))
        table.add_row(
            str(path.relative_to(place)) if place.is_dir() else path.name,
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
    """Print a library's motions by class, its skeleton, licence and attribution."""
    library = MotionLibrary.load(file) if file else MotionLibrary.builtin()
    table = Table(title=str(file or "the built-in library"), title_justify="left")
    table.add_column("class", overflow="fold")
    for heading in ("motions", "actors", "seconds", "frames/s", "on the axis"):
        table.add_column(heading, justify="right")
    for class_name, group in groupby(library.motions, key=lambda motion: motion.class_name):
        motions = list(group)
        rates = sorted({motion.frame_rate for motion in motions})
        table.add_row(
            class_name,
            str(len(motions)),
            str(len({motion.actor for motion in motions if motion.actor}) or "?"),
            f"{sum(motion.duration for motion in motions):.1f}",
            ", ".join(f"{rate:g}" for rate in rates),
            f"{sum(motion.share for motion in motions) / len(motions):.0%}",
        )
    console.print(table)
    skeleton = library.skeleton
    console.print(f"{len(library)} motions of {len(skeleton.joints)} joints, {len(skeleton.pairs)} pairs measured")
    console.print(f"licence: {library.licence or 'not stated'}", soft_wrap=True)
    console.print(f"attribution: {library.attribution or 'none'}", soft_wrap=True)
    return 0
