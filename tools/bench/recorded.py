"""The feed of every part: motions of the built-in library without end; never noise."""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Frame
from kinespace.tools.feeding.feed import without_pause

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

#: Frames per second of the feeds.
FRAME_RATE = 120.0
#: Every eighth of the library's motions is played, so that there are some of each class.
_EVERY = 8


def positions() -> NDArray[np.float32]:
    """Give every eighth motion of the built-in library: shape (frames, 31, 3), metres, 120 frames per second."""
    return without_pause(MotionLibrary.builtin().motions[::_EVERY], FRAME_RATE)


def endless(positions: NDArray[np.floating], performer: str = "bench", begin: int = 0) -> Iterator[Frame]:
    """Play positions, shape (frames, joints, 3), metres, 120 times a second without end, from one of them on."""
    # Time 0 would mean "on arrival".
    return (
        Frame(performer, 1.0 + number / FRAME_RATE, positions[(begin + number) % len(positions)]) for number in count()
    )
