"""Acclaim recordings (ASF skeleton, AMC motion) read into clips.

HDM05 and the CMU Graphics Lab Motion Capture Database use these formats. An ASF gives each bone a direction,
a length and the axis frame in which its rotations are measured; an AMC gives the angles of every frame. Where a bone's
`dof` and `axis` disagree in order, `dof` says which number is which angle, and `axis` says in which order the angles
are applied; the root's `order` and `axis` do the same.
"""

import math
from array import array
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import accumulate, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.naming import hdm05
from kinespace.library.recordings.formats.errors import Line, RecordingError, numbers_in, positive_in, refuse
from kinespace.library.recordings.formats.joint_choice import few
from kinespace.library.recordings.formats.measures import METRES, with_missing_frames
from kinespace.library.recordings.formats.rotations import placed, turns
from kinespace.library.recordings.formats.texts import lines_of
from kinespace.library.skeleton import Skeleton

#: HDM05's and CMU's rate, assumed of an AMC that names no rate.
DEFAULT_FRAME_RATE = 120.0


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
    for number, text in enumerate(lines_of(path, most, encoding="latin-1"), start=1):
        if words := text.partition("#")[0].split():
            yield number, words


class _SkeletonLine(Line):
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


def read_asf(path: Path) -> AcclaimSkeleton:
    """Read an ASF skeleton.

    Raises
    ------
    RecordingError
        Not an ASF, or its hierarchy, axes or degrees of freedom make no sense; the message says where.
    OSError
        The file cannot be opened.
    """
    section, entry, heads = "", dict[str, _SkeletonLine](), defaultdict[str, dict[str, _SkeletonLine]](dict)
    bones, parents = dict[str, dict[str, _SkeletonLine]](), dict[str, str]()
    for number, words in _lines(path, memory.MAX_WITHOUT_MOTION):
        word, line = words[0].lower(), _SkeletonLine(path, number, words)
        if word.startswith(":"):
            section = word
        elif section == ":bonedata":
            entry = {} if word == "begin" else entry
            if word == "name":
                if words[-1] in (*bones, "root"):
                    line.fail(f"bone {words[-1]!r} is described twice")
                bones[words[-1]] = entry
            entry[word] = line
        elif section != ":hierarchy":
            heads[section][word] = line
        elif word not in ("begin", "end"):
            _adopt(line, bones, parents)
    orphans = [name for name in bones if name not in parents]
    if not bones or orphans:
        what = f"bones without a parent: {', '.join(orphans)}" if orphans else "no :bonedata in it"
        raise RecordingError(f"{path}: not a usable ASF skeleton, {what}")
    if lacking := [word for word in ("order", "axis") if word not in heads[":root"]]:
        raise RecordingError(f"{path}: no {lacking[0]!r} in :root")
    metres, angle = _units_in(heads[":units"])
    names = few(["root", *parents])
    found = [_root(heads[":root"], metres, angle), *(_bone(name, bones[name], metres, angle) for name in parents)]
    places = {name: place for place, name in enumerate(names)}
    skeleton = Skeleton(names, (-1, *(places[parent] for parent in parents.values())))
    return AcclaimSkeleton(skeleton, tuple(found), metres, angle)


def _adopt(line: _SkeletonLine, bones: Collection[str], parents: dict[str, str]) -> None:
    """Read a bone's children in the hierarchy."""
    parent, *children = line.words
    if parent != "root" and parent not in parents:
        line.fail(f"bone {parent!r} has children before it has a parent")
    for child in children:
        if child not in bones:
            line.fail(f"bone {child!r} stands in the hierarchy but not in :bonedata")
        if child in parents:
            line.fail(f"bone {child!r} has two parents")
        parents[child] = parent


