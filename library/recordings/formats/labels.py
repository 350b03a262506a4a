"""Labels of a continuous take: segments in which a motion is performed, and the clips cut from them.

Read are a table with the columns `start_s,end_s,label`, with commas, semicolons or tabs between; labels as Audacity
exports them (start, end and label, with tabs between, no headings); ELAN's annotations (`.eaf`); and the state events
of a BORIS project (`.boris`) with one observation.
"""

import csv
import json
import math
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.recordings.formats.texts import lines_of

_COLUMNS = ("start_s", "end_s", "label")
#: Columns of a table in frames, which is refused with a hint: a table does not know the take's frame rate.
_IN_FRAMES = {"start_frame", "end_frame"}
#: Endings of the files of labels that may lie in a take's folder.
_ENDINGS = (".csv", ".tsv", ".txt", ".eaf", ".boris")
#: A line that Audacity exports.
_EXPORTED = re.compile(r"(\d+(?:[.,]\d+)?)\t(\d+(?:[.,]\d+)?)\t([^\t]*)")
#: Seconds of the shortest window by which motions are compared.
_SHORTEST = 0.25


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
        The motion that is performed.
    performer
        The performer in a recording of several; empty when not given.

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
        """Length in seconds."""
        return self.end - self.start


def read_labels(path: Path) -> tuple[Segment, ...]:
    """Read a table with the columns `start_s,end_s,label` and, where several perform, `performer`; or an export.

    Lines without a label are ignored. So are Audacity's labels of a moment.

    Returns
    -------
    The segments by their start.

    Raises
    ------
    LabelError
        The file is no table, a column is missing, a line makes no sense, segments overlap, or there is none.
    OSError
        The file cannot be opened.
    """
    try:
        lines = list(lines_of(path, memory.MAX_WITHOUT_MOTION))
        segments = list(_READERS.get(path.suffix.lower(), _segments)(path, lines))
    except (AttributeError, IndexError, ET.ParseError, json.JSONDecodeError, *memory.DAMAGE) as error:
        raise LabelError(f"{path}: expected annotations of ELAN or events of BORIS ({error!r})") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise LabelError(f"{path}: expected a CSV, as a spreadsheet can save it ({error})") from error
    if not segments:
        raise LabelError(f"{path}: no segment in it: write a class into the column `label` of some rows")
    by_performer = sorted(segments, key=lambda segment: (segment.performer, segment.start))
    for before, after in pairwise(by_performer):
        if before.performer == after.performer and after.start < before.end:
            both = f"{before.label!r} (to {before.end}) and {after.label!r} (from {after.start})"
            raise LabelError(f"{path}: {both} overlap")
    return tuple(sorted(segments, key=lambda segment: segment.start))


def labels_beside(take: Path) -> list[Path]:
    """Find the files of labels that lie in a take's folder and have its name; the first of them counts."""
    paths = (take.with_suffix(ending) for ending in _ENDINGS)
    return [path for path in paths if path != take and path.is_file() and _holds_labels(path)]


def _of_elan(path: Path, lines: Sequence[str]) -> Iterator[Segment]:
    """Read the annotations of all tiers; a tier's participant performs them."""
    root = ET.fromstring("".join(lines))  # noqa: S314 - expat refuses entities that grow
    slots = {slot.attrib["TIME_SLOT_ID"]: slot.attrib["TIME_VALUE"] for slot in root.iter("TIME_SLOT")}
    for tier in root.iter("TIER"):
        for number, each in enumerate(tier.iter("ALIGNABLE_ANNOTATION"), 1):
            if label := (each.findtext("ANNOTATION_VALUE") or "").strip():
                # In milliseconds.
                times = [f"{slots[each.attrib[f'TIME_SLOT_REF{end}']]}e-3" for end in (1, 2)]
                yield _segment(path, number, times, label, tier.get("PARTICIPANT", ""))


def _of_boris(path: Path, lines: Sequence[str]) -> Iterator[Segment]:
    """Read the state events: a behaviour of a subject begins with one event and ends with the next."""
    project = json.loads("".join(lines))
    observations = list(project["observations"].values())
    # Point events last no time: nothing is performed between two of them.
    points = {each["code"] for each in project.get("behaviors_conf", {}).values() if each["type"].startswith("Point")}
    if len(observations) != 1:
        raise LabelError(f"{path}: expected one observation, got {len(observations)}")
    times = defaultdict[tuple[str, str], list[float]](list)
    for time, subject, behaviour, *_ in sorted(observations[0]["events"], key=lambda event: event[0]):
        times[subject, behaviour] += [time] * (behaviour not in points)
    for (subject, behaviour), moments in times.items():
        if len(moments) % 2:
            raise LabelError(f"{path}: expected an end of {behaviour!r} of {subject}, which begins at {moments[-1]} s")
        for number, both in enumerate(zip(moments[::2], moments[1::2], strict=True), 1):
            yield _segment(path, number, [*map(str, both)], behaviour, "" if subject == _NOBODY else subject)


_READERS = {".eaf": _of_elan, ".boris": _of_boris}
#: How BORIS calls the subject of an event that has none.
_NOBODY = "No focal subject"


