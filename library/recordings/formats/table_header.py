"""The header of a table of joints: which columns hold joints' positions, times, and what may tell people apart.

One row names a column for each coordinate (`head_x`, `head.X`, `head:tx`, `Head Position X (mm)`, `x_head`); or one row
names the joints and a later one their axes, as in the tables of Motive, Vicon and pandas, and in TRC; or each row is a
joint, or a coordinate, and a column names it. Rows above say how often frames come, and the unit of length.
"""

import math
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, pairwise

from kinespace.library.recordings.formats.errors import number_of
from kinespace.library.recordings.formats.joint_choice import MAX_NAME, plain
from kinespace.library.recordings.formats.measures import METRES, WORDS, metres_of, words_of

#: What stands behind an axis: a word for a place, a unit or another word, or a number without a mark.
_BEHIND = r"(?i:pos(?:ition)?|coord(?:inate)?)?(?:(?:[\W_]+|(?=\d))(?P<unit>[µa-zA-Z\d]{1,30}))?[\W_]*"
#: How columns are named after a joint and an axis: of these ways the one that names most joints counts.
_WAYS = (
    re.compile(rf"(?i)(?P<joint>.*[(\[]\w+[)\]]|.*[^\W_])[\W_]+[tp]?(?P<axis>[wxyz]){_BEHIND}"),
    re.compile(rf"(?P<joint>.+[a-z]|.*(?:[0-9\])]|[A-Z]{{2}}))[TP]?(?P<axis>[WXYZ]){_BEHIND}"),
    re.compile(
        r"(?i)(?:pos|position|[tp])?[\W_]*(?P<axis>[wxyz])[\W_]*"
        r"(?:(?:coord(?:inate)?[\W_]+)?of[\W_]+)?(?P<joint>((?<=[\W_])|(?-i:(?=[A-Z][a-z]))).*?[^\W_]|\d+)"
        r"(?:[\W_]*[(\[](?P<unit>[µa-zA-Z]{1,11})[)\]])?[\W_]*"
    ),
    re.compile(r"(?P<joint>.*[^\W_])[\W_]+(?P<axis>\d+)[\W_]*"),
    re.compile(r"(?P<joint>.*(?:\d|[^\W_]{2}))(?P<axis>[xyz])"),
    re.compile(r"(?P<axis>[xyz])(?P<joint>[^\W\d_]\w*)"),
)
#: The axes of a place; a fourth number is a part of a turn, or a weight.
_AXES = re.compile("w?xyz|0123?4?|1234?")
#: Words for places that are no joint's in a picture, or to its parent.
_WORLD = frozenset({"world", "global"})
#: An axis alone, in a table whose rows are joints.
_AXIS = re.compile(
    r"(?i)(?:(?:pos(?:ition)?|translation|loc(?:ation)?|coord|world|global|3d|[pt])[\W_]*){0,2}([xyz])(?:3d)?(?:[\W_]+(\w{1,11}))?[\W_]*"
)
#: Words of columns (`words.toml`).
_TIMES, _SECONDS, _PARTS, _FRAMES, _LABELS, _VALUES, _FRONTS, _NO_PLACES, _NO_LENGTHS = (
    frozenset(WORDS["columns"][kind])
    for kind in ("times", "alone", "parts", "frames", "labels", "values", "fronts", "no_places", "no_lengths")
)
#: Shorter ones may be names of markers, which stand over their axes.
_NO_MARKERS = frozenset(word for word in _NO_PLACES if len(word) > 4)
_PERSON = re.compile(rf"({'|'.join(WORDS['columns']['people'])})( ?(id|ids|idx|index|nr|no|number|name))?|p?id")
#: Joints that a row must name without axes, at least one more.
_FEW = 2
#: Rows above the first frame that may name joints.
_DEEP = 12
#: What pandas writes behind a name that stands there again, or in place of none.
_AGAIN = re.compile(r"\.\d+\Z|\AUnnamed: \d+.*")
_NUMBERED = re.compile(r"(?<=\A[XYZxyz])\d+\Z")
_ROOT = re.compile(r"\A(.+):\1\Z")
#: How the rows above say the rate (a camera's where no other is said), the unit of length, and the number of frames.
_FREQUENCY = (
    r"(?:(?:export|recording|video|stream|nominal|acquisition|data|frame|point|marker|sampl\w+)[ _]?){0,3}"
    r"(?:rate|freq(?:uency)?|fps|fs|hz|frames? per sec\w*)\b.*"
)
_SAID = {
    "rate": re.compile(_FREQUENCY, re.IGNORECASE),
    "capture": re.compile(rf"(?:capture|camera)[ _]?{_FREQUENCY}", re.IGNORECASE),
    "unit": re.compile(r"(?:length |pos\w*? ?)?units?\W*", re.IGNORECASE),
    "frames": re.compile(r"(?:num(?:ber)?|no)_?(?:of_)?frames?|nrows", re.IGNORECASE),
}
_BETWEEN = re.compile(r"\s*[:=]\s*|\s+(?=[\d.]+\s*(?:hz)?\Z)", re.IGNORECASE)
_ALONE = re.compile(r"\W*(\d+\.?\d*)\W*(?:hz|fps)?\W*", re.IGNORECASE)
_LEADING, _WORD = re.compile(r"\s*(\d+\.?\d*)"), re.compile(r"\W*([^\W\d]+|\?)")
#: The columns of x, y and z, by joint; and the columns of each axis.
_Columns = Mapping[str, tuple[int, int, int]]
_Places = dict[str, list[int]]


