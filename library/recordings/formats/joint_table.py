"""Tables of joint positions: CSV with three columns for each joint, and the `.npz` that `kinespace convert` writes.

A text has commas, semicolons, tabs, bars or blanks between, in UTF-8 or UTF-16; `table_header` finds its columns, also
in tables of Motive, Vicon, Qualisys and OpenSim, and in TRC. A table whose rows are joints is turned into one of
frames. Times count in any unit (`measures.timing`); without them frames follow each other evenly, 30 in a second unless
another rate is given. A column that numbers or names persons makes a clip for each. Other columns (visibilities,
rotations) are ignored. An empty field is a joint that was not seen. Where the header and the frames differ the frames
count: their number, their times.

The `.npz` holds `time` (frames,), seconds; `positions` (frames, joints, 3), metres; `joints`; `parents`, empty when
they are not known; and `performer`.
"""

from __future__ import annotations

import csv
import math
import re
from array import array
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from io import BytesIO
from itertools import chain, islice, pairwise
from pathlib import Path

import numpy as np
from numpy.lib.format import read_array
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import MAX_DISTANCE, Clip, as_numbers, is_near
from kinespace.library.naming import listed
from kinespace.library.recordings.formats.errors import RecordingError, number_of, refuse, spoilt
from kinespace.library.recordings.formats.joint_choice import few, restricted
from kinespace.library.recordings.formats.markers.marker_clip import clips_of_markers, is_seen
from kinespace.library.recordings.formats.measures import (
    SECONDS,
    WORDS,
    are_shuffled,
    clock_of,
    laid,
    metres_of,
    timing,
    words_of,
)
from kinespace.library.recordings.formats.table_header import (
    TableHeader,
    coordinate_of,
    header_of,
    is_numbers,
    is_value,
)
from kinespace.library.recordings.formats.texts import MAX_LINE, lines_of
from kinespace.library.skeleton import Skeleton

