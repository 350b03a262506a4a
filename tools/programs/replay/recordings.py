"""The recordings that `kinespace replay` sends: found, read piece by piece, cut, each piece of one class."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from kinespace.library import Clip, MotionLibrary, Reading, find_recordings
from kinespace.library.recordings import RecordingReader, labelled, segments_beside
from kinespace.tools.cli.arguments import BUILT_IN, class_at
from kinespace.tools.feeding.feed import Piece
from kinespace.tools.terminal.named_joints import NameTeller
from kinespace.tools.terminal.tables import counted

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from kinespace.library.recordings.formats.labels import Segment
    from kinespace.library.skeleton import Skeleton
    from kinespace.tools.programs.replay.options import Course


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


def announced(recordings: Sequence[Path | Clip], course: Course) -> str:
    """Say how much is about to be sent; the seconds only of motions, because files are read while they are sent."""
    clips = [each for each in recordings if isinstance(each, Clip)]
    what = counted(len(recordings), "motion" if clips else "recording")
    if len(clips) < len(recordings):
        return f"sending {what}"
    lasting = [min(each.duration, course.end or each.duration) - course.begin for each in clips]
    seconds = (sum(lasting) + course.pause * (len(clips) - 1)) / course.speed
    return f"sending {what}, {seconds:.0f} s{', again and again' if course.loop else ''}"


def pieces_of(recordings: Sequence[Path | Clip], reading: Reading, course: Course) -> Iterator[Piece]:
    """Read the recordings, one after the other, in a loop for ever; all with the first recording's joints."""
    skeleton: Skeleton | None = None
    teller = NameTeller()
    with RecordingReader(reading) as reader:
        while True:
            for recording in recordings:
                for piece in _cut(_read(reader, recording), course.begin, course.end):
                    skeleton = skeleton or piece.clip.skeleton
                    yield Piece(piece.start, teller(piece.clip).as_of(skeleton))
            if not course.loop:
                return


def _read(reader: RecordingReader, recording: Path | Clip) -> Iterator[Clip]:
    """Read a recording in consecutive pieces, each of one class, by labels beside the recording if there are any."""
    if isinstance(recording, Clip):
        yield replace(recording, name=recording.name or f"{recording.class_name} {recording.actor}".strip())
        return
    segments, start = segments_beside(recording), 0
    for clip in reader.pieces(recording):
        if not segments:
            yield labelled(clip, recording)
            continue
        yield from _by_label(clip, start, segments)
        start += clip.frames


def _by_label(clip: Clip, start: int, segments: Sequence[Segment]) -> Iterator[Clip]:
    """Divide a clip, whose first frame is a recording's frame `start`, where labels begin and end."""
    spans = [(round(each.start * clip.frame_rate), round(each.end * clip.frame_rate), each.label) for each in segments]
    ends = (place - start for span in spans for place in span[:2])
    places = sorted({0, clip.frames, *(place for place in ends if 0 < place < clip.frames)})
    for first, last in pairwise(places):
        label = next((label for begin, end, label in spans if begin <= start + first < end), "")
        yield replace(
            clip, positions=clip.positions[first:last], rotations=clip.rotations[first:last], class_name=label
        )


def _cut(clips: Iterable[Clip], begin: float, end: float | None) -> Iterator[Piece]:
    """Give the part of a recording between two moments, seconds from its start; only this part is read."""
    start = given = 0
    clip: Clip | None = None
    for clip in clips:
        first, last = round(begin * clip.frame_rate), None if end is None else round(end * clip.frame_rate)
        here = slice(max(first - start, 0), None if last is None else max(last - start, 0))
        start += clip.frames
        if len(positions := clip.positions[here]):
            yield Piece(given, replace(clip, positions=positions, rotations=clip.rotations[here]))
            given += len(positions)
        if last is not None and start >= last:
            break
    if clip and not given:
        raise ValueError(f"clip {clip.name!r}: expected --from and --to within its {start / clip.frame_rate:.2f} s")