@dataclass(frozen=True, slots=True)
class TableHeader:
    """The columns of a table.

    Attributes
    ----------
    names
        The name of every column.
    joints
        The columns of x, y and z, for each joint. Where each row is a joint they are those of one without a name, and
        where each row is a coordinate there are none.
    clocks
        The columns of times, then of frame numbers.
    people, free, labels
        Columns named like those that tell people apart, all others of no known meaning, and columns named like those of
        joints' names.
    rate, unit, frames
        Frames per second, the unit of length, and the number of frames, where the header says them.
    others
        Names of columns that come by three but hold no positions.
    rank
        Whether these are a file's trajectories, and how many joints: of a file's parts the highest counts.
    """

    names: Sequence[str]
    joints: _Columns
    clocks: Sequence[int]
    people: Sequence[int]
    free: Sequence[int]
    labels: Sequence[int]
    rate: float
    unit: str
    frames: float
    others: Sequence[str]
    rank: tuple[bool, int]


@lru_cache(maxsize=4096)
def coordinate_of(name: str) -> tuple[str, str] | None:
    """Give the joint and the axis in the name of one coordinate, like `/p1/wrist_l:tx`; None for another name."""
    named = next((found for way in _WAYS[:2] if (found := way.fullmatch(name)) and not found["unit"]), None)
    return (plain(named["joint"]), axis) if named and (axis := named["axis"].lower()) != "w" else None


def is_numbers(row: Sequence[str], *, named: bool = False) -> bool:
    """Say whether a row holds a frame: most of it are numbers, the first one too unless a name may stand there."""
    filled = [field for field in row if field.strip()]
    numbers = sum(number_of(field) is not None for field in filled)
    # Motive numbers its markers, over each of their columns, and bodies may be called by numbers, behind an empty cell.
    begins = len(filled) > 2 and (bool(named and row[0]) or filled[0].strip()[0] in "0123456789+-.,'\"")
    counts = filled[:1] == ["ID"] or (filled[::3] == filled[1::3] == filled[2::3] and len({*filled}) > 1)
    return begins and not counts and numbers > 0.7 * len(filled) - 1.2


def is_value(name: str) -> bool:
    """Say whether a column is named like those of a table with a coordinate in each row."""
    return name.strip().lower() in _VALUES


