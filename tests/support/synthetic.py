"""Small bodies and motions made by the tests: Acclaim text, and clips that need no file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinespace.library import Clip, MotionLibrary, Skeleton, WindowIndex
from kinespace.library.signature.basis import Basis
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import Kind, Part
from kinespace.library.windows.comparison import Comparison, Weighing

#: The unit of length in which an ASF's numbers are metres.
METRE = 0.0254


@dataclass(frozen=True)
class TinyBone:
    """One bone of an ASF: by default a length of one along x, free to turn about axes parallel to the world's."""

    name: str
    parent: str = "root"
    direction: tuple[float, ...] = (1.0, 0.0, 0.0)
    length: float = 1.0
    axis: tuple[float, ...] = (0.0, 0.0, 0.0)
    axis_order: str = "XYZ"
    dof: tuple[str, ...] = ("rx", "ry", "rz")

    def text(self, number: int) -> str:
        """Give the bone's `begin` to `end`; without degrees of freedom it has no `dof` line."""
        dof = f"     dof {' '.join(self.dof)}\n     limits (-160.0 20.0)\n" if self.dof else ""
        return (
            f"  begin\n     id {number}\n     name {self.name}\n     direction {_numbers(self.direction)}\n"
            f"     length {self.length!r}\n     axis {_numbers(self.axis)} {self.axis_order}\n{dof}  end\n"
        )


@dataclass(frozen=True)
class TinyBody:
    """A whole ASF, in metres and degrees unless given otherwise."""

    bones: tuple[TinyBone, ...]
    length: float = METRE
    angle: str = "deg"
    root_order: str = "TX TY TZ RX RY RZ"
    root_axis: str = "XYZ"
    position: tuple[float, ...] = (0.0, 0.0, 0.0)
    orientation: tuple[float, ...] = (0.0, 0.0, 0.0)

    def asf(self) -> str:
        """Give the file's text."""
        bonedata = "".join(bone.text(number) for number, bone in enumerate(self.bones, start=1))
        hierarchy = "".join(f"    {bone.parent} {bone.name}\n" for bone in self.bones)
        return (
            f":version 1.10\n:name TINY\n:units\n  mass 1.0\n  length {self.length!r}\n  angle {self.angle}\n"
            f":documentation\n   made by a test\n:root\n   order {self.root_order}\n   axis {self.root_axis}\n"
            f"   position {_numbers(self.position)}\n   orientation {_numbers(self.orientation)}\n"
            f":bonedata\n{bonedata}:hierarchy\n  begin\n{hierarchy}  end\n"
        )


#: An arm of three bones in a line along x; the last does not turn.
ARM = TinyBody(
    (
        TinyBone("upper"),
        TinyBone("lower", parent="upper", dof=("rz",)),
        TinyBone("hand", parent="lower", length=0.5, dof=()),
    )
)


def amc_text(
    frames: Sequence[Mapping[str, Sequence[float]]], *, numbers: Sequence[int] = (), header: str = ":DEGREES"
) -> str:
    """Give an AMC's text: bones in each frame's own order, frames numbered from 1 unless given otherwise."""
    lines = [":FULLY-SPECIFIED", header]
    for number, frame in zip(numbers or range(1, len(frames) + 1), frames, strict=True):
        lines += [str(number), *(f"{bone} {_numbers(values)}" for bone, values in frame.items())]
    return "\n".join(lines) + "\n"


def arm_frames(count: int, *, seed: int = 7) -> list[dict[str, list[float]]]:
    """Give frames of ARM with random angles within a right angle."""
    generator = np.random.default_rng(seed)
    sizes = {"root": 6, "upper": 3, "lower": 1}
    return [{bone: generator.uniform(-90, 90, size).tolist() for bone, size in sizes.items()} for _ in range(count)]


def write_pair(folder: Path, asf: str, amc: str) -> Path:
    """Write `tiny.asf` and `tiny_01.amc`, and give the AMC's path."""
    (folder / "tiny.asf").write_text(asf, encoding="latin-1", newline="")
    path = folder / "tiny_01.amc"
    path.write_text(amc, encoding="latin-1", newline="")
    return path


