"""BVH recordings (Biovision hierarchy) read into clips.

A BVH gives every joint an offset from its parent and channels: rotations, of which the first named is applied last (R =
R₁ · R₂ · R₃), and for the root, in some files for every joint, positions. A joint's position channels replace its
offset, as in MotionBuilder and Blender; where they are mostly small against it the offset stays, because some programs
write position channels of nothing, or of noise. An End Site is a joint like any other, called after its parent with
`_end`. A joint that always coincides with its parent, or with an earlier child of its parent, is left out.

The file names no unit; `library.recordings.formats.measures.guessed_metres` guesses it.
"""

import math
import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from itertools import chain, islice, pairwise, product, starmap
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.naming import hdm05
from kinespace.library.recordings.formats.errors import Line, RecordingError, mended, number_of, numbers_in, refuse
from kinespace.library.recordings.formats.joint_choice import MAX_JOINTS, chosen, short_names
from kinespace.library.recordings.formats.measures import USUAL, guessed_metres
from kinespace.library.recordings.formats.rotations import placed, turns
from kinespace.library.recordings.formats.texts import lines_of
from kinespace.library.skeleton import Skeleton

_CHANNEL = re.compile(r"([xyz])(position|rotation|scale)", re.IGNORECASE)
#: Braces, and the words that may stand behind others on a line.
_CUT = re.compile(r"([{}])|(?<!JOINT)(?<!ROOT)\s(?=(?:ROOT|JOINT|End\s+Site|OFFSET|CHANNELS|MOTION)\s)")
#: Frames per second at least: longer Frame Times count the frames, or milliseconds.
_SLOWEST = 0.2
#: Statements between MOTION and the first frame, at most.
_HEADER = 8
#: An offset shorter than this share of the largest offset counts as none.
_NO_OFFSET = 1e-6
#: A joint's position channels replace its offset where half of them are longer than this share of it.
_REPLACES = 0.05


@dataclass(frozen=True, slots=True)
class BvhJoint:
    """One joint or End Site of a BVH.

    Attributes
    ----------
    parent
        Index of the joint it hangs on, below its own; -1 for the root.
    offset
        From the parent, in the parent's frame, in the file's unit.
    channels
        The meaning of each number in a frame: "p" for a position or "r" for a rotation, then the axis, one of "xyz".
    """

    name: str
    parent: int
    offset: tuple[float, float, float]
    channels: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class BvhMotion:
    """A BVH as it stands in the file.

    Attributes
    ----------
    joints
        In the file's order, the root first.
    channels
        All joints' numbers one after the other, shape (frames, channels): degrees, and lengths in the file's unit.
    frame_rate
        Frames per second.
    notes
        Remarks on the file.
    """

    joints: tuple[BvhJoint, ...]
    channels: NDArray[np.float64]
    frame_rate: float
    notes: tuple[str, ...] = ()


def _statements(path: Path) -> Iterator[Line]:
    """Give braces, and the texts between braces, line ends, and words that begin a statement behind another one."""
    # Joint names come in any encoding; a name that is not UTF-8 must not stop the reader.
    for number, text in enumerate(lines_of(path, errors="replace"), start=1):
        several = "{" in text or "}" in text or text.lstrip().startswith(("HIERARCHY", "OFFSET", "CHANNELS"))
        for piece in _CUT.split(text) if several else (text,):
            if piece and (words := piece.split()) and not words[0].startswith(("#", "//", ";")):
                yield Line(path, number, words)