def header_of(rows: Sequence[Sequence[str]], first: Sequence[str] = ()) -> TableHeader | None:
    """Read the rows above a table's first frame; None where they name no two joints."""
    # Qualisys names no unit: its numbers are millimetres, those of hands or feet alone, too.
    if any(row[:1] == ["MARKER_NAMES"] for row in rows) and any(re.match(r"-?\d{3}", cell) for cell in first[2:]):
        rows = [["Units", "mm"], *rows]
    names = [row for row in rows if not is_numbers(row)]
    for place in range(len(names) - 1, max(len(names) - _DEEP, 0) - 1, -1):
        row, others = names[place], [each for each in rows if each is not names[place]]
        if len(row) == len(first) + 1 and row[0].strip() in ("#", "%", "//"):
            row = row[1:]
        # R names no column for the numbers, or the names, of its rows; a time in front is none.
        is_of_r = len(row) == len(first) - 1 and first[-1] and "." not in first[0]
        row = _continued(["", *row] if is_of_r else row)
        for each, no_places in ((_over_axes(names, place, first), _NO_MARKERS), (row, _NO_PLACES)):
            if len((one := _of_one(each, first, no_places))[0]) > 1:
                return _header(others, each, *one)
        if found := _of_long(row, first):
            return _header(others, row, *found)
    row = _thrice(names[-1], len(first)) if names else []
    one = _of_one(row, first)
    return _header(rows, row, *one) if len(one[0]) > _FEW else None


def _continued(row: Sequence[str]) -> list[str]:
    """Give bare axes the name that stands in front of the first one: `head X`, `Y`, `Z`."""
    names = [*row]
    for place, name in enumerate(row):
        before = coordinate_of(names[place - 1].strip()) if place and name.strip() in {*"yzYZ"} else None
        if before and ord(before[1]) + 1 == ord(name.strip().lower()):
            names[place] = f"{names[place - 1].rstrip()[:-1]}{name.strip()}"
    return names


def _thrice(row: Sequence[str], size: int) -> list[str]:
    """Give numbers to the three columns of a name that stands there thrice, once, or as pandas has it (`head.1`)."""
    row = [*row, *[""] * (size - len(row))]
    names = _filled([_AGAIN.sub("", name.strip()) for name in row], size or len(row))
    counts, begin = Counter(names), {name: place for place, name in reversed([*enumerate(names)])}
    return [
        f"{name}_{place - begin[name] + 1}"
        # Elsewhere a name is another curve's: angles and sensors beside each other.
        if len(name) > 1 and counts[name] == 3 and names[begin[name] + 2] == name
        else row[place]
        for place, name in enumerate(names)
    ]


def _of_one(
    row: Sequence[str], first: Sequence[str], no_places: frozenset[str] = _NO_PLACES
) -> tuple[_Columns, list[str], set[str]]:
    """Find the joints that one row names with their axes, other things of three columns, and the units behind them."""
    best: tuple[_Columns, list[str], set[str]] = ({}, [], set())
    for way in _WAYS:
        found, units, measures = dict[str, _Places](), set[str](), set[str]()
        for place, name in enumerate(row):
            if len(name) <= MAX_NAME and (named := way.fullmatch(name.strip().lstrip("#%(' =\"").replace("°", "deg"))):
                unit = named.groupdict().get("unit") or ""
                # Another word behind the axis belongs to the name: `head_x_world`.
                is_name = unit.isdigit() or metres_of(unit or "m") is None
                joint = f"{named['joint']}_{unit}" if is_name else named["joint"]
                found.setdefault(joint, {}).setdefault(named["axis"].lower(), []).append(place)
                units.add("" if is_name else unit)
                measures |= {joint} if unit.lower() in _NO_LENGTHS else set()
        whole = {name: each for name, each in found.items() if len(each) > 2 and _AXES.fullmatch("".join(sorted(each)))}
        turns = _turns([[each[0] for each in axes.values()] for axes in whole.values() if len(axes) == 4], first)
        ahead = {(*words[:-1],) for joint in whole if (words := words_of(joint))[-1:] == ["forward"]}
        others = [
            joint
            for joint, axes in whole.items()
            if joint in measures or _is_no_place(joint, ahead, no_places) or (turns and len(axes) == 4)
        ]
        places = [joint for joint in whole if joint not in others]
        # Of places in the world and in a picture those in the world count.
        if len(places) <= 2 * len(world := [joint for joint in places if _WORLD & {*words_of(joint)}]):
            places, others = world, others + [joint for joint in places if joint not in world]
        if len(places) > len(best[0]):
            best = _apart({joint: whole[joint] for joint in places}), others, units - {""}
    return best


