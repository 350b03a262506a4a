"""What `kinespace discover` writes into its folder, and the named groups that it makes of it."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library.motion_library import NOTHING, MotionLibrary
from kinespace.library.teaching.discovery import ALIKE, ALIKE_SEVERAL, grouped, middle
from kinespace.stream.teaching.commands import Rename
from kinespace.tools.page.sheet import body_shown, write_sheet
from kinespace.tools.terminal.tables import csv_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from kinespace.library.clip import Clip
    from kinespace.library.teaching.discovery import Pieces

#: The files: all pieces as a library whose classes are the groups, as a table, as a page; and what naming makes.
PIECES, TABLE, PAGE, NAMED, LABELS = "pieces.npz", "pieces.csv", "groups.html", "named.npz", "labels"
#: Pieces of a group that the library keeps, those nearest to all others first; and of all groups.
_KEPT, _MOST = 24, 2000
#: Seconds of a body on the page, and its frames per second.
_SECONDS, _FRAMES = 6.0, 15.0
_COLUMNS = ("group", "start_s", "end_s", "performer", "recording")


class Source(NamedTuple):
    """A take: its file, and who performs."""

    path: Path
    performer: str


class Group(NamedTuple):
    """A motion that came once or more often.

    Attributes
    ----------
    number
        Counted from 1.
    pieces
        Indices of its pieces, the one nearest to all others first.
    seconds
        Of all its pieces together.
    """

    number: int
    pieces: tuple[int, ...]
    seconds: float


def groups_of(pieces: Pieces, performers: Sequence[str], alike: float | None) -> list[Group]:
    """Group pieces; list those that came most often first, then those that lasted longest.

    Parameters
    ----------
    pieces
        At least one.
    performers
        Who performs each take.
    alike
        The log distance up to which two pieces are alike; None for the usual one.
    """
    vectors, several = pieces.vectors(), len({performers[piece.take] for piece in pieces.pieces}) > 1
    usual = ALIKE_SEVERAL if several else ALIKE
    labels = grouped(vectors, usual if alike is None else alike)
    every = [middle(vectors, np.flatnonzero(labels == label)).tolist() for label in np.unique(labels)]
    seconds = [sum(pieces.pieces[place].seconds for place in each) for each in every]
    order = sorted(range(len(every)), key=lambda each: (-len(every[each]), -seconds[each]))
    return [Group(number, tuple(every[each]), seconds[each]) for number, each in enumerate(order, start=1)]


def require_room(folder: Path, *, overwrite: bool) -> None:
    """Make the folder; refuse one that holds groups unless they may be replaced."""
    if (folder / PIECES).exists() and not overwrite:
        raise FileExistsError(f"{folder / PIECES}: exists already; --overwrite writes over it")
    folder.mkdir(exist_ok=True)


def write(folder: Path, groups: Sequence[Group], pieces: Pieces, sources: Sequence[Source], most: int) -> None:
    """Write library, table and page; the page shows so many groups at most.

    Raises
    ------
    OSError
        The folder cannot be written.
    """
    with (folder / TABLE).open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(_COLUMNS)
        for group in groups:
            for piece in sorted(pieces.pieces[place] for place in group.pieces):
                source = sources[piece.take]
                texts = csv_text(source.performer), csv_text(str(source.path))
                rows.writerow((group.number, f"{piece.start:.2f}", f"{piece.end:.2f}", *texts))
    kept = [(group, place) for group in groups for place in group.pieces[:_KEPT]][:_MOST]
    MotionLibrary.of_clips(
        [
            replace(pieces.clips[place], class_name=str(group.number), take=str(place), name=f"{group.number} {place}")
            for group, place in kept
        ]
    ).save(folder / PIECES)
    shown = [_described(group, pieces.clips[group.pieces[0]]) for group in groups[:most]]
    write_sheet(folder / PAGE, "groups", "motions found", {"folder": str(folder), "groups": shown})


def named(folder: Path, names: Mapping[str, str], *, rest_nothing: bool) -> tuple[MotionLibrary, int]:
    """Make a library of the named groups, and labels for each recording; give both, the labels as a number of files.

    Parameters
    ----------
    folder
        What `write` wrote.
    names
        Class names by the groups' numbers.
    rest_nothing
        Whether the other groups become examples of `nothing`; else they are left out.

    Raises
    ------
    ValueError
        There is no such group, or a name is not allowed for a class.
    OSError
        Nothing was found in the folder, or it cannot be written.
    """
    pieces = MotionLibrary.load(folder / PIECES)
    for name in names.values():
        Rename("", name)
    if strange := [number for number in names if number not in pieces.classes]:
        last = max(pieces.classes, key=int)
        raise ValueError(f"--name: expected numbers of groups, 1 to {last}, got {strange[0]!r}")
    rest = [number for number in pieces.classes if number not in names]
    pieces = pieces if rest_nothing or not rest else pieces.without(classes=rest)
    library = pieces.renamed({**dict.fromkeys(rest if rest_nothing else (), NOTHING), **names})
    library.save(folder / NAMED)
    with (folder / TABLE).open(newline="", encoding="utf-8") as file:
        return library, _write_labels(folder / LABELS, csv.DictReader(file), names)


def _write_labels(folder: Path, rows: Iterable[dict[str, str]], names: Mapping[str, str]) -> int:
    """Write a table of labels for each recording that has pieces of named groups; give their number."""
    folder.mkdir(exist_ok=True)
    by_recording = dict[str, list[dict[str, str]]]()
    for row in rows:
        if row["group"] in names:
            by_recording.setdefault(row["recording"], []).append(row)
    for recording, own in by_recording.items():
        with (folder / f"{Path(recording).stem}.csv").open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(("start_s", "end_s", "label", "performer"))
            for row in sorted(own, key=lambda each: float(each["start_s"])):
                table.writerow((row["start_s"], row["end_s"], csv_text(names[row["group"]]), row["performer"]))
    return len(by_recording)


def _described(group: Group, clip: Clip) -> dict[str, object]:
    """Describe a group and the body of its middle piece for the page."""
    begin = replace(clip, positions=clip.positions[: round(_SECONDS * clip.frame_rate)])
    body = body_shown(begin, _FRAMES)
    return {"number": group.number, "came": len(group.pieces), "seconds": round(group.seconds, 1), **body}
