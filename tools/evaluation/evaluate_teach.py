"""`kinespace evaluate teach`: a person teaches by few examples; other motions of the same and of other persons ask.

Draws examples of one person's motions, makes a library of them, and replays what was recorded apart from them, of the
same person and of others, through the live recogniser.
"""

import argparse
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kinespace.library import Clip, MotionLibrary, WindowIndex
from kinespace.stream import EventKind, Outcome, Settings
from kinespace.stream.teaching.movement import moved_in
from kinespace.tools.cli.arguments import add_settings, settings_of
from kinespace.tools.cli.arguments import count as above_zero
from kinespace.tools.cli.console import counted, note, progress, scores_of, tell
from kinespace.tools.evaluation.harness import Feed, Take, add_sources, answers_to, shared_joints, takes_at
from kinespace.tools.evaluation.scores import percentile, ratio, values_of
from kinespace.tools.feeding.feed import resampled
from kinespace.tools.teaching.lessons import open_taught

#: A motion, and the name of the recording that it was cut from.
Motion = tuple[str, Clip]

#: Motions of a class that ask in one draw, at most: of the same person, and of all other persons.
_ASKED = {"same": 4, "other": 2}
#: Seed of the draws.
_SEED = 0
#: How much slower a motion is played to see whether it begins a lesson all the same.
_SLOW = 0.4
#: Seconds of a time of standing still, and how far a joint may be from its mean in them, metres.
_STOOD, _STAYS = 2.0, 0.05
_COLUMNS = (
    "examples {examples} | same person {same_first_right:.1%} | delay {delay_s:.2f} | "
    "false a minute {false_per_minute:.2f} | another person {other_first_right:.1%} | delay {other_delay_s:.2f} | "
    "false a minute {other_false_per_minute:.2f}"
)


class Reply(NamedTuple):
    """The start events of a motion that asked: their classes, and the seconds from its first frame to the first.

    And of its answers the number, and of these the number that named a class.
    """

    motion: Clip
    classes: tuple[str, ...]
    delay: float
    answers: int = 0
    named: int = 0

    @property
    def right(self) -> bool:
        """Whether the first names the class performed; a motion without a start event counts as wrong."""
        return self.classes[:1] == (self.motion.class_name,)

    @property
    def false_starts(self) -> int:
        """The number of start events of other classes."""
        return sum(each != self.motion.class_name for each in self.classes)


#: The replies by who asks, and by the number of examples.
Replies = Mapping[tuple[str, int], Sequence[Reply]]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    add_sources(parser, "the built-in library's motions")
    parser.add_argument("--person", default="", help="the performer of all takes that do not name one")
    text, usual = "examples of each class (default: 1 2 3)", [1, 2, 3]
    parser.add_argument("--examples", nargs="+", type=above_zero, default=usual, metavar="N", help=text)
    parser.add_argument("--draws", type=above_zero, default=20, help="draws of each person's examples (%(default)s)")
    text = "the persons who teach (default: all, in turn)"
    parser.add_argument("--teachers", nargs="+", default=[], metavar="PERSON", help=text)
    text = "ask each motion again with its class left out: how much of its time is named all the same?"
    parser.add_argument("--left-out", action="store_true", help=text)
    add_settings(parser)


def run(options: argparse.Namespace) -> int:
    """Draw examples, teach them, let other motions ask, and print how right the first start events were."""
    takes = takes_at(options, MotionLibrary.builtin())
    by_person = _motions(takes, options)
    if strange := {*options.teachers} - {*by_person}:
        raise ValueError(f"--teachers: expected some of {', '.join(sorted(by_person))}, got {min(strange)!r}")
    teachers = sorted(options.teachers or by_person)
    replies = _replies(by_person, teachers, options)
    if not any(replies.values()):
        note("nothing asked: each class needs one take more than --examples says; a take that teaches does not ask")
        return 1
    figures = {"examples": options.examples, **scored(replies, options.examples)}
    lessons = begun([clip for each in by_person.values() for _, clip in each]) | stood([take.clip for take in takes])
    found = {**figures, "persons": len(teachers), "draws": options.draws, **lessons}
    rows = [{name: each[place] for name, each in figures.items()} for place in range(len(options.examples))]
    title = "Motions asked that were not taught: is the first start event right?"
    caption = f"{counted(len(teachers), 'person')}, {counted(options.draws, 'draw')} each"
    tell(options, found, scores_of(rows, _COLUMNS, title=title, caption=caption, names=0))
    return 0


