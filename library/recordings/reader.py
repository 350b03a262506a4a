"""Recorded files of every format that can be read, found in folders and opened by their ending."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.naming import Naming
from kinespace.library.recordings.formats import acclaim, bvh, joint_table, utkinect
from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.formats.joint_choice import restricted
from kinespace.library.recordings.formats.labels import Segment, cut, labels_beside, read_labels
from kinespace.library.recordings.formats.markers import c3d
from kinespace.library.recordings.formats.measures import WORDS, metres_of

_AMC = ".amc"
_C3D = ".c3d"
#: A raw recording of a feed: `stream` decodes feeds, so its reader is handed in (`Reading.raw`).
RAW = ".kinerec"
_TABLES = (*joint_table.TEXTS, ".npz")
#: Films: `tools` finds bodies in them, so that its reader is handed in as well.
FILMS = (".avi", ".mkv", ".mov", ".mp4", ".webm")
#: Readers of the files that hold their own skeleton, by ending.
_READERS: dict[str, Callable[..., list[Clip]]] = {".bvh": bvh.read_clips, _C3D: c3d.read_clips}
#: The endings of all files that can be read.
ENDINGS = (_AMC, *_READERS, RAW, *_TABLES)
_NAMED = f"{', '.join(ENDINGS[: -len(_TABLES)])}, a table in {', '.join(joint_table.TEXTS)} or .npz"
#: Bytes of memory for each byte in a text: a number takes two characters or more, and eight bytes in each of the arrays
#: that are computed one from the other.
_TIMES = 4
#: Bytes of memory for each byte in a binary file, whose numbers take two bytes or more.
_TIMES_BINARY = {_C3D: 10, RAW: 10, **dict.fromkeys(FILMS, 0)}


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
        The joints or markers to read, by patterns of the file's own names
        (`library.recordings.formats.joint_choice.chosen`); all when there are none.
    naming
        How the files' joint names are read; by default our names are found for them.
    actor_in
        The part of the path in which `labelled` finds the actor.
    raw
        Reads a raw recording or a film: one clip for each performer, each from the recording's beginning. When None,
        such files are refused.

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

    def __post_init__(self) -> None:
        if self.unit and metres_of(self.unit) is None:
            raise ValueError(f"unit: expected m, cm, mm, in, ft or the metres of one, got {self.unit!r}")


def is_recording(path: Path) -> bool:
    """Say whether a file can be read, by its ending or a table's columns."""
    ending = _ending(path)
    if ending in _TABLES:
        return utkinect.is_take(path) or joint_table.is_joint_table(path)
    return ending in (*ENDINGS, *FILMS)


def _begun(path: Path) -> str:
    """Give the ending of a text's format by its first words, or say what other file it is; empty where neither."""
    with suppress(OSError), memory.opened(path) as file:
        held = file.read(64).decode("latin-1")
        begin = held.removeprefix("ï»¿").lstrip(' "\r\n').lower()
        found = next((what for front, what in WORDS["begins"].items() if begin.startswith(front)), "")
        return found or "an empty file" * (not begin and len(held) < 64)
    return ""


def _ending(path: Path) -> str:
    """Give the ending of a file's format: people keep texts with the ending of a table, too."""
    ending, begun = path.suffix.lower(), _begun(path)
    return begun if ending in joint_table.TEXTS and begun in _READERS else ending


def _another(path: Path) -> str:
    """Say what a file is, if it is none of ours whatever its ending; an `.npz` is a ZIP."""
    begun, ending = _begun(path), path.suffix.lower()
    ours = not begun or begun in _READERS or ending == ".npz"
    return "" if ours or (ending in joint_table.TEXTS and joint_table.is_joint_table(path)) else begun


def is_systems(path: Path) -> bool:
    """Say whether a system wrote a file beside a person's: its name, or a folder's above it, begins with a dot."""
    return any(part.startswith((".", "__MACOSX")) for part in path.parts)


def instead_of_recording(path: Path) -> str:
    """Describe a file that is no recording."""
    if other := _another(path):
        return other
    ending = path.suffix.lower()
    if ending in joint_table.TEXTS:
        why = joint_table.why_no_table(path)
        return why or f"a {ending} without joints' positions: columns like time, head_x, head_y, head_z"
    return WORDS["endings"].get(ending, path.suffix) or "no ending"


