"""Acclaim recordings (ASF skeleton, AMC motion) read into clips.

HDM05 and the CMU Graphics Lab Motion Capture Database use these formats. An ASF gives each bone a direction,
a length and the axis frame in which its rotations are measured; an AMC gives the angles of every frame. Where a bone's
`dof` and `axis` disagree in order, `dof` says which number is which angle, and `axis` says in which order the angles
are applied; the root's `order` and `axis` do the same.
"""

import math
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.naming import hdm05
from kinespace.library.recordings.formats.errors import Line, RecordingError, numbers_in, positive_in, refuse
from kinespace.library.recordings.formats.joint_choice import few
from kinespace.library.recordings.formats.rotations import BLOCK, turns
from kinespace.library.recordings.formats.timed_frames import with_missing_frames
from kinespace.library.skeleton import Skeleton

METRES_PER_INCH = 0.0254
#: HDM05's and CMU's rate, assumed of an AMC that names no rate.
DEFAULT_FRAME_RATE = 120.0

#: Keywords of an AMC that name its unit of angles, deg or rad.
_UNITS = {":degrees": "deg", ":radians": "rad"}


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
    angle: str

    @property
    def channels(self) -> list[str]:
        """The meaning of each number that an AMC gives for each frame."""
        return [channel for bone in self.bones for channel in bone.channels]


def _lines(path: Path, most: int | None = None) -> Iterator[tuple[int, list[str]]]:
    """Give the number and the words of each line, comments and empty lines left out."""
    # Latin-1 decodes every byte: HDM05's comments hold umlauts in an unnamed encoding.
    for number, text in enumerate(memory.lines(path, most, encoding="latin-1"), start=1):
        if words := text.partition("#")[0].split():
            yield number, words


class _Line(Line):
    """A line of an ASF, which is understood when all lines are known."""

    def floats(self, count: int) -> list[float]:
        return numbers_in(self.words[1 : 1 + count], self.path, self.number, count, f" after {self.words[0]!r}")

    def order(self, place: int, usual: str = "") -> str:
        """Read the word at a place as the order of three axes."""
        word = self.words[place] if len(self.words) > place else usual
        if sorted(word.lower()) != ["x", "y", "z"]:
            self.fail(f"expected a rotation order like XYZ, got {word!r}")
        return word.lower()

    def channels(self, allowed: tuple[str, ...]) -> tuple[str, ...]:
        channels = tuple(word.lower() for word in self.words[1:])
        if not set(channels) <= set(allowed) or len(set(channels)) != len(channels):
            self.fail(f"expected some of {', '.join(allowed)}, each once, got {' '.join(channels)!r}")
        return channels


@dataclass(slots=True)
class _AsfReader:
    """Collects the sections of one ASF while its lines go by."""

    path: Path
    length_unit: float = 1.0
    angle: str = "deg"
    root: dict[str, _Line] = field(default_factory=dict)
    bones: dict[str, dict[str, _Line]] = field(default_factory=dict)
    parents: dict[str, str] = field(default_factory=dict)

    def read(self) -> AcclaimSkeleton:
        section, entry = "", dict[str, _Line]()
        for number, words in _lines(self.path, memory.MAX_WITHOUT_MOTION):
            word, line = words[0].lower(), _Line(self.path, number, words)
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
            self.length_unit = positive_in(line.words[1:2], self.path, line.number, "unit of length")
        elif word == "angle":
            self.angle = line.words[-1].lower()
            if self.angle not in ("deg", "rad"):
                line.fail(f"expected angle deg or rad, got {self.angle!r}")

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
            raise RecordingError(f"{self.path}: not a usable ASF skeleton, {what}")
        metres = METRES_PER_INCH / self.length_unit
        names = few(["root", *self.parents])
        bones = [self._finish_root(metres), *(self._finish_bone(name, metres) for name in self.parents)]
        places = {name: place for place, name in enumerate(names)}
        parents = (-1, *(places[parent] for parent in self.parents.values()))
        return AcclaimSkeleton(Skeleton(names, parents), tuple(bones), metres, self.angle)

    def _finish_root(self, metres: float) -> Bone:
        for word in ("order", "axis"):
            if word not in self.root:
                raise RecordingError(f"{self.path}: no {word!r} in :root")
        channels = self.root["order"].channels(("tx", "ty", "tz", "rx", "ry", "rz"))
        order = self.root["axis"].order(-1)
        position, orientation = (
            self.root[word].floats(3) if word in self.root else [0.0] * 3 for word in ("position", "orientation")
        )
        return Bone("root", np.array(position) * metres, self._axis_frame(order, orientation), order, channels)

    def _finish_bone(self, name: str, metres: float) -> Bone:
        entry = self.bones[name]
        for word in ("direction", "length", "axis"):
            if word not in entry:
                entry["name"].fail(f"bone {name!r} has no {word}")
        offset = np.array(entry["direction"].floats(3)) * entry["length"].floats(1)[0] * metres
        angles = entry["axis"].floats(3)
        order = entry["axis"].order(4, usual="XYZ")
        channels = entry["dof"].channels(("rx", "ry", "rz")) if "dof" in entry else ()
        return Bone(name, offset, self._axis_frame(order, angles), order, channels)

    def _axis_frame(self, order: str, angles: list[float]) -> NDArray[np.float64]:
        return turns(order, [*np.array(angles) * (math.radians(1) if self.angle == "deg" else 1)])


def read_asf(path: Path) -> AcclaimSkeleton:
    """Read an ASF skeleton.

    Raises
    ------
    RecordingError
        Not an ASF, or its hierarchy, axes or degrees of freedom make no sense; the message says where.
    OSError
        The file cannot be opened.
    """
    return _AsfReader(path).read()


