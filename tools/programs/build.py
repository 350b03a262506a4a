"""`kinespace build`: makes one motion library file of recordings and libraries.

Puts the motions of recordings and library files together, over the joints that all of them have. A recording's class is
in its name (HDM05) or is its folder's name. A file of labels next to a take, with the take's name and the ending .csv,
.tsv or .txt, cuts it into motions.
"""

import argparse
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from pathlib import Path

from kinespace.library import NOTHING, Clip, MotionLibrary, Reading, find_recordings, library_file, recordings
from kinespace.library.naming import hdm05, listed
from kinespace.library.recordings.formats import utkinect
from kinespace.library.recordings.formats.labels import LabelError, Segment, cut, labels_beside, oddities, read_labels
from kinespace.library.windows.courses import without_course
from kinespace.library.windows.segments import mirrored
from kinespace.tools.cli import arguments
from kinespace.tools.cli.console import NameNotes, counted, progress, require_place_for, say

#: Seconds: a longer recording hardly is one motion; HDM05's longest cut clip has eight.
_MAX_SECONDS = 15.0
#: Damaged files, and other files and motions, that are named, at most.
_MAX_NAMED, _MAX_LISTED = 10, 5
#: Seconds of the shortest window by which motions are compared.
_MIN_WINDOW = 0.25


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    text = f"folders, recordings, libraries, or {arguments.BUILT_IN}"
    parser.add_argument("sources", nargs="+", type=Path, metavar="SOURCE", help=text)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="the library to write")
    text = "leave these classes or persons out"
    parser.add_argument(
        "--without", action="extend", type=arguments.names, default=[], metavar="CLASS|PERSON,...", help=text
    )
    text = f'rename these classes; motions of the class {NOTHING} are to be answered "unknown"'
    parser.add_argument("--rename", **arguments.several(arguments.mapping, "OLD=NEW"), help=text)
    arguments.add_shared(parser, "--either-side")
    text = "start_s,end_s,label for each recording, in order: cut it into these motions (default: the file next to it)"
    parser.add_argument("--labels", **arguments.several(Path, "CSV"), help=text)
    arguments.add_shared(parser, "--overwrite", "--feed", "--actor-in")
    arguments.add_reading(parser)
    parser.add_argument("--licence", help="terms of the recordings (default: HDM05's, if they are named like HDM05's)")
    parser.add_argument("--attribution", help="the authors to name (default: HDM05's, if they are named like HDM05's)")


def run(options: argparse.Namespace) -> None:
    """Build a library from recordings and libraries, save it, and print its contents."""
    sources, output, labels = options.sources, options.output, options.labels
    places = [each for each in sources if each.suffix != ".npz" or recordings.is_recording(each)]
    places = [each for each in places if each != arguments.BUILT_IN]
    files = [each for each in sources if each not in places]
    if labels and not places:
        raise ValueError("--labels: expected recordings to cut, got libraries only")
    library_file.require_name(output)
    require_place_for(output, overwrite=options.overwrite)
    libraries = [arguments.library_at(file) for file in files]
    read = _Recordings(arguments.reading_of(options), options.licence, options.attribution)
    clips = list(read.motions(places, labels)) if places else []
    if not (clips or libraries):
        notes = f" ({'; '.join(read.notes)})" if read.notes else ""
        raise ValueError(f"labels: expected segments with two frames or more of their takes, got none{notes}")
    libraries += by_body(clips)
    merged = changed(reduce(MotionLibrary.merged_with, libraries), options.without, dict(options.rename))
    if not merged.classes:
        raise ValueError(f"motions: expected some of another class than {NOTHING!r}, got none")
    if options.either_side:
        merged = merged.with_motions(list(map(mirrored, merged.motions)))
    merged.save(output)
    made = f"{counted(len(merged), 'motion')}, {counted(len(merged.classes), 'class', 'classes')}"
    say(f"{output}: {made}, {output.stat().st_size / 1e6:.2f} MB")
    for line in (*read.notes, *_remarks(libraries, merged, read.uncut)):
        say(line)


