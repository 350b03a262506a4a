"""`kinespace evaluate retrieval`: how often a motion's nearest neighbour is of its class."""

from __future__ import annotations

import csv
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from rich.table import Table

from kinespace.library import Clip
from kinespace.tools.cli.arguments import add_clips, add_library, library_at, reading_of
from kinespace.tools.evaluation.retrieval.experiment import (
    SPLIT_LIBRARY_ACTORS,
    Labels,
    Protocol,
    Retrieval,
    SignatureKind,
    Space,
    compare,
    compare_spreads,
    motion_axes,
    motion_spreads,
    retrieve,
    splits,
    turned,
)
from kinespace.tools.evaluation.scoring.bootstrap import Ratio
from kinespace.tools.evaluation.scoring.stream_tables import interval, percent
from kinespace.tools.feeding.joint_sets import joints_of
from kinespace.tools.terminal.console import console, progress
from kinespace.tools.terminal.named_joints import read_labelled
from kinespace.tools.terminal.output_path import require_place_for
from kinespace.tools.terminal.tables import add_names, csv_text, narrow_table

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kinespace.library import Reading
    from kinespace.tools.evaluation.scoring.bootstrap import Interval

#: Characters of the columns beside the names of joint sets.
_BESIDE_SKELETONS = 50


class _Way(NamedTuple):
    """The space and the signature by which motions are compared."""

    space: Space
    signature: SignatureKind

    @property
    def title(self) -> str:
        """What a picture says of it."""
        return f"{self.space}, {'spread' if self.signature is SignatureKind.SPREAD else 'leading eigenvector'}"


@dataclass(frozen=True, slots=True)
class Splits:
    """The result of all libraries of three of five actors.

    Attributes
    ----------
    mean, worst
        Share of motions whose nearest neighbour is of their class.
    worst_library
        The three actors of the worst library.
    """

    mean: float
    worst: float
    worst_library: tuple[str, ...]


class _Outcome(NamedTuple):
    """The result in one space by one signature: of each protocol, and of all splits where there are five actors."""

    retrievals: dict[Protocol, Retrieval]
    splits: Splits | None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "For every motion, counts whether its nearest other motion is of its class, and whether one of the two nearest "
        "is, in the spaces of joint distances, joint positions and joint rotations."
    )
    add_clips(parser, "the built-in library's motions, which have no rotations")
    add_library(parser)
    parser.add_argument("--space", choices=("distances", "positions", "rotations"), help="default: all")
    parser.add_argument("--signature", choices=("eigenvector", "spread"), help="default: both, for distances")
    parser.add_argument("--protocol", choices=("leave-one-out", "actor-held-out", "split"), help="default: all")
    parser.add_argument(
        "--skeleton",
        nargs="+",
        default=[],
        metavar="NAME",
        help="also with the joints of these products alone, like kinectv2",
    )
    parser.add_argument("--turned", action="store_true", help="first turn and shift every clip at random")
    parser.add_argument("--seed", type=int, default=0, help="of --turned (default %(default)s)")
    parser.add_argument(
        "--picture",
        type=Path,
        metavar="FILE",
        help="draw the confusion matrices; their numbers go beside it as CSV",
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="print one JSON object and nothing else (default: distances, eigenvector, leave-one-out)",
    )


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    return evaluate(
        options.folder,
        library=options.library,
        reading=reading_of(options),
        space=options.space,
        signature=options.signature,
        protocol=options.protocol,
        skeletons=options.skeleton,
        turned_by=options.seed if options.turned else None,
        picture=options.picture,
        as_json=options.json,
    )