def _replies(
    by_person: Mapping[str, Sequence[Motion]], teachers: Sequence[str], options: argparse.Namespace
) -> Replies:
    """Ask what each teacher's draws teach; give the replies by who asks, and by the number of examples."""
    settings, replies = settings_of(options), defaultdict[tuple[str, int], list[Reply]](list)
    for place, teacher in enumerate(progress(teachers, "Teaching", len(teachers))):
        own = by_person[teacher]
        others = [clip for name, each in by_person.items() if name != teacher for _, clip in each]
        for draw in range(options.draws):
            for count in options.examples:
                generator = np.random.default_rng([_SEED, place, draw, count])
                examples, left = drawn(own, count, generator)
                if examples:
                    index = _opened(examples)
                    known = sorted({each.class_name for each in examples})
                    for whose, clips in (("same", left), ("other", others)):
                        asked = _some(clips, known, _ASKED[whose], generator)
                        replies[whose, count] += [ask(clip, index, settings) for clip in asked]
                        if options.left_out:
                            replies[f"unknown {whose}", count] += _strangers(asked, examples, settings)
    return replies


def _motions(takes: Sequence[Take], options: argparse.Namespace) -> dict[str, list[Motion]]:
    """Give each person's motions, over the joints that the built-in library has, too: its persons teach the metrics."""
    by_person = defaultdict[str, list["Motion"]](list)
    joints = shared_joints([*(take.clip.skeleton for take in takes), MotionLibrary.builtin().skeleton])
    for take in takes:
        for clip in take.motions():
            actor = clip.actor or options.person
            by_person[actor].append((take.clip.name, replace(clip.restricted_to(joints), actor=actor)))
    # As a library sorts its motions: they keep their order within a class.
    return {person: sorted(own, key=lambda each: each[1].class_name) for person, own in by_person.items()}


def _opened(examples: Sequence[Clip]) -> WindowIndex:
    """Open one person's examples as a file of taught motions is opened, in metrics learned without the person."""
    return open_taught(MotionLibrary.of_clips(examples), {examples[0].actor})


def drawn(own: Sequence[Motion], count: int, generator: np.random.Generator) -> tuple[list[Clip], list[Clip]]:
    """Draw the examples of each class, and give the motions of the same person that are left to ask.

    Recordings come in a drawn order, and each class is taught by its first motions; motions from the same recording as
    an example do not ask. So a person whose motions are cut from whole takes teaches from one take and asks in another.

    Parameters
    ----------
    own
        The person's motions.
    count
        The number of examples of each class.
    generator
        The generator of the draw.

    Returns
    -------
    The examples, and the motions to ask; empty where no class has enough examples.
    """
    takes = sorted({take for take, _ in own})
    order = {takes[place]: rank for rank, place in enumerate(generator.permutation(len(takes)).tolist())}
    chosen = defaultdict[str, list[Motion]](list)
    for motion in sorted(own, key=lambda each: order[each[0]]):
        chosen[motion[1].class_name].append(motion)
    examples = [motion for each in chosen.values() if len(each) >= count for motion in each[:count]]
    used = {take for take, _ in examples}
    left = [clip for take, clip in own if take not in used] if examples else []
    return [clip for _, clip in examples], left


def _some(clips: Sequence[Clip], classes: Sequence[str], most: int, generator: np.random.Generator) -> list[Clip]:
    """Draw some motions of each class."""
    chosen = list["Clip"]()
    for class_name in classes:
        own = [clip for clip in clips if clip.class_name == class_name]
        chosen += [own[place] for place in generator.permutation(len(own))[:most].tolist()]
    return chosen