def changed(library: MotionLibrary, without: Sequence[str], names: Mapping[str, str]) -> MotionLibrary:
    """Leave out classes and persons, and rename the classes that stay by their old names.

    Raises
    ------
    ValueError
        The library lacks a class or a person.
    """
    classes, actors = {motion.class_name for motion in library.motions}, library.actors
    for name in without:
        if name not in (*classes, *actors):
            listed = ", ".join((*sorted(classes), *actors))
            raise ValueError(f"--without: expected a class or a person ({listed}), got {name!r}")
    for name in names:
        if name not in classes - set(without):
            stays = " that stays" if name in classes else ""
            raise ValueError(f"--rename: expected a class ({', '.join(sorted(classes))}){stays}, got {name!r}")
    return library.without(classes={*without} & classes, actors={*without} & {*actors}).renamed(names)


class _Recordings:
    """Reads recordings: each is one motion, or labels cut it into several motions of these classes.

    Attributes
    ----------
    uncut
        Recordings that are one motion each.
    notes
        On the labels, for a person, a line each.
    """

    def __init__(self, reading: Reading, licence: str | None, attribution: str | None) -> None:
        self._reading, self._licence, self._attribution = reading, licence, attribution
        self.uncut: list[Clip] = []
        self.notes: list[str] = []
        self._filled = self._read = 0

    def motions(self, places: Sequence[Path], labels: Sequence[Path]) -> Iterator[Clip]:
        """Give the motions of recordings, by the given labels or the labels next to the recordings."""
        paths = find_recordings(places)
        if labels and len(labels) != len(paths):
            raise ValueError(f"--labels: expected one for each of {len(paths)} recordings, got {len(labels)}")
        given = list(map(read_labels, labels)) if labels else list(map(recordings.segments_beside, paths))
        named, found = NameNotes(), sum(each is not None for each in given)
        if found and not labels:
            self.notes.append(f"{found} of {counted(len(paths), 'recording')} cut by the labels next to them")
        near = {} if labels else {path: labels_beside(path) for path in paths}
        for path, (first, *others) in ((path, files) for path, files in near.items() if len(files) > 1):
            self.notes.append(f"{path.name}: cut by {first.name}, not by {', '.join(each.name for each in others)}")
        self.notes += _passed_over(places, {*paths, *labels, *(each for files in near.values() for each in files)})
        damaged = list[str]()
        reader = recordings.RecordingReader(self._reading)
        for path, segments in zip(progress(paths, "Reading", len(paths)), given, strict=True):
            try:
                clips = [self._with_terms(named(clip), path) for clip in reader.clips(path)]
            except recordings.RecordingError as error:
                damaged.append(str(error))
                continue
            self._filled += sum(clip.filled for clip in clips)
            self._read += sum(clip.frames * len(clip.skeleton.joints) for clip in clips)
            yield from self._motions_of(clips, path, segments)
        if damaged:
            more = [f"and {len(damaged) - _MAX_NAMED} more"] if len(damaged) > _MAX_NAMED else []
            raise recordings.RecordingError(*damaged[:_MAX_NAMED], *more)
        if self._filled:
            self.notes.append(f"{self._filled} of {self._read} joint positions were missing, and are on straight lines")

    def _with_terms(self, clip: Clip, path: Path) -> Clip:
        """Set a clip's source and terms: the given ones, the file's own, or HDM05's for names like HDM05's."""
        notes = clip.source or path.name, clip.licence, clip.attribution
        ours = hdm05.SOURCE, hdm05.LICENCE, hdm05.ATTRIBUTION
        source, *terms = ours if hdm05.read_clip_name(path) else notes
        return replace(
            clip, source=source, licence=self._licence or terms[0], attribution=self._attribution or terms[1]
        )

    def _motions_of(self, clips: Sequence[Clip], path: Path, segments: Sequence[Segment] | None) -> Iterator[Clip]:
        """Give the motions of one recording, a clip for each performer."""
        if segments is None:
            whole = [recordings.labelled(clip, path, self._reading.actor_in) for clip in clips]
            self.uncut += whole
            yield from whole
        else:
            takes = [recordings.performed(clip, path, self._reading.actor_in) for clip in clips]
            yield from self._cut(takes, segments, path)

    def _cut(self, takes: Sequence[Clip], segments: Sequence[Segment], path: Path) -> Iterator[Clip]:
        """Cut the takes of one recording: with several performers each label names its performer."""
        performers = {take.actor for take in takes}
        for segment in segments:
            if len(takes) > 1 and segment.performer not in performers:
                notes = repr(segment.performer) if segment.performer else "none"
                known = ", ".join(sorted(performers))
                raise LabelError(f"{path}: labels: expected a performer of {known}, got {notes}")
        for take in takes:
            own = [each for each in segments if not (take.actor and each.performer) or each.performer == take.actor]
            if others := sorted({each.performer for each in segments} - {each.performer for each in own} - performers):
                lost = sum(each.performer in others for each in segments)
                whose = f"{counted(lost, 'label')} of {', '.join(others)}"
                self.notes.append(f"{path.name}: {whose} left out: {take.actor} is in the recording")
            self.notes += oddities(take, own)
            yield from cut(take, own)


