"""Recordings that tests write, of a body with two arms: clips named and laid out like HDM05's, and labelled takes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from synthetic import TinyBody, TinyBone, amc_text

#: Two arms that bend at the elbow, and a head: the distances show which bone bends the elbow.
TWO_ARMS = TinyBody(
    (
        TinyBone("lupper"),
        TinyBone("llower", parent="lupper", dof=("rz",)),
        TinyBone("rupper", direction=(-1.0, 0.0, 0.0)),
        TinyBone("rlower", parent="rupper", direction=(-1.0, 0.0, 0.0), dof=("rz",)),
        TinyBone("head", direction=(0.0, 1.0, 0.0), dof=()),
    )
)
JOINTS = ("root", "lupper", "rupper", "head", "llower", "rlower")
#: By class, degrees that each bone swings about z: of clips, and of the parts of takes.
SWINGS = {"bendLeft": {"llower": 70.0}, "bendRight": {"rlower": 70.0}, "raiseBoth": {"lupper": 60.0, "rupper": -60.0}}
MOTIONS = {
    "clap": {"lupper": 40.0, "rupper": -40.0},
    "hail": {"rlower": 60.0},
    "row": {"llower": 60.0, "rlower": 60.0},
    "salute": {"llower": 60.0},
}
FRAME_RATE = 120


def _swung(moments: NDArray[np.float64], class_name: str, still: float) -> list[dict[str, list[float]]]:
    """Give a frame for each moment, -1 to 1, at which the class's bones swing."""
    swings, sizes = (SWINGS | MOTIONS)[class_name], {"root": 6, "lupper": 3, "llower": 1, "rupper": 3, "rlower": 1}
    return [
        {bone: [0.0] * (size - 1) + [swings.get(bone, 0.0) * moment + still] for bone, size in sizes.items()}
        for moment in moments.tolist()
    ]


def write_clip(folder: Path, actor: str, class_name: str, take: int, *, frames: int = 180) -> Path:
    """Write one clip, one swing a second, into its class's folder, its actor's skeleton one folder up."""
    (folder / class_name).mkdir(exist_ok=True)
    (folder / f"HDM_{actor}.asf").write_text(TWO_ARMS.asf())
    path = folder / class_name / f"HDM_{actor}_{class_name}_{take:03d}_120.amc"
    generator = np.random.default_rng(take + 100 * sum(map(ord, actor)))
    scale, begin = generator.uniform(0.9, 1.1), generator.uniform(0.0, 2 * np.pi)
    moments = scale * np.sin(begin + 2 * np.pi * np.arange(frames) / FRAME_RATE)
    path.write_text(amc_text(_swung(moments, class_name, 5.0)))
    return path


def write_clips(folder: Path, *, actors: Sequence[str] = ("bd", "mm"), takes: int = 2) -> list[Path]:
    """Write some clips of every class by every actor; give their paths."""
    return [
        write_clip(folder, actor, class_name, take)
        for class_name in SWINGS
        for actor in actors
        for take in range(1, takes + 1)
    ]


def write_take(
    folder: Path, number: int, parts: Sequence[tuple[str, float]], *, person: str, labelled: bool = True
) -> Path:
    """Write motions of so many seconds one after another, and their labels beside; each take wavers differently."""
    generator = np.random.default_rng([number, *map(ord, person)])
    frames, lines, begin = list[dict[str, list[float]]](), ["start_s,end_s,label"], 0.0
    for motion, seconds in parts:
        turn = np.arange(round(seconds * FRAME_RATE)) / FRAME_RATE * generator.uniform(1.4, 1.8) * np.pi
        frames += _swung(np.sin(turn), motion, 10.0)
        lines.append(f"{begin},{begin + seconds},{motion}")
        begin += seconds
    (folder / f"{person}.asf").write_text(TWO_ARMS.asf())
    path = folder / f"{person}_{number:02d}.amc"
    path.write_text(amc_text(frames))
    if labelled:
        path.with_suffix(".csv").write_text("\n".join(lines) + "\n")
    return path