def evaluate(
    places: Sequence[Path],
    *,
    library: Path | None = None,
    reading: Reading,
    space: str | None,
    signature: str | None,
    protocol: str | None,
    skeletons: Sequence[str],
    turned_by: int | None,
    picture: Path | None,
    as_json: bool,
) -> int:
    """Run the paper's experiment and print, draw or write the results.

    Parameters
    ----------
    places
        Recordings, or folders of them; a library's motions when there are none.
    library
        The library, without places; None for the built-in one.
    reading
        How recordings are read.
    space, signature, protocol
        One of each, or None for all that the motions have.
    skeletons
        Names of joint sets to restrict the clips to, one after the other; all joints when empty.
    turned_by
        Seed for turning and shifting clips; None to leave them as recorded.
    picture
        The file for a picture of each space's confusion matrix; the numbers go beside it, ending in `.csv`.
    as_json
        Print one JSON object, for one space and protocol.
    """
    if as_json:
        space, protocol = space or Space.DISTANCES, protocol or Protocol.LEAVE_ONE_OUT
        signature = signature or SignatureKind.EIGENVECTOR
    if signature == SignatureKind.SPREAD and space not in (None, Space.DISTANCES):
        raise ValueError(f"--signature spread: expected --space distances with it, got {space}")
    if picture:
        _require_place_for_confusions(picture)
    if library and places:
        raise ValueError(f"--library: expected no recordings beside it, got {places[0]}")
    clips = _recorded(places, reading) if places else list(library_at(library).motions)
    if turned_by is not None:
        generator = np.random.default_rng(turned_by)
        clips = [turned(clip, generator) for clip in clips]
    protocols = [Protocol(protocol)] if protocol else _protocols(clips)
    _require_actors(clips, protocols)
    if skeletons:
        return _run_by_skeleton(clips, skeletons, protocols, as_json=as_json)
    ways = _ways(clips, space, signature)
    if picture:
        _write_confusions(picture, clips, Protocol(protocol) if protocol else Protocol.LEAVE_ONE_OUT)
    outcomes = {way: _outcome(clips, way, protocols) for way in progress(ways, "Comparing", len(ways))}
    if as_json:
        ((way, outcome),) = outcomes.items()
        print(json.dumps(_as_json(clips, way, outcome)))
    else:
        _print_table(clips, outcomes, turned_by)
    return 0


def _run_by_skeleton(
    clips: Sequence[Clip], skeletons: Sequence[str], protocols: Sequence[Protocol], *, as_json: bool
) -> int:
    """Print the figures of the distances with each set of joints, by both signatures."""
    ways = [_Way(Space.DISTANCES, signature) for signature in SignatureKind]
    found = dict[str, tuple[list[Clip], dict[_Way, _Outcome]]]()
    for name in progress(skeletons, "Comparing", len(skeletons)):
        fewer = [clip.restricted_to(joints_of(name)) for clip in clips]
        found[name] = fewer, {way: _outcome(fewer, way, protocols) for way in ways}
    if as_json:
        told = [
            {"skeleton": name, "joints": len(fewer[0].skeleton.joints)} | _as_json(fewer, way, outcome)
            for name, (fewer, outcomes) in found.items()
            for way, outcome in outcomes.items()
        ]
        print(json.dumps(told))
        return 0
    table = Table(title="Of how many motions is the nearest neighbour of their class?", title_justify="left")
    add_names(table, "skeleton", found, beside=_BESIDE_SKELETONS)
    for heading in ("joints", "signature", *(protocol.replace("-", " ") for protocol in protocols)):
        table.add_column(heading, justify="left" if heading == "signature" else "right")
    for name, (fewer, outcomes) in found.items():
        for way, outcome in outcomes.items():
            shares = [percent(result.nearest) for result in outcome.retrievals.values()]
            table.add_row(name, f"{len(fewer[0].skeleton.joints)}", way.signature, *shares)
    console.print(table)
    return 0


def _recorded(places: Sequence[Path], reading: Reading) -> list[Clip]:
    clips = read_labelled(places, reading)
    short = [clip.name for clip in clips if clip.frames < 2]
    if short:
        raise ValueError(f"{short[0]}: expected a motion of at least 2 frames, got one")
    return [clip.as_of(clips[0].skeleton) for clip in clips]


def _protocols(clips: Sequence[Clip]) -> list[Protocol]:
    """List the protocols that the known actors allow."""
    actors = {clip.actor for clip in clips}
    protocols = [Protocol.LEAVE_ONE_OUT]
    if len(actors) > 1 and "" not in actors:
        protocols.append(Protocol.ACTOR_HELD_OUT)
        if actors & set(SPLIT_LIBRARY_ACTORS) and actors - set(SPLIT_LIBRARY_ACTORS):
            protocols.append(Protocol.SPLIT)
    return protocols


def _require_actors(clips: Sequence[Clip], protocols: Sequence[Protocol]) -> None:
    unnamed = [clip.name for clip in clips if not clip.actor]
    if unnamed and any(protocol is not Protocol.LEAVE_ONE_OUT for protocol in protocols):
        raise ValueError(
            f"{unnamed[0]}: expected a name that tells the actor, as HDM05's clips have; --actor-in says where it is"
        )


def _spaces(clips: Sequence[Clip]) -> list[Space]:
    """List the spaces for which the motions have numbers."""
    rotating = all(clip.rotations.size for clip in clips)
    return [space for space in Space if rotating or space is not Space.ROTATIONS]


def _ways(clips: Sequence[Clip], space: str | None, signature: str | None) -> list[_Way]:
    spaces = [Space(space)] if space else _spaces(clips)
    ways = [_Way(each, SignatureKind.EIGENVECTOR) for each in spaces if signature != SignatureKind.SPREAD]
    if signature != SignatureKind.EIGENVECTOR and Space.DISTANCES in spaces:
        ways.append(_Way(Space.DISTANCES, SignatureKind.SPREAD))
    return sorted(ways)


