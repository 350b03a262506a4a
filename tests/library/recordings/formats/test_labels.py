"""Labels of continuous takes: read, refused, and the clips cut by them."""

import dataclasses
import json
import math
import re
from itertools import pairwise
from pathlib import Path

import naive_windows
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import stick_clip

from kinespace.library.clip import Clip
from kinespace.library.recordings.formats.labels import LabelError, Segment, cut, labels_beside, oddities, read_labels

HEADER = "start_s,end_s,label\n"


def _take(frames: int = 100, frame_rate: float = 50.0) -> Clip:
    clip = stick_clip("wave", frames=frames, actor="bb")
    return dataclasses.replace(
        clip, frame_rate=frame_rate, name="evening", rotations=np.arange(2.0 * frames).reshape(-1, 2)
    )


# --- segments ----------------------------------------------------------------------------------------------------


_TIMELESS = ((1.0, 1.0), (2.0, 1.0), (-0.1, 1.0), (0.0, math.inf), (math.nan, 1.0), (0.0, math.nan))


@pytest.mark.parametrize(("start", "end", "label"), [*((*each, "wave") for each in _TIMELESS), (0.0, 1.0, "")])
def test_a_segment_without_time_or_label_is_refused(start: float, end: float, label: str) -> None:
    """A segment that does not end after it starts, starts before 0, has no finite end or no label is refused."""
    with pytest.raises(ValueError, match="segment: expected 0 <= start < end" if label else "label: expected a name"):
        Segment(start, end, label)


# --- reading -----------------------------------------------------------------------------------------------------

_ONE = (Segment(0.0, 1.0, "Übung"),)
_TWO = (Segment(0.5, 2.25, "wave"), Segment(62.5, 64.0, "bow low"))
_ELAN = """<?xml version="1.0" encoding="UTF-8"?>
<ANNOTATION_DOCUMENT><TIME_ORDER><TIME_SLOT TIME_SLOT_ID="a" TIME_VALUE="500"/>
<TIME_SLOT TIME_SLOT_ID="b" TIME_VALUE="1250"/></TIME_ORDER><TIER TIER_ID="x" PARTICIPANT="ann"><ANNOTATION>
<ALIGNABLE_ANNOTATION ANNOTATION_ID="1" TIME_SLOT_REF1="a" TIME_SLOT_REF2="b"><ANNOTATION_VALUE>wave</ANNOTATION_VALUE>
</ALIGNABLE_ANNOTATION></ANNOTATION></TIER></ANNOTATION_DOCUMENT>"""


def _boris(*events: list[object], **observations: object) -> str:
    """Give a project of BORIS with some events, and a behaviour that lasts no time."""
    kinds = {"0": {"code": "blink", "type": "Point event"}, "1": {"code": "bow", "type": "State event"}}
    return json.dumps({"behaviors_conf": kinds, "observations": observations or {"monday": {"events": events}}})


#: Files as people's programs write them, and their segments.
READ: dict[str, tuple[str, str | bytes, tuple[Segment, ...]]] = {
    "any order, spaces, quotes, blank lines": (
        "take.csv",
        HEADER + '2.5,3,bow\n\n0,1.25, wave \n1.25,2.5,"rest, long"\n',
        (Segment(0.0, 1.25, "wave"), Segment(1.25, 2.5, "rest, long"), Segment(2.5, 3.0, "bow")),
    ),
    "byte order mark": ("take.csv", b"\xef\xbb\xbfstart_s,end_s,label\n0,1,\xc3\x9cbung\n", _ONE),
    "Windows": ("take.csv", "start_s,end_s,label\r\n0,1,Übung\r\n", _ONE),
    "Latin-1": ("take.csv", (HEADER + "0,1,Übung\n").encode("latin-1"), _ONE),
    "UTF-16, no last line end": ("take.csv", (HEADER + "0,1,Übung").encode("utf-16"), _ONE),
    "other columns, other order": ("take.csv", "label,who,end_s,start_s\nÜbung,me,1,0\n", _ONE),
    "quoted, cells too many": ("take.csv", '"start_s","end_s","label"\n"0","1e0","Übung",,\n', _ONE),
    "semicolons": ("take.csv", "start_s;end_s;label\n0.5;2.25;wave\n62.5;64;bow low\n", _TWO),
    "decimal commas": ("take.csv", "start_s;end_s;label\n0,5;2,25;wave\n62,5;64,0;bow low\n", _TWO),
    "tabs": ("take.csv", "start_s\tend_s\tlabel\n0.5\t2.25\twave\n62,5\t64\tbow low\n", _TWO),
    "Audacity with frequencies, a moment, a region without a name": (
        "take.txt",
        "0.500000\t2.250000\twave\n\\\t20.5\t300.0\n3.000000\t3.000000\tclap\n62.5\t64.0\tbow low\n70.0\t71.0\t\n",
        _TWO,
    ),
    "Audacity by hand": ("take.txt", "0\t1\tÜbung\n", _ONE),
    "ELAN": ("take.eaf", _ELAN, (Segment(0.5, 1.25, "wave", "ann"),)),
    "BORIS, in no order, subjects": (
        "take.boris",
        _boris(
            *([1.25, "ann", "wave", "", ""], [0.5, "ann", "wave", "", ""]),
            *([2, "No focal subject", "bow"], [3, "No focal subject", "bow"]),
        ),
        (Segment(0.5, 1.25, "wave", "ann"), Segment(2.0, 3.0, "bow")),
    ),
    "BORIS, point events": (
        "take.boris",
        _boris([1.0, "ann", "blink"], [1.5, "ann", "bow"], [2.0, "ann", "blink"], [3.0, "ann", "bow"]),
        (Segment(1.5, 3.0, "bow", "ann"),),
    ),
}


