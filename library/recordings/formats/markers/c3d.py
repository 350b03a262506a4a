"""C3D recordings (www.c3d.org) read into clips, by ezc3d (an extra: `pip install kinespace[c3d]`).

A C3D holds labelled points: markers, joint centres that a model computed, and often, among the same labels, angles,
forces and other results that are no positions. These results (the file lists them in POINT:ANGLES and similar
parameters) and markers without a label (`*12`) are left out unless they are asked for by name.

Mistakes in the header that we check for are reported with their byte. Any other broken file can only crash ezc3d's own
process, not ours.
"""

from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING, Any

import numpy as np

from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.formats.markers.c3d_process import C3dProcess
from kinespace.library.recordings.formats.markers.marker_clip import clip_of_markers
from kinespace.library.recordings.formats.units import guessed_metres, metres_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from kinespace.library.clip import Clip

#: Parameters of the group POINT in which files list the points that are no positions.
_NO_PLACES = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
_BLOCK = 512
_INTEL = 84
_MAX_POINTS = 10_000
#: Parameters that the reader counts by: a number below 0 would be taken for a huge one.
_COUNTS = (b"USED", b"RATIO")
_HEADER = struct.Struct("<BBHHHHHfHHf")


class C3dError(RecordingError):
    """A C3D file cannot be used; the message names the file and, where it is known, the byte."""


def _require_whole(path: Path) -> None:
    """Refuse a file that is no C3D or is cut short: the reader would make up the missing part."""
    with path.open("rb") as file:
        start = file.read(_HEADER.size).ljust(_HEADER.size, b"\0")
        parameters, key, points, analog, first, last, _, scale, data, samples, _ = _HEADER.unpack(start)
        if key != 0x50 or not parameters:
            raise C3dError(f"{path}: byte 1: expected a C3D's 0x50, got a file of another kind")
        file.seek((parameters - 1) * _BLOCK + 3)
        processor = file.read(1)
        size = file.seek(0, 2)
    if processor != bytes([_INTEL]):
        return  # other byte orders are left to the reader
    _require_sound_parameters(path, (parameters - 1) * _BLOCK)
    number = 4 if scale < 0 else 2
    frames = last - first + 1
    if data < 2 or points > _MAX_POINTS or (analog and not samples):
        raise C3dError(f"{path}: byte 2: an impossible header ({points} points, {analog} analog values)")
    wanted = (data - 1) * _BLOCK + frames * (4 * points + analog) * number
    # The header does not tell how many frames there are if there are more than 65 535.
    if first <= last < 0xFFFF and size < wanted:
        raise C3dError(f"{path}: byte {size}: the file ends, expected {wanted} bytes")


def _require_sound_parameters(path: Path, start: int) -> None:
    """Walk through the parameters and refuse any that points outside of them: the reader trusts their sizes."""
    with path.open("rb") as file:
        file.seek(start)
        blocks = file.read(4)[2:3]
        section = blocks + file.read(max(blocks[0] if blocks else 0, 1) * _BLOCK - 4)
    place, groups, used = 1, set[int](), set[int]()
    while True:
        if place + 2 > len(section):
            raise C3dError(f"{path}: byte {start + place + 3}: the parameters have no end")
        name, group = struct.unpack_from("bb", section, place)
        if not name:
            break
        after = place + 2 + abs(name)
        at = after + 2
        if at + 1 > len(section) or not group:
            raise C3dError(f"{path}: byte {start + place + 3}: a parameter that ends outside the parameters")
        (offset,) = struct.unpack_from("<h", section, after)
        if group < 0:
            groups.add(-group)
        else:
            used.add(group)
            called = section[place + 2 : after].upper()
            if called in _COUNTS and section[at : at + 2] == b"\x02\x00" and section[at + 3 : at + 4] > b"\x7f":
                raise C3dError(f"{path}: byte {start + place + 3}: {called.decode()} is below 0")
            at = _end_of_data(section, at)
        end = at + 1 + section[at] if 0 < at < len(section) else len(section) + 1
        if end > len(section) or (offset and after + offset < end):
            raise C3dError(f"{path}: byte {start + place + 3}: a parameter that ends outside the parameters")
        if not offset:
            break
        place = after + offset
    if not used <= groups:
        raise C3dError(f"{path}: byte {start}: parameters of groups that are not there")


