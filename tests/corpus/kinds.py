"""Small files as people's programs write them, one a kind, all of the same few frames of one body; README.md lists them."""

from __future__ import annotations

import re
import struct
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
from numpy.typing import NDArray
from written import MOVES, TURNS, Node, bvh_text, trc_text

RATE = 60.0
NAMES = (
    *("Hips", "Spine1", "Neck", "Head", "LeftArm", "LeftForeArm", "LeftHand", "RightArm", "RightForeArm", "RightHand"),
    *("LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot"),
)
_HEIGHTS = (0.94, 1.16, 1.44, 1.54, 1.39, 1.12, 0.88, 1.39, 1.12, 0.88, 0.89, 0.48, 0.07, 0.89, 0.48, 0.07)
_SIDES = (0, 0, 0, 0, 0.17, 0.24, 0.31, -0.17, -0.24, -0.31, 0.09, 0.09, 0.1, -0.09, -0.09, -0.1)


def body() -> NDArray[np.float64]:
    """Give a body that bends its knees and lifts its left hand, (48, joints, 3), metres, to a tenth of a millimetre."""
    at = np.linspace(0, np.pi, 48)[:, None]
    heights, sides = np.array(_HEIGHTS), np.array(_SIDES)
    x = sides + 0.05 * np.sin(at) * sides
    y = heights - 0.3 * np.sin(at) * np.clip(heights - 0.1, 0, 0.8)
    z = 0.02 + 0.1 * np.sin(at) * (heights < 0.6) + 0.3 * np.sin(at) * (np.array(NAMES) == "LeftHand")
    return np.round(np.stack([x, y, z], axis=2), 4)


@dataclass(frozen=True)
class Kind:
    """A file, the right values in it where they are not the body's, and what is said of it.

    `lacking` are names that are left out, `frames` those that are there, `people` the performers' names, `tells` a part
    of a remark or of the refusal; `names` are those of `body`, if it is another; `options` are a person's. `reads` is False where only a clear refusal is right.
    """

    ending: str
    content: bytes
    tells: str = ""
    lacking: tuple[str, ...] = ()
    rate: float = RATE
    frames: slice = field(default_factory=lambda: slice(None))
    people: tuple[str, ...] = ("",)
    options: tuple[tuple[str, object], ...] = ()
    names: Sequence[str] = NAMES
    body: NDArray[np.float64] = field(default_factory=lambda: BODY)
    near: float = 2e-4
    reads: bool = True

    @property
    def is_plain(self) -> bool:
        """Whether it is read as the body by its names, at its rate, of nobody, without a remark."""
        said = self.tells or self.lacking or self.options or self.people != ("",) or self.rate != RATE
        return self.reads and not said and self.names is NAMES and self.body is BODY


BODY = body()
OTHER = BODY + np.array([1.5, 0, 0])
#: Two bodies beside each other.
BOTH = np.concatenate([BODY, OTHER], axis=1)
TIMES = np.arange(len(BODY)) / RATE
#: Two markers on each segment, some centimetres apart.
MARKERS = tuple(f"{name}{number}" for name in NAMES if name != "Spine1" for number in (1, 2))
ON_SEGMENTS = np.repeat(np.delete(BODY, NAMES.index("Spine1"), axis=1), 2, axis=1) + np.tile([[0.04], [-0.03]], (15, 3))
SIDES_LAST = [re.sub("(Left|Right)(.+)", r"\2_\1", name).lower() for name in NAMES]
PATHS = [f"/p1/{name}" for name in NAMES]
#: Of two letters each.
JAPANESE = tuple(
    map(
        "".join,
        zip(*["頭頂首元右肩左肩右肘左肘右手左手腰部胸部右膝左膝右足左足背中骨盤"[n::2] for n in (0, 1)], strict=True),
    )
)
PELVIS = ("LASI", "RASI", "LPSI", "RPSI")
FEET = ("LTOE", "LHEE", "RTOE", "RHEE")
_FEET = BODY[:, [12, 12, 15, 15]] + np.array([[0.05, 0, 0.15], [0, 0, -0.1]] * 2) + np.array([33.0, 10.5, 0])
HEAD = ("LFHD", "RFHD", "LBHD", "RBHD")
HAND = ("WRIST", "THUMB_TIP", "INDEX_FINGER_TIP", "PINKY_TIP")
_HAND = BODY[:, [9] * 4] + np.array([[0, 0, 0], [0.08, 0.1, 0], [0.03, 0.19, 0], [-0.06, 0.15, 0]])
_PELVIS = BODY[:, :1] + np.array([[0.12, 0, 0.1], [-0.12, 0, 0.1], [0.05, 0, -0.1], [-0.05, 0, -0.1]])


def _kinds(
    ending: str, texts: Mapping[str, tuple[str, Mapping[str, Any]]], front: str = "", encoding: str = "latin-1"
) -> dict[str, Kind]:
    return {
        front + name: Kind(**{"ending": ending, "content": text.encode(encoding), **said})
        for name, (text, said) in texts.items()
    }


# --- tables ----------------------------------------------------------------------------------------------------------


def table(  # noqa: PLR0913 - a table may differ in many ways
    *,
    head: Callable[[str, str], str] = "{}_{}".format,
    clock: str | None = "time",
    times: Iterable[object] = (f"{time:.4f}" for time in ()),
    mark: str = ",",
    positions: NDArray[np.float64] = BODY,
    first: str = "",
    more: Sequence[tuple[str, object]] = (),
    names: Sequence[str] = NAMES,
) -> str:
    """Give a table with a column for each coordinate, and further columns in front."""
    moments = list(times) or [f"{time:.4f}" for time in TIMES]
    rows = [[*([clock] if clock else []), *(name for name, _ in more), *(head(n, a) for n in names for a in "xyz")]]
    for moment, frame in zip(moments, positions, strict=False):
        rows.append([*([str(moment)] if clock else []), *(str(value) for _, value in more), *_numbers(frame)])
    return first + _lines(rows, mark)


def _numbers(frame: NDArray[np.float64]) -> list[str]:
    """Write a frame's numbers to a tenth of a millimetre, NaN as nothing."""
    return ["" if value != value else f"{value:.4f}" for value in frame.ravel().tolist()]  # noqa: PLR0124 - NaN


def _lines(rows: Iterable[Iterable[str]], mark: str = ",") -> str:
    return "".join(mark.join(row) + "\n" for row in rows)


def _frames(positions: NDArray[np.float64], lead: Callable[[int], str], mark: str = ",") -> str:
    """Give a row for each frame, behind what its number leads to."""
    return _lines(([lead(place), *_numbers(frame)] for place, frame in enumerate(positions)), mark)


def _without(joint: str, value: float | NDArray[np.float64], frames: slice = slice(None)) -> NDArray[np.float64]:
    changed = BODY.copy()
    changed[frames, NAMES.index(joint)] = value
    return changed


def _several_rows(names: Sequence[str], axes: Sequence[str], lead: Sequence[Sequence[str]], kinds: str) -> str:
    """Give the rows of a header that names joints over the first, or every, of their columns."""
    over = [cell if kinds == "every" or place == 0 else "" for cell in names for place in range(len(axes))]
    return _lines([[*lead[0], *over], [*lead[1], *axes * len(names)]])


def _motive(of: str = "Bone", who: str = "Ann:", markers: Sequence[str] = ("Ann:WaistLFront",)) -> str:
    """Motive 2 and 3: seven rows, a rotation before each position, and markers of the skeleton behind the bones."""
    kinds = (("Rotation", "XYZW"), ("Position", "XYZ"))
    columns = [(f"{who}{name}", kind, axis) for name in NAMES for kind, axes in kinds for axis in axes]
    columns += [
        (name, "Position", axis) if axis else (name, "Marker Quality", "") for name in markers for axis in (*"XYZ", "")
    ]
    head = "Format Version,1.23,Take Name,Take 1,Capture Frame Rate,60.000000,Export Frame Rate,60.000000,Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global\n\n"
    head += _lines(
        [
            ["", "Type", *[of] * 7 * len(NAMES), *[f"{of} Marker"] * 4 * len(markers)],
            ["", "Name", *(name for name, _, _ in columns)],
            ["", "ID", *(f"{sum(map(ord, name)):032X}" for name, _, _ in columns)],
            ["", "", *(kind for _, kind, _ in columns)],
            ["Frame", "Time (Seconds)", *(axis for _, _, axis in columns)],
        ]
    )
    bones = np.concatenate([np.broadcast_to((0.1, 0.2, 0.3, 0.9), (48, 16, 4)), BODY], axis=2).reshape(48, -1)
    places = np.broadcast_to((5.0, 5.0, 6.0, 1.0) * len(markers), (48, 4 * len(markers)))
    return head + _frames(np.hstack([bones, places]), lambda place: f"{place},{place / RATE:.6f}")


def _motive_markers(names: Sequence[str] = NAMES, who: str = "Ann", ids: Sequence[str] = ("7",) * 16) -> str:
    """Motive's markers alone: names, numbers and kinds stand thrice; where these differ a row of bodies is among them."""
    rows = [("Type", ["Marker"] * 16), ("Name", [f"{who}:{name}" for name in names]), ("ID", ids)]
    rows += [*[("Parent", [who] * 16)] * (len({*ids}) > 1), ("", ["Position"] * 16)]
    head = "".join(",".join(["", title, *(cell for cell in cells for _ in "xyz")]) + "\n" for title, cells in rows)
    axes = ",".join(["Frame", "Time (Seconds)", *"XYZ" * 16])
    return f"Format Version,1.23,Length Units,Meters\n\n{head}{axes}\n" + _frames(
        BODY, lambda place: f"{place},{place / RATE:.6f}"
    )


def _results() -> str:
    """Give angles and places of a model side by side, told apart by a row above the names."""
    head = "# ,Joint Angle,,,,,,Joint Coordinate,,,\n# ,,,x = flexion,,,,###O = Origin,,,\n"
    names = _several_rows([*NAMES[:2], *NAMES], "XYZ", (["# "], ["# frame num"]), "first")
    return (
        head + names + _frames(np.concatenate([100 * BODY[:, :2], 1000 * BODY], axis=1), lambda place: f"{place:.9f}")
    )


def _rigid(measured_as: str = "") -> str:
    """Motive's rigid bodies: each of their markers stands there as the body's, and as it was measured."""
    names = [f"{who}:Marker {number}" for who in ("Front", "Back") for number in (1, 2)]
    names += [measured_as.format(number) or name for number, name in enumerate(names)]
    rows = (
        ("", "Type", *["Rigid Body Marker"] * 12, *["Marker"] * 12),
        ("", "Name", *(name for name in names for _ in "xyz")),
        ("", "ID", *(f'"{sum(map(ord, name)):X}{n // 4}"' for n, name in enumerate(names) for _ in "xyz")),
        ("", "", *["Position"] * 24),
        ("Frame", "Time (Seconds)", *"XYZ" * 8),
    )
    says = "Format Version,1.24,Take Name,Take 1,Take Notes,,Export Frame Rate,60.000000,Length Units,Millimeters\n\n"
    front = 1000 * _PELVIS[:, :2].reshape(-1, 6)
    measured = np.concatenate([front, front + np.tile([1500.0, 0, 0], 2)], axis=1)
    frames = np.concatenate([measured + 7, measured], axis=1)
    return says + _lines(rows) + _frames(frames, lambda place: f"{place},{place / RATE:.6f}")