class _Motion(NamedTuple):
    """The numbers of an AMC: one row of channels for each frame, in metres and radians, and the rate it names."""

    channels: NDArray[np.float64]
    frame_numbers: NDArray[np.int64]
    frame_rate: float | None


def _read_amc(path: Path, body: AcclaimSkeleton) -> _Motion:
    """Read the frames of an AMC, each with its bones in any order."""
    places, frame = _channel_places(body), [0.0] * len(body.channels)
    numbers, values, unseen = array("q"), array("d"), set[str]()
    angle, rate, line = body.angle, None, 0
    for line, words in _lines(path):
        word = words[0]
        if place := places.get(word):
            if word not in unseen:
                refuse(path, line, f"bone {word!r} stands twice in a frame, or before the first frame number")
            frame[place] = numbers_in(words[1:], path, line, place.stop - place.start, f" after {word!r}")
            unseen.remove(word)
            if not unseen:
                values.extend(frame)
        elif len(words) == 1 and _is_frame_number(word):
            if unseen:
                refuse(path, line, f"the frame before has no {', '.join(sorted(unseen))}")
            numbers.append(int(word))
            unseen = set(places)
        elif word.startswith(":"):
            angle = _UNITS.get(word.lower(), angle)
            if word.lower() == ":samples-per-second":
                rate = positive_in(words[1:2], path, line, "frame rate")
        else:
            refuse(path, line, f"expected a frame number or a bone of the skeleton's {len(body.bones)}, got {word!r}")
    if unseen or not numbers:
        refuse(path, line, f"the file ends in the middle of frame {numbers[-1]}" if unseen else "no frames in it")
    memory.require_numbers(len(numbers) * max(len(frame), 3 * len(body.bones)))
    radians = math.radians(1.0) if angle == "deg" else 1.0
    channels = np.frombuffer(values, dtype=np.float64).reshape(-1, len(frame))
    frames = np.frombuffer(numbers, dtype=np.int64)
    _check(path, frames)
    return _Motion(
        channels * [body.metres_per_unit if kind[0] == "t" else radians for kind in body.channels], frames, rate
    )


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


def _check(path: Path, numbers: NDArray[np.int64]) -> None:
    """Refuse frame numbers that do not grow or of which most are missing."""
    steps = np.diff(numbers)
    if (steps < 1).any():
        late = numbers[int(np.argmax(steps < 1)) + 1]
        raise RecordingError(f"{path}: expected growing frame numbers, frame {late} comes too late")
    frames, span = len(numbers), int(numbers[-1] - numbers[0]) + 1
    if span > 2 * frames:
        raise RecordingError(f"{path}: {span - frames} of {span} frames are missing, more than are there")


def _forward_kinematics(body: AcclaimSkeleton, channels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn channels (frames, channels; translations in metres, angles in radians) into positions.

    A joint's frame is M = M_parent · C · R · C⁻¹, with C the bone's axis frame and R its rotation; the joint stands
    at p = p_parent + M · offset. Many frames at once, one bone at a time.
    """
    positions = np.empty((len(channels), len(body.bones), 3))
    for start in range(0, len(channels), BLOCK):
        _place(body, channels[start : start + BLOCK], positions[start : start + BLOCK])
    return positions


def _place(body: AcclaimSkeleton, channels: NDArray[np.float64], positions: NDArray[np.float64]) -> None:
    places = _channel_places(body)
    turned: list[NDArray[np.float64]] = []
    for index, (bone, parent) in enumerate(zip(body.bones, body.skeleton.parents, strict=True)):
        own = dict(zip(bone.channels, channels[:, places.get(bone.name, slice(0))].T, strict=True))
        order = [axis for axis in bone.axis_order if f"r{axis}" in own]
        turn = turns("".join(order), [own[f"r{axis}"] for axis in order], len(channels))
        local = bone.axis @ turn @ bone.axis.T
        if parent < 0:
            still = np.zeros(len(channels))
            turned.append(local)
            positions[:, index] = bone.offset + np.stack([own.get(f"t{name}", still) for name in "xyz"], axis=1)
        else:
            turned.append(turned[parent] @ local)
            positions[:, index] = positions[:, parent] + turned[index] @ bone.offset


def find_asf(amc: Path) -> Path:
    """Find the skeleton of an AMC by name, in its folder or one folder up.

    The skeleton of `HDM_bd_squat1Reps_001_120.amc` (cut) and `HDM_bd_03-03_01_120.amc` (uncut) is `HDM_bd.asf`, the
    skeleton of `13_29.amc` is `13.asf`. If neither is there, the AMC's own name with `.asf` is tried. Endings may be in
    upper or lower case.

    Raises
    ------
    RecordingError
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
    raise RecordingError(
        f"{amc}: no skeleton {' or '.join(f'{stem}.asf' for stem in stems)} in its folder or one folder up"
    )


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
    RecordingError
        The file is no AMC or does not fit its skeleton: unknown bone, wrong count, NaN, cut off in the middle.
    OSError
        A file cannot be opened.
    """
    body = body or read_asf(find_asf(amc))
    channels, numbers, rate = _read_amc(amc, body)
    positions = _forward_kinematics(body, channels).reshape(len(channels), -1)
    named = hdm05.read_clip_name(amc)
    said = named.frame_rate if named else rate or DEFAULT_FRAME_RATE
    clip = Clip(
        skeleton=body.skeleton,
        positions=with_missing_frames(numbers, positions).reshape(-1, len(body.bones), 3),
        frame_rate=said if frame_rate is None else frame_rate,
        name=amc.stem,
        rotations=with_missing_frames(numbers, channels[:, [channel[0] == "r" for channel in body.channels]]),
        filled=(int(numbers[-1] - numbers[0]) + 1 - len(numbers)) * len(body.bones),
    )
    return hdm05.titled(clip, amc)
