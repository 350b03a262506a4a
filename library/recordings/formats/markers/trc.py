"""TRC recordings read into clips: the format of Motion Analysis, OpenSim and many markerless systems.

The header has five lines: the second names and the third gives rates, counts and the unit, the fourth labels the
markers. Then each line is a frame: number, time, and three numbers for each marker, separated by tabs. Fields that are
empty or NaN stand for a marker out of sight.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.recordings.formats.errors import count_in, positive_in, refuse
from kinespace.library.recordings.formats.markers.marker_clip import clip_of_markers
from kinespace.library.recordings.formats.units import metres_of


def _header(path: Path, lines: Iterator[str]) -> tuple[tuple[str, ...], int, float, float]:
    """Read the five lines of the header: the markers' names, frames, frames per second, and metres of the unit."""
    kind, names, values, labels, axes = (next(lines, "").rstrip("\r\n") for _ in range(5))
    if not kind.startswith("PathFileType"):
        refuse(path, 1, f"expected PathFileType, got {kind[:40]!r}")
    said = dict(zip(names.split(), values.split(), strict=False))
    missing = [name for name in ("DataRate", "NumFrames", "NumMarkers", "Units") if name not in said]
    if missing:
        refuse(path, 3, f"expected a header with DataRate, NumFrames, NumMarkers and Units, no {', '.join(missing)}")
    metres = metres_of(said["Units"])
    if metres is None:
        refuse(path, 3, f"expected Units like mm or m, got {said['Units']!r}")
    found = tuple(label.strip() for label in labels.split("\t")[2:] if label.strip())
    if not axes.split() or axes.split()[0].lower() != "x1":
        refuse(path, 5, f"expected X1 Y1 Z1 ..., got {axes[:40]!r}")
    if len(found) != count_in(said["NumMarkers"], path, 3, "NumMarkers"):
        refuse(path, 4, f"expected {said['NumMarkers']} names of markers, got {len(found)}")
    rate = positive_in([said["DataRate"]], path, 3, "DataRate")
    return found, count_in(said["NumFrames"], path, 3, "NumFrames"), rate, metres


def _numbers(path: Path, number: int, line: str, columns: int) -> list[float]:
    """Read the fields between tabs, which may be empty; of a line without tabs the words."""
    fields = line.rstrip("\r\n").split("\t") if "\t" in line else line.split()
    while len(fields) > columns and not fields[-1].strip():
        fields.pop()
    if len(fields) != columns:
        refuse(path, number, f"expected {columns} fields, got {len(fields)}")
    try:
        return [float(field) if field and not field.isspace() else math.nan for field in fields]
    except ValueError as error:
        refuse(path, number, f"expected numbers ({str(error)[:80]})")


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
    RecordingError
        The file is no TRC, is malformed or cut off.
    ValueError
        It lacks a marker that is asked for, or has a marker out of sight for too long.
    OSError
        The file cannot be opened.
    """
    lines = memory.lines(path, errors="replace")
    (labels, frames, rate, metres), values, number = _header(path, lines), array("d"), 5
    columns = 2 + 3 * len(labels)
    for number, line in enumerate(lines, start=6):
        if line.strip():
            values.extend(_numbers(path, number, line, columns))
    memory.require_numbers(len(values))
    positions = np.frombuffer(values, dtype=np.float64).reshape(-1, columns)[:, 2:]
    if len(positions) != frames:
        refuse(path, number, f"the file ends after {len(positions)} of {frames} frames")
    positions = positions.reshape(frames, -1, 3) * (metres_per_unit or metres)
    return clip_of_markers(path, labels, positions, frame_rate or rate, joints)
