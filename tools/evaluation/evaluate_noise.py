"""`kinespace evaluate noise`: motions as a noisy sensor sees them, through the recogniser that runs live."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.cli.arguments import (
    add_clips,
    add_json,
    add_settings,
    count,
    not_negative,
    reading_of,
    settings_of,
)
from kinespace.tools.evaluation.scoring.bootstrap import Interval, Ratio
from kinespace.tools.evaluation.scoring.stream_tables import interval, percent
from kinespace.tools.feeding.joint_sets import joints_of
from kinespace.tools.terminal.console import console, progress
from kinespace.tools.terminal.named_joints import read_labelled
from kinespace.tools.terminal.tables import narrow_table

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence
    from pathlib import Path

    from kinespace.library import Clip, Reading
    from kinespace.stream.recognition import Recognition

#: Frames per second of noisy sensors.
FRAME_RATE = 30.0


@dataclass(frozen=True, slots=True)
class Heard:
    """The answers to one motion: their number, and in how many the class named and the best guess were right."""

    person: str
    seconds: float
    answers: int
    named: int
    guessed: int
    last_named: bool
    last_guessed: bool


@dataclass(frozen=True, slots=True)
class NoiseScore:
    """How right the answers under one noise were. Shares are 0 to 1; an answer without a class is not right.

    Attributes
    ----------
    noise_mm
        Standard deviation of each coordinate, millimetres.
    answers_right, answers_guessed
        The shares of all answers that name the class performed, and that have it as best guess, named or not.
    clips_right, clips_guessed
        The same shares of the motions' last answers; a motion without an answer counts as wrong.
    seconds, clips, persons
        The basis of the figures; persons None when they are not known.
    intervals
        Ends of the 95 % interval of each share, by its name: bootstrap over motions.
    """

    noise_mm: float
    answers_right: float | None
    answers_guessed: float | None
    clips_right: float | None
    clips_guessed: float | None
    seconds: float
    clips: int
    persons: int | None
    intervals: dict[str, Interval | None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Plays motions at 30 frames per second with white noise on every coordinate into the live recogniser. Motions "
        "are left out of the library in groups, so that no motion is named by itself."
    )
    add_clips(parser, "the built-in library's motions")
    parser.add_argument(
        "--noise",
        nargs="+",
        type=not_negative,
        default=[0.0, 10.0, 20.0, 30.0],
        metavar="MM",
        help="standard deviations on each coordinate (default: 0 10 20 30)",
    )
    parser.add_argument("--groups", type=count, default=12, help="number of groups, at least two (default %(default)s)")
    parser.add_argument("--every", type=count, default=1, help="play every nth motion alone (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the noise (default %(default)s)")
    parser.add_argument("--skeleton", metavar="NAME", help="with the joints of this product alone, like kinectv2")
    add_settings(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    return evaluate(
        options.folder,
        reading=reading_of(options),
        noises=options.noise,
        groups=options.groups,
        every=options.every,
        seed=options.seed,
        skeleton=options.skeleton,
        settings=settings_of(options),
        as_json=options.json,
    )


def evaluate(
    places: Sequence[Path],
    *,
    reading: Reading,
    noises: Sequence[float],
    groups: int,
    every: int,
    seed: int,
    skeleton: str | None,
    settings: Settings,
    as_json: bool,
) -> int:
    """Replay motions under each noise, and print how right the answers were.

    Parameters
    ----------
    places
        Clips, or folders of them; the built-in library's motions when there are none.
    reading
        How to read them.
    noises
        Standard deviations of each coordinate, millimetres.
    groups
        The number of groups; each group is left out of the library that names its motions.
    every
        Every so many motions one is played; all stay in the groups.
    seed
        The seed of the noise.
    skeleton
        Name of a joint set to which motions are restricted; all joints when not given.
    settings
        The recogniser's settings.
    as_json
        Print one JSON object and nothing else.
    """
    library = _library(places, reading)
    if skeleton:
        library = library.restricted_to(joints_of(skeleton))
    left_out = _groups(library, groups)
    heard: dict[float, dict[int, Heard]] = {noise: {} for noise in noises}
    for group in progress(left_out, "Replaying", len(left_out)):
        others = library.without(motions=[library.motions[index] for index in group])
        for noise in noises:
            for index in (each for each in group if each % every == 0):
                generator = np.random.default_rng([seed, index])
                heard[noise][index] = _heard(library.motions[index], others, settings, noise / 1000, generator)
    scores = [scored(noise, [each[index] for index in sorted(each)]) for noise, each in heard.items()]
    if as_json:
        print(json.dumps({"groups": len(left_out), "noise": [asdict(score) for score in scores]}))
    else:
        _print(scores, len(left_out))
    return 0


def _library(places: Sequence[Path], reading: Reading) -> MotionLibrary:
    if not places:
        return MotionLibrary.builtin()
    return MotionLibrary.of_clips(read_labelled(places, reading))


def _groups(library: MotionLibrary, groups: int) -> list[range]:
    """Distribute motions, which are sorted by class and person, so that each group has some of every class."""
    if not 2 <= groups <= len(library):
        raise ValueError(f"--groups: expected 2 to {len(library)}, the motions there are, got {groups}")
    return [range(first, len(library), groups) for first in range(groups)]


def _heard(
    motion: Clip, library: MotionLibrary, settings: Settings, noise: float, generator: np.random.Generator
) -> Heard:
    """Play a motion with noise in metres, and count its answers."""
    seen = seen_with(motion, noise, generator)
    recognizer = Recognizer(library, settings)
    pushed = (recognizer.push(Frame("clip", *each)) for each in zip(seen.times.tolist(), seen.positions, strict=True))
    answers = [answer for answer in pushed if answer is not None]
    named = [answer.class_name == motion.class_name for answer in answers]
    guessed = [_guess(answer) == motion.class_name for answer in answers]
    return Heard(
        motion.actor,
        motion.duration,
        len(answers),
        sum(named),
        sum(guessed),
        last_named=bool(named and named[-1]),
        last_guessed=bool(guessed and guessed[-1]),
    )


def seen_with(motion: Clip, noise: float, generator: np.random.Generator) -> Clip:
    """Give a motion as a sensor of `FRAME_RATE` sees it, with white noise in metres on every coordinate."""
    every = max(round(motion.frame_rate / FRAME_RATE), 1)
    positions = motion.positions[::every]
    positions = positions + noise * generator.standard_normal(positions.shape)
    return replace(motion, positions=positions, frame_rate=motion.frame_rate / every)


def _guess(answer: Recognition) -> str | None:
    return answer.classes[answer.guess_index] if answer.guess_index >= 0 else None


def scored(noise: float, heard: Sequence[Heard]) -> NoiseScore:
    """Score the answers under one noise, in millimetres."""
    answers, one = [each.answers for each in heard], [1] * len(heard)
    shares = {
        "answers_right": Ratio([each.named for each in heard], answers),
        "answers_guessed": Ratio([each.guessed for each in heard], answers),
        "clips_right": Ratio([each.last_named for each in heard], one),
        "clips_guessed": Ratio([each.last_guessed for each in heard], one),
    }
    persons = {each.person for each in heard}
    return NoiseScore(
        noise_mm=noise,
        **{name: share.value() for name, share in shares.items()},
        seconds=math.fsum(each.seconds for each in heard),
        clips=len(heard),
        persons=None if "" in persons else len(persons),
        intervals={name: share.interval() for name, share in shares.items()},
    )


def _print(scores: Sequence[NoiseScore], groups: int) -> None:
    first = scores[0]
    persons = "persons not told" if first.persons is None else f"{first.persons} persons"
    table = narrow_table(
        "Motions with white noise on every coordinate, 30 frames per second",
        f"{first.seconds:.0f} s, {first.clips} motions, {persons}; left out in {groups} groups; 95 % below",
    )
    for heading in ("noise", "answers right", "guessed right", "last answer right", "last guess right"):
        table.add_column(heading, justify="right")
    shares = ("answers_right", "answers_guessed", "clips_right", "clips_guessed")
    for score in scores:
        values = [getattr(score, name) for name in shares]
        table.add_row(f"{score.noise_mm:g} mm", *("-" if value is None else percent(value) for value in values))
        table.add_row("", *(interval(score.intervals[name], percent) for name in shares))
    console.print(table)