def paths_of(given: str | Path | Iterable[str | Path]) -> list[Path]:
    """Give one path, or several, as a list; ValueError for anything else."""
    several = [given] if isinstance(given, (str, Path)) else list(given) if isinstance(given, Iterable) else None
    if several is None or not all(isinstance(each, (str, Path)) for each in several):
        raise ValueError(f"paths: expected a path or several, as text or Path, got {type(given).__name__}")
    return list(map(Path, several))


def find_recordings(places: str | Path | Iterable[str | Path]) -> list[Path]:
    """List the recordings under some folders (at any depth) and files, sorted within each folder, each once.

    Films count only in a folder that has no other recordings: else they show what was recorded by better means. What
    systems put beside files (`._take.bvh`, `__MACOSX`) is no recording (`is_systems`).

    Raises
    ------
    RecordingError
        A place does not exist, or no place holds a recording.
    """
    found, places = list[Path](), paths_of(places)
    for place in places:
        if not place.exists():
            raise RecordingError(f"{place}: no such file or folder")
        if place.is_dir():
            ours = (path for path in place.rglob("*") if not is_systems(path.relative_to(place)))
            # Other files have the other endings of tables, too: a TRC that cannot be read is not passed over.
            files = (path for path in ours if not path.is_dir())
            within = sorted(path for path in files if path.suffix.lower() == ".trc" or is_recording(path))
            found += [path for path in within if path.suffix.lower() not in FILMS] or within
        else:
            found.append(place)
    if not found:
        raise RecordingError(f"{', '.join(map(str, places))}: no recording ({_NAMED}) in it")
    return list(dict.fromkeys(found))


def read_recordings(
    paths: str | Path | Iterable[str | Path],
    reading: Reading | None = None,
    *,
    actor_in: ActorIn | Literal["name", "folder"] | None = None,
) -> Iterator[Clip]:
    """Read recordings one after the other; each Acclaim skeleton is read once.

    A file is one clip. A folder gives the motions of all recordings in it (`find_recordings`): cut by the labels beside
    a take, else each with the class that its name (HDM05) or its folder's name says.

    Parameters
    ----------
    paths
        Files and folders.
    reading
        How to read them; by default as each file says.
    actor_in
        Where the person stands in a path: "name" is `class/ann_3.bvh`, "folder" `ann/class/3.bvh`; as `reading` says
        when not given.

    Raises
    ------
    ValueError
        Something else than paths is given, or another part of a path.
    RecordingError
        The file is of no kind that can be read, or cannot be used (the format's own error).
    OSError
        The file cannot be opened.
    """
    reading = reading or Reading()
    return _read(paths_of(paths), reading, ActorIn(actor_in) if actor_in else reading.actor_in)


def _read(places: Sequence[Path], reading: Reading, actor_in: ActorIn) -> Iterator[Clip]:
    reader = RecordingReader(reading)
    for place in places:
        if not place.is_dir():
            yield performed(reader.clip(place), place, actor_in)
            continue
        for path in find_recordings(place):
            clip, segments = reader.clip(path), segments_beside(path)
            if segments is None:
                yield labelled(clip, path, actor_in)
            else:
                yield from cut(performed(clip, path, actor_in), segments)


