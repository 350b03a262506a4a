"""Phases on which recordings of one class agree, by time warping between actors.

A recording's own relative time is a poor phase: some recordings stand still before the motion, some after it. Every
recording is warped onto others of its class (dynamic time warping, Sakoe and Chiba 1978), each of them gives it a
phase, and the median of these is the phase on which they agree.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

#: Cost of a step along both recordings, relative to a step along one: a diagonal path is as long as the detour.
_DIAGONAL = 1.4
#: Recordings of each other actor onto which a recording is warped, at most; of its own actor if there is no other.
_PER_ACTOR, _OF_ONE = 2, 6
#: Pairs of recordings that are warped together.
_TOGETHER = 256


def agreed_phases(features: Sequence[NDArray[np.float64]], actors: Sequence[str]) -> list[NDArray[np.float64]]:
    """Find the phase of every frame of the recordings of one class.

    Parameters
    ----------
    features
        The numbers of each recording's frames that are compared, each (frames, numbers), two frames at least.
    actors
        The actor of each recording.

    Returns
    -------
    For each recording the phase of its frames, (frames,), 0 to 1, never falling; relative time if the class has no
    other recording.
    """
    pairs = [(index, other) for index in range(len(features)) for other in _partners(index, actors)]
    found: list[list[NDArray[np.float64]]] = [[] for _ in features]
    # Recordings of similar length are warped together, because all are filled up to the longest.
    pairs.sort(key=lambda pair: (len(features[pair[0]]) + len(features[pair[1]]), pair))
    for start in range(0, len(pairs), _TOGETHER):
        some = pairs[start : start + _TOGETHER]
        warped = warped_phases([(features[one], features[other]) for one, other in some])
        for (one, _), phases in zip(some, warped, strict=True):
            found[one].append(phases)
    return [
        np.maximum.accumulate(np.median(phases, axis=0)) if phases else np.linspace(0.0, 1.0, len(own))
        for phases, own in zip(found, features, strict=True)
    ]


def _partners(index: int, actors: Sequence[str]) -> list[int]:
    """Choose the recordings onto which one is warped, spread over each other actor's recordings."""
    others: dict[str, list[int]] = {}
    for other, actor in enumerate(actors):
        if actor != actors[index]:
            others.setdefault(actor, []).append(other)
    if not others:
        own = [other for other in range(len(actors)) if other != index]
        return _spread(own, index, _OF_ONE)
    return [other for group in others.values() for other in _spread(group, index, _PER_ACTOR)]


def _spread(group: list[int], index: int, count: int) -> list[int]:
    """Take some of a group, evenly spread, beginning at a place that depends on the asking recording."""
    step = max(len(group) // count, 1)
    return [group[(index + each * step) % len(group)] for each in range(min(count, len(group)))]


def warped_phases(pairs: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> list[NDArray[np.float64]]:
    """Warp the first of each pair onto the second, with both ends pinned.

    Parameters
    ----------
    pairs
        The numbers of two recordings, (frames, numbers) and (other frames, numbers).

    Returns
    -------
    For each pair the mean relative time of the frames of the second recording with which each frame of the first is
    matched, shape (frames,).
    """
    rows, columns = max(len(a) for a, _ in pairs), max(len(b) for _, b in pairs)
    costs = np.zeros((len(pairs), rows, columns))
    for cost, (a, b) in zip(costs, pairs, strict=True):
        squares = (a**2).sum(1)[:, None] + (b**2).sum(1) - 2 * a @ b.T
        cost[: len(a), : len(b)] = np.sqrt(np.maximum(squares, 0.0))
    steps = _best_steps(costs)
    return _followed_back(steps, [(len(a), len(b)) for a, b in pairs])


def _best_steps(costs: NDArray[np.float64]) -> NDArray[np.int8]:
    """Say from where the cheapest path reaches each cell: 0 from both before, 1 from above, 2 from the left."""
    count, rows, columns = costs.shape
    total = np.full((count, rows + 1, columns + 1), np.inf)
    total[:, 0, 0] = 0.0
    steps = np.zeros(costs.shape, dtype=np.int8)
    for diagonal in range(rows + columns - 1):
        i = np.arange(max(0, diagonal - columns + 1), min(rows, diagonal + 1))
        j = diagonal - i
        here = costs[:, i, j]
        ways = np.stack([total[:, i, j] + (_DIAGONAL - 1) * here, total[:, i, j + 1], total[:, i + 1, j]])
        best = ways.argmin(axis=0)
        steps[:, i, j] = best
        total[:, i + 1, j + 1] = np.take_along_axis(ways, best[None], axis=0)[0] + here
    return steps


def _followed_back(steps: NDArray[np.int8], sizes: Sequence[tuple[int, int]]) -> list[NDArray[np.float64]]:
    """Follow every pair's path from its end, and average the columns that each row is matched with."""
    place = np.array(sizes) - 1
    last = np.maximum(place[:, 1], 1)
    sums, counts = np.zeros(steps.shape[:2]), np.zeros(steps.shape[:2])
    while (there := (place >= 0).all(axis=1)).any():
        which, (i, j) = np.flatnonzero(there), place[there].T
        sums[which, i] += j / last[which]
        counts[which, i] += 1
        step = steps[which, i, j]
        done = (i == 0) & (j == 0)
        place[which, 0] = np.where(done, -1, i - (step != 2))
        place[which, 1] = np.where(done, -1, j - (step != 1))
    return [sums[each, :rows] / counts[each, :rows] for each, (rows, _) in enumerate(sizes)]
