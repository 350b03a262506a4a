"""`kinespace evaluate stream`: replays takes through the recogniser that runs live, and scores its answers."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import MotionLibrary, SkeletonMismatchError
from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.windows.index import WindowIndex, usual_weighing
from kinespace.library.windows.parts import Kind
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.cli.arguments import (
    add_actor_in,
    add_json,
    add_labels,
    add_library,
    add_map,
    add_reading,
    add_settings,
    add_subjects,
    add_takes,
    library_at,
    reading_of,
    settings_of,
)
from kinespace.tools.evaluation.scoring.protocols import Fold, Protocol, folds_of
from kinespace.tools.evaluation.scoring.stream_score import LOWER_IS_BETTER, StreamScore, score_courses
from kinespace.tools.evaluation.scoring.stream_tables import print_persons, print_score
from kinespace.tools.evaluation.scoring.timeline import Course, confusion, course_of
from kinespace.tools.evaluation.takes import Sources, Take, read_takes, takes_of
from kinespace.tools.feeding.joint_sets import joints_of
from kinespace.tools.terminal.console import progress, progress_console
from kinespace.tools.terminal.output_path import require_place_for

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from kinespace.library import Clip, Reading, Skeleton
    from kinespace.library.recordings.formats.labels import Segment

#: Seconds before a moment that must lie in a segment for the moment to count as inside it.
_INSIDE = 1.0


@dataclass(frozen=True, slots=True)
class Pictures:
    """Files for pictures of the answers over time, of labels against answers, and for a page; None for none."""

    timeline: Path | None = None
    confusion: Path | None = None
    page: Path | None = None

    def require_places(self) -> None:
        """Refuse files that cannot be written, before the work."""
        if self.page:
            require_place_for(self.page)
        for picture in (self.timeline, self.confusion):
            if picture:
                from kinespace.tools.terminal import pictures  # noqa: PLC0415 - matplotlib is an extra, and slow to load

                pictures.require_place_for_picture(picture)

    def draw(self, courses: Sequence[Course], takes: Sequence[Take], classes: Sequence[str]) -> None:
        """Draw the pictures that were asked for, of the answers to each take."""
        if self.page:
            from kinespace.tools.page.report import write_report  # noqa: PLC0415 - seldom needed

            bodies = [take.clip for take in takes]
            write_report(self.page, list(zip(courses, bodies, strict=True)), classes)
        if not (self.timeline or self.confusion):
            return
        from kinespace.tools.terminal import pictures  # noqa: PLC0415 - matplotlib is an extra, and slow to load

        if self.timeline:
            pictures.draw_timelines(self.timeline, courses, classes)
        if self.confusion:
            pictures.draw_time_confusion(self.confusion, *confusion(courses, classes))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Replays takes through the very recogniser that runs live, at full speed and without sockets, and compares "
        "the answer of each moment with the movement performed at that moment."
    )
    parser.add_argument(
        "takes",
        nargs="*",
        type=Path,
        metavar="TAKE",
        help="labelled takes, clips named as HDM05's, or folders of them (default: the library's own motions)",
    )
    add_takes(parser)
    parser.add_argument(
        "--unknown",
        nargs="+",
        action="extend",
        type=Path,
        default=[],
        metavar="TAKE",
        help="recordings in which nothing known happens, or folders of them",
    )
    parser.add_argument("--clips", action="store_true", help="a recording without labels is one motion, of its folder")
    add_reading(parser)
    add_actor_in(parser)
    add_labels(parser, "for each TAKE, in order (default: beside the take, called like it)")
    add_library(parser)
    parser.add_argument(
        "--protocol",
        choices=[str(protocol) for protocol in Protocol],
        default=str(Protocol.LIBRARY),
        help="recognise with the library; with motions cut from the other takes, or from the other persons' takes; or "
        "with motions of one person, for each person in turn",
    )
    add_subjects(parser)
    add_map(parser)
    parser.add_argument("--skeleton", metavar="NAME", help="with the joints of this product alone, like kinectv2")
    add_settings(parser)
    parser.add_argument(
        "--without-part",
        choices=[str(kind) for kind in Kind],
        help="leave these parts of the signature out, to see their worth",
    )
    parser.add_argument("--timeline", type=Path, metavar="FILE", help="draw labels and answers over time")
    parser.add_argument("--page", type=Path, metavar="HTML", help="write a page that plays takes, answers and bodies")
    parser.add_argument("--confusion", type=Path, metavar="FILE", help="draw the confusion matrix")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    return evaluate(
        Sources(
            options.takes,
            options.labels,
            clips=options.clips,
            unknown=options.unknown,
            tables=options.tables,
            names=dict(options.map),
            persons=options.subjects,
            without_persons=options.without_subjects,
            skeleton=options.skeleton,
        ),
        reading=reading_of(options),
        library=options.library,
        protocol=Protocol(options.protocol),
        settings=settings_of(options),
        without=Kind(options.without_part) if options.without_part else None,
        drawn=Pictures(options.timeline, options.confusion, options.page),
        as_json=options.json,
    )


def evaluate(
    sources: Sources,
    *,
    reading: Reading,
    library: Path | None,
    protocol: Protocol,
    settings: Settings,
    without: Kind | None,
    drawn: Pictures,
    as_json: bool,
) -> int:
    """Replay takes, score the answers, and print or draw the results.

    Parameters
    ----------
    sources
        The takes; with none the motions of the library.
    reading
        How to read them.
    library
        The library to recognise with, if the protocol makes none from the takes; by default the built-in one.
    protocol
        Which library recognises which take.
    settings
        The recogniser's settings.
    without
        Parts of the signature that are left out, to measure their worth.
    drawn
        The pictures.
    as_json
        Print one JSON object and nothing else.
    """
    drawn.require_places()
    takes = read_takes(sources, reading) if sources else _motions(library, sources, protocol)
    given = _library(library, sources.skeleton) if protocol is Protocol.LIBRARY else None
    joints = shared_joints([*(take.clip.skeleton for take in takes), *([given.skeleton] if given else [])])
    takes = [replace(take, clip=take.clip.restricted_to(joints)) for take in takes]
    folds = folds_of(takes, protocol, lambda: (given or MotionLibrary.builtin()).restricted_to(joints))
    classes = tuple(sorted({name for fold in folds for name in fold.library.classes}))
    _require_classes(takes, sources, classes)
    if drawn.confusion and not any(take.segments for take in takes):
        raise ValueError("--confusion: expected takes with labels, got none")
    asked = [(fold, take) for fold in folds for take in fold.takes]
    courses = [
        _course(take, _compared(fold.library, without), classes, settings)
        for fold, take in progress(asked, "Replaying", len(asked))
    ]
    score = score_courses(courses, classes, _INSIDE, intervals=True)
    persons = _by_person([fold for fold, _ in asked], courses, classes)
    drawn.draw(courses, [take for _, take in asked], classes)
    if as_json:
        print(json.dumps(asdict(score) | (_over_persons(persons) if persons else {})))
        return 0
    print_score(score)
    if persons:
        print_persons(persons, _over_persons(persons), protocol)
    return 0


def replay(
    take: Clip, segments: Sequence[Segment], *, library: MotionLibrary, classes: Sequence[str], settings: Settings
) -> Course:
    """Push a take through the recogniser, frame by frame, and put its answers beside the labels.

    Parameters
    ----------
    take
        A recording of the library's joints, in any order.
    segments
        The segments performed.
    library, settings
        The recogniser's library and settings.
    classes
        All classes of an evaluation, including the library's; indices count in them.
    """
    return _course(Take(take, tuple(segments)), library, classes, settings)


@lru_cache(maxsize=2)
def _compared(library: MotionLibrary, without: Kind | None) -> MotionLibrary | WindowIndex:
    """Give the library, or its windows without some parts."""
    return WindowIndex.of(library, weighing=usual_weighing(library).without(without)) if without else library


def _course(take: Take, compared: MotionLibrary | WindowIndex, classes: Sequence[str], settings: Settings) -> Course:
    library = compared if isinstance(compared, MotionLibrary) else compared.library
    clip = take.clip.as_of(library.skeleton)
    delivered = slice(None) if take.delivered is None else take.delivered
    times, positions = clip.times[delivered], clip.positions[delivered]
    recognizer = Recognizer(compared, settings)
    answers = (recognizer.push(Frame("take", time, each)) for time, each in zip(times.tolist(), positions, strict=True))
    recognitions = [answer for answer in answers if answer is not None]
    return course_of(
        clip.name,
        times,
        take.segments,
        classes=classes,
        known=library.classes,
        recognitions=recognitions,
        events=[event for recognition in recognitions for event in recognition.events],
        person=take.person,
        contains=take.contains,
    )


def _library(path: Path | None, skeleton: str | None) -> MotionLibrary:
    whole = library_at(path)
    return whole.restricted_to(joints_of(skeleton)) if skeleton else whole


def shared_joints(skeletons: Sequence[Skeleton]) -> tuple[str, ...]:
    """Give the joints that all takes and the library have; say which joints are lost.

    Raises
    ------
    SkeletonMismatchError
        Too few are left.
    """
    bodies = dict.fromkeys(skeleton.joints for skeleton in skeletons)
    every = tuple(dict.fromkeys(name for joints in bodies for name in joints))
    shared = tuple(name for name in every if all(name in joints for joints in bodies))
    if len(shared) < MIN_JOINTS:
        raise SkeletonMismatchError(
            f"joints: expected at least {MIN_JOINTS} that all takes and the library have, got {len(shared)}"
        )
    if len(shared) < len(every):
        lost = ", ".join(name for name in every if name not in shared)
        told = f"{len(shared)} joints that all takes and the library have; without {lost}"
        progress_console.print(told, soft_wrap=True, markup=False, highlight=False)
    return shared


def _motions(library: Path | None, sources: Sources, protocol: Protocol) -> list[Take]:
    """Take the library's own motions, if the protocol leaves each out of the library that recognises it."""
    if protocol is Protocol.LIBRARY:
        raise ValueError("TAKE, --takes, --unknown: expected takes with --protocol library, got none")
    whole = _library(library, sources.skeleton)
    return [take for take in takes_of(whole.motions) if sources.wants(take.person)]