class RecordingReader:
    """Reads recordings of any format; keeps skeletons for the next recording.

    Parameters
    ----------
    reading
        How to read them; by default as each file says.
    """

    def __init__(self, reading: Reading | None = None) -> None:
        self._reading = reading or Reading()
        self._body_in = cache(acclaim.read_asf)

    def clips(self, path: Path) -> Sequence[Clip]:
        """Read one recording: one clip, or of a raw recording one clip for each performer.

        Raises
        ------
        RecordingError
            The file is of no kind that can be read, or cannot be used (the format's own error).
        OSError
            The file cannot be opened.
        """
        if not is_recording(path) or _another(path):
            raise RecordingError(f"{path}: expected a recording ({_NAMED}), got {instead_of_recording(path)}")
        with _errors_naming(path):
            return [self._named(clip) for clip in self._read(path)]

    def clip(self, path: Path) -> Clip:
        """Read one recording of a single performer.

        Raises
        ------
        RecordingError
            As `clips`, or the recording has several performers.
        OSError
            The file cannot be opened.
        """
        first, *others = self.clips(path)
        if others:
            names = ", ".join(clip.actor for clip in (first, *others))
            what = f"the recording has several performers ({names}): kinespace convert --performer takes one"
            raise RecordingError(f"{path}: {what}")
        return first

    def _read(self, path: Path) -> Sequence[Clip]:
        ending, reading = _ending(path), self._reading
        if ending in (RAW, *FILMS):
            if reading.raw is None:
                got = "a raw recording or a film"
                raise RecordingError(f"{path}: expected a motion file, got {got}: kinespace convert makes one")
            return [restricted(clip, reading.joints) for clip in reading.raw(path)]
        if ending == _AMC:
            body = self._body_in(reading.asf or acclaim.find_asf(path))
            clip = acclaim.read_clip(path, body, frame_rate=reading.frame_rate)
            return [restricted(clip, reading.joints)]
        if utkinect.is_take(path):
            return [restricted(utkinect.read_clip(path), reading.joints)]
        read = _READERS.get(ending, joint_table.read_clips)
        return read(path, metres_per_unit=metres_of(reading.unit), frame_rate=reading.frame_rate, joints=reading.joints)

    def _named(self, clip: Clip) -> Clip:
        """Give a clip's joints our names."""
        named = self._reading.naming.read(clip.skeleton.joints)
        if named.joints == clip.skeleton.joints:
            return clip
        return replace(clip, skeleton=replace(clip.skeleton, joints=named.joints), naming=named.title)


def labelled(clip: Clip, path: Path, actor_in: ActorIn = ActorIn.NOWHERE) -> Clip:
    """Complete a clip whose name holds no class by its folder's name, its file's name and the actor in its path."""
    if clip.class_name:
        return clip
    return replace(performed(clip, path, actor_in), class_name=path.absolute().parent.name, take=clip.name)


def performed(clip: Clip, path: Path, actor_in: ActorIn) -> Clip:
    """Give a clip the actor that its path names; where the path names none, the clip keeps its actor."""
    named = {ActorIn.NAME: path.stem.partition("_")[0], ActorIn.FOLDER: path.absolute().parent.parent.name}
    return replace(clip, actor=named.get(actor_in, clip.actor))


def clips_of(take: Clip, labels: str | Path | Iterable[tuple[float, float, str]]) -> list[Clip]:
    """Cut a take into its motions.

    Parameters
    ----------
    take
        A recording of one performer.
    labels
        A file of labels (`start_s,end_s,label`, or an export), or start, end, seconds, and class of each motion.

    Returns
    -------
    A clip for each label, with its class.

    Raises
    ------
    ValueError
        The labels cannot be used.
    OSError
        The file cannot be opened.
    """
    if isinstance(labels, (str, Path)):
        return list(cut(take, read_labels(Path(labels))))
    return list(cut(take, [Segment(*each) for each in labels]))


def segments_beside(take: Path) -> tuple[Segment, ...] | None:
    """Read the labels in a file that has a take's name, in its folder, or UTKinect's; None if there are none.

    Raises
    ------
    LabelError
        The labels cannot be used.
    """
    if utkinect.is_take(take) and take.with_name(utkinect.LABELS).is_file():
        return utkinect.read_segments(take)
    return next(map(read_labels, labels_beside(take)), None)


@contextmanager
def _errors_naming(path: Path) -> Iterator[None]:
    """Name a file in the errors that do not name it yet; too large a file, or numbers to compute with, is one."""
    try:
        memory.require(path.stat().st_size * _TIMES_BINARY.get(path.suffix.lower(), _TIMES), "memory")
        with np.errstate(over="ignore", invalid="ignore"):
            yield
    except RecordingError:
        raise
    except (ValueError, *memory.DAMAGE) as error:
        what = str(error) or type(error).__name__
        raise RecordingError(what if what.startswith(str(path)) else f"{path}: {what}") from error
