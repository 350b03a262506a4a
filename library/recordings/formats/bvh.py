"""BVH recordings (Biovision hierarchy) read into clips.

A BVH gives every joint an offset from its parent and channels: rotations, of which the first named is applied last (R =
R₁ · R₂ · R₃), and for the root, in some files for every joint, positions. A joint's position channels replace its
offset, as in MotionBuilder and Blender; where they are 0 in the whole file the offset stays, because some programs
write empty position channels. An End Site is a joint like any other, called after its parent with `_end`. A joint that
always coincides with its parent, or with an earlier child of its parent, is left out.

The file names no unit; `library.formats.units.guessed_metres` guesses it.
"""

from __future__ import annotations

import math
import re
from array import array
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from kinespace.library.clip import Clip
from kinespace.library.distances import distance_rows
from kinespace.library.naming import hdm05
from kinespace.library.recordings.formats.errors import RecordingError, finite_numbers
from kinespace.library.recordings.formats.joint_choice import chosen, short_names
from kinespace.library.recordings.formats.rotations import turn_about
from kinespace.library.recordings.formats.units import guessed_metres
from kinespace.library.skeleton import Skeleton

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

_CHANNEL = re.compile(r"([xyz])(position|rotation)", re.IGNORECASE)
#: Frames whose matrices are held at once.
_BLOCK = 4096
#: An offset shorter than this share of the largest offset counts as none.
_NO_OFFSET = 1e-6