def _written(folder: Path, name: str, content: str | bytes) -> Path:
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return folder / name


@pytest.mark.parametrize("kind", READ)
def test_labels_of_every_kind_are_read(tmp_path: Path, kind: str) -> None:
    """In order of time, with their performers, and they are found beside a take."""
    name, content, expected = READ[kind]
    path = _written(tmp_path, name, content)
    assert read_labels(path) == expected
    assert labels_beside(path.with_suffix(".amc")) == [path]


_NEITHER = ".*: expected annotations of ELAN or events of BORIS"
_COLUMNS = ": expected the columns start_s, end_s, label, got none called"
#: Files that make no sense, and what is said behind their name: the line is an editor's.
WRONG: list[tuple[str, str | bytes, str]] = [
    *(
        ("take.csv", f"{HEADER}0,1,bow\n\n{line}\n5,6,bow\n", f":4: {said}")
        for line, said in (
            ("x,4,wave", "start, end: expected seconds, got 'x', '4'"),
            ("3,,wave", "start, end: expected seconds, got '3', ''"),
            ('3,"4,5",wave', "start, end: expected seconds, got '3', '4,5'"),
            ("4,3,wave", "segment: expected 0 <= start < end, got 4.0 to 3.0"),
        )
    ),
    ("take.csv", "", f"{_COLUMNS} start_s, end_s, label"),
    ("take.csv", "start_s,end_s\n0,1\n", f"{_COLUMNS} label"),
    ("take.csv", b"PK\x03\x04\xff\xfe\x00", ": expected the columns"),
    *(("take.csv", HEADER + rows, ": no segment in it") for rows in ("", "3,4, \n")),
    ("take.csv", HEADER + "2,3,bow\n0,2.001,wave\n", r": 'wave' \(to 2.001\) and 'bow' \(from 2.0\) overlap"),
    ("take.csv", "start_frame,end_frame,label\n0,468,a\n", ": expected the columns start_s, end_s, label, got frame"),
    ("take.csv", HEADER + "0,1," + "a" * 200_000 + "\n", ": expected a CSV, as"),
    ("take.txt", "0.5\t1.5\twave\n2.0\tx\tbow\n", ":2: start, end: expected seconds, got '2.0', 'x'"),
    ("take.txt", "0.5\t1.5\twave\n3.0\t2.0\tbow\n", ":2: segment: expected 0 <= start < end, got 3.0 to 2.0"),
    ("take.txt", "100\t200\t300\t4\n", f"{_COLUMNS} start_s, end_s, label"),
    ("take.eaf", "<a", _NEITHER),
    ("take.eaf", _ELAN.replace('"b"', '"c"', 1), _NEITHER),
    ("take.eaf", _ELAN.replace("500", "5000"), ".*expected 0 <= start < end"),
    ("take.eaf", _ELAN.replace("500", "half"), ".*start, end: expected seconds"),
    *(("take.boris", text, _NEITHER) for text in ("{}", "[" * 100_000, _boris([]))),
    ("take.boris", '{"observations": {}}', ".*expected one observation, got 0"),
    ("take.boris", _boris(one={}, two={}), ".*expected one observation, got 2"),
    ("take.boris", _boris([2.0, "ann", "bow"]), ".*expected an end of 'bow' of ann, which begins at 2.0 s"),
]