@dataclass(slots=True)
class _HierarchyReader:
    """Collects the joints while the statements of the hierarchy go by."""

    joints: list[BvhJoint] = field(default_factory=list)
    #: Indices of the joints whose braces are open; -1 before the root.
    _open: list[int] = field(default_factory=lambda: [-1])
    _named: str = ""
    _ends: dict[int, int] = field(default_factory=dict)

    def take(self, statement: Line) -> bool:
        """Take in one statement; return whether the hierarchy ends before it."""
        word = statement.words[0].lower().rstrip(":")
        if self._named and word != "{":
            statement.fail(f"expected {{ after {self._named!r}, got {statement.words[0]!r}")
        match word:
            case "root" | "joint" | "end" | "endsite":
                self._name(word, statement)
            case "{":
                if not self._named:
                    statement.fail("expected ROOT, JOINT or End Site before {")
                self.joints.append(BvhJoint(self._named, self._open[-1], (math.nan,) * 3))
                self._open.append(len(self.joints) - 1)
                self._named = ""
            case "}":
                self._close(statement)
            case "offset" | "channels":
                self._describe(word, statement)
            case "motion":
                self._finish(statement)
                return True
            case _ if word != "hierarchy":
                statement.fail(f"expected a word of a BVH hierarchy, got {statement.words[0][:40]!r}")
        return False

    def _name(self, word: str, statement: Line) -> None:
        if (word == "root") != (self._open == [-1]):
            statement.fail("expected a ROOT, and all joints within one")
        name = " ".join(statement.words[1:]).strip("\"'")
        if word.startswith("end"):
            parent = self._open[-1]
            self._ends[parent] = self._ends.get(parent, 0) + 1
            name = f"{self.joints[parent].name}_end{self._ends[parent] if self._ends[parent] > 1 else ''}"
        if not name:
            statement.fail(f"expected a name after {statement.words[0]!r}")
        if len(self.joints) == MAX_JOINTS:
            statement.fail(f"expected at most {MAX_JOINTS} joints, got more")
        self._named = name

    def _describe(self, word: str, statement: Line) -> None:
        """Describe the joint whose braces are the innermost."""
        if self._open == [-1]:
            statement.fail(f"{statement.words[0]} stands outside a joint")
        index = self._open[-1]
        joint = self.joints[index]
        if word == "offset":
            x, y, z = numbers_in(statement.words[1:], statement.path, statement.number, 3)
            self.joints[index] = replace(joint, offset=(x, y, z))
            return
        if joint.channels or index != len(self.joints) - 1:
            statement.fail(f"expected the channels of {joint.name!r} once, and before its children")
        self.joints[index] = replace(joint, channels=_channels(statement))

    def _close(self, statement: Line) -> None:
        if self._open == [-1]:
            statement.fail("a } without its {")
        joint = self.joints[self._open.pop()]
        if math.isnan(joint.offset[0]):
            statement.fail(f"joint {joint.name!r} has no OFFSET")

    def _finish(self, statement: Line) -> None:
        if self._open != [-1]:
            statement.fail(f"joint {self.joints[self._open[-1]].name!r} is not closed with }}")
        if len(self.joints) < 2:
            statement.fail(f"expected a hierarchy of at least 2 joints, got {len(self.joints)}")


def _channels(statement: Line) -> tuple[str, ...]:
    count, *names = statement.words[1:] or [""]
    found = [_CHANNEL.fullmatch(name) for name in names]
    channels = tuple(each[2][0].lower() + each[1].lower() for each in found if each)
    if not count.isdecimal() or int(count) != len(names) or len(set(channels)) != len(names):
        got = " ".join(statement.words)
        statement.fail(f"expected CHANNELS, a count, and that number of Xposition ... Zrotation, got {got!r}")
    return channels


def read_bvh(path: Path, frame_rate: float | None = None) -> BvhMotion:
    """Read a BVH as it stands, line by line; of a line that is cut off at the file's end nothing.

    Parameters
    ----------
    path
        The file.
    frame_rate
        Frames per second; by default the file's own.

    Raises
    ------
    RecordingError
        The file is no BVH, its hierarchy makes no sense, or a frame has too few or too many numbers.
    OSError
        The file cannot be opened.
    """
    hierarchy, statements, line = _HierarchyReader(), _statements(path), Line(path, 1, [])
    for line in statements:
        if hierarchy.take(line):
            break
    else:
        line.fail("expected HIERARCHY and MOTION, got a file that ends before its motion")
    announced, rate, statements = _motion_header(statements, line, frame_rate)
    size = sum(len(joint.channels) for joint in hierarchy.joints)
    frames, values, notes = 0, array("d"), list[str]()
    if not frame_rate and rate < _SLOWEST:
        period = round(1 / rate, 6)
        rate = min(period, _frame_rate(f"{period / 1000:.9g}"), key=lambda each: abs(each - round(each)))
        notes.append(f"times: the Frame Time {period:g} is taken for {rate:.6g} frames a second")
    for line in _whole_frames(statements, size):
        try:
            values.extend(numbers_in(line.words, path, line.number, size))
        except RecordingError:
            if not frames or next(statements, None) is not None:
                raise
            notes.append(f"frames: the last line, {line.number}, is cut off and left out")
            break
        frames += 1
    if not frames:
        line.fail("the file ends before its first frame")
    if announced != str(frames):
        notes.append(f"frames: the header says {announced}, there are {frames}: these are taken")
    memory.require_numbers(frames * max(size, 3 * len(hierarchy.joints)))
    channels = np.frombuffer(values, dtype=np.float64).reshape(frames, size)
    return BvhMotion(tuple(hierarchy.joints), channels, rate, tuple(notes))


