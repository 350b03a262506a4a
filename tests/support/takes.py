"""Continuous labelled takes made by the tests: a body with two arms does one motion after another."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from synthetic import TinyBody, TinyBone, amc_text

#: A trunk with a head, and two arms of two bones.
PUPPET = TinyBody(
    (
        TinyBone("head", direction=(0.0, 1.0, 0.0), dof=()),
        TinyBone("larm"),
        TinyBone("lhand", parent="larm", dof=("rz",)),
        TinyBone("rarm", direction=(-1.0, 0.0, 0.0)),
        TinyBone("rhand", parent="rarm", direction=(-1.0, 0.0, 0.0), dof=("rz",)),
    )
)
#: Degrees that each bone swings about z, by motion.
MOTIONS = {
    "clap": {"larm": 40.0, "rarm": -40.0},
    "hail": {"rhand": 60.0},
    "row": {"lhand": 60.0, "rhand": 60.0},
    "salute": {"lhand": 60.0},
}
FRAME_RATE = 120

#: A motion and its seconds.
Part = tuple[str, float]


def write_take(
    folder: Path, number: int, parts: Sequence[Part], *, labelled: bool = True, person: str = "puppet"
) -> Path:
    """Write a take of a person and its labels beside it; each take of each person wavers differently."""
    generator = np.random.default_rng(number if person == "puppet" else [number, *map(ord, person)])
    frames, lines, begin = list[dict[str, list[float]]](), ["start_s,end_s,label"], 0.0
    for motion, seconds in parts:
        turn = np.arange(round(seconds * FRAME_RATE)) / FRAME_RATE * generator.uniform(1.4, 1.8) * np.pi
        swings = MOTIONS[motion]
        for moment in np.sin(turn).tolist():
            angles = {bone: 10.0 + swings.get(bone, 0.0) * moment for bone in ("larm", "lhand", "rarm", "rhand")}
            sizes = {"root": 6, "larm": 3, "lhand": 1, "rarm": 3, "rhand": 1}
            frames.append({bone: [0.0] * (size - 1) + [angles.get(bone, 0.0)] for bone, size in sizes.items()})
        lines.append(f"{begin},{begin + seconds},{motion}")
        begin += seconds
    (folder / f"{person}.asf").write_text(PUPPET.asf())
    path = folder / f"{person}_{number:02d}.amc"
    path.write_text(amc_text(frames))
    if labelled:
        path.with_suffix(".csv").write_text("\n".join(lines) + "\n")
    return path
