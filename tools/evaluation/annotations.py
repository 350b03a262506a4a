"""Events of an evaluation as annotations that ELAN (`.eaf`) and BORIS (`.boris`) open beside the film."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream import EventKind
from kinespace.tools.cli.values import printable
from kinespace.tools.evaluation.scores import AnsweredTake

#: The tiers: motions from `start` to `end`, motions that were done, and the labels of the take.
TIERS = ("started", "done", "performed")
_BORIS_VERSION, _DATE = "7.0", "1970-01-01T00:00:00"
_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_SCHEMA = "http://www.mpi.nl/tools/elan/EAFv3.0.xsd"


def is_annotation(path: Path, takes: int) -> bool:
    """Say whether a file's ending is ELAN's or BORIS's; ValueError for several takes in a file of ELAN."""
    if path.suffix.lower() == ".eaf" and takes != 1:
        raise ValueError(f"--answers: expected one take in a file of ELAN, got {takes}; BORIS's takes several (.boris)")
    return path.suffix.lower() in _WRITERS


def write_annotations(path: Path, answered: Sequence[AnsweredTake]) -> None:
    """Write what was said of takes, and what was performed, into a file that `is_annotation`."""
    path.write_text(_WRITERS[path.suffix.lower()](answered), encoding="utf-8")


def _tiers(one: AnsweredTake) -> dict[str, list[Segment]]:
    """Give a take's segments by tier; a motion that goes on ends with the take."""
    begun, started, done = dict[str, float](), list[Segment](), list[Segment]()
    for answer in one.answers:
        for event in answer.events:
            if event.kind is EventKind.START:
                begun[event.label] = event.time
            elif event.time > (since := begun.pop(event.label, event.time)):
                started.append(Segment(since, event.time, event.label))
        if answer.done:
            done.append(Segment(max(answer.done.start, 0.0), answer.done.end, answer.done.label))
    last = float(one.times[-1])
    started += [Segment(since, last, label) for label, since in begun.items() if last > since]
    return dict(zip(TIERS, (started, done, list(one.segments)), strict=True))


def _elan(answered: Sequence[AnsweredTake]) -> str:
    (one,) = answered
    root = ET.Element("ANNOTATION_DOCUMENT", AUTHOR="kinespace", FORMAT="3.0", VERSION="3.0")
    root.set("DATE", f"{_DATE}+00:00")
    root.set("xmlns:xsi", _XSI)
    root.set("xsi:noNamespaceSchemaLocation", _SCHEMA)
    ET.SubElement(root, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    order, number = ET.SubElement(root, "TIME_ORDER"), 0
    for name, segments in _tiers(one).items():
        person = printable(one.person)
        tier = ET.SubElement(root, "TIER", LINGUISTIC_TYPE_REF="motion", TIER_ID=name, PARTICIPANT=person)
        for segment in segments:
            place = ET.SubElement(ET.SubElement(tier, "ANNOTATION"), "ALIGNABLE_ANNOTATION")
            for end, seconds in enumerate((segment.start, segment.end), 1):
                number += 1
                ET.SubElement(order, "TIME_SLOT", TIME_SLOT_ID=f"ts{number}", TIME_VALUE=str(round(1000 * seconds)))
                place.set(f"TIME_SLOT_REF{end}", f"ts{number}")
            place.set("ANNOTATION_ID", f"a{number}")
            ET.SubElement(place, "ANNOTATION_VALUE").text = printable(segment.label)
    kind = {"LINGUISTIC_TYPE_ID": "motion", "TIME_ALIGNABLE": "true", "GRAPHIC_REFERENCES": "false"}
    ET.SubElement(root, "LINGUISTIC_TYPE", kind)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True)


def _boris(answered: Sequence[AnsweredTake]) -> str:
    tiers = [_tiers(one) for one in answered]
    codes = sorted({f"{tier} {each.label}" for own in tiers for tier, some in own.items() for each in some})
    people = sorted({one.person for one in answered} - {""})
    named = {"time_format": "s", "project_date": _DATE, "project_name": "kinespace", "project_description": ""}
    observed = {"file": {}, "type": "LIVE", "date": _DATE, "description": "", "time offset": 0.0}
    observations = dict[str, object]()
    for one, own in zip(answered, tiers, strict=True):
        events = sorted(_boris_events(one, own), key=lambda event: event[0])
        observations[one.name] = {**observed, "events": events, "independent_variables": {}}
    blank = ("key", "description", "category", "modifiers", "excluded", "coding map")
    behaviour = {"type": "State event", "code": "", **dict.fromkeys(blank, "")}
    project = {
        **named,
        "project_format_version": _BORIS_VERSION,
        "subjects_conf": {str(n): {"key": "", "name": name, "description": ""} for n, name in enumerate(people)},
        "behaviors_conf": {str(place): {**behaviour, "code": code} for place, code in enumerate(codes)},
        "observations": observations,
        "behavioral_categories": [],
        "independent_variables": {},
        "coding_map": {},
        "behaviors_coding_map": [],
        "converters": {},
    }
    return json.dumps(project, indent=1, ensure_ascii=False)


def _boris_events(one: AnsweredTake, tiers: dict[str, list[Segment]]) -> Iterator[tuple[float, str, str, str, str]]:
    """Give the events of a take: a state event begins with one row and ends with the next of its behaviour."""
    for tier, segments in tiers.items():
        for segment in segments:
            for seconds in (segment.start, segment.end):
                yield round(seconds, 3), one.person, f"{tier} {segment.label}", "", ""


_WRITERS = {".eaf": _elan, ".boris": _boris}
