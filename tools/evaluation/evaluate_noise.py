"""`kinespace evaluate noise`: motions as a noisy sensor sees them, through the recogniser that runs live.

Plays motions at 30 frames per second with white noise on every coordinate into the live recogniser. Motions are left
out of the library in groups, so that no motion is named by itself.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from kinespace.tools.cli.arguments import (
    add_settings,
    add_shared,
    count,
    library_at,
    not_negative,
    settings_of,
)
from kinespace.tools.evaluation.faults import noisy
from kinespace.tools.evaluation.harness import Feed, answers_to, print_json, written
from kinespace.tools.evaluation.scoring.answers import counted, shares
from kinespace.tools.evaluation.scoring.bootstrap import intervals_of, values_of
from kinespace.tools.evaluation.scoring.stream_score import basis_of
from kinespace.tools.evaluation.scoring.stream_tables import interval, rests_on
from kinespace.tools.evaluation.takes import takes_of
from kinespace.tools.terminal.console import console, progress
from kinespace.tools.terminal.tables import table_of

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
#: Seed of the noise.
_SEED = 0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    text, usual = "standard deviations on each coordinate (default: 0 10 20 30)", [0.0, 10.0, 20.0, 30.0]
    parser.add_argument("--noise", nargs="+", type=not_negative, default=usual, metavar="MM", help=text)
    parser.add_argument("--groups", type=count, default=12, help="number of groups, at least two (default %(default)s)")
    parser.add_argument("--every", type=count, default=1, help="play every nth motion alone (default %(default)s)")
    add_settings(parser)
    add_shared(parser, "--library", "--json")


def run(options: argparse.Namespace) -> int:
    """Play motions under each noise, and print how right the answers were; return the exit status."""
    library, settings = library_at(options.library), settings_of(options)
    takes, groups = takes_of(library.motions), _groups(len(library), options.groups)
    asked = range(0, len(takes), options.every)
    counts: dict[float, dict[int, Counter[str]]] = {noise: {} for noise in options.noise}
    for group in progress(groups, "Playing", len(groups)):
        others = library.without(motions=[library.motions[index] for index in group])
        for noise, index in product(options.noise, {*group} & {*asked}):
            feed = Feed.of(takes[index].clip, library.skeleton)
            noised = noisy(noise / 1000)(feed, np.random.default_rng([_SEED, index]))
            counts[noise][index] = counted(takes[index], others.classes, answers_to(noised, others, settings))
    basis = basis_of([takes[each].clip.duration for each in asked], [takes[each].person for each in asked])
    caption = f"{rests_on(basis, 'motion')}; left out in {len(groups)} groups; 95 % in brackets"
    basis["clips"] = basis.pop("segments")
    scores = list[dict[str, Any]]()
    for noise, of_noise in counts.items():
        found = shares([of_noise[index] for index in asked], _SHARES)
        scores.append({"noise_mm": noise, **values_of(found), **basis, "intervals": intervals_of(found)})
    if options.json:
        print_json({"groups": len(groups), "noise": scores})
        return 0
    rows = [
        (
            f"{each['noise_mm']:g} mm",
            *(f"{written(each[name])} ({interval(ends, '{:.0%}')})" for name, ends in of.items()),
        )
        for each in scores
        for of in [each["intervals"]]
    ]
    headings = ("noise", "answers right", "guessed right", "last answer right", "last guess right")
    title = "Motions with white noise on every coordinate, 30 frames per second"
    console.print(table_of(title, headings, rows, caption=caption, names=0))
    return 0


def _groups(motions: int, groups: int) -> list[range]:
    """Distribute motions, which are sorted by class and person, so that each group has some of every class."""
    if not 2 <= groups <= motions:
        raise ValueError(f"--groups: expected 2 to {motions}, the motions there are, got {groups}")
    return [range(first, motions, groups) for first in range(groups)]
