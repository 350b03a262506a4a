"""The feed of every part: motions of the built-in library, or recordings, without end; never noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import MotionLibrary, find_recordings, read_recordings
from kinespace.stream.frame import Frame
from kinespace.tools.feeding.feed import without_pause

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

#: Frames per second of the feeds.
FRAME_RATE = 120.0
#: One in so many of the library's motions is played, so that there are some of each class.
_EVERY = 8
#: Seconds of recordings that are read at most.
_MAX_SECONDS = 120.0


def positions(folder: Path | None = None) -> NDArray[np.float32]:
    """Give the positions of a feed: every eighth motion of the built-in library, or two minutes of recordings.

    Returns
    -------
    Shape (frames, 31, 3), metres, 120 frames per second.

    Raises
    ------
    ValueError
        The folder has no recording, one cannot be used, or its joints are not the built-in library's.
    """
    library = MotionLibrary.builtin()
    clips = read_recordings(find_recordings([folder])) if folder else library.motions[::_EVERY]
    return without_pause((clip.as_of(library.skeleton) for clip in clips), FRAME_RATE, _MAX_SECONDS)


class Feed:
    """Recorded positions as an endless 120 Hz feed of one performer, beginning again after the last.

    Parameters
    ----------
    positions
        Shape (frames, joints, 3), metres.
    performer
        The performer's name.
    begin
        The index of the first frame.
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
