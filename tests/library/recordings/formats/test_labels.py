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
from kinespace.library.recordings.formats.labels import (
    LabelError,
    Segment,
    cut,
    labels_beside,
    oddities,
    read_labels,
    renamed,
)

HEADER = "start_s,end_s,label\n"


def _file(folder: Path, text: str | bytes) -> Path:
    path = folder / "labels.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def _take(frames: int = 100, frame_rate: float = 50.0) -> Clip:
    clip = stick_clip("wave", frames=frames, actor="bb")
    return dataclasses.replace(
        clip, frame_rate=frame_rate, name="evening", rotations=np.arange(2.0 * frames).reshape(-1, 2)
    )


# --- segments ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("start", "end"),
    [(1.0, 1.0), (2.0, 1.0), (-0.1, 1.0), (0.0, math.inf), (math.nan, 1.0), (0.0, math.nan), (math.inf, math.inf)],
)
def test_a_segment_without_time_is_refused(start: float, end: float) -> None:
    """A segment that does not end after it starts, starts before 0 or has no finite end is refused."""
    with pytest.raises(ValueError, match="segment: expected 0 <= start < end, got"):
        Segment(start, end, "wave")


def test_a_segment_needs_a_label() -> None:
    """An empty label is refused; a duration is the time between."""
    with pytest.raises(ValueError, match="label: expected a name"):
        Segment(0.0, 1.0, "")
    assert Segment(0.5, 2.0, "wave").duration == pytest.approx(1.5)


# --- reading -----------------------------------------------------------------------------------------------------


def test_labels_are_read_in_order_of_time(tmp_path: Path) -> None:
    """Lines in any order come sorted by start, spaces about a label gone, blank lines passed over."""
    path = _file(tmp_path, HEADER + '2.5,3,bow\n\n0,1.25, wave \n1.25,2.5,"rest, long"\n')
    assert read_labels(path) == (
        Segment(0.0, 1.25, "wave"),
        Segment(1.25, 2.5, "rest, long"),
        Segment(2.5, 3.0, "bow"),
    )


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(b"\xef\xbb\xbfstart_s,end_s,label\n0,1,\xc3\x9cbung\n", id="byte order mark"),
        pytest.param("start_s,end_s,label\r\n0,1,Übung\r\n", id="Windows"),
        pytest.param("start_s,end_s,label\n0,1,Übung", id="no last line end"),
        pytest.param("label,who,end_s,start_s\nÜbung,me,1,0\n", id="other columns, other order"),
        pytest.param('"start_s","end_s","label"\n"0","1e0","Übung",,\n', id="quoted, cells too many"),
    ],
)
def test_tables_from_spreadsheets_are_read(tmp_path: Path, text: str | bytes) -> None:
    """A byte order mark, Windows' line ends, quotes, further columns and another order change nothing."""
    assert read_labels(_file(tmp_path, text)) == (Segment(0.0, 1.0, "Übung"),)


TWO = (Segment(0.5, 2.25, "wave"), Segment(62.5, 64.0, "bow low"))


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("start_s;end_s;label\n0.5;2.25;wave\n62.5;64;bow low\n", id="semicolons"),
        pytest.param("start_s;end_s;label\n0,5;2,25;wave\n62,5;64,0;bow low\n", id="semicolons, decimal commas"),
        pytest.param("start_s\tend_s\tlabel\n0.5\t2.25\twave\n62,5\t64\tbow low\n", id="tabs"),
        pytest.param("0.500000\t2.250000\twave\n62.500000\t64.000000\tbow low\n", id="Audacity"),
        pytest.param(
            "0.500000\t2.250000\twave\n\\\t20.5\t300.0\n3.000000\t3.000000\tclap\n62.5\t64.0\tbow low\n70.0\t71.0\t\n",
            id="Audacity with frequencies, a moment, a region without a name",
        ),
        pytest.param("0\t1\tjump\n", id="Audacity by hand"),
    ],
)
def test_exports_of_other_programs_are_read(tmp_path: Path, text: str) -> None:
    """Semicolons, tabs and Audacity's labels are the same segments, and are found beside a take."""
    path = _file(tmp_path, text)
    wanted = (Segment(0.0, 1.0, "jump"),) if "jump" in text else TWO
    assert read_labels(path) == wanted
    assert labels_beside(path.with_suffix(".amc")) == [path]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.5\t1.5\twave\n2.0\tx\tbow\n", ":2: could not convert string to float: 'x'"),
        ("0.5\t1.5\twave\n3.0\t2.0\tbow\n", ":2: segment: expected 0 <= start < end, got 3.0 to 2.0"),
        ("100\t200\t300\t4\n", ": expected the columns start_s, end_s, label, no start_s, end_s, label in it"),
    ],
)
def test_exports_that_make_no_sense_are_refused(tmp_path: Path, text: str, said: str) -> None:
    """A row that is no label is named by its line."""
    path = _file(tmp_path, text)
    with pytest.raises(LabelError, match=re.escape(f"{path}{said}")):
        read_labels(path)


