"""`kinespace info`: what is in a motion library."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

from rich.table import Table

from library import MotionLibrary
from tools.console import console

if TYPE_CHECKING:
    from pathlib import Path


def run(file: Path | None) -> int:
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