@pytest.mark.parametrize(("name", "content", "said"), WRONG, ids=range(len(WRONG)))
def test_labels_that_make_no_sense_are_refused(tmp_path: Path, name: str, content: str | bytes, said: str) -> None:
    """The file is named, and the line where one is at fault."""
    path = _written(tmp_path, name, content)
    with pytest.raises(LabelError, match=f"^{re.escape(str(path))}{said}"):
        read_labels(path)


def test_other_files_beside_a_take_are_not_taken_for_labels(tmp_path: Path) -> None:
    """Notes, tables of numbers and of joints, and the take itself are no labels; the table comes before an export."""
    take = tmp_path / "take.csv"
    take.write_text("time,root_x,root_y,root_z\n0,1,2,3\n")
    (tmp_path / "take.txt").write_text("filmed on Monday\n")
    (tmp_path / "take.tsv").write_text("0.0\t1.5\t2.5\n")
    assert labels_beside(tmp_path / "take.amc") == []
    assert labels_beside(take) == []
    (tmp_path / "take.txt").write_text("0.0\t1.5\twave\n")
    assert labels_beside(take) == [tmp_path / "take.txt"]
    take.write_text(HEADER)
    assert labels_beside(tmp_path / "take.bvh") == [take, tmp_path / "take.txt"]


def test_odd_labels_cause_a_remark() -> None:
    """Frame numbers, labels beyond the end and tiny labels cause a remark; good labels cause none."""
    take = _take(frames=100)
    assert oddities(take, [Segment(0.0, 1.0, "bow"), Segment(1.0, 2.0, "wave")]) == []
    assert oddities(take, []) == []
    with pytest.raises(LabelError, match=r"evening: the labels end at 100, the take at 2\.0 s or frame 100: frame n"):
        oddities(take, [Segment(0.0, 50.0, "bow"), Segment(50.0, 100.0, "wave")])
    beyond, tiny = oddities(take, [Segment(0.0, 0.2, "bow"), Segment(1.5, 2.5, "wave"), Segment(7.0, 8.5, "bow")])
    assert beyond == "evening: 2 of 3 labels reach beyond the take (0.0 to 2.0 s): 1 shortened, 1 left out"
    assert tiny == "evening: 1 of 3 labels are shorter than 0.25 s, too short for any window"


# --- cutting -----------------------------------------------------------------------------------------------------


@given(
    st.sampled_from([24.0, 29.97, 50.0, 120.0]),
    st.lists(st.integers(1, 4000), min_size=2, max_size=6, unique=True).map(sorted),
)
def test_cuts_are_made_at_frame_boundaries(frame_rate: float, milliseconds: list[int]) -> None:
    """A segment has the frames whose middles lie in it: neighbours share no frame and omit none."""
    take = _take(70, frame_rate)
    times = [number / 1000 + 1e-7 for number in milliseconds]
    segments = [Segment(start, end, "bow") for start, end in pairwise(times)]
    places = {positions.tobytes(): place for place, positions in enumerate(take.positions)}
    found = [[places[frame.tobytes()] for frame in clip.positions] for clip in cut(take, segments)]
    expected = [naive_windows.frames_within(70, frame_rate, segment.start, segment.end) for segment in segments]
    assert found == [frames for frames in expected if len(frames) >= 2]


def test_segments_begin_where_somebody_is_seen() -> None:
    """A segment that begins before anybody is seen is cut short too, with the same remark; a later gap is refused."""
    take = dataclasses.replace(_take(), gaps=((0.0, 1.0),))
    segments = [Segment(0.0, 0.5, "jump"), Segment(0.5, 1.5, "bow")]
    (clip,) = cut(take, segments)
    assert (clip.class_name, clip.frames, clip.gaps) == ("bow", 25, ())
    assert np.array_equal(clip.positions, take.positions[50:75])
    (told,) = oddities(take, segments)
    assert told == "evening: 2 of 2 labels reach beyond the take (1.0 to 2.0 s): 1 shortened, 1 left out"
    with pytest.raises(LabelError, match=r"not seen from 1\.20 to 1\.60 s"):
        list(cut(dataclasses.replace(take, gaps=((1.2, 1.6),)), segments))
