"""Acclaim recordings (ASF skeleton, AMC motion) read into clips.

HDM05 and the CMU Graphics Lab Motion Capture Database use these formats. An ASF gives each bone a direction,
a length and the axis frame in which its rotations are measured; an AMC gives the angles of every frame. Where a bone's
`dof` and `axis` disagree in order, `dof` says which number is which angle, and `axis` says in which order the angles
are applied; the root's `order` and `axis` do the same.
"""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, NoReturn

import numpy as np

from kinespace.library.clip import Clip
from kinespace.library.naming import hdm05
from kinespace.library.recordings.formats.errors import RecordingError, finite_numbers
from kinespace.library.recordings.formats.gap_filling import with_missing_frames
from kinespace.library.recordings.formats.rotations import turn_about
from kinespace.library.skeleton import Skeleton

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

METRES_PER_INCH = 0.0254
#: HDM05's and CMU's rate, assumed of an AMC that names no rate.
DEFAULT_FRAME_RATE = 120.0

#: How much of an AMC is read at once, about, and how many frames when it is read line by line: some ten seconds.
_BLOCK_BYTES, _BLOCK_FRAMES = 1 << 20, 1024
#: Missing frames that a long take may always have, even where few frames have come so far.
_FEW_MISSING = 1024

AngleUnit = Literal["deg", "rad"]


class AcclaimError(RecordingError):
    """An ASF or AMC file cannot be used; the message names the file and, where there is one, the line."""


@dataclass(frozen=True, slots=True)
class Bone:
    """One bone, or the root, of an ASF.

    Attributes
    ----------
    offset
        From the parent joint to this one in the rest pose, shape (3,), metres.
    axis
        Rotation matrix of the frame in which the bone's angles are measured, shape (3, 3).
    axis_order
        The order in which the angles are applied, three of "xyz".
    channels
        The meaning of each number on the bone's AMC line: "rx", "ry", "rz", and for the root also "tx", "ty", "tz".
    """

    name: str
    offset: NDArray[np.float64]
    axis: NDArray[np.float64]
    axis_order: str
    channels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class AcclaimSkeleton:
    """The content of an ASF: bones in the hierarchy's order, the root first."""

    skeleton: Skeleton
    bones: tuple[Bone, ...]
    metres_per_unit: float
    angle: AngleUnit

    @property
    def channel_count(self) -> int:
        """How many numbers an AMC gives for each frame."""
        return sum(len(bone.channels) for bone in self.bones)


@dataclass(frozen=True, slots=True)
class _Line:
    """A line of a file with its comment and white space removed, and where it stands."""

    path: Path
    number: int
    words: list[str]

    def fail(self, what: str) -> NoReturn:
        raise AcclaimError(f"{self.path}:{self.number}: {what}")

    def floats(self, first: int, count: int) -> list[float]:
        try:
            return finite_numbers(self.words[first : first + count], count, f" after {self.words[0]!r}")
        except ValueError as error:
            self.fail(str(error))


def _lines(path: Path) -> Iterator[_Line]:
    # Latin-1 decodes every byte: HDM05's comments hold umlauts in an unnamed encoding.
    with path.open(encoding="latin-1") as file:
        for number, text in enumerate(file, start=1):
            words = text.partition("#")[0].split()
            if words:
                yield _Line(path, number, words)


