"""`kinespace evaluate teach`: a person teaches by few examples; other motions of the same and of other persons ask."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.library.windows.index import WindowIndex, teacher_of
from kinespace.tools.cli.arguments import (
    add_actor_in,
    add_json,
    add_labels,
    add_reading,
    add_settings,
    reading_of,
    settings_of,
)
from kinespace.tools.cli.arguments import count as above_zero
from kinespace.tools.evaluation.scoring.bootstrap import Percentile, Ratio
from kinespace.tools.evaluation.scoring.hearing import heard, starts_heard, starts_of
from kinespace.tools.evaluation.takes import Sources, read_takes, takes_of
from kinespace.tools.terminal.console import console, progress
from kinespace.tools.terminal.tables import narrow_table

if TYPE_CHECKING:
    import argparse
    from collections.abc import Collection, Sequence

    from kinespace.library import Clip, Reading
    from kinespace.stream.recognition import Event
    from kinespace.stream.recognizer import Settings
    from kinespace.tools.evaluation.scoring.hearing import Hop

#: Motions of a class that ask in one draw, at most: of the same person, and of all other persons.
_ASKED_OWN, _ASKED_OTHERS = 4, 2
#: Seconds between two windows of a taught motion.
_EVERY = 0.1


@dataclass(frozen=True, slots=True)
class Asked:
    """The result of one motion that asked.

    Attributes
    ----------
    seconds
        Its length in seconds.
    first
        Class of the first start event; empty when there was none.
    right
        Whether this is the class performed.
    delay
        Seconds from the motion's first frame to the first start event; NaN when there was none.
    false_starts
        Start events of other classes.
    """

    seconds: float
    first: str
    right: bool
    delay: float
    false_starts: int


@dataclass(frozen=True, slots=True)
class TeachScore:
    """Figures for each number of examples, in the order of `examples`; None where no motion could ask.

    Attributes
    ----------
    examples
        The numbers of examples of each class that were taught.
    same_first_right, other_first_right
        Share of the motions whose first start event names the class performed, of the person who taught and of others.
        A motion without a start event counts as wrong.
    same_started, other_started
        Share of the motions that had a start event.
    same_first_right_of_started, other_first_right_of_started
        Share of the motions with a start event whose first start event is right.
    delay_s, other_delay_s
        Seconds from a motion's first frame to its first start event, if that is right, median.
    false_per_minute, other_false_per_minute
        Start events of other classes than the one performed, per minute.
    same_asked, other_asked
        The number of motions that asked, over all draws; a motion may ask in several draws.
    persons, draws
        The number of persons who taught, and of draws for each person.
    """

    examples: list[int]
    same_first_right: list[float | None] = field(default_factory=list)
    other_first_right: list[float | None] = field(default_factory=list)
    delay_s: list[float | None] = field(default_factory=list)
    false_per_minute: list[float | None] = field(default_factory=list)
    same_started: list[float | None] = field(default_factory=list)
    other_started: list[float | None] = field(default_factory=list)
    same_first_right_of_started: list[float | None] = field(default_factory=list)
    other_first_right_of_started: list[float | None] = field(default_factory=list)
    other_delay_s: list[float | None] = field(default_factory=list)
    other_false_per_minute: list[float | None] = field(default_factory=list)
    same_asked: list[int] = field(default_factory=list)
    other_asked: list[int] = field(default_factory=list)
    persons: int = 0
    draws: int = 0

    def add(self, same: Sequence[Asked], other: Sequence[Asked]) -> None:
        """Score the motions that asked with the next number of examples."""
        for whose, asked in (("same", same), ("other", other)):
            prefix = "" if whose == "same" else "other_"
            right, one = [each.right for each in asked], [1.0] * len(asked)
            started = [bool(each.first) for each in asked]
            figures = {
                f"{whose}_first_right": Ratio(right, one).value(),
                f"{whose}_started": Ratio(started, one).value(),
                f"{whose}_first_right_of_started": Ratio(right, started).value(),
                f"{prefix}delay_s": Percentile([[each.delay] for each in asked if each.right], 50).value(),
                f"{prefix}false_per_minute": Ratio(
                    [each.false_starts for each in asked], [each.seconds for each in asked], scale=60.0
                ).value(),
                f"{whose}_asked": len(asked),
            }
            for name, figure in figures.items():
                getattr(self, name).append(figure)


@dataclass(frozen=True, slots=True, eq=False)
class _Person:
    """One person's motions as one library, whose windows are computed once; each draw opens some of them.

    Attributes
    ----------
    index
        The windows of all motions that the person may teach.
    takes
        For each of the library's motions the name of the recording that it was cut from.
    beside
        Indices of the library's motions that nobody teaches: the built-in ones.
    """

    index: WindowIndex
    takes: tuple[str, ...]
    beside: tuple[int, ...] = ()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Draws examples of one person's motions, makes a library of them, and replays what was recorded apart from "
        "them, of the same person and of others, through the live recogniser."
    )
    parser.add_argument(
        "takes",
        nargs="*",
        type=Path,
        metavar="TAKE",
        help="labelled takes, clips named as HDM05's, or folders of them (default: the built-in library's motions)",
    )
    add_labels(parser, "for each TAKE, in order (default: beside the take, called like it)")
    parser.add_argument("--clips", action="store_true", help="a recording without labels is one motion, of its folder")
    add_reading(parser)
    add_actor_in(parser)
    parser.add_argument("--person", default="", help="the performer of all takes that do not name one")
    parser.add_argument(
        "--examples",
        nargs="+",
        type=above_zero,
        default=[1, 2, 3],
        metavar="N",
        help="examples of each class (default: 1 2 3)",
    )
    parser.add_argument(
        "--draws", type=above_zero, default=20, help="draws of each person's examples (default %(default)s)"
    )
    parser.add_argument(
        "--teachers", nargs="+", default=[], metavar="PERSON", help="the persons who teach (default: all, in turn)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the draws (default %(default)s)")
    parser.add_argument("--beside", action="store_true", help="teach beside the built-in library")
    add_settings(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    return evaluate(
        Sources(options.takes, options.labels, clips=options.clips),
        reading=reading_of(options),
        person=options.person,
        examples=options.examples,
        draws=options.draws,
        teachers=options.teachers,
        seed=options.seed,
        beside=options.beside,
        settings=settings_of(options),
        as_json=options.json,
    )


def evaluate(
    sources: Sources,
    *,
    reading: Reading,
    person: str,
    examples: Sequence[int],
    draws: int,
    teachers: Sequence[str],
    seed: int,
    beside: bool,
    settings: Settings,
    as_json: bool,
) -> int:
    """Draw examples, teach them, let other motions ask, and print how right the first start events were.

    Parameters
    ----------
    sources
        Labelled takes or clips; with none the built-in library's motions.
    reading
        How to read them.
    person
        The person who performs in takes that name none.
    examples
        The numbers of examples of each class.
    draws
        How many times examples are drawn for each person.
    teachers
        The persons who teach; empty for all.
    seed
        The seed of the draws.
    beside
        Teach beside the built-in library instead of alone. The person who teaches is left out of it, and the taught
        classes are called `my ...`: they must win over the built-in classes, even over those of the same motion.
    settings
        The recogniser's settings.
    as_json
        Print one JSON object and nothing else.
    """
    takes = read_takes(sources, reading) if sources else takes_of(MotionLibrary.builtin().motions)
    builtin = MotionLibrary.builtin()
    mine = "my {}" if beside else "{}"
    motions = [
        (take.clip.name, replace(clip, class_name=mine.format(clip.class_name), actor=clip.actor or person))
        for take in takes
        for clip in take.motions()
    ]
    by_person: dict[str, list[tuple[str, Clip]]] = defaultdict(list)
    for name, clip in motions:
        by_person[clip.actor].append((name, clip))
    taught_by = {name: by_person[name] for name in _checked(teachers, by_person) or by_person}
    score = TeachScore(list(examples), persons=len(taught_by), draws=draws)
    same: dict[int, list[Asked]] = {count: [] for count in examples}
    other: dict[int, list[Asked]] = {count: [] for count in examples}
    for place, (teaching, own) in enumerate(progress(sorted(taught_by.items()), "Teaching", len(taught_by))):
        taught = _person(own, beside=beside)
        asking = _Asking(taught.index, settings)
        others = [clip for name, each in by_person.items() if name != teaching for _, clip in each]
        if beside:
            # The built-in library knows its own persons, so they do not ask.
            others = [clip for clip in others if clip.actor not in builtin.actors]
        for draw in range(draws):
            for count in examples:
                generator = np.random.default_rng([seed, place, draw, count])
                chosen, asked = drawn(own, taught, count, generator)
                if not chosen:
                    continue
                index = taught.index.of_some([*taught.beside, *chosen])
                known = {taught.index.library.motions[motion].class_name for motion in chosen}
                same[count] += asking.ask(asked, index, known, _ASKED_OWN, generator)
                other[count] += asking.ask(others, index, known, _ASKED_OTHERS, generator)
    for count in examples:
        score.add(same[count], other[count])
    if as_json:
        print(json.dumps(asdict(score)))
    else:
        _print(score)
    return 0


def _checked(teachers: Sequence[str], known: Collection[str]) -> Sequence[str]:
    """Refuse a teacher who performs nothing."""
    for name in teachers:
        if name not in known:
            raise ValueError(f"--teachers: expected some of {', '.join(sorted(known))}, got {name!r}")
    return teachers


def drawn(
    own: Sequence[tuple[str, Clip]], taught: _Person, count: int, generator: np.random.Generator
) -> tuple[list[int], list[Clip]]:
    """Draw the examples of each class, and give the motions of the same person that are left to ask.

    Recordings come in a drawn order, and each class is taught by its first motions; motions from the same recording as
    an example do not ask. So a person whose motions are cut from whole takes teaches from one take and asks in another.

    Parameters
    ----------
    own
        The person's motions, each with its recording's name.
    taught
        The same motions as a library.
    count
        The number of examples of each class.
    generator
        The generator of the draw.

    Returns
    -------
    Indices of the examples in the library, and the motions to ask; empty where no class has enough examples.
    """
    classes = {clip.class_name for _, clip in own}
    places = defaultdict(list)
    for index, (motion, take) in enumerate(zip(taught.index.library.motions, taught.takes, strict=True)):
        if take and motion.class_name in classes:
            places[take].append(index)
    takes = sorted(places)
    order = [takes[place] for place in generator.permutation(len(takes))]
    chosen: dict[str, list[int]] = defaultdict(list)
    for take in order:
        for index in places[take]:
            mine = chosen[taught.index.library.motions[index].class_name]
            if len(mine) < count:
                mine.append(index)
    examples = [index for mine in chosen.values() if len(mine) == count for index in mine]
    used = {taught.takes[index] for index in examples}
    return examples, [clip for take, clip in own if take not in used] if examples else []


def _person(own: Sequence[tuple[str, Clip]], *, beside: bool) -> _Person:
    """Compute the windows of all motions that one person may teach, in metrics learned without the person."""
    library = MotionLibrary.of_clips([clip for _, clip in own])
    person = own[0][1].actor
    builtin = MotionLibrary.builtin().restricted_to(library.skeleton.joints)
    strangers = builtin.without(actors=[person]) if person in builtin.actors else builtin
    # A library's motions are sorted, but keep their order within a class and person.
    names = [name for name, _ in sorted(own, key=lambda each: each[1].class_name)]
    if not beside:
        teacher = teacher_of(library)
        if teacher is not library:
            teacher = replace(strangers, learned=None).restricted_to(library.skeleton.joints)
            library = replace(
                library,
                skeleton=teacher.skeleton,
                motions=tuple(each.as_of(teacher.skeleton) for each in library.motions),
            )
        return _Person(WindowIndex.of(library, teacher), tuple(names))
    taught = [replace(motion, actor="").as_of(strangers.skeleton) for motion in library.motions]
    index = WindowIndex.of(strangers).with_motions(taught, every=_EVERY)
    own_names = iter(names)
    takes = tuple("" if motion.actor else next(own_names) for motion in index.library.motions)
    return _Person(index, takes, tuple(place for place, take in enumerate(takes) if not take))


class _Asking:
    """Asks motions of one person's libraries; each motion is heard once.

    Parameters
    ----------
    everything
        The windows of all that the person may teach: the libraries are made of some of them.
    settings
        Of the recogniser.
    """

    def __init__(self, everything: WindowIndex, settings: Settings) -> None:
        self._everything, self._settings = everything, settings
        self._heard: dict[int, Sequence[Hop] | None] = {}

    def ask(
        self, clips: Sequence[Clip], index: WindowIndex, known: set[str], most: int, generator: np.random.Generator
    ) -> list[Asked]:
        """Ask some motions of each class that is known, drawn at random."""
        asked = []
        for class_name in sorted(known):
            mine = [clip for clip in clips if clip.class_name == class_name]
            places = generator.permutation(len(mine))[:most]
            asked += [scored(mine[place], self._starts(mine[place], index)) for place in places.tolist()]
        return asked

    def _starts(self, clip: Clip, index: WindowIndex) -> list[Event]:
        if id(clip) not in self._heard:
            self._heard[id(clip)] = heard(clip, self._everything, self._settings)
        hops = self._heard[id(clip)]
        return starts_of(clip, index, self._settings) if hops is None else starts_heard(hops, index, self._settings)


def scored(clip: Clip, starts: Sequence[Event]) -> Asked:
    """Look at the start events of a motion that was asked."""
    first = starts[0] if starts else None
    return Asked(
        seconds=clip.duration,
        first=first.label if first else "",
        right=first is not None and first.label == clip.class_name,
        delay=first.time if first else math.nan,
        false_starts=sum(start.label != clip.class_name for start in starts),
    )


def _print(score: TeachScore) -> None:
    table = narrow_table(
        "Motions asked that were not taught: is the first start event right?",
        f"{score.persons} persons, {score.draws} draws each",
    )
    for heading in ("examples", "same person", "delay", "false a minute", "another person", "delay", "false a minute"):
        table.add_column(heading, justify="right")
    for place, count in enumerate(score.examples):
        table.add_row(
            str(count),
            *(
                _told(getattr(score, name)[place], form)
                for name, form in (
                    ("same_first_right", ".1%"),
                    ("delay_s", ".2f"),
                    ("false_per_minute", ".2f"),
                    ("other_first_right", ".1%"),
                    ("other_delay_s", ".2f"),
                    ("other_false_per_minute", ".2f"),
                )
            ),
        )
    console.print(table)


def _told(figure: float | None, form: str) -> str:
    return "-" if figure is None else format(figure, form)
