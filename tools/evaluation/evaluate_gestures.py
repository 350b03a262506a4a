"""`kinespace evaluate gestures`: gestures taught by the first example of each, and asked for in long takes.

Of each person the first labelled segment of each class teaches, cut to its movement; the others ask. The takes are
played through the live recogniser. In a segment's time the first right word is found; a wrong word is false, and misses
the gesture; a second right word is false. Segments that teach, segments labelled `repeated` and time without a label
count neither way; in segments labelled `nothing` every word is false.
"""

import argparse
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinespace.library import NOTHING, Clip, MotionLibrary, WindowIndex
from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream import Settings
from kinespace.tools.cli.arguments import add_settings, settings_of
from kinespace.tools.cli.console import progress, require_place_for_report, scores_of, tell
from kinespace.tools.evaluation.harness import Feed, Take, add_sources, answers_to, shared_joints, takes_at, written
from kinespace.tools.evaluation.scores import basis_of, interval, ratio, rests_on, write_rows
from kinespace.tools.evaluation.words import COLUMNS, KINDS, Heard, Span, right_so_far, said_in, score_words, word_rows
from kinespace.tools.teaching.lessons import open_taught

#: Each class's first segment, and the take that it lies in.
Lessons = Mapping[str, tuple[Take, Segment]]

#: The label of a command that was asked again at once.
_REPEATED = "repeated"
#: The share of a segment's movement that lies before its gesture, and as much behind it; seconds that are kept before
#: and after it; seconds over which movement is averaged.
_AROUND, _BEFORE, _AFTER, _AVERAGED = 0.02, 0.13, 0.17, 0.1
_SPANS = dict.fromkeys(KINDS, Span(commands=True))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    add_sources(parser, "the built-in library's motions")
    text = "the person's own examples teach (default), the next person's, or those of all other persons"
    parser.add_argument("--taught-by", choices=["own", "next", "all"], default="own", help=text)
    add_settings(parser)
    add_answers(parser)


def run(options: argparse.Namespace) -> None:
    """Teach each person's gestures, play the takes, and print how rightly the gestures were said."""
    if options.answers:
        require_place_for_report(options.answers, options)
    takes = takes_at(options, MotionLibrary.builtin())
    joints = shared_joints([take.clip.skeleton for take in takes])
    by_person = defaultdict[str, list["Take"]](list)
    for take in takes:
        by_person[take.person].append(replace(take, clip=take.clip.restricted_to(joints)))
    lessons = {person: first_of(own) for person, own in by_person.items()}
    settings, heard = settings_of(options), list[Heard]()
    for person in progress(sorted(by_person), "Playing", len(by_person)):
        teachers = _teachers(person, sorted(by_person), options.taught_by)
        index = _opened([lessons[each] for each in teachers], person)
        heard += [listened(take, index, lessons[person], settings) for take in by_person[person]]
    title = f"Gestures taught by one example: {options.taught_by}"
    report(heard, options, title, "delay: from the end of the gesture's movement")


def first_of(takes: Sequence[Take]) -> Lessons:
    """Give the first segment of each class in one person's takes."""
    first: dict[str, tuple[Take, Segment]] = {}
    for take in takes:
        for segment in take.segments:
            if segment.label not in (_REPEATED, NOTHING):
                first.setdefault(segment.label, (take, segment))
    return first


def _teachers(person: str, persons: Sequence[str], taught_by: str) -> list[str]:
    """Say whose examples teach."""
    if taught_by == "own":
        return [person]
    if len(persons) < 2:
        raise ValueError(f"--taught-by {taught_by}: expected takes of several persons, got {len(persons)}; --actor-in")
    place = persons.index(person)
    others = [*persons[place + 1 :], *persons[:place]]
    return others[:1] if taught_by == "next" else others


def _opened(lessons: Sequence[Lessons], person: str) -> WindowIndex:
    """Open examples as a file of taught motions is opened, in metrics learned without the person."""
    examples = [example_of(*each) for of_teacher in lessons for each in of_teacher.values()]
    if not examples:
        raise ValueError("TAKE: expected labelled segments that teach, got none")
    return open_taught(MotionLibrary.of_clips(examples), {person})


def example_of(take: Take, segment: Segment) -> Clip:
    """Cut a segment's movement out of a take."""
    first, last = moved(take.clip, segment)
    positions, rotations = take.clip.positions[first:last], np.zeros((last - first, 0))
    return replace(take.clip, positions=positions, rotations=rotations, class_name=segment.label, gaps=())


def moved(take: Clip, segment: Segment) -> tuple[int, int]:
    """Give the frames, from the first to before the last, in which a segment's movement lies.

    By the sum of all joints' squared speeds: what happens before and after nearly all of it is left out.
    """
    begin, end = (round(time * take.frame_rate) for time in (segment.start, segment.end))
    steps = np.diff(take.positions[begin:end].astype(np.float64), axis=0)
    width = max(round(_AVERAGED * take.frame_rate), 1)
    speeds = np.convolve(np.square(steps).sum(axis=(1, 2)), np.ones(width) / width, "same")
    if not speeds.sum():
        return begin, min(end, take.frames)
    first, last = np.searchsorted(np.cumsum(speeds) / speeds.sum(), [_AROUND, 1 - _AROUND]).tolist()
    before, after = round(_BEFORE * take.frame_rate), round(_AFTER * take.frame_rate)
    return begin + max(first - before, 0), min(begin + last + after, end, take.frames)


def listened(take: Take, index: WindowIndex, lessons: Lessons, settings: Settings) -> Heard:
    """Play a take, and match what is said with the segments that ask."""
    taught = [segment for of, segment in lessons.values() if of is take]
    asked = [each for each in take.segments if each.label != _REPEATED and each not in taught]
    skeleton = index.library.skeleton
    feed = Feed.of(take.clip.restricted_to(skeleton.joints), skeleton, take.delivered)
    answers = answers_to(feed, index, settings)
    ends = {each: moved(take.clip, each)[1] / take.clip.frame_rate for each in asked}
    seconds = sum(each.duration for each in asked)
    so_far = right_so_far(answers, {each: end for each, end in ends.items() if each.label != NOTHING})
    return Heard(take.person, seconds, asked, said_in(answers), _SPANS, dict.fromkeys(KINDS, ends), so_far)


def add_answers(parser: argparse.ArgumentParser) -> None:
    """Add the option for what is written."""
    text = "write every word said: person, time, kind, class, whether it is right, its segment"
    parser.add_argument("--answers", type=Path, metavar="CSV", help=text)


def report(heard: Sequence[Heard], options: argparse.Namespace, title: str, caption: str, **further: object) -> None:
    """Print the scores of all takes together, write the words; `further` is for JSON."""
    scores, basis = score_words(heard), basis_of([each.seconds for each in heard], [each.person for each in heard])
    basis["segments"] = sum(each.asked for each in heard)
    so_far = ratio([each.so_far for each in heard], [each.asked for each in heard]).value()
    if options.answers:
        write_rows(options.answers, word_rows(heard))
    rows = [{"name": kind, **score, "interval": interval(score["intervals"]["f1"])} for kind, score in scores.items()]
    caption = f"{rests_on(basis, 'gesture')}; {written(so_far)} right so far at a gesture's end; {caption}"
    found = {**scores, "so_far": so_far, **further, **basis}
    tell(options, found, scores_of(rows, COLUMNS, title=title, caption=caption))