@dataclass(slots=True)
class _AsfReader:
    """Collects the sections of one ASF while its lines go by."""

    path: Path
    length_unit: float = 1.0
    angle: AngleUnit = "deg"
    root: dict[str, _Line] = field(default_factory=dict)
    bones: dict[str, dict[str, _Line]] = field(default_factory=dict)
    parents: dict[str, str] = field(default_factory=dict)

    def read(self) -> AcclaimSkeleton:
        section, entry = "", dict[str, _Line]()
        for line in _lines(self.path):
            word = line.words[0].lower()
            if word.startswith(":"):
                section = word
            elif section == ":units":
                self._read_unit(word, line)
            elif section == ":root":
                self.root[word] = line
            elif section == ":bonedata":
                entry = self._read_bonedata(word, line, entry)
            elif section == ":hierarchy" and word not in ("begin", "end"):
                self._read_children(line)
        return self._finish()

    def _read_unit(self, word: str, line: _Line) -> None:
        if word == "length":
            (self.length_unit,) = line.floats(1, 1)
            if self.length_unit <= 0:
                line.fail(f"expected a positive unit of length, got {self.length_unit}")
        elif word == "angle":
            unit = line.words[-1].lower()
            if unit not in ("deg", "rad"):
                line.fail(f"expected angle deg or rad, got {unit!r}")
            self.angle = "rad" if unit == "rad" else "deg"

    def _read_bonedata(self, word: str, line: _Line, entry: dict[str, _Line]) -> dict[str, _Line]:
        if word == "begin":
            return {}
        if word == "name":
            name = line.words[-1]
            if name in self.bones or name == "root":
                line.fail(f"bone {name!r} is described twice")
            self.bones[name] = entry
        entry[word] = line
        return entry

    def _read_children(self, line: _Line) -> None:
        parent, *children = line.words
        if parent != "root" and parent not in self.parents:
            line.fail(f"bone {parent!r} has children before it has a parent")
        for child in children:
            if child not in self.bones:
                line.fail(f"bone {child!r} stands in the hierarchy but not in :bonedata")
            if child in self.parents:
                line.fail(f"bone {child!r} has two parents")
            self.parents[child] = parent

    def _finish(self) -> AcclaimSkeleton:
        orphans = [name for name in self.bones if name not in self.parents]
        if not self.bones or orphans:
            what = f"bones without a parent: {', '.join(orphans)}" if orphans else "no :bonedata in it"
            raise AcclaimError(f"{self.path}: not a usable ASF skeleton, {what}")
        metres = METRES_PER_INCH / self.length_unit
        names = ["root", *self.parents]
        bones = [self._finish_root(metres), *(self._finish_bone(name, metres) for name in self.parents)]
        places = {name: place for place, name in enumerate(names)}
        parents = (-1, *(places[parent] for parent in self.parents.values()))
        return AcclaimSkeleton(Skeleton(tuple(names), parents), tuple(bones), metres, self.angle)

    def _finish_root(self, metres: float) -> Bone:
        for word in ("order", "axis"):
            if word not in self.root:
                raise AcclaimError(f"{self.path}: no {word!r} in :root")
        channels = self._channels(self.root["order"], allowed=("tx", "ty", "tz", "rx", "ry", "rz"))
        order = self._rotation_order(self.root["axis"], self.root["axis"].words[-1])
        position = self.root["position"].floats(1, 3) if "position" in self.root else [0.0] * 3
        orientation = self.root["orientation"].floats(1, 3) if "orientation" in self.root else [0.0] * 3
        axis = self._axis_frame(order, orientation)
        return Bone("root", np.array(position) * metres, axis, order, channels)

    def _finish_bone(self, name: str, metres: float) -> Bone:
        entry = self.bones[name]
        for word in ("direction", "length", "axis"):
            if word not in entry:
                entry["name"].fail(f"bone {name!r} has no {word}")
        offset = np.array(entry["direction"].floats(1, 3)) * entry["length"].floats(1, 1)[0] * metres
        angles = entry["axis"].floats(1, 3)
        order = self._rotation_order(entry["axis"], entry["axis"].words[4] if len(entry["axis"].words) > 4 else "XYZ")
        axis = self._axis_frame(order, angles)
        channels = self._channels(entry["dof"], allowed=("rx", "ry", "rz")) if "dof" in entry else ()
        return Bone(name, offset, axis, order, channels)

    def _axis_frame(self, order: str, angles: list[float]) -> NDArray[np.float64]:
        from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to load, and a live feed does not need it

        return Rotation.from_euler(order, angles, degrees=self.angle == "deg").as_matrix()

    @staticmethod
    def _channels(line: _Line, allowed: tuple[str, ...]) -> tuple[str, ...]:
        channels = tuple(word.lower() for word in line.words[1:])
        unknown = [channel for channel in channels if channel not in allowed]
        if unknown or len(set(channels)) != len(channels):
            line.fail(f"expected some of {', '.join(allowed)}, each once, got {' '.join(channels)!r}")
        return channels

    @staticmethod
    def _rotation_order(line: _Line, word: str) -> str:
        order = word.lower()
        if sorted(order) != ["x", "y", "z"]:
            line.fail(f"expected a rotation order like XYZ, got {word!r}")
        return order


