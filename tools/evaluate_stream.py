"""`kinespace evaluate stream`: labelled takes replayed through the recogniser that runs live, and how right it was."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

from rich.table import Table

from library import MotionLibrary, find_recordings, read_recordings
from library.labels import Segment, cut, read_labels, renamed
from stream.frame import Frame
from stream.recognition import Recognition
from stream.recognizer import Recognizer, Settings
from tools.console import console, progress
from tools.jointsets import joints_of
from tools.streamscore import Course, StreamScore, confusion, course_of, score_courses
from tools.tables import add_names

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from library import Clip, Reading

#: Seconds that must lie in a segment for a moment to count as inside it, whatever the recogniser looks at.
_INSIDE = 1.0

#: Characters that the figures beside classes' names need.
_BESIDE_CLASSES = 38

LabelledTake = tuple["Clip", tuple[Segment, ...]]


def run(
    places: Sequence[Path],
    *,
    reading: Reading,
    labels: Sequence[Path],
    library: Path | None,
    leave_one_out: bool,
    names: Mapping[str, str],
    skeleton: str | None,
    settings: Settings,
    timeline: Path | None,
    confusion_file: Path | None,
    as_json: bool,
) -> int:
    """Replay takes, score the answers, and print or draw what came out.

    Parameters
    ----------
    places
        Takes, or folders of them.
    reading
        How they are read.
    labels
        The takes' labels, in their order; each take's own, beside it and ending in `.csv`, when none is given.
    library
        To recognise with; the built-in one when not given.
    leave_one_out
        Recognise each take with a library built from the segments of the others instead.
    names
        Class name of labels that the library calls otherwise.
    skeleton
        Name of a joint set that takes and libraries are restricted to; as recorded when not given.
    settings
        Of the recogniser.
    timeline, confusion_file
        Where to draw pictures of both.
    as_json
        Print one JSON object and nothing else.
    """
    for picture in (timeline, confusion_file):
        if picture:
            _require_place_for(picture)
    takes = _labelled_takes(places, reading, labels, names)
    if skeleton:
        takes = [(take.restricted_to(joints_of(skeleton)), segments) for take, segments in takes]
    if leave_one_out:
        libraries = [_library_of_others(takes, index) for index in range(len(takes))]
    else:
        whole = MotionLibrary.load(library) if library else MotionLibrary.builtin()
        libraries = [whole.restricted_to(joints_of(skeleton)) if skeleton else whole] * len(takes)
    classes = tuple(sorted({name for each in libraries for name in each.classes}))
    for (take, _), each in zip(takes, libraries, strict=True):
        each.skeleton.require_same(take.skeleton)
    _require_classes(takes, names, classes)
    pairs = list(zip(takes, libraries, strict=True))
    courses = [
        replay(take, segments, library=each, classes=classes, settings=settings)
        for (take, segments), each in progress(pairs, "Replaying", len(pairs))
    ]
    score = score_courses(courses, classes, _INSIDE)
    if timeline or confusion_file:
        _draw(courses, classes, timeline, confusion_file)
    if as_json:
        print(json.dumps(asdict(score)))
    else:
        _print(score)
    return 0


def replay(
    take: Clip,
    segments: Sequence[Segment],
    *,
    library: MotionLibrary,
    classes: Sequence[str],
    settings: Settings,
) -> Course:
    """Push a take through the recogniser, frame by frame, and lay its answers beside the labels.

    Parameters
    ----------
    take
        Recorded with the library's skeleton.
    segments
        What is performed when.
    library, settings
        Of the recogniser.
    classes
        All classes of an evaluation, the library's among them: what indices count in.
    """
    take = take.as_of(library.skeleton)
    recognizer = Recognizer(library, settings)
    recognitions = list[Recognition]()
    for time, positions in zip(take.times.tolist(), take.positions, strict=True):
        recognition = recognizer.push(Frame(take.name, time, positions))
        if recognition is not None:
            recognitions.append(recognition)
    events = [event for recognition in recognitions for event in recognition.events]
    return course_of(
        take.name,
        take.times,
        segments,
        classes=classes,
        known=library.classes,
        recognitions=recognitions,
        events=events,
    )


def _labelled_takes(
    places: Sequence[Path], reading: Reading, labels: Sequence[Path], names: Mapping[str, str]
) -> list[LabelledTake]:
    paths = find_recordings(places)
    if labels and len(labels) != len(paths):
        raise ValueError(f"--labels: expected one for each of {len(paths)} takes, got {len(labels)}")
    files = labels or [path.with_suffix(".csv") for path in paths]
    for path, file in zip(paths, files, strict=True):
        if not file.is_file():
            raise FileNotFoundError(f"{file}: no labels for {path.name}; --labels says where they are")
    performed = [read_labels(file) for file in files]
    labels_there = {segment.label for each in performed for segment in each}
    for label in names:
        if label not in labels_there:
            raise ValueError(f"--map: expected a label of the takes, {', '.join(sorted(labels_there))}, got {label!r}")
    segments = [renamed(each, names) for each in performed]
    return list(zip(progress(read_recordings(paths, reading), "Reading", len(paths)), segments, strict=True))


def _require_classes(takes: Sequence[LabelledTake], names: Mapping[str, str], classes: Sequence[str]) -> None:
    """Refuse names that are no class: nobody would see that nothing is known."""
    labels = {segment.label for _, segments in takes for segment in segments}
    for class_name in names.values():
        if class_name not in classes:
            raise ValueError(f"--map: expected one of {', '.join(classes)}, got {class_name!r}")
    if not labels & set(classes):
        raise ValueError(
            f"expected a label that is a class of the library, got {', '.join(sorted(labels))}; --map LABEL=CLASS "
            f"renames them, to one of {', '.join(classes)}"
        )


def _library_of_others(takes: Sequence[LabelledTake], held_out: int) -> MotionLibrary:
    others = [each for index, each in enumerate(takes) if index != held_out]
    if not others:
        raise ValueError("--protocol leave-one-take-out: expected at least two takes, got one")
    clips = [clip for take, segments in others for clip in cut(take, segments)]
    return MotionLibrary.of_clips(clips, comparison=MotionLibrary.builtin().comparison_for(clips[0].skeleton))


def _require_place_for(picture: Path) -> None:
    from tools import pictures  # noqa: PLC0415 - matplotlib is an extra, and slow to load

    pictures.require_place_for_picture(picture)


def _draw(
    courses: Sequence[Course], classes: Sequence[str], timeline: Path | None, confusion_file: Path | None
) -> None:
    from tools import pictures  # noqa: PLC0415 - matplotlib is an extra, and slow to load

    if timeline:
        pictures.draw_timelines(timeline, courses, classes)
    if confusion_file:
        pictures.draw_time_confusion(confusion_file, *confusion(courses, classes))


def _print(score: StreamScore) -> None:
    table = Table(title="Answers against what was performed at that moment", title_justify="left", show_header=False)
    table.add_column("")
    table.add_column("", justify="right")
    for name, shown in _figures(score).items():
        table.add_row(name, shown)
    console.print(table)
    classes = Table(title="By class", title_justify="left")
    add_names(classes, "class", score.classes, beside=_BESIDE_CLASSES)
    for heading in ("seconds", "right", "right, last second inside"):
        classes.add_column(heading, justify="right")
    for name, each in score.classes.items():
        classes.add_row(name, f"{each.seconds:.1f}", f"{each.right:.1%}", f"{each.right_inside:.1%}")
    console.print(classes)


def _figures(score: StreamScore) -> dict[str, str]:
    return {
        "known motions: share of their time guessed right": _percent(score.frame_accuracy),
        "the same, last second wholly inside the segment": _percent(score.segment_accuracy),
        "known motions: share named at all, last second inside": _percent(score.known_answered),
        "segments found": _percent(score.segments_found),
        "delay of the first lasting right guess, median": _seconds(score.median_delay_s),
        "the same, 90 %": _seconds(score.p90_delay_s),
        "share of a motion seen by then, median": _percent(score.median_seen),
        "delay of the start event, median": _seconds(score.median_event_delay_s),
        "unknown motions: share of their time named": _percent(score.unknown_answered),
        "unknown motions: names begun per minute": _plain(score.false_per_minute),
        "unknown motions: ROC area of the raw score": _plain(score.auc_unknown),
        "changes of the motion going on, per minute": _plain(score.changes_per_minute),
        "the same, by the labels": _plain(score.true_changes_per_minute),
    }


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.1%}"


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} s"


def _plain(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
