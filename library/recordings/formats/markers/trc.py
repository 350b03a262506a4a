"""TRC recordings read into clips: the format of Motion Analysis, OpenSim and many markerless systems.

The second line names and the third gives rates, counts and the unit, the fourth labels the markers, the fifth their
axes. Then each line is a frame: number, time, and three numbers for each marker, separated by tabs. Fields that are
empty or NaN stand for a marker out of sight; empty ones at a line's end are often cut off. Where the header and the
frames differ the frames count: their number, their times.
"""

import math
import re
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.recordings.formats.errors import mended, number_of, refuse, spoilt
from kinespace.library.recordings.formats.markers.marker_clip import clips_of_markers
from kinespace.library.recordings.formats.measures import WORDS, metres_of, timing
from kinespace.library.recordings.formats.table_header import coordinate_of
from kinespace.library.recordings.formats.texts import lines_of

#: Lines within which the header begins, and words of which it has one.
_FRONT, _RATES = 20, ("datarate", "numframe", "nummarker")


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Give the lines that hold something, by number, from the one that names rates on; tabs for other marks."""
    mark, begun = "", False
    for number, line in enumerate(lines_of(path, errors="replace"), start=1):
        if begun := begun or any(word in line.lower() for word in _RATES):
            # Commas that stand between names stand between numbers.
            mark = mark or next((each for each in "\t;," if each in line), "\t")
            if line.strip():
                yield number, line.replace('"', "").replace(mark, "\t")
        elif number == _FRONT:
            break


def _header(names: str, given: str) -> tuple[dict[str, str], bool]:
    """Read rates, counts and the unit by their names in small letters; say whether they stand in the names' line."""
    # Some write NumFrame and NumMarker.
    names = re.sub(r"(numframe|nummarker)(?!s)", r"\1s", names.lower())
    keys, values = names.split(), given.split()
    if any(map(number_of, keys[1::2])):
        return dict(zip(keys[::2], keys[1::2], strict=False)), True
    if len(values) != len(keys):
        keys, values = ([field.strip() for field in line.split("\t")] for line in (names, given))
    return dict(zip(keys, values, strict=False)), False


def _labels(path: Path, number: int, line: str, announced: int, lead: int) -> list[str]:
    """Read the names of the markers, which stand three tabs apart, between any blanks, or thrice."""
    cells = [label.strip() for label in line.split("\t")[lead:]]
    if any(cells[::3]) and not any((*cells[1::3], *cells[2::3])) and len(cells[::3]) >= announced > 1:
        # A marker without a name keeps its columns; a star stands for the name, as in C3D.
        count = max(announced, *(number for number, cell in enumerate(cells[::3], 1) if cell))
        return [cell or f"*{number}" for number, cell in enumerate(cells[::3][:count], 1)]
    tabbed = [label for label in cells if label]
    spaced = line.split()[lead:]
    found = spaced if len(tabbed) < 2 or len(spaced) == announced != len(tabbed) else tabbed
    if len(found) < 2:
        refuse(path, number, f"expected names of markers behind Frame# and Time, 2 at least, got {line[:40]!r}")
    named = [coordinate_of(label) or (label, "") for label in found]
    names, axes = [name for name, _ in named], {axis for _, axis in named[::3]}
    if names[::3] == names[1::3] == names[2::3] and axes <= {"x", ""}:
        return names[::3]
    return [*found, *(f"*{number}" for number in range(len(found) + 1, announced + 1))]


def _fields(line: str, columns: int) -> list[float | None]:
    """Read a frame's fields between tabs, which may be empty, or its words."""
    fields = line.rstrip("\r\n").split("\t") if "\t" in line else line.split()
    found = [number_of(field) for field in fields]
    if None in found:
        found = [number_of(field) for field in mended(fields)]
    while len(found) > columns and found[-1] is not None and math.isnan(found[-1]):
        found.pop()
    return found


def _frames(
    path: Path, lines: Iterator[tuple[int, str]], named: tuple[int, str, int], notes: list[str]
) -> tuple[list[str], NDArray[np.float64]]:
    """Read the frames below the line of names, its number, itself and how many it announces: names, and numbers."""
    number, lead, labels = named[0], 2, _labels(path, *named, 2)
    columns, values, frames = lead + 3 * len(labels), array("d"), 0
    for number, line in lines:
        if not frames and "x" in line.lower():
            continue
        fields = _fields(line, columns)
        if all(each is not None and math.isnan(each) for each in fields):
            # A line of separators alone, as tables write an empty line.
            continue
        if not frames:
            if len(fields) - columns in (-1, 2) and "time" not in named[1].lower().split()[1:2]:
                # Frames with a number, or a time, alone; else a field is cut off.
                labels, lead = _labels(path, *named, 1), 1
            # Names behind those that are announced, without columns; and markers behind those that have names.
            labels = labels[: max((len(fields) - lead) // 3, named[2] or len(labels))]
            labels += [f"*{number}" for number in range(len(labels) + 1, len(fields) // 3 + 1)]
            columns = lead + 3 * len(labels)
        row = [each for each in fields if each is not None]
        if frames and len(row) < columns and not line.endswith(("\n", "\r")):
            notes.append(f"frames: the last line, {number}, is cut off and left out")
            break
        if len(row) < len(fields) or not lead <= len(row) <= columns:
            why = spoilt(line) or f"expected {columns} numbers, got {len(row)} in {line.strip()[:40]!r}"
            refuse(path, number, why)
        values.extend(row + [math.nan] * (columns - len(row)))
        frames += 1
    memory.require_numbers(len(values))
    if not frames:
        refuse(path, number, "the file ends before its first frame")
    return labels, np.frombuffer(values, dtype=np.float64).reshape(frames, columns)


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
    lines, notes = _lines(path), list[str]()
    (_, names), (_, given) = next(lines, (0, "")), next(lines, (0, ""))
    if not names:
        refuse(path, 1, "expected a TRC, got no line that names DataRate, NumFrames and the like")
    said, within = _header(names, given)
    number, heads = (2, given) if within else next(lines, (3, ""))
    counted = said.get("nummarkers", "")
    announced = int(counted) if re.fullmatch(r"\d{1,3}", counted) else 0
    labels, rows = _frames(path, lines, (number, heads, announced), notes)
    frames, lead = len(rows), rows.shape[1] - 3 * len(labels)
    if said.get("numframes") != str(frames):
        notes.append(f"frames: the header says {said.get('numframes', 'nothing')}, there are {frames}: these are taken")
    header = number_of(said.get("datarate", "")) or 0.0
    moments = rows[:, lead - 1] if frame_rate is None and np.isfinite(rows[:, lead - 1]).all() else None
    times, rate = timing(moments, "Time", header if 0 < header < math.inf else 0.0, frame_rate, notes)
    unit = said.get("units", "").strip("0123456789.")
    if metres_per_unit is None and unit.lower() in WORDS["columns"]["no_lengths"]:
        raise ValueError(f"expected positions, got numbers in {unit}")
    metres = metres_per_unit or metres_of(unit)
    if metres is None:
        notes.append(f"units: {said.get('units') or 'none'!r} is no unit: the body's size tells it; --unit names it")
    places = rows[:, lead:].reshape(frames, -1, 3)
    return clips_of_markers(path, labels, places, rate, joints, times=times, metres=metres, notes=notes)