def _holds_labels(path: Path) -> bool:
    if path.suffix.lower() in _READERS:
        return True
    first = ""
    with suppress(ValueError):
        first = next((line.rstrip("\r\n") for line in lines_of(path, errors="replace") if line.strip()), "")
    columns = {name.strip().strip('"') for name in re.split("[,;\t]", first)}
    exported = _EXPORTED.fullmatch(first)
    # A table of numbers holds no labels.
    return set(_COLUMNS) <= columns or columns >= _IN_FRAMES or bool(exported and re.search(r"[^\W\d_]", exported[3]))


def _segments(path: Path, lines: Sequence[str]) -> Iterator[Segment]:
    """Read segments in the order of the file."""
    head = next((line for line in lines if line.strip()), "").rstrip("\r\n")
    exported = bool(_EXPORTED.fullmatch(head))
    delimiter = "\t" if exported else max(",;\t", key=head.count)
    # Audacity's labels have no headings, and may hold quotation marks.
    rows = csv.DictReader(lines, delimiter=delimiter)
    if exported:
        rows = csv.DictReader(lines, _COLUMNS, delimiter=delimiter, quoting=csv.QUOTE_NONE)
    if missing := [name for name in _COLUMNS if name not in (rows.fieldnames or ())]:
        framed = "frame numbers: divide them by the take's frames per second"
        got = framed if set(rows.fieldnames or ()) >= _IN_FRAMES else f"none called {', '.join(missing)}"
        raise LabelError(f"{path}: expected the columns {', '.join(_COLUMNS)}, got {got}")
    for row in rows:
        start, end, label = row["start_s"] or "", row["end_s"] or "", row["label"]
        # Audacity writes a label's frequencies in a line of their own, and marks moments, too.
        if exported and (start.startswith("\\") or start == end):
            continue
        if label is None or label.strip():
            times = [start, end] if delimiter == "," else [time.replace(",", ".") for time in (start, end)]
            yield _segment(path, rows.line_num, times, label or "", row.get("performer") or "")


def _segment(path: Path, line: int, times: Sequence[str], label: str, performer: str) -> Segment:
    try:
        start, end = map(float, times)
    except ValueError as error:
        raise LabelError(f"{path}:{line}: start, end: expected seconds, got {times[0]!r}, {times[1]!r}") from error
    try:
        return Segment(start, end, label.strip(), performer.strip())
    except ValueError as error:
        raise LabelError(f"{path}:{line}: {error}") from error


def oddities(take: Clip, segments: Sequence[Segment]) -> list[str]:
    """List notes for a person on segments before a take is cut by them, a line each.

    Raises
    ------
    LabelError
        The segments are frame numbers: whole numbers up to the take's frames, and twice its seconds or more.
    """
    if not segments:
        return []
    last, lasts, seen = max(segment.end for segment in segments), take.duration, _first_seen(take)
    whole = all(time.is_integer() for segment in segments for time in (segment.start, segment.end))
    if whole and 2 * lasts < last <= take.frames + 1:
        raise LabelError(
            f"{take.name}: the labels end at {last:g}, the take at {lasts:.1f} s or frame {take.frames}: "
            "frame numbers? Expected seconds: divide by the take's frames per second"
        )
    slack = max(_SHORTEST, 1 / take.frame_rate)
    beyond = [segment for segment in segments if segment.end > lasts + slack or segment.start < seen - slack]
    lost = sum(_frames_of(take, segment) is None for segment in beyond)
    tiny = [segment for segment in segments if segment.duration < _SHORTEST]
    done = f"({seen:.1f} to {lasts:.1f} s): {len(beyond) - lost} shortened, {lost} left out"
    notes = {f"labels reach beyond the take {done}": beyond}
    notes |= {f"labels are shorter than {_SHORTEST} s, too short for any window": tiny}
    return [f"{take.name}: {len(those)} of {len(segments)} {what}" for what, those in notes.items() if those]


def renamed(segments: Iterable[Segment], names: Mapping[str, str]) -> tuple[Segment, ...]:
    """Rename the labels of segments by `names`."""
    return tuple(replace(segment, label=names.get(segment.label, segment.label)) for segment in segments)


def cut(take: Clip, segments: Sequence[Segment]) -> Iterator[Clip]:
    """Cut a take into one clip per segment; the label is its class, the take's name its take.

    Frames beyond the take's end, and before somebody was seen, are left out, and so is a segment with fewer than two
    frames.

    Raises
    ------
    LabelError
        A segment holds a later time in which nothing was seen.
    """
    for segment in segments:
        for begin, end in take.gaps:
            if 0 < begin < segment.end and segment.start < end:
                raise LabelError(
                    f"{take.name}: {segment.label!r} from {segment.start:g} to {segment.end:g} s: the performer was "
                    f"not seen from {begin:.2f} to {end:.2f} s"
                )
        if frames := _frames_of(take, segment):
            clip = take.moved_to(take.positions[frames])
            cut_out = replace(clip, rotations=take.rotations[frames], class_name=segment.label, take=take.name)
            yield replace(cut_out, gaps=())


def _frames_of(take: Clip, segment: Segment) -> slice | None:
    """Give a segment's frames in which somebody was seen; None for fewer than two."""
    first, last = (round(time * take.frame_rate) for time in (max(segment.start, _first_seen(take)), segment.end))
    return slice(first, last) if min(last, take.frames) - first >= 2 else None


def _first_seen(take: Clip) -> float:
    """Give the time at which somebody is seen first, seconds."""
    return next((end for begin, end in take.gaps if begin == 0), 0.0)