def read_asf(path: Path) -> AcclaimSkeleton:
    """Read an ASF skeleton.

    Raises
    ------
    AcclaimError
        Not an ASF, or its hierarchy, axes or degrees of freedom make no sense; the message says where.
    OSError
        The file cannot be opened.
    """
    return _AsfReader(path).read()


@dataclass(frozen=True, slots=True)
class _Motion:
    """The numbers of an AMC: one row of channels for each frame, the angles in the file's unit."""

    channels: NDArray[np.float64]
    frame_numbers: NDArray[np.int64]
    angle: AngleUnit
    frame_rate: float | None

    def after(self, frames: int) -> _Motion:
        """Give the frames after the first `count`."""
        return replace(self, channels=self.channels[frames:], frame_numbers=self.frame_numbers[frames:])


class _IrregularError(Exception):
    """Frames of an AMC do not all list the same bones in the same order."""


def _read_amc(path: Path, body: AcclaimSkeleton) -> _Motion:
    blocks = list(_blocks(path, body))
    channels = np.concatenate([block.channels for block in blocks])
    numbers = np.concatenate([block.frame_numbers for block in blocks])
    motion = _checked(path, _Motion(channels, numbers, blocks[-1].angle, blocks[-1].frame_rate))
    _require_most_of(path, len(numbers), int(numbers[-1] - numbers[0]) + 1)
    return motion


def _blocks(path: Path, body: AcclaimSkeleton) -> Iterator[_Motion]:
    """Read an AMC some frames at a time, at least one frame in all."""
    given = 0
    try:
        for block in _regular_blocks(path, body):
            given += len(block.frame_numbers)
            yield block
    except _IrregularError:
        # Frames that were given already are not given again. A mistake in the file is told with its line.
        for block in _blocks_by_line(path, body):
            left = block.after(given)
            given -= len(block.frame_numbers) - len(left.frame_numbers)
            if len(left.frame_numbers):
                yield left


def _regular_blocks(path: Path, body: AcclaimSkeleton) -> Iterator[_Motion]:
    """Read an AMC whose frames all list the same bones in the same order, as nearly every AMC does.

    Works on columns of words, which is much faster than line by line. Raises _IrregularError where the frames are not,
    or from some frame on no longer, alike.
    """
    with path.open(encoding="latin-1") as file:
        angle, frame_rate = body.angle, None
        for number, text in enumerate(file, start=1):
            words = text.partition("#")[0].split()
            if len(words) == 1 and _is_frame_number(words[0]):
                break
            if words and not words[0].startswith(":"):
                raise _IrregularError
            if words:
                angle, frame_rate = _read_keyword(_Line(path, number, words), angle, frame_rate)
        else:
            raise _IrregularError
        period = 1 + len(_channel_places(body)) + body.channel_count
        while lines := file.readlines(_BLOCK_BYTES):
            words += "".join(lines).split()
            whole = len(words) // period * period
            if whole:
                numbers, channels = _columns(words[:whole], body)
                yield _Motion(channels, numbers, angle, frame_rate)
                words = words[whole:]
    if words:
        raise _IrregularError


