"""`kinespace evaluate`: how often the right class is found."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from library import find_recordings, read_recordings
from library.recordings import labelled
from library.retrieval import (
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
    turned,
)
from tools.console import console, progress
from tools.jointsets import joints_of
from tools.output import require_place_for
from tools.tables import add_names

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from library import Clip, Reading

_WITHOUT_ROTATIONS = [Space.DISTANCES, Space.POSITIONS]

#: Characters that the figures beside the names of sets of joints need.
_BESIDE_SKELETONS = 50

Results = dict[tuple[Space, SignatureKind, Protocol], Retrieval]


def run_retrieval(
    places: Sequence[Path],
    *,
    reading: Reading,
    space: str | None,
    signature: str | None,
    protocol: str | None,
    skeletons: Sequence[str],
    turned_by: int | None,
    picture: Path | None,
    as_json: bool,
) -> int:
    """Run the paper's experiment and print, draw or write what came out.

    Parameters
    ----------
    places
        Recordings, or folders of them.
    reading
        How they are read.
    space, signature, protocol
        One of each, or None for all that the recordings allow.
    skeletons
        Names of joint sets to restrict the clips to, each for itself; as recorded when there is none.
    turned_by
        Seed with which clips are first turned and shifted; None to take them as recorded.
    picture
        Where to draw the confusion matrices of the three spaces; their numbers go beside it, ending in `.csv`.
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
    clips = _clips(places, reading, turned_by)
    protocols = [Protocol(protocol)] if protocol else _protocols(clips)
    _require_actors(clips, protocols)
    if skeletons:
        return _run_by_skeleton(clips, skeletons, protocols, as_json=as_json)
    # The picture compares the paper's three spaces, whatever is printed.
    spaces = list(Space) if picture or all(clip.rotations.size for clip in clips) else _WITHOUT_ROTATIONS
    wanted = [Space(space)] if space and not picture else spaces
    results = _retrieve(clips, wanted, protocols)
    if picture:
        drawn = Protocol(protocol) if protocol else Protocol.LEAVE_ONE_OUT
        confusions = {each: results[each, SignatureKind.EIGENVECTOR, drawn] for each in Space}
        _write_confusions(picture, confusions, drawn)
    if signature != SignatureKind.EIGENVECTOR and space in (None, Space.DISTANCES):
        results |= _retrieve_by_spread(clips, protocols)
    shown = {key: result for key, result in results.items() if space in (None, key[0]) and signature in (None, key[1])}
    if as_json:
        ((chosen, result),) = shown.items()
        print(json.dumps(_as_json(*chosen, result)))
    else:
        _print_table(shown, turned_by)
    return 0


def _run_by_skeleton(
    clips: Sequence[Clip], skeletons: Sequence[str], protocols: Sequence[Protocol], *, as_json: bool
) -> int:
    """Say what each set of joints keeps of the distances' figures, by both signatures."""
    found = dict[str, tuple[int, Results]]()
    for name in skeletons:
        fewer = [clip.restricted_to(joints_of(name)) for clip in clips]
        results = _retrieve(fewer, [Space.DISTANCES], protocols) | _retrieve_by_spread(fewer, protocols)
        found[name] = len(fewer[0].skeleton.joints), results
    if as_json:
        told = [
            {"skeleton": name, "joints": joints} | _as_json(*key, result)
            for name, (joints, results) in found.items()
            for key, result in results.items()
        ]
        print(json.dumps(told))
        return 0
    table = Table(title="Of how many motions is the nearest neighbour of their class?", title_justify="left")
    add_names(table, "skeleton", found, beside=_BESIDE_SKELETONS)
    for heading in ("joints", "signature", *(protocol.replace("-", " ") for protocol in protocols)):
        table.add_column(heading, justify="left" if heading == "signature" else "right")
    for name, (joints, results) in found.items():
        for signature in SignatureKind:
            shares = [f"{results[Space.DISTANCES, signature, protocol].nearest:.1%}" for protocol in protocols]
            table.add_row(name, f"{joints}", signature, *shares)
    console.print(table)
    return 0


