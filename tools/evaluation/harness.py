"""Takes, the labels of the motions in them, and the libraries that recognise them, played through the live recogniser.

All evaluations share this.
"""

import argparse
import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import NOTHING, Clip, MotionLibrary, Reading, Skeleton, WindowIndex, find_recordings, memory
from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import hdm05
from kinespace.library.recordings import RecordingReader, labelled, performed, segments_beside
from kinespace.library.recordings.formats import utkinect
from kinespace.library.recordings.formats.labels import LabelError, Segment, cut, oddities, renamed
from kinespace.library.recordings.formats.texts import lines_of
from kinespace.library.skeleton import SkeletonMismatchError
from kinespace.library.windows.segments import mirrored
from kinespace.stream import Frame, Recognition, Recognizer, Settings
from kinespace.tools.cli import arguments
from kinespace.tools.cli.console import NameNotes, note, progress

_COLUMNS = ("file", "subject", "contains", "perhaps")


@dataclass(frozen=True, slots=True, eq=False)
class Take:
    """A recording, and the motions performed in it.

    Attributes
    ----------
    clip
        A clip of evenly spaced frames; frames that a sensor skipped are on straight lines.
    segments
        The labelled segments; one segment of `NOTHING` in a take without known motions.
    contains
        Classes that are performed at some time in the take.
    delivered
        The clip's frames that a sensor delivered, shape (frames,); None when it delivered all.
    """

    clip: Clip
    segments: tuple[Segment, ...]
    contains: tuple[str, ...] = ()
    delivered: NDArray[np.int64] | None = field(default=None, repr=False)

    @property
    def person(self) -> str:
        """The person who performs; empty when not known."""
        return self.clip.actor

    @property
    def is_known(self) -> bool:
        """Whether motions can be cut out of it."""
        return any(segment.label != NOTHING for segment in self.segments)

    @property
    def labels(self) -> set[str]:
        """The labels of all motions performed, whether the library knows them or not; without `NOTHING`."""
        return {*self.contains, *(segment.label for segment in self.segments)} - {NOTHING}

    def motions(self) -> list[Clip]:
        """Cut out the motions performed, one for each segment."""
        if len(self.segments) == 1 and self.segments[0].duration >= self.clip.duration:
            return [replace(self.clip, class_name=self.segments[0].label)]
        return list(cut(self.clip, self.segments))


@dataclass(frozen=True, slots=True)
class Sources:
    """The places from which takes are read.

    Attributes
    ----------
    places
        Labelled takes, or folders of them: each take's labels lie next to it, ending in `.csv`, `.tsv` or `.txt`, or as
        UTKinect has them.
    clips
        Whether each recording without labels is one motion from beginning to end. Its class is in its name (for files
        named like HDM05's, without this option too) or is its folder's name.
    unknown
        Recordings without known motions, or folders of them.
    tables
        CSV files that list the classes that each take contains.
    names
        Class names for labels that the library calls otherwise.
    persons
        The persons whose takes are kept; all when empty.
    """

    places: Sequence[Path] = ()
    clips: bool = False
    unknown: Sequence[Path] = ()
    tables: Sequence[Path] = ()
    names: Mapping[str, str] = field(default_factory=dict)
    persons: Sequence[str] = ()

    def __bool__(self) -> bool:
        return bool(self.places or self.unknown or self.tables)

    def wants(self, person: str) -> bool:
        """Whether a person's takes are kept."""
        return not self.persons or person in self.persons


@dataclass(frozen=True, slots=True)
class _Entry:
    """A recording before it is read; segments None: it is one motion; person None: its path names the person."""

    path: Path
    segments: tuple[Segment, ...] | None = ()
    contains: tuple[str, ...] = ()
    person: str | None = None


