"""Recorded files of every format that can be read, found in folders and opened by their ending."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from kinespace.library.naming import Naming
from kinespace.library.recordings import memory
from kinespace.library.recordings.formats import acclaim, bvh, joint_table, utkinect
from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.formats.joint_choice import chosen
from kinespace.library.recordings.formats.labels import labels_beside, read_labels
from kinespace.library.recordings.formats.markers import c3d, trc
from kinespace.library.recordings.formats.markers.c3d_process import C3dProcess
from kinespace.library.recordings.formats.units import metres_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from kinespace.library.clip import Clip
    from kinespace.library.recordings.formats.labels import Segment

_AMC, _BVH, _C3D = ".amc", ".bvh", ".c3d"
#: A raw recording of a feed: `stream` decodes feeds, so its reader is handed in (`Reading.raw`).
RAW = ".kinerec"
#: Readers of the files that hold their own skeleton, by ending.
_READERS: dict[str, Callable[..., Clip]] = {_BVH: bvh.read_clip, _C3D: c3d.read_clip, ".trc": trc.read_clip}
_ENDINGS = (_AMC, *_READERS, RAW)
_TABLES = (".csv", ".npz")
_NAMED = f"{', '.join(_ENDINGS)}, a table in {' or '.join(_TABLES)}, or UTKinect's .txt"
#: Bytes of memory for each byte of text in a file: a number of two characters takes eight. C3D has its own limit.
_TIMES_TEXT = 4


class ActorIn(StrEnum):
    """The part of a recording's path that names the actor, if the file is not named like HDM05's files."""

    NOWHERE = "nowhere"
    #: `class/ann_3.bvh`: the file's name up to its first underscore.
    NAME = "name"
    #: `ann/class/3.bvh`: the folder that holds the class's folder.
    FOLDER = "folder"


@dataclass(frozen=True, slots=True)
class Reading:
    """How recordings are read.

    Attributes
    ----------
    asf
        The skeleton of all AMC files; when not given, the skeleton of each file is found by name.
    frame_rate
        Frames per second of all recordings; when not given, each recording's own.
    unit
        Unit of length of all BVH, C3D and TRC files, by name or in metres; when empty, the file's own, or a guess from
        the body's size.
    joints
        The joints or markers to read, by patterns of the file's own names (`library.formats.joint_choice.chosen`); all
        when there are none.
    naming
        How the files' joint names are read; by default our names are found for them.
    actor_in
        The part of the path in which `labelled` finds the actor.
    raw
        Reads a raw recording: one clip for each performer, each from the recording's beginning. When None, such files
        are refused.

    Raises
    ------
    ValueError
        The unit is not known.
    """

    asf: Path | None = None
    frame_rate: float | None = None
    unit: str = ""
    joints: tuple[str, ...] = ()
    naming: Naming = field(default_factory=Naming)
    actor_in: ActorIn = ActorIn.NOWHERE
    raw: Callable[[Path], Sequence[Clip]] | None = field(default=None, compare=False)
    metres_per_unit: float | None = field(init=False)

    def __post_init__(self) -> None:
        metres = metres_of(self.unit) if self.unit else None
        if self.unit and metres is None:
            raise ValueError(f"unit: expected m, cm, mm, in, ft or the metres of one, got {self.unit!r}")
        object.__setattr__(self, "metres_per_unit", metres)


def is_recording(path: Path) -> bool:
    """Say whether a file can be read, by its ending, UTKinect's kind of name, or a table's columns."""
    ending = path.suffix.lower()
    return ending in _ENDINGS or utkinect.is_take(path) or (ending in _TABLES and joint_table.is_joint_table(path))


def instead_of_recording(path: Path) -> str:
    """Describe a file that is no recording."""
    if path.is_file() and not path.stat().st_size:
        return "an empty file"
    if path.suffix.lower() in _TABLES:
        return f"a {path.suffix} without joints' positions: columns like time, head_x, head_y, head_z"
    return path.suffix or "no ending"


def find_recordings(places: Sequence[Path]) -> list[Path]:
    """List the recordings under some folders (at any depth) and files, sorted within each folder, each once.

    Raises
    ------
    RecordingError
        A place does not exist, or no place holds a recording.
    """
    found = list[Path]()
    for place in places:
        if not place.exists():
            raise RecordingError(f"{place}: no such file or folder")
        if place.is_dir():
            found += sorted(path for path in place.rglob("*") if is_recording(path) and not path.is_dir())
        else:
            found.append(place)
    if not found:
        raise RecordingError(f"{', '.join(map(str, places))}: no recording ({_NAMED}) in it")
    return list(dict.fromkeys(found))


def read_recordings(paths: Sequence[Path], reading: Reading | None = None) -> Iterator[Clip]:
    """Read recordings one after the other; each Acclaim skeleton is read once.

    Parameters
    ----------
    paths
        Files, in the order of `find_recordings`.
    reading
        How to read them; by default as each file says.

    Raises
    ------
    RecordingError
        The file is of no kind that can be read, or cannot be used (the format's own error).
    OSError
        The file cannot be opened.
    """
    with RecordingReader(reading) as reader:
        for path in paths:
            yield reader.clip(path)


class RecordingReader:
    """Reads recordings of any format; keeps skeletons and the C3D process for the next recording. A context manager.

    Parameters
    ----------
    reading
        How to read them; by default as each file says.
    """

    def __init__(self, reading: Reading | None = None) -> None:
        self._reading = reading or Reading()
        self._bodies = dict[Path, acclaim.AcclaimSkeleton]()
        self._process = C3dProcess()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.close()

    def clips(self, path: Path) -> Sequence[Clip]:
        """Read one recording: one clip, or of a raw recording one clip for each performer.

        Raises
        ------
        RecordingError
            The file is of no kind that can be read, or cannot be used (the format's own error).
        OSError
            The file cannot be opened.
        """
        if path.suffix.lower() != RAW:
            return [self.clip(path)]
        if self._reading.raw is None:
            raise RecordingError(f"{path}: expected a motion file, got a raw recording: kinespace convert makes one")
        return [self._named(self._chosen(clip, path)) for clip in self._reading.raw(path)]

    def clip(self, path: Path) -> Clip:
        """Read one recording of a single performer.

        Raises
        ------
        RecordingError
            As `clips`, or the recording has several performers.
        OSError
            The file cannot be opened.
        """
        self._require_recording(path)
        if path.suffix.lower() == RAW:
            clips = self.clips(path)
            if len(clips) > 1:
                told = ", ".join(clip.actor for clip in clips)
                raise RecordingError(f"{path}: the recording has several performers ({told})")
            return clips[0]
        if path.suffix.lower() != _C3D:
            self._require_memory(path)
        if path.suffix.lower() in _TABLES:
            return self._named(joint_table.read_clip(path, **self._options(path)))
        if reader := utkinect.read_clip if utkinect.is_take(path) else _READERS.get(path.suffix.lower()):
            return self._named(reader(path, **self._options(path)))
        clip = acclaim.read_clip(path, self._body(path), frame_rate=self._reading.frame_rate)
        return self._named(self._chosen(clip, path))

    def pieces(self, path: Path) -> Iterator[Clip]:
        """Read one recording as consecutive clips: AMC and BVH some seconds at a time, to save memory.

        C3D and TRC come in one piece, because missing markers are interpolated over the whole recording.

        Raises
        ------
        RecordingError, OSError
            As `clip`, once the place of the mistake is reached.
        """
        ending = path.suffix.lower()
        if ending == _BVH:
            yield from map(self._named, bvh.read_pieces(path, **self._options(path)))
        elif ending == _AMC:
            for piece in acclaim.read_pieces(path, self._body(path), frame_rate=self._reading.frame_rate):
                yield self._named(self._chosen(piece, path))
        else:
            yield self.clip(path)

    def _require_recording(self, path: Path) -> None:
        if not is_recording(path):
            raise RecordingError(f"{path}: expected a recording ({_NAMED}), got {instead_of_recording(path)}")

    @staticmethod
    def _require_memory(path: Path) -> None:
        try:
            memory.require(_TIMES_TEXT * path.stat().st_size, str(path))
        except ValueError as error:
            raise RecordingError(str(error)) from error

    def _options(self, path: Path) -> dict[str, Any]:
        reading = self._reading
        options = {
            "metres_per_unit": reading.metres_per_unit,
            "frame_rate": reading.frame_rate,
            "joints": reading.joints,
        }
        return options | ({"process": self._process} if path.suffix.lower() == _C3D else {})

    def _body(self, path: Path) -> acclaim.AcclaimSkeleton:
        file = self._reading.asf or acclaim.find_asf(path)
        if file not in self._bodies:
            self._bodies[file] = acclaim.read_asf(file)
        return self._bodies[file]

    def _named(self, clip: Clip) -> Clip:
        """Give a clip's joints our names."""
        named = self._reading.naming.read(clip.skeleton.joints)
        if named.joints == clip.skeleton.joints:
            return clip
        return replace(clip, skeleton=replace(clip.skeleton, joints=named.joints), naming=named.title)

    def _chosen(self, clip: Clip, path: Path) -> Clip:
        return _with_joints(clip, self._reading.joints, path) if self._reading.joints else clip


def labelled(clip: Clip, path: Path, actor_in: ActorIn = ActorIn.NOWHERE) -> Clip:
    """Complete a clip whose name tells no class by its folder's name, its file's name and the actor in its path."""
    if clip.class_name:
        return clip
    return replace(performed(clip, path, actor_in), class_name=path.absolute().parent.name, take=clip.name)


def performed(clip: Clip, path: Path, actor_in: ActorIn) -> Clip:
    """Give a clip the actor that its path tells; where the path tells none, the clip keeps its actor."""
    match actor_in:
        case ActorIn.NOWHERE:
            return clip
        case ActorIn.NAME:
            return replace(clip, actor=path.stem.partition("_")[0])
        case ActorIn.FOLDER:
            return replace(clip, actor=path.absolute().parent.parent.name)


def segments_beside(take: Path) -> tuple[Segment, ...] | None:
    """Read the labels that lie beside a take: a file with its name, or UTKinect's; None if there are none.

    Raises
    ------
    LabelError, UTKinectError
        The labels cannot be used.
    """
    if labels := labels_beside(take):
        return read_labels(labels[0])
    if utkinect.is_take(take) and take.with_name(utkinect.LABELS).is_file():
        return utkinect.read_segments(take)
    return None


def _with_joints(clip: Clip, wanted: Sequence[str], path: Path) -> Clip:
    try:
        kept = chosen(clip.skeleton.joints, wanted)
        return replace(clip, skeleton=clip.skeleton.restricted_to(kept), positions=clip.positions[:, kept])
    except ValueError as error:
        raise RecordingError(f"{path}: {error}") from error
