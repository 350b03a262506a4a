"""TRC recordings read into clips: the format of Motion Analysis, OpenSim and many markerless systems.

The second line names and the third gives rates, counts and the unit, the fourth labels the markers, the fifth their
axes. Then each line is a frame: number, time, and three numbers for each marker, separated by tabs. Fields that are
empty or NaN stand for a marker out of sight; empty ones at a line's end are often cut off. Where the header and the
frames differ the frames count: their number, their times.
"""

import math
import re
from array import array
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.recordings.formats.errors import mended, number_of, refuse
from kinespace.library.recordings.formats.markers.marker_clip import clips_of_markers
from kinespace.library.recordings.formats.table_header import coordinate_of
from kinespace.library.recordings.formats.timed_frames import timing
from kinespace.library.recordings.formats.units import metres_of


def _labels(path: Path, line: str, announced: int) -> list[str]:
    """Read the names of the markers, which stand three tabs apart, between any blanks, or thrice with their axes."""
    cells = [label.strip() for label in line.split("\t")[2:]]
    if any(cells[::3]) and not any((*cells[1::3], *cells[2::3])) and len(cells[::3]) >= announced > 1:
        # A marker without a name keeps its columns.
        return [cell or f"marker {number}" for number, cell in enumerate(cells[::3][:announced], 1)]
    tabbed = [label for label in cells if label]
    spaced = line.split()[2:]
    found = spaced if len(tabbed) < 2 or len(spaced) == announced != len(tabbed) else tabbed
    if len(found) < 2:
        refuse(path, 4, f"expected names of markers behind Frame# and Time, got {line[:40]!r}")
    named = [coordinate_of(label) or ("", "") for label in found]
    if [axis for _, axis in named] == [*"xyz"] * (len(named) // 3):
        return [name for name, _ in named[::3]]
    return [*found, *(f"marker {number}" for number in range(len(found) + 1, announced + 1))]


def _fields(line: str, columns: int) -> list[float | None]:
    """Read a frame's fields between tabs, which may be empty, or its words."""
    fields = line.rstrip("\r\n").split("\t") if "\t" in line else line.split()
    found = [number_of(field) for field in fields]
    if None in found or ("\t" not in line and len(found) != columns):
        found = [number_of(field) for field in mended(fields)]
    while len(found) > columns and found[-1] is not None and math.isnan(found[-1]):
        found.pop()
    return found


def read_clips(
    path: Path, *, metres_per_unit: float | None = None, frame_rate: float | None = None, joints: Sequence[str] = ()
) -> list[Clip]:
    """Read a TRC into a clip for each person that its labels name.

    Parameters
    ----------
    path
        The file.
    metres_per_unit, frame_rate
        Metres of the file's unit, and frames per second; as the header and the times say when not given.
    joints
        Which markers, by name (`library.recordings.formats.joint_choice.chosen`); all when none are given.

    Returns
    -------
    The clips: positions (frames, markers, 3) in metres, the skeleton without parents.

    Raises
    ------
    RecordingError
        The file is no TRC, or malformed.
    ValueError
        It lacks a marker that is asked for, or has fewer than two that are seen.
    OSError
        The file cannot be opened.
    """
    lines, notes = memory.lines(path, errors="replace"), list[str]()
    kind, names, given, heads = (next(lines, "").rstrip("\r\n") for _ in range(4))
    if not kind.startswith("PathFileType"):
        refuse(path, 1, f"expected PathFileType, got {kind[:40]!r}")
    between = "\t" if "\t" in names and "\t" in given else None
    said = dict(zip(map(str.strip, names.split(between)), map(str.strip, given.split(between)), strict=False))
    announced = said.get("NumMarkers", "")
    labels = _labels(path, heads, int(announced) if re.fullmatch(r"\d{1,3}", announced) else 0)
    columns, values, frames, number = 2 + 3 * len(labels), array("d"), 0, 4
    for number, line in enumerate(lines, start=5):
        if not line.strip() or (not frames and "x" in line.lower()):
            continue
        fields = _fields(line, columns)
        if not frames and len(fields) > columns and len(fields) % 3 == 2:
            # Markers behind those that have names.
            labels += [f"marker {number}" for number in range(len(labels) + 1, len(fields) // 3 + 1)]
            columns = len(fields)
        row = [each for each in fields if each is not None]
        if frames and len(row) < columns and not line.endswith(("\n", "\r")):
            notes.append(f"frames: the last line, {number}, is cut off and left out")
            break
        if len(row) < len(fields) or not 5 <= len(row) <= columns:
            refuse(path, number, f"expected {columns} numbers, got {len(row)} in {line.strip()[:40]!r}")
        values.extend(row + [math.nan] * (columns - len(row)))
        frames += 1
    memory.require_numbers(len(values))
    if not frames:
        refuse(path, number, "the file ends before its first frame")
    if said.get("NumFrames") != str(frames):
        notes.append(f"frames: the header says {said.get('NumFrames', 'nothing')}, there are {frames}: these are taken")
    rows = np.frombuffer(values, dtype=np.float64).reshape(frames, columns)
    header = number_of(said.get("DataRate", "")) or 0.0
    moments = rows[:, 1] if frame_rate is None and np.isfinite(rows[:, 1]).all() else None
    times, rate = timing(moments, "Time", header if 0 < header < math.inf else 0.0, frame_rate, notes)
    metres = metres_per_unit or metres_of(said.get("Units", ""))
    if metres is None:
        notes.append(f"units: {said.get('Units', 'none')!r} is no unit: the body's size tells it; --unit names it")
    places = rows[:, 2:].reshape(frames, -1, 3)
    return clips_of_markers(path, labels, places, rate, joints, times=times, metres=metres, notes=notes)
