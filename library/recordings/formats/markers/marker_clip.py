"""Markers or joint centres over time, as in C3D, TRC and tables, made into a clip of those that were seen."""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.naming import hdm05, listed
from kinespace.library.recordings.formats.joint_choice import chosen, people_in, short_names
from kinespace.library.recordings.formats.measures import (
    FAR,
    MAX_GAP,
    Evened,
    Positions,
    Times,
    from_middle,
    guessed_metres,
    laid,
)
from kinespace.library.skeleton import Skeleton

#: Two joints of a body keep their distance: it spreads over the frames by less than this share.
_STEADY = 0.2
#: A person's joints: their places, and their names without the person.
_Own = dict[int, str]
#: Markers of one segment are nearer to each other, in shares of how far half of all are from the middle; people never.
#: A body that is smoothed, or stands there again, is nearer to the first one than two people who stand at one place.
_NEAR, _SAME = 0.5, 0.03
#: Share of the markers whose absence makes a frame one without a body, the first that leaves enough of the recording.
_ABSENT = (0.5, 0.25, 0.0)
#: Markers that a remark lists, at most.
_MAX_LISTED = 8


def clips_of_markers(  # noqa: PLR0913 - what files say of their markers
    path: Path,
    labels: Sequence[str],
    positions: Positions,
    frame_rate: float | None,
    joints: Sequence[str],
    *,
    times: Times | None = None,
    metres: float | None = 1.0,
    notes: Sequence[str] = (),
) -> list[Clip]:
    """Make a clip of the markers that are wanted and were seen, for each person that their labels name.

    Of several people those who are never seen are left out, and those who are no bodies: speeds, say.

    A marker that is missing for a short time is put on a straight line; before its first and after its last sight it
    rests. One that is missing for longer than `MAX_GAP` is left out; where too many are missing the body rests, and
    the clip lists the gap.

    Parameters
    ----------
    path
        The clip is named after this file.
    labels
        The markers' names; how markers are connected is not known.
    positions
        Shape (frames, markers, 3), NaN, or a number that stands for nothing, where a marker is missing.
    frame_rate
        Frames per second; None: as often as the times say.
    joints
        Which markers, by name (`library.recordings.formats.joint_choice.chosen`); all when none are given.
    times
        Seconds of the frames; None: they follow each other evenly.
    metres
        Metres of the unit; None to guess them by the body's size.
    notes
        What the reader has to say of the file.

    Raises
    ------
    ValueError
        A wanted marker is missing, or fewer than two are left.
    """
    kept = chosen(labels, joints)
    if len(kept) < 2:
        raise ValueError(f"expected at least 2 points, got {len(kept)}")
    memory.require_numbers(len(positions) * len(kept) * 3)
    rest = 0 if joints else len(labels) - len(kept)
    aside = [f"left out: {rest} without a name; --joints '*' takes all"] if rest else []
    named, positions = [labels[index] for index in kept], positions[:, kept]
    clips, people = list[Clip](), people_in(named)
    if _are_markers(people, named, positions):
        people = {"": dict(enumerate(named))}
    aside += _oddities(people, named)
    if len(people) > 1:
        people = _performers(people, positions, aside)
    for person, own in people.items():
        names, twice = short_names([*own.values()])
        found = _seen(positions[:, [*own]])
        found *= guessed_metres(found, names) if metres is None else metres
        even = Evened(found, frame_rate or 0.0, 0, ()) if times is None else laid(times, found, frame_rate)
        clip = _clip(names, even, (*notes, *aside, *twice))
        clips.append(hdm05.titled(replace(clip, name=path.stem, actor=person or "0" * (len(people) > 1)), path))
    return clips


def _oddities(people: dict[str, _Own], labels: Sequence[str]) -> Iterator[str]:
    """Say which labels are nobody's, and which subjects, that share no marker's name, make one body."""
    theirs = {place for own in people.values() for place in own}
    if things := [name for place, name in enumerate(labels) if place not in theirs]:
        yield f"left out: no performer's: {listed(things, 5)}"
    subjects = Counter(filter(None, (labels[place].rpartition(":")[0] for place in sorted(theirs))))
    names = [name for own in people.values() for name in own.values()]
    if len(people) == 1 < len(subjects) < len(names) == len({*names}):
        largest = max(subjects, key=subjects.__getitem__)
        yield f"subjects: {listed([*subjects], 5)}: one body; --joints '{largest}:*' takes one"


