"""UTKinect-Action3D's takes: joints as a depth camera saw them, frame by frame, and labels of the actions.

`joints_s01_e02.txt` holds on each line a frame's number and 20 joints' x, y, z in metres. The camera skipped some
frames and wrote some twice; in a frame of zeros the sensor saw no person. `actionLabel.txt` next to the takes lists,
under each take's name (`s01_e02`), the numbers of the frames between which an action is performed.
"""

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.formats.labels import Segment
from kinespace.library.recordings.formats.measures import with_missing_frames
from kinespace.library.skeleton import Skeleton

FRAME_RATE = 30.0
#: The file of labels beside the takes.
LABELS = "actionLabel.txt"
#: The joints of Kinect 1 in the order of the file's columns, in HDM05's names; HDM05 has no spine just above the hips.
SKELETON = Skeleton(
    (
        *("root", "Spine", "lowerneck", "head"),
        *("lclavicle", "lhumerus", "lradius", "lhand", "rclavicle", "rhumerus", "rradius", "rhand"),
        *("lhipjoint", "lfemur", "ltibia", "ltoes", "rhipjoint", "rfemur", "rtibia", "rtoes"),
    ),
    (*(-1, 0, 1, 2), *(2, 4, 5, 6, 2, 8, 9, 10), *(0, 12, 13, 14, 0, 16, 17, 18)),
)
_NAME = re.compile(r"joints_(?P<take>(?P<actor>s\d+)_(?P<number>e\d+))\.txt", re.IGNORECASE)
#: A label of an action: its name, and the numbers of two frames, or NaN.
_LABEL = re.compile(r"(?P<label>.+):\s*(?P<begin>\d+|NaN)\s+(?P<end>\d+|NaN)\s*", re.IGNORECASE)
#: Corrections of a misprinted label number: the action would begin before the action that is performed before it.
_MISPRINTS = {("s03_e01", "push", 2556): 3556}


def is_take(path: Path) -> bool:
    """Say whether a file is named like UTKinect's takes."""
    return _NAME.fullmatch(path.name) is not None


def read_clip(path: Path) -> Clip:
    """Read a take: all frames from the first to the last in which a person is seen, skipped ones on straight lines.

    Raises
    ------
    RecordingError
        The file holds something else than frames' numbers that do not fall and 20 joints each, or fewer than two frames
        show somebody.
    OSError
        The take cannot be opened.
    """
    numbers, positions = _frames(path)
    named = _NAME.fullmatch(path.name)
    return Clip(
        SKELETON,
        with_missing_frames(numbers, positions).reshape(-1, len(SKELETON.joints), 3),
        FRAME_RATE,
        path.stem,
        actor=named["actor"] if named else "",
        take=named["number"] if named else "",
        source="UTKinect-Action3D",
        filled=(int(numbers[-1] - numbers[0]) + 1 - len(numbers)) * len(SKELETON.joints),
    )


def delivered(path: Path) -> NDArray[np.int64]:
    """Give the frames of a take's clip that the camera delivered; raises as `read_clip`."""
    numbers, _ = _frames(path)
    since: NDArray[np.int64] = numbers - numbers[0]
    return since


def read_segments(path: Path) -> tuple[Segment, ...]:
    """Read a take's actions in the file next to it, by their start.

    Actions of unknown time are left out; where two actions overlap, the earlier one ends where the later one begins.

    Raises
    ------
    RecordingError
        The take cannot be read, or the labels do not name it.
    OSError
        The take cannot be opened, or no labels are next to it.
    """
    named, labels, (numbers, _) = _NAME.fullmatch(path.name), path.with_name(LABELS), _frames(path)
    take = named["take"].lower() if named else path.stem
    found, under = list[tuple[int, int, str]](), ""
    for line in labels.read_text(encoding="utf-8", errors="replace").splitlines():
        labelled = _LABEL.fullmatch(line)
        if labelled is None:
            under = line.strip().lower() or under
        elif under == take and "nan" not in line.lower():
            label, begin = labelled["label"].strip(), int(labelled["begin"])
            found.append((_MISPRINTS.get((take, label, begin), begin), int(labelled["end"]), label))
    if not found:
        raise RecordingError(f"{labels}: expected actions of {take}, got none")
    first, found = int(numbers[0]), sorted(found)
    ends = [min(end, after) for (_, end, _), (after, _, _) in pairwise(found)] + [found[-1][1]]
    return tuple(
        Segment(max(begin - first, 0) / FRAME_RATE, (end - first) / FRAME_RATE, label)
        for (begin, _, label), end in zip(found, ends, strict=True)
        if end > max(begin, first)
    )


def _frames(path: Path) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Read the frames in which a person is seen, each once: their numbers and positions, (frames, 60)."""
    try:
        rows = np.loadtxt(path, ndmin=2)
    except ValueError as error:
        raise RecordingError(f"{path}: {error}") from error
    whole = rows.shape[1] == 1 + 3 * len(SKELETON.joints) and np.isfinite(rows).all()
    if not whole or (np.diff(rows[:, 0]) < 0).any():
        raise RecordingError(f"{path}: expected on each line a frame's number, that does not fall, and 60 numbers")
    seen = rows[:, 1:].any(axis=1)
    numbers, first = np.unique(rows[seen, 0].astype(np.int64), return_index=True)
    if len(numbers) < 2:
        raise RecordingError(f"{path}: expected at least 2 frames with a person, got {len(numbers)}")
    return numbers, rows[seen, 1:][first]
