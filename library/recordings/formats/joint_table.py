"""Tables of joint positions: CSV with three columns for each joint, and the `.npz` that `kinespace convert` writes.

A CSV has commas, semicolons or tabs between; its first line names its columns: `<joint>_x`, `<joint>_y`, `<joint>_z`
for each joint, in any order, and perhaps a column `time` (or `timestamp`, `time_s`, `timestamp_s`, `t`): seconds, or
milliseconds if frames would otherwise lie a second or more apart. Other columns (a frame's number, visibilities) are
ignored. Without times the frames follow each other evenly, 30 in a second unless another rate is given; FreeMoCap
writes its `mediapipe_body_3d_xyz.csv` so. An empty field is a joint that was not seen.

The `.npz` holds `time` (frames,), seconds; `positions` (frames, joints, 3), metres; `joints`; `parents`, empty when
they are not known; and `performer`.
"""

from __future__ import annotations

import csv
import math
import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import replace
from io import BytesIO
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.lib.format import read_array
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip, as_numbers
from kinespace.library.recordings.formats.errors import RecordingError, refuse
from kinespace.library.recordings.formats.joint_choice import few, restricted
from kinespace.library.recordings.formats.markers.marker_clip import clip_of_markers
from kinespace.library.recordings.formats.timed_frames import evened
from kinespace.library.recordings.formats.units import guessed_metres
from kinespace.library.skeleton import Skeleton

#: Frames per second of a table without times: the rate of MediaPipe's cameras.
FRAME_RATE = 30.0
#: Seconds between two frames from which on times are taken to be milliseconds.
_SECONDS_APART = 1.0
_TIMES = ("time", "time_s", "timestamp", "timestamp_s", "t")
_COLUMN = re.compile(r"(?P<joint>.+)[_.](?P<axis>[xyz])", re.IGNORECASE)
#: The beginning of every column in FreeMoCap's newer tables of a body.
_BODY = "body_"
_ARRAYS = ("time", "positions", "joints", "parents", "performer")
#: The errors for a file of another kind, or one cut short.
_DAMAGE = (*memory.DAMAGE, OSError, ValueError)


def is_joint_table(path: Path) -> bool:
    """Say whether a `.csv` or `.npz` file is a table of joints: files of labels and libraries have the same endings."""
    try:
        if path.suffix.lower() == ".npz":
            with memory.archive(path) as archive:
                return {"time.npy", "positions.npy", "joints.npy"} <= set(archive.namelist())
        if path.suffix.lower() != ".csv":
            return False
        return bool(_joints(next(_rows(memory.lines(path, memory.MAX_LINE, errors="replace")), [])))
    except (*_DAMAGE, csv.Error):
        return False


def why_no_table(path: Path) -> str:
    """Say what a file lacks to be a table of joints; empty where it is none of the usual mistakes."""
    if path.suffix.lower() == ".npy":
        return "a bare array without times and joint names: np.savez them as `kinespace convert` does, or make a Clip"
    if path.suffix.lower() == ".npz":
        return "a .npz without the arrays time, positions and joints"
    try:
        rows = _rows(memory.lines(path, memory.MAX_LINE, errors="replace"))
        first, second = next(rows, []), next(rows, [])
    except (*_DAMAGE, csv.Error):
        return ""
    axes = {each.strip().lower() for each in second} - {""}
    if {"x", "y"} <= axes:
        return "two lines of headings, as pandas writes a MultiIndex: join them, df.columns = map('_'.join, df.columns)"
    ends = {name.strip().lower()[-2:] for name in first}
    if ends & {"_x", ".x"} and ends & {"_y", ".y"} and not ends & {"_z", ".z"}:
        return "columns x and y but no z: 2-D landmarks cannot be compared, their distances are no body's"
    return ""


def read_clip(
    path: Path, *, metres_per_unit: float | None = None, frame_rate: float | None = None, joints: Sequence[str] = ()
) -> Clip:
    """Read a table into a clip whose frames follow each other evenly.

    Parameters
    ----------
    path
        The file.
    metres_per_unit
        Metres of a CSV's unit; guessed by the body's size when not given. An `.npz` is in metres.
    frame_rate
        Frames per second; as often as the file's times say when not given.
    joints
        Which joints, by name (`library.formats.joint_choice.chosen`); all when none are given.

    Raises
    ------
    RecordingError
        The file is no such table, or a line of it makes no sense.
    ValueError
        The times fall, a joint is missing for too long, or a joint that is asked for is missing.
    OSError
        The file cannot be opened.
    """
    if path.suffix.lower() == ".npz":
        return restricted(_npz_clip(path, frame_rate), joints)
    return _csv_clip(path, metres_per_unit, frame_rate, joints)


