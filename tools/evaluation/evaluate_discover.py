"""`kinespace evaluate discover`: motions found in takes whose labels are hidden, and what they are worth."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library import NOTHING, MotionLibrary
from kinespace.library.teaching import discovery
from kinespace.tools.cli.arguments import add_settings, add_shared, count, settings_of
from kinespace.tools.evaluation import harness
from kinespace.tools.evaluation.evaluate_stream import course
from kinespace.tools.evaluation.scoring.protocols import Fold, Protocol, folds_of
from kinespace.tools.evaluation.scoring.stream_score import score_courses
from kinespace.tools.programs.recordings.found import Group, groups_of
from kinespace.tools.terminal.console import progress
from kinespace.tools.terminal.tables import counted, print_scores

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kinespace.library.recordings.formats.labels import Segment
    from kinespace.stream.recognizer import Settings
    from kinespace.tools.evaluation.takes import Take

#: The share of a group's segments that are of one class in a pure group.
PURE = 0.9
#: The share of a segment's time that must lie in one group for the segment to lie in it.
_INSIDE = 0.5
_COLUMNS = (
    ("segments", "{segments}"),
    ("in a pure group", "{in_pure:.1%}"),
    ("pure groups a class", "{groups_per_class:.2f}"),
    ("guesses right: named", "{named_right:.1%}"),
    ("taught", "{taught_right:.1%}"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """The groups of some takes.

    Attributes
    ----------
    pieces
        The pieces, with their clips.
    groups
        The largest first.
    group_of
        The number of each piece's group, shape (pieces,).
    """

    pieces: discovery.Pieces
    groups: list[Group]
    group_of: NDArray[np.intp]


class Purity(NamedTuple):
    """How well groups are classes: figures as `--json` gives them."""

    in_pure: float
    groups_per_class: float
    in_no_group: float


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Hides the labels of takes, finds the motions that repeat in them, and compares the groups with the labels. "
        "Then it names the largest groups by what most of their time is labelled, as a person would who sees them, and "
        "asks with takes that were left out, beside a library of the labelled motions themselves."
    )
    harness.add_sources(parser, "the built-in library's motions")
    parser.add_argument("--alike", type=float, metavar="LOG", help="how far apart pieces of a group may be")
    parser.add_argument("--named", dest="most", type=count, default=12, help="groups to name (default %(default)s)")
    text = "takes asked about are left out one by one, or by person (default: by person where persons are known)"
    choices = [str(Protocol.LEAVE_ONE_TAKE_OUT), str(Protocol.LEAVE_ONE_PERSON_OUT)]
    parser.add_argument("--protocol", choices=choices, help=text)
    add_settings(parser)
    add_shared(parser, "--json")


def run(options: argparse.Namespace) -> int:
    """Find, compare, name, ask, and print the figures; return the exit status."""
    takes = list(harness.takes_at(harness.sources_of(options), options, MotionLibrary.builtin()))
    joints = harness.shared_joints([take.clip.skeleton for take in takes])
    takes = [replace(take, clip=take.clip.restricted_to(joints)) for take in takes]
    found = find(takes, options.alike)
    seconds = sum(take.clip.duration for take in takes)
    persons = {take.person for take in takes}
    figures: dict[str, object] = {
        "takes": len(takes),
        "persons": len(persons) if all(persons) else None,
        "seconds": seconds,
        "segments": sum(len(take.segments) for take in takes),
        "pieces": len(found.pieces.pieces),
        "groups": len(found.groups),
        **purity(takes, found)._asdict(),
        **_worth(takes, found, options, settings_of(options)),
    }
    if options.json:
        harness.print_json(figures)
        return 0
    caption = (
        f"{counted(len(takes), 'take')}, {seconds:.0f} s, {figures['groups']} groups of {figures['pieces']} pieces"
    )
    print_scores([figures], _COLUMNS, title="Motions found with labels hidden", caption=caption, names=0)
    return 0


def find(takes: Sequence[Take], alike: float | None = None, known: discovery.Pieces | None = None) -> Found:
    """Find the groups of takes, without their labels; of some takes, if `known` has the pieces of these alone."""
    pieces = known or discovery.Pieces(takes[0].clip.skeleton.joints)
    for take in progress(takes, "Looking", len(takes)) if known is None else ():
        pieces.add(take.clip)
    several = len({takes[piece.take].person for piece in pieces.pieces}) > 1
    labels = discovery.grouped(pieces.vectors(), discovery.alike_of(several=several) if alike is None else alike)
    groups, group_of = groups_of(pieces, labels), np.zeros(len(labels), dtype=np.intp)
    for group in groups:
        group_of[list(group.pieces)] = group.number
    return Found(pieces, groups, group_of)


def purity(takes: Sequence[Take], found: Found) -> Purity:
    """Compare groups with labels.

    Returns
    -------
    The share of labelled segments at least half of whose time lies in one group, nine tenths of whose segments are of
    one class; how many such groups there are for each class; and the share of segments in no group.
    """
    lies = list[tuple[str, int]]()
    for place, take in enumerate(takes):
        own = [
            (each, group) for each, group in zip(found.pieces.pieces, found.group_of, strict=True) if each.take == place
        ]
        for segment in take.segments:
            seconds = defaultdict[int, float](float)
            for piece, group in own:
                seconds[int(group)] += _shared(piece, segment)
            group, most = max(seconds.items(), key=itemgetter(1), default=(0, 0.0))
            lies.append((segment.label, group if most >= _INSIDE * segment.duration else 0))
    classes = {group: Counter(label for label, other in lies if other == group) for _, group in lies if group}
    pure = {group for group, own in classes.items() if max(own.values()) >= PURE * sum(own.values())}
    named = {label for label, _ in lies} - {NOTHING}
    return Purity(
        float(np.mean([group in pure for _, group in lies])),
        len(pure) / max(len(named), 1),
        float(np.mean([not group for _, group in lies])),
    )


def named_by_labels(takes: Sequence[Take], found: Found, most: int) -> MotionLibrary | None:
    """Name the largest groups by the label of most of their time; None where no group is a labelled motion.

    A group most of whose time has no label is nothing that a person would name.
    """
    motions = []
    for group in found.groups[:most]:
        seconds = defaultdict[str, float](float)
        for piece in (found.pieces.pieces[place] for place in group.pieces):
            labelled = [(each.label, _shared(piece, each)) for each in takes[piece.take].segments]
            for name, inside in (*labelled, (NOTHING, piece.seconds - sum(each for _, each in labelled))):
                seconds[name] += inside
        name = max(seconds.items(), key=itemgetter(1))[0]
        motions += [replace(found.pieces.clips[place], class_name=name, take=str(place)) for place in group.pieces]
    return MotionLibrary.of_clips(motions) if any(each.class_name != NOTHING for each in motions) else None


def _shared(piece: discovery.Piece, segment: Segment) -> float:
    """Give the seconds that a piece and a segment share."""
    return max(min(piece.end, segment.end) - max(piece.start, segment.start), 0.0)


def _worth(
    takes: Sequence[Take], found: Found, options: argparse.Namespace, settings: Settings
) -> dict[str, float | None]:
    """Ask with takes left out: the library of named groups, and the library of the labelled motions."""
    persons = {take.person for take in takes}
    usual = Protocol.LEAVE_ONE_PERSON_OUT if all(persons) and len(persons) > 1 else Protocol.LEAVE_ONE_TAKE_OUT
    if len(takes) < 2:
        return {"named_right": None, "taught_right": None}
    folds = folds_of(takes, Protocol(options.protocol or usual), MotionLibrary.builtin)
    right, asked = dict[str, float](), 0.0
    for what in ("named", "taught"):
        courses, classes = [], tuple(sorted({name for fold in folds for name in fold.library.classes}))
        for fold in progress(folds, f"Asking the {what}", len(folds)):
            library = fold.library if what == "taught" else _named(takes, found, fold, options)
            courses += [course(take, library, classes, settings) for take in fold.takes if library]
        score = score_courses(courses, classes, harness.INSIDE) if courses else None
        asked = score.known["seconds"] or 0.0 if score else 0.0
        right[what] = (score.values["frame_accuracy"] or 0.0) * asked if score else 0.0
    # Motions of classes that no named group has are asked, too.
    return {f"{what}_right": seconds / asked if asked else None for what, seconds in right.items()}


def _named(takes: Sequence[Take], found: Found, fold: Fold, options: argparse.Namespace) -> MotionLibrary | None:
    left = found.pieces.of_takes([place for place, take in enumerate(takes) if take not in fold.takes])
    library = named_by_labels(takes, find(takes, options.alike, left), options.most)
    return library and library.restricted_to(fold.library.skeleton.joints)