class BvhError(RecordingError):
    """A BVH file cannot be used; the message names the file and the line."""


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
    """

    joints: tuple[BvhJoint, ...]
    channels: NDArray[np.float64]
    frame_rate: float


@dataclass(slots=True)
class _Statement:
    """A brace, or the text between braces and line ends."""

    path: Path
    line: int
    words: list[str]

    def fail(self, what: str) -> NoReturn:
        raise BvhError(f"{self.path}:{self.line}: {what}")

    def floats(self, words: Sequence[str], count: int) -> list[float]:
        try:
            return finite_numbers(words, count)
        except ValueError as error:
            self.fail(str(error))


def _statements(path: Path) -> Iterator[_Statement]:
    # Joint names come in any encoding; a name that is not UTF-8 must not stop the reader.
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for number, text in enumerate(file, start=1):
            for piece in re.split(r"([{}])", text) if "{" in text or "}" in text else (text,):
                if words := piece.split():
                    yield _Statement(path, number, words)


class _HierarchyReader:
    """Collects the joints while the statements of the hierarchy go by."""

    def __init__(self) -> None:
        self.joints: list[BvhJoint] = []
        #: Indices of the joints whose braces are open; -1 before the root.
        self._open = [-1]
        self._named = ""
        self._ends = dict[int, int]()

    def take(self, statement: _Statement) -> bool:
        """Take in one statement; return whether the hierarchy ends before it."""
        word = statement.words[0].lower()
        if self._named and word != "{":
            statement.fail(f"expected {{ after {self._named!r}, got {statement.words[0]!r}")
        match word:
            case "hierarchy":
                pass
            case "root" | "joint" | "end":
                self._name(word, statement)
            case "{":
                if not self._named:
                    statement.fail("expected ROOT, JOINT or End Site before {")
                self.joints.append(BvhJoint(self._named, self._open[-1], (math.nan,) * 3))
                self._open.append(len(self.joints) - 1)
                self._named = ""
            case "}":
                self._close(statement)
            case "offset":
                x, y, z = statement.floats(statement.words[1:], 3)
                self._describe(statement, offset=(x, y, z))
            case "channels":
                self._describe(statement, channels=_channels(statement))
            case "motion":
                self._finish(statement)
                return True
            case _:
                statement.fail(f"expected a word of a BVH hierarchy, got {statement.words[0][:40]!r}")
        return False

    def _name(self, word: str, statement: _Statement) -> None:
        if (word == "root") != (self._open == [-1]):
            statement.fail("expected one ROOT with all joints: one performer in a file")
        if word == "root" and self.joints:
            statement.fail("a second ROOT: expected one performer in a file")
        name = " ".join(statement.words[1:])
        if word == "end":
            parent = self._open[-1]
            self._ends[parent] = self._ends.get(parent, 0) + 1
            name = f"{self.joints[parent].name}_end{self._ends[parent] if self._ends[parent] > 1 else ''}"
        if not name:
            statement.fail(f"expected a name after {statement.words[0]!r}")
        if any(joint.name == name for joint in self.joints):
            statement.fail(f"joint {name!r} stands in it twice")
        self._named = name

    def _describe(
        self,
        statement: _Statement,
        *,
        offset: tuple[float, float, float] | None = None,
        channels: tuple[str, ...] | None = None,
    ) -> None:
        if self._open == [-1]:
            statement.fail(f"{statement.words[0]} stands outside a joint")
        index = self._open[-1]
        joint = self.joints[index]
        if offset is not None:
            self.joints[index] = replace(joint, offset=offset)
        if channels is not None:
            if joint.channels or index != len(self.joints) - 1:
                statement.fail(f"expected the channels of {joint.name!r} once, and before its children")
            self.joints[index] = replace(joint, channels=channels)

    def _close(self, statement: _Statement) -> None:
        if self._open == [-1]:
            statement.fail("a } without its {")
        joint = self.joints[self._open.pop()]
        if math.isnan(joint.offset[0]):
            statement.fail(f"joint {joint.name!r} has no OFFSET")

    def _finish(self, statement: _Statement) -> None:
        if self._open != [-1]:
            statement.fail(f"joint {self.joints[self._open[-1]].name!r} is not closed with }}")
        if len(self.joints) < 2:
            statement.fail(f"expected a hierarchy of at least 2 joints, got {len(self.joints)}")


def _channels(statement: _Statement) -> tuple[str, ...]:
    count, *names = statement.words[1:] or [""]
    found = [_CHANNEL.fullmatch(name) for name in names]
    channels = tuple(each[2][0].lower() + each[1].lower() for each in found if each)
    if not count.isdecimal() or int(count) != len(names) or len(set(channels)) != len(names):
        statement.fail(
            f"expected CHANNELS, how many, and so many of Xposition ... Zrotation, got {' '.join(statement.words)!r}"
        )
    return channels


def read_bvh(path: Path) -> BvhMotion:
    """Read a BVH as it stands, line by line.

    Raises
    ------
    BvhError
        The file is no BVH, its hierarchy makes no sense, a frame has too few or too many numbers, or frames are
        missing.
    OSError
        The file cannot be opened.
    """
    reader = _BvhReader(path)
    channels = np.concatenate(list(reader.blocks()))
    return BvhMotion(reader.joints, channels, reader.frame_rate)


class _BvhReader:
    """Reads a BVH's head, then its frames some at a time.

    Attributes
    ----------
    joints
        In the file's order.
    frame_rate
        Frames per second.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._statements = _statements(path)
        hierarchy = _HierarchyReader()
        statement = _Statement(path, 1, [])
        for statement in self._statements:
            if hierarchy.take(statement):
                break
        else:
            statement.fail("expected HIERARCHY and MOTION, got a file that ends before its motion")
        self._frames, self.frame_rate, self._last = _motion_header(self._statements, statement)
        self.joints = tuple(hierarchy.joints)
        self._size = sum(len(joint.channels) for joint in self.joints)

    def blocks(self) -> Iterator[NDArray[np.float64]]:
        """Give the frames' numbers, some frames at a time, (frames, channels); can be iterated once."""
        frames, values, line = 0, array("d"), self._last
        for line in self._statements:
            if frames == self._frames:
                line.fail(f"a frame more than the {self._frames} that were announced")
            if len(line.words) != self._size:
                line.fail(f"expected {self._size} numbers, got {len(line.words)}")
            try:
                values.extend(map(float, line.words))
            except ValueError:
                line.floats(line.words, self._size)
            frames += 1
            if not frames % _BLOCK:
                yield self._finite(values, frames)
                values = array("d")
        if frames != self._frames:
            line.fail(f"the file ends after {frames} of {self._frames} frames")
        if values:
            yield self._finite(values, frames)

    def _finite(self, values: array[float], frames: int) -> NDArray[np.float64]:
        """Refuse numbers that are not finite, in the frames up to `number`."""
        channels = np.frombuffer(values, dtype=np.float64).reshape(-1, self._size)
        finite = np.isfinite(channels).all(axis=1)
        if not finite.all():
            number = frames - len(channels) + int(np.argmin(finite)) + 1
            raise BvhError(f"{self._path}: NaN or infinity in frame {number}")
        return channels


def _motion_header(statements: Iterator[_Statement], last: _Statement) -> tuple[int, float, _Statement]:
    """Read `Frames: 100` and `Frame Time: 0.01`: frames, frames per second, and the last statement of the two."""
    last, frames = _after("Frames", statements, last)
    if not frames.isdecimal() or len(frames) > 9 or int(frames) == 0:
        last.fail(f"expected a number of frames, got {frames!r}")
    last, period = _after("Frame Time", statements, last)
    (seconds,) = last.floats([period], 1)
    if seconds <= 0:
        last.fail(f"expected a positive Frame Time, got {period}")
    return int(frames), _frame_rate(period), last