def ask(motion: Clip, index: WindowIndex, settings: Settings) -> Reply:
    """Push a motion through the recogniser, and keep its start events."""
    answers = answers_to(Feed.of(motion, index.library.skeleton), index, settings)
    starts = [event for each in answers for event in each.events if event.kind is EventKind.START]
    named = sum(answer.outcome is Outcome.NAMED for answer in answers)
    delay = starts[0].time if starts else np.nan
    return Reply(motion, tuple(each.label for each in starts), delay, len(answers), named)


def _strangers(asked: Sequence[Clip], examples: Sequence[Clip], settings: Settings) -> list[Reply]:
    """Ask motions whose class was not taught: the others' examples alone are opened."""
    # What is done says nothing about names, and takes long to open.
    settings = replace(settings, false_alarms=0.0)
    opened = dict[str, WindowIndex]()
    for name in {clip.class_name for clip in asked}:
        opened[name] = _opened([each for each in examples if each.class_name != name])
    return [ask(clip, opened[clip.class_name], settings) for clip in asked]


def begun(motions: Sequence[Clip]) -> dict[str, float]:
    """Give the share of motions that begin a lesson, as recorded and at two fifths of their speed, and their number.

    Nobody stands in a cut motion: the movement that begins it is the usual one, and the first tenths are lost.
    """
    slow = [resampled(replace(each, frame_rate=_SLOW * each.frame_rate), each.frame_rate) for each in motions]
    shares = [float(np.mean([any(moved_in(each)) for each in played])) for played in (motions, slow)]
    return {"begins": shares[0], "begins_slow": shares[1], "motions": len(motions)}


def stood(takes: Sequence[Clip]) -> dict[str, float | None]:
    """Give the share of times of standing still that begin a lesson, and their number; times overlap.

    A time lasts `_STOOD` seconds, in which all joints stay within `_STAYS` of their mean.
    """
    begins = list[bool]()
    for take in takes:
        long = round(_STOOD * take.frame_rate)
        for first in range(0, take.frames - long, long // 2):
            positions = take.positions[first : first + long]
            if (np.linalg.norm(positions - positions.mean(axis=0), axis=2) <= _STAYS).all():
                begins.append(any(moved_in(replace(take, positions=positions, gaps=(), filled=0))))
    return {"stood_begins": float(np.mean(begins)) if begins else None, "stood": len(begins)}


def scored(replies: Replies, examples: Sequence[int]) -> dict[str, list[float | None]]:
    """Give the figures for each number of examples, in order; None where no motion could ask.

    Of the same person's motions and of others': the shares whose first start event is right, that had a start event,
    and, of these, whose first is right; the median seconds to a right first start event; start events of other classes
    a minute; the number of motions that asked, over all draws; and of motions whose class was left out, where such
    asked, the share of the time that was named, and start events a minute.
    """
    figures = defaultdict[str, list[float | None]](list)
    left_out = any(whose.startswith("unknown") for whose, _ in replies)
    for count in examples:
        for whose, prefix in (("same", ""), ("other", "other_")):
            asked = replies.get((whose, count), [])
            right, one = [each.right for each in asked], [1.0] * len(asked)
            started = [bool(each.classes) for each in asked]
            false, seconds = [each.false_starts for each in asked], [each.motion.duration for each in asked]
            found = {
                f"{whose}_first_right": ratio(right, one),
                f"{whose}_started": ratio(started, one),
                f"{whose}_first_right_of_started": ratio(right, started),
                f"{prefix}delay_s": percentile([[each.delay] for each in asked if each.right], 50),
                f"{prefix}false_per_minute": ratio(false, seconds, 60),
            }
            if left_out:
                unknown = replies.get((f"unknown {whose}", count), [])
                starts, seconds = [len(each.classes) for each in unknown], [each.motion.duration for each in unknown]
                named, answers = [each.named for each in unknown], [each.answers for each in unknown]
                found[f"{prefix}unknown_named"] = ratio(named, answers)
                found[f"{prefix}unknown_starts_per_minute"] = ratio(starts, seconds, 60)
            for name, value in (values_of(found) | {f"{whose}_asked": len(asked)}).items():
                figures[name].append(value)
    return dict(figures)