def by_body(clips: Sequence[Clip]) -> list[MotionLibrary]:
    """Make a library of the clips of each set of joints; merged they meet over the joints that all of them have."""
    bodies = dict[frozenset[str], list[Clip]]()
    for clip in clips:
        bodies.setdefault(frozenset(clip.skeleton.joints), []).append(clip)
    return [MotionLibrary.of_clips(each) for each in bodies.values()]


def _passed_over(places: Sequence[Path], used: Collection[Path]) -> Iterator[str]:
    """List the files in folders that are neither recordings, nor skeletons, nor labels of a recording."""
    notes = list[str]()
    for place in filter(Path.is_dir, places):
        for path in sorted({each for each in place.rglob("*") if each.is_file()} - {*used}):
            if path.suffix.lower() != ".asf" and not path.name.startswith(utkinect.LABELS):
                is_systems = recordings.is_systems(path.relative_to(place))
                what = "a system wrote it" if is_systems else recordings.instead_of_recording(path)
                notes.append(f"{path.name} ({what})")
    if notes:
        yield f"{counted(len(notes), 'file')} passed over: {listed(notes, _MAX_LISTED)}"


def _remarks(libraries: Sequence[MotionLibrary], merged: MotionLibrary, uncut: Sequence[Clip]) -> Iterator[str]:
    """Say which joints were lost, which motions are too short, and which recordings may have several motions."""
    every = dict.fromkeys(name for library in libraries for name in library.skeleton.joints)
    if lost := [name for name in every if name not in merged.skeleton.joints]:
        yield f"{len(merged.skeleton.joints)} joints that all sources have; without {', '.join(lost)}"
    if short := [motion for motion in merged.motions if motion.duration < _MIN_WINDOW]:
        names = listed([motion.name for motion in short], _MAX_LISTED)
        yield f"{len(short)} of {counted(len(merged), 'motion')} below {_MIN_WINDOW:g} s, for playback alone: {names}"
    if lacking := without_course(merged.motions):
        yield f"too short, or one posture, to be found done: {', '.join(lacking)}"
    if long := [clip for clip in uncut if clip.duration > _MAX_SECONDS]:
        longest = max(long, key=lambda clip: clip.duration)
        yield (
            f"{len(long)} of {counted(len(uncut), 'recording')} longer than {_MAX_SECONDS:g} s, {longest.name} "
            f"({longest.duration:.0f} s) the longest; each is taken as one motion; --labels cuts takes into motions"
        )
