"""Tables of joint positions: CSV with three columns for each joint, and the `.npz` that `kinespace convert` writes.

A CSV (also `.tsv`, `.txt`) has commas, semicolons or tabs between, in UTF-8 or UTF-16; `table_header` finds its
columns, in the tables of Motive and Vicon too. Times count in any unit (`timed_frames.seconds_of`); without them frames
follow each other evenly, 30 in a second unless another rate is given. A column that numbers or names persons makes a
clip for each. Other columns (visibilities, rotations) are ignored. An empty field is a joint that was not seen.

The `.npz` holds `time` (frames,), seconds; `positions` (frames, joints, 3), metres; `joints`; `parents`, empty when
they are not known; and `performer`.
"""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from io import BytesIO
from itertools import chain, islice, pairwise
from pathlib import Path

import numpy as np
from numpy.lib.format import read_array
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip, as_numbers
from kinespace.library.recordings.formats.errors import RecordingError, number_of, refuse
from kinespace.library.recordings.formats.joint_choice import few, restricted
from kinespace.library.recordings.formats.markers.marker_clip import clip_of_markers
from kinespace.library.recordings.formats.table_header import Header, header_of, is_numbers
from kinespace.library.recordings.formats.timed_frames import laid, timing
from kinespace.library.skeleton import Skeleton

#: The marks between fields, in the order in which they are tried.
_MARKS = "\t;,"
#: Lines of which one must have the mark between fields, and lines in which a table's first frame must come.
_FRONT = 50
_MAX_HEAD = 2000
#: The endings of tables in text.
TEXTS = (".csv", ".tsv", ".txt")
_ARRAYS = ("time", "positions", "joints", "parents", "performer")
#: The errors for a file of another kind, or one cut short.
_DAMAGE = (*memory.DAMAGE, OSError, ValueError)


def is_joint_table(path: Path) -> bool:
    """Say whether a text or `.npz` file is a table of joints: files of labels and libraries have the same endings."""
    try:
        if path.suffix.lower() == ".npz":
            with memory.archive(path) as archive:
                return {"time.npy", "positions.npy", "joints.npy"} <= set(archive.namelist())
        return path.suffix.lower() in TEXTS and _begun(path, memory.MAX_MEMORY) is not None
    except (*_DAMAGE, csv.Error):
        return False


def why_no_table(path: Path) -> str:
    """Say what a file lacks to be a table of joints; empty where it is none of the usual mistakes."""
    if path.suffix.lower() == ".npy":
        return "a bare array without times and joint names: np.savez them as `kinespace convert` does, or make a Clip"
    if path.suffix.lower() == ".npz":
        return "a .npz without the arrays time, positions and joints"
    try:
        _begun(path, memory.MAX_MEMORY)
        first = next(memory.lines(path, memory.MAX_LINE, errors="replace"), "").lower()
    except csv.Error as error:
        return f"a table with {error}"
    except _DAMAGE:
        return ""
    if any(f"{mark}x" in first and f"{mark}y" in first and f"{mark}z" not in first for mark in "_."):
        return "columns x and y but no z: 2-D landmarks cannot be compared, their distances are no body's"
    return ""


def read_clips(
    path: Path, *, metres_per_unit: float | None = None, frame_rate: float | None = None, joints: Sequence[str] = ()
) -> list[Clip]:
    """Read a table into a clip for each person, whose frames follow each other evenly.

    Parameters
    ----------
    path
        The file.
    metres_per_unit
        Metres of a CSV's unit; as its header says, or by the body's size, when not given. An `.npz` is in metres.
    frame_rate
        Frames per second; as often as the file's times say when not given.
    joints
        Which joints, by name (`library.formats.joint_choice.chosen`); all when none are given.

    Raises
    ------
    RecordingError
        The file is no such table, or a line of it makes no sense.
    ValueError
        The times fall, or a joint that is asked for is missing.
    OSError
        The file cannot be opened.
    """
    if path.suffix.lower() == ".npz":
        return [restricted(_npz_clip(path, frame_rate), joints)]
    head, people, notes = _read_csv(path)
    return [
        replace(clip, actor=name or clip.actor)
        for name, each in people.items()
        for clip in [_clip(path, head, each, metres_per_unit, frame_rate, joints, notes)]
    ]