def _end_of_data(section: bytes, at: int) -> int:
    """Find the end of a parameter's data, which begins with its type; 0 when the data makes no sense."""
    kind: int
    dimensions: int
    kind, dimensions = struct.unpack_from("bB", section.ljust(at + 2, b"\0"), at)
    sizes = section[at + 2 : at + 2 + dimensions]
    if kind not in (-1, 1, 2, 4) or dimensions > 7 or len(sizes) != dimensions:
        return 0
    return at + 2 + dimensions + abs(kind) * math.prod(sizes)


def _read(path: Path, process: C3dProcess | None) -> tuple[dict[str, list[Any]], NDArray[np.float64]]:
    try:
        if process:
            return process.read(path)
        with C3dProcess() as alone:
            return alone.read(path)
    except ImportError as error:
        raise C3dError(f"{path}: {error}") from error
    except ValueError as error:
        raise C3dError(f"{path}: not a usable C3D ({error})") from error


def read_clip(
    path: Path,
    *,
    metres_per_unit: float | None = None,
    frame_rate: float | None = None,
    joints: Sequence[str] = (),
    process: C3dProcess | None = None,
) -> Clip:
    """Read a C3D into a clip.

    Parameters
    ----------
    path
        The file.
    metres_per_unit, frame_rate
        Metres of the file's unit, and frames per second; as POINT:UNITS and POINT:RATE say when not given.
    joints
        Which points, by name (`library.formats.joint_choice.chosen`); all labelled positions when not given.
    process
        Reads the file; when not given, a process is started for this file alone, which takes a moment.

    Returns
    -------
    The clip: positions (frames, points, 3) in metres, the skeleton without parents.

    Raises
    ------
    C3dError
        ezc3d is not installed or breaks down on the file; the file is no C3D, is malformed or cut off, lacks a point
        that is asked for, or has a point out of sight for too long.
    OSError
        The file cannot be opened.
    """
    _require_whole(path)
    said, points = _read(path, process)
    try:
        labels, positions = _places(points, said, joints)
        if len(labels) < 2:
            raise ValueError(f"expected at least 2 labelled points, got {len(labels)}")  # noqa: TRY301 - told alike
        if not positions.size:
            raise ValueError("no frames in it")  # noqa: TRY301 - told alike
        metres = metres_per_unit or _unit(said, positions)
        rate = _rate(said) if frame_rate is None else frame_rate
        return clip_of_markers(path, labels, positions * metres, rate, joints)
    except ValueError as error:
        raise C3dError(f"{path}: {error}") from error


def _places(
    points: NDArray[np.float64], said: dict[str, list[Any]], named: Sequence[str]
) -> tuple[list[str], NDArray[np.float64]]:
    """Give the labels of points and their positions, (frames, points, 3), NaN where a point is out of sight."""
    labels = _texts("LABELS", said)
    positions = np.array(np.moveaxis(points[:3], 0, 2).swapaxes(0, 1))
    labels = labels[: positions.shape[1]]
    positions[points[3].T < 0] = np.nan
    no_places = {label for kind in _NO_PLACES for label in _texts(kind, said)}
    kept = [
        index
        for index, label in enumerate(labels)
        if label in named or (label and label not in no_places and not label.startswith("*"))
    ]
    return [labels[index] for index in kept], positions[:, kept]


def _texts(name: str, said: dict[str, list[Any]]) -> list[str]:
    """Give the texts of a parameter and of the parameters that continue it.

    A parameter holds 255 entries at most; LABELS continues in LABELS2.
    """
    names = (name, *(f"{name}{number}" for number in range(2, 100)))
    texts = [text for each in names for text in said.get(each, ())]
    if not all(isinstance(text, str) for text in texts):
        raise ValueError(f"expected texts in POINT:{name}, got numbers")
    return [text.strip() for text in texts]


def _unit(said: dict[str, list[Any]], positions: NDArray[np.float64]) -> float:
    named = next((unit for unit in _texts("UNITS", said) if unit), "")
    metres = metres_of(named) if named else None
    if named and metres is None:
        raise ValueError(f"expected POINT:UNITS like mm or m, got {named!r}")
    if metres is not None:
        return metres
    seen = positions[~np.isnan(positions).all(axis=(1, 2))]
    if not len(seen):
        raise ValueError("no point is ever in sight")
    extent = np.nanmax(seen, axis=1) - np.nanmin(seen, axis=1)
    return guessed_metres(float(np.median(np.linalg.norm(extent, axis=1))))


def _rate(said: dict[str, list[Any]]) -> float:
    rate = float(said["RATE"][0]) if len(said.get("RATE", ())) else 0.0
    if not 0 < rate < np.inf:
        raise ValueError(f"expected a positive POINT:RATE, got {rate:g}; give it with --frame-rate")
    return rate