def _clips(places: Sequence[Path], reading: Reading, turned_by: int | None) -> list[Clip]:
    paths = find_recordings(places)
    read = progress(read_recordings(paths, reading), "Reading", len(paths))
    clips = [labelled(clip, path, reading.actor_in) for clip, path in zip(read, paths, strict=True)]
    clips = [clip.as_of(clips[0].skeleton) for clip in clips]
    short = [clip.name for clip in clips if clip.frames < 2]
    if short:
        raise ValueError(f"{short[0]}: expected a motion of at least 2 frames, got one")
    if turned_by is None:
        return clips
    generator = np.random.default_rng(turned_by)
    return [turned(clip, generator) for clip in clips]


def _protocols(clips: Sequence[Clip]) -> list[Protocol]:
    """List the protocols for which enough is known of who performs."""
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


def _retrieve(clips: Sequence[Clip], spaces: Sequence[Space], protocols: Sequence[Protocol]) -> Results:
    labels = Labels.of_clips(clips)
    results: Results = {}
    for space in progress(spaces, "Comparing", len(spaces)):
        scores = compare(motion_axes(clips, space))
        for protocol in protocols:
            results[space, SignatureKind.EIGENVECTOR, protocol] = retrieve(scores, labels, protocol)
    return results


def _retrieve_by_spread(clips: Sequence[Clip], protocols: Sequence[Protocol]) -> Results:
    labels, spreads = Labels.of_clips(clips), motion_spreads(clips)
    results: Results = {}
    for protocol in progress(protocols, "Comparing spreads", len(protocols)):
        scores = compare_spreads(spreads, labels, protocol)
        results[Space.DISTANCES, SignatureKind.SPREAD, protocol] = retrieve(scores, labels, protocol)
    return results


def _as_json(space: Space, signature: SignatureKind, protocol: Protocol, result: Retrieval) -> dict[str, object]:
    return {
        "space": space,
        "signature": signature,
        "protocol": protocol,
        "motions": result.motions,
        "classes": len(result.classes),
        "nearest": round(result.nearest, 4),
        "two_nearest": round(result.two_nearest, 4),
    }


def _print_table(results: Results, turned_by: int | None) -> None:
    title = "Of how many motions is the nearest neighbour of their class?"
    if turned_by is not None:
        title += " Every clip turned and shifted by chance."
    table = Table(title=title, title_justify="left")
    for heading in ("space", "signature", "protocol"):
        table.add_column(heading)
    for heading in ("motions", "nearest", "one of two"):
        table.add_column(heading, justify="right")
    last = max((protocol for _, _, protocol in results), key=list(Protocol).index)
    for (space, signature, protocol), result in sorted(results.items(), key=lambda each: each[0][0]):
        row = (f"{result.motions}", f"{result.nearest:.1%}", f"{result.two_nearest:.1%}")
        table.add_row(space, signature, protocol, *row, end_section=protocol == last)
    console.print(table)


def _require_place_for_confusions(picture: Path) -> None:
    from tools import pictures  # noqa: PLC0415 - matplotlib is an extra, and slow to load

    pictures.require_place_for_picture(picture)
    require_place_for(picture.with_suffix(".csv"))


def _write_confusions(picture: Path, results: Mapping[Space, Retrieval], protocol: Protocol) -> None:
    from tools import pictures  # noqa: PLC0415 - matplotlib is an extra, and slow to load

    pictures.draw_confusions(picture, results, protocol)
    with picture.with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["space", "performed", "found", "share"])
        for space, result in results.items():
            for performed, shares in zip(result.classes, result.confusion, strict=True):
                for found, share in zip(result.classes, shares, strict=True):
                    rows.writerow([space, performed, found, f"{share:.4f}"])
