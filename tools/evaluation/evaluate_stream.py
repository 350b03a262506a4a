"""`kinespace evaluate stream`: replays takes through the recogniser that runs live, and scores its answers.

Replays takes through the very recogniser that runs live, at full speed and without sockets, and compares the answer of
each moment with the movement performed at that moment.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from kinespace.library import MotionLibrary, WindowIndex
from kinespace.library.signature.parts import Kind
from kinespace.library.windows.taught import usual_weighing
from kinespace.stream import Recognizer, Settings
from kinespace.tools.cli.arguments import settings_of
from kinespace.tools.cli.console import progress, require_place_for_report, tell
from kinespace.tools.evaluation import harness, scores
from kinespace.tools.evaluation.annotations import is_annotation, write_annotations
from kinespace.tools.evaluation.harness import Take

_Values = dict[str, float | None]

#: Of what the intervals draw others.
_RESAMPLED = ("segments", "persons")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    harness.add_asked(parser)
    text = "draw segments (default) or persons for the intervals: how the figures vary with other segments, or people"
    parser.add_argument("--resample", choices=_RESAMPLED, default=_RESAMPLED[0], help=text)
    parser.add_argument("--without-part", choices=[*map(str, Kind)], help="leave this part of the signature out")
    text = "write a row for each answer: truth, guess, scores; or, for ELAN and BORIS, events (.eaf, .boris)"
    parser.add_argument("--answers", type=Path, metavar="FILE", help=text)
    text = "write a row for each segment: right, named, delays"
    parser.add_argument("--segments", type=Path, metavar="CSV", help=text)


def run(options: argparse.Namespace) -> None:
    """Replay takes, score the answers, and print the results."""
    for file in filter(None, (options.answers, options.segments)):
        require_place_for_report(file, options)
    asked, classes = harness.asked_of(options)
    annotates = options.answers and is_annotation(options.answers, len(asked))
    by_person = options.resample == "persons"
    if by_person and not all(each.take.person for each in asked):
        raise ValueError("--resample persons: expected the person of every take, got takes without (--actor-in name)")
    without = Kind(options.without_part) if options.without_part else None
    settings, played = settings_of(options), progress(asked, "Replaying", len(asked))
    answered = [replayed(each.take, _compared(each.library, without), classes, settings) for each in played]
    persons = _by_person(asked, answered, classes)
    if annotates:
        write_annotations(options.answers, answered)
    elif options.answers:
        scores.write_rows(options.answers, scores.answer_rows(answered, classes))
    if options.segments:
        scores.write_rows(options.segments, scores.segment_rows(answered, classes, harness.INSIDE))
    figures, described = scores.score_takes(answered, classes, harness.INSIDE)
    intervals = scores.intervals_of(figures, by_person=by_person)
    found = {**scores.values_of(figures), **described, "intervals": intervals}
    tables = [*scores.tables_of(found, "95 %, by person" if by_person else "95 %")]
    if persons:
        found |= {"persons": persons, **_over(persons)}
        tables.append(scores.table_of_persons(persons, _over(persons), harness.protocol_of(options)))
    tell(options, found, *tables)


def replayed(
    take: Take, compared: MotionLibrary | WindowIndex, classes: Sequence[str], settings: Settings
) -> scores.AnsweredTake:
    """Push a take through the recogniser, frame by frame, and compare its answers with the labels.

    Parameters
    ----------
    take
        A recording of the library's joints, in any order.
    compared, settings
        The recogniser's library and settings.
    classes
        All classes of an evaluation, including the library's; indices count in them.
    """
    library = compared.library if isinstance(compared, WindowIndex) else compared
    feed = harness.Feed.of(take.clip, library.skeleton, take.delivered)
    recognizer = Recognizer(compared, settings)
    answers = [answer for _, answer in harness.pushed(recognizer, feed) if answer is not None]
    played = scores.answered_take(take, feed.times, answers, classes=classes, known=library.classes)
    return replace(played, unlike=recognizer.fitting.unlike)


@lru_cache(maxsize=2)
def _compared(library: MotionLibrary, without: Kind | None) -> MotionLibrary | WindowIndex:
    """Give the library, or its windows without some parts."""
    return WindowIndex.of(library, weighing=usual_weighing(library).without(without)) if without else library


def _by_person(
    asked: Sequence[harness.AskedTake], answered: Sequence[scores.AnsweredTake], classes: Sequence[str]
) -> dict[str, _Values]:
    """Score the takes of each person's fold separately, if folds are persons'."""
    values = dict[str, _Values]()
    for person in sorted({each.person for each in asked} - {""}):
        own = [one for each, one in zip(asked, answered, strict=True) if each.person == person]
        figures, _ = scores.score_takes(own, classes, harness.INSIDE)
        values[person] = scores.values_of(figures)
    return values


def _over(persons: Mapping[str, _Values]) -> dict[str, _Values]:
    """Give the mean of all persons' figures, and the worst of each; None where no person has the figure."""
    mean, worst = dict[str, float | None](), dict[str, float | None]()
    for name in next(iter(persons.values())):
        there = [value for each in persons.values() if (value := each[name]) is not None]
        mean[name] = float(np.mean(there)) if there else None
        worst[name] = (max if name in scores.LOWER_IS_BETTER else min)(there) if there else None
    return {"mean": mean, "worst": worst}
