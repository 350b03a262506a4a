"""Events as annotations of ELAN and BORIS: what a program reads is what was said."""

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from synthetic import stick_clip

from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream.recognition import Done, Event, EventKind, Outcome, Recognition
from kinespace.tools.evaluation.annotations import is_annotation, write_annotations
from kinespace.tools.evaluation.harness import Take
from kinespace.tools.evaluation.stream_score import Course, course_of


def _course() -> Course:
    """Give a take of which a bow was said twice, once to the take's end, and done once."""
    answers = [Recognition("p", time, Outcome.NAMED, ("bow",), np.ones(1), 0.1) for time in (0.05, 0.2, 0.3)]
    kinds = (EventKind.START, EventKind.END, EventKind.START)
    answers = [
        replace(each, events=(Event("p", kind, "bow", 0, 0.9, each.time),))
        for each, kind in zip(answers, kinds, strict=True)
    ]
    answers[1] = replace(answers[1], done=Done("p", "bow", 0, 0.02, 0.13, 0.8, 1.0, 1.0))
    take = Take(replace(stick_clip("bow"), actor="ann"), (Segment(0, 0.35, "bow"),))
    return course_of(take, take.clip.times, answers, classes=("bow",), known=("bow",))


def test_elan_reads_what_was_said(tmp_path: Path) -> None:
    """Starts, done motions and labels stand in three tiers of their person, in milliseconds."""
    path, course = tmp_path / "events.eaf", _course()
    assert is_annotation(path, 1)
    write_annotations(path, [course])
    root = ET.parse(path).getroot()  # noqa: S314 - we wrote it
    slots = {each.attrib["TIME_SLOT_ID"]: int(each.attrib["TIME_VALUE"]) for each in root.iter("TIME_SLOT")}
    tiers = {
        tier.attrib["TIER_ID"]: [
            (slots[each.attrib["TIME_SLOT_REF1"]], slots[each.attrib["TIME_SLOT_REF2"]], each.findtext("*"))
            for each in tier.iter("ALIGNABLE_ANNOTATION")
        ]
        for tier in root.iter("TIER")
    }
    last = round(1000 * float(course.times[-1]))
    assert tiers == {
        "started": [(50, 200, "bow"), (300, last, "bow")],
        "done": [(20, 150, "bow")],
        "performed": [(0, 350, "bow")],
    }
    assert {tier.attrib["PARTICIPANT"] for tier in root.iter("TIER")} == {"ann"}
    # A motion that begins and ends at once is none, and no name makes another file than XML.
    at_once = replace(course.answers[0], events=[Event("p", kind, "bow", 0, 0.9, 0.05) for kind in EventKind])
    odd = replace(course, answers=[at_once], segments=(Segment(0, 0.35, "b\bow"),))
    write_annotations(path, [odd])
    assert [each.text for each in ET.parse(path).iter("ANNOTATION_VALUE")] == ["b\ufffdow"]  # noqa: S314 - as above
    with pytest.raises(ValueError, match="expected one take in a file of ELAN, got 2"):
        is_annotation(path, 2)


def test_boris_reads_what_was_said(tmp_path: Path) -> None:
    """Of several takes each is an observation; each state event begins with a row and ends with the next."""
    path, course = tmp_path / "events.boris", _course()
    assert is_annotation(path, 2)
    assert not is_annotation(Path("rows.csv"), 2)
    write_annotations(path, [course, replace(course, name="again")])
    project = json.loads(path.read_text(encoding="utf-8"))
    codes = {each["code"]: each["type"] for each in project["behaviors_conf"].values()}
    assert codes == dict.fromkeys(("done bow", "performed bow", "started bow"), "State event")
    assert set(project["observations"]) == {course.name, "again"}
    events = project["observations"]["again"]["events"]
    assert [time for time, *_ in events] == sorted(time for time, *_ in events)
    assert [time for time, person, code, *_ in events if (person, code) == ("ann", "done bow")] == [0.02, 0.15]
