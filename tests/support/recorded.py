"""Recordings made by the tests: a small body with two arms, in files named and laid out like HDM05's cut clips."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
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
#: By class, degrees that each bone swings about z.
SWINGS = {"bendLeft": {"llower": 70.0}, "bendRight": {"rlower": 70.0}, "raiseBoth": {"lupper": 60.0, "rupper": -60.0}}
FRAME_RATE = 120.0


def two_arms_frames(class_name: str, *, frames: int, seed: int = 0) -> list[dict[str, list[float]]]:
    """Give the channels of one take, smooth, a little different for each seed, one swing a second."""
    generator = np.random.default_rng(seed)
    scale, begin = generator.uniform(0.9, 1.1), generator.uniform(0.0, 2 * np.pi)
    swing = scale * np.sin(begin + 2 * np.pi * np.arange(frames) / FRAME_RATE)
    swings = SWINGS[class_name]
    still = {"root": 6, "lupper": 3, "llower": 1, "rupper": 3, "rlower": 1}
    return [
        {bone: [0.0] * (size - 1) + [swings.get(bone, 0.0) * moment + 5.0] for bone, size in still.items()}
        for moment in swing.tolist()
    ]


def write_take(folder: Path, actor: str, class_name: str, take: int, *, frames: int = 180) -> Path:
    """Write one clip into its class's folder, its actor's skeleton one folder up."""
    (folder / class_name).mkdir(exist_ok=True)
    (folder / f"HDM_{actor}.asf").write_text(TWO_ARMS.asf())
    path = folder / class_name / f"HDM_{actor}_{class_name}_{take:03d}_120.amc"
    seed = take + 100 * sum(map(ord, actor))
    path.write_text(amc_text(two_arms_frames(class_name, frames=frames, seed=seed)))
    return path


def write_takes(folder: Path, *, actors: Sequence[str] = ("bd", "mm"), takes: int = 2, frames: int = 180) -> list[Path]:
    """Write some takes of every class by every actor; give their paths."""
    return [
        write_take(folder, actor, class_name, take, frames=frames)
        for class_name in SWINGS
        for actor in actors
        for take in range(1, takes + 1)
    ]
