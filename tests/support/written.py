"""Recordings that tests write: BVH, TRC and C3D of made-up bodies, and BVH made of Acclaim files."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinespace.library.recordings.formats import acclaim

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

TURNS = ("Zrotation", "Yrotation", "Xrotation")
MOVES = ("Xposition", "Yposition", "Zposition")


@dataclass
class Node:
    """A joint of a BVH with all joints below it; a joint without children and channels is an End Site."""

    name: str
    offset: tuple[float, ...]
    channels: tuple[str, ...] = ()
    children: list[Node] = field(default_factory=list)

    def all(self) -> Iterator[Node]:
        """Give this joint and all joints below it, in the file's order."""
        yield self
        for child in self.children:
            yield from child.all()

    def text(self, kind: str = "ROOT") -> str:
        """Give the hierarchy's text."""
        if not self.channels and not self.children:
            return f"End Site\n{{\nOFFSET {numbers(self.offset)}\n}}\n"
        below = "".join(child.text("JOINT") for child in self.children)
        channels = f"CHANNELS {' '.join([str(len(self.channels)), *self.channels])}\n"
        return f"{kind} {self.name}\n{{\nOFFSET {numbers(self.offset)}\n{channels}{below}}}\n"


def numbers(values: Iterable[float]) -> str:
    """Write numbers so that reading gives the same numbers."""
    return " ".join(repr(float(value)) for value in values)


def bvh_text(root: Node, frames: Sequence[Sequence[float]], period: str = "0.01") -> str:
    """Give a BVH's text."""
    motion = "".join(f"{numbers(frame)}\n" for frame in frames)
    return f"HIERARCHY\n{root.text()}MOTION\nFrames: {len(frames)}\nFrame Time: {period}\n{motion}"


def bvh_of_acclaim(asf: Path, amc: Path, *, scale: float = 1.0) -> tuple[str, dict[str, str]]:
    """Write an Acclaim motion as BVH.

    A bone of an ASF ends where it turns its children; a joint of a BVH begins there. So each bone becomes a joint at
    its parent's end, and bones without children end in an End Site.

    Returns
    -------
    The text, lengths in metres times `scale`, and for each Acclaim joint the BVH joint at the same place.
    """
    body = acclaim.read_asf(asf)
    motion = acclaim._read_amc(amc, body)  # noqa: SLF001 - the test needs the angles
    channels = acclaim._in_si(body, motion)  # noqa: SLF001 - as above
    places = acclaim._channel_places(body)  # noqa: SLF001 - as above
    names = body.skeleton.joints
    nodes = [Node(name, (0.0, 0.0, 0.0), TURNS) for name in names]
    nodes[0].channels = (*MOVES, *TURNS)
    stands = {"root": "root"}
    for joint, parent in enumerate(body.skeleton.parents):
        if parent >= 0:
            nodes[joint].offset = tuple(body.bones[parent].offset * scale) if parent else (0.0, 0.0, 0.0)
            nodes[parent].children.append(nodes[joint])
            stands.setdefault(names[parent], names[joint])
    for joint, name in enumerate(names):
        if joint not in body.skeleton.parents:
            nodes[joint].children.append(Node(f"{name}_end", tuple(body.bones[joint].offset * scale)))
            stands[name] = f"{name}_end"
    turns = {}
    for bone in body.bones:
        own = channels[:, places[bone.name]] if bone.channels else channels[:, :0]
        local = bone.axis @ acclaim._rotation(bone, own) @ bone.axis.T  # noqa: SLF001 - as above
        turns[bone.name] = Rotation.from_matrix(local).as_euler("ZYX", degrees=True)
    root = body.bones[0]
    moved = (root.offset + acclaim._translation(root, channels[:, places["root"]])) * scale  # noqa: SLF001 - as above
    columns = [moved, *(turns[node.name] for node in nodes[0].all() if node.channels)]
    period = repr(1 / 120)
    return bvh_text(nodes[0], np.concatenate(columns, axis=1).tolist(), period), stands


def trc_text(
    labels: Sequence[str], positions: NDArray[np.float64], *, rate: float = 100.0, unit: str = "mm", missing: str = ""
) -> str:
    """Give a TRC's text: positions (frames, markers, 3) in its unit, NaN as `missing` fields."""
    heads = "".join(f"{label}\t\t\t" for label in labels)
    axes = "\t".join(f"X{n}\tY{n}\tZ{n}" for n in range(1, len(labels) + 1))
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ttest.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{len(positions)}\t{len(labels)}\t{unit}\t{rate}\t1\t{len(positions)}",
        f"Frame#\tTime\t{heads}",
        f"\t\t{axes}",
        "",
    ]
    for number, frame in enumerate(positions, start=1):
        fields = [missing if np.isnan(value) else repr(float(value)) for value in frame.ravel()]
        lines.append("\t".join([str(number), repr(number / rate), *fields]))
    return "\n".join(lines) + "\n"


def write_c3d(  # noqa: PLR0913 - parameters of a C3D file
    path: Path,
    labels: Sequence[str],
    positions: NDArray[np.float64],
    *,
    rate: float = 100.0,
    unit: str = "mm",
    angles: Sequence[str] = (),
) -> None:
    """Write a C3D: positions (frames, points, 3) in its unit, NaN as points of residual -1."""
    try:
        import ezc3d  # noqa: PLC0415 - an extra
    except ImportError:
        if os.environ.get("KINESPACE_COMPLETE") == "1":
            pytest.fail("no ezc3d, and KINESPACE_COMPLETE=1 says that the tests run with the extra c3d", pytrace=False)
        pytest.skip("no ezc3d, an extra")
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [rate]
    file["parameters"]["POINT"]["LABELS"]["value"] = tuple(labels)
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit] if unit else []
    gone = np.isnan(positions).any(axis=2)
    points = np.ones((4, len(labels), len(positions)))
    points[:3] = np.moveaxis(np.where(gone[:, :, None], 0.0, positions), 2, 0).swapaxes(1, 2)
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = -gone.T[None].astype(np.float64)
    if angles:
        file.add_parameter("POINT", "ANGLES", list(angles))
    file.write(str(path))
