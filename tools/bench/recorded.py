"""The recordings every part is timed with: HDM05's cut clips and CMU's labelled takes, never noise."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from library import find_recordings, hdm05, read_recordings
from library.labels import Segment, read_labels, renamed
from stream.frame import Frame
from tools.console import progress

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from library import Clip

#: Frames per second of both databases, and of the feeds made of them.
FRAME_RATE = 120.0
HDM05, CMU = "hdm05_cut_amc", "cmu"
#: What the built-in library calls motions that the takes' labels call otherwise.
NAMES = {
    "Squat": "squat1Reps",
    "ArmCircle": "rotateArmsBothBackward1Reps",
    "Jog": "jogLeftCircle4StepsRstart",
}


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """Recordings of one skeleton.

    Attributes
    ----------
    clips
        HDM05's, one motion each.
    takes
        CMU's, one motion after another.
    segments
        What is performed when in each take; empty where nobody labelled it.
    """

    clips: tuple[Clip, ...] = field(repr=False)
    takes: tuple[Clip, ...] = field(repr=False)
    segments: tuple[tuple[Segment, ...], ...] = field(repr=False)

    @property
    def examples(self) -> tuple[Clip, ...]:
        """One clip of each class."""
        return tuple({clip.class_name: clip for clip in reversed(self.clips)}.values())

    @property
    def positions(self) -> NDArray[np.float32]:
        """All that a feed plays: the takes, then a clip of each class; shape (frames, joints, 3), metres.

        In the float32 that goes over the wire.
        """
        return np.concatenate([each.positions for each in (*self.takes, *self.examples)]).astype(np.float32)


def read(folder: Path | None) -> Recorded:
    """Read all recordings of a folder that holds `hdm05_cut_amc/` and `cmu/`.

    Raises
    ------
    ValueError
        No folder was given, one of the two is not in it, or their bodies have other joints than HDM05's.
    """
    if folder is None or not all((folder / name).is_dir() for name in (HDM05, CMU)):
        raise ValueError(f"--data: expected a folder with {HDM05}/ and {CMU}/ in it, got {folder or 'none'}")
    paths = find_recordings([folder / HDM05])
    clips = tuple(progress(read_recordings(paths), "Reading HDM05", len(paths)))
    places = find_recordings([folder / CMU])
    takes = tuple(progress(read_recordings(places), "Reading CMU", len(places)))
    for clip in (*clips, *takes):
        hdm05.SKELETON.require_same(clip.skeleton)
    labels = [path.with_suffix(".csv") for path in places]
    segments = tuple(renamed(read_labels(path), NAMES) if path.is_file() else () for path in labels)
    return Recorded(clips, takes, segments)


class Feed:
    """Recorded positions as an endless 120 Hz feed of one performer, beginning again after the last.

    Parameters
    ----------
    positions
        Shape (frames, joints, 3), metres.
    performer
        Who performs.
    begin
        Which frame comes first.
    """

    def __init__(self, positions: NDArray[np.floating], performer: str = "bench", begin: int = 0) -> None:
        self._positions = positions
        self._performer = performer
        self._begin = begin
        self.sent = 0

    def next(self) -> Frame:
        """Give the next frame; its time is 1/120 s after the one before."""
        place = (self._begin + self.sent) % len(self._positions)
        # Time 0 would mean "on arrival".
        frame = Frame(self._performer, 1.0 + self.sent / FRAME_RATE, self._positions[place])
        self.sent += 1
        return frame

    def last(self, count: int) -> NDArray[np.floating]:
        """Give the positions of the last frames, shape (count, joints, 3), metres."""
        places = np.arange(self._begin + self.sent - count, self._begin + self.sent)
        return self._positions[places % len(self._positions)]

    def take(self, count: int) -> list[Frame]:
        """Give the next frames."""
        return [self.next() for _ in range(count)]


def resampled(positions: NDArray[np.floating], rate_hz: float) -> NDArray[np.float32]:
    """Give recorded positions at another frame rate, in between by straight lines; shape (frames, joints, 3)."""
    places = np.arange(0.0, len(positions) - 1, FRAME_RATE / rate_hz)
    before = places.astype(np.intp)
    share = (places - before)[:, None, None]
    between: NDArray[np.float32] = ((1 - share) * positions[before] + share * positions[before + 1]).astype(np.float32)
    return between