def _columns(words: list[str], body: AcclaimSkeleton) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Read whole frames of words: their numbers and channels; _IrregularError when the frames are not alike."""
    places = _channel_places(body)
    period = 1 + len(places) + body.channel_count
    frames = len(words) // period
    channels = np.empty((frames, body.channel_count))
    column, unseen = 1, set(places)
    while unseen:
        name = words[column] if column < period else ""
        if name not in unseen or words[column::period].count(name) != frames:
            raise _IrregularError
        unseen.remove(name)
        for channel in range(places[name].start, places[name].stop):
            column += 1
            try:
                channels[:, channel] = [float(word) for word in words[column::period]]
            except ValueError:
                raise _IrregularError from None
        column += 1
    numbers = words[::period]
    if not all(map(_is_frame_number, numbers)):
        raise _IrregularError
    return np.array(list(map(int, numbers)), dtype=np.int64), channels


def _blocks_by_line(path: Path, body: AcclaimSkeleton) -> Iterator[_Motion]:
    reader = _AmcReader(body)
    line = _Line(path, 0, [])
    for line in _lines(path):
        if reader.take(line) >= _BLOCK_FRAMES:
            yield reader.taken()
    reader.finish(line)
    yield reader.taken()


class _AmcReader:
    """Collects the frames of an AMC while its lines go by, bones in any order, and says on which line reading fails."""

    def __init__(self, body: AcclaimSkeleton) -> None:
        self._body = body
        self._places = _channel_places(body)
        self._frame = [0.0] * body.channel_count
        self._unseen = set[str]()
        self._numbers, self._values = array("q"), array("d")
        self._angle: AngleUnit = body.angle
        self._frame_rate: float | None = None
        self._any = False

    def take(self, line: _Line) -> int:
        """Take in one line; give how many whole frames can be taken out."""
        word = line.words[0]
        if word in self._places:
            self._take_bone(word, line)
        elif _is_frame_number(word) and len(line.words) == 1:
            if self._unseen:
                line.fail(f"the frame before has no {', '.join(sorted(self._unseen))}")
            self._numbers.append(int(word))
            self._any = True
            self._unseen = set(self._places)
        elif word.startswith(":"):
            self._angle, self._frame_rate = _read_keyword(line, self._angle, self._frame_rate)
        else:
            line.fail(f"expected a frame number or a bone of the skeleton's {len(self._body.bones)}, got {word!r}")
        return len(self._numbers) - bool(self._unseen)

    def _take_bone(self, word: str, line: _Line) -> None:
        place = self._places[word]
        if word not in self._unseen:
            line.fail(f"bone {word!r} stands twice in a frame, or before the first frame number")
        if len(line.words) - 1 != place.stop - place.start:
            line.fail(f"expected {place.stop - place.start} numbers for {word!r}, got {len(line.words) - 1}")
        self._frame[place] = line.floats(1, place.stop - place.start)
        self._unseen.remove(word)
        if not self._unseen:
            self._values.extend(self._frame)

    def finish(self, last: _Line) -> None:
        """Refuse a file that ends in the middle of a frame, or before the first frame."""
        if not self._any:
            last.fail("no frames in it")
        if self._unseen:
            last.fail(f"the file ends in the middle of frame {self._numbers[-1]}")

    def taken(self) -> _Motion:
        """Take the whole frames out."""
        frames = len(self._numbers) - bool(self._unseen)
        numbers, self._numbers = self._numbers[:frames], self._numbers[frames:]
        values, self._values = self._values, array("d")
        channels = np.array(values, dtype=np.float64).reshape(-1, self._body.channel_count)
        return _Motion(channels, np.array(numbers, dtype=np.int64), self._angle, self._frame_rate)


def _is_frame_number(word: str) -> bool:
    # Not isdigit, which accepts a superscript two; 18 digits always fit into an int64.
    return word.isdecimal() and len(word) <= 18


def _channel_places(body: AcclaimSkeleton) -> Mapping[str, slice]:
    places, start = {}, 0
    for bone in body.bones:
        if bone.channels:
            places[bone.name] = slice(start, start + len(bone.channels))
            start += len(bone.channels)
    return places


def _read_keyword(line: _Line, angle: AngleUnit, rate: float | None) -> tuple[AngleUnit, float | None]:
    match line.words[0].lower():
        case ":degrees":
            return "deg", rate
        case ":radians":
            return "rad", rate
        case ":samples-per-second":
            (rate,) = line.floats(1, 1)
            if rate <= 0:
                line.fail(f"expected a positive frame rate, got {rate}")
            return angle, rate
        case _:
            return angle, rate


def _checked(path: Path, motion: _Motion, before: int | None = None) -> _Motion:
    """Refuse numbers that are not finite, and frame numbers that do not grow; the frame before the first is given."""
    bad = np.flatnonzero(~np.isfinite(motion.channels).all(axis=1))
    if bad.size:
        raise AcclaimError(f"{path}: NaN or infinity in frame {motion.frame_numbers[bad[0]]}")
    numbers = motion.frame_numbers if before is None else np.concatenate([[before], motion.frame_numbers])
    steps = np.diff(numbers)
    if (steps < 1).any():
        late = numbers[int(np.argmax(steps < 1)) + 1]
        raise AcclaimError(f"{path}: expected growing frame numbers, frame {late} comes too late")
    return motion


def _require_most_of(path: Path, frames: int, span: int, *, spare: int = 0) -> None:
    if span > 2 * frames + spare:
        raise AcclaimError(f"{path}: {span - frames} of {span} frames are missing, more than are there")


def _forward_kinematics(body: AcclaimSkeleton, channels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn channels (frames, channels; translations in metres, angles in radians) into positions.

    A joint's frame is M = M_parent · C · R · C⁻¹, with C the bone's axis frame and R its rotation; the joint stands
    at p = p_parent + M · offset. All frames at once, one bone at a time.
    """
    places = _channel_places(body)
    positions = np.empty((len(channels), len(body.bones), 3))
    turned: list[NDArray[np.float64]] = []
    for index, (bone, parent) in enumerate(zip(body.bones, body.skeleton.parents, strict=True)):
        own = channels[:, places[bone.name]] if bone.channels else channels[:, :0]
        local = bone.axis @ _rotation(bone, own) @ bone.axis.T
        if parent < 0:
            turned.append(local)
            positions[:, index] = bone.offset + _translation(bone, own)
        else:
            turned.append(turned[parent] @ local)
            positions[:, index] = positions[:, parent] + turned[index] @ bone.offset
    return positions


