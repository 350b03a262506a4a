"""`kinespace evaluate retrieval`: how often a motion's nearest neighbour is of its class."""

from __future__ import annotations

import csv
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.tools.cli.arguments import add_clips, add_library, library_at, reading_of
from kinespace.tools.evaluation.harness import print_json, print_table, written
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
    turned,
)
from kinespace.tools.evaluation.scoring.stream_score import basis_of
from kinespace.tools.evaluation.scoring.stream_tables import interval
from kinespace.tools.feeding.joint_sets import joints_of
from kinespace.tools.terminal.console import progress
from kinespace.tools.terminal.named_joints import read_labelled
from kinespace.tools.terminal.output_path import require_place_for
from kinespace.tools.terminal.tables import csv_text

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from kinespace.library import Clip


class _Way(NamedTuple):
    """The joints, the space and the signature by which motions are compared."""

    skeleton: str
    space: Space
    signature: SignatureKind


class _Outcome(NamedTuple):
    """The results in one way: of each protocol; and of five actors' splits the shares, by library."""

    clips: Sequence[Clip]
    retrievals: dict[Protocol, Retrieval]
    splits: dict[tuple[str, ...], float]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "For every motion, counts whether its nearest other motion is of its class, and whether one of the two nearest "
        "is, in the spaces of joint distances, joint positions and joint rotations."
    )
    add_clips(parser, "the built-in library's motions, which have no rotations")
    add_library(parser)
    parser.add_argument("--space", choices=[*map(str, Space)], help="default: all")
    parser.add_argument("--signature", choices=[*map(str, SignatureKind)], help="default: both, for distances")
    parser.add_argument("--protocol", choices=[*map(str, Protocol)], help="default: all")
    text = "with the joints of these products alone, like kinectv2; distances, by both signatures"
    parser.add_argument("--skeleton", nargs="+", default=[], metavar="NAME", help=text)
    parser.add_argument("--turned", action="store_true", help="first turn and shift every clip at random")
    parser.add_argument("--seed", type=int, default=0, help="of --turned (default %(default)s)")
    text = "draw the confusion matrices; their numbers go beside it as CSV"
    parser.add_argument("--picture", type=Path, metavar="FILE", help=text)
    text = "print one JSON object and nothing else (default: distances, eigenvector, leave-one-out)"
    parser.add_argument("--json", action="store_true", help=text)


def run(options: argparse.Namespace) -> int:
    """Run the paper's experiment and print, draw or write the results; return the exit status."""
    if options.json:
        options.space = options.space or Space.DISTANCES
        options.protocol = options.protocol or Protocol.LEAVE_ONE_OUT
        options.signature = options.signature or SignatureKind.EIGENVECTOR
    if options.signature == SignatureKind.SPREAD and options.space not in (None, Space.DISTANCES):
        raise ValueError(f"--signature spread: expected --space distances with it, got {options.space}")
    if options.picture:
        from kinespace.tools.evaluation import pictures  # noqa: PLC0415 - matplotlib is an extra, and slow to load

        pictures.require_place_for_picture(options.picture)
        require_place_for(options.picture.with_suffix(".csv"))
    clips = _clips(options)
    protocols = [Protocol(options.protocol)] if options.protocol else _protocols(clips)
    _require_actors(clips, protocols)
    ways = [_Way(*each, kind) for each in product(options.skeleton, [Space.DISTANCES]) for kind in SignatureKind]
    ways = ways or _ways(clips, options.space, options.signature)
    if options.picture:
        _draw(options.picture, clips, Protocol(options.protocol or Protocol.LEAVE_ONE_OUT))
    outcomes = {way: _outcome(clips, way, protocols) for way in progress(ways, "Comparing", len(ways))}
    if not options.json:
        _print(clips, outcomes, is_turned=options.turned)
        return 0
    described = [_as_json(way, outcome) for way, outcome in outcomes.items()]
    print_json(described if options.skeleton else described[0])
    return 0


def _clips(options: argparse.Namespace) -> list[Clip]:
    """Read the recordings, or take a library's motions; turn them if asked to."""
    places = options.folder
    if options.library and places:
        raise ValueError(f"--library: expected no recordings beside it, got {places[0]}")
    clips = read_labelled(places, reading_of(options)) if places else library_at(options.library).motions
    if short := [clip.name for clip in clips if clip.frames < 2]:
        raise ValueError(f"{short[0]}: expected a motion of at least 2 frames, got one")
    generator = np.random.default_rng(options.seed)
    clips = [clip.as_of(clips[0].skeleton) for clip in clips]
    return [turned(clip, generator) for clip in clips] if options.turned else clips


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


def _require_actors(clips: Sequence[Clip], protocols: Sequence[Protocol]) -> None:
    unnamed = [clip.name for clip in clips if not clip.actor]
    if unnamed and any(protocol is not Protocol.LEAVE_ONE_OUT for protocol in protocols):
        raise ValueError(
            f"{unnamed[0]}: expected a name that tells the actor, as HDM05's clips have; --actor-in says where it is"
        )


