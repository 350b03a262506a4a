"""Timing on a busy machine: a thread's own time, turns, warm-up, medians."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from kinespace.tools.terminal.console import progress

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

#: Whether the system counts a thread's own time finely enough.
_FINE = time.get_clock_info("thread_time").resolution <= 1e-6


def clock() -> float:
    """Give the seconds for which this thread has used a core; other programs' time does not count.

    Where the system counts it too coarsely, the wall clock is used.
    """
    return time.thread_time() if _FINE else time.perf_counter()


def timed(call: Callable[[], object]) -> float:
    """Give the seconds of a core that a call took."""
    start = clock()
    call()
    return clock() - start


def in_turns(jobs: Mapping[str, Callable[[], float]], rounds: int, what: str) -> dict[str, NDArray[np.float64]]:
    """Run jobs one after the other, in rounds, so that a disturbance of the machine meets all jobs alike.

    Parameters
    ----------
    jobs
        Each job returns its cost, in a unit of its own. The first turn of each job warms up and does not count.
    rounds
        Turns that count.
    what
        The title of the progress bar.

    Returns
    -------
    By job, the cost of each round, shape (rounds,).
    """
    turns = range(rounds + 1)
    costs = [{name: job() for name, job in jobs.items()} for _ in progress(turns, what, len(turns))]
    return {name: np.array([cost[name] for cost in costs[1:]]) for name in jobs}