_ELAN = """<?xml version="1.0" encoding="UTF-8"?>
<ANNOTATION_DOCUMENT><TIME_ORDER><TIME_SLOT TIME_SLOT_ID="a" TIME_VALUE="500"/>
<TIME_SLOT TIME_SLOT_ID="b" TIME_VALUE="1250"/></TIME_ORDER><TIER TIER_ID="x" PARTICIPANT="ann"><ANNOTATION>
<ALIGNABLE_ANNOTATION ANNOTATION_ID="1" TIME_SLOT_REF1="a" TIME_SLOT_REF2="b"><ANNOTATION_VALUE>wave</ANNOTATION_VALUE>
</ALIGNABLE_ANNOTATION></ANNOTATION></TIER></ANNOTATION_DOCUMENT>"""
_EVENTS = [[1.25, "ann", "wave", "", ""], [0.5, "ann", "wave", "", ""], [2, "No focal subject", "bow", "", ""]]
_BORIS = {"observations": {"one": {"events": [*_EVENTS, [3, "No focal subject", "bow", "", ""]]}}}


def _boris(events: list[list[object]]) -> dict[str, object]:
    """Give a project of BORIS with some events, and a behaviour that lasts no time."""
    kinds = {"0": {"code": "blink", "type": "Point event"}, "1": {"code": "bow", "type": "State event"}}
    return {"behaviors_conf": kinds, "observations": {"monday": {"events": events}}}


def test_point_events_of_boris_are_no_motions(tmp_path: Path) -> None:
    """Nothing is performed between two of them."""
    events = [[1.0, "ann", "blink"], [1.5, "ann", "bow"], [2.0, "ann", "blink"], [3.0, "ann", "bow"]]
    (tmp_path / "take.boris").write_text(json.dumps(_boris(events)))
    assert read_labels(tmp_path / "take.boris") == (Segment(1.5, 3.0, "bow", "ann"),)


@pytest.mark.parametrize(
    ("name", "text", "further"),
    [("take.eaf", _ELAN, ()), ("take.boris", json.dumps(_BORIS), (Segment(2.0, 3.0, "bow"),))],
)
def test_annotations_of_elan_and_boris_are_read(
    tmp_path: Path, name: str, text: str, further: tuple[Segment, ...]
) -> None:
    """They lie beside a take as other labels do; their participants, or subjects, are the performers."""
    (tmp_path / name).write_text(text)
    assert labels_beside(tmp_path / "take.bvh") == [tmp_path / name]
    assert read_labels(tmp_path / name) == (Segment(0.5, 1.25, "wave", "ann"), *further)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("take.eaf", "<a", "expected annotations of ELAN or events of BORIS"),
        ("take.eaf", _ELAN.replace('"b"', '"c"', 1), "expected annotations of ELAN or events of BORIS"),
        ("take.eaf", _ELAN.replace("500", "5000"), "expected 0 <= start < end"),
        ("take.eaf", _ELAN.replace("500", "half"), "could not convert string to float"),
        ("take.boris", "{}", "expected annotations of ELAN or events of BORIS"),
        ("take.boris", "[" * 100_000, "expected annotations of ELAN or events of BORIS"),
        ("take.boris", json.dumps(_boris([[]])), "expected annotations of ELAN or events of BORIS"),
        ("take.boris", '{"observations": {}}', "expected one observation, got 0"),
        ("take.boris", json.dumps({"observations": {"one": {}, "two": {}}}), "expected one observation, got 2"),
        (
            "take.boris",
            json.dumps(_boris([[2.0, "ann", "bow"]])),
            "expected an end of 'bow' of ann, which begins at 2.0 s",
        ),
    ],
)
def test_annotations_that_make_no_sense_are_refused(tmp_path: Path, name: str, text: str, said: str) -> None:
    """The file is named."""
    (tmp_path / name).write_text(text)
    with pytest.raises(LabelError, match=rf"^{re.escape(str(tmp_path / name))}.*{said}"):
        read_labels(tmp_path / name)


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