def _is_no_place(name: str, ahead: Collection[tuple[str, ...]], no_places: frozenset[str]) -> bool:
    """Say whether a name's words, or the end of one in capitals (`LKNEEANGLES`), are of something else than a place.

    What has a vector `ahead` (Unity's `head_forward`) may have others up and to the right; `hand_right` is a joint.
    """
    *front, last = words_of(name) or [""]
    if last in ("forward", "up", "right") and (*front,) in ahead:
        return True
    # A navel ends like a velocity.
    ends = tuple(word for word in no_places if len(word) > 2) if name.isupper() and last != "navel" else ()
    # ROS puts `field.` in front of all its names.
    is_field = name.lower() == "field"
    return is_field or bool(no_places & {*words_of(name)}) or name.lower().removesuffix("s").endswith(ends)


def _apart(found: Mapping[str, _Places]) -> _Columns:
    """Give x, y and z of each joint; a joint that stands there again may be another person's (`1:head`)."""
    each = {joint: [axes[axis] for axis in sorted({*axes} - {"w"})[:3]] for joint, axes in found.items()}
    threes = ((joint, *place) for joint, axes in each.items() for place in enumerate(zip(*axes, strict=False)))
    # One name for all is no joint's.
    return {f"{n}:{joint}" if n else joint: (x, y, z) for joint, n, (x, y, z) in threes if not n or len(found) > 1}


def _turns(fours: Sequence[Sequence[int]], first: Sequence[str]) -> bool:
    """Say whether the first frame has lengths of 1, or none, in all columns that come by four: quaternions have."""
    numbers = ([number_of(first[column]) or 0.0 for column in four] for four in fours if max(four) < len(first))
    seen = (length for four in numbers if math.isfinite(length := math.hypot(*four)) and length)
    return all(math.isclose(length, 1, rel_tol=0.01) for length in seen)


def _of_long(row: Sequence[str], first: Sequence[str]) -> tuple[_Columns, list[str], set[str]] | None:
    """Find the axes, or the values, in the header of a table whose cells name joints, or coordinates."""
    found = dict[str, tuple[_Places, set[str]]]()
    for place, name in enumerate(row):
        if (axis := _AXIS.fullmatch(name.strip())) and (axis[2] or "").lower() not in _NO_LENGTHS:
            # Axes that belong together differ in their letter alone.
            front, end = axis.span(1)
            places, units = found.setdefault(f"{axis.string[:front]}*{axis.string[end:]}".lower(), ({}, set()))
            places.setdefault(axis[1].lower(), []).append(place)
            units |= {axis[2].lower()} if axis[2] else set()
    whole = {name: each for name, each in found.items() if len(each[0]) == 3}
    name = next((each for each in whole if _WORLD & {*words_of(each)}), next(iter(whole), ""))
    places, units = whole.get(name, ({}, set()))
    axes = {place for each in places.values() for place in each}
    threes = [*zip(*(places.get(axis, []) for axis in "xyz"), strict=False)]
    # Where joints stand beside each other a cell in front of each names it, in this row or in the next.
    named = {row[three[0] - 1].strip(): three for three in threes if three[0] and three[0] - 1 not in axes}
    if len(named) == len(threes) > 1 and all(named) and len(first) >= len(row) - 1:
        return named, [], units
    labels = [place for place, name in enumerate(row[: len(first)]) if _LABELS & {*words_of(name)}]
    beside = {first[max((each for each in labels if each < three[0]), default=0)]: three for three in threes if first}
    if len(beside) == len(threes) > 1 and all(number_of(name) is None for name in beside):
        return beside, [], units
    if threes and len(row) > 3:
        return {"": threes[0]}, [], units
    return ({}, [], set()) if len(row) > 2 and any(map(is_value, row)) else None