def _require_classes(takes: Sequence[Take], sources: Sources, classes: Sequence[str]) -> None:
    """Refuse names that are no class: the figures would not show that no motion is known."""
    for class_name in sources.names.values():
        if class_name not in classes:
            raise ValueError(f"--map: expected one of {', '.join(classes)}, got {class_name!r}")
    labels = {label for take in takes for label in take.labels}
    if labels and not labels & set(classes):
        raise ValueError(
            f"expected a label that is a class of the library, got {', '.join(sorted(labels))}; --map LABEL=CLASS "
            f"renames them, to one of {', '.join(classes)}"
        )


def _by_person(folds: Sequence[Fold], courses: Sequence[Course], classes: Sequence[str]) -> dict[str, StreamScore]:
    """Score the takes of each person's fold separately, if folds are persons'."""
    return {
        person: score_courses(
            [course for fold, course in zip(folds, courses, strict=True) if fold.person == person], classes, _INSIDE
        )
        for person in sorted({fold.person for fold in folds} - {""})
    }


def _over_persons(persons: dict[str, StreamScore]) -> dict[str, dict[str, object]]:
    """Give every person's figures, their mean and the worst of each; None where no person has the figure."""
    figures = {person: score.figures() for person, score in persons.items()}
    mean, worst = dict[str, object](), dict[str, object]()
    for name in next(iter(figures.values())):
        there = [value for each in figures.values() if (value := each[name]) is not None]
        mean[name] = float(np.mean(there)) if there else None
        worst[name] = (max if name in LOWER_IS_BETTER else min)(there) if there else None
    return {"persons": dict(figures), "mean": mean, "worst": worst}
