"""The feed of every part: motions of the built-in library, or recordings, without end; never noise."""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING

from kinespace.library import MotionLibrary, find_recordings, read_recordings
from kinespace.stream.frame import Frame
from kinespace.tools.feeding.feed import without_pause

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import numpy as np
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


def endless(positions: NDArray[np.floating], performer: str = "bench", begin: int = 0) -> Iterator[Frame]:
    """Play positions, shape (frames, joints, 3), metres, 120 times a second without end, from one of them on."""
    # Time 0 would mean "on arrival".
    return (
        Frame(performer, 1.0 + number / FRAME_RATE, positions[(begin + number) % len(positions)]) for number in count()
    )