#: The marks between fields that are tried before blanks.
_MARKS = "\t;|,"
#: Lines of which one must have the mark between fields, and lines that may stand above a part's first frame.
_FRONT = 50
_MAX_HEAD = 2000
#: Values of a column that tells people apart, at most.
_MOST_PEOPLE = 64
#: A time of day, perhaps behind a date, with a half of the day or a zone behind; SMPTE's ends with a frame's number.
_CLOCK = re.compile(
    r"(?i)(?:.*[\sT,_])?(?:(\d+):)?(\d+):(\d+(?:[.,]\d+)?)(?:[:;](\d+)\S*)?(?: ?[AP]\.?M\.?)?(?:Z| ?UTC|[+-][\d:]+)?"
)
_DATE = re.compile(r"\d+([-./])\d+\1\d+")
#: A time with its unit.
_WITH_UNIT = re.compile(r"([-+\d.,]{1,40}) ?([^\W\d]{1,12})")
#: Frames that a second of such times counts, at most, unless the header says more.
_MOST_FRAMES = 250
#: SMPTE's frames per second, and where they do not show; and the number by which their numbers are divided at first.
_OF_SMPTE, _USUAL_SMPTE, _SMPTE = (24, 25, 30, 48, 50, 60, 100, 120), (30, 60, 120), 1000.0
#: Seconds after which a clock of twelve hours begins anew.
_HALF_DAY = 43_200
#: Times as large a change between two rows of one time as between two times that shows two bodies.
_OTHER = 3.0
#: Bytes of a field that is kept as text, and turned.
_CELL = 150
#: Bodies at one time, at most.
_MOST_AT_ONCE = 10
#: A field of several numbers (`[0.1 0.2 0.3]`, `<Vector (0.1, 0.2, 0.3)>`, `{'x': 0.1, ...`), or of names; a number
#: in it; and its characters, at most.
_BRACKETS = re.compile(r"[(\[{](?:[-+\d.,;:='\"\sxyzeEnaNA]{1,120}|\w+(?:[,;] ?\w+){2})[)\]}]")
_PART = re.compile(r"<?(?:[a-z][\w./]* ?[(\[{]+)?(?:['\"]?[xyz]['\"]? ?[=:] ?)?([^\s,;()\[\]{}<>]+)", re.IGNORECASE)
_MAX_POINT = 120
#: The endings of tables in text.
TEXTS = (".csv", ".tsv", ".txt", ".trc", ".sto", ".mot", ".emt")
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
    """Say what a text lacks to be a table of joints; empty where it is none of the usual mistakes."""
    try:
        _begun(path, memory.MAX_MEMORY)
        front = [*islice(lines_of(path, MAX_LINE, errors="replace"), _FRONT)]
    except csv.Error as error:
        return f"a table with {error}"
    except _DAMAGE as error:
        return str(error)
    cells = ([cell.strip() for cell in re.split('[,;|\t"]', line)] for line in front)
    axes = ({(coordinate_of(cell) or ("", cell.lower()))[1] for cell in each} & {*"xyz"} for each in cells)
    if is_numbers(re.split(r"[,;|\s]+", "".join(front[:1]).strip())):
        return "numbers without a row of names above them, like time, head_x, head_y, head_z"
    if {"x", "y"} in axes:
        return "columns x and y but no z: 2-D landmarks cannot be compared, their distances are no body's"
    return next(filter(None, map(spoilt, front)), "")


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
        Which joints, by name (`library.recordings.formats.joint_choice.chosen`); all when none are given.

    Raises
    ------
    RecordingError
        The file is no such table, or a line of it makes no sense.
    ValueError
        A joint that is asked for is missing.
    OSError
        The file cannot be opened.
    """
    if path.suffix.lower() == ".npz":
        return [restricted(_npz_clip(path, frame_rate), joints)]
    table = _read(path)
    head, places, (name, moments) = table.header, table.places(), table.clock()
    clips, people = list[Clip](), table.people(path, moments)
    several = people.items() if len(people) > 1 else ()
    if head.frames and head.frames != len(places) and not several:
        table.notes.append(f"frames: the header says {head.frames:g}, there are {len(places)}: these are taken")
    if head.unit and not metres_of(head.unit) and not metres_per_unit:
        if head.unit.lower() in WORDS["columns"]["no_lengths"]:
            raise RecordingError(f"{path}: expected positions, got numbers in {head.unit}; --unit names another")
        table.notes.append(f"units: {head.unit!r} is no unit: the body's size tells it; --unit names it")
    brief = [person for person, rows in several if len(rows) < 2 < len(places) or not is_seen(places[rows])]
    if 0 < len(brief) < len(people):
        # A tracker's slip is no reason to refuse the others.
        table.notes.append(f"left out: seen in one frame, or in none: {', '.join(brief[:5])}")
        people = {person: rows for person, rows in people.items() if person not in brief}
    for person, rows in people.items():
        notes, timed = list(table.notes), rows if moments is None else rows[np.isfinite(moments[rows])]
        if len(timed) < len(rows):
            notes.append(f"times: {len(rows) - len(timed)} frames without one are left out")
        if moments is not None and are_shuffled(moments[timed]):
            notes.append(f"times: rows stand in another order than {name.strip()!r}: sorted")
            timed = timed[np.argsort(moments[timed], kind="stable")]
        if len(timed) < 2:
            raise RecordingError(f"{path}: expected at least 2 frames, got {len(timed)}")
        times, rate = timing(None if moments is None else moments[timed], name, head.rate, frame_rate, notes)
        own, metres = places[timed], metres_per_unit or metres_of(head.unit)
        found = clips_of_markers(path, [*head.joints], own, rate, joints, times=times, metres=metres, notes=notes)
        clips += [replace(clip, actor=person or clip.actor) for clip in found]
    return clips


def _npz_clip(path: Path, frame_rate: float | None) -> Clip:
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
    if not is_near(positions):
        raise RecordingError(f"{path}: positions: expected metres below {MAX_DISTANCE:g}, got NaN or more")
    return replace(laid(times, positions, frame_rate).clip(skeleton), name=path.stem, actor=str(performer))


@dataclass(slots=True)
class _Table:
    """A part of a file: its header, numbers row by row, and for each row its times and what may tell people apart.

    Attributes
    ----------
    first, begin
        The first frame and its line.
    points
        The columns whose fields hold three numbers each.
    values, clocks
        The joints' numbers, and by column the times.
    cells
        By column the numbers of its texts, and those numbers row by row; a column of many texts is dropped.
    rows
        The rows with their lines where each is a joint or a coordinate.
    short, extra
        Rows that are shorter than the header, and numbers behind all names in a row, at most.
    """

    header: TableHeader
    first: Sequence[str]
    begin: int
    points: Collection[int] = ()
    values: array[float] = field(default_factory=lambda: array("d"))
    clocks: dict[int, array[float]] = field(default_factory=dict)
    cells: dict[int, tuple[dict[str, int], array[int]]] = field(default_factory=dict)
    rows: list[tuple[int, list[str]]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    short: int = 0
    extra: int = 0
    columns: list[int] = field(init=False)
    needed: int = field(init=False)

    def __post_init__(self) -> None:
        head = self.header
        # Where nobody is seen a row may be shorter than its header.
        self.first = [*self.first, *[""] * (len(head.names) - len(self.first))] if self.first else self.first
        self.columns = [column for axes in head.joints.values() for column in axes]
        # A column may be called like times, and hold other texts.
        clocks = [column for column in head.clocks if not self.first or _moment(self.first[column]) is not None]
        self.clocks = {column: array("d") for column in clocks}
        free = [each for each in head.free if self.first and "." not in self.first[each]]
        self.cells = {column: ({}, array("q")) for column in (*head.people, *free)}
        self.needed = max([*self.columns, *head.clocks, *head.people]) + 1 if self.is_wide else len(self.first)

    def take(self, path: Path, line: int, row: list[str]) -> None:
        """Take in a row; refuse one of another width than the header's."""
        missing, width = self.needed - len(row), len(self.header.names)
        # Decimal commas that cut numbers make fields without a point.
        beyond = sum(bool(each) and "." not in each for each in row[width:]) if len(row) > width else 0
        # Where nobody was seen a row may end behind its time.
        # A number more than the first frame has moves all behind it; a remark may stand there.
        more = any(map(_is_finite, row[max(width, len(self.first)) :]))
        if missing > len(row) > min(self.columns, default=0) or more or 5 * beyond > self.needed + 5:
            want, why = (width, ": commas in numbers, too?" * (not more)) if beyond else (self.needed, "")
            refuse(path, line, f"expected {want} fields, got {len(row)}{why}")
        self.short, row = self.short + (missing > 0), row + [""] * missing
        if not self.is_wide:
            self.rows.append((line, row))
            memory.require(len(self.rows) * len(row) * _CELL, "memory")
            return
        fields = [row[column] or "nan" for column in self.columns]
        self.values.extend(_numbers(path, line, fields))
        for column, moments in self.clocks.items():
            moments.append(_known(path, line, row[column], _moment))
        for column, (texts, numbers) in [*self.cells.items()]:
            numbers.append(texts.setdefault(row[column].strip() if column < len(row) else "", len(texts)))
            if len(texts) > _MOST_PEOPLE:
                del self.cells[column]

    def even(self, cells: list[str]) -> list[str]:
        """Give a row of tabs without the markers behind all names, that come later, and with tabs that were cut off."""
        width = len(self.header.names) - (not self.header.names[-1])
        extra = sum(map(_is_finite, cells[width:]))
        if extra % 3:
            return cells
        self.extra = max(self.extra, extra)
        return [*cells[:width], *[""] * (self.needed - len(cells))]

    @property
    def is_wide(self) -> bool:
        """Whether a row is a frame."""
        return len(self.header.joints) > 1

    def places(self) -> NDArray[np.float64]:
        """Give the positions, (rows, joints, 3)."""
        memory.require_numbers(len(self.values))
        return np.frombuffer(self.values).reshape(-1, len(self.header.joints), 3)

    def clock(self) -> tuple[str, NDArray[np.float64] | None]:
        """Give the name and the numbers of the times that count; of times of the day seconds."""
        found = dict[str, NDArray[np.float64]]()
        for column, numbers in self.clocks.items():
            moments, name = np.frombuffer(numbers), self.header.names[column]
            if clock := _CLOCK.fullmatch(self.first[column].strip()) if self.first else None:
                name = f"s of {name}"
                if clock[4]:
                    moments = self._of_smpte(moments)
                # The day, or its half, begins anew.
                days = np.round(np.minimum(np.diff(moments), 0) / -_HALF_DAY)
                moments += np.cumsum(np.append(0, days * _HALF_DAY))
            if np.isfinite(moments).any():
                found[name] = moments
        return clock_of(found)

    def _of_smpte(self, moments: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give the seconds of times whose fractions hold the number of a frame."""
        frames = np.round(moments % 1 * _SMPTE)
        rate, most = self.header.rate, float(np.nanmax(frames)) + 1
        if most > max(rate or 0, _MOST_FRAMES):
            # Milliseconds stand behind a colon, too.
            return moments
        if not rate:
            shows = bool((np.diff(frames) < 0).any())
            rate = next((each for each in (_OF_SMPTE if shows else _USUAL_SMPTE) if each >= most), most)
            if not shows:
                self.notes.append(f"times: SMPTE's within one second: {rate:g} frames a second")
        return np.floor(moments) + frames / rate

    def people(self, path: Path, moments: NDArray[np.float64] | None) -> dict[str, NDArray[np.intp]]:
        """Give the rows of each person; RecordingError where bodies stand at one time, and no column tells whose."""
        size = len(self.places())
        several = ((column, each) for column, (texts, each) in self.cells.items() if 1 < len(texts) <= size / 2)
        told = {column: np.frombuffer(numbers, np.int64) for column, numbers in several}
        ours = [each for each in self.header.people if each in told][:2]
        times = np.arange(float(size)) if moments is None else moments

        def tell(*columns: int) -> bool:
            """Say whether rows of one time differ in some columns."""
            return bool(np.unique(np.stack([times, *(told[each] for each in columns)]), axis=1).shape[1] == size)

        # Several cameras may see each of the people.
        columns = ours if ours[1:] and not tell(ours[0]) and tell(*ours) else ours[:1]
        if not columns and not (np.diff(times) > 0).all():
            columns = [each for each in told if tell(each)][:1]
            if not columns and self._has_two_bodies(times):
                refuse(path, self.begin + 1, "two bodies at one time: expected a column of persons, like person_id")
        if not columns:
            return {"": np.arange(size)}
        found, whose = np.unique(np.stack([told[each] for each in columns]), axis=1, return_inverse=True)
        texts = [[*self.cells[each][0]] for each in columns]
        names = ("_".join(each[n] for each, n in zip(texts, some, strict=True)) for some in found.T.tolist())
        return {name: np.flatnonzero(whose.ravel() == number) for number, name in enumerate(names)}

    def _has_two_bodies(self, moments: NDArray[np.float64]) -> bool:
        """Say whether rows of one time differ more than rows of times that follow each other."""
        places, same = self.places(), np.diff(moments) == 0
        bodies = round(len(same) / max(1, (~same).sum()))
        if not 1 < bodies < min(_MOST_AT_ONCE, len(same) / 4):
            return False
        pairs = np.diff(places, axis=0)[same], places[bodies:] - places[:-bodies]
        apart, moved = (np.linalg.norm(each[np.isfinite(each).all(axis=2)], axis=1) for each in pairs)
        return bool(len(apart) and len(moved) and np.median(apart) > _OTHER * np.median(moved))


def _rows(path: Path, mark: str, most: int | None) -> Iterator[list[str] | None]:
    """Give the rows of a table of at most so many characters; behind a last one that may be cut off, None."""
    line = ""

    def whole() -> Iterator[str]:
        nonlocal line
        for line in lines_of(path, most, errors="replace"):
            # A row of any length, otherwise.
            if line.count('"') % 2:
                raise csv.Error("a quotation mark that does not end on its line")
            # What stands in brackets is one field, without quotation marks, too.
            has_brackets = "(" in line or "[" in line or "{" in line
            one = _BRACKETS.sub(lambda several: several[0].replace(mark, " "), line) if has_brackets else line
            yield one.replace(";(", f"{mark}(")

    if mark == " ":
        yield from (each.replace('"', "").lstrip("#% ").removeprefix("//").split() for each in whole())
    else:
        yield from csv.reader(whole(), delimiter=mark, skipinitialspace=True)
    # Tabs at a line's end are often cut off: there a short line that ends is whole.
    yield [] if mark == "\t" and line.endswith(("\n", "\r")) else None


def _begun(path: Path, most: int | None = None) -> str | None:
    """Give the mark by which a text is a table of the most joints, a blank at last; None where it is none."""
    front = "".join(islice(lines_of(path, most, errors="replace"), _FRONT))
    there = (mark for mark in _MARKS if mark in front)
    found = ((table.header.rank, mark) for mark in there for table in islice(_tables(path, mark, most), 1))
    if best := max(found, default=None):
        return best[1]
    # Blanks stand within names, too.
    return " " if next(_tables(path, " ", most), None) else None


def _tables(path: Path, mark: str, most: int | None = None) -> Iterator[_Table]:
    """Give each part of a text that is a table of joints when its first frame comes; it gets its rows later."""
    head, named, table, blank, goes, line = list[list[str]](), list[str](), None, False, False, 0
    gone = list[list[str]]()
    for line, (row, after) in enumerate(pairwise(_rows(path, mark, most)), start=1):
        if not row or not any(row) or (table and (row[0].startswith("#") or row == named)):
            blank |= not row or not any(row)
            # Where no time is said a row of nothing is a frame in which nobody is seen, unless it is among the last.
            is_frame = row and table and not table.clocks and len(row) >= table.needed and not any(row)
            gone += [row] if row and is_frame else []
            continue
        if table and blank and not is_numbers(row, named=not is_numbers(table.first)):
            table.notes.append(f"parts: what stands from line {line} on is left out")
            table = None
        blank &= table is None
        if table is None:
            if table := _part(head, row, line):
                yield table
                head, named, blank = [], head[-1], False
            else:
                # Numbers may stand below their names, as in TRC; where they go on, they are another part's.
                before, goes = goes, is_numbers(row)
                head = [] if before and goes else [*head, row]
                if len(head) > _MAX_HEAD:
                    return
                continue
        for nobody in gone:
            table.take(path, line, nobody)
        gone, cells = [], _spread(row, table.points) if table.points else row
        if len(cells) < table.needed and line > table.begin and after is None:
            table.notes.append(f"frames: the last line, {line}, is cut off and left out")
        else:
            table.take(path, line, table.even(cells) if mark == "\t" else cells)
    if table is None and (header := header_of(head)) and len(header.joints) > 1:
        yield _Table(header, [], line)


def _part(head: list[list[str]], row: list[str], line: int) -> _Table | None:
    """Begin a table with its first frame; None where that is no frame, or the rows above name no two joints."""
    if not head:
        return None
    parts = [_PART.findall(cell) if len(cell) < _MAX_POINT else [] for cell in row]
    points = [place for place, each in enumerate(parts) if len(each) == 3 and None not in map(number_of, each)]
    # Of a table with one joint in a row there is one such field.
    ways = [points] if len(points) != 1 else [[], points]
    return next(filter(None, (_with_points(head, row, line, each) for each in ways)), None)


def _with_points(head: list[list[str]], row: list[str], line: int, points: Collection[int]) -> _Table | None:
    """Begin a table whose frames hold three numbers in some fields; None as in `_part`."""
    first = _spread(row, points)
    # Where nobody is seen at first, frames have a time alone.
    is_time = 0 < sum(map(_is_finite, first)) < 3 and None not in map(number_of, first)
    if not is_time and not is_numbers(first, named=True):
        return None
    header = header_of([*head[:-1], _spread(head[-1], points, "xyz")], first)
    if header is None or (len(header.joints) < 2 and not _labels_in(header, first)):
        return None
    if 0 in header.free and not header.names[0] and (":" in first[0] or number_of(first[0] or "-") is not None):
        # An index without a name.
        header = replace(header, clocks=[*header.clocks, 0], free=[each for each in header.free if each])
    return _Table(header, first, line, points)


def _labels_in(head: TableHeader, first: Sequence[str]) -> list[int]:
    """Find the columns that may name the joint, or the coordinate, that stands in a row; the likeliest one first."""
    there = dict.fromkeys((*head.labels, *head.free, *head.people))
    free = [each for each in there if each < len(first) and "." not in first[each]]
    texts = [each for each in free if each not in head.people and number_of(first[each]) is None]
    # An axis stands behind its joint.
    texts.sort(key=lambda column: first[column].strip().lower() in {*"xyz"})
    if not head.joints:
        return texts if coordinate_of(_label(first, texts)) else []
    labels = [*(each for each in head.labels if each in texts), *head.labels, *texts, *head.people]
    return [*labels, *free] if labels else []


def _labelled(head: TableHeader, first: Sequence[str], rows: list[list[str]]) -> tuple[list[int], list[int], list[str]]:
    """Give the columns of times, the one that tells people apart, and the name of what stands in each row."""
    counts = [len({row[column] for row in rows}) for column in range(len(first))]
    # What differs from row to row numbers the rows.
    told = [column for column, count in enumerate(counts) if 2 * count <= len(rows)]
    clocks, those = [each for each in head.clocks if each in told], _labels_in(head, first)
    # Of columns of names, the joints' has most: others name a person or a class.
    of_names = [each for each in those if each in head.labels and number_of(first[each]) is None]
    of_names.sort(key=lambda each: -counts[each])
    those = [*of_names, *(each for each in those if each not in of_names)]
    labels = [[each] for each in those if each in told and counts[each] > 1] if head.joints else [those]

    def fits(*columns: int) -> bool:
        return len({_label(row, [*clocks, *columns]) for row in rows}) == len(rows)

    people = [each for each in head.people if each in told and counts[each] > 1]
    others = [each for each in dict.fromkeys((*those, *people, *head.free)) if each in told]
    alone = ((label, -1) for label in labels if fits(*label))
    pairs = ((label, each) for label in labels for each in others if each not in label and fits(*label, each, *people))
    label, other = next(chain(alone, pairs), ((labels or [those[:1]])[0], -1))
    names, people = [_label(row, label) for row in rows], [each for each in people if each not in label][:1]
    if other < 0 or other in people:
        return clocks, people, names
    parts = {(name, row[other]) for name, row in zip(names, rows, strict=True)}
    times = Counter(name for name, _ in parts)
    shared = {part for name, part in parts if times[name] > 1}
    # Each of the people has all joints; sides are no people.
    if len(parts) == len(times) * len(shared) and not {each.lower() for each in shared} <= {"left", "right", "l", "r"}:
        return clocks, [other], names
    # A hand's numbers are not a body's.
    names = [f"{row[other]}_{n}" if row[other] in shared else n for n, row in zip(names, rows, strict=True)]
    return clocks, people, names


def _label(row: Sequence[str], columns: Sequence[int]) -> str:
    return "_".join(row[each].strip() for each in columns)


def _spread(row: Sequence[str], points: Collection[int], axes: str = "") -> list[str]:
    """Make three fields of each that holds three numbers, or of each that names such a column."""
    spread = list[str]()
    for place, cell in enumerate(row):
        if place not in points:
            spread.append(cell)
        elif axes:
            spread += _three_names(cell, axes)
        else:
            spread += [*_PART.findall(cell), "", "", ""][:3]
    return spread


def _three_names(cell: str, axes: str) -> list[str]:
    """Name a column for each axis: a joint's, or the three that stand there: `head_x,head_y,head_z`."""
    parts = re.split("[,;|]", cell) if re.search("[,;|]", cell) else cell.strip("()[]{}").split()
    named = [coordinate_of(part.strip()) or ("", "") for part in parts]
    if len({joint for joint, _ in named}) == 1 and sorted(axis for _, axis in named) == sorted(axes):
        return [f"{joint}_{axis}" for joint, axis in named]
    return [f"{cell}_{axis}" for axis in axes]


def _read(path: Path) -> _Table:
    """Read the part of a text that has the most joints."""
    try:
        mark = _begun(path)
        if mark is None:
            refuse(path, 1, "expected columns like head_x, head_y, head_z for two joints or more")
        table = max(_tables(path, mark), key=lambda each: each.header.rank)
    except csv.Error as error:
        raise RecordingError(f"{path}: expected a CSV ({error})") from error
    if beyond := max(table.extra, sum(map(_is_finite, table.first[len(table.header.names) :]))):
        table.notes.append(f"columns: {beyond} behind all names: left out")
    if not table.is_wide:
        table = _turned(path, table)
    if others := table.header.others:
        table.notes.append(f"no positions: {listed(others, 5)}: left out")
    if all("local" in words_of(joint) for joint in table.header.joints):
        table.notes.append("positions: called local: of places that count from each joint's parent no body is made")
    if table.short:
        few = f"frames: {table.short} have fewer than {table.needed} fields: the joints in the others are not seen"
        table.notes.append(few)
    return table


def _turned(path: Path, table: _Table) -> _Table:
    """Make a table whose rows are frames of one whose rows are joints or coordinates."""
    head = table.header
    values = [*head.joints.get("", ())] or [
        each for each in head.free if is_value(head.names[each]) and number_of(table.first[each]) is not None
    ]
    clocks, people, labels = _labelled(head, table.first, [row for _, row in table.rows])
    frames, seen = dict[tuple[int, str], tuple[int, list[str], dict[str, list[str]]]](), Counter[tuple[str, str]]()
    for (line, row), label in zip(table.rows, labels, strict=True):
        key = _label(row, [*clocks, *people])
        *_, places = frames.setdefault((seen[key, label], key), (line, [row[each] for each in (*clocks, *people)], {}))
        places[label] = [row[each] for each in values]
        seen[key, label] += 1
    names = few([*dict.fromkeys(labels)])
    lead = [*(head.names[each] for each in clocks), *["person"] * len(people)]
    ends = ["_x", "_y", "_z"] if head.joints else [""]
    header = header_of([[*lead, *(name + end for name in names for end in ends)]])
    if header is None:
        refuse(path, table.begin, f"expected rows of two joints or more, got {', '.join(names[:3])}")
    header = replace(header, rate=head.rate, unit=head.unit)
    # Rows joint by joint, too: frames go by their time, and times that come again follow each other.
    order = {key: [key[0], *(number_of(c) or 0.0 for c in each[1][: len(clocks)])] for key, each in frames.items()}
    turned = [frames[key] for key in sorted(frames, key=lambda key: order[key])]
    nothing, found = [""] * len(values), _Table(header, turned[0][1], table.begin, notes=table.notes)
    for line, cells, places in turned:
        found.take(path, line, [*cells, *chain.from_iterable(places.get(name, nothing) for name in names)])
    return found


def _is_finite(text: str) -> bool:
    number = number_of(text)
    return number is not None and math.isfinite(number)


def _numbers(path: Path, line: int, fields: list[str]) -> list[float]:
    """Read a row's coordinates: most rows hold plain numbers, which Python reads at once."""
    # It reads `1_2` as twelve.
    if "_" not in "".join(fields):
        with suppress(ValueError):
            return [*map(float, fields)]
    return [_known(path, line, each, number_of) for each in fields]


def _known(path: Path, line: int, text: str, reader: Callable[[str], float | None]) -> float:
    """Read a field; refuse the line where its text is no such number."""
    number = reader(text)
    if number is None:
        refuse(path, line, f"expected a number, got {text[:40]!r}")
    return number


def _moment(text: str) -> float | None:
    """Read a time: a number, or hours, minutes, seconds and the number of a frame; None for other texts."""
    if clock := _CLOCK.fullmatch(text.strip()) if ":" in text else None:
        hours, minutes, seconds, frame = (float((each or "0").replace(",", ".")) for each in clock.groups())
        return 3600 * hours + 60 * minutes + seconds + frame / _SMPTE
    found = _WITH_UNIT.fullmatch(text.strip())
    unit = SECONDS.get(found[2].lower()) if found else None
    # A date alone, and the times of several cameras (`{'a': 0.1, 'b': 0.2}`), are no moments: NaN.
    if _DATE.fullmatch(text.strip()) or text.startswith(("{", "[")):
        return math.nan
    number = number_of(found[1] if found and unit else text)
    return number if number is None else number * (unit or 1.0)