def _units_in(units: Mapping[str, _SkeletonLine]) -> tuple[float, str]:
    """Give the metres of the unit of length, and the unit of angles."""
    length, angle = units.get("length"), units.get("angle")
    inches = positive_in(length.words[1:2], length.path, length.number, "unit of length") if length else 1.0
    unit = angle.words[-1].lower() if angle else "deg"
    if angle and unit not in ("deg", "rad"):
        angle.fail(f"expected angle deg or rad, got {unit!r}")
    return METRES["in"] / inches, unit


def _root(lines: Mapping[str, _SkeletonLine], metres: float, angle: str) -> Bone:
    channels, order = lines["order"].channels(("tx", "ty", "tz", "rx", "ry", "rz")), lines["axis"].order(-1)
    position, turn = (lines[word].floats(3) if word in lines else [0.0] * 3 for word in ("position", "orientation"))
    return Bone("root", np.array(position) * metres, _frame(order, turn, angle), order, channels)


def _bone(name: str, lines: Mapping[str, _SkeletonLine], metres: float, angle: str) -> Bone:
    for word in ("direction", "length", "axis"):
        if word not in lines:
            lines["name"].fail(f"bone {name!r} has no {word}")
    offset = np.array(lines["direction"].floats(3)) * lines["length"].floats(1)[0] * metres
    turn, order = lines["axis"].floats(3), lines["axis"].order(4, usual="XYZ")
    channels = lines["dof"].channels(("rx", "ry", "rz")) if "dof" in lines else ()
    return Bone(name, offset, _frame(order, turn, angle), order, channels)


def _frame(order: str, angles: list[float], unit: str) -> NDArray[np.float64]:
    return turns(order, [*np.array(angles) * (math.radians(1) if unit == "deg" else 1)])


def _read_amc(path: Path, body: AcclaimSkeleton) -> tuple[NDArray[np.float64], NDArray[np.int64], float | None]:
    """Read the frames of an AMC, each with its bones in any order.

    Returns
    -------
    A row of channels for each frame, in metres and radians; the numbers of the frames; and the rate it names.
    """
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
        # Not isdigit, which accepts a superscript two; 18 digits always fit into an int64.
        elif len(words) == 1 and word.isdecimal() and len(word) <= 18:
            if unseen:
                refuse(path, line, f"the frame before has no {', '.join(sorted(unseen))}")
            numbers.append(int(word))
            unseen = set(places)
        elif word.startswith(":"):
            angle = {":degrees": "deg", ":radians": "rad"}.get(word.lower(), angle)
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
    return channels * [body.metres_per_unit if kind[0] == "t" else radians for kind in body.channels], frames, rate


def _channel_places(body: AcclaimSkeleton) -> Mapping[str, slice]:
    each = zip(body.bones, accumulate(len(bone.channels) for bone in body.bones), strict=True)
    return {bone.name: slice(end - len(bone.channels), end) for bone, end in each if bone.channels}


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

    A bone turns by C · R · C⁻¹, with C its axis frame and R its own rotation, and takes its end along.
    """
    places = _channel_places(body)

    def bones(block: slice) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        for bone, parent in zip(body.bones, body.skeleton.parents, strict=True):
            own = dict(zip(bone.channels, channels[block, places.get(bone.name, slice(0))].T, strict=True))
            order = [axis for axis in bone.axis_order if f"r{axis}" in own]
            turn = turns("".join(order), [own[f"r{axis}"] for axis in order], len(channels[block]))
            local = bone.axis @ turn @ bone.axis.T
            still = np.zeros(len(local))
            moved = np.stack([own.get(f"t{name}", still) for name in "xyz"], axis=1)
            yield moved + (bone.offset if parent < 0 else local @ bone.offset), local

    return placed(body.skeleton.parents, len(channels), bones)


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
    for folder, stem, ending in product((amc.parent, amc.parent.parent), stems, (".asf", ".ASF")):
        if (found := folder / f"{stem}{ending}").is_file():
            return found
    names = " or ".join(f"{stem}.asf" for stem in stems)
    raise RecordingError(f"{amc}: no skeleton {names} in its folder or one folder up")


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