def _outcome(clips: Sequence[Clip], way: _Way, protocols: Sequence[Protocol]) -> _Outcome:
    labels = Labels.of_clips(clips)
    by_spread = way.signature is SignatureKind.SPREAD
    signatures = motion_spreads(clips) if by_spread else motion_axes(clips, way.space)
    products: NDArray[np.floating] | None = None if by_spread else compare(signatures)

    def retrieved(protocol: Protocol, actors: Sequence[str] = SPLIT_LIBRARY_ACTORS) -> Retrieval:
        scores = compare_spreads(signatures, labels, protocol, actors) if products is None else products
        return retrieve(scores, labels, protocol, actors)

    ten = splits({clip.actor for clip in clips}) if Protocol.SPLIT in protocols or len(protocols) > 1 else []
    shares = {actors: retrieved(Protocol.SPLIT, actors).nearest for actors in ten}
    worst = min(shares, key=shares.__getitem__) if shares else ()
    summary = Splits(float(np.mean(list(shares.values()))), shares[worst], worst) if shares else None
    return _Outcome({protocol: retrieved(protocol) for protocol in protocols}, summary)


def _intervals(result: Retrieval) -> dict[str, Interval | None]:
    """Give the ends of both shares' 95 % intervals: bootstrap over the motions that asked."""
    one = [1.0] * result.motions
    return {
        name: Ratio(right.tolist(), one).interval()
        for name, right in zip(("nearest", "two_nearest"), result.right.T.astype(np.float64), strict=True)
    }


def _as_json(clips: Sequence[Clip], way: _Way, outcome: _Outcome) -> dict[str, object]:
    ((protocol, result),) = outcome.retrievals.items()
    asking = [clips[index] for index in result.asking]
    persons = {clip.actor for clip in asking}
    return {
        "space": way.space,
        "signature": way.signature,
        "protocol": protocol,
        "motions": result.motions,
        "classes": len(result.classes),
        "nearest": round(result.nearest, 4),
        "two_nearest": round(result.two_nearest, 4),
        "seconds": round(sum(clip.duration for clip in asking), 3),
        "persons": None if "" in persons else len(persons),
        "intervals": _intervals(result),
        "splits": asdict(outcome.splits) if outcome.splits else None,
    }


def _print_table(clips: Sequence[Clip], outcomes: Mapping[_Way, _Outcome], turned_by: int | None) -> None:
    title = "Of how many motions is the nearest neighbour of their class?"
    if turned_by is not None:
        title += " Every clip turned and shifted at random."
    persons = {clip.actor for clip in clips} - {""}
    told = f"{sum(clip.duration for clip in clips):.0f} s, {len(persons) or 'no'} persons told; 95 %: by motions"
    table = narrow_table(title, told)
    for heading in ("space", "signature", "protocol"):
        table.add_column(heading)
    for heading in ("motions", "nearest", "95 %", "one of two"):
        table.add_column(heading, justify="right")
    for way, outcome in outcomes.items():
        for protocol, result in outcome.retrievals.items():
            sure = interval(_intervals(result)["nearest"], "{:.0%}".format)
            table.add_row(
                *way, protocol, f"{result.motions}", percent(result.nearest), sure, percent(result.two_nearest)
            )
        if outcome.splits:
            table.add_row(*way, "mean of splits", "", percent(outcome.splits.mean))
            library = " ".join(outcome.splits.worst_library)
            table.add_row(*way, f"worst: {library}", "", percent(outcome.splits.worst))
    console.print(table)


def _require_place_for_confusions(picture: Path) -> None:
    from kinespace.tools.terminal import pictures  # noqa: PLC0415 - matplotlib is an extra, and slow to load

    pictures.require_place_for_picture(picture)
    require_place_for(picture.with_suffix(".csv"))


def _write_confusions(picture: Path, clips: Sequence[Clip], protocol: Protocol) -> None:
    """Draw and write the confusion matrices of all spaces and signatures, whatever else is asked for."""
    from kinespace.tools.terminal import pictures  # noqa: PLC0415 - matplotlib is an extra, and slow to load

    results = {way: _outcome(clips, way, [protocol]).retrievals[protocol] for way in _ways(clips, None, None)}
    pictures.draw_confusions(picture, {way.title: result for way, result in results.items()}, protocol)
    with picture.with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["space", "signature", "performed", "found", "share"])
        for way, result in results.items():
            for performed, shares in zip(result.classes, result.confusion, strict=True):
                for found, share in zip(result.classes, shares, strict=True):
                    rows.writerow([*way, csv_text(performed), csv_text(found), f"{share:.4f}"])
