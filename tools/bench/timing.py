"""Timing on a busy machine: one thread and its own time, turns, warm-up, medians."""

from __future__ import annotations

import os
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from kinespace.tools.terminal.console import progress

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

#: The variables that BLAS libraries read at their start; processes started by the bench inherit them.
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
#: Whether the system counts a thread's own time finely enough.
_FINE = time.get_clock_info("thread_time").resolution <= 1e-6


@contextmanager
def one_thread() -> Iterator[str | None]:
    """Let linear algebra use one thread, here and in processes started from here.

    Yields
    ------
    None, or a note that this process could not be pinned.
    """
    pinned_already = os.environ.get(_THREADS[0]) == "1"
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        from threadpoolctl import threadpool_limits  # noqa: PLC0415 - of the bench extra
    except ImportError:
        note = "BLAS threads are not pinned: pip install kinespace[bench], or set OPENBLAS_NUM_THREADS=1"
        yield None if pinned_already else note
    else:
        with threadpool_limits(1):
            yield None
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


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


def in_turns(
    jobs: Mapping[str, Callable[[], float]], rounds: int, *, what: str | None = None
) -> dict[str, NDArray[np.float64]]:
    """Run jobs one after the other, in rounds, so that a disturbance of the machine meets all jobs alike.

    Parameters
    ----------
    jobs
        Each job returns its cost, in a unit of its own. The first turn of each job warms up and does not count.
    rounds
        Turns that count.
    The title of the progress bar; no bar when not given.
        The title of the progress bar; no bar when not given.

    Returns
    -------
    By job, the cost of each round, shape (rounds,); take ratios round by round.

    Raises
    ------
    ValueError
        There are no rounds.
    """
    if rounds < 1:
        raise ValueError(f"rounds: expected at least 1, got {rounds}")
    turns = range(rounds + 1)
    costs = [
        {name: job() for name, job in jobs.items()} for _ in (progress(turns, what, len(turns)) if what else turns)
    ]
    return {name: np.array([cost[name] for cost in costs[1:]]) for name in jobs}


def exponent(sizes: Sequence[float], costs: Sequence[float]) -> float:
    """Fit cost = a · size^b by least squares of the logarithms; give b.

    Parameters
    ----------
    sizes, costs
        At least two, positive, sizes not all the same.

    Raises
    ------
    There are fewer than two, or one is not positive.
        Fewer than two, or one is not positive.
    """
    if len(sizes) < 2 or len(sizes) != len(costs) or min(*sizes, *costs) <= 0:
        raise ValueError(f"sizes, costs: expected two positive numbers of each at least, got {sizes}, {costs}")
    return float(np.polynomial.Polynomial.fit(np.log(sizes), np.log(costs), 1).convert().coef[1])