def _whole_frames(statements: Iterator[Line], size: int) -> Iterator[Line]:
    """Join the lines of each frame, where the first frame stands on several and has as many numbers as expected."""
    is_broken: bool | None = None
    for line in statements:
        words, count = [*line.words], size if is_broken is False else len(mended(line.words))
        while count < size and (following := next(statements, None)):
            words += following.words
            count += len(mended(following.words))
        if is_broken is None:
            is_broken = len(words) > len(line.words) and count == size
        yield replace(line, words=words) if is_broken else line


def _motion_header(statements: Iterator[Line], last: Line, given: float | None) -> tuple[str, float, Iterator[Line]]:
    """Read `Frames: 100` and `Frame Time: 0.01`: frames, frames per second, and the statements that are left."""
    said = " ".join(last.words[1:])
    for statement in islice(statements, _HEADER):
        if None not in _rates_in(said) or (len(statement.words) > 1 and number_of(statement.words[0]) is not None):
            statements = chain([statement], statements)
            break
        said, last = f"{said} {' '.join(statement.words)}", statement
    frames, period = _rates_in(said)
    if not given and not (period and 0 < (number_of(period[1]) or 0.0) < math.inf):
        got = period[1] if period else said[:60].strip() or "none"
        last.fail(f"expected a positive Frame Time, got {got}: --frame-rate says the frames per second")
    rate = given or _frame_rate(period[1].replace(",", ".") if period else "")
    return frames[1] if frames else "nothing", rate, statements


def _rates_in(said: str) -> tuple[re.Match[str] | None, ...]:
    """Find the numbers behind `Frames` and `Frame Time`."""
    return tuple(re.search(rf"{name}[\s:=]+([-+.\d]\S*)", said, re.IGNORECASE) for name in ("frames", "frame[ _]?time"))


def _frame_rate(period: str) -> float:
    """Frames per second: the usual rate, or the whole number, from which the period was rounded or cut."""
    seconds = float(period)
    rate = 1.0 / seconds
    decimals = len(period.lower().partition("e")[0].partition(".")[2])
    usual, whole = float(USUAL[np.abs(1 / USUAL - seconds).argmin()]), float(round(rate))
    near = (each for each in (usual, whole) if each and abs(1 / each - seconds) <= 10.0**-decimals)
    return rate if "e" in period.lower() or math.isclose(rate, whole) else next(near, rate)


def forward_kinematics(motion: BvhMotion) -> NDArray[np.float64]:
    """Work out the position of every joint, (frames, joints, 3), in the file's unit; R = R₁ · R₂ · R₃."""
    displaced = _displaced(motion)[0]

    def bones(block: slice) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        channels = motion.channels[block]
        each = zip(motion.joints, displaced, _by_joint(motion.joints, channels), strict=True)
        for joint, is_displaced, numbers in each:
            own, offset = dict(zip(joint.channels, numbers.T, strict=True)), np.tile(joint.offset, (len(channels), 1))
            for axis, name in enumerate("xyz" if is_displaced else ""):
                offset[:, axis] = own.get(f"p{name}", offset[:, axis])
            order = [name[1] for name in own if name[0] == "r"]
            yield offset, turns("".join(order).upper(), [np.radians(own[f"r{axis}"]) for axis in order], len(channels))

    return placed([joint.parent for joint in motion.joints], len(motion.channels), bones)


