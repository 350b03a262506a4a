"""UTKinect-Action3D's takes: joints as a depth camera saw them, frame by frame, and labels of the actions.

`joints_s01_e02.txt` holds on each line a frame's number and 20 joints' x, y, z in metres. The camera skipped some
frames and wrote some twice; in a frame of zeros the sensor saw no person. `actionLabel.txt` beside the takes lists,
under each take's name (`s01_e02`), the numbers of the frames between which an action is performed.
"""

from __future__ import annotations

import re
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, NoReturn

import numpy as np

from kinespace.library.clip import Clip
from kinespace.library.recordings import memory
from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.formats.gap_filling import with_missing_frames
from kinespace.library.recordings.formats.joint_choice import chosen
from kinespace.library.recordings.formats.labels import Segment
from kinespace.library.skeleton import Skeleton

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

FRAME_RATE = 30.0
SOURCE = "UTKinect-Action3D"
LICENCE = "research use, not to be passed on"
ATTRIBUTION = (
    'L. Xia, C. Chen, J. Aggarwal, "View invariant human action recognition using histograms of 3D joints", CVPRW 2012.'
)
LABELS = "actionLabel.txt"
#: The joints that Kinect 1 tracks, in the order of the file's columns, in HDM05's names.
SKELETON = Skeleton(
    joints=(
        *("root", "upperback", "lowerneck", "head"),
        *("lclavicle", "lhumerus", "lradius", "lhand", "rclavicle", "rhumerus", "rradius", "rhand"),
        *("lhipjoint", "lfemur", "ltibia", "ltoes", "rhipjoint", "rfemur", "rtibia", "rtoes"),
    ),
    parents=(*(-1, 0, 1, 2), *(2, 4, 5, 6, 2, 8, 9, 10), *(0, 12, 13, 14, 0, 16, 17, 18)),
)

_NAME = re.compile(r"joints_(?P<take>(?P<actor>s\d+)_(?P<number>e\d+))\.txt", re.IGNORECASE)
_COLUMNS = 1 + 3 * len(SKELETON.joints)
#: Frame numbers above this are a mistake: a take of nine hours.
_MAX_FRAME = 1_000_000
#: Corrections of a misprinted label number: the action would begin before the action that is performed before it.
_MISPRINTS = {("s03_e01", "push", 2556): 3556}


class UTKinectError(RecordingError):
    """A take of UTKinect cannot be used; the message names the file and the line."""


class Frames(NamedTuple):
    """The frames with a person, each once: numbers, (frames,), and positions, (frames, 20, 3), metres."""

    numbers: NDArray[np.int64]
    positions: NDArray[np.float64]


def is_take(path: Path) -> bool:
    """Say whether a file is named like UTKinect's takes."""
    return _NAME.fullmatch(path.name) is not None


def read_frames(path: Path) -> Frames:
    """Read the frames that the camera delivered.

    Raises
    ------
    UTKinectError
        A line lacks the frame's number or has not 60 finite numbers, frame numbers fall, or fewer than two frames show
        somebody.
    OSError
        The file cannot be opened.
    """
    numbers, rows = list[int](), list[list[float]]()
    with path.open(encoding="utf-8", errors="replace") as file:
        for line, text in enumerate(file, start=1):
            fields = text.split()
            if not fields:
                continue
            row = _numbers(path, line, fields)
            number = int(row[0])
            if numbers and number < numbers[-1]:
                _fail(path, line, f"expected a frame after {numbers[-1]}, got {number}")
            if any(row[1:]) and (not numbers or number > numbers[-1]):
                numbers.append(number)
                rows.append(row[1:])
    if len(rows) < 2:
        raise UTKinectError(f"{path}: expected at least 2 frames with a person, got {len(rows)}")
    return Frames(np.array(numbers), np.array(rows).reshape(len(rows), -1, 3))


