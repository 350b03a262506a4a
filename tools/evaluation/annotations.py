"""Events of an evaluation as annotations that ELAN opens beside the film (`.eaf`)."""

from pathlib import Path
from xml.etree import ElementTree as ET

from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream import EventKind
from kinespace.tools.cli.values import printable
from kinespace.tools.evaluation.scores import Course

_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_SCHEMA = "http://www.mpi.nl/tools/elan/EAFv3.0.xsd"


def is_elan(path: Path, takes: int) -> bool:
    """Say whether a file's ending is ELAN's; ValueError for several takes in one file."""
    if path.suffix.lower() == ".eaf" and takes != 1:
        raise ValueError(f"--answers: expected one take in a file of ELAN, got {takes}")
    return path.suffix.lower() == ".eaf"


def _tiers(course: Course) -> dict[str, list[Segment]]:
    """Give by tier the motions from `start` to `end` or to the take's end, those that were done, and the labels."""
    begun, started, done = dict[str, float](), list[Segment](), list[Segment]()
    for answer in course.answers:
        for event in answer.events:
            if event.kind is EventKind.START:
                begun[event.label] = event.time
            elif event.time > (since := begun.pop(event.label, event.time)):
                started.append(Segment(since, event.time, event.label))
        if answer.done:
            done.append(Segment(max(answer.done.start, 0.0), answer.done.end, answer.done.label))
    last = float(course.times[-1])
    started += [Segment(since, last, label) for label, since in begun.items() if last > since]
    return {"started": started, "done": done, "performed": list(course.segments)}


def write_elan(path: Path, course: Course) -> None:
    """Write what was said of a take, and what was performed, as ELAN's annotations."""
    root = ET.Element("ANNOTATION_DOCUMENT", AUTHOR="kinespace", FORMAT="3.0", VERSION="3.0")
    root.set("DATE", "1970-01-01T00:00:00+00:00")
    root.set("xmlns:xsi", _XSI)
    root.set("xsi:noNamespaceSchemaLocation", _SCHEMA)
    ET.SubElement(root, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    order, number = ET.SubElement(root, "TIME_ORDER"), 0
    for name, segments in _tiers(course).items():
        person = printable(course.person)
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
    path.write_text(ET.tostring(root, encoding="unicode", xml_declaration=True), encoding="utf-8")
