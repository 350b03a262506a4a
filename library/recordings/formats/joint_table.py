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
import zipfile
from array import array
from dataclasses import replace
from typing import TYPE_CHECKING, TextIO

import numpy as np

from kinespace.library.recordings.formats.errors import RecordingError, refuse
from kinespace.library.recordings.formats.joint_choice import restricted
from kinespace.library.recordings.formats.markers.marker_clip import clip_of_markers
from kinespace.library.recordings.formats.timed_frames import evened
from kinespace.library.recordings.formats.units import guessed_metres
from kinespace.library.skeleton import Skeleton

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from kinespace.library.clip import Clip

#: Frames per second of a table without times: the rate of MediaPipe's cameras.
FRAME_RATE = 30.0
#: Seconds between two frames from which on times are taken to be milliseconds.
_SECONDS_APART = 1.0
_TIMES = ("time", "time_s", "timestamp", "timestamp_s", "t")
_COLUMN = re.compile(r"(?P<joint>.+)[_.](?P<axis>[xyz])", re.IGNORECASE)
#: The beginning of every column in FreeMoCap's newer tables of a body.
_BODY = "body_"
_ARRAYS = ("time", "positions", "joints", "parents", "performer")
#: The errors of numpy and zipfile for a file of another kind, or one cut short.
_DAMAGE = (zipfile.BadZipFile, EOFError, KeyError, OSError, ValueError)


def is_joint_table(path: Path) -> bool:
    """Say whether a `.csv` or `.npz` file is a table of joints: files of labels and libraries have the same endings."""
    try:
        if path.suffix.lower() == ".npz":
            with zipfile.ZipFile(path) as archive:
                return {"time.npy", "positions.npy", "joints.npy"} <= set(archive.namelist())
        if path.suffix.lower() != ".csv":
            return False
        with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
            return bool(_joints(next(csv.reader(file, delimiter=_mark_between(file)), [])))
    except (zipfile.BadZipFile, OSError, csv.Error):
        return False


def read_clip(
    path: Path, *, metres_per_unit: float | None = None, frame_rate: float | None = None, joints: Sequence[str] = ()
) -> Clip:
    """Read a table into a clip whose frames follow each other evenly.

    Parameters
    ----------
    path
        The file.
    metres_per_unit
        Metres of a CSV's unit; told by the body's size when not given. An `.npz` is in metres.
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
    times, positions, names, parents, performer = _arrays(path)
    skeleton = Skeleton(tuple(map(str, names.tolist())), tuple(map(int, parents.tolist())))
    if not np.isfinite(positions).all():
        raise RecordingError(f"{path}: positions: expected finite metres, got NaN or infinity")
    even = evened(times.astype(np.float64), positions.astype(np.float64), rate=frame_rate)
    return replace(even.clip(skeleton), name=path.stem, actor=str(performer))


def _arrays(path: Path) -> list[NDArray[np.generic]]:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as loaded:
            arrays = [np.asarray(loaded[name]) for name in _ARRAYS]
    except _DAMAGE as error:
        raise RecordingError(f"{path}: not a table of joints ({error})") from error
    times, positions, names = arrays[:3]
    if positions.ndim != 3 or positions.shape != (len(times), len(names), 3) or positions.dtype.kind != "f":
        raise RecordingError(f"{path}: expected positions ({len(times)}, {len(names)}, 3), got {positions.shape}")
    return arrays


def _csv_clip(path: Path, metres: float | None, frame_rate: float | None, joints: Sequence[str]) -> Clip:
    names, times, positions = _read_csv(path)
    if metres is None:
        metres = guessed_metres(_reach(positions))
    if times is None:
        return clip_of_markers(path, names, positions * metres, frame_rate or FRAME_RATE, joints)
    # Single joints that were not seen are put on straight lines, as markers are; only evenly spaced frames allow it.
    even = evened(times, positions * metres, rate=frame_rate)
    clip = clip_of_markers(path, names, even.positions, even.rate, joints)
    return replace(clip, filled=clip.filled + even.missing * len(clip.skeleton.joints), gaps=even.gaps)


def _reach(positions: NDArray[np.float64]) -> float:
    """Give the largest extent of the first frame in which two joints were seen, in the file's unit."""
    for frame in positions:
        seen = frame[np.isfinite(frame).all(axis=1)]
        if len(seen) > 1:
            return float(np.linalg.norm(np.ptp(seen, axis=0)))
    return 0.0


def _joints(header: Sequence[str]) -> dict[str, dict[str, int]]:
    """Find the joints that have all three columns: for each axis its column."""
    found: dict[str, dict[str, int]] = {}
    for place, name in enumerate(header):
        if named := _COLUMN.fullmatch(name.strip()):
            found.setdefault(named["joint"], {})[named["axis"].lower()] = place
    whole = {joint: axes for joint, axes in found.items() if len(axes) == 3}
    if len(whole) > 1 and all(joint.startswith(_BODY) for joint in whole):
        return {joint.removeprefix(_BODY): axes for joint, axes in whole.items()}
    return whole


def _mark_between(file: TextIO) -> str:
    """Find the mark between the fields of a file just opened: the mark that its first line has most."""
    head = file.readline()
    file.seek(0)
    return max(",;\t", key=head.count)


def _read_csv(path: Path) -> tuple[list[str], NDArray[np.float64] | None, NDArray[np.float64]]:
    """Read joint names, times in seconds (or None), and positions in the file's unit, NaN for an empty field."""
    values, times = array("d"), array("d")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = csv.reader(file, delimiter=_mark_between(file))
            header = next(lines, [])
            joints = _joints(header)
            if len(joints) < 2:
                refuse(path, 1, "expected columns like head_x, head_y, head_z for two joints or more")
            clock = next((place for place, name in enumerate(header) if name.strip().lower() in _TIMES), None)
            columns = [axes[axis] for axes in joints.values() for axis in "xyz"]
            for row in lines:
                if not row:
                    continue
                if len(row) < len(header):
                    refuse(path, lines.line_num, f"expected {len(header)} fields, got {len(row)}")
                values.extend([_number(path, lines.line_num, row[column]) for column in columns])
                if clock is not None:
                    times.append(_number(path, lines.line_num, row[clock]))
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
