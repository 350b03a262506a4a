"""Takes to be recognised: labelled, unknown, listed in tables, whole clips, and takes with a sensor's gaps."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded import SWINGS, write_takes
from takes import write_take

from kinespace.library import NOTHING, Reading
from kinespace.library.recordings import ActorIn, RecordingError
from kinespace.library.recordings.formats.labels import LabelError, Segment
from kinespace.tools.evaluation.harness import Sources, Take, read_takes

BY_NAME = Reading(actor_in=ActorIn.NAME)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write three takes of two persons."""
    write_take(tmp_path, 1, [("clap", 1.0), ("row", 1.0)], person="ann")
    write_take(tmp_path, 2, [("row", 1.0)], person="ann")
    write_take(tmp_path, 1, [("hail", 1.0)], person="ben")
    return tmp_path


def _names(takes: list[Take]) -> list[str]:
    return [take.clip.name for take in takes]


# --- labelled takes ----------------------------------------------------------------------------------------------


def test_labelled_takes_have_their_segments_and_persons(folder: Path) -> None:
    """Labels beside a take are its segments, and its path names its person if asked for."""
    takes = read_takes(Sources([folder]), BY_NAME)
    assert _names(takes) == ["ann_01", "ann_02", "ben_01"]
    assert takes[0].segments == (Segment(0.0, 1.0, "clap"), Segment(1.0, 2.0, "row"))
    assert [take.person for take in takes] == ["ann", "ann", "ben"]
    assert [take.person for take in read_takes(Sources([folder]), Reading())] == [""] * 3
    assert all(take.is_known and take.contains == () and take.delivered is None for take in takes)


def test_motions_are_cut_out(folder: Path) -> None:
    """Each segment is a motion of its label, with its frames, by the take's person."""
    take, *_ = read_takes(Sources([folder]), BY_NAME)
    first, second = take.motions()
    assert [(each.class_name, each.frames, each.actor) for each in (first, second)] == [
        ("clap", 120, "ann"),
        ("row", 120, "ann"),
    ]
    assert np.array_equal(second.positions, take.clip.positions[120:])
    (part,) = replace(take, segments=(Segment(0.25, 0.75, "hail"),)).motions()
    assert part.frames == 60


def test_labels_get_other_names(folder: Path) -> None:
    """Segments are renamed; a name for a label that no take has is refused, also when takes are left out."""
    takes = read_takes(Sources([folder], names={"row": "pull"}), BY_NAME)
    assert [segment.label for take in takes for segment in take.segments] == ["clap", "pull", "pull", "hail"]
    with pytest.raises(ValueError, match="--map: expected a label of the takes, clap, row, got 'hail'"):
        read_takes(Sources([folder], names={"hail": "pull"}, persons=["ann"]), BY_NAME)


# --- clips -------------------------------------------------------------------------------------------------------


def test_clips_named_as_hdm05_are_one_motion(tmp_path: Path) -> None:
    """A clip with its class in its name is one motion from its beginning to its end."""
    write_takes(tmp_path, takes=1, frames=60)
    takes = read_takes(Sources([tmp_path]), Reading())
    assert {(take.segments[0].label, take.person) for take in takes} == {(n, a) for n in SWINGS for a in ("bd", "mm")}
    for take in takes:
        assert take.segments == (Segment(0.0, 0.5, take.clip.class_name),)
        (motion,) = take.motions()
        assert (motion.frames, motion.class_name) == (60, take.clip.class_name)


def test_other_clips_are_of_their_folders_class(tmp_path: Path) -> None:
    """With --clips the folder is the class; clips of one name are numbered."""
    for class_name in ("clap", "row"):
        (tmp_path / class_name).mkdir()
        write_take(tmp_path / class_name, 1, [(class_name, 0.5)], person="ann", labelled=False)
    takes = read_takes(Sources([tmp_path], clips=True), BY_NAME)
    assert [(take.clip.name, take.labels, take.person) for take in takes] == [
        ("ann_01", {"clap"}, "ann"),
        ("ann_01 (2)", {"row"}, "ann"),
    ]
    with pytest.raises(FileNotFoundError, match=r"ann_01.csv: no labels for ann_01.amc; --labels .* --clips "):
        read_takes(Sources([tmp_path]), BY_NAME)


# --- tables ------------------------------------------------------------------------------------------------------

HEADER = "file,subject,seconds,contains,perhaps\n"


def _table(folder: Path, text: str) -> Path:
    path = folder / "takes.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_table_lists_the_classes_in_takes(folder: Path) -> None:
    """One with classes contains them, one without any is unknown, one that might contain some is left out."""
    rows = 'ann_01.amc,7,2,"clap, row",hail\nann_02.amc,7,1,,row\nben_01.amc,8,1,,\n'
    takes = read_takes(Sources(tables=[_table(folder, HEADER + rows)], names={"row": "pull"}), Reading())
    assert [(take.clip.name, take.person, take.contains, take.segments) for take in takes] == [
        ("ann_01", "7", ("clap", "pull"), ()),
        ("ben_01", "8", (), (Segment(0.0, 1.0, NOTHING),)),
    ]


def test_a_tables_takes_are_chosen_before_they_are_read(folder: Path) -> None:
    """Takes of unwanted persons need not exist."""
    rows = "gone.amc,7,1,clap,\nben_01.amc,8,1,hail,\n"
    assert _names(read_takes(Sources(tables=[_table(folder, HEADER + rows)], persons=["8"]), BY_NAME)) == ["ben_01"]
    with pytest.raises((OSError, RecordingError), match="gone"):
        read_takes(Sources(tables=[_table(folder, HEADER + rows)]), BY_NAME)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("file,subject,contains\n", "expected the columns file, subject, contains, perhaps, no perhaps in it"),
        ("", "expected the columns file, subject, contains, perhaps, no file, subject, contains, perhaps in it"),
        (HEADER + ",7,1,clap,\n", "takes.csv:2: expected the name of a file, got none"),
    ],
)
def test_a_table_that_says_nothing_is_refused(folder: Path, text: str, message: str) -> None:
    """Missing columns and missing names are reported with the file."""
    with pytest.raises(LabelError, match=re.escape(message)):
        read_takes(Sources(tables=[_table(folder, text)]), Reading())