def _after(name: str, statements: Iterator[_Statement], last: _Statement) -> tuple[_Statement, str]:
    statement = next(statements, last)
    key, colon, value = " ".join(statement.words).partition(":")
    if key.strip().lower() != name.lower() or not colon:
        statement.fail(f"expected {name}: and a number, got {' '.join(statement.words)[:60]!r}")
    return statement, value.strip()


def _frame_rate(period: str) -> float:
    """Frames per second: the whole number from which the period was rounded, if there is one (0.0083333 is 120)."""
    seconds = float(period)
    rate = 1.0 / seconds
    decimals = len(period.lower().partition("e")[0].partition(".")[2])
    rounded = abs(1.0 / max(round(rate), 1) - seconds) <= 0.5001 * 10.0**-decimals
    return float(round(rate)) if rounded and round(rate) and "e" not in period.lower() else rate


def forward_kinematics(motion: BvhMotion, displaced: Sequence[bool] | None = None) -> NDArray[np.float64]:
    """Work out the position of every joint, (frames, joints, 3), in the file's unit.

    A joint's frame is M = M_parent · R₁ · R₂ · R₃; it stands at p = p_parent + M_parent · offset. Many frames at once,
    one joint at a time.

    Parameters
    ----------
    motion
        The whole motion, or some frames of it.
    For each joint whether its position channels hold a number in the whole motion; when not given, in these frames.
        Of each joint, whether its position channels say anything in the whole motion; when not given, in these frames.
    """
    positions = np.empty((len(motion.channels), len(motion.joints), 3))
    displaced = _displaced(motion) if displaced is None else displaced
    for start in range(0, len(positions), _BLOCK):
        block = slice(start, start + _BLOCK)
        _place(motion.joints, motion.channels[block], displaced, positions[block])
    return positions


def _place(
    joints: Sequence[BvhJoint],
    channels: NDArray[np.float64],
    displaced: Sequence[bool],
    positions: NDArray[np.float64],
) -> None:
    turned: list[NDArray[np.float64]] = []
    column = 0
    for index, joint in enumerate(joints):
        own = channels[:, column : column + len(joint.channels)]
        column += len(joint.channels)
        offset = np.tile(np.array(joint.offset), (len(channels), 1))
        local = np.broadcast_to(np.eye(3), (len(channels), 3, 3))
        for name, numbers in zip(joint.channels, own.T, strict=True):
            if name[0] == "r":
                local = local @ turn_about(name[1], np.radians(numbers))
            elif displaced[index]:
                offset[:, "xyz".index(name[1])] = numbers
        if joint.parent < 0:
            positions[:, index] = offset
            turned.append(local)
        else:
            above = turned[joint.parent]
            positions[:, index] = positions[:, joint.parent] + (above @ offset[:, :, None])[:, :, 0]
            turned.append(above @ local)


def _displaced(motion: BvhMotion) -> list[bool]:
    """Tell for each joint whether its position channels hold a number other than 0."""
    displaced, column = list[bool](), 0
    for joint in motion.joints:
        own = motion.channels[:, column : column + len(joint.channels)]
        column += len(joint.channels)
        displaced.append(bool(own[:, [name[0] == "p" for name in joint.channels]].any()))
    return displaced


def _displaced_in(path: Path) -> list[bool]:
    """Tell the same of a file; reads only as many frames as are needed, mostly the first ones."""
    reader = _BvhReader(path)
    movable = [any(name[0] == "p" for name in joint.channels) for joint in reader.joints]
    displaced = [False] * len(movable)
    for channels in reader.blocks():
        here = _displaced(BvhMotion(reader.joints, channels, reader.frame_rate))
        displaced = [before or now for before, now in zip(displaced, here, strict=True)]
        if displaced == movable:
            break
    return displaced


def _representatives(joints: Sequence[BvhJoint], displaced: Sequence[bool]) -> list[int]:
    """Give for each joint the first joint that it always coincides with, or itself when there is none."""
    largest = max(max(map(abs, joint.offset)) for joint in joints) or 1.0
    firsts: list[int] = []
    for index, joint in enumerate(joints):
        first = index
        if joint.parent >= 0 and not displaced[index]:
            if max(map(abs, joint.offset)) < _NO_OFFSET * largest:
                first = firsts[joint.parent]
            else:
                for earlier in range(index):
                    other = joints[earlier]
                    if other.parent == joint.parent and other.offset == joint.offset and not displaced[earlier]:
                        first = earlier
                        break
        firsts.append(first)
    return firsts


