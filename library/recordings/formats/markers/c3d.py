"""C3D recordings (www.c3d.org) read into clips.

A C3D holds labelled points: markers, joint centres that a model computed, and often, among the same labels, angles,
forces and other results that are no positions. These results (the file lists them in POINT:ANGLES and similar
parameters) and markers without a label (`*12`) are left out unless they are asked for by name.

The file is blocks of 512 bytes: a header; parameters in groups, each with its type and dimensions; then frames of
points (x, y, z and a residual, below 0 where the point is out of sight) and analog values, as floats or scaled
integers. No size in it is believed before it is compared with the bytes that are there. Read here and not by a library:
ezc3d trusts a broken file, which can end the process; c3d reads nothing of a file of 65,535 frames.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.formats.markers.marker_clip import clip_of_markers
from kinespace.library.recordings.formats.units import guessed_metres, metres_of

#: Parameters of the group POINT in which files list the points that are no positions.
_NO_PLACES = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
_BLOCK = 512
#: The second byte of every C3D.
_KEY = 0x50
#: The kind of processor that wrote a file: only Intel's numbers are read.
_INTEL = 84
#: First block of the parameters, key, points, analog values, first frame, last frame, longest gap, scale, first block
#: of the frames.
_HEADER = struct.Struct("<BBHHHHHfH")
#: The last frame in the header of a file with more frames than fit there.
_MANY = 0xFFFF

_Values = list[str] | list[float]
#: The values of each parameter, by group and name.
_Parameters = dict[tuple[str, str], _Values]


@dataclass(frozen=True, slots=True)
class _File:
    """The bytes of a C3D."""

    path: Path
    content: bytes

    def fail(self, byte: int, what: str) -> NoReturn:
        raise RecordingError(f"{self.path}: byte {byte}: {what}")


def _parameters(file: _File, start: int) -> _Parameters:
    """Walk through the parameters, which begin at a byte."""
    groups, found = dict[int, str](), list[tuple[int, str, _Values]]()
    place = start + 4
    try:
        while True:
            size, group = struct.unpack_from("bb", file.content, place)
            after = place + 2 + abs(size)
            name = file.content[place + 2 : after].decode("utf-8", "replace").upper()
            (offset,) = struct.unpack_from("<h", file.content, after) if size else (0,)
            if size and group < 0:
                groups[-group] = name
            elif size and group > 0:
                found.append((group, name, _values(file, after + 2)))
            if not offset:
                break
            if offset < 0:
                file.fail(place + 1, "a parameter that lies before itself")
            place = after + offset
    except (struct.error, IndexError):
        file.fail(place + 1, "a parameter that ends outside the file")
    return {(groups.get(group, ""), name): values for group, name, values in found}


def _values(file: _File, place: int) -> _Values:
    """Read a parameter's values, which begin with their type and dimensions; struct.error beyond the file's end."""
    kind, dimensions = struct.unpack_from("bB", file.content, place)
    sizes = struct.unpack_from(f"{dimensions}B", file.content, place + 2)
    count, begin = math.prod(sizes), place + 2 + dimensions
    if kind not in (-1, 1, 2, 4):
        file.fail(place + 1, f"expected a parameter of type -1, 1, 2 or 4, got {kind}")
    (content,) = struct.unpack_from(f"{abs(kind) * count}s", file.content, begin)
    if kind == -1:
        width = sizes[0] if sizes else 1
        texts = (content[at : at + width] for at in range(0, len(content), width or 1))
        return [text.decode("utf-8", "replace").strip(" \0") for text in texts]
    numbers = np.frombuffer(content, dtype="<f4" if kind == 4 else f"<i{kind}")
    return [float(number) for number in numbers]


def _frames(first: int, last: int, said: _Parameters) -> int:
    """Give the number of frames; more than the header can hold are counted in TRIAL, by numbers of two words."""
    words = [*said.get(("TRIAL", "ACTUAL_START_FIELD"), ()), *said.get(("TRIAL", "ACTUAL_END_FIELD"), ())]
    if last == _MANY and len(words) == 4:
        low, high, last_low, last_high = (int(word) % 65536 for word in words)
        first, last = low + high * 65536, last_low + last_high * 65536
    return last - first + 1


def _read(path: Path) -> tuple[_Parameters, NDArray[np.float64]]:
    """Read the parameters and the points, (frames, points, 3) in the file's unit, NaN where a point is out of sight."""
    content = memory.content(path, memory.limit())
    if len(content) < _BLOCK or content[1] != _KEY or not content[0]:
        raise RecordingError(f"{path}: byte 1: expected a C3D's 0x50, got a file of another kind")
    start = (content[0] - 1) * _BLOCK
    file, processor = _File(path, content), content[start + 3] if len(content) > start + 3 else 0
    if processor != _INTEL:
        file.fail(start + 3, f"expected Intel's processor, {_INTEL}, got {processor}")
    _, _, points, analog, first, last, _, scale, data = _HEADER.unpack_from(content)
    said = _parameters(file, start)
    frames = _frames(first, last, said)
    begin = (data - 1) * _BLOCK
    end = begin + frames * (4 * points + analog) * (4 if scale < 0 else 2)
    if not 0 < begin < end or points < 2:
        file.fail(2, f"an impossible header ({points} points, {analog} analog values, {frames} frames)")
    if len(content) < end:
        file.fail(len(content), f"the file ends, expected {end} bytes")
    memory.require_numbers(frames * points * 3)
    numbers = np.frombuffer(content[begin:end], dtype="<f4" if scale < 0 else "<i2")
    each = numbers.reshape(frames, -1)[:, : 4 * points].reshape(frames, points, 4).astype(np.float64)
    positions = each[:, :, :3] if scale < 0 else each[:, :, :3] * scale
    positions[each[:, :, 3] < 0] = np.nan
    return said, positions


