"""`kinespace evaluate noise`: motions as a noisy sensor sees them, through the recogniser that runs live."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.tools.cli.arguments import (
    add_clips,
    add_json,
    add_settings,
    count,
    not_negative,
    reading_of,
    settings_of,
)
from kinespace.tools.evaluation.faults import noisy
from kinespace.tools.evaluation.harness import Feed, add_skeleton, answers_to, print_json, print_table, written
from kinespace.tools.evaluation.scoring.answers import counted, shares
from kinespace.tools.evaluation.scoring.bootstrap import intervals_of, values_of
from kinespace.tools.evaluation.scoring.stream_score import basis_of
from kinespace.tools.evaluation.scoring.stream_tables import interval, rests_on
from kinespace.tools.evaluation.takes import takes_of
from kinespace.tools.feeding.joint_sets import joints_of
from kinespace.tools.terminal.console import progress
from kinespace.tools.terminal.named_joints import read_labelled

if TYPE_CHECKING:
    import argparse
    from collections import Counter

#: Of each figure what is counted, and among what: answers that name the class performed, and that have it as best
#: guess, named or not; and the same of the motions' last answers. A motion without an answer counts as wrong.
_SHARES = {
    "answers_right": ("right", "answers"),
    "answers_guessed": ("guessed", "answers"),
    "clips_right": ("last_right", "takes"),
    "clips_guessed": ("last_guessed", "takes"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Plays motions at 30 frames per second with white noise on every coordinate into the live recogniser. Motions "
        "are left out of the library in groups, so that no motion is named by itself."
    )
    add_clips(parser, "the built-in library's motions")
    text, usual = "standard deviations on each coordinate (default: 0 10 20 30)", [0.0, 10.0, 20.0, 30.0]
    parser.add_argument("--noise", nargs="+", type=not_negative, default=usual, metavar="MM", help=text)
    parser.add_argument("--groups", type=count, default=12, help="number of groups, at least two (default %(default)s)")
    parser.add_argument("--every", type=count, default=1, help="play every nth motion alone (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the noise (default %(default)s)")
    add_skeleton(parser)
    add_settings(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Play motions under each noise, and print how right the answers were; return the exit status."""
    clips = read_labelled(options.folder, reading_of(options)) if options.folder else []
    library, settings = MotionLibrary.of_clips(clips) if clips else MotionLibrary.builtin(), settings_of(options)
    if options.skeleton:
        library = library.restricted_to(joints_of(options.skeleton))
    takes, groups = takes_of(library.motions), _groups(len(library), options.groups)
    counts: dict[float, dict[int, Counter[str]]] = {noise: {} for noise in options.noise}
    for group in progress(groups, "Playing", len(groups)):
        others = library.without(motions=[library.motions[index] for index in group])
        played = [index for index in group if index % options.every == 0]
        for noise, index in product(options.noise, played):
            feed = Feed.of(takes[index].clip, library.skeleton)
            noised = noisy(noise / 1000)(feed, np.random.default_rng([options.seed, index]))
            counts[noise][index] = counted(takes[index], others.classes, answers_to(noised, others, settings))
    asked = sorted({index for each in counts.values() for index in each})
    basis = basis_of([takes[each].clip.duration for each in asked], [takes[each].person for each in asked])
    found = {noise: shares([each[index] for index in asked], _SHARES) for noise, each in counts.items()}
    values = {noise: values_of(each) for noise, each in found.items()}
    ends = {noise: intervals_of(each) for noise, each in found.items()}
    if options.json:
        basis["clips"] = basis.pop("segments")
        scores = [{"noise_mm": each, **values[each], **basis, "intervals": ends[each]} for each in found]
        print_json({"groups": len(groups), "noise": scores})
        return 0
    rows = [
        row
        for noise in found
        for row in (
            (f"{noise:g} mm", *map(written, values[noise].values())),
            ("", *map(interval, ends[noise].values())),
        )
    ]
    caption = f"{rests_on(basis, 'motion')}; left out in {len(groups)} groups; 95 % below"
    headings = ("noise", "answers right", "guessed right", "last answer right", "last guess right")
    title = "Motions with white noise on every coordinate, 30 frames per second"
    print_table(headings, rows, title, caption, names=0)
    return 0


def _groups(motions: int, groups: int) -> list[range]:
    """Distribute motions, which are sorted by class and person, so that each group has some of every class."""
    if not 2 <= groups <= motions:
        raise ValueError(f"--groups: expected 2 to {motions}, the motions there are, got {groups}")
    return [range(first, motions, groups) for first in range(groups)]