#: A body of six joints for motions without a file.
STICK = Skeleton(("root", "chest", "head", "left", "right", "foot"), (-1, 0, 1, 1, 1, 0))
#: Movements of the stick body: every class swings the joints in its own directions.
STICK_CLASSES = ("bow", "jump", "wave")
#: How many times a second they swing there and back.
STICK_SWINGS = 2.0


def stick_clip(  # noqa: PLR0913 - a clip has many fields
    class_name: str,
    *,
    seed: int = 0,
    frames: int = 48,
    actor: str = "aa",
    skeleton: Skeleton = STICK,
    rate: float = 120.0,
) -> Clip:
    """Make a motion of six joints: the class sets where each joint swings, the seed sets phases and noise."""
    own = np.random.default_rng(STICK_CLASSES.index(class_name))
    pose = np.random.default_rng(99).normal(size=(6, 3))
    swing = own.normal(scale=0.2, size=(6, 3))
    generator = np.random.default_rng(seed)
    turns = 2.0 * np.pi * np.arange(frames) / rate
    phase = np.sin(STICK_SWINGS * turns + generator.uniform(0.0, 2.0 * np.pi))
    waver = np.sin(3.0 * turns[:, None, None] + generator.uniform(0.0, 2.0 * np.pi, size=(6, 3)))
    positions = pose + phase[:, None, None] * swing + 0.01 * waver
    return Clip(skeleton, positions, rate, f"{class_name}_{seed}", class_name, actor, f"{seed:03d}")


def gesture(name: str) -> Clip:
    """Stand for a second, move twice in two seconds, and stand: a nod, a hand wave, or a bow, which comes once."""
    upper, times, degrees = {
        "nod": ("lowerneck", 2, 35.0),
        "hand wave": ("rradius", 2, 45.0),
        "bow": ("root", 1, 45.0),
    }[name]
    skeleton, time = MotionLibrary.builtin().skeleton, np.arange(240) / 60
    joints, body = skeleton.joints, MotionLibrary.builtin().motions[40].positions[0]
    moved: list[int] = []
    for joint, parent in enumerate(skeleton.parents):
        if parent in moved or (joints[parent] == upper and not joints[joint].endswith("hipjoint")):
            moved.append(joint)
    side = body[joints.index("lhipjoint")] - body[joints.index("rhipjoint")]
    side /= np.linalg.norm(side)
    arms = body[moved] - body[joints.index(upper)]
    along = np.outer(arms @ side, side)
    positions = np.repeat(body[None], len(time), axis=0)
    angles = np.radians(degrees) * (1 - np.cos(np.pi * times * np.clip(time - 1, 0, 2))) / 2
    for frame, angle in enumerate(angles):
        turned = along + np.cos(angle) * (arms - along) + np.sin(angle) * np.cross(side, arms)
        positions[frame, moved] = body[joints.index(upper)] + turned
    return Clip(skeleton, positions, 60.0)


def stick_clips(*, takes: int = 3, actors: Sequence[str] = ("aa", "bb"), frames: int = 120) -> list[Clip]:
    """Make some takes of every class by every actor, the classes mixed."""
    return [
        stick_clip(class_name, seed=seed * len(actors) + place, actor=actor, frames=frames)
        for seed in range(takes)
        for place, actor in enumerate(actors)
        for class_name in reversed(STICK_CLASSES)
    ]


def _numbers(values: Sequence[float]) -> str:
    return " ".join(map(repr, map(float, values)))


def plain_index(seconds: float, joints: int) -> WindowIndex:
    """Give an index without windows, whose windows would be of so many seconds, in a basis of the distances alone."""
    body = Body.of(Skeleton(tuple(f"joint{place}" for place in range(joints))))
    pairs = len(body.sizing)
    parts = Part(Kind.EIGEN, seconds), Part(Kind.SPREAD, seconds)
    weighing = Weighing(groups=(parts,), blends=((1.0,),), first=seconds)
    basis, none = Basis.of(np.eye(pairs), np.ones(pairs), 1.0), np.empty(0)
    return WindowIndex(MotionLibrary.builtin(), body, basis, Comparison(weighing, {}, ()), (), none, none)
