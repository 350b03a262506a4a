"""What is performed when in a continuous take: labelled segments, and the clips cut from them."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from kinespace.library.clip import Clip

_COLUMNS = ("start_s", "end_s", "label")


class LabelError(ValueError):
    """A file of labels cannot be used; the message names the file and the line."""


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of a take in which one motion is performed.

    Attributes
    ----------
    start, end
        Seconds from the take's start; the end is not part of it.
    label
        What is performed.
    performer
        By whom, in a recording of several; empty where nobody has said.

    Raises
    ------
    ValueError
        The end is not after the start, a time is not finite or negative, or the label is empty.
    """

    start: float
    end: float
    label: str
    performer: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.end) and 0 <= self.start < self.end):
            raise ValueError(f"segment: expected 0 <= start < end, got {self.start} to {self.end}")
        if not self.label:
            raise ValueError("label: expected a name, got an empty one")

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.end - self.start


def read_labels(path: Path) -> tuple[Segment, ...]:
    """Read a CSV with the columns `start_s,end_s,label` and, where several perform, `performer`.

    Lines without a label are passed over: nobody has said what they are.

    Returns
    -------
    The segments by their start.

    Raises
    ------
    LabelError
        The file is no CSV, a column is missing, a line makes no sense, segments overlap, or there is none.
    OSError
        The file cannot be opened.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.DictReader(file)
            missing = [name for name in _COLUMNS if name not in (rows.fieldnames or ())]
            if missing:
                raise LabelError(f"{path}: expected the columns {', '.join(_COLUMNS)}, no {', '.join(missing)} in it")
            segments = [
                _segment(path, rows.line_num, row) for row in rows if row["label"] is None or row["label"].strip()
            ]
    except (csv.Error, UnicodeDecodeError) as error:
        raise LabelError(f"{path}: expected a CSV in UTF-8 ({error})") from error
    if not segments:
        raise LabelError(f"{path}: no segment in it")
    by_performer = sorted(segments, key=lambda segment: (segment.performer, segment.start))
    for before, after in pairwise(by_performer):
        if before.performer == after.performer and after.start < before.end:
            raise LabelError(
                f"{path}: {before.label!r} (to {before.end}) and {after.label!r} (from {after.start}) overlap"
            )
    return tuple(sorted(segments, key=lambda segment: segment.start))


def _segment(path: Path, line: int, row: Mapping[str, str | None]) -> Segment:
    try:
        start, end = float(row["start_s"] or ""), float(row["end_s"] or "")
        return Segment(start, end, (row["label"] or "").strip(), (row.get("performer") or "").strip())
    except ValueError as error:
        raise LabelError(f"{path}:{line}: {error}") from error


def renamed(segments: Iterable[Segment], names: Mapping[str, str]) -> tuple[Segment, ...]:
    """Give segments other labels where `names` has one."""
    return tuple(replace(segment, label=names.get(segment.label, segment.label)) for segment in segments)


def cut(take: Clip, segments: Sequence[Segment]) -> Iterator[Clip]:
    """Cut a take into one clip per segment; the label is its class, the take's name its take.

    Frames beyond the take's end are left out, and so is a segment of which fewer than two frames are there.

    Raises
    ------
    LabelError
        A segment holds a time in which nothing was seen.
    """
    for segment in segments:
        for begin, end in take.gaps:
            if begin < segment.end and segment.start < end:
                raise LabelError(
                    f"{take.name}: {segment.label!r} from {segment.start:g} to {segment.end:g} s: nothing was seen of "
                    f"the performer from {begin:.2f} to {end:.2f} s"
                )
        first, last = round(segment.start * take.frame_rate), round(segment.end * take.frame_rate)
        positions = take.positions[first:last]
        if len(positions) >= 2:
            clip = take.moved_to(positions)
            cut_out = replace(clip, rotations=take.rotations[first:last], class_name=segment.label, take=take.name)
            yield replace(cut_out, gaps=())