def read_takes(sources: Sources, reading: Reading) -> list[Take]:
    """Read takes of all kinds.

    Raises
    ------
    ValueError
        A recording, a table or labels cannot be used, `names` renames a label that no take has, or no takes are left.
    OSError
        A file or a take's labels are missing or cannot be opened.
    """
    unknown = find_recordings(sources.unknown) if sources.unknown else ()
    entries = [*_labelled(sources), *(_Entry(path, contains=(NOTHING,)) for path in unknown)]
    entries += [each for table in sources.tables for each in _listed(table)]
    wanted = [each for each in entries if each.person is None or sources.wants(each.person)]
    reader, named = RecordingReader(reading), NameNotes()
    read = progress(wanted, "Reading", len(wanted))
    takes = [_take(named(reader.clip(entry.path)), entry, reading) for entry in read]
    people = sorted({*(take.person for take in takes), *(entry.person or "" for entry in entries)} - {""})
    takes = [take for take in takes if sources.wants(take.person)]
    for take in takes:
        for line in oddities(take.clip, take.segments) if take.is_known else ():
            note(line)
    if not takes:
        there = f"those of {', '.join(people)}" if people else "none"
        raise ValueError(f"takes: expected some of {', '.join(sources.persons) or 'anybody'}, got {there}")
    return _with_distinct_names(_with_labels(takes, sources.names))


def takes_of(motions: Sequence[Clip]) -> list[Take]:
    """Make a take of each motion of a library."""
    named = [replace(each, name=f"{each.class_name} {each.actor} {each.take}".strip()) for each in motions]
    return _with_distinct_names([Take(each, _throughout(each, each.class_name)) for each in named])


def _labelled(sources: Sources) -> Iterator[_Entry]:
    for path in find_recordings(sources.places) if sources.places else ():
        named = hdm05.read_clip_name(path)
        if segments := segments_beside(path):
            yield _Entry(path, segments)
        elif sources.clips or (named and named.class_name):
            yield _Entry(path, None)
        else:
            what = f"no labels for {path.name}; --clips says that it is one motion"
            raise FileNotFoundError(f"{path.with_suffix('.csv')}: {what}")


def _listed(table: Path) -> Iterator[_Entry]:
    """Read the takes that a table lists, without takes that may contain a class: nothing is known of them."""
    try:
        rows = csv.DictReader(lines_of(table, memory.MAX_WITHOUT_MOTION))
        missing = [name for name in _COLUMNS if name not in (rows.fieldnames or ())]
        if missing:
            got = f"none called {', '.join(missing)}"
            raise LabelError(f"{table}: expected the columns {', '.join(_COLUMNS)}, got {got}")
        for row in rows:
            contains, perhaps = _names(row["contains"]), _names(row["perhaps"])
            if not row["file"]:
                raise LabelError(f"{table}:{rows.line_num}: expected the name of a file, got none")
            if contains or not perhaps:
                yield _Entry(table.parent / row["file"], (), contains or (NOTHING,), row["subject"] or "")
    except (csv.Error, UnicodeDecodeError) as error:
        raise LabelError(f"{table}: expected a CSV in UTF-8 ({error})") from error


def _names(text: str | None) -> tuple[str, ...]:
    return tuple(name for each in re.split("[,;]", text or "") if (name := each.strip()))


def _take(clip: Clip, entry: _Entry, reading: Reading) -> Take:
    if entry.segments is None:
        clip = labelled(clip, entry.path, reading.actor_in)
        return Take(clip, _throughout(clip, clip.class_name))
    clip = performed(clip, entry.path, reading.actor_in)
    if entry.person is not None:
        clip = replace(clip, actor=entry.person)
    if entry.contains == (NOTHING,):
        return Take(clip, _throughout(clip, NOTHING))
    shown = utkinect.delivered(entry.path) if utkinect.is_take(entry.path) else None
    return Take(clip, entry.segments, entry.contains, shown)


def _throughout(clip: Clip, label: str) -> tuple[Segment]:
    return (Segment(0.0, clip.duration, label),)


def _with_labels(takes: Sequence[Take], names: Mapping[str, str]) -> list[Take]:
    """Rename labels; a name for a label that no take has is a mistake, and is refused."""
    there = {label for take in takes for label in take.labels}
    for label in names:
        if label not in there:
            raise ValueError(f"--map: expected a label of the takes, {', '.join(sorted(there))}, got {label!r}")
    contained = (tuple(names.get(name, name) for name in take.contains) for take in takes)
    pairs = zip(takes, contained, strict=True)
    return [replace(take, segments=renamed(take.segments, names), contains=each) for take, each in pairs]