def read_clip(
    path: Path, *, metres_per_unit: float | None = None, frame_rate: float | None = None, joints: Sequence[str] = ()
) -> Clip:
    """Read a take into a clip of all frames from the first to the last, skipped frames on straight lines.

    Parameters
    ----------
    path
        The file.
    metres_per_unit, frame_rate
        Metres of the file's unit, and frames per second; 1 and 30 when not given.
    joints
        Which joints, by name (`library.formats.joint_choice.chosen`); all when none are given.

    Raises
    ------
    UTKinectError
        As `read_frames`, or a joint that is asked for is missing.
    OSError
        The file cannot be opened.
    """
    frames = read_frames(path)
    try:
        kept = chosen(SKELETON.joints, joints)
        span = int(frames.numbers[-1] - frames.numbers[0]) + 1
        memory.require(2 * span * len(kept) * 3 * frames.positions.itemsize, f"{span} frames")
    except ValueError as error:
        raise UTKinectError(f"{path}: {error}") from error
    skeleton = SKELETON.restricted_to(kept) if joints else SKELETON
    seen = frames.positions[:, kept].reshape(len(frames.numbers), -1) * (metres_per_unit or 1.0)
    positions = with_missing_frames(frames.numbers, seen).reshape(-1, len(kept), 3)
    named = _NAME.fullmatch(path.name)
    return Clip(
        skeleton,
        positions,
        frame_rate or FRAME_RATE,
        path.stem,
        actor=named["actor"] if named else "",
        take=named["number"] if named else "",
        source=SOURCE,
        licence=LICENCE,
        attribution=ATTRIBUTION,
        filled=(len(positions) - len(frames.numbers)) * len(kept),
    )


def read_segments(path: Path) -> tuple[Segment, ...]:
    """Read the labels of a take from the file beside it.

    Returns
    -------
    By start, in seconds since the first frame. Actions of unknown time (NaN) are left out; where two actions overlap,
    the earlier one ends where the later one begins.

    Raises
    ------
    UTKinectError
        As `read_frames`, the labels do not name the take, or a line of the labels makes no sense.
    OSError
        No labels are beside the take.
    """
    first = int(read_frames(path).numbers[0])
    named, labels = _NAME.fullmatch(path.name), path.with_name(LABELS)
    take, found, under = named["take"].lower() if named else path.stem, list[tuple[int, int, str]](), None
    for line, text in enumerate(labels.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        label, colon, between = text.partition(":")
        if not colon:
            under = label.strip().lower() or under
        elif under == take and "nan" not in between.lower():
            found.append((*_between(labels, line, between), label.strip()))
    if not found:
        raise UTKinectError(f"{labels}: expected actions of {take}, got none")
    right = sorted((_MISPRINTS.get((take, label, begin), begin), end, label) for begin, end, label in found)
    ends = [min(end, after) for (_, end, _), (after, _, _) in pairwise(right)] + [right[-1][1]]
    return tuple(
        Segment(max(begin - first, 0) / FRAME_RATE, (end - first) / FRAME_RATE, label)
        for (begin, _, label), end in zip(right, ends, strict=True)
        if end > max(begin, first)
    )


def _numbers(path: Path, line: int, fields: list[str]) -> list[float]:
    try:
        row = [float(field) for field in fields]
    except ValueError:
        row = []
    if len(row) != _COLUMNS or not np.isfinite(row).all() or not 0 <= row[0] <= _MAX_FRAME or row[0] % 1:
        _fail(path, line, f"expected a frame's number and {_COLUMNS - 1} numbers, got {' '.join(fields)[:40]!r}")
    return row


def _between(path: Path, line: int, text: str) -> tuple[int, int]:
    fields = text.split()
    if len(fields) != 2 or not all(field.isdecimal() for field in fields) or int(fields[0]) >= int(fields[1]):
        _fail(path, line, f"expected the numbers of two frames, the first before the second, got {text.strip()[:40]!r}")
    return int(fields[0]), int(fields[1])


def _fail(path: Path, line: int, what: str) -> NoReturn:
    raise UTKinectError(f"{path}:{line}: {what}")
