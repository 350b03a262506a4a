"""`kinespace evaluate retrieval`: how often a motion's nearest neighbour is of its class.

For every motion, counts whether its nearest other motion is of its class, and whether one of the two nearest is, in the
spaces of joint distances, joint positions and joint rotations.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Clip, MotionLibrary
from kinespace.tools.cli.arguments import add_reading, add_shared, reading_of
from kinespace.tools.evaluation.harness import print_json
from kinespace.tools.evaluation.scoring.bootstrap import intervals_of, values_of
from kinespace.tools.evaluation.scoring.retrieval import (
    SPLIT_LIBRARY_ACTORS,
    Labels,
    Protocol,
    Retrieval,
    SignatureKind,
    Space,
    candidates,
    compare,
    retrieve,
    signatures_of,
    splits,
)
from kinespace.tools.evaluation.scoring.stream_score import basis_of
from kinespace.tools.evaluation.scoring.stream_tables import interval
from kinespace.tools.terminal.console import progress
from kinespace.tools.terminal.named_joints import read_labelled
from kinespace.tools.terminal.tables import print_scores

_COLUMNS = (
    ("compared", "{space} {signature}"),
    ("protocol", "{protocol}"),
    ("motions", "{motions}"),
    ("nearest", "{nearest:.1%}"),
    ("95 %", "{sure}"),
    ("of two", "{two_nearest:.1%}"),
    ("splits' mean", "{mean:.1%}"),
    ("worst", "{worst:.1%}"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    text = "clips, or folders of them (default: the built-in library's motions, which have no rotations)"
    parser.add_argument("folder", nargs="*", type=Path, metavar="FOLDER", help=text)
    add_reading(parser)
    add_shared(parser, "--actor-in")
    parser.add_argument("--signature", choices=[*map(str, SignatureKind)], help="default: both, for distances")
    parser.add_argument("--protocol", choices=[*map(str, Protocol)], help="default: all")
    text = "print one JSON object and nothing else: of distances (default: eigenvector, leave-one-out)"
    parser.add_argument("--json", action="store_true", help=text)


def run(options: argparse.Namespace) -> int:
    """Run the paper's experiment and print the results; return the exit status."""
    clips = read_labelled(options.folder, reading_of(options)) if options.folder else MotionLibrary.builtin().motions
    if short := [clip.name for clip in clips if clip.frames < 2]:
        raise ValueError(f"{short[0]}: expected a motion of at least 2 frames, got one")
    clips = [clip.as_of(clips[0].skeleton) for clip in clips]
    protocols = [Protocol(options.protocol)] if options.protocol else _protocols(clips)
    unnamed = [clip.name for clip in clips if not clip.actor]
    if unnamed and Protocol.LEAVE_ONE_OUT not in protocols:
        raise ValueError(
            f"{unnamed[0]}: expected a name with the actor in it, as HDM05's clips have; --actor-in says where it is"
        )
    ways = _ways(clips, options.signature)
    if options.json:
        protocol = Protocol(options.protocol or Protocol.LEAVE_ONE_OUT)
        kind = SignatureKind(options.signature or SignatureKind.EIGENVECTOR)
        print_json(_scored(clips, signatures_of(clips, Space.DISTANCES, kind), (Space.DISTANCES, kind), protocol))
        return 0
    scores = list[dict[str, Any]]()
    for way in progress(ways, "Comparing", len(ways)):
        signatures = signatures_of(clips, *way)
        scores += [_scored(clips, signatures, way, protocol) for protocol in protocols]
    persons = {clip.actor for clip in clips} - {""}
    caption = f"{sum(clip.duration for clip in clips):.0f} s, {len(persons) or 'no'} known persons; 95 %: by motions"
    for each in scores:
        each.update(each["splits"] or {"mean": None, "worst": None})
        # A narrow terminal breaks lines at spaces.
        each["protocol"] = each["protocol"].replace("-", " ")
        each["sure"] = interval(each["intervals"]["nearest"], "{:.0%}")
    title = "Of how many motions is the nearest neighbour of their class?"
    print_scores(scores, _COLUMNS, title=title, caption=caption, names=2)
    return 0


def _protocols(clips: Sequence[Clip]) -> list[Protocol]:
    """List the protocols that the known actors allow."""
    actors, library = {clip.actor for clip in clips}, set(SPLIT_LIBRARY_ACTORS)
    several = len(actors) > 1 and "" not in actors
    allowed = {
        Protocol.LEAVE_ONE_OUT: True,
        Protocol.ACTOR_HELD_OUT: several,
        Protocol.SPLIT: several and bool(actors & library) and bool(actors - library),
    }
    return [protocol for protocol, is_allowed in allowed.items() if is_allowed]


def _ways(clips: Sequence[Clip], signature: str | None) -> list[tuple[Space, SignatureKind]]:
    """List the spaces for which the motions have numbers, with the signatures that belong to them."""
    spaces = [each for each in Space if each is not Space.ROTATIONS or all(clip.rotations.size for clip in clips)]
    ways = [(Space.DISTANCES, SignatureKind.SPREAD), *((space, SignatureKind.EIGENVECTOR) for space in spaces)]
    return [way for way in ways if signature in (None, way[1])]


def _scored(
    clips: Sequence[Clip], signatures: NDArray[np.float64], way: tuple[Space, SignatureKind], protocol: Protocol
) -> dict[str, Any]:
    """Score one protocol: the shares of the motions that asked, and of five actors' splits the mean and the worst."""
    labels, (space, kind) = Labels.of_clips(clips), way

    def retrieved(library: Sequence[str]) -> Retrieval:
        allowed = candidates(labels, protocol, library)
        return retrieve(compare(signatures, kind, labels, allowed), labels, allowed)

    result = retrieved(SPLIT_LIBRARY_ACTORS)
    asking = [clips[index] for index in result.asking]
    basis = basis_of([round(sum(clip.duration for clip in asking), 3)], [clip.actor for clip in asking])
    ten = splits({clip.actor for clip in clips}) if protocol is Protocol.SPLIT else []
    shares = {actors: retrieved(actors).nearest for actors in ten}
    worst = min(shares, key=shares.__getitem__, default=())
    return {
        "space": space,
        "signature": kind,
        "protocol": protocol,
        "motions": len(asking),
        "classes": len(np.unique(labels.classes)),
        **{name: round(value or 0.0, 4) for name, value in values_of(result.shares).items()},
        "seconds": basis["seconds"],
        "persons": basis["persons"],
        "intervals": intervals_of(result.shares),
        "splits": {"mean": float(np.mean([*shares.values()])), "worst": shares[worst], "worst_library": worst}
        if worst
        else None,
    }
