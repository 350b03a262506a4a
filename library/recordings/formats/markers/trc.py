"""TRC recordings read into clips: the format of Motion Analysis, OpenSim and many markerless systems.

The header has five lines: the second names and the third gives rates, counts and the unit, the fourth labels the
markers. Then each line is a frame: number, time, and three numbers for each marker, separated by tabs. Fields that are
empty or NaN stand for a marker out of sight.
"""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.formats.markers.marker_clip import clip_of_markers
from kinespace.library.recordings.formats.units import metres_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from typing import TextIO

    from numpy.typing import NDArray

    from kinespace.library.clip import Clip


class TrcError(RecordingError):
    """A TRC file cannot be used; the message names the file and the line."""


@dataclass(frozen=True, slots=True)
class TrcMotion:
    """A TRC as it stands in the file.

    Attributes
    ----------
    labels
        Of the markers.
    positions
        Shape (frames, markers, 3), in the file's unit, NaN where a marker is out of sight.
    frame_rate
        Frames per second.
    metres_per_unit
        Metres of the header's unit.
    """

    labels: tuple[str, ...]
    positions: NDArray[np.float64]
    frame_rate: float
    metres_per_unit: float


@dataclass(frozen=True, slots=True)
class _Header:
    labels: tuple[str, ...]
    frames: int
    frame_rate: float
    metres_per_unit: float


def _fail(path: Path, line: int, what: str) -> NoReturn:
    raise TrcError(f"{path}:{line}: {what}")


def read_trc(path: Path) -> TrcMotion:
    """Read a TRC as it stands, line by line.

    Raises
    ------
    TrcError
        The file is no TRC, its header makes no sense, a line has too few or too many numbers, or frames are missing.
    OSError
        The file cannot be opened.
    """
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        header = _header(path, file)
        values = array("d")
        columns = 2 + 3 * len(header.labels)
        number = 5
        for number, line in enumerate(file, start=6):
            fields = _fields(line)
            if fields:
                values.extend(_numbers(path, number, fields, columns))
    positions = np.frombuffer(values, dtype=np.float64).reshape(-1, columns)[:, 2:]
    if len(positions) != header.frames:
        _fail(path, number, f"the file ends after {len(positions)} of {header.frames} frames")
    return TrcMotion(header.labels, positions.reshape(header.frames, -1, 3), header.frame_rate, header.metres_per_unit)


def _header(path: Path, file: TextIO) -> _Header:
    kind, names, values, labels, axes = (file.readline().rstrip("\r\n") for _ in range(5))
    if not kind.startswith("PathFileType"):
        _fail(path, 1, f"expected PathFileType, got {kind[:40]!r}")
    said = dict(zip(names.split(), values.split(), strict=False))
    missing = [name for name in ("DataRate", "NumFrames", "NumMarkers", "Units") if name not in said]
    if missing:
        _fail(path, 3, f"expected a header with DataRate, NumFrames, NumMarkers and Units, no {', '.join(missing)}")
    metres = metres_of(said["Units"])
    if metres is None:
        _fail(path, 3, f"expected Units like mm or m, got {said['Units']!r}")
    found = tuple(label.strip() for label in labels.split("\t")[2:] if label.strip())
    if not axes.split() or axes.split()[0].lower() != "x1":
        _fail(path, 5, f"expected X1 Y1 Z1 ..., got {axes[:40]!r}")
    if len(found) != _count(path, "NumMarkers", said["NumMarkers"]):
        _fail(path, 4, f"expected {said['NumMarkers']} names of markers, got {len(found)}")
    rate = _rate(path, said["DataRate"])
    return _Header(found, _count(path, "NumFrames", said["NumFrames"]), rate, metres)


def _count(path: Path, name: str, text: str) -> int:
    if not text.isdecimal() or len(text) > 9 or int(text) == 0:
        _fail(path, 3, f"expected a number as {name}, got {text!r}")
    return int(text)


def _rate(path: Path, text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not 0 < rate < math.inf:
        _fail(path, 3, f"expected a positive DataRate, got {text!r}")
    return rate


def _fields(line: str) -> list[str]:
    """Split at tabs, between which fields may be empty; a line without tabs at white space. Empty for a blank line."""
    if not line.strip():
        return []
    return line.rstrip("\r\n").split("\t") if "\t" in line else line.split()


def _numbers(path: Path, number: int, fields: list[str], columns: int) -> list[float]:
    while len(fields) > columns and not fields[-1].strip():
        fields.pop()
    if len(fields) != columns:
        _fail(path, number, f"expected {columns} fields, got {len(fields)}")
    try:
        return [float(field) if field and not field.isspace() else math.nan for field in fields]
    except ValueError:
        wrong = next(field for field in fields if field.strip() and not _is_number(field))
        _fail(path, number, f"expected numbers, got {wrong[:40]!r}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_clip(
    path: Path, *, metres_per_unit: float | None = None, frame_rate: float | None = None, joints: Sequence[str] = ()
) -> Clip:
    """Read a TRC into a clip.

    Parameters
    ----------
    path
        The file.
    metres_per_unit, frame_rate
        Metres of the file's unit, and frames per second; as the header says when not given.
    joints
        Which markers, by name (`library.formats.joint_choice.chosen`); all when none are given.

    Returns
    -------
    The clip: positions (frames, markers, 3) in metres, the skeleton without parents.

    Raises
    ------
    TrcError
        The file is no TRC, is malformed or cut off, lacks a marker that is asked for, or has a marker out of sight for
        too long.
    OSError
        The file cannot be opened.
    """
    motion = read_trc(path)
    metres = metres_per_unit or motion.metres_per_unit
    rate = motion.frame_rate if frame_rate is None else frame_rate
    try:
        return clip_of_markers(path, motion.labels, motion.positions * metres, rate, joints)
    except ValueError as error:
        raise TrcError(f"{path}: {error}") from error