@pytest.mark.parametrize(
    ("line", "said"),
    [
        pytest.param("x,4,wave", "could not convert string to float: 'x'", id="a word"),
        pytest.param("3,,wave", "could not convert string to float: ''", id="no end"),
        pytest.param('3,"4,5",wave', "could not convert string to float: '4,5'", id="decimal comma"),
        pytest.param("4,3,wave", "segment: expected 0 <= start < end, got 4.0 to 3.0", id="backwards"),
    ],
)
def test_a_line_that_makes_no_sense_is_named(tmp_path: Path, line: str, said: str) -> None:
    """A bad line is refused with the file, the line number of an editor, and the mistake."""
    path = _file(tmp_path, f"{HEADER}0,1,bow\n\n{line}\n5,6,bow\n")
    with pytest.raises(LabelError, match=re.escape(f"{path}:4: {said}")):
        read_labels(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        pytest.param("", "expected the columns start_s, end_s, label, no start_s, end_s, label in it", id="empty"),
        pytest.param("start_s,end_s\n0,1\n", "expected the columns start_s, end_s, label, no label", id="no label"),
        pytest.param(HEADER, "no segment in it", id="header alone"),
        pytest.param(HEADER + "3,4, \n", "no segment in it", id="no label filled in"),
        pytest.param(
            HEADER + "2,3,bow\n0,2.001,wave\n", "'wave' (to 2.001) and 'bow' (from 2.0) overlap", id="overlapping"
        ),
        pytest.param(
            "start_frame,end_frame,label\n0,468,a\n",
            "expected start_s,end_s,label, got frame numbers: divide them by the take's frames per second",
            id="frames",
        ),
        pytest.param(b"PK\x03\x04\xff\xfe\x00", "expected the columns", id="binary"),
        pytest.param(HEADER + "0,1," + "a" * 200_000 + "\n", "expected a CSV, as", id="endless cell"),
    ],
)
def test_a_file_that_is_no_labels_is_refused(tmp_path: Path, text: str | bytes, said: str) -> None:
    """Without the columns or any line, with overlaps, or not a text at all, a file is refused by name."""
    path = _file(tmp_path, text)
    with pytest.raises(LabelError, match=re.escape(f"{path}: {said}")):
        read_labels(path)


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16", "utf-8-sig"])
def test_labels_are_read_in_any_encoding(tmp_path: Path, encoding: str) -> None:
    """Spreadsheets and Windows' editor save Latin-1 and UTF-16."""
    path = _file(tmp_path, (HEADER + "0,1,Übung\n").encode(encoding))
    assert read_labels(path) == (Segment(0.0, 1.0, "Übung"),)


def test_renaming_leaves_other_labels() -> None:
    """Labels that are in the names are replaced, others and all times stay."""
    segments = (Segment(0.0, 1.0, "bow"), Segment(1.0, 2.0, "wave"))
    assert renamed(segments, {"bow": "Verbeugung"}) == (Segment(0.0, 1.0, "Verbeugung"), segments[1])


# --- cutting -----------------------------------------------------------------------------------------------------


def test_a_cut_clip_is_its_segments_frames() -> None:
    """Positions and rotations are the segment's, the class is its label, the take the take's name, the rest stays."""
    take = _take()
    first, second = cut(take, [Segment(0.2, 0.6, "bow"), Segment(0.6, 2.0, "jump")])
    assert np.array_equal(first.positions, take.positions[10:30])
    assert np.array_equal(first.rotations, take.rotations[10:30])
    assert np.array_equal(second.positions, take.positions[30:100])
    assert (first.class_name, first.take, first.actor, first.frame_rate) == ("bow", "evening", "bb", 50.0)
    assert second.class_name == "jump"


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