def is_seen(positions: Positions) -> bool:
    """Say whether there is a person: two markers or more are seen at some time; positions as for `clips_of_markers`."""
    return bool(np.isfinite(_seen(positions)[:, :, 0]).any(axis=0).sum() > 1)


def _performers(people: dict[str, _Own], positions: Positions, notes: list[str]) -> dict[str, _Own]:
    """Leave out of several people whom nobody saw, what is no body, as speeds are, and a body that is there again."""
    tests: dict[str, Callable[[_Own, _Own], bool]] = {
        "never seen": lambda own, _: is_seen(positions[:, [*own]]),
        "no body": lambda own, _: _is_body(positions[:, [*own]]),
        "the same body again": lambda own, first: own is first or _apart(first, own, positions) > _SAME,
    }
    for what, is_one in tests.items():
        first = next(iter(people.values()))
        lost = [person for person, own in people.items() if not is_one(own, first)]
        if 0 < len(lost) < len(people):
            notes.append(f"left out: {what}: {listed([person or '0' for person in lost], 5)}")
            people = {person: own for person, own in people.items() if person not in lost}
    return people


def _is_body(positions: Positions) -> bool:
    """Say whether two of the joints that are seen keep their distance, or too few frames show them to tell."""
    seen = _seen(positions)
    seen = seen[:, np.isfinite(seen[:, :, 0]).any(axis=0)]
    return _holds_together(seen[np.isfinite(seen).all(axis=(1, 2))])


def _are_markers(people: Mapping[str, _Own], labels: Sequence[str], positions: Positions) -> bool:
    """Say whether numbers behind names count markers of one body (`LThigh1`, `LThigh2`): those of a name are near."""
    first, *others = people.values()
    if not others or not all(map(str.isdecimal, people)) or any(labels[place] == name for place, name in first.items()):
        return False
    return _apart(first, others[0], positions) < _NEAR


def _apart(first: _Own, other: _Own, positions: Positions) -> float:
    """Give how far joints of the same names are apart, in shares of how far half of all are from the middle."""
    seen, second = _seen(positions), {name: place for place, name in other.items()}
    both = [(place, second[name]) for place, name in first.items() if name in second]
    apart = np.linalg.norm(np.diff(seen[:, both], axis=2), axis=3)
    apart = apart[np.isfinite(apart)]
    return float(np.median(apart)) / (from_middle(seen)[1] or 1.0) if len(apart) else math.inf


def _clip(names: Sequence[str], even: Evened, notes: Sequence[str]) -> Clip:
    missing: NDArray[np.bool_] = np.isnan(even.positions).max(axis=2)
    absent, lost = _absences(missing, MAX_GAP * even.rate)
    if (~lost).sum() < 2:
        raise ValueError(f"expected 2 markers or more that are seen, got {(~lost).sum()} of {len(names)}")
    skeleton = Skeleton(tuple(name for name, gone in zip(names, lost, strict=True) if not gone))
    filled = _filled(even.positions[:, ~lost], missing[:, ~lost], absent)
    odd = "positions: no two joints keep their distance: are they speeds, or turns?"
    rests = [] if _holds_together(filled) else [odd]
    spans = [(a / even.rate, b / even.rate) for a, b in absent]
    rests += [f"not seen: too many markers from {a:.2f} to {b:.2f} s; the body rests" for a, b in spans]
    return Clip(
        skeleton=skeleton,
        positions=filled,
        frame_rate=even.rate,
        filled=int(missing[:, ~lost].sum()) + even.missing * len(skeleton.joints),
        gaps=tuple(sorted((*even.gaps, *spans))),
        notes=(*notes, *_left_out(names, missing, lost), *rests),
    )