def distinct(names: Iterable[str]) -> list[str]:
    """Give names with a number behind each that came before."""
    seen, numbered = Counter[str](), list[str]()
    for name in names:
        seen[name] += 1
        numbered.append(f"{name} ({seen[name]})" if seen[name] > 1 else name)
    return numbered


def _with_distinct_names(takes: Sequence[Take]) -> list[Take]:
    """Make names of takes distinct, because counts are kept by name."""
    names = distinct(take.clip.name for take in takes)
    return [replace(take, clip=replace(take.clip, name=name)) for take, name in zip(takes, names, strict=True)]


class Protocol(StrEnum):
    """Which library recognises which take."""

    #: The given library recognises all takes.
    LIBRARY = "library"
    #: A take is recognised by motions cut from the other takes.
    LEAVE_ONE_TAKE_OUT = "leave-one-take-out"
    #: A take is recognised by motions cut from the other persons' takes.
    LEAVE_ONE_PERSON_OUT = "leave-one-person-out"
    #: A library is cut from one person's takes, for every person in turn, and recognises all other takes.
    ONE_PERSON = "one-person"


class AskedTake(NamedTuple):
    """A take, and the library that recognises it.

    Attributes
    ----------
    take
        The take.
    library
        One object for all takes that it recognises, so that it is opened once.
    person
        The person who asks, where the other persons' motions make the library; the person whose motions make the
        library, where it is one person's; else empty.
    """

    take: Take
    library: MotionLibrary
    person: str = ""


def asked_by(takes: Sequence[Take], protocol: Protocol, *, either_side: bool = False) -> list[AskedTake]:
    """Make the libraries of a protocol, and say which recognises which take; takes of one library come together.

    Takes without labels are recognised by every library of the protocol that has no motions of their person; where one
    take is left out at a time, by the library of all takes.

    Parameters
    ----------
    takes
        At least one.
    protocol
        How libraries are made; not `Protocol.LIBRARY`, which makes none.
    either_side
        Whether the libraries that are made have each motion mirrored, too.

    Raises
    ------
    ValueError
        The performers are not known, or no motion is left to make a library of.
    """
    labelled = [take for take in takes if take.is_known]
    every = [*labelled, *(take for take in takes if not take.is_known)]
    by_take = protocol is Protocol.LEAVE_ONE_TAKE_OUT
    if unnamed := [] if by_take else [take.clip.name for take in labelled if not take.person]:
        raise ValueError(f"{unnamed[0]}: expected a name with the actor in it, as HDM05's have; --actor-in says where")
    whose = {id(take): str(place) if by_take else take.person for place, take in enumerate(every)}
    named = [whose[id(take)] for take in labelled]
    ones = [*dict.fromkeys(named if by_take else sorted(named))]
    if len(ones) < 2:
        what = "takes" if by_take else "persons"
        raise ValueError(f"--protocol {protocol}: expected at least two labelled {what}, got {len(ones) or 'none'}")
    asked = list[AskedTake]()
    for one in ones:
        own = [take for take in every if whose[id(take)] == one]
        rest = [take for take in every if whose[id(take)] != one]
        teaching, asking = (own, rest) if protocol is Protocol.ONE_PERSON else (rest, own)
        made = _library(teaching, either_side=either_side)
        asked += [AskedTake(take, made, "" if by_take else one) for take in asking]
    strangers = [take for take in every if whose[id(take)] not in ones]
    if strangers and protocol is not Protocol.ONE_PERSON:
        made = _library(labelled, either_side=either_side)
        asked += [AskedTake(take, made) for take in strangers]
    return asked


def _library(takes: Sequence[Take], *, either_side: bool) -> MotionLibrary:
    motions = [motion for take in takes if take.is_known for motion in take.motions()]
    return MotionLibrary.of_clips([*motions, *map(mirrored, motions)] if either_side else motions)


