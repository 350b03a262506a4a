"""The recordings that `kinespace replay` sends: found, read one after the other, cut, each piece of one class."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from kinespace.library import Clip, MotionLibrary, Reading, find_recordings
from kinespace.library.recordings import RecordingReader, labelled, segments_beside
from kinespace.library.recordings.formats.labels import Segment
from kinespace.library.skeleton import Skeleton
from kinespace.tools.cli.arguments import BUILT_IN, class_at
from kinespace.tools.feeding.feed import Piece
from kinespace.tools.terminal.files import NameNotes
from kinespace.tools.terminal.tables import counted


def recordings_in(places: Sequence[Path], reading: Reading) -> list[Path | Clip]:
    """List the files to read and the built-in library's motions, place by place, each once."""
    found = [each for place in places for each in _in_place(place)] if places else [*MotionLibrary.builtin().motions]
    if reading != Reading() and not any(isinstance(each, Path) for each in found):
        raise ValueError(
            "replay: expected recordings with --asf, --frame-rate, --unit, --joints, --names, got none to read"
        )
    return list(dict.fromkeys(found))


def _in_place(place: Path) -> Sequence[Path | Clip]:
    """Give the motions of the built-in library, or of its class of that name, if no path has that name."""
    if place == BUILT_IN and not place.exists():
        return MotionLibrary.builtin().motions
    if name := class_at(place):
        return [each for each in MotionLibrary.builtin().motions if each.class_name == name]
    return find_recordings([place])


def announced(recordings: Sequence[Path | Clip], options: argparse.Namespace) -> str:
    """Say how much is about to be sent; the seconds only of motions, because files are read while they are sent."""
    clips = [each for each in recordings if isinstance(each, Clip)]
    what = counted(len(recordings), "motion" if clips else "recording")
    if len(clips) < len(recordings):
        return f"sending {what}"
    lasting = [min(each.duration, options.end or each.duration) - options.begin for each in clips]
    seconds = (sum(lasting) + options.pause * (len(clips) - 1)) / options.speed
    return f"sending {what}, {seconds:.0f} s{', again and again' if options.loop else ''}"


def pieces_of(recordings: Sequence[Path | Clip], reading: Reading, options: argparse.Namespace) -> Iterator[Piece]:
    """Read the recordings, one after the other, in a loop for ever; all with the first recording's joints."""
    skeleton: Skeleton | None = None
    reader, teller = RecordingReader(reading), NameNotes()
    while True:
        for recording in recordings:
            clip, segments = _read(reader, recording)
            skeleton = skeleton or clip.skeleton
            yield from _cut(teller(clip).as_of(skeleton), segments, options)
        if not options.loop:
            return


def _read(reader: RecordingReader, recording: Path | Clip) -> tuple[Clip, Sequence[Segment]]:
    """Read a recording, and the labels next to it if there are any; without labels the clip has its class."""
    if isinstance(recording, Clip):
        return replace(recording, name=recording.name or f"{recording.class_name} {recording.actor}".strip()), ()
    clip, segments = reader.clip(recording), segments_beside(recording)
    return (clip, segments) if segments else (labelled(clip, recording), ())


def _cut(clip: Clip, segments: Sequence[Segment], options: argparse.Namespace) -> Iterator[Piece]:
    """Give the wanted part of a recording in pieces, each of one class: it is divided where labels begin and end."""
    begin = round(options.begin * clip.frame_rate)
    end = clip.frames if options.end is None else min(round(options.end * clip.frame_rate), clip.frames)
    if begin >= end:
        raise ValueError(f"clip {clip.name!r}: expected --from and --to within its {clip.duration:.2f} s")
    spans = [(round(each.start * clip.frame_rate), round(each.end * clip.frame_rate), each.label) for each in segments]
    ends = {place for span in spans for place in span[:2] if begin < place < end}
    for first, last in pairwise(sorted({begin, end, *ends})):
        label = next((label for start, stop, label in spans if start <= first < stop), "")
        piece = replace(clip, positions=clip.positions[first:last], rotations=clip.rotations[first:last])
        yield Piece(first - begin, replace(piece, class_name=label) if segments else piece)