def _over_axes(rows: Sequence[Sequence[str]], place: int, first: Sequence[str]) -> list[str]:
    """Name the columns of a row of axes by the rows around it, other columns by their own cells or the ones above.

    Empty where the row holds no axes, or no other row names them.
    """
    row, above = [name.strip() for name in rows[place]], rows[:place]
    if above and row[0] == "MARKER_NAMES":
        return _in_order(row, len(first), first)
    # Markers may be counted behind their axes, where names stand above: `X1`.
    again = _NUMBERED if above and sum(bool(_NUMBERED.search(name)) for name in row) > _FEW else _AGAIN
    found = [_AXIS.fullmatch(again.sub("", name)) for name in row]
    axes = [each[1].lower() if each and (each[2] or "").lower() not in _NO_LENGTHS else "" for each in found]
    # Motive's numbers are no names; those of several markers without a name may be one.
    around = [each for each in above or rows[place + 1 :] if sum(map(bool, each)) > 1 and "ID" not in each[:2]]
    names = [_filled(each, len(row), axes) for each in around]
    ours = _places_among(axes, names, rows[place + 1 :] if above else [])
    if min(map(axes.count, "xyz")) < _FEW or not ours or not names:
        return []
    # The joints' row, not one that says rates and units.
    named = max(names, key=lambda one: len(set.intersection(*({one[c] for c in ours if axes[c] == a} for a in "xyz"))))
    threes = [ours[n : n + 3] for n in range(len(ours)) if [axes[column] for column in ours[n : n + 3]] == [*"xyz"]]
    is_over = _are_over(named, threes)
    if above and all((coordinate_of(names[-1][column]) or ("", ""))[1] == axes[column] for column in ours):
        # Each column has a whole name.
        return names[-1]
    if above and not (is_over and named == names[-1]):
        # Behind the last marker that is seen at first, tabs may be cut off; the axes are whole.
        ways = (_in_order(above[-1], size, first) for size in (len(first), ours[-1] + 1))
        if in_order := next(filter(None, ways), None):
            return in_order
    if not is_over:
        return []
    named = _with_stars(named, around[names.index(named)], threes)
    named = _with_bodies(named, names, [(column, axes[column]) for column in ours], threes)
    # pandas names times in a row of their own, below the axes.
    below = next((each for each in rows[place + 1 :] if not any("".join(each[c : c + 1]) for c in ours)), ())
    near, low = ([*each, *[""] * len(row)] for each in (above[-1] if above else (), below))
    heads = ["" if axes[c] else low[c].strip() or row[c] or near[c].strip() for c in range(len(row))]
    # Motive calls a skeleton's first bone like the skeleton; Vicon Tracker calls each thing so.
    root = "Hip" if any(cell and not _ROOT.match(cell) for cell in (named[column] for column in ours)) else r"\1"
    for column in ours:
        name, axis = _ROOT.sub(rf"\1:{root}", named[column]), found[column]
        heads[column] = f"{name}_{axis[1]} {axis[2] or ''}" if axis and name else ""
    return heads


def _are_over(names: Sequence[str], threes: Sequence[Sequence[int]]) -> bool:
    """Say whether one name stands over the three columns of each marker."""
    return all(len({names[column] for column in three}) == 1 for three in threes)


