"""Recordings that tests write: every format with a made-up body, clips laid out like HDM05's, and labelled takes."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import ezc3d
import naive
import numpy as np
from numpy.typing import NDArray
from synthetic import METRE, TinyBody, TinyBone, amc_text

from kinespace.library.recordings.formats.measures import METRES

TURNS = ("Zrotation", "Yrotation", "Xrotation")
MOVES = ("Xposition", "Yposition", "Zposition")


@dataclass
class Node:
    """A joint of a BVH with all joints below it; a joint without children and channels is an End Site."""

    name: str
    offset: tuple[float, ...]
    channels: tuple[str, ...] = ()
    children: list["Node"] = field(default_factory=list)

    def all(self) -> Iterator["Node"]:
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


def trc_text(
    labels: Sequence[str], positions: NDArray[np.float64], *, rate: float = 100.0, unit: str = "mm", first: int = 1
) -> str:
    """Give a TRC's text: positions (frames, markers, 3) in its unit, NaN as empty fields; markers from `first` on."""
    heads = "".join(f"{label}\t\t\t" for label in labels)
    axes = "\t".join(f"X{n}\tY{n}\tZ{n}" for n in range(first, first + len(labels)))
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ttest.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{len(positions)}\t{len(labels)}\t{unit}\t{rate}\t1\t{len(positions)}",
        f"Frame#\tTime\t{heads}",
        f"\t\t{axes}",
        "",
    ]
    for number, frame in enumerate(positions, start=1):
        fields = ["" if np.isnan(value) else repr(float(value)) for value in frame.ravel()]
        lines.append("\t".join([str(number), repr(number / rate), *fields]))
    return "\n".join(lines) + "\n"


