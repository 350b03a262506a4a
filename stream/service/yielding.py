"""Work in a thread that yields to the frames: it rests while other threads of the process are busy."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

#: Seconds of work after which the thread checks whether others were busy; seconds of rest if they were.
PIECE, REST = 5e-4, 2e-3
#: The share of a piece in which others may use a core before the thread rests.
BUSY = 0.2


def _used_by_others() -> float:
    return time.process_time() - time.thread_time()


@contextmanager
def yielding(
    clock: Callable[[], float] = time.perf_counter,
    others: Callable[[], float] = _used_by_others,
    rest: Callable[[float], None] = time.sleep,
) -> Iterator[None]:
    """Let the calling thread rest, in the `with` block, while the process's other threads are busy.

    A thread that computes can take Python's lock whenever another thread receives a packet, so that answers wait under
    a flood of packets. The thread checks at each call of a function, as a profiler does; the profiler that was set
    before the block is set again after it.

    Parameters
    ----------
    clock
        Seconds.
    others
        Seconds of a core that the process's other threads have used.
    rest
        Sleeps some seconds.
    """
    began, had = clock(), others()

    def look(_frame: FrameType, _event: str, _argument: object) -> None:
        nonlocal began, had
        took = clock() - began
        if took < PIECE:
            return
        if others() - had > BUSY * took:
            rest(REST)
        began, had = clock(), others()

    before = sys.getprofile()
    sys.setprofile(look)
    try:
        yield
    finally:
        sys.setprofile(before)