def _ways(clips: Sequence[Clip], space: str | None, signature: str | None) -> list[_Way]:
    """List the ways for which the motions have numbers, all or those that were chosen."""
    rotating = all(clip.rotations.size for clip in clips)
    spaces = [Space(space)] if space else [each for each in Space if rotating or each is not Space.ROTATIONS]
    kinds = [SignatureKind(signature)] if signature else list(SignatureKind)
    ways = [_Way("", *each) for each in product(spaces, kinds)]
    return [way for way in ways if way.signature is SignatureKind.EIGENVECTOR or way.space is Space.DISTANCES]


def _outcome(clips: Sequence[Clip], way: _Way, protocols: Sequence[Protocol]) -> _Outcome:
    if way.skeleton:
        clips = [clip.restricted_to(joints_of(way.skeleton)) for clip in clips]
    labels, signatures = Labels.of_clips(clips), signatures_of(clips, way.space, way.signature)

    def retrieved(protocol: Protocol, actors: Sequence[str] = SPLIT_LIBRARY_ACTORS) -> Retrieval:
        allowed = candidates(labels, protocol, actors)
        return retrieve(compare(signatures, way.signature, labels, allowed), labels, allowed)

    ten = splits({clip.actor for clip in clips}) if Protocol.SPLIT in protocols or len(protocols) > 1 else []
    shares = {actors: retrieved(Protocol.SPLIT, actors).nearest for actors in ten}
    return _Outcome(clips, {protocol: retrieved(protocol) for protocol in protocols}, shares)


def _as_json(way: _Way, outcome: _Outcome) -> dict[str, object]:
    """Describe the result of one protocol."""
    ((protocol, result),) = outcome.retrievals.items()
    asking = [outcome.clips[index] for index in result.asking]
    joints = len(outcome.clips[0].skeleton.joints)
    basis = basis_of([round(sum(clip.duration for clip in asking), 3)], [clip.actor for clip in asking])
    mean, worst = _summary(outcome.splits)
    return {
        **({"skeleton": way.skeleton, "joints": joints} if way.skeleton else {}),
        "space": way.space,
        "signature": way.signature,
        "protocol": protocol,
        "motions": len(asking),
        "classes": len(result.classes),
        **{name: round(value or 0.0, 4) for name, value in values_of(result.shares).items()},
        "seconds": basis["seconds"],
        "persons": basis["persons"],
        "intervals": intervals_of(result.shares),
        "splits": {"mean": mean, "worst": outcome.splits[worst], "worst_library": worst} if worst else None,
    }


def _summary(shares: dict[tuple[str, ...], float]) -> tuple[float, tuple[str, ...]]:
    """Give the mean share of all splits, and the library of the worst; an empty one where there are no splits."""
    return (float(np.mean(list(shares.values()))), min(shares, key=shares.__getitem__)) if shares else (0.0, ())


def _print(clips: Sequence[Clip], outcomes: dict[_Way, _Outcome], *, is_turned: bool) -> None:
    """Print a row for each protocol in each way, and the mean and the worst of all splits."""
    persons = {clip.actor for clip in clips} - {""}
    by_skeleton, rows = any(way.skeleton for way in outcomes), list[tuple[str, ...]]()
    for way, outcome in outcomes.items():
        begin = (
            (f"{way.skeleton}, {len(outcome.clips[0].skeleton.joints)} joints", *way[1:]) if by_skeleton else way[1:]
        )
        for protocol, result in outcome.retrievals.items():
            nearest, two = map(written, values_of(result.shares).values())
            sure = interval(result.shares["nearest"].interval(), "{:.0%}")
            rows.append((*begin, protocol, f"{len(result.asking)}", nearest, sure, two))
        mean, worst = _summary(outcome.splits)
        if worst:
            rows.append((*begin, "mean of splits", "", written(mean)))
            rows.append((*begin, f"worst: {' '.join(worst)}", "", written(outcome.splits[worst])))
    first = ("skeleton",) if by_skeleton else ()
    print_table(
        (*first, "space", "signature", "protocol", "motions", "nearest", "95 %", "one of two"),
        rows,
        title="Of how many motions is the nearest neighbour of their class?"
        + (" Every clip turned and shifted at random." if is_turned else ""),
        caption=f"{sum(clip.duration for clip in clips):.0f} s, {len(persons) or 'no'} known persons; 95 %: by motions",
        names=3 + len(first),
    )


def _draw(picture: Path, clips: Sequence[Clip], protocol: Protocol) -> None:
    """Draw and write the confusion matrices of all spaces and signatures, whatever else is asked for."""
    from kinespace.tools.evaluation import pictures  # noqa: PLC0415 - matplotlib is an extra, and slow to load

    results = {way[1:]: _outcome(clips, way, [protocol]).retrievals[protocol] for way in _ways(clips, None, None)}
    titles = {kind: str(kind) for kind in SignatureKind} | {SignatureKind.EIGENVECTOR: "leading eigenvector"}
    drawn = {f"{space}, {titles[kind]}": result for (space, kind), result in results.items()}
    pictures.draw_confusions(picture, drawn, protocol)
    with picture.with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["space", "signature", "performed", "found", "share"])
        for way, result in results.items():
            pairs = product(map(csv_text, result.classes), repeat=2)
            for pair, share in zip(pairs, result.confusion.ravel().tolist(), strict=True):
                rows.writerow([*way, *pair, f"{share:.4f}"])