def write_c3d(path: Path, labels: Sequence[str], positions: NDArray[np.float64], *, unit: str = "mm") -> None:
    """Write a C3D: positions (frames, points, 3) in its unit, NaN as points of residual -1."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = tuple(labels)
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit] if unit else []
    gone = np.isnan(positions).any(axis=2)
    points = np.ones((4, len(labels), len(positions)))
    points[:3] = np.moveaxis(np.where(gone[:, :, None], 0.0, positions), 2, 0).swapaxes(1, 2)
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = -gone.T[None].astype(np.float64)
    file.write(str(path))


def csv_table(labels: Sequence[str], positions: NDArray[np.float64]) -> str:
    """Give a table of joints: positions (frames, joints, 3) in its unit, NaN as empty fields."""
    heads = ["time", *(f"{label}_{axis}" for label in labels for axis in "xyz")]
    rows = [[number / 100.0, *frame.ravel().tolist()] for number, frame in enumerate(positions)]
    return "".join(
        ",".join("" if value != value else str(value) for value in row) + "\n"  # noqa: PLR0124 - only NaN differs from itself
        for row in [heads, *rows]
    )


@dataclass(frozen=True)
class Written:
    """A recording that a test wrote, and the motion that is in it: positions (frames, joints, 3) in metres."""

    path: Path
    joints: tuple[str, ...]
    positions: NDArray[np.float64]
    rate: float = 100.0


def written(  # noqa: PLR0913 - a recording may differ in many ways
    ending: str,
    folder: Path,
    generator: np.random.Generator,
    *,
    frames: int = 12,
    unit: str = "m",
    shuffled: bool = False,
) -> Written:
    """Write a recording of a made-up body, its numbers in a unit, its joints perhaps in another order.

    Where the format is a hierarchy, the slow twin says where the joints stand.
    """
    path, metres = folder / f"take.{ending}", METRES[unit]
    if ending == "amc":
        return _written_amc(path, generator, frames, metres, shuffled=shuffled)
    if ending == "bvh":
        return _written_bvh(path, generator, frames, metres)
    labels = ("hip", "knee", "heel", "toe", "wrist")
    start = generator.uniform(-0.5, 1.5, (5, 3))
    positions = start + np.cumsum(generator.normal(0.01, 0.005, (frames, 5, 3)), axis=0)
    order = generator.permutation(5) if shuffled else np.arange(5)
    names, numbers_ = [labels[index] for index in order], positions[:, order] / metres
    match ending:
        case "trc":
            path.write_text(trc_text(names, numbers_, unit=unit))
        case "c3d":
            write_c3d(path, names, numbers_, unit=unit)
        case "csv":
            path.write_text(csv_table(names, numbers_))
        case _:
            times, parents = np.arange(frames) / 100.0, np.array([-1, 0, 0, 0, 0])
            np.savez(
                path, time=times, positions=numbers_, joints=np.array(names), parents=parents, performer=np.array("ann")
            )
    return Written(path, labels, positions)


def _written_amc(path: Path, generator: np.random.Generator, frames: int, metres: float, *, shuffled: bool) -> Written:
    def triple(most: float) -> tuple[float, ...]:
        return tuple(np.round(generator.uniform(-most, most, 3), 3).tolist())

    bones: list[TinyBone] = []
    for index in range(int(generator.integers(2, 6))):
        parent = generator.choice(["root", *(bone.name for bone in bones)])
        dof = tuple(generator.permutation(["rx", "ry", "rz"])[: generator.integers(0, 4)].tolist())
        order, length = "".join(generator.permutation(list("XYZ"))), float(generator.uniform(0.0, 0.5) / metres)
        bones.append(TinyBone(f"bone{index}", str(parent), triple(1.0), length, triple(180.0), order, dof))
    body = TinyBody(
        tuple(bones),
        length=METRE / metres,
        root_order=" ".join(generator.permutation(["TX", "TY", "TZ", "RX", "RY", "RZ"])),
        root_axis="".join(generator.permutation(list("XYZ"))),
        position=triple(1.0 / metres),
        orientation=triple(180.0),
    )
    sizes = {"root": 6} | {bone.name: len(bone.dof) for bone in bones if bone.dof}
    names = [generator.permutation(list(sizes)) if shuffled else list(sizes) for _ in range(frames)]
    motion = [{str(name): generator.uniform(-180, 180, sizes[name]).tolist() for name in each} for each in names]
    asf = path.with_suffix(".asf")
    asf.write_text(body.asf())
    path.write_text(amc_text(motion, header=":DEGREES\n:SAMPLES-PER-SECOND 100"))
    return Written(path, tuple(naive.Asf(asf).joints), naive.clip_positions(asf, path))


def _written_bvh(path: Path, generator: np.random.Generator, frames: int, metres: float) -> Written:
    def offset() -> tuple[float, ...]:
        return tuple((generator.uniform(0.1, 0.5, 3) / metres).tolist())

    nodes: list[Node] = []
    for index in range(int(generator.integers(2, 6))):
        moves = index == 0 or generator.random() < 0.3
        names = generator.permutation([*TURNS, *(MOVES if moves else ())])
        nodes.append(Node(f"joint {index}", offset(), tuple(names[: generator.integers(1, len(names) + 1)].tolist())))
        if index:
            nodes[int(generator.integers(index))].children.append(nodes[-1])
    for node in nodes:
        if not node.children:
            node.children.append(Node(f"{node.name}_end", offset()))
    joints = list(nodes[0].all())
    scales = [0.5 / metres if name in MOVES else 180.0 for node in joints for name in node.channels]
    motion = [(generator.uniform(0.1, 1.0, len(scales)) * scales).tolist() for _ in range(frames)]
    path.write_text(bvh_text(nodes[0], motion))
    places = [naive.bvh_places(nodes[0], iter(frame), np.zeros(3), np.eye(3)) for frame in motion]
    return Written(path, tuple(node.name for node in joints), np.array(places) * metres)


# --- of a body with two arms: clips named and laid out like HDM05's, and labelled takes -------------------------------


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