def _rotation(bone: Bone, own: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compose a bone's angles (frames, channels), the first of its axis order applied first; (frames, 3, 3).

    Written out, because one scipy `Rotation` for each bone and frame makes the reader much slower.
    """
    composed = np.broadcast_to(np.eye(3), (len(own), 3, 3))
    for name in bone.axis_order:
        if f"r{name}" in bone.channels:
            composed = turn_about(name, own[:, bone.channels.index(f"r{name}")]) @ composed
    return composed


def _translation(bone: Bone, own: NDArray[np.float64]) -> NDArray[np.float64]:
    moved = np.zeros((len(own), 3))
    for place, name in enumerate("xyz"):
        if f"t{name}" in bone.channels:
            moved[:, place] = own[:, bone.channels.index(f"t{name}")]
    return moved


def _in_si(body: AcclaimSkeleton, motion: _Motion) -> NDArray[np.float64]:
    """Scale channels to metres and radians."""
    kinds = [channel for bone in body.bones for channel in bone.channels]
    per_degree = math.radians(1.0) if motion.angle == "deg" else 1.0
    return motion.channels * [body.metres_per_unit if kind[0] == "t" else per_degree for kind in kinds]


def find_asf(amc: Path) -> Path:
    """Find the skeleton of an AMC by name, beside it or one folder up.

    The skeleton of `HDM_bd_squat1Reps_001_120.amc` (cut) and `HDM_bd_03-03_01_120.amc` (uncut) is `HDM_bd.asf`, the
    skeleton of `13_29.amc` is `13.asf`. If neither is there, the AMC's own name with `.asf` is tried. Endings may be in
    upper or lower case.

    Raises
    ------
    AcclaimError
        There is none; the message lists the names that were tried.
    """
    named = hdm05.read_clip_name(amc)
    stems = [f"HDM_{named.actor}"] if named else []
    stems += [amc.stem, amc.stem.split("_")[0]]
    for folder in (amc.parent, amc.parent.parent):
        for stem in stems:
            for ending in (".asf", ".ASF"):
                if (folder / f"{stem}{ending}").is_file():
                    return folder / f"{stem}{ending}"
    raise AcclaimError(f"{amc}: no skeleton {' or '.join(f'{stem}.asf' for stem in stems)} beside it or one folder up")


def read_clip(amc: Path, body: AcclaimSkeleton | None = None, *, frame_rate: float | None = None) -> Clip:
    """Read an AMC motion into a clip.

    Parameters
    ----------
    amc
        The motion file, `.amc` in any case.
    body
        Its skeleton; found by name (`find_asf`) and read when not given.
    frame_rate
        Frames per second; when not given, the rate in the file's name (HDM05) or in the file, else 120.

    Returns
    -------
    The clip: positions (frames, joints, 3) in metres, and `rotations`, the recorded angles in radians. Missing frames
    are filled with straight lines between their neighbours.

    Raises
    ------
    AcclaimError
        The file is no AMC or does not fit its skeleton: unknown bone, wrong count, NaN, cut off in the middle.
    OSError
        A file cannot be opened.
    """
    body = body or read_asf(find_asf(amc))
    motion = _read_amc(amc, body)
    return _clip(amc, body, motion, _positions_and_angles(body, motion), frame_rate)


def read_pieces(amc: Path, body: AcclaimSkeleton | None = None, *, frame_rate: float | None = None) -> Iterator[Clip]:
    """Read an AMC motion as clips of some seconds that follow each other; the whole motion is never in memory.

    Parameters
    ----------
    amc, body, frame_rate
        The same as for `read_clip`.

    Yields
    ------
    The pieces; put together they are the clip that `read_clip` gives.

    Raises
    ------
    AcclaimError, OSError
        As `read_clip`, once the place of the mistake is reached.
    """
    body = body or read_asf(find_asf(amc))
    first, frames = 0, 0
    last: tuple[int, NDArray[np.float64], NDArray[np.float64]] | None = None
    for block in _blocks(amc, body):
        motion = _checked(amc, block, None if last is None else last[0])
        numbers, values = motion.frame_numbers, _positions_and_angles(body, motion)
        first = first if last else int(numbers[0])
        frames += len(numbers)
        _require_most_of(amc, frames, int(numbers[-1]) - first + 1, spare=_FEW_MISSING)
        if last is None:
            yield _clip(amc, body, motion, values, frame_rate)
        else:
            # The last frame is kept, so that frames missing after it stand on a straight line too.
            motion = replace(motion, frame_numbers=np.concatenate([[last[0]], numbers]))
            joined = np.concatenate([last[1], values[0]]), np.concatenate([last[2], values[1]])
            piece = _clip(amc, body, motion, joined, frame_rate)
            yield replace(piece, positions=piece.positions[1:], rotations=piece.rotations[1:])
        last = int(numbers[-1]), values[0][-1:], values[1][-1:]
    if last:
        _require_most_of(amc, frames, last[0] - first + 1)


def _positions_and_angles(body: AcclaimSkeleton, motion: _Motion) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    channels = _in_si(body, motion)
    angles = channels[:, [channel[0] == "r" for bone in body.bones for channel in bone.channels]]
    return _forward_kinematics(body, channels), angles


def _clip(
    amc: Path,
    body: AcclaimSkeleton,
    motion: _Motion,
    values: tuple[NDArray[np.float64], NDArray[np.float64]],
    frame_rate: float | None,
) -> Clip:
    """Make a clip of frames; the frames missing between them are put on straight lines."""
    numbers, (positions, angles) = motion.frame_numbers, values
    named = hdm05.read_clip_name(amc)
    said = named.frame_rate if named else motion.frame_rate or DEFAULT_FRAME_RATE
    missing = int(numbers[-1] - numbers[0]) + 1 - len(numbers)
    clip = Clip(
        skeleton=body.skeleton,
        positions=with_missing_frames(numbers, positions.reshape(len(positions), -1)).reshape(-1, len(body.bones), 3),
        frame_rate=said if frame_rate is None else frame_rate,
        name=amc.stem,
        rotations=with_missing_frames(numbers, angles),
        filled=missing * len(body.bones),
    )
    return replace(clip, class_name=named.class_name, actor=named.actor, take=named.take) if named else clip