def _kept(
    joints: Sequence[BvhJoint], displaced: Sequence[bool], wanted: Sequence[str]
) -> tuple[list[int], tuple[int, ...]]:
    """Choose the joints of the clip: their indices in the file, and their parents among the chosen joints."""
    firsts = _representatives(joints, displaced)
    names = [joint.name for joint in joints]
    kept, taken = list[int](), set[int]()
    for index in chosen(names, wanted):
        if firsts[index] not in taken:
            kept.append(index)
        elif names[index] in wanted:
            raise ValueError(f"{names[index]!r} always coincides with another chosen joint")
        taken.add(firsts[index])
    places = {firsts[index]: place for place, index in enumerate(kept)}
    parents = []
    for place, index in enumerate(kept):
        above = joints[firsts[index]].parent
        while above >= 0 and firsts[above] not in places:
            above = joints[firsts[above]].parent
        # Where the joint above two chosen joints is not chosen, the first chosen joint takes its place.
        parents.append(places[firsts[above]] if above >= 0 else (-1 if place == 0 else 0))
    return kept, tuple(parents)


def read_clip(
    path: Path, *, metres_per_unit: float | None = None, frame_rate: float | None = None, joints: Sequence[str] = ()
) -> Clip:
    """Read a BVH into a clip.

    Parameters
    ----------
    path
        The file.
    metres_per_unit
        Metres of the file's unit; guessed from the body's size when not given.
    Frames per second; the file's own rate when not given.
        Frames per second; by default the file's own.
    joints
        Names of the clip's joints (`library.formats.joint_choice.chosen`); when not given, all joints that never
        coincide.

    Returns
    -------
    The clip: positions (frames, joints, 3) in metres, and `rotations`, the recorded angles in radians.

    Raises
    ------
    BvhError
        The file is no BVH, is malformed or cut off, or lacks a joint that is asked for.
    OSError
        The file cannot be opened.
    """
    motion = read_bvh(path)
    wanted = _Wanted(metres_per_unit, frame_rate, tuple(joints))
    (clip,) = _clips(path, [motion], _displaced(motion), wanted)
    return clip


def read_pieces(
    path: Path, *, metres_per_unit: float | None = None, frame_rate: float | None = None, joints: Sequence[str] = ()
) -> Iterator[Clip]:
    """Read a BVH as clips of some seconds that follow each other; the whole motion is never in memory.

    Parameters
    ----------
    path, metres_per_unit, frame_rate, joints
        The same as for `read_clip`.

    Yields
    ------
    The pieces; put together they are the clip that `read_clip` gives.

    Raises
    ------
    BvhError, OSError
        As `read_clip`, once the place of the mistake is reached.
    """
    displaced = _displaced_in(path)
    reader = _BvhReader(path)
    motions = (BvhMotion(reader.joints, channels, reader.frame_rate) for channels in reader.blocks())
    yield from _clips(path, motions, displaced, _Wanted(metres_per_unit, frame_rate, tuple(joints)))


@dataclass(frozen=True, slots=True)
class _Wanted:
    metres_per_unit: float | None
    frame_rate: float | None
    joints: tuple[str, ...]


def _clips(path: Path, motions: Iterable[BvhMotion], displaced: Sequence[bool], wanted: _Wanted) -> Iterator[Clip]:
    """Make a clip of each of some motions of one body; the first motion shows how large the body is."""
    metres = wanted.metres_per_unit
    named = hdm05.read_clip_name(path)
    for motion in motions:
        try:
            kept, parents = _kept(motion.joints, displaced, wanted.joints)
            skeleton = Skeleton(short_names([motion.joints[index].name for index in kept]), parents)
        except ValueError as error:
            raise BvhError(f"{path}: {error}") from error
        positions = forward_kinematics(motion, displaced)[:, kept]
        if not np.isfinite(positions).all():
            raise BvhError(f"{path}: expected places of joints, got numbers too large to compute with")
        metres = metres or guessed_metres(float(distance_rows(positions[0], skeleton).max()))
        positions *= metres
        turns = [name[0] == "r" for joint in motion.joints for name in joint.channels]
        clip = Clip(
            skeleton=skeleton,
            positions=positions,
            frame_rate=motion.frame_rate if wanted.frame_rate is None else wanted.frame_rate,
            name=path.stem,
            rotations=np.radians(motion.channels[:, turns]),
        )
        yield replace(clip, class_name=named.class_name, actor=named.actor, take=named.take) if named else clip