def _seen(positions: Positions) -> Positions:
    """Put NaN where a position stands for a marker that was not seen; gives a copy.

    Such are positions of one whole number thrice (0 0 0, -1 -1 -1), and a place far away that is taken again and again.
    """
    found = positions.astype(np.float64)
    x = found[:, :, 0]
    nowhere = (found == x[:, :, None]).all(axis=2) & (x % 1 == 0)
    # A pose around its root has the root at 0 0 0 throughout, in the middle of the other joints.
    rooted = nowhere.all(axis=0) & (x == 0).all(axis=0)
    if rooted.sum() == 1 and _is_around_origin(found[:, ~rooted]):
        nowhere[:, rooted] = False
    found[nowhere | ~np.isfinite(found).all(axis=2)] = np.nan
    away, radius = from_middle(found)
    # A place that is held in several frames is no place: programs write 9999 for markers that they do not see.
    far = away > FAR * radius
    places, counts = np.unique(found[far], axis=0, return_counts=True)
    for place in places[counts > 1]:
        found[far & (found == place).all(axis=2)] = np.nan
    return found


def _is_around_origin(positions: Positions) -> bool:
    """Say whether the middle of the joints is near the origin in every frame."""
    _, radius = from_middle(positions)
    middle = np.linalg.norm(np.nanmedian(positions, axis=1), axis=1)
    return positions.shape[1] < 2 or bool((middle <= radius).all())


def _absences(missing: NDArray[np.bool_], longest: float) -> tuple[list[tuple[int, int]], NDArray[np.bool_]]:
    """Find when there is no body, frames from and to, and the markers that are missing for too long at other times.

    The shares of `_ABSENT` are tried one after the other. The first that leaves half of the markers and half of the
    frames is taken, else the one that leaves most places.
    """
    ever: NDArray[np.bool_] = ~missing.min(axis=0)
    ways = list[tuple[int, list[tuple[int, int]], NDArray[np.bool_]]]()
    for share in _ABSENT:
        away = np.asarray(missing[:, ever].mean(axis=1) > share) if ever.any() else ever[:0]
        absent = [(a, b) for a, b in _runs(away) if b - a > longest]
        gone = missing.copy()
        for a, b in absent:
            gone[a:b] = False
        lost = np.array([any(b - a > longest for a, b in _runs(each)) for each in gone.T]) | ~ever
        kept, frames = int((~lost).sum()), len(missing) - sum(b - a for a, b in absent)
        if 2 * kept >= ever.sum() and 2 * frames >= len(missing):
            return absent, lost
        ways.append((kept * frames, absent, lost))
    return max(ways, key=lambda way: way[0])[1:]


def _filled(positions: Positions, missing: NDArray[np.bool_], absent: Sequence[tuple[int, int]]) -> Positions:
    """Put straight lines where single markers are missing, and let the body rest where it is absent."""
    filled, frames = positions.copy(), np.arange(len(positions))
    for joint in np.flatnonzero(missing.any(axis=0)).tolist():
        gone = missing[:, joint]
        for axis in range(3):
            filled[gone, joint, axis] = np.interp(frames[gone], frames[~gone], positions[~gone, joint, axis])
    for a, b in absent:
        filled[a:b] = filled[a - 1] if a else filled[min(b, len(filled) - 1)]
    return filled


def _holds_together(positions: Positions) -> bool:
    """Say whether two of some joints keep their distance, in some frames."""
    some = positions[:: 1 + len(positions) // 32, :40]
    if len(some) < 3 or some.shape[1] < 4:
        return True
    apart = np.linalg.norm(some[:, :, None] - some[:, None], axis=3)
    mean = apart.mean(axis=0)
    return bool((apart.std(axis=0)[mean > 0] < _STEADY * mean[mean > 0]).any())


def _left_out(names: Sequence[str], missing: NDArray[np.bool_], lost: NDArray[np.bool_]) -> list[str]:
    """Say in one line which markers are left out, and in which share of the frames each is not seen."""
    shares = [(name, share) for name, share, gone in zip(names, missing.mean(axis=0), lost, strict=True) if gone]
    each = [f"{name} (never seen)" if share == 1 else f"{name} (not seen in {share:.0%})" for name, share in shares]
    return [f"left out: {len(each)} of {len(names)} markers: {listed(each, _MAX_LISTED)}"] if each else []


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Give where runs of true flags begin and end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