def _by_joint(joints: Sequence[BvhJoint], channels: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Give the channels (frames, n) of each joint."""
    return np.split(channels, np.cumsum([len(joint.channels) for joint in joints[:-1]]), axis=1)


def _displaced(motion: BvhMotion) -> tuple[list[bool], list[str]]:
    """Tell for each joint whether its position channels stand in place of its offset: they are not small against it.

    Gives a remark, too, where a joint keeps its offset although the channels are large in some frames.
    """
    found, large = list[bool](), list[str]()
    for joint, own in zip(motion.joints, _by_joint(motion.joints, motion.channels), strict=True):
        moves = np.linalg.norm(own[:, [name[0] == "p" for name in joint.channels]], axis=1)
        small, is_root = _REPLACES * math.hypot(*joint.offset), joint.parent < 0
        found.append(bool(moves.any() if is_root else np.median(moves) > small))
        large += [joint.name] * (not found[-1] and not is_root and bool(moves.max() > small))
    listed = ", ".join(large[:5])
    return found, [f"positions: channels of {listed} pass over their OFFSET in some frames: left out"] if large else []


def _representatives(joints: Sequence[BvhJoint], displaced: Sequence[bool]) -> list[int]:
    """Give for each joint the first joint that it always coincides with, or itself when there is none."""
    largest = max(max(map(abs, joint.offset)) for joint in joints) or 1.0
    firsts, sisters = list[int](), dict[tuple[int, object], int]()
    for index, joint in enumerate(joints):
        if joint.parent >= 0 and not displaced[index] and max(map(abs, joint.offset)) < _NO_OFFSET * largest:
            firsts.append(firsts[joint.parent])
        else:
            firsts.append(sisters.setdefault((joint.parent, index if displaced[index] else joint.offset), index))
    return firsts


def _kept(joints: Sequence[BvhJoint], moved: Sequence[bool], wanted: Sequence[str]) -> tuple[list[int], Sequence[int]]:
    """Choose the joints of the clip: their indices in the file, and their parents among the chosen joints."""
    firsts, names, kept = _representatives(joints, moved), [joint.name for joint in joints], dict[str, int]()
    for index in chosen(names, wanted) if wanted else range(len(names)):
        if kept.setdefault(str(firsts[index]), index) != index and names[index] in wanted:
            raise ValueError(f"{names[index]!r} always coincides with another chosen joint")
    above = tuple(firsts[each.parent] if each.parent >= 0 else -1 for each in joints)
    whole = Skeleton(tuple(map(str, range(len(joints)))), above)
    # Where the joint above two chosen joints is not chosen, the first chosen joint takes its place.
    parents = (each if each >= 0 or not place else 0 for place, each in enumerate(whole.linked([*kept]).parents))
    return [*kept.values()], tuple(parents)


def _performers(motion: BvhMotion) -> Iterator[BvhMotion]:
    """Give the motion of each ROOT that has joints."""
    columns = np.cumsum([0, *(len(joint.channels) for joint in motion.joints)])
    roots = [place for place, joint in enumerate(motion.joints) if joint.parent < 0]
    for first, end in pairwise([*roots, len(motion.joints)]):
        joints = tuple(replace(joint, parent=max(joint.parent - first, -1)) for joint in motion.joints[first:end])
        if len(joints) > 1:
            yield replace(motion, joints=joints, channels=motion.channels[:, columns[first] : columns[end]])


def read_clips(
    path: Path, *, metres_per_unit: float | None = None, frame_rate: float | None = None, joints: Sequence[str] = ()
) -> list[Clip]:
    """Read a BVH into a clip for each ROOT, one usually.

    Parameters
    ----------
    path
        The file.
    metres_per_unit
        Metres of the file's unit; guessed from the body's size when not given.
    frame_rate
        Frames per second; by default the file's own.
    joints
        Names of the clip's joints (`library.recordings.formats.joint_choice.chosen`); when not given, all joints that
        never coincide.

    Returns
    -------
    The clips: positions (frames, joints, 3) in metres, and `rotations`, the recorded angles in radians.

    Raises
    ------
    RecordingError
        The file is no BVH, is malformed or cut off.
    ValueError
        It lacks a joint that is asked for, or its numbers are too large to compute with.
    OSError
        The file cannot be opened.
    """
    bodies = [*_performers(read_bvh(path, frame_rate))]
    # Joints may be asked of one body alone.
    asked = [body for body in bodies if any(starmap(fnmatchcase, product((each.name for each in body.joints), joints)))]
    bodies = asked or bodies
    if not bodies:
        refuse(path, 1, "expected a ROOT with joints, got ROOTs alone")
    clips = [hdm05.titled(_clip(body, metres_per_unit, joints, path.stem), path) for body in bodies]
    roots, _ = short_names([body.joints[0].name for body in bodies])
    return [replace(clip, actor=root) for clip, root in zip(clips, roots, strict=True)] if len(clips) > 1 else clips


def _clip(motion: BvhMotion, metres_per_unit: float | None, joints: Sequence[str], name: str) -> Clip:
    displaced, passing = _displaced(motion)
    kept, parents = _kept(motion.joints, displaced, joints)
    names, twice = short_names([motion.joints[index].name for index in kept])
    skeleton = Skeleton(names, parents)
    positions = forward_kinematics(motion)[:, kept]
    if not np.isfinite(positions).all():
        raise ValueError("expected places of joints, got numbers too large to compute with")
    positions *= metres_per_unit or guessed_metres(positions, names)
    turns = [name[0] == "r" for joint in motion.joints for name in joint.channels]
    return Clip(
        skeleton=skeleton,
        positions=positions,
        frame_rate=motion.frame_rate,
        name=name,
        rotations=np.radians(motion.channels[:, turns]),
        notes=(*motion.notes, *twice, *passing),
    )