def _npz_clip(path: Path, frame_rate: float | None) -> Clip:
    times, positions, skeleton, performer = _arrays(path)
    if not np.isfinite(positions).all():
        raise RecordingError(f"{path}: positions: expected finite metres, got NaN or infinity")
    return replace(laid(times, positions, frame_rate).clip(skeleton), name=path.stem, actor=performer)


def _arrays(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64], Skeleton, str]:
    try:
        with memory.archive(path) as archive:
            arrays = [read_array(BytesIO(memory.unpacked(archive, name, memory.limit() // 4))) for name in _ARRAYS]
        memory.require_numbers(sum(each.size for each in arrays))
        times, positions, names, parents, performer = arrays
        skeleton = Skeleton(few([str(name) for name in names.tolist()]), tuple(map(int, parents.tolist())))
        times, positions, expected = as_numbers(times), as_numbers(positions), (len(times), len(names), 3)
    except _DAMAGE as error:
        raise RecordingError(f"{path}: not a table of joints ({error})") from error
    if positions.shape != expected or times.ndim != 1:
        raise RecordingError(f"{path}: expected positions {expected}, got {positions.shape}")
    return times, positions, skeleton, str(performer)


@dataclass(slots=True)
class _Frames:
    """One person's rows: the joints' numbers, times or frame numbers, and the joints' names where each row is one."""

    values: array[float] = field(default_factory=lambda: array("d"))
    moments: array[float] = field(default_factory=lambda: array("d"))
    labels: list[str] = field(default_factory=list)

    def together(self, joints: Sequence[str]) -> tuple[Sequence[str], NDArray[np.float64], NDArray[np.float64]]:
        """Give the joints' names, their positions (frames, joints, 3) and the frames' moments."""
        values, moments = np.frombuffer(self.values), np.frombuffer(self.moments)
        if not self.labels:
            return joints, values.reshape(-1, len(joints), 3), moments
        names, frames, begins = list(dict.fromkeys(self.labels)), list[dict[str, int]](), list[int]()
        for row, (label, moment) in enumerate(zip(self.labels, self.moments, strict=True)):
            if not frames or label in frames[-1] or moment != self.moments[begins[-1]]:
                frames.append({})
                begins.append(row)
            frames[-1][label] = row
        few(names)
        memory.require_numbers(len(frames) * len(names) * 3)
        # The row behind the last stands for a joint that is not in its frame.
        rows = np.concatenate([values.reshape(-1, 3), np.full((1, 3), np.nan)])
        return names, rows[[[frame.get(name, -1) for name in names] for frame in frames]], moments[begins]


def _clip(  # noqa: PLR0913, PLR0917 - what a person may ask for
    path: Path,
    head: Header,
    frames: _Frames,
    metres: float | None,
    rate: float | None,
    joints: Sequence[str],
    notes: Sequence[str],
) -> Clip:
    memory.require_numbers(len(frames.values))
    names, positions, moments = frames.together([*head.joints])
    if len(positions) < 2:
        raise RecordingError(f"{path}: expected at least 2 frames, got {len(positions)}")
    clock, own = _clock(head), list(notes)
    if timed := np.isfinite(moments).sum():
        if untimed := len(moments) - timed:
            own.append(f"times: {untimed} frames without one are left out")
        positions, moments = positions[np.isfinite(moments)], moments[np.isfinite(moments)]
    name = "" if clock is None else head.names[clock]
    times, rate = timing(moments if timed else None, name, head.rate, rate, own)
    metres = metres or head.metres
    return clip_of_markers(path, names, positions, rate, joints, times=times, metres=metres, notes=own)


def _clock(head: Header) -> int | None:
    """Give the column that says when a frame was: of times, or else of frame numbers."""
    return head.frames if head.times is None else head.times


def _rows(path: Path, mark: str, most: int | None) -> Iterator[list[str]]:
    """Give the rows of a table of at most so many characters."""

    def whole() -> Iterator[str]:
        for line in memory.lines(path, most, errors="replace"):
            # A row of any length, otherwise.
            if line.count('"') % 2:
                raise csv.Error("a quotation mark that does not end on its line")
            yield line

    return csv.reader(whole(), delimiter=mark)


def _begun(path: Path, most: int | None = None) -> tuple[Header, list[str], Iterator[list[str]], int] | None:
    """Read a table up to its first frame: the header, that frame, the rows behind it, and the frame's line."""
    found, front = None, "".join(islice(memory.lines(path, most, errors="replace"), _FRONT))
    for mark in (each for each in _MARKS if each in front):
        head, rows = list[list[str]](), _rows(path, mark, most)
        for number, row in enumerate(islice(rows, _MAX_HEAD), start=1):
            if not is_numbers(row):
                head.append(row)
            elif (header := header_of(head)) and (found is None or len(header.joints) > len(found[0].joints)):
                found = header, row, rows, number
                break
            else:
                # The header of another part of the file.
                head = []
        if found is None and (header := header_of(head)):
            found = header, [], rows, len(head)
    return found


def _read_csv(path: Path) -> tuple[Header, dict[str, _Frames], list[str]]:
    """Read a table's header, each person's frames, positions in the file's unit, and remarks."""
    try:
        begun = _begun(path)
        if begun is None:
            refuse(path, 1, "expected columns like head_x, head_y, head_z for two joints or more")
        head, first, rows, begin = begun
        columns = [column for axes in head.joints.values() for column in axes]
        people, notes, clock = dict[str, _Frames](), list[str](), _clock(head)
        needed = max(columns + [each for each in (clock, head.person, head.label) if each is not None]) + 1
        for number, row in _whole(path, chain([first], rows), begin, needed, notes):
            person = row[head.person].strip() if head.person is not None else ""
            frames = people.setdefault(person, _Frames())
            fields = [row[column] for column in columns]
            try:
                frames.values.extend([*map(float, fields)])
            except ValueError:
                frames.values.extend([_number(path, number, each) for each in fields])
            if head.label is not None:
                frames.labels.append(row[head.label].strip())
            frames.moments.append(math.nan if clock is None else _moment(path, number, row[clock]))
    except csv.Error as error:
        raise RecordingError(f"{path}: expected a CSV ({error})") from error
    if head.others:
        notes.append(f"no positions: {', '.join(head.others[:5])}{' ...' if len(head.others) > 5 else ''}: left out")
    return head, people if len(people) > 1 else {"": next(iter(people.values()), _Frames())}, notes


def _whole(
    path: Path, rows: Iterator[list[str]], begin: int, needed: int, notes: list[str]
) -> Iterator[tuple[int, list[str]]]:
    """Give the rows of frames with their lines, empty fields where some at the end lack; remark on what is odd."""
    blank, short = False, 0
    for number, (row, after) in enumerate(pairwise(chain(rows, [None])), start=begin):
        if not row or not any(row) or row[0].startswith("#"):
            blank |= not row or not any(row)
            continue
        if blank and not is_numbers(row):
            notes.append(f"parts: what stands from line {number} on is left out")
            break
        if len(row) < needed and number > begin and after is None:
            notes.append(f"frames: the last line, {number}, is cut off and left out")
            break
        if 2 * len(row) < needed:
            refuse(path, number, f"expected {needed} fields, got {len(row)}")
        short += len(row) < needed
        yield number, row + [""] * (needed - len(row))
    if short:
        notes.append(f"frames: {short} have fewer than {needed} fields: the joints in the others are not seen")


def _number(path: Path, line: int, text: str) -> float:
    number = number_of(text)
    if number is None:
        refuse(path, line, f"expected a number, got {text[:40]!r}")
    return number


def _moment(path: Path, line: int, text: str) -> float:
    """Read a time: a number, a date with its time, or hours, minutes and seconds."""
    if ":" not in text and "-" not in text[1:]:
        return _number(path, line, text)
    try:
        return datetime.fromisoformat(text.strip()).timestamp()
    except ValueError:
        pass
    seconds = 0.0
    for part in text.split(":"):
        seconds = 60 * seconds + _number(path, line, part)
    return seconds