def _npz_clip(path: Path, frame_rate: float | None) -> Clip:
    times, positions, skeleton, performer = _arrays(path)
    if not np.isfinite(positions).all():
        raise RecordingError(f"{path}: positions: expected finite metres, got NaN or infinity")
    even = evened(times, positions, rate=frame_rate)
    return replace(even.clip(skeleton), name=path.stem, actor=performer)


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


def _csv_clip(path: Path, metres: float | None, frame_rate: float | None, joints: Sequence[str]) -> Clip:
    names, times, positions = _read_csv(path)
    if metres is None:
        metres = guessed_metres(positions)
    if times is None:
        return clip_of_markers(path, names, positions * metres, frame_rate or FRAME_RATE, joints)
    # Single joints that were not seen are put on straight lines, as markers are; only evenly spaced frames allow it.
    even = evened(times, positions * metres, rate=frame_rate)
    clip = clip_of_markers(path, names, even.positions, even.rate, joints)
    return replace(clip, filled=clip.filled + even.missing * len(clip.skeleton.joints), gaps=even.gaps)


def _joints(header: Sequence[str]) -> dict[str, dict[str, int]]:
    """Find the joints that have all three columns: for each axis its column."""
    found: dict[str, dict[str, int]] = {}
    for place, name in enumerate(header):
        if named := _COLUMN.fullmatch(name.strip()):
            found.setdefault(named["joint"], {})[named["axis"].lower()] = place
    whole = {joint: axes for joint, axes in found.items() if len(axes) == 3}
    if all(joint.startswith(_BODY) for joint in whole):
        return {joint.removeprefix(_BODY): axes for joint, axes in whole.items()}
    return whole


def _rows(lines: Iterator[str]) -> Iterator[list[str]]:
    """Give the rows of a table; the mark between their fields is the mark that the first line has most."""
    head = next(lines, "")

    def whole() -> Iterator[str]:
        for line in chain([head], lines):
            # A row of any length, otherwise.
            if line.count('"') % 2:
                raise csv.Error("a quotation mark that does not end on its line")
            yield line

    return csv.reader(whole(), delimiter=max(",;\t", key=head.count))


def _read_csv(path: Path) -> tuple[list[str], NDArray[np.float64] | None, NDArray[np.float64]]:
    """Read joint names, times in seconds (or None), and positions in the file's unit, NaN for an empty field."""
    values, times = array("d"), array("d")
    try:
        rows = _rows(memory.lines(path))
        header = next(rows, [])
        joints = _joints(header)
        if len(joints) < 2:
            refuse(path, 1, "expected columns like head_x, head_y, head_z for two joints or more")
        clock = next((place for place, name in enumerate(header) if name.strip().lower() in _TIMES), None)
        columns = [axes[axis] for axes in joints.values() for axis in "xyz"]
        for number, row in enumerate(rows, start=2):
            if not row:
                continue
            if len(row) < len(header):
                refuse(path, number, f"expected {len(header)} fields, got {len(row)}")
            values.extend([_number(path, number, row[column]) for column in columns])
            if clock is not None:
                times.append(_number(path, number, row[clock]))
        memory.require_numbers(len(values))
    except (csv.Error, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: expected a CSV in UTF-8 ({error})") from error
    positions = np.frombuffer(values, dtype=np.float64).reshape(-1, len(joints), 3)
    if len(positions) < 2:
        raise RecordingError(f"{path}: expected at least 2 frames, got {len(positions)}")
    if clock is None:
        return list(joints), None, positions
    moments = np.frombuffer(times, dtype=np.float64)
    milliseconds = float(np.median(np.diff(moments))) >= _SECONDS_APART
    return list(joints), moments / 1000 if milliseconds else moments, positions


def _number(path: Path, line: int, text: str) -> float:
    try:
        number = float(text.replace(",", ".")) if text.strip() else math.nan
    except ValueError:
        number = math.inf
    if math.isinf(number):
        refuse(path, line, f"expected a number, got {text[:40]!r}")
    return number
