"""Work in a thread that yields to the frames: it rests while other threads want Python's lock."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

#: Seconds of work after which the thread looks whether it was alone, and for which it rests when it was not.
PIECE, REST = 5e-4, 1e-3
#: The share of a piece that the thread must have had for itself to count as alone.
ALONE = 0.8


@contextmanager
def yielding(
    clock: Callable[[], float] = time.perf_counter,
    used: Callable[[], float] = time.thread_time,
    rest: Callable[[float], None] = time.sleep,
) -> Iterator[None]:
    """Let the calling thread rest, in the `with` block, while others are busy.

    A thread that computes can take Python's lock whenever another thread receives a packet, so that answers wait under
    a flood of packets. The thread looks at each call of a function, where a profiler would look; the profiler that was
    set comes back after the block.

    Parameters
    ----------
    clock
        Seconds.
    used
        Seconds of a core that the calling thread has used.
    rest
        Sleeps some seconds.
    """
    began, had = clock(), used()

    def look(_frame: FrameType, _event: str, _argument: object) -> None:
        nonlocal began, had
        took = clock() - began
        if took < PIECE:
            return
        if used() - had < ALONE * took:
            rest(REST)
        began, had = clock(), used()

    before = sys.getprofile()
    sys.setprofile(look)
    try:
        yield
    finally:
        sys.setprofile(before)
