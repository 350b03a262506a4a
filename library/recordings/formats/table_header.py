"""The header of a table of joints: which columns hold joints' positions, times, frame numbers and people.

One row names a column for each coordinate (`head_x`, `head.X`, `head:tx`, `Head Position X (mm)`, `x_head`); or one row
names the joints and a later one their axes, as in the tables of Motive, Vicon and pandas; or each row is a joint, and a
column names it. Rows above say how often frames come, and the unit of length.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate, pairwise

from kinespace.library.recordings.formats.errors import number_of
from kinespace.library.recordings.formats.joint_choice import MAX_NAME, plain
from kinespace.library.recordings.formats.timed_frames import words_of
from kinespace.library.recordings.formats.units import WORDS, metres_of

#: How columns are named after a joint and an axis: of these ways the one that names most joints counts.
_WAYS = (
    re.compile(r"(?P<joint>.*[^\W_])[\W_]+[tp]?(?P<axis>[xyz])(?:[\W_]+(?P<unit>[µa-z]{1,11}))?[\W_]*", re.IGNORECASE),
    re.compile(r"(?P<joint>.*[a-z0-9\])])(?P<axis>[XYZ])(?:[\W_]+(?P<unit>[µa-zA-Z]{1,11}))?[\W_]*"),
    re.compile(r"(?:pos|position)?[\W_]*(?P<axis>[xyz])[\W_]*(?P<joint>(?<=[\W_]).+|\d+)", re.IGNORECASE),
)
#: Words of columns (`words.toml`).
_TIMES, _SECONDS, _FRAMES, _LABELS, _NO_PLACES = (
    frozenset(WORDS["columns"][kind]) for kind in ("times", "alone", "frames", "labels", "no_places")
)
_PERSON = re.compile(
    r"(person|people|body|track|tracking|subject|performer|actor|user|skeleton|player|participant|human|object|instance|"
    r"character|dancer|entity|avatar)"
    r"( ?(id|ids|idx|index|nr|no|number|name))?|p?id"
)
#: Rows above the first frame that may name joints.
_DEEP = 12
_RATE = re.compile(r"(export |data |camera )?(frame ?rate|frequency|sampl\w+ (rate|frequency)|fps)\b.*", re.IGNORECASE)
_UNIT = re.compile(r"(length )?units?\W*", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Header:
    """The columns of a table.

    Attributes
    ----------
    names
        The name of every column.
    joints
        The columns of x, y and z, for each joint.
    times, frames, person
        The columns of times, of frame numbers, of a number or a name for each person; None where there is none.
    label
        The column of joints' names where each row is a joint, and `joints` one without a name; else None.
    rate, metres
        Frames per second and metres of the unit, where the header says them; else 0 and None.
    others
        Names of columns that come by three but hold no positions.
    """

    names: Sequence[str]
    joints: Mapping[str, tuple[int, int, int]]
    times: int | None
    frames: int | None
    person: int | None
    label: int | None
    rate: float
    metres: float | None
    others: Sequence[str]


@lru_cache(maxsize=4096)
def coordinate_of(name: str) -> tuple[str, str] | None:
    """Give the joint and the axis in the name of one coordinate, like `/p1/wrist_l:tx`; None for another name."""
    named = next((found for way in _WAYS[:2] if (found := way.fullmatch(name)) and not found["unit"]), None)
    return (plain(named["joint"]), named["axis"].lower()) if named else None


def is_numbers(row: Sequence[str]) -> bool:
    """Say whether a row holds a frame: it begins with a number, or a time of day, and most of it are numbers."""
    filled = [field for field in row if field.strip()]
    numbers = sum(number_of(field) is not None for field in filled)
    return len(filled) > 3 and filled[0].strip()[0] in "0123456789+-.,'\"" and numbers > 0.7 * len(filled) - 1


def header_of(rows: Sequence[Sequence[str]]) -> Header | None:
    """Read the rows above a table's first frame; None where they name no two joints."""
    for place in range(len(rows) - 1, max(len(rows) - _DEEP, 0) - 1, -1):
        axes = [name.strip().lower() for name in rows[place]]
        if min(map(axes.count, "xyz")) > 1 and (found := _of_several(rows, place)):
            return found
        joints, others, units = _of_one(rows[place])
        if len(joints) > 1:
            return _header(rows, rows[place], joints, others, units)
        if {*"xyz"} <= {*axes} and any(_LABELS & {*words_of(name)} for name in rows[place]):
            return _header(rows, rows[place], {"": {axis: axes.index(axis) for axis in "xyz"}}, {}, set())
    return None


def _of_one(row: Sequence[str]) -> tuple[dict[str, dict[str, int]], dict[str, None], set[str]]:
    """Find the joints that one row names with their axes, other things of three columns, and the units behind them."""
    best: tuple[dict[str, dict[str, int]], dict[str, None], set[str]] = ({}, {}, set())
    for way in _WAYS:
        found, units = dict[str, dict[str, int]](), set[str]()
        for place, name in enumerate(row):
            if len(name) <= MAX_NAME and (named := way.fullmatch(name.strip().strip("#").strip())):
                found.setdefault(named["joint"], {}).setdefault(named["axis"].lower(), place)
                units.add((named.groupdict().get("unit") or "").lower())
        whole = {joint: axes for joint, axes in found.items() if len(axes) == 3}
        others = {joint: None for joint in whole if _NO_PLACES & {*words_of(joint)}}
        if len(whole) - len(others) > len(best[0]):
            best = {joint: axes for joint, axes in whole.items() if joint not in others}, others, units - {""}
    return best


