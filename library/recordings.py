"""Recorded files of any format we read, found in folders and opened by name."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from library.formats import acclaim, bvh, c3d, trc
from library.formats.c3dprocess import C3dProcess
from library.formats.error import RecordingError
from library.formats.naming import chosen
from library.formats.units import metres_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from library.clip import Clip

__all__ = ["ActorIn", "Reading", "RecordingError", "find_recordings", "is_recording", "labelled", "read_recordings"]

#: Readers of the files that hold their own skeleton, by ending.
_READERS: dict[str, Callable[..., Clip]] = {".bvh": bvh.read_clip, ".c3d": c3d.read_clip, ".trc": trc.read_clip}
_C3D = ".c3d"
_ENDINGS = (".amc", *_READERS)


class ActorIn(StrEnum):
    """Where a recording's place says who performs, if its name is not HDM05's."""

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
        The skeleton of all AMC files; each one's own, found by name, when not given.
    frame_rate
        Frames per second of all of them; what each says of itself when not given.
    unit
        Of length of all BVH, C3D and TRC files, by name or in metres; what each says, or its size tells, when empty.
    joints
        Which joints or markers, by names and patterns (`library.formats.naming.chosen`); all when there are none.
    actor_in
        Where `labelled` finds who performs.

    Raises
    ------
    ValueError
        The unit is none we know.
    """

    asf: Path | None = None
    frame_rate: float | None = None
    unit: str = ""
    joints: tuple[str, ...] = ()
    actor_in: ActorIn = ActorIn.NOWHERE
    metres_per_unit: float | None = field(init=False)

    def __post_init__(self) -> None:
        metres = metres_of(self.unit) if self.unit else None
        if self.unit and metres is None:
            raise ValueError(f"unit: expected m, cm, mm, in, ft or the metres of one, got {self.unit!r}")
        object.__setattr__(self, "metres_per_unit", metres)


def is_recording(path: Path) -> bool:
    """Whether a file's ending is that of a format we read."""
    return path.suffix.lower() in _ENDINGS


def find_recordings(places: Sequence[Path]) -> list[Path]:
    """List the recordings under some folders (at any depth) and files, sorted within each folder, each once.

    Raises
    ------
    RecordingError
        A place does not exist, or no recording is in any of them.
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
        raise RecordingError(f"{', '.join(map(str, places))}: no recording ({', '.join(_ENDINGS)}) in it")
    return list(dict.fromkeys(found))


def read_recordings(paths: Sequence[Path], reading: Reading | None = None) -> Iterator[Clip]:
    """Read recordings one after the other, each Acclaim skeleton once.

    Parameters
    ----------
    paths
        Files, as `find_recordings` lists them.
    reading
        How; as each file says when not given.

    Raises
    ------
    RecordingError
        A file of a kind we do not read, or one that cannot be used: the format's own error.
    OSError
        A file that cannot be opened.
    """
    reading = reading or Reading()
    bodies = dict[Path, acclaim.AcclaimSkeleton]()
    with C3dProcess() as process:
        for path in paths:
            if not is_recording(path):
                raise RecordingError(
                    f"{path}: expected a recording ({', '.join(_ENDINGS)}), got {path.suffix or 'no ending'}"
                )
            ending = path.suffix.lower()
            if reader := _READERS.get(ending):
                yield reader(
                    path,
                    metres_per_unit=reading.metres_per_unit,
                    frame_rate=reading.frame_rate,
                    joints=reading.joints,
                    **({"process": process} if ending == _C3D else {}),
                )
                continue
            skeleton_file = reading.asf or acclaim.find_asf(path)
            if skeleton_file not in bodies:
                bodies[skeleton_file] = acclaim.read_asf(skeleton_file)
            clip = acclaim.read_clip(path, bodies[skeleton_file], frame_rate=reading.frame_rate)
            yield _with_joints(clip, reading.joints, path) if reading.joints else clip


def labelled(clip: Clip, path: Path, actor_in: ActorIn = ActorIn.NOWHERE) -> Clip:
    """Give a clip whose name tells no class (as HDM05's do) its folder's name as class, its own as take, its actor."""
    if clip.class_name:
        return clip
    folder = path.absolute().parent
    actor = {
        ActorIn.NOWHERE: clip.actor,
        ActorIn.NAME: path.stem.partition("_")[0],
        ActorIn.FOLDER: folder.parent.name,
    }[actor_in]
    return replace(clip, class_name=folder.name, actor=actor, take=clip.name)


def _with_joints(clip: Clip, wanted: Sequence[str], path: Path) -> Clip:
    try:
        kept = chosen(clip.skeleton.joints, wanted)
        return replace(clip, skeleton=clip.skeleton.restricted_to(kept), positions=clip.positions[:, kept])
    except ValueError as error:
        raise RecordingError(f"{path}: {error}") from error
