"""Takes to be recognised, and the labels of the motions in them."""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinespace.library import NOTHING, Clip, Reading, find_recordings, memory
from kinespace.library.naming import hdm05
from kinespace.library.recordings import RecordingReader, labelled, performed, segments_beside
from kinespace.library.recordings.formats import utkinect
from kinespace.library.recordings.formats.labels import LabelError, Segment, cut, oddities, read_labels, renamed
from kinespace.tools.cli.arguments import joints_of
from kinespace.tools.terminal.console import NameNotes, note, progress

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
    labels
        The takes' labels in the takes' order, when they lie elsewhere.
    clips
        Whether each recording without labels is one motion from beginning to end. Its class is in its name (for files
        named like HDM05's, without this option too) or is its folder's name.
    unknown
        Recordings without known motions, or folders of them.
    tables
        CSV files that list the classes that each take contains.
    names
        Class names for labels that the library calls otherwise.
    persons, without_persons
        The persons whose takes are kept (all when empty), and the persons whose takes are left out.
    skeleton
        Name of a joint set to which takes are restricted; all joints when not given.
    """

    places: Sequence[Path] = ()
    labels: Sequence[Path] = ()
    clips: bool = False
    unknown: Sequence[Path] = ()
    tables: Sequence[Path] = ()
    names: Mapping[str, str] = field(default_factory=dict)
    persons: Sequence[str] = ()
    without_persons: Sequence[str] = ()
    skeleton: str | None = None

    def __bool__(self) -> bool:
        return bool(self.places or self.unknown or self.tables)

    def wants(self, person: str) -> bool:
        """Whether a person's takes are kept."""
        return person not in self.without_persons and (not self.persons or person in self.persons)


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
    takes = [take for take in takes if sources.wants(take.person)]
    for take in takes:
        for line in oddities(take.clip, take.segments) if take.is_known else ():
            note(line)
    if not takes:
        persons = ", ".join((*sources.persons, *(f"not {name}" for name in sources.without_persons)))
        raise ValueError(f"--subjects: expected persons with takes, got {persons}")
    if sources.skeleton:
        joints = joints_of(sources.skeleton)
        takes = [replace(take, clip=take.clip.restricted_to(joints)) for take in takes]
    return _with_distinct_names(_with_labels(takes, sources.names))


def takes_of(motions: Sequence[Clip]) -> list[Take]:
    """Make a take of each motion of a library."""
    named = [replace(each, name=f"{each.class_name} {each.actor} {each.take}".strip()) for each in motions]
    return _with_distinct_names([Take(each, _throughout(each, each.class_name)) for each in named])


def _labelled(sources: Sources) -> Iterator[_Entry]:
    paths = find_recordings(sources.places) if sources.places else []
    if sources.labels and len(sources.labels) != len(paths):
        raise ValueError(f"--labels: expected one for each of {len(paths)} takes, got {len(sources.labels)}")
    for index, path in enumerate(paths):
        segments = read_labels(sources.labels[index]) if sources.labels else segments_beside(path)
        named = hdm05.read_clip_name(path)
        if segments:
            yield _Entry(path, segments)
        elif not sources.labels and (sources.clips or (named and named.class_name)):
            yield _Entry(path, None)
        else:
            raise FileNotFoundError(
                f"{path.with_suffix('.csv')}: no labels for {path.name}; --labels says where they are, --clips that it "
                "is one motion"
            )


def _listed(table: Path) -> Iterator[_Entry]:
    """Read the takes that a table lists, without takes that may contain a class: nothing is known of them."""
    try:
        rows = csv.DictReader(memory.lines(table, memory.MAX_WITHOUT_MOTION))
        missing = [name for name in _COLUMNS if name not in (rows.fieldnames or ())]
        if missing:
            raise LabelError(f"{table}: expected the columns {', '.join(_COLUMNS)}, no {', '.join(missing)} in it")
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

    def renamed_in(take: Take) -> Take:
        contains = tuple(names.get(name, name) for name in take.contains)
        return replace(take, segments=renamed(take.segments, names), contains=contains)

    return [renamed_in(take) for take in takes]


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