def _of_several(rows: Sequence[Sequence[str]], place: int) -> Header | None:
    """Read a header whose row of axes is below a row of names."""
    axes = [name.strip().lower() for name in rows[place]]
    ours = [column for column, axis in enumerate(axes) if axis in ("x", "y", "z")]
    above = [_filled(row, len(axes)) for row in rows[:place] if sum(map(bool, row)) > 1]
    units = {row[column].strip().lower() for row in rows[place + 1 :] for column in ours if column < len(row)} - {""}
    kinds = {row[column].lower() for row in above for column in ours}
    ours = [
        column
        for column in ours
        if not any(
            _NO_PLACES & {*words_of(row[column])} and row[column].lower() in kinds for row in above if _is_kind(row)
        )
        # Of a skeleton's table the bones count, not the markers on them.
        and not (
            "bone" in kinds and any(row[column].lower() in ("marker", "bone marker", "rigid body") for row in above)
        )
    ]
    named = max(above, key=lambda row: len({row[column] for column in ours}), default=None)
    if named is None:
        return None
    found, again = dict[str, dict[str, int]](), dict[str, None]()
    for column in ours:
        if found.setdefault(named[column], {}).setdefault(axes[column], column) != column and named[column]:
            # A second body, say, whose name stands in another row.
            again[f"{named[column]} again"] = None
    joints = {joint: each for joint, each in found.items() if joint and len(each) == 3}
    others = again | {joint: None for joint in joints if _NO_PLACES & {*words_of(joint)[-1:]}}
    joints = {joint: each for joint, each in joints.items() if joint not in others}
    return _header(rows, rows[place], joints, others, units) if len(joints) > 1 else None


def _is_kind(row: Sequence[str]) -> bool:
    """Say whether a row tells positions from rotations."""
    return bool({"position", "rotation"} & {name.lower() for name in row})


def _filled(row: Sequence[str], size: int) -> list[str]:
    """Give each empty cell the text on its left: a name stands over the first of its columns alone."""
    cells = [*(name.strip() for name in row), *[""] * size][:size]
    return [*accumulate(cells, _kept)]


def _kept(before: str, name: str) -> str:
    return name or before


def _header(
    rows: Sequence[Sequence[str]],
    names: Sequence[str],
    joints: Mapping[str, Mapping[str, int]],
    others: Mapping[str, None],
    units: set[str],
) -> Header:
    taken = {column for axes in joints.values() for column in axes.values()}
    words = {column: words_of(name) for column, name in enumerate(names) if column not in taken}
    said = list(_said(rows))
    rates = [number for name, value in said if _RATE.fullmatch(name) and (number := number_of(value))]
    # Vicon's tables have the rate alone in a row.
    alone = [number for row in rows if len(kept := [*filter(None, row)]) == 1 and (number := number_of(kept[0]))]
    named = [metres_of(value) for name, value in said if _UNIT.fullmatch(name)]
    named += [metres_of(units.pop())] if len(units) == 1 else []
    return Header(
        [name.strip().strip("#").strip() for name in names],
        {name: (axes["x"], axes["y"], axes["z"]) for name, axes in _plain(joints).items()},
        next(
            (
                c
                for c, each in words.items()
                if (_TIMES & {*each} or _SECONDS >= {*each} > set()) and "code" not in each
            ),
            None,
        ),
        next((c for c, each in words.items() if each[:1] and (each[0] in _FRAMES)), None),
        next((c for c, each in words.items() if _PERSON.fullmatch(" ".join(each))), None),
        next((c for c, each in words.items() if _LABELS & {*each}), None) if {*joints} == {""} else None,
        next((rate for rate in (*rates, *alone) if rate > 1), 0.0),
        next((each for each in named if each), None),
        list(others),
    )


def _said(rows: Sequence[Sequence[str]]) -> Iterator[tuple[str, str]]:
    """Give each cell with the cell behind it, and what stands around a colon."""
    for row in rows:
        yield from ((name.strip(), value) for name, value in pairwise(row))
        for cell in row:
            name, colon, value = cell.strip("# ").partition(":")
            if colon:
                yield name, value


def _plain(joints: Mapping[str, Mapping[str, int]]) -> Mapping[str, Mapping[str, int]]:
    """Leave out words that are no part of a name: those for a position, and FreeMoCap's `body_` before every joint."""
    names = Counter(map(plain, joints))
    found = {plain(joint) if names[plain(joint)] == 1 else joint: axes for joint, axes in joints.items()}
    if all(joint.startswith("body_") for joint in found):
        return {joint.removeprefix("body_"): axes for joint, axes in found.items()}
    return found
