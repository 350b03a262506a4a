"""`kinespace evaluate discover`: motions found in takes whose labels are hidden, and what they are worth."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING

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

    from kinespace.library.recordings.formats.labels import Segment
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
    pieces = discovery.Pieces(joints)
    for take in progress(takes, "Looking", len(takes)):
        pieces.add(take.clip)
    groups = _groups(takes, pieces, options)
    seconds = sum(take.clip.duration for take in takes)
    persons = {take.person for take in takes}
    figures: dict[str, object] = {
        "takes": len(takes),
        "persons": len(persons) if all(persons) else None,
        "seconds": seconds,
        "segments": sum(len(take.segments) for take in takes),
        "pieces": len(pieces.pieces),
        "groups": len(groups),
        **purity(takes, pieces, groups),
        **_worth(takes, pieces, options),
    }
    if options.json:
        harness.print_json(figures)
        return 0
    caption = (
        f"{counted(len(takes), 'take')}, {seconds:.0f} s, {figures['groups']} groups of {figures['pieces']} pieces"
    )
    print_scores([figures], _COLUMNS, title="Motions found with labels hidden", caption=caption, names=0)
    return 0


def _groups(takes: Sequence[Take], pieces: discovery.Pieces, options: argparse.Namespace) -> list[Group]:
    """Group pieces without the takes' labels."""
    return groups_of(pieces, [take.person for take in takes], options.alike)


def purity(takes: Sequence[Take], pieces: discovery.Pieces, groups: Sequence[Group]) -> dict[str, float]:
    """Compare groups with labels.

    Returns
    -------
    The share of labelled segments at least half of whose time lies in one group, nine tenths of whose segments are of
    one class; how many such groups there are for each class; and the share of segments in no group.
    """
    lies = list[tuple[str, int]]()
    in_groups = [(pieces.pieces[place], group.number) for group in groups for place in group.pieces]
    for place, take in enumerate(takes):
        for segment in take.segments:
            seconds = defaultdict[int, float](float)
            for piece, group in in_groups:
                if piece.take == place:
                    seconds[group] += _shared(piece, segment)
            group, most = max(seconds.items(), key=itemgetter(1), default=(0, 0.0))
            lies.append((segment.label, group if most >= _INSIDE * segment.duration else 0))
    classes = {group: Counter(label for label, other in lies if other == group) for _, group in lies if group}
    pure = {group for group, own in classes.items() if max(own.values()) >= PURE * sum(own.values())}
    named = {label for label, _ in lies} - {NOTHING}
    return {
        "in_pure": float(np.mean([group in pure for _, group in lies])),
        "groups_per_class": len(pure) / max(len(named), 1),
        "in_no_group": float(np.mean([not group for _, group in lies])),
    }


def named_by_labels(takes: Sequence[Take], pieces: discovery.Pieces, groups: Sequence[Group]) -> MotionLibrary | None:
    """Name groups by the label of most of their time; None where no group is a labelled motion.

    A group most of whose time has no label is nothing that a person would name.
    """
    motions = []
    for group in groups:
        seconds = defaultdict[str, float](float)
        for piece in (pieces.pieces[place] for place in group.pieces):
            labelled = [(each.label, _shared(piece, each)) for each in takes[piece.take].segments]
            for name, inside in (*labelled, (NOTHING, piece.seconds - sum(each for _, each in labelled))):
                seconds[name] += inside
        name = max(seconds.items(), key=itemgetter(1))[0]
        motions += [replace(pieces.clips[place], class_name=name, take=str(place)) for place in group.pieces]
    return MotionLibrary.of_clips(motions) if any(each.class_name != NOTHING for each in motions) else None


def _shared(piece: discovery.Piece, segment: Segment) -> float:
    """Give the seconds that a piece and a segment share."""
    return max(min(piece.end, segment.end) - max(piece.start, segment.start), 0.0)


def _worth(takes: Sequence[Take], pieces: discovery.Pieces, options: argparse.Namespace) -> dict[str, float | None]:
    """Ask with takes left out: the library of named groups, and the library of the labelled motions."""
    persons = {take.person for take in takes}
    usual = Protocol.LEAVE_ONE_PERSON_OUT if all(persons) and len(persons) > 1 else Protocol.LEAVE_ONE_TAKE_OUT
    if len(takes) < 2:
        return {"named_right": None, "taught_right": None}
    folds, settings = folds_of(takes, Protocol(options.protocol or usual), MotionLibrary.builtin), settings_of(options)
    right, asked = dict[str, float](), 0.0
    for what in ("named", "taught"):
        courses, classes = [], tuple(sorted({name for fold in folds for name in fold.library.classes}))
        for fold in progress(folds, f"Asking the {what}", len(folds)):
            library = fold.library if what == "taught" else _named(takes, pieces, fold, options)
            courses += [course(take, library, classes, settings) for take in fold.takes if library]
        score = score_courses(courses, classes, harness.INSIDE) if courses else None
        asked = score.known["seconds"] or 0.0 if score else 0.0
        right[what] = (score.values["frame_accuracy"] or 0.0) * asked if score else 0.0
    # Motions of classes that no named group has are asked, too.
    return {f"{what}_right": seconds / asked if asked else None for what, seconds in right.items()}


def _named(
    takes: Sequence[Take], pieces: discovery.Pieces, fold: Fold, options: argparse.Namespace
) -> MotionLibrary | None:
    """Name the largest groups of the takes that a fold's own do not ask about."""
    left = pieces.of_takes([place for place, take in enumerate(takes) if take not in fold.takes])
    library = named_by_labels(takes, left, _groups(takes, left, options)[: options.most])
    return library and library.restricted_to(fold.library.skeleton.joints)