def read_clip(
    path: Path, *, metres_per_unit: float | None = None, frame_rate: float | None = None, joints: Sequence[str] = ()
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

    Returns
    -------
    The clip: positions (frames, points, 3) in metres, the skeleton without parents.

    Raises
    ------
    RecordingError
        The file is no C3D, is malformed or cut off.
    ValueError
        It lacks a point that is asked for, or has a point out of sight for too long.
    OSError
        The file cannot be opened.
    """
    said, positions = _read(path)
    labels = _texts("LABELS", said)[: positions.shape[1]]
    no_places = {label for kind in _NO_PLACES for label in _texts(kind, said)}
    kept = [
        index
        for index, label in enumerate(labels)
        if label in joints or (label and label not in no_places and not label.startswith("*"))
    ]
    if len(kept) < 2:
        raise ValueError(f"expected at least 2 labelled points, got {len(kept)}")
    positions = positions[:, kept]
    rate = _rate(said) if frame_rate is None else frame_rate
    metres = metres_per_unit or _unit(said, positions)
    return clip_of_markers(path, [labels[index] for index in kept], positions * metres, rate, joints)


def _texts(name: str, said: _Parameters) -> list[str]:
    """Give the texts of a parameter of POINT and of the parameters that continue it.

    A parameter holds 255 entries at most; LABELS continues in LABELS2.
    """
    names = (name, *(f"{name}{number}" for number in range(2, 100)))
    texts = [text for each in names for text in said.get(("POINT", each), ())]
    if not all(isinstance(text, str) for text in texts):
        raise ValueError(f"expected texts in POINT:{name}, got numbers")
    return [str(text) for text in texts]


def _unit(said: _Parameters, positions: NDArray[np.float64]) -> float:
    named = next((unit for unit in _texts("UNITS", said) if unit), "")
    metres = metres_of(named) if named else None
    if named and metres is None:
        raise ValueError(f"expected POINT:UNITS like mm or m, got {named!r}")
    return guessed_metres(positions) if metres is None else metres


def _rate(said: _Parameters) -> float:
    rate = next((number for number in said.get(("POINT", "RATE"), ()) if isinstance(number, float)), 0.0)
    if not 0 < rate < math.inf:
        raise ValueError(f"expected a positive POINT:RATE, got {rate:g}; give it with --frame-rate")
    return rate