def _vicon(title: str = "Trajectories", axes: Sequence[str] = "XYZ", units: str = "mm,mm,mm") -> str:
    """Vicon Nexus and Tracker: forces first, then millimetres, perhaps behind turns, with the rate in its own line."""
    forces = (
        "Devices\n600\n,,Plate - Force,,\nFrame,Sub Frame,Fx,Fy,Fz\n,,N,N,N\n1,0,0.1,0.2,700.5\n1,1,0.1,0.2,700.6\n\n"
    )
    head = _several_rows([f"Ann:{name}" for name in NAMES], axes, (["", ""], ["Frame", "Sub Frame"]), "first")
    turns = np.full((48, 16, len(axes) - 3), 0.5)
    rows = _frames(np.concatenate([turns, BODY * 1000], axis=2), lambda place: f"{place + 1},0")
    return f"{forces}{title}\n{RATE:.0f}\n{head},,{','.join([units] * 16)}\n{rows}"


def _nexus() -> str:
    """Vicon Nexus with kinematics: behind a marker's places stand its speeds and its accelerations."""
    speeds = 60_000 * np.gradient(BODY, axis=0)
    kinds = (("", "mm", 1000 * BODY), ("'", "mm/s", speeds), ("''", "mm/s^2", 60 * np.gradient(speeds, axis=0)))
    columns = [(f"Ann:{name}", axis + mark, unit) for name in NAMES for mark, unit, _ in kinds for axis in "XYZ"]
    names = (name if place % 9 == 0 else "" for place, (name, _, _) in enumerate(columns))
    axes, units = (axis for _, axis, _ in columns), (unit for _, _, unit in columns)
    head = _lines([["", "", *names], ["Frame", "Sub Frame", *axes], ["", "", *units]])
    numbers = np.stack([each for _, _, each in kinds], axis=2)
    return f"Trajectories\n60\n{head}" + _frames(numbers, lambda place: f"{place + 1},0")


def _vicon_parts() -> str:
    """Give the events, with a rate of their own, and angles above the trajectories."""
    events = "Events\n1000\nSubject,Context,Name,Time (s),Description\nAnn,Left,Foot Strike,0.2,x\n\n"
    angles = _several_rows(["Ann:LHipAngles", "Ann:RHipAngles"], "XYZ", (["", ""], ["Frame", "Sub Frame"]), "first")
    rows = "".join(f"{place + 1},0,1.0,2.0,3.0,1.0,2.0,3.0\n" for place in range(48))
    return f"{events}Model Outputs\n120\n{angles},,deg,deg,deg,deg,deg,deg\n{rows}\n"


def _vicon_old() -> str:
    head = _several_rows([f"Ann:{name}" for name in NAMES], "XYZ", ([""], ["Field #"]), "first")
    rows = _frames(BODY * 1000, lambda place: str(place + 1))
    return f"TRAJECTORIES\n60,Hz\n{head}{rows}"


def _qualisys(*, columns: bool = True, body: NDArray[np.float64] = BODY) -> str:
    names = "\t".join(NAMES)
    head = f"NO_OF_FRAMES\t{len(BODY)}\nNO_OF_MARKERS\t16\nFREQUENCY\t60\nDATA_INCLUDED\t3D\nMARKER_NAMES\t{names}\n"
    heads = "\t".join(f"{name} {axis}" for name in NAMES for axis in "XYZ")
    rows = _frames(body * 1000, lambda place: f"{place + 1}\t{place / RATE:.5f}", "\t")
    return head + f"Frame\tTime\t{heads}\n" * columns + rows


def _skeleton() -> str:
    """Put a joint's name into the header in front of its axes, over an empty column."""
    heads = "\t".join(["Frame", "Time", *(f"{name}\tX\tY\tZ\tQX\tQY\tQZ\tQW" for name in NAMES)])
    empty, turns = np.full((48, 16, 1), np.nan), np.broadcast_to((0.1, 0.2, 0.3, 0.9), (48, 16, 4))
    numbers = np.concatenate([empty, 1000 * BODY, turns], axis=2)
    rows = _frames(numbers, lambda place: f"{place + 1}\t{TIMES[place]:.5f}", "\t")
    return f"NO_OF_FRAMES\t48\nFREQUENCY\t60\nREFERENCE\tGLOBAL\n{heads}\n{rows}"


#: Numbers of a hand and a body, which both begin at 0; and names whose sides stand in a column of their own.
_PARTS = tuple(f"hand_{number}" if number < 6 else f"pose_{number - 6}" for number in range(16))
_SIDED = tuple(f"{name[:4]}_{name[4:]}" if name[:4] == "Left" else name.replace("Right", "Right_") for name in NAMES)


def _apart(names: Sequence[str], head: str) -> str:
    """Give a row a joint, whose name stands in two columns."""
    cells = [name.replace("_", ",") if "_" in name else f"none,{name}" for name in names]
    return _long("{time:.4f},{joint},{x:.4f},{y:.4f},{z:.4f}", names=cells).replace("time,joint", f"time,{head}")


def _two_long() -> str:
    names = [f"{who},{name}" for who in "ab" for name in NAMES]
    return _long("{time:.4f},{joint},{x:.4f},{y:.4f},{z:.4f}", names=names, body=BOTH).replace("joint", "who,joint", 1)


def _two(column: str, clock: str, ids: tuple[str, str]) -> str:
    """Put the rows of two bodies by turns."""
    times = TIMES if clock == "time" else range(len(BODY))
    (head, *one), (_, *other) = (
        table(clock=clock, times=times, more=[(column, name)], positions=each).splitlines(keepends=True)
        for name, each in zip(ids, (BODY, OTHER), strict=True)
    )
    return head + "".join(row for pair in zip(one, other, strict=True) for row in pair)