def _with_bodies(
    named: Sequence[str],
    rows: Sequence[Sequence[str]],
    ours: Sequence[tuple[int, str]],
    threes: Sequence[Sequence[int]],
) -> list[str]:
    """Put each body's name, which stands in another row, before its joints where several have the same joints."""

    def is_each_told(row: Sequence[str]) -> bool:
        return len({(row[column], named[column], axis) for column, axis in ours}) == len(ours)

    if is_each_told(named):
        return [*named]
    front = next((each for each in rows if is_each_told(each) and _are_over(each, threes)), None)
    return [f"{one}:{name}" for one, name in zip(front, named, strict=True)] if front else [*named]


def _with_stars(named: Sequence[str], row: Sequence[str], threes: Sequence[Sequence[int]]) -> list[str]:
    """Give a star and a number, as C3D does, to each marker without a name of its own in a row.

    Such a marker has the name of the marker on its left, or of the clock: `named` holds these, too.
    """
    found, taken = [*named], set[str]()
    for number, three in enumerate(threes, start=1):
        name = named[three[0]]
        is_clock = bool((_TIMES | _FRAMES) & {*words_of(name)})
        if (name in taken or is_clock) and not any(row[three[0] : three[-1] + 1]):
            for column in three:
                found[column] = f"*{number}"
        taken.add(name)
    # What stands over all columns names no marker.
    return found if len(taken) > 1 else [*named]


def _places_among(axes: Sequence[str], names: Sequence[Sequence[str]], below: Sequence[Sequence[str]]) -> list[int]:
    """Choose of the columns of axes the ones of positions, by the rows of names and the rows below."""
    kinds = [each for each in names if {"position", "rotation", "joint angle"} & {name.lower() for name in each}]
    over = [{each[column].lower() for each in names} for column in range(len(axes))]
    ours = [
        column
        for column, axis in enumerate(axes)
        if axis
        and not any(_NO_PLACES & {*words_of(each[column])} for each in kinds)
        # Degrees and newtons are no positions.
        and not any(cell.strip() and metres_of(cell) is None for each in below for cell in each[column : column + 1])
    ]
    # Of Motive's columns a skeleton's bones count, or several rigid bodies, not the markers on them.
    if bones := [column for column in ours if "bone" in over[column]]:
        return bones
    each_body = [over[column] for column in ours if axes[column] == "x" and "rigid body" in over[column]]
    bodies = {*chain(*each_body)} if len(each_body) > 1 else set[str]()
    ours = [c for c in ours if not any(cell.partition(":")[0] in bodies for cell in over[c] - bodies)]
    # A body's markers stand there again as they were measured.
    measured = {cell for c in ours if "marker" in over[c] for cell in over[c] if ":" in cell}
    return [c for c in ours if "rigid body marker" not in over[c] or not over[c] & measured]


def _in_order(row: Sequence[str], size: int, first: Sequence[str]) -> list[str]:
    """Name three of so many columns after each name of a row that does not stand over them; empty where none fit."""
    cells = [*filter(None, map(str.strip, row))]
    for each in (cells, " ".join(cells).split()):
        heads = [name for name in each[:2] if name == "MARKER_NAMES" or (_FRAMES | _TIMES) & {*words_of(name)}]
        names, front = each[len(heads) :], size - 3 * (len(each) - len(heads))
        # A tab may stand at a line's end, too.
        front -= front % 2 and not first[-1]
        if len(names) > 1 and 0 <= front < 3:
            return [*("Frame", "Time")[:front], *(f"{name} {axis}" for name in names for axis in "xyz")]
    return []


def _filled(row: Sequence[str], size: int, axes: Sequence[str] = ()) -> list[str]:
    """Give each empty cell the text on its left: a name stands over the first of its columns, or the second, alone."""
    if {axis for name, axis in zip(row, axes, strict=False) if name.strip() and axis} == {"y"}:
        row = row[1:]
    left = ""
    return [left := name.strip() or left for name in [*row, *[""] * size][:size]]