#: Seconds before a moment that must lie in a segment for the moment to count as inside it.
INSIDE = 1.0


class Feed(NamedTuple):
    """Frames of a take: times (frames,), seconds, and positions (frames, joints, 3), metres, of a skeleton."""

    times: NDArray[np.float64]
    positions: NDArray[np.floating]
    skeleton: Skeleton

    @classmethod
    def of(cls, clip: Clip, skeleton: Skeleton, delivered: NDArray[np.int64] | None = None) -> "Feed":
        """Give a clip's frames, or those that a sensor delivered, in the order of a skeleton's joints."""
        ordered, shown = clip.as_of(skeleton), slice(None) if delivered is None else delivered
        return cls(ordered.times[shown], ordered.positions[shown], skeleton)


def add_sources(parser: argparse.ArgumentParser, usual: str) -> None:
    """Add the options for takes, and for JSON; `usual` says what is played when there are none."""
    text = f"labelled takes, clips named as HDM05's, or folders of them (default: {usual})"
    parser.add_argument("takes", nargs="*", type=Path, metavar="TAKE", help=text)
    parser.add_argument("--clips", action="store_true", help="a recording without labels is one motion, of its folder")
    arguments.add_reading(parser)
    arguments.add_shared(parser, "--actor-in", "--subjects", "--json")
    parser.add_argument("--map", **arguments.several(arguments.mapping, "LABEL=CLASS"), help="rename labels")
    parser.add_argument("--skeleton", metavar="NAME", help="with the joints of this product alone, like kinectv2")


def add_asked(parser: argparse.ArgumentParser) -> None:
    """Add the options for takes of all kinds, and for the library and the recogniser that are asked."""
    add_sources(parser, "the library's own motions")
    parser.add_argument("--unknown", **arguments.several(Path, "TAKE"), help="takes, or folders, without known motions")
    arguments.add_shared(parser, "--takes", "--library", "--either-side")
    text = (
        "recognise with the library; with motions cut from the other takes, or from the other persons' takes; or with "
        "motions of one person, for each person in turn"
    )
    text += f" (default: {Protocol.LIBRARY}; {Protocol.LEAVE_ONE_PERSON_OUT} for the library's own motions)"
    parser.add_argument("--protocol", choices=[*map(str, Protocol)], help=text)
    arguments.add_settings(parser)


def sources_of(options: argparse.Namespace) -> Sources:
    """Make the sources of takes from the arguments."""
    further = {"places": options.takes, "persons": options.subjects, "names": dict(options.map)}
    return arguments.made_of(Sources, options, **further)


def takes_at(options: argparse.Namespace, library: MotionLibrary) -> list[Take]:
    """Read the takes; without any give the motions of a library; perhaps with the joints of one product alone."""
    if sources := sources_of(options):
        takes = read_takes(sources, arguments.reading_of(options))
    else:
        takes = [take for take in takes_of(library.motions) if sources.wants(take.person)]
    if not options.skeleton:
        return takes
    joints = arguments.joints_of(options.skeleton)
    return [replace(take, clip=take.clip.restricted_to(joints)) for take in takes]


def motions_at(options: argparse.Namespace) -> list[Clip]:
    """Cut the motions out of the takes, or give the built-in library's, over the joints that all have, in one order.

    Raises
    ------
    ValueError
        A motion has one frame, or they are of one class.
    """
    takes = takes_at(options, MotionLibrary.builtin())
    motions = [motion for take in takes if take.is_known for motion in take.motions()]
    if short := [clip.name for clip in motions if clip.frames < 2]:
        raise ValueError(f"{short[0]}: expected a motion of at least 2 frames, got one")
    classes = {clip.class_name for clip in motions}
    if len(classes) < 2:
        got = f"got {len(motions)} of {', '.join(classes) or 'none'}"
        where = "a class is in a clip's name (HDM05), is its folder's name, or a label beside the take"
        raise ValueError(f"TAKE: expected motions of two classes or more, {got}: {where}")
    joints = shared_joints([clip.skeleton for clip in motions])
    if any(len(clip.skeleton.joints) > len(joints) for clip in motions):
        motions = [clip.restricted_to(joints) for clip in motions]
    return [clip.as_of(motions[0].skeleton) for clip in motions]