def _two_twice() -> str:
    """Put the rows of two bodies by turns, each as two cameras saw it, a metre and a half apart each."""
    four = [BODY + np.array([1.5 * number, 0, 0]) for number in range(4)]
    texts = [
        table(more=[("Person#", number // 2), ("Skeleton#", number % 2)], positions=each).splitlines(keepends=True)
        for number, each in enumerate(four)
    ]
    return texts[0][0] + "".join(row for rows in zip(*(text[1:] for text in texts), strict=True) for row in rows)


def _beside() -> str:
    """Put two bodies beside each other, as DeepLabCut does it: scorer, individuals, parts, axes."""
    heads = [["scorer", *["me"] * 96], ["individuals", *["ann"] * 48, *["bob"] * 48]]
    heads += [["bodyparts", *(n for n in NAMES * 2 for _ in "xyz")], ["coords", *"xyz" * 32]]
    return _lines(heads) + _frames(BOTH, str)


def _long(
    fields: str,
    *,
    by: str = "frame",
    names: Sequence[str] = NAMES,
    end: str = "",
    body: NDArray[np.float64] = BODY,
) -> str:
    """Give a row for each joint, or for each coordinate (`{value}`), frame by frame or joint by joint."""
    head = fields.replace("{time:.4f}", "time").replace(":.4f", "").replace("{", "").replace("}", "")
    axes = range(3 if "{value" in fields else 1)
    rows = [(place, joint, axis) for place in range(len(body)) for joint in range(len(names)) for axis in axes]
    made = [head + end]
    for place, joint, axis in rows if by == "frame" else sorted(rows, key=lambda row: row[1]):
        point = body[place, joint].tolist()
        said = {
            "time": TIMES[place],
            "joint": names[joint],
            "id": joint,
            "frame": place,
            **dict(zip("xyz", point, strict=True)),
        }
        made.append(fields.format(axis="xyz"[axis], value=point[axis], **said) + end.replace("score", "0.9"))
    return "\n".join([*made, ""])


def _in_front(heads: str, fields: Callable[[int, float], str], text: str = "") -> str:
    """Put columns in front of a table without a clock: of a frame's number and its time, from half a second on."""
    head, *rows = (text or table(clock=None)).splitlines(keepends=True)
    return f"{heads}{head}" + "".join(
        fields(place, time) + row for place, (time, row) in enumerate(zip(TIMES.tolist(), rows, strict=True))
    )


def _people(front: str, both: tuple[str, str]) -> str:
    """Put two bodies beside each other, whose names stand in front of the joints' ones."""
    return table(names=[front.format(who, name) for who in both for name in NAMES], positions=BOTH)


def _points(field: str, front: str = "") -> str:
    """Write a joint's three numbers into one field."""
    fields = (",".join(field.format(*place) for place in frame) for frame in BODY.tolist())
    lines = "".join(f"{time:.4f},{each}\n" for time, each in zip(TIMES, fields, strict=True))
    return f"{front}time,{','.join(NAMES)}\n{lines}"


def _names_together(axes: str = "XYZ", name: str = "{}_{}", mark: str = ",") -> str:
    """Write semicolons between joints, and commas between a joint's numbers and between their names."""
    heads = ";".join(mark.join(name.format(joint, axis) for axis in axes) for joint in NAMES)
    order = ["XYZ".index(axis) for axis in axes]
    fields = (
        ";".join("{:.5f},{:.5f},{:.5f}".format(*place) for place in frame) for frame in BODY[:, :, order].tolist()
    )
    return "".join([f"Time;{heads}\n", *(f"{time:.4f};{each}\n" for time, each in zip(TIMES, fields, strict=True))])


def _times(scale: float, start: int = 0) -> list[int]:
    return [start + round(time * scale) for time in TIMES.tolist()]


def _tables() -> dict[str, Kind]:
    late = _without("LeftHand", np.nan, slice(0, 40))
    texts = {
        "times after a #": (table(clock="# times"), {}),
        "times in ms by name": (table(clock="time_ms", times=[f"{time * 1000:.1f}" for time in TIMES]), {}),
        "times in ms, misspelled": (table(clock="Miliseconds", times=[f"{time * 1000:.1f}" for time in TIMES]), {}),
        "times that stand, a nominal rate": (table(first="Software : LSL_Kinect,Stream nominal rate : 60,Task : a\n\n", times=['"1,594038E+12"'] * len(BODY)), {}),
        "a comment's mark before the names, blanks": ("% " + table(mark=" "), {"ending": "txt"}),
        "a comment's mark before the names, tabs": ("%\t" + table(mark="\t"), {"ending": "txt"}),
        "a comment's mark at the first name, no times": (table(clock=None, first="%"), {"rate": 30.0, "tells": "times: none"}),
        "slashes before the names, blanks": ("// " + table(mark=" "), {"ending": "txt"}),
        "numbers of no joint": ("time,left arm angle,hip value\n" + _lines([f"{time:.4f}", "1.0", "2.0"] for time in TIMES[:3]), {"reads": False, "tells": "without joints' positions"}),
        "three names in brackets": (_points("({:.4f}, {:.4f}, {:.4f})").replace(",".join(NAMES), ",".join(f"({name}PosX,{name}PosY,{name}PosZ)" for name in NAMES)), {}),
        "three names in brackets, another mark before them": (re.sub("(?m)^([^,]+),", r"\1;", _points("({:.4f}, {:.4f}, {:.4f})").replace(",".join(NAMES), ",".join(f"({name}PosX,{name}PosY,{name}PosZ)" for name in NAMES))), {}),
        "a magnetic field": (table(names=[*NAMES, "field"], positions=np.concatenate([BODY, 20 * BODY[:, :1] + 7], axis=1)), {"tells": "no positions: field"}),
        "directions of an engine": (table(names=[f"{name}_{end}" for name in NAMES for end in ("position", "forward", "up")], positions=np.stack([BODY, BODY * 0.1 + 0.9, BODY * 0.2 + 0.8], axis=2).reshape(48, 48, 3)), {"tells": "no positions: Hips_forward"}),
        "three names in a field": (_names_together(), {}),
        "three names in a field, in another order": (_names_together("XZY"), {}),
        "three names in a field, with blanks": (_names_together("XYZ", "{} {}", ", "), {}),
        "times of five digits": (table(times=[f"{time:.5g}" for time in TIMES]), {}),
        "times with a unit in brackets": (table(clock="Time (Seconds)"), {}),
        "elapsed ms": (table(clock="elapsedMs", times=_times(1e3)), {"near": 2e-3}),
        "milliseconds of a frame": (table(clock="frame_ms", times=_times(1e3)), {"near": 2e-3}),
        "microseconds": (table(clock="timestamp", times=_times(1e6, 5_000_000)), {}),
        "nanoseconds": (table(clock="timestamp", times=_times(1e9, 1_700_000_000_000_000_000)), {}),
        "ticks of 100 ns": (table(clock="timestamp", times=_times(1e7, 638_000_000_000_000_000)), {}),
        "dates": (table(clock="Timestamp", times=[f"2024-05-01T10:00:{time:09.6f}" for time in TIMES]), {}),
        "time of day": (table(clock="time", times=[f"10:00:{time:07.4f}" for time in TIMES]), {}),
        "frame numbers as time": (table(times=range(len(BODY))), {"rate": 30.0, "tells": "frame numbers"}),
        "frame numbers in steps": (table(clock="frame", times=range(0, 96, 2)), {"options": (("frame_rate", RATE),)}),
        "microseconds, ten frames a second": (table(clock="timestamp", times=range(0, 4_800_000, 100_000)), {"rate": 10.0}),
        "no times": (table(clock=None), {"rate": 30.0, "tells": "times: none"}),
        "no times, a rate": (table(clock=None), {"options": (("frame_rate", RATE),)}),
        "times that stand": (table(times=[0.0] * len(BODY)), {"rate": 30.0, "tells": "times"}),
        "two people": (_two("person_id", "frame", ("1", "2")), {"rate": 30.0, "tells": "frame numbers", "people": ("1", "2")}),
        "two people with times": (_two("id", "time", ("1", "2")), {"people": ("1", "2")}),
        "two people in columns": (_beside(), {"rate": 30.0, "tells": "times: none", "people": ("ann", "bob")}),
        "two people with numbers behind axes": (table(head=lambda name, axis: f"{name.removesuffix('*')}_{axis}{1 + name.endswith('*')}", names=[*NAMES, *(f"{name}*" for name in NAMES)], positions=BOTH), {"people": ("1", "2")}),
        "two people with numbers in brackets": (table(names=[f"{name} ({who})" for who in (1, 2) for name in NAMES], positions=BOTH), {"people": ("1", "2")}),
        "two people whose names are the same": (table(names=NAMES * 2, positions=BOTH), {"people": ("0", "1")}),
        "two people whose names are the same, joint by joint": (table(names=[name for name in NAMES for _ in (1, 2)], positions=np.stack([BODY, OTHER], axis=2).reshape(48, 32, 3)), {"people": ("0", "1")}),
        "two people whose names are the same, over their axes": (_several_rows(NAMES * 2, "XYZ", (["", ""], ["Frame", "Time"]), "first") + _frames(BOTH, lambda place: f"{place},{TIMES[place]:.4f}"), {"people": ("0", "1")}),
        "two people with numbers behind all names": (table(names=[f"{name}{who}" for who in (1, 2) for name in NAMES], positions=BOTH), {"people": ("1", "2")}),
        "a column more than names": ("".join(line + ",7.5" * (n > 0) + "\n" for n, line in enumerate(table().splitlines())), {"tells": "columns: 1 behind all names"}),
        "a joint twice": (table(names=[*NAMES, "Head"], positions=np.concatenate([BODY, BODY[:, :1]], axis=1)), {"tells": "twice: Head: the second is called Head_2"}),
        "two joints twice": (table(names=[*NAMES, "Head", "Neck"], positions=np.concatenate([BODY, BODY[:, [3, 2]]], axis=1)), {"tells": "twice: Neck, Head: the second is called Neck_2"}),
        "markers with numbers behind their segments": (table(names=MARKERS, positions=ON_SEGMENTS), {"names": MARKERS, "body": ON_SEGMENTS}),
        "joints to the right, and a direction of something else": (table(names=[*SIDES_LAST, "gaze_forward"], positions=np.concatenate([BODY, 0.1 * BODY[:, :1]], axis=1)), {"names": SIDES_LAST, "tells": "no positions: gaze_forward"}),
        "paths in front of names, blanks, no times": (table(names=PATHS, clock=None, mark=" "), {"ending": "txt", "names": PATHS, "rate": 30.0, "tells": "times: none"}),
        "heads and tails of bones": (table(names=[f"{name}_{end}" for name in NAMES for end in ("head", "tail")], positions=np.stack([BODY, BODY + 0.05], axis=2).reshape(48, 32, 3)), {"tells": "no performer's: Hips_tail"}),
        "two people and a ball": (table(names=[f"{who}:{name}" for who in ("ann", "bob") for name in NAMES], positions=BOTH, more=[(f"{thing}_{axis}", 0.5) for thing in ("ball1", "ball2") for axis in "xyz"]), {"people": ("ann", "bob"), "tells": "no performer's: ball1, ball2"}),
        "two people below a number of frames": ("NO_OF_FRAMES,48\n" + _two("id", "time", ("1", "2")), {"people": ("1", "2")}),
        "two people by instance": (_two("instance", "time", ("0", "1")), {"people": ("0", "1")}),
        "two people, one never seen": (table(names=[f"{who}:{name}" for who in ("ann", "bob") for name in NAMES], positions=np.concatenate([BODY, np.zeros_like(BODY)], axis=1)), {"people": ("ann",), "tells": "never seen: bob"}),
        "two people by id, one never seen": (re.sub(r"(?m)^(.*?,2),.*", r"\1" + ",0" * 48, _two("id", "time", ("1", "2"))), {"people": ("1",), "tells": "or in none: 2"}),
        "two people by name": (_two("Performer", "time", ("ann", "佐藤")), {"people": ("ann", "佐藤")}),
        "rotations": (table(more=[(f"Hips_rot_{axis}", 0.5) for axis in "xyz"] + [(f"Hips_q{axis}", 0.5) for axis in "wxyz"]), {"tells": "no positions: Hips_rot"}),
        "rotations in the world": (table(more=[(f"Hips_rot_world_{axis}", 50.0) for axis in "xyz"]), {"tells": "no positions: Hips_rot"}),
        "qualities": (table(more=[("Hips_visibility", 0.9), ("Hips_confidence", 0.5), ("Hips_presence", 1)]), {}),
        "_pos": (table(head="{}_pos_{}".format), {}),
        "_position.x": (table(head="{}_position.{}".format), {}),
        ".x": (table(head="{}.{}".format), {}),
        "/x": (table(head="{}/{}".format), {}),
        ":tx": (table(head="{}:t{}".format), {}),
        "names and X in capitals": (table(head=lambda name, axis: (name + axis).upper()), {"names": tuple(map(str.upper, NAMES))}),
        "accelerations in capitals": ("time,LACCX,LACCY,LACCZ,LGYRX,LGYRY,LGYRZ\n" + "".join(f"0.{row},1,9,2,1,2,3\n" for row in range(9)), {"reads": False, "tells": "without joints' positions"}),
        "axes behind a name": (table(head=lambda name, axis: f"{name} X" if axis == "x" else axis.upper()), {}),
        "a topic of ROS": (table(clock="%time", times=_times(1e9, 17 * 10**17), head="field.{}.translation.{}".format, more=[("field.header.seq", 1), ("field.header.frame_id", 0)]), {}),
        "X in capitals": (table(head=lambda name, axis: name + axis.upper()), {}),
        "Position X (mm)": (table(head=lambda name, axis: f"{name} Position {axis.upper()} (mm)", positions=BODY * 1000), {}),
        "x in front": (table(head=lambda name, axis: f"{axis}_{name}"), {}),
        "short rows": ("".join(line.rsplit(",", 3)[0] + "\n" if 20 < n < 25 else line for n, line in enumerate(table().splitlines(keepends=True))), {"tells": "4 have fewer", "near": 3e-3}),
        "comments": (table(first="# made by a tracker\n# fps: 60\n"), {}),
        "a comment in braces": (table(first="{a tracker's comment}\n"), {}),
        "sep=": (table(mark=";", first="sep=;\n"), {}),
        "decimal commas": (table(mark=";").replace(".", ","), {}),
        "tabs": (table(mark="\t"), {}),
        "nothing in words": (table(positions=late).replace(",,", ",NA,").replace(",,", ",NA,"), {"tells": "LeftHand (not seen in 83%)", "lacking": ("LeftHand",)}),
        "0 0 0 throughout": (table(positions=_without("LeftHand", 0.0)), {"tells": "LeftHand (never seen)", "lacking": ("LeftHand",)}),
        "-1 -1 -1 for some frames": (table(positions=_without("LeftHand", -1.0, slice(20, 24))), {"near": 6e-3}),
        "9999 9999 0 for some frames": (table(positions=_without("LeftHand", np.array([9999, 9999, 0.0]), slice(20, 24))), {"near": 6e-3}),
        "the last line is cut": (table()[:-60], {"frames": slice(-1), "tells": "cut off"}),
        "Motive": (_motive(), {}),
        "Motive's markers by number": (_motive_markers(), {}),
        "Motive's markers of a body called by a number": (_motive_markers(who="763", ids=[f"{n:X}:73CB" for n in range(16)]), {}),
        "Motive's markers, two without a name": (_motive_markers([*NAMES[:14], *["Unlabeled 1189"] * 2], ids=[str(n) for n in range(16)]), {"tells": "2 without a name", "lacking": NAMES[14:]}),
        "Motive's rigid bodies and their markers": (_motive("Rigid Body", "", [f"{name}:Marker {n}" for name in NAMES for n in (1, 2)]), {}),
        "Motive's markers without titles": (re.sub("(?m)^,(Type|Name|ID)", ",", _motive_markers()).replace(",7", "".join(f",{number}" for number in range(1, 17) for _ in "xyz"), 1).replace(",7", ""), {}),
        "results, angles first": (_results(), {"rate": 30.0, "tells": "frame numbers"}),
        "Vicon Nexus": (_vicon(), {}),
        "Vicon Nexus, speeds and accelerations": (_nexus(), {}),
        "Qualisys": (_qualisys(), {"ending": "tsv"}),
        "pandas": (_several_rows(NAMES, ["x", "y", "z"], (["joint"], ["axis"]), "every") + _frames(BODY, str), {"rate": 30.0, "tells": "times: none"}),
        "a row a joint": (_long("{frame},{time:.4f},{joint},{x:.4f},{y:.4f},{z:.4f}", end=",score").replace("time,joint", "timestamp,keypoint"), {}),
        "seconds beside milliseconds": (_in_front("Frame,SubFrame,seconds,ms,", lambda n, t: f"{n},0,{int(t + 0.5)},{(t + 0.5) % 1 * 1000:.3f},"), {}),
        "seconds beside nanoseconds": (_in_front("stamp.secs,stamp.nsecs,", lambda _, t: f"{17 * 10**8 + int(t + 0.5)},{int((t + 0.5) % 1 * 1e9)},"), {"near": 1e-3}),
        "whole seconds alone": (_in_front("time,", lambda n, _: f"{n // 10},"), {"rate": 10.0, "tells": "stands for several frames"}),
        "two times, the first stands": (_in_front("start time,time_ms,", lambda _, t: f"12.5,{1000 * t:.1f},"), {}),
        "SMPTE": (_in_front("Timecode,", lambda n, _: f"10:00:{(n + 30) // 60:02}:{(n + 30) % 60:02},"), {}),
        "SMPTE within one second": (_in_front("Timecode,", lambda n, _: f"10:00:01:{n:02},"), {"tells": "60 frames a second"}),
        "SMPTE of 240 frames": (_in_front("Timecode,", lambda n, _: f"10:00:{(n + 220) // 240:02}:{(n + 220) % 240:03},"), {"rate": 240.0}),
        "brackets around names": ("".join(f"{row},{0.5 if n else 'note)'}\n" for n, row in enumerate(table(clock="time(s").splitlines())), {}),
        "SMPTE with ;": (_in_front("Frame,Time,", lambda n, _: f"{n},10:00:{(n + 30) // 60:02};{(n + 30) % 60:02},"), {}),
        "dates of America": (_in_front("timestamp,", lambda _, t: f"05/01/2024 12:59:{59.5 + t if t < 0.5 else 0:09.6f} PM,".replace("12:59:00.000000", f"01:00:{t - 0.5:09.6f}")), {}),
        "dates of Germany": (_in_front("timestamp,", lambda _, t: f"01;05;2024 10:00:{t:09.6f},").replace(",", "|").replace(".", ",").replace(";", "."), {}),
        "pandas, the times named below": (_several_rows(NAMES, "xyz", (["joint"], ["axis"]), "every") + "time" + "," * 48 + "\n" + _frames(BODY, lambda place: f"{place / RATE:.6f}"), {}),
        "times of pandas": (table(times=[f"0 days 00:00:{time:09.6f}" for time in TIMES]), {}),
        "midnight": (table(clock="date,time", times=[f"05/0{1 + (time >= 0.4)}/2024,{'00:00' if time >= 0.4 else '23:59'}:{(time + 59.6) % 60:07.4f}" for time in TIMES]), {}),
        "takes joined": (_in_front("time,", lambda n, _: f"{n % 24 / RATE:.4f},"), {"tells": "starts again behind frame 24"}),
        "two people by an unknown name": (_two("who", "time", ("ann", "bob")), {"people": ("ann", "bob")}),
        "two people one after the other": ("".join(sorted(_two("who", "time", ("ann", "bob")).splitlines(keepends=True), key=lambda row: ("time" not in row, "bob" in row))), {"people": ("ann", "bob")}),
        "two people whom nothing tells apart": (_two("who", "time", ("ann", "ann")), {"reads": False, "tells": "two bodies at one time"}),
        "two people by A:": (_people("{}:{}", ("A", "B")), {"people": ("A", "B")}),
        "two people by person_1_": (_people("{}_{}", ("person_1", "person_2")), {"people": ("person_1", "person_2")}),
        "a person and a box": (table(names=[*(f"ann:{name}" for name in NAMES), "box:left", "box:right"], positions=np.concatenate([BODY, BODY[:, :2] + 0.3], axis=1)), {"tells": "subjects: ann, box: one body; --joints 'ann:*'"}),
        "two people, and a slip of the tracker": (_two("id", "time", ("1", "2")) + table(clock="time", times=["0.79"], more=[("id", 3)]).splitlines()[1] + "\n", {"people": ("1", "2"), "tells": "in one frame, or in none: 3"}),
        "times in German": (table(clock="Zeit"), {}),
        "times in Chinese": (table(clock="时间(ms)", times=[f"{time * 1000:.1f}" for time in TIMES]), {}),
        "a person's name in front": (_in_front("performer,", lambda *_: "ann,", table()), {}),
        "Vicon Nexus, all parts": (_vicon_parts() + _vicon(), {}),
        "Vicon Workstation": (_vicon_old(), {}),
        "Qualisys, without columns' names": (_qualisys(columns=False), {"ending": "tsv"}),
        "Qualisys, names of two words": (_qualisys(columns=False).replace("Left", "Left "), {"ending": "tsv", "names": tuple(name.replace("Left", "Left ") for name in NAMES)}),
        "Qualisys' skeleton": (_skeleton(), {"ending": "tsv"}),
        "names over three columns": (table(head=lambda name, axis: name if axis == "x" else ""), {}),
        "names thrice": (table(head="{0}".format), {}),
        "names thrice, by pandas": (table(head=lambda name, axis: name + {"x": "", "y": ".1", "z": ".2"}[axis]), {}),
        "axes again, by pandas": (table(clock="time", head=lambda name, axis: axis + f".{NAMES.index(name)}" * (name != NAMES[0]), first="," + ",,,".join(NAMES) + ",,\n"), {}),
        "x before a capital": (table(head=lambda name, axis: axis + name), {}),
        "an axis before Position": (table(head=lambda name, axis: f"{name}{axis.upper()}Position"), {}),
        "_xpos": (table(head="{}_{}pos".format), {}),
        "TX": (table(head=lambda name, axis: f"{name}T{axis.upper()}"), {}),
        "an axis before 3D": (table(head=lambda name, axis: f"{name}_{axis.upper()}_3D"), {}),
        "an axis around a name": (table(head=lambda name, axis: f"{axis}({name})"), {}),
        "_loc": (table(head="{}_loc_{}".format), {}),
        "two people, names again, by pandas": (table(names=[f"{who}{name}" for who in ("", ".1") for name in NAMES], head=lambda name, axis: f"{name.removeprefix('.1')}_{axis}{'.1' * (name[0] == '.')}", positions=np.concatenate([BODY, BODY + np.array([1.5, 0, 0])], axis=1)), {"people": ("0", "1")}),
        "two people by a number behind the axis": (table(names=[f"{who}{name}" for who in "12" for name in NAMES], head=lambda name, axis: f"{name[1:]}_{axis}_{name[0]}", positions=np.concatenate([BODY, BODY + np.array([1.5, 0, 0])], axis=1)), {"people": ("1", "2")}),
        "Unity's clock": (table(clock="realtimeSinceStartup"), {}),
        "milliseconds since the start": (table(clock="ms_since_start", times=[f"{time * 1000:.1f}" for time in TIMES]), {}),
        "times of three digits": (table(times=[f"{time:.3g}" for time in TIMES]), {}),
        "times of five digits from ten seconds on": (table(times=[f"{time + 9.8:.5g}" for time in TIMES]), {}),
        "a frame dropped, times of two decimals": (table(times=[f"{place / 100 + (place > 20) / 100:.2f}" for place in range(48)]), {"rate": 100.0, "body": np.insert(BODY, 21, (BODY[20] + BODY[21]) / 2, axis=0)}),
        "milliseconds behind a colon": (table(times=[f"10:00:00:{1000 * time:03.0f}" for time in TIMES]), {"near": 3e-3}),
        "axes behind names without a mark": (table(names=SIDES_LAST, head="{}{}".format), {"names": SIDES_LAST}),
        "px in front": (table(head="p{1}_{0}".format), {}),
        "x of a joint": (table(head="{1} of {0}".format), {}),
        "X-coordinate of a joint": (table(head=lambda name, axis: f"{axis.upper()}-coordinate of {name}"), {}),
        "joint X name": (table(head=lambda name, axis: f"joint_{axis.upper()}_{name}"), {}),
        "coordinates by number alone": (table(names=("pose", "hand"), positions=BODY[:, :2], head="{}_{}".format).replace("_x", "_0").replace("_y", "_1").replace("_z", "_2").replace("\n", ",pose_3,pose_4,pose_5,hand_3,hand_4,hand_5\n", 1).replace("\n", ",1,2,3,1,2,3\n").replace("hand_5,1,2,3,1,2,3", "hand_5"), {"reads": False, "tells": "positions"}),
        "bars between a person and a joint": (_people("{}|{}", ("ann", "bob")), {"people": ("ann", "bob")}),
        "times missing at the end": (table(times=[*(f"{time:.4f}" for time in TIMES[:-1]), "NaN"]), {"frames": slice(-1), "tells": "1 frames without one"}),
        "a thousand frames a second": (table(times=[f"{place / 1000:.3f}" for place in range(48)]), {"rate": 1000.0}),
        "nobody for a moment, no times": (table(clock=None, positions=np.where(np.isin(np.arange(48), (20, 21))[:, None, None], np.nan, BODY)) + "," * 47 + "\n", {"rate": 30.0, "tells": "times: none", "near": 3e-3}),
        "halves of frames": (table(clock="frame", times=[place / 2 for place in range(48)]), {"rate": 30.0, "tells": "no rate of frames"}),
        "a row of units below the names": (table(positions=BODY / 0.0254).replace("\n", "\ns" + ",in" * 48 + "\n", 1), {"near": 3e-4}),
        "times named above the axes": ("frame,time," + ",,,".join(NAMES) + ",,\n,," + ",".join([*"xyz"] * 16) + "\n" + _frames(BODY, lambda place: f"{place},{TIMES[place]:.4f}"), {}),
        "nobody at first": (table(positions=np.where(np.arange(48)[:, None, None] < 5, np.nan, BODY)), {"frames": slice(5, None), "near": 1e-3}),
        "frames per second above": ("Frames per second,60\n#freq 60\n" + table(clock="frame", times=range(48)), {}),
        "a capture rate and the export's": ("Capture Frame Rate,120,Export Frame Rate,60\n\n" + table(clock="frame", times=range(48)), {}),
        "a row a joint, the picture's places in front": (_long("{time:.4f},{joint},10,20,{x:.4f},{y:.4f},{z:.4f}").replace("10,20,x", "px,py,x"), {}),
        "a row a coordinate, Coordinate and Value": (_long("{time:.4f},{joint},{axis},{value:.4f}").replace("joint,axis,value", "Marker,Coordinate,Value"), {}),
        "a capture rate": ("Capture rate: 60 fps\n" + table(clock=None), {}),
        "nothing in a spreadsheet's words": (table(positions=late).replace(",,,", ",lost,#VALUE!,"), {"tells": "LeftHand (not seen in 83%)", "lacking": ("LeftHand",)}),
        "an axis in a word": (table(head="{} {}-axis".format), {}),
        "a row a joint, its parent's axes, too": (_long("{frame},{time:.4f},{joint},0.1,0.2,0.3,{x:.4f},{y:.4f},{z:.4f}").replace("0.1,0.2,0.3,x,y,z", "LocalPosX,LocalPosY,LocalPosZ,WorldPosX,WorldPosY,WorldPosZ"), {}),
        "a row a joint, the picture's axes, too": (_long("{frame},{time:.4f},{joint},0.1,0.2,0.3,{x:.4f},{y:.4f},{z:.4f}").replace("0.1,0.2,0.3,x,y,z", "x,y,z,world_x,world_y,world_z"), {}),
        "a row a joint, a vector in a field": (_long("{time:.4f},{joint},({x:.4f}, {y:.4f}, {z:.4f})").replace("(x, y, z)", "position"), {}),
        "a row a joint, by id": (_long("{time:.4f},{id},{x:.4f},{y:.4f},{z:.4f}", names=NAMES), {"names": tuple(map(str, range(16)))}),
        "a row a joint, joint by joint": (_long("{joint},{time:.4f},{x:.4f},{y:.4f},{z:.4f}", by="joint"), {}),
        "a row a joint, two people": (_two_long(), {"people": ("a", "b")}),
        "a row a joint, two people by name": (_two_long().replace("who", "name", 1), {"people": ("a", "b")}),
        "a row a coordinate": (_long("{time:.4f},{joint},{axis},{value:.4f}"), {}),
        "a row a coordinate, its axis in front": (_long("{time:.4f},{axis},{joint},{value:.4f}").replace("joint", "channel", 1), {}),
        "a row a coordinate, melted": (_long("{time:.4f},{joint}_{axis},{value:.4f}").replace("joint_axis", "variable"), {}),
        "a running id": (_in_front("id,", lambda n, _: f"{n},", table()), {}),
        "R's row names": (_in_front("", lambda n, _: f'"{n}",', table()), {}),
        "leading empty fields": (_in_front(",", lambda *_: ",", table()), {}),
        "bars": ("".join(f"| {line.replace(',', ' | ')} |\n" for line in table().splitlines()), {}),
        "runs of blanks": (table().replace(",", "   "), {"ending": "txt"}),
        "units: 1": ("# units: 1\n" + table(positions=BODY * 1000), {}),
        "OpenSim": ("me\nversion=1\nnRows=48\nnColumns=49\ninDegrees=no\nendheader\n" + table(mark="\t"), {"ending": "sto"}),
        "OpenSim, three in a field": (_points("{:.4f};{:.4f};{:.4f}", "DataRate=60.000\nDataType=Vec3\nendheader\n").replace(",", "\t").replace(";", ","), {"ending": "sto"}),
        "vectors in fields": (_points('"Vector3({:.4f}, {:.4f}, {:.4f})"'), {}),
        "dicts in fields": (_points("\"{{'x': {:.4f}, 'y': {:.4f}, 'z': {:.4f}}}\""), {}),
        "tuples in fields, without quotes": (_points("({:.4f}, {:.4f}, {:.4f})"), {}),
        "lists in fields": (_points('"[{:.4f}, {:.4f}, {:.4f}]"'), {}),
        "headings again": (table() + table(times=[f"{time + 0.8:.4f}" for time in TIMES]), {"body": np.concatenate([BODY, BODY])}),
        "axes by number": (table(head=lambda name, axis: f"{name}[{'xyz'.index(axis)}]"), {}),
        "a picture's places and the world's": (table(head="{}_world_{}".format, more=[(f"{n}_{a}", 0.5) for n in NAMES for a in "xyz"]), {"tells": "no positions: Hips"}),
        "the world's places behind a picture's": (table(head="{}_{}_world".format, more=[(f"{n}_{a}", 0.5) for n in NAMES for a in "xyz"]), {"tells": "no positions: Hips"}),
        "local places": (table(head="{}_global_{}".format, more=[(f"{n}_local_{a}", 0.5) for n in NAMES for a in "xyz"]), {"tells": "no positions: Hips_local"}),
        "a row a joint, translation.x": (_long("{time:.4f},{joint},{x:.4f},{y:.4f},{z:.4f}").replace("x,y,z", "translation.x,translation.y,translation.z"), {}),
        "a row a joint, the picture's axes and 3-D ones": (_long("{time:.4f},{joint},10,20,{x:.4f},{y:.4f},{z:.4f}").replace("10,20,x,y,z", "x2d,y2d,x3d,y3d,z3d"), {}),
        "a unit behind a name whose axis is in front": (table(head=lambda name, axis: f"{axis.upper()}_{name} [mm]", positions=1000 * BODY), {}),
        "the same body again, filtered": (table(names=[f"{kind}_{name}" for kind in ("raw", "filt") for name in NAMES], positions=np.concatenate([BODY, BODY + 0.002], axis=1)), {"people": ("raw",), "tells": "the same body again: filt"}),
        "names and units in brackets around axes": (_lines([["", *(name for name in NAMES for _ in "xyz")], ["Time", *"XYZ" * 16], ["(s)", *["(mm)"] * 48]], "\t") + _frames(1000 * BODY, lambda place: f"{place / RATE:.4f}", "\t"), {"ending": "txt"}),
        "a sample's time": (table(clock="SampleTimeFine", times=_times(1e6)), {}),
        "speeds by the same names": (table(names=NAMES * 2, positions=np.concatenate([BODY, 60 * np.gradient(BODY, axis=0)], axis=1)), {"tells": "no body: 1"}),
        "two people glued in front": (table(names=[f"Player{who}{name}" for who in (1, 2) for name in NAMES], head=lambda name, axis: name + axis.upper(), positions=BOTH), {"people": ("Player1", "Player2")}),
        "local places alone": (table(head=lambda name, axis: f"{name}.m_LocalPosition.{axis}"), {"names": tuple(f"{name}.m_Local" for name in NAMES), "tells": "called local"}),
        "X=0.1 Y=0.2 Z=0.3": (_points("X={:.4f} Y={:.4f} Z={:.4f}"), {}),
        "Motive, the root called like the skeleton": (_motive().replace("Ann:Hips", "Ann:Ann"), {"names": ("Hip", *NAMES[1:])}),
        "forces beside": (table(head=lambda n, a: f"{n}.Pos{a.upper()}", more=[(f"FP1.{kind}{a}", 0.5) for kind in ("Cop", "For", "Mom") for a in "XYZ"]), {"tells": "no positions: FP1.Cop"}),
        "joints' names in cells": ("Time,SkeletonId" + ",Joint,Status,PositionX,PositionY,PositionZ,RotationX,RotationY" * 16 + "\n" + "".join(f"{t:.4f},7" + "".join(f",{n},TRACKED,{x:.4f},{y:.4f},{z:.4f},0.5,0" for n, (x, y, z) in zip(NAMES, frame, strict=True)) + "\n" for t, frame in zip(TIMES, BODY.tolist(), strict=True)), {}),
        "commas within and between": (table().replace(".", ","), {"reads": False, "tells": "expected 49 fields, got 98: commas in numbers"}),
        "axes from 1": (table(head=lambda name, axis: f"{name}_{'xyz'.index(axis) + 1}", more=[(f"q_{n}", 0.5) for n in range(1, 5)]), {"tells": "no positions: q"}),
        "weights": (_points("{:.4f},{:.4f},{:.4f},1.0").replace(",".join(NAMES), ",".join(f"{n}.X,{n}.Y,{n}.Z,{n}.W" for n in NAMES)), {}),
        "turns": (table(positions=BODY * 0 + 0.5, more=[(f"{n}_w", 0.5) for n in NAMES]), {"reads": False, "tells": "positions"}),
        "turns beside": (table(more=[(f"Hips turn.{axis}", 0.5) for axis in "wxyz"]), {"tells": "no positions: Hips turn"}),
        "rate and unit after //": ("// fs=60 n=48\n// posUnit=mm\n" + table(clock=None, positions=BODY * 1000), {}),
        "single quotes": ("'" + table().replace(",", "','").replace("\n", "'\n'").removesuffix("'"), {}),
        "seconds with s": (table(times=[f"{time:.4f}s" for time in TIMES]), {}),
        "h, m, s, f": (_in_front("h,m,s,f,", lambda n, _: f"10,59,{(n + 30) // 60},{(n + 30) % 60},"), {}),
        "a height, and no clock": (_in_front("h,", lambda n, _: f"{1.5 - n % 7 / 9:.3f},"), {"rate": 30.0, "tells": "times: none"}),
        "a force, and no clock": (_in_front("f,", lambda n, _: f"{10 + 1.5 * n},"), {"rate": 30.0, "tells": "times: none"}),
        "five numbers a joint": (_points("{:.4f},{:.4f},{:.4f},0.9,0.8").replace(",".join(NAMES), ",".join(f"{n}_{k}" for n in NAMES for k in range(5))), {}),
        "Vicon Tracker": (_vicon("Objects", ("RX", "RY", "RZ", "TX", "TY", "TZ"), "rad,rad,rad,mm,mm,mm"), {}),
        "Vicon Tracker, each thing called twice": (re.sub(r"Ann:(\w+)", r"\1:\1", _vicon("Objects", ("RX", "RY", "RZ", "TX", "TY", "TZ"), "rad,rad,rad,mm,mm,mm")), {}),
        "a joint in capitals that ends like a speed": (table(names=(names := [name.upper().replace("SPINE1", "SPINE_NAVEL") for name in NAMES])), {"names": names}),
        "a speed in capitals beside": (table(names=[name.upper() for name in (*NAMES, "Left_HandVel")], positions=np.concatenate([BODY, BODY[:, 6:7] * 0.3], axis=1)), {"names": [name.upper() for name in NAMES], "tells": "no positions: LEFT_HANDVEL"}),
        "a date in the clock's first cell": (table(times=["2026-01-02", *(f"{time:.4f}" for time in TIMES[1:])]), {"frames": slice(1, None), "tells": "1 frame"}),
        "times that nothing reads": (table(times=[f"10-59-{place // 60:02}_{place:03}" for place in range(48)]), {"rate": 30.0, "tells": "times: none"}),
        "Blender's bones": (table(head=lambda name, axis: f'"pose.bones[""{name}""].location[{"xyz".index(axis)}]"'), {}),
        "Blender's vectors": (_points("<Vector ({:.4f}, {:.4f}, {:.4f})>"), {}),
        "Venus3D": ("#Venus3D CSV Data\n#Sample Rate,,60.000000\n#Units,,mm\n" + _in_front("ID,Sample,Time,", lambda n, t: f"{n},{n},{t:.6f},", table(head=lambda n, a: f"{n}({a.upper()})", clock=None, positions=1000 * BODY)), {}),
        "Visual3D": (table(clock="ITEM", mark="\t", times=range(1, 49), head=lambda _, axis: axis.upper(), first="".join("\t" + "\t".join(cell or name for name in NAMES for _ in "xyz") + "\n" for cell in ("walk.c3d", "", "TARGET", "ORIGINAL"))), {"ending": "txt", "rate": 30.0, "tells": "times: none"}),
        "a row a joint, with a class and a running id": (_long("{frame}-{id},{frame},walk,{joint},{x:.4f},{y:.4f},{z:.4f}").replace("frame-id,frame,walk", "row_id,frame,label"), {"rate": 30.0, "tells": "frame numbers"}),
        "a row a joint, sides apart": (_apart(_SIDED, "side,joint"), {"names": _SIDED}),
        "a row a joint, numbers by part": (_apart(_PARTS, "type,landmark_id"), {"names": _PARTS}),
        "a row a joint, by number and name": (_long("{time:.4f},{id},{joint},{x:.4f},{y:.4f},{z:.4f}").replace("id,joint", "joint_index,joint_name"), {}),
        "Qualisys, tabs behind": (_qualisys(columns=False).replace("\n", "\t\n"), {"ending": "tsv"}),
        "hours, minutes, seconds": (_in_front("hour,minute,second,ms,", lambda _, t: f"10,{59 if t < 0.2 else 0},{int(t + 59.8) % 60},{(t + 59.8) % 1 * 1000:.3f},".replace("10,0,", "11,0,")), {}),
        "days": (table(clock="datenum", times=[f"{45413.4 + time / 86400:.11f}" for time in TIMES]), {}),
        "seconds since 1970": (table(clock="timestamp", times=[f"{1.7e9 + time:.4f}" for time in TIMES]), {}),
        "rows in another order": ("".join(row for n in range(49) for row in [t[n + (n == 9) - (n == 10)]]) if (t := table().splitlines(keepends=True)) else "", {"tells": "another order"}),
        "rows that end behind their time": (re.sub(r"(?m)^(0\.(?:2333|2500)),.*", r"\1", table()), {"tells": "2 have fewer", "near": 2e-3}),
        "a row twice": (table().replace(row := table().splitlines(keepends=True)[9], 2 * row), {}),
        "frames a second in a comment": ("# 60 fps\n" + table(clock=None), {}),
        "a word in front": (table(head="joint.{}.{}".format), {}),
        "degrees beside": (table(more=[(f"Spine9_{axis} ({unit})", 0.5) for axis in "xyz" for unit in ("deg", "°", "N")]), {"tells": "no positions: Spine9_deg, Spine9_N"}),
        "newtons alone": (table(head=lambda name, axis: f"{name} {axis.upper()} [N]"), {"reads": False, "tells": "positions"}),
        "numbers before the names": (table(head=lambda name, axis: f"{NAMES.index(name) + 1} - {name} {axis.upper()}"), {}),
        "curves whose names stand three times": (",".join(3 * ["time", *NAMES]) + "\n" + ",".join(["0.5"] * 51) + "\n" + table().partition("\n")[2].replace("\n", ",1,2\n"), {"reads": False, "tells": "positions"}),
        "a tick of several cameras": (_long("{frame},{joint},{x:.4f},{y:.4f},{z:.4f}").replace("frame", "sync_index"), {"rate": 30.0, "tells": "frame numbers"}),
        "frames of a film": (_in_front("video_frame,", lambda n, _: f"{n + 900},"), {"rate": 30.0, "tells": "frame numbers"}),
        "commas of thousands": (re.sub(r"\b(\d)(\d{3}\.\d+)", r'"\1,\2"', table(positions=1000 * BODY)), {}),
        "apostrophes of thousands": (re.sub(r"\b(\d)(\d{3}\.\d+)", r"\1'\2", table(positions=1000 * BODY)), {}),
        "a real minus sign": (table().replace("-", "−"), {}),
        "formulas": (re.sub(r"([^,\n]+)", r'="\1"', table()), {}),
        "a rate below its name": ("Frame Rate,Units\n60,mm\n\n" + table(clock=None, positions=1000 * BODY), {}),
        "names over axes with a number": (",".join(["frame", *(cell for name in NAMES for cell in (name, "", ""))]) + "\n," + ",".join(f"{axis}{n}" for n in range(1, 17) for axis in "XYZ") + "\n" + _frames(BODY, str), {"rate": 30.0, "tells": "frame numbers"}),
        "names over the second axis": (",".join(["frame", *(cell for name in NAMES for cell in ("", name, ""))]) + "\n," + ",".join([*"xyz"] * 16) + "\n" + _frames(BODY, str), {"rate": 30.0, "tells": "frame numbers"}),
        "names over places and turns with units": (",".join(["time", *(name for name in NAMES for _ in range(6))]) + "\ns," + ",".join(["X (deg)", "Y (deg)", "Z (deg)", "X (mm)", "Y (mm)", "Z (mm)"] * 16) + "\n" + _frames(np.concatenate([BODY * 0 + 7, 1000 * BODY], axis=2), lambda place: f"{place / RATE:.6f}"), {}),
        "names over axes with a unit": (",".join(["time", *(name for name in NAMES for _ in "xyz")]) + "\ns," + ",".join(["X (mm)", "Y (mm)", "Z (mm)"] * 16) + "\n" + _frames(1000 * BODY, lambda place: f"{place / RATE:.6f}"), {}),
        "points of thousands": (re.sub(r"\.(\d)\d*", r".123.\g<1>00", table()), {"reads": False, "tells": "a spreadsheet"}),
        "rigid bodies of Motive": (_rigid(), {"names": ("Marker 1", "Marker 2"), "people": ("Front", "Back"), "body": _PELVIS[:, :2]}),
        "rigid bodies of Motive beside markers of nobody": (_rigid("Unlabeled {}"), {"names": ("Marker 1", "Marker 2"), "people": ("Front", "Back"), "body": _PELVIS[:, :2], "near": 8e-3, "tells": "4 without a name"}),
        "axes behind a number": (table(head=lambda name, axis: f"m{NAMES.index(name):03}{axis}", more=[(f"m{n:03}c", 1) for n in range(16)]), {"names": tuple(f"m{n:03}" for n in range(16))}),
        "BTS": ("BTS ASCII format\n\nType:\tPoint 3D tracks\nMeasure unit:\tm\n\nTracks:\t16\nFrequency:\t60 Hz\nFrames:\t48\n\nFrame\t" + table(clock="Time", mark="\t", head=lambda name, axis: f"{name}.{axis.upper()}").replace("\n", "\n1\t").removesuffix("1\t"), {"ending": "emt"}),
        "sensors by number": (_long("{frame},{id},{x:.4f},{y:.4f},{z:.4f},1,2,3").replace("frame,id,x,y,z,1,2,3", "Frame,Sensor,X,Y,Z,Az,El,Ro"), {"names": tuple(map(str, range(16))), "rate": 30.0, "tells": "frame numbers"}),
        "Axis Neuron": (table(clock=None, mark="\t", head="{}-Joint-Posi-{}".format, more=[(f"{n}-Sensor-Acce-{axis}", 0.5) for n in NAMES for axis in "xyz"]), {"names": tuple(f"{n}-Joint" for n in NAMES), "ending": "txt", "rate": 30.0, "tells": "no positions: Hips-Sensor-Acce"}),
        "each camera's times": (_long("{frame},{time:.4f},cameras,{joint},{x:.4f},{y:.4f},{z:.4f}").replace(",cameras,", ",\"{'cam0': 0.01}\",").replace("\"{'cam0': 0.01}\"", "time_by_camera", 1), {}),
        "a rate beside the frames": (_in_front("Frame (60 Hz),", lambda n, _: f"{n},"), {}),
        "feet alone, far away": (table(names=FEET, positions=1000 * _FEET), {"names": FEET, "body": _FEET}),
        "two people whom two cameras see": (_two_twice(), {"people": ("0_0", "0_1", "1_0", "1_1")}),
        "pairs of numbers in fields": (_lines([map(str, range(33)), *([f'"[0.7{n}, 0.1]"'] * 33 for n in range(9))]), {"reads": False, "tells": "without a row of names"}),
        "a hand alone": (table(names=HAND, positions=1000 * _HAND), {"names": HAND, "body": _HAND}),
        "a head alone": (table(names=HEAD, positions=1000 * _PELVIS), {"names": HEAD, "body": _PELVIS}),
        "Qualisys, a part of a body": (_qualisys(columns=False, body=BODY / 5), {"ending": "tsv", "body": BODY / 5}),
        "a pelvis alone": (table(names=PELVIS, positions=1000 * _PELVIS), {"names": PELVIS, "body": _PELVIS}),
    }  # fmt: skip
    return _kinds("csv", texts, encoding="utf-8") | {
        "UTF-16": Kind("csv", table(mark="\t").encode("utf-16")),
        "BOM, CRLF": Kind("csv", table().replace("\n", "\r\n").encode("utf-8-sig")),
        "tabs in a .txt": Kind("txt", table(mark="\t").encode()),
        "no names": Kind("csv", table().partition("\n")[2].encode(), "without a row of names", reads=False),
        "two dimensions": Kind("csv", table().replace("_z", "_w").encode(), "no z", reads=False),
        "angles": Kind("csv", table(head="{}_rot_{}".format).encode(), "positions", reads=False),
    }


# --- TRC -------------------------------------------------------------------------------------------------------------


def trc(
    *,
    rate: str = "60.00",
    frames: int | None = None,
    unit: str = "mm",
    first: int = 1,
    positions: NDArray[np.float64] = BODY * 1000,
) -> str:
    """Give a TRC as OpenSim writes it, empty fields where a position is NaN."""
    text, count = trc_text(NAMES, positions.round(2), rate=RATE, unit=unit, first=first), len(positions)
    return text.replace(f"60.0\t60.0\t{count}\t", f"{rate}\t{rate}\t{frames or count}\t").replace(
        "\t\t\t\n", "\t\t\n", 1
    )


def _late(text: str) -> str:
    """Put a marker behind the others of a TRC that nothing names, from the ninth frame on."""
    rows = text.splitlines(keepends=True)
    return "".join([*rows[:-40], *(row.replace("\n", "\t139.604\t565.547\t1063.723\n") for row in rows[-40:])])


def _trcs() -> dict[str, Kind]:
    gone, late = _without("RightFoot", np.nan) * 1000, _without("LeftHand", np.nan, slice(0, 40)) * 1000
    short = _without("RightFoot", np.nan, slice(30, 34)) * 1000
    gone_at_first = np.where(np.arange(len(BODY))[:, None, None] < 34, np.nan, BODY)
    heads = "\t\t\t".join(NAMES)
    texts = {
        "header and times differ": (trc(rate="600.00"), {"tells": "600 frames a second"}),
        "rate 0": (trc(rate="0"), {}),
        "a rate a little beside the times": (trc(rate="59.94"), {}),
        "counts in the singular": (trc().replace("NumFrames\tNumMarkers", "NumFrame\tNumMarker", 1), {}),
        "points of thousands": (re.sub(r"\.(\d)\d*", r".123.\g<1>00", trc()), {"reads": False, "tells": "a spreadsheet"}),
        "a frame more": (trc(frames=len(BODY) - 1), {"tells": "the header says 47, there are 48"}),
        "X5": (trc(first=5), {}),
        "X0": (trc(first=0), {}),
        "labels by spaces": (trc().replace(heads, "   ".join(NAMES)), {}),
        "another word for the rate": (trc().replace("DataRate", "Rate", 1), {}),
        "the first frame cut short": (trc(positions=np.where(np.arange(len(NAMES))[:, None] == len(NAMES) - 1, np.where(np.arange(len(BODY))[:, None, None] == 0, np.nan, BODY), BODY) * 1000).replace("\t\n2\t", "\n2\t", 1), {"near": 3e-2}),
        "one tab between labels": (trc().replace(heads, "\t".join(NAMES)), {}),
        "tabs trimmed": ("\n".join(line.rstrip("\t") for line in trc(positions=short).split("\n")), {"near": 3e-3}),
        "never seen": (trc(positions=gone), {"tells": "RightFoot (never seen)", "lacking": ("RightFoot",)}),
        "seen late": (trc(positions=late), {"tells": "LeftHand (not seen in 83%)", "lacking": ("LeftHand",)}),
        "decimal commas": (trc().replace(".", ","), {}),
        "a marker behind all names, late": (_late(trc()), {"tells": "columns: 3 behind all names"}),
        "a marker without a name": (trc().replace("\tRightLeg\t", "\t\t"), {"lacking": ("RightLeg",), "tells": "1 without a name"}),
        "the first marker without a name": (trc().replace("\tHips\t", "\t\t"), {"lacking": ("Hips",), "tells": "1 without a name"}),
        "angles": (trc(unit="rad"), {"reads": False, "tells": "numbers in rad"}),
        "markers without names behind": ("\n".join(line + "\t1\t2\t3" * (n > 5) for n, line in enumerate(trc().splitlines())), {"tells": "columns: 3 behind all names"}),
        "columns that are neither named nor counted": (re.sub(r"\t+LeftUpLeg.*", "", trc()).replace("\t" + "\t".join(f"{axis}{number}" for number in range(11, 17) for axis in "XYZ"), ""), {"lacking": NAMES[10:], "tells": "columns: 18 behind all names"}),
        "an empty unit": (trc(unit=""), {}),
        "no unit": (trc(unit="?"), {"tells": "units"}),
        "metres, cut to four letters": (trc(unit="mete", positions=BODY), {"near": 6e-3}),
        "Windows' NaN": (re.sub(r"(?m)^(\d+\t\d.*\d)\t\t\t$", "\\1\t-nan(ind)\t-1.#IND\tNaN", trc(positions=gone)), {"tells": "never seen", "lacking": ("RightFoot",)}),
        "spaces between all": (trc().replace("\t\t\t", " ").replace("\t", " "), {}),
        "a label for each axis": (trc().replace(heads, "\t".join(f"{name}_{axis}" for name in NAMES for axis in "xyz")), {}),
        "tabs behind": (trc().replace("\n", "\t\t\t\n"), {}),
        "two tabs more in front": (trc().replace("Time\t", "Time\t\t\t"), {}),
        "a label twice": (trc().replace("RightLeg", "LeftLeg"), {"tells": "twice: LeftLeg: the second is called LeftLeg_2", "lacking": ("RightLeg",)}),
        "a label twice, of which one is below the header's counts": (trc().replace("RightLeg", "Hips"), {"tells": "twice: Hips: the second is called Hips_2", "lacking": ("RightLeg",)}),
        "nobody at last, tabs trimmed": ("\n".join(line.rstrip("\t") for line in trc(positions=np.where(np.arange(48)[:, None, None] > 44, np.nan, 1000 * BODY)).split("\n")), {"frames": slice(45)}),
        "small letters behind a subject": (trc().replace(heads, "\t\t\t".join(f"an:{name.lower()}" for name in NAMES)), {"names": tuple(map(str.lower, NAMES))}),
        "one tab between labels, the last never seen, tabs trimmed": ("\n".join(line.rstrip("\t") for line in trc(positions=gone).replace(heads, "\t".join(NAMES)).split("\n")), {"tells": "RightFoot (never seen)", "lacking": ("RightFoot",)}),
        "brackets in names": (trc().replace(heads, "\t\t\t".join(f"{name} (a)" for name in NAMES)), {"names": tuple(f"{name} (a)" for name in NAMES)}),
        "Latin letters": (trc().replace("Head", "Schädel"), {"lacking": ("Head",)}),
        "two tabs between the header's numbers": (trc().replace("60.00\t60.00\t48\t16\tmm", " 60.0\t\t 60.0\t\t 48\t\t 16\t\t mm"), {}),
        "a header without the unit": (trc().replace("\tmm\t", "\t"), {}),
        "the header's values beside their names": (trc().replace(trc().split("\n", 3)[1], "DataRate\t60\tNumFrames\t48\tUnits\tmm").replace(trc().split("\n", 3)[2], ""), {}),
        "a label thrice": (trc().replace(heads + "\t\t", "\t".join(name for name in NAMES for _ in range(3))), {}),
        "blank lines, comments": ("\n# made by a tool\n" + trc().replace("\n", "\n\n"), {}),
        "names two tabs apart, times of five digits": (re.sub(r"0\.\d{6,}", lambda time: f"{float(time[0]):.5g}", trc().replace("\t\t\t", "\t\t").replace("Time\t", "Times\t\t").replace("\n\t\tX1", "\n\t\t\tX1")), {}),
        "names that end in axes": (trc().replace("LeftLeg", "LeftX"), {"lacking": ("LeftLeg",)}),
        "angles among the markers": (trc().replace("RightFoot", "LKneeAngles"), {"lacking": ("RightFoot",), "tells": "no positions: LKneeAngles"}),
        "axes led by blanks, numbers padded": (trc().replace("\t\tX1", "          X1").replace("60.00\t60.00\t48", "   60.0\t   60.0\t     48"), {}),
        "blanks behind a subject's colon": (trc().replace(heads, "\t\t\t".join(f"Ann: {name}" for name in NAMES)), {}),
        "commas between": (trc().replace("\t", ","), {}),
        "an empty line of commas": (trc().replace("\n1\t", "\n" + "\t" * 50 + "\n1\t", 1).replace("\t", ","), {}),
        "markers that are named and never written": (trc().replace(heads, heads + "\t\t\tV_Mid_Hip\t\t\tV_Head"), {}),
        "more names than markers are announced": (trc().replace("\t48\t16\t", "\t48\t10\t"), {}),
        "quotes": (trc().replace("Hips", '"Hips"').replace("LeftLeg", '"LeftLeg"'), {}),
        "no numbers of frames": ("".join(row.partition("\t")[2] if n > 2 else row for n, row in enumerate(trc().splitlines(keepends=True))), {}),
        "nobody at first, tabs trimmed": ("\n".join(line.rstrip("\t") for line in trc(positions=gone_at_first * 1000).split("\n")), {"tells": "0.00 to 0.57 s", "frames": slice(34, None)}),
        "nobody at first": (trc(positions=gone_at_first * 1000), {"tells": "0.00 to 0.57 s", "frames": slice(34, None)}),
        "in a .csv": (trc().replace("\t", ","), {"ending": "csv"}),
    }  # fmt: skip
    return _kinds("trc", texts, "TRC, ")


# --- BVH -------------------------------------------------------------------------------------------------------------


def _bvh_body(*, moves: bool = False, metres: float = 1.0) -> tuple[Node, NDArray[np.float64]]:
    """Give a hierarchy of the body's joints, and frames of small turns; every joint may have position channels."""
    above = dict(zip(NAMES[1:], (0, 1, 2, 2, 4, 5, 2, 7, 8, 0, 10, 11, 0, 13, 14), strict=True))
    nodes = [
        Node(
            NAMES[index],
            tuple((BODY[0, index] - (BODY[0, above[NAMES[index]]] if index else 0)) / metres),
            (*MOVES, *TURNS) if moves or not index else TURNS,
        )
        for index in range(16)
    ]
    for index in range(1, 16):
        nodes[above[NAMES[index]]].children.append(nodes[index])
    for node in nodes:
        if not node.children:
            node.children.append(Node(f"{node.name}_end", (0.0, 0.1 / metres, 0.0)))
    channels = [name for node in nodes[0].all() for name in node.channels]
    frames = np.random.default_rng(4).uniform(-20, 20, (len(BODY), len(channels)))
    frames[:, [name in MOVES for name in channels]] = 0.0
    frames[:, :3] = 0.1 / metres, 1.0 / metres, 0.2 / metres
    return nodes[0], np.round(frames, 4)


def _bvh_in(metres: float) -> str:
    root, frames = _bvh_body(metres=metres)
    return bvh_text(root, frames.tolist(), period="0.0166667")


def _bvhs() -> dict[str, Kind]:
    plain = _bvh_in(1.0)
    moving, moved = _bvh_body(moves=True)
    still = bvh_text(moving, moved.tolist(), period="0.0166667")
    glitch, noise = moved.copy(), moved.copy()
    glitch[20, 7] = 0.01
    noise[:, 6:9] = 1e-7
    head, motion = plain.split("Frame Time")
    scene, staged = _bvh_body(moves=True)
    for node in scene.all():
        node.offset = (100 * node.offset[0], 100 * node.offset[1], 100 * node.offset[2])
    staged[:, :3] *= 100
    staged[:, 0] += 800
    scene = Node(
        "Reference",
        (0.0, 0.0, 0.0),
        (*MOVES, *TURNS),
        [scene, Node("Sword", (750.0, 0.0, 0.0), TURNS, [Node("SwordTip", (0.0, 90.0, 0.0))])],
    )
    staged = np.hstack([np.tile([-800.0, 0, 0, 0, 0, 0], (48, 1)), staged, np.zeros((48, 3))])
    twice = plain.replace("MOTION", plain.removeprefix("HIERARCHY\n").partition("MOTION")[0] + "MOTION")
    texts = {
        "plain": (plain, {}),
        "inches": (_bvh_in(0.0254), {}),
        "Acclaim's unit": (_bvh_in(0.0254 / 0.45), {}),
        "a frame more": (plain.replace("Frames: 48", "Frames: 47"), {"tells": "the header says 47, there are 48"}),
        "a frame less": (plain.replace("Frames: 48", "Frames: 100"), {"tells": "the header says 100, there are 48"}),
        "the last line is cut": (plain[:-40], {"tells": "cut off", "frames": slice(-1)}),
        "Frame Time 0": (plain.replace("Time: 0.0166667", "Time: 0"), {"options": (("frame_rate", RATE),)}),
        "Frame Time 0, no rate": (plain.replace("Time: 0.0166667", "Time: 0"), {"reads": False, "tells": "--frame-rate"}),
        "decimal commas": (plain.replace(".", ","), {}),
        "commas between": (head + "Frame Time" + motion.replace(" ", ", ").replace(":, ", ": "), {}),
        "glued": (head + "Frame Time" + motion.replace(" -", "-"), {}),
        "positions of nothing": (still, {}),
        "one small position": (bvh_text(moving, glitch.tolist(), period="0.0166667"), {}),
        "noise for positions": (bvh_text(moving, noise.tolist(), period="0.0166667"), {}),
        "positions of a scene, its reference and a sword": (bvh_text(scene, staged.tolist(), period="0.0166667"), {}),
        "a name twice": (plain.replace("JOINT RightLeg", "JOINT LeftLeg"), {"tells": "twice: LeftLeg", "lacking": ("RightLeg",)}),
        "comments": ("# made by a tool\n" + plain.replace("MOTION", "// its frames\nMOTION"), {}),
        "scales beside positions": (bvh_text(moving, moved.tolist(), period="0.0166667").replace("CHANNELS 6", "CHANNELS 7 Xscale", 1).replace("\n0.1", "\n1 0.1"), {}),
        "frames a second for Frame Time": (plain.replace("Time: 0.0166667", "Time: 60"), {"tells": "taken for 60 frames a second"}),
        "milliseconds for Frame Time": (plain.replace("Time: 0.0166667", "Time: 16.6667"), {"tells": "taken for 60 frames a second"}),
        "no colon": (plain.replace("Frames:", "Frames").replace("Time:", "Time"), {}),
        "the rate first": (plain.replace("Frames: 48\nFrame Time: 0.0166667", "FrameTime = 0.0166667 s\nFrames = 48"), {}),
        "all in MOTION's line": (plain.replace("MOTION\n", "MOTION ").replace("48\n", "48 "), {}),
        "no Frame Time": (plain.replace("Frame Time: 0.0166667\n", ""), {"options": (("frame_rate", RATE),)}),
        "semicolons between": (head + "Frame Time" + motion.replace(" ", ";").replace(":;", ": "), {}),
        "colons, and names in quotes": (plain.replace("HIERARCHY", "HIERARCHY:").replace("MOTION", "MOTION:").replace("JOINT Head", 'JOINT "Head"'), {}),
        "a Frame Time that is cut": (plain.replace("Time: 0.0166667", "Time: 0.0166"), {}),
        "a Frame Time of three digits": (plain.replace("Time: 0.0166667", "Time: 0.017"), {}),
        "frames over lines": (head + "Frame Time" + re.sub(r"((?: \S+){7})", r"\1\n", motion.replace(": ", ":")).replace(":", ": "), {}),
        "the hierarchy on one line": (re.sub(r"\s*\n\s*", " ", plain.partition("MOTION")[0]) + "\nMOTION" + plain.partition("MOTION")[2], {}),
        "in a .txt": ("\n" + plain, {"ending": "txt"}),
        "two ROOTs": ("".join(f"{row[:-1]} {row}" if row[0] in "-0123456789" else row for row in twice.splitlines(keepends=True)), {"people": ("Hips", "Hips_2")}),
        "Latin letters": (plain.replace("JOINT Head", "JOINT Schädel"), {"lacking": ("Head",)}),
    }  # fmt: skip
    # The order of the hierarchy is not that of NAMES, and a 'still' file has other turns than a plain one.
    # The order of the hierarchy is not that of NAMES, and a 'still' file has other turns than a plain one.
    return _kinds("bvh", texts, "BVH, ") | {
        "BVH, Shift-JIS": Kind("bvh", plain.replace("JOINT Head", "JOINT 頭").encode("cp932"), lacking=("Head",))
    }


# --- C3D -------------------------------------------------------------------------------------------------------------


def _vax(values: NDArray[np.float32]) -> bytes:
    """Write numbers as DEC's machines did: four times as large, their two words exchanged."""
    return (values.astype("<f4") * 4).astype("<f4").view("<u2").reshape(-1, 2)[:, ::-1].astype("<u2").tobytes()


def c3d(  # noqa: PLR0913 - a file may differ in many ways
    *,
    processor: int = 84,
    whole: bool = False,
    labels: Sequence[str] = NAMES,
    positions: NDArray[np.float64] = BODY,
    unit: str = "mm",
    rates: tuple[float, float] = (RATE, RATE),
    said: int | None = None,
    analog: int = 0,
    used: int | None = None,
) -> bytes:
    """Give a C3D: whole numbers or reals of Intel's (84), DEC's (85) or MIPS' (86) processors; NaN as residual -1.

    `rates` are the header's and POINT:RATE (0: none); `said` frames instead of those that are there; `used` is
    ANALOG:USED.
    """
    order = ">" if processor == 86 else "<"

    def real(*numbers: float) -> bytes:
        values = np.array(numbers, np.float32)
        return _vax(values) if processor == 85 else values.astype(f"{order}f4").tobytes()

    def entry(name: str, group: int, *fields: bytes) -> bytes:
        rest = b"".join(fields)
        return struct.pack("bb", len(name), group) + name.encode() + struct.pack(f"{order}h", len(rest) + 2) + rest

    def parameter(name: str, kind: int, sizes: Sequence[int], content: bytes) -> bytes:
        return entry(name, 1, struct.pack("bB", kind, len(sizes)), bytes(sizes), content, b"\0")

    frames, scale = len(positions), 0.1 if whole else -1.0
    width = max(map(len, labels))
    said_frames = struct.pack(f"{order}H", (said or frames) & 0xFFFF)
    texts = [
        parameter("UNITS", -1, [len(unit)], unit.encode()),
        parameter("USED", 2, [], struct.pack(f"{order}H", len(labels))),
    ]
    texts += [parameter("SCALE", 4, [], real(scale)), parameter("FRAMES", 2, [], said_frames)]
    texts += [parameter("RATE", 4, [], real(rates[1]))] if rates[1] else []
    texts += [parameter("LABELS", -1, [width, len(labels)], "".join(label.ljust(width) for label in labels).encode())]
    if used is not None:
        content = struct.pack("bB", 2, 0) + struct.pack(f"{order}H", used) + b"\0"
        texts += [entry("ANALOG", -2, b"\0"), entry("USED", 2, content)]
    parameters = entry("POINT", -1, b"\0") + b"".join(texts) + b"\0\0"
    blocks = -(-(len(parameters) + 4) // 512)
    header = struct.pack(f"{order}BBHHHHH", 2, 0x50, len(labels), analog, 1, (said or frames) & 0xFFFF, 10)
    header += real(scale) + struct.pack(f"{order}HH", 2 + blocks, int(analog > 0)) + real(rates[0])
    gone = np.isnan(positions).any(axis=2)
    numbers = np.zeros((frames, len(labels), 4))
    numbers[:, :, :3] = np.where(gone[:, :, None], 0, positions * {"mm": 1000, "mete": 1, "cm": 100}.get(unit, 1000))
    numbers[:, :, 3] = np.where(gone, -1, 0)
    rows = np.concatenate([numbers.reshape(frames, -1), np.full((frames, analog), 3.0)], axis=1)
    if whole:
        rows[:, : 4 * len(labels)] = np.round((numbers * [10, 10, 10, 1]).reshape(frames, -1))
        content = rows.astype(f"{order}i2").tobytes()
    else:
        content = real(*rows.ravel())
    content += b"\0" * (-len(content) % 512)
    return (
        header.ljust(512, b"\0")
        + (bytes([1, 0x50, blocks, processor]) + parameters).ljust(512 * blocks, b"\0")
        + content
    )


def _theia(points: Sequence[str] = ()) -> bytes:
    """Let ezc3d write what Theia does: a matrix for each segment in place of points, or behind them."""
    matrices = np.zeros((4, 4, len(NAMES), len(BODY)))
    matrices[:] = np.eye(4)[:, :, None, None]
    matrices[:3, 3] = 1000 * BODY.transpose(2, 1, 0)
    made = ezc3d.c3d()
    made["parameters"]["POINT"]["RATE"]["value"], made["parameters"]["POINT"]["UNITS"]["value"] = [RATE], ["mm"]
    made["parameters"]["POINT"]["LABELS"]["value"] = list(points)
    made["data"]["points"], made["data"]["rotations"] = matrices[:, 3, : len(points)], matrices
    for name, value in (("RATE", [RATE]), ("USED", [len(NAMES)]), ("LABELS", list(NAMES))):
        made.add_parameter("ROTATION", name, value)
    with tempfile.TemporaryDirectory() as folder:
        made.write(f"{folder}/theia.c3d")
        return Path(folder, "theia.c3d").read_bytes()


def _at(place: int, these: bytes, content: bytes = b"") -> bytes:
    """Give a C3D with other bytes in its header."""
    return (content := content or c3d())[:place] + these + content[place + len(these) :]


def _whole_rate(size: int) -> bytes:
    """Give a C3D whose POINT:RATE is a whole number of one byte or two, and whose header says none."""
    real = struct.pack("bb", 4, 1) + b"RATE" + struct.pack("<hbBf", 9, 4, 0, RATE) + b"\0"
    whole = struct.pack("bb", 4, 1) + b"RATE" + struct.pack("<hbB", 5 + size, size, 0) + bytes([60, 0])[:size] + b"\0"
    begin, mark, end = c3d(rates=(0, RATE)).partition(real)
    labels, less = end.find(b"\0\0\0\0"), len(real) - len(whole)
    return begin + (whole if mark else b"") + end[:labels] + b"\0" * less + end[labels:]


def _unseen() -> bytes:
    """Give a C3D whose residuals say that no marker was seen."""
    begin = len(content := c3d()) - len(BODY) * len(NAMES) * 16
    numbers = np.frombuffer(content[begin:], "<f4").reshape(-1, 4) - np.array([0, 0, 0, 1], np.float32)
    return content[:begin] + numbers.tobytes()


def _damaged(content: bytes, kind: str) -> bytes:
    """Give a C3D with a parameter behind the others that holds more than the file's parameters have room for."""
    end, begin = content.index(kind.encode()) - 2, 512 * (struct.unpack("<H", content[16:18])[0] - 1)
    beyond = struct.pack("bb", 6, 1) + b"VALUES" + struct.pack("<hbB", 20_405, 4, 2) + bytes([255, 20])
    return (content[:end] + beyond).ljust(begin, b"\1")[:begin] + content[begin:]


def _japanese() -> bytes:
    """Give a C3D whose labels are in Shift-JIS."""
    content = c3d(labels=[f"Q{number:02}QQQ" for number in range(16)])
    for number, name in enumerate(JAPANESE):
        content = content.replace(f"Q{number:02}QQQ".encode(), name.encode("cp932").ljust(6))
    return content


def _scaled(said: float, content: bytes) -> bytes:
    """Give a C3D whose two scales say whole numbers where there are reals."""
    return content.replace(struct.pack("<f", -1.0), struct.pack("<f", said), 2)


def _c3ds() -> dict[str, Kind]:
    many = np.repeat(BODY[:, :2], 1500, axis=0)
    late, both = _without("LeftHand", np.nan, slice(0, 40)), _without("LeftHand", 0.0)
    nobody = BODY.copy()
    nobody[:34] = np.nan
    kinds = {
        f"{maker}, {'whole numbers' if whole else 'reals'}": (c3d(processor=processor, whole=whole, analog=4), {})
        for processor, maker in ((84, "Intel"), (85, "DEC"), (86, "MIPS"))
        for whole in (False, True)
    } | {
        "the rate in the header alone": (c3d(rates=(RATE, 0)), {}),
        "the rate in POINT alone": (c3d(rates=(0, RATE)), {}),
        "a whole number for the rate": (_whole_rate(2), {}),
        "a byte for the rate": (_whole_rate(1), {}),
        "no rate": (c3d(rates=(0, 0)), {"reads": False, "tells": "--frame-rate"}),
        "unit of four letters": (c3d(unit="mete"), {}),
        "unknown unit": (c3d(unit="xx"), {"tells": "units"}),
        "a label twice": (c3d(labels=[name.replace("RightLeg", "LeftLeg") for name in NAMES]), {"tells": "twice: LeftLeg", "lacking": ("RightLeg",)}),
        "never seen": (c3d(positions=both), {"tells": "LeftHand (never seen)", "lacking": ("LeftHand",)}),
        "seen late": (c3d(positions=late), {"tells": "LeftHand (not seen in 83%)", "lacking": ("LeftHand",)}),
        "nobody at first": (c3d(positions=nobody), {"tells": "0.00 to 0.57 s", "frames": slice(34, None)}),
        "9999": (c3d(positions=_without("LeftHand", 9.999, slice(20, 24))), {"near": 6e-3}),
        "more frames than 16 bits": (c3d(positions=many, labels=NAMES[:2], whole=True, said=65_535), {"tells": "there are 72000", "names": ()}),
        "frames modulo 65,536": (c3d(positions=many, labels=NAMES[:2], whole=True, said=72_000 - 65_536), {"tells": "there are 72000", "names": ()}),
        "cut off": (c3d()[:-4000], {"tells": "the header says 48", "frames": slice(0, 32)}),
        "two people": (c3d(labels=[f"{who}:{name}" for who in "AB" for name in NAMES], positions=BOTH), {"people": ("A", "B")}),
        "two people whose labels are the same": (c3d(labels=NAMES * 2, positions=BOTH), {"people": ("0", "1")}),
        "two people glued in front, in capitals": (c3d(labels=[f"S{who}{name.upper()}" for who in (1, 2) for name in NAMES], positions=BOTH), {"people": ("S1", "S2"), "names": [name.upper() for name in NAMES]}),
        "two people, one never seen": (c3d(labels=[f"{who}:{name}" for who in "AB" for name in NAMES], positions=np.concatenate([BODY, np.full_like(BODY, np.nan)], axis=1)), {"people": ("A",), "tells": "never seen: B"}),
        "no last frame in the header": (_at(8, b"\0\0"), {"tells": "the header says 0"}),
        "no last frame, and matrices behind": (_at(8, b"\0\0", _theia(NAMES)), {"tells": "the header says 0"}),
        "frame numbers beyond 16 bits": (_at(6, struct.pack("<HH", 65_500, 11)), {}),
        "first and last frame exchanged": (_at(6, struct.pack("<HH", 10, 5)) + b"\0" * 512, {"tells": "there are 48"}),
        "fewer frames in the header": (_at(8, b"\x1e\0"), {"tells": "the header says 30, there are 48"}),
        "fewer points in the header": (_at(2, b"\x0a\0"), {}),
        "a scale of whole numbers in the header": (_at(12, struct.pack("<f", 0.1)), {}),
        "no block of frames in the header": (_at(16, b"\0\0"), {}),
        "a name that goes on behind a NUL": (c3d(labels=[name.ljust(14, "\0") for name in NAMES]).replace(b"Head\0\0\0", b"Head\0zz"), {}),
        "residuals of nothing beside places": (_unseen(), {"tells": "residuals"}),
        "angles that nothing lists, markers without names": (c3d(labels=[*NAMES, "LHipAngles", "RKneePower", "*12", "Unlabeled_2012", "uname*1"], positions=np.concatenate([BODY, BODY[:, :5] + 3], axis=1)), {"tells": "without a name"}),
        "more points in the header, and matrices behind": (_at(2, b"\x54\0", _theia(NAMES)), {}),
        "more events than the header has places": (_at(300, b"\x39\x30"), {}),
        "no points in the header": (_at(2, b"\0\0"), {}),
        "fewer labels than points": (c3d().replace(b"\xff\x02\x0c\x10", b"\xff\x02\x0c\x0e"), {"tells": "2 without a name", "lacking": NAMES[14:]}),
        "no labels": (c3d().replace(b"\xff\x02\x0c\x10", b"\xff\x02\x0c\x00"), {"names": tuple(f"*{number}" for number in range(1, 17))}),
        "Theia's matrices": (_theia(), {}),
        "nothing before the header": (b"\0" * 512 + c3d(), {}),
        "another kind of processor": (_at(512 + 3, b"\1"), {}),
        "no count of parameters' blocks": (_at(512 + 2, b"\0"), {}),
        "a parameter beyond the others' blocks": (_damaged(c3d(used=0), "ANALOG"), {"tells": "parameters: one is damaged"}),
        "labels in Shift-JIS": (_japanese(), {"names": JAPANESE}),
        "more other numbers in the header": (_at(4, b"\x03\0", c3d(used=0)), {}),
        "no other numbers in the header": (_at(4, b"\0\0", c3d(analog=4, used=4)), {}),
        "scales of whole numbers for reals": (_scaled(1.0, c3d(analog=4)), {}),
        "no points": (c3d(labels=NAMES[:1], positions=BODY[:, :1]), {"reads": False, "tells": "points"}),
    }  # fmt: skip
    return {f"C3D, {name}": Kind("c3d", content, **said) for name, (content, said) in kinds.items()}  # type: ignore[arg-type]


KINDS = {**_tables(), **_trcs(), **_bvhs(), **_c3ds()}