def _header(
    rows: Sequence[Sequence[str]], names: Sequence[str], joints: _Columns, others: list[str], units: set[str]
) -> TableHeader:
    taken = {column for axes in joints.values() for column in axes}
    words = {column: words_of(name) for column, name in enumerate(names) if column not in taken}
    parts = [c for c, each in words.items() if _PARTS >= {*each} > set()]
    times = [c for c, each in words.items() if _TIMES & {*each} or _SECONDS >= {*each} > set()]
    times = sorted({*times, *parts}) if len(parts) > 2 else times
    # ROS puts `field.` in front of all its columns.
    numbers = [c for c, each in words.items() if len(each) < 4 and _FRAMES & {*each[:1]}]
    frames = sorted({*numbers, *(c for c, each in words.items() if each[-1:] == ["frame"])})
    people = [c for c, each in words.items() if _PERSON.fullmatch(" ".join(each))]
    said = dict[str, list[str]]()
    for name, value in _said(rows):
        kind = next((kind for kind, form in _SAID.items() if form.fullmatch(name)), "")
        if found := (_WORD if kind == "unit" else _LEADING).match(value):
            said.setdefault(kind, []).append(found[1])
    # Vicon's tables have the rate alone in a row, the nearest one above its part.
    alone = [number[1] for row in reversed(rows) if (number := _ALONE.fullmatch(" ".join(filter(None, row))))]
    beside = re.findall(r"(?i)(\d+\.?\d*) ?(?:hz|fps)\b", " ".join(names[column] for column in frames))
    rates = map(float, (*said.get("rate", ()), *said.get("capture", ()), *alone, *beside))
    # A row of units may stand over the joints' columns, or below their names.
    over = [{row[column].strip("()[]. ").lower() for column in taken if column < len(row)} - {""} for row in rows]
    lengths = {each.lower() for each in units}.union(*(each for each in over if each <= {*METRES})) & {*METRES}
    of_length = [*said.get("unit", ()), *(lengths if len({*map(METRES.get, lengths)}) == 1 else ())]
    return TableHeader(
        [name.strip().strip("#").strip() for name in names],
        _plain(joints),
        [*times, *(column for column in frames if column not in times)],
        people,
        [column for column in words if column not in {*times, *frames, *people}],
        [column for column, each in words.items() if _LABELS & {*each}],
        next((rate for rate in rates if rate > 1), 0.0),
        next(filter(metres_of, of_length), next(iter(of_length), "")),
        next(map(float, said.get("frames", ())), 0.0),
        others,
        (any(row and row[0].lower() == "trajectories" for row in rows), len(joints)),
    )


def _said(rows: Sequence[Sequence[str]]) -> Iterator[tuple[str, str]]:
    """Give each cell with the cells behind and below it, and what stands around a colon, an equals sign or a blank."""
    for row, below in zip(rows, [*rows[1:], []], strict=False):
        keys, values = ([cell.strip() for cell in each if cell.strip()] for each in (row, below))
        # Where as many cells are filled, they belong together in their order.
        if len(keys) != len(values):
            keys, values = [cell.strip() for cell in row], [*below]
        yield from zip(keys, values, strict=False)
        yield from () if is_numbers(below) else pairwise(map(str.strip, row))
        for cell in row:
            name, *value = _BETWEEN.split(cell.strip("#/% "), maxsplit=1)
            yield name, next(iter(value), "")


def _plain(joints: _Columns) -> _Columns:
    """Leave out words that are no part of a name: those for a position, and those for a joint in front of all."""
    names = Counter(map(plain, joints))
    found = {plain(joint) if names[plain(joint)] == 1 else joint: axes for joint, axes in joints.items()}
    front = re.match(r"([^\W_]+)[\W_]+", next(iter(found), ""))
    if front and front[1].lower() in _FRONTS and all(joint.startswith(front[0]) for joint in found):
        bare = {joint.removeprefix(front[0]).strip("[]\"'") or joint: axes for joint, axes in found.items()}
        # `Marker 001` is a whole name; Blender has two words in front: `pose.bones["Hips"]`.
        return found if any(map(str.isdigit, bare)) or len(bare) < len(found) else _plain(bare)
    return found