def protocol_of(options: argparse.Namespace) -> Protocol:
    """Give the protocol: a library cannot be asked about its own motions."""
    given = sources_of(options)
    return Protocol(options.protocol or (Protocol.LIBRARY if given else Protocol.LEAVE_ONE_PERSON_OUT))


def asked_of(options: argparse.Namespace) -> tuple[list[AskedTake], tuple[str, ...]]:
    """Say which library recognises which take, over the joints that all have.

    Returns
    -------
    The takes with their libraries, takes of one library together; and all classes of the libraries.

    Raises
    ------
    ValueError
        There are no takes, or the protocol or `--map` does not fit them.
    """
    sources, protocol = sources_of(options), protocol_of(options)
    if not sources and protocol is Protocol.LIBRARY:
        raise ValueError("TAKE, --takes, --unknown: expected takes with --protocol library, got none")
    given = None
    if protocol is Protocol.LIBRARY or not sources:
        given = arguments.library_at(options.library)
    takes = takes_at(options, given or MotionLibrary.builtin())
    joints = shared_joints([*(take.clip.skeleton for take in takes), *([given.skeleton] if given else ())])
    takes = [replace(take, clip=take.clip.restricted_to(joints)) for take in takes]
    if given and protocol is Protocol.LIBRARY:
        library = given.restricted_to(joints)
        asked = [AskedTake(take, library) for take in takes]
    else:
        asked = asked_by(takes, protocol, either_side=options.either_side)
    classes = tuple(sorted({name for each in asked for name in each.library.classes}))
    _require_classes(takes, sources, classes)
    return asked, classes


def shared_joints(skeletons: Sequence[Skeleton]) -> tuple[str, ...]:
    """Give the joints that all takes and the library have; say which joints are lost.

    Raises
    ------
    SkeletonMismatchError
        Too few are left.
    """
    bodies = dict.fromkeys(skeleton.joints for skeleton in skeletons)
    every = tuple(dict.fromkeys(name for joints in bodies for name in joints))
    shared = tuple(name for name in every if all(name in joints for joints in bodies))
    if len(shared) < MIN_JOINTS:
        raise SkeletonMismatchError(f"joints: expected at least {MIN_JOINTS} that all have, got {len(shared)}")
    if len(shared) < len(every):
        lost = ", ".join(name for name in every if name not in shared)
        note(f"{len(shared)} joints that all takes and the library have; without {lost}")
    return shared


def _require_classes(takes: Sequence[Take], sources: Sources, classes: Sequence[str]) -> None:
    """Refuse names that are no class: the figures would not show that no motion is known."""
    for class_name in sources.names.values():
        if class_name not in classes:
            raise ValueError(f"--map: expected one of {', '.join(classes)}, got {class_name!r}")
    labels = {label for take in takes for label in take.labels}
    if labels and not labels & set(classes):
        mapped = f"--map LABEL=CLASS renames them, to one of {', '.join(classes)}"
        raise ValueError(f"expected a label that is a class of the library, got {', '.join(sorted(labels))}; {mapped}")


def pushed(recognizer: Recognizer, feed: Feed) -> Iterator[tuple[float, Recognition | None]]:
    """Push frames into a recogniser; give the time of each, and its answer if one is due."""
    for time, positions in zip(feed.times.tolist(), feed.positions, strict=True):
        yield time, recognizer.push(Frame("take", time, positions))


def answers_to(feed: Feed, compared: MotionLibrary | WindowIndex, settings: Settings) -> list[Recognition]:
    """Push frames into a recogniser of their own; give its answers."""
    return [answer for _, answer in pushed(Recognizer(compared, settings), feed) if answer is not None]


def written(value: float | None, form: str = "{:.1%}") -> str:
    """Write a figure; a dash where there is none."""
    return "-" if value is None else form.format(value)
