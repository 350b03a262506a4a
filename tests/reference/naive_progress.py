"""How far in a motion, the slow way: time warping by its recursion, the forward filter a moment at a time."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


def warped_phase(first: NDArray[np.float64], second: NDArray[np.float64]) -> list[float]:
    """Warp one recording onto another: the mean relative time of the frames that each of its frames is matched with."""

    def cost(i: int, j: int) -> float:
        return float(np.linalg.norm(first[i] - second[j]))

    @cache
    def cheapest(i: int, j: int) -> tuple[float, tuple[tuple[int, int], ...]]:
        if i == j == 0:
            return cost(0, 0), ((0, 0),)
        ways = []
        if i and j:
            total, path = cheapest(i - 1, j - 1)
            ways.append((total + 1.4 * cost(i, j), path))
        if i:
            total, path = cheapest(i - 1, j)
            ways.append((total + cost(i, j), path))
        if j:
            total, path = cheapest(i, j - 1)
            ways.append((total + cost(i, j), path))
        total, path = min(ways, key=lambda way: way[0])
        return total, (*path, (i, j))

    _, path = cheapest(len(first) - 1, len(second) - 1)
    last = max(len(second) - 1, 1)
    return [float(np.mean([j / last for i, j in path if i == frame])) for frame in range(len(first))]


def gone_on(
    belief: Sequence[float], phases: Sequence[float], starts: Sequence[int], beginning: Sequence[float], *, cyclic: bool
) -> list[float]:
    """Move the probability of every moment on by one step."""
    count = len(belief)
    ends = [*(start - 1 for start in starts[1:]), count - 1]
    after = [0.0] * count
    first = [index for index in range(count) if phases[index] < 1 / 40]
    for index, probability in enumerate(belief):
        end = next(end for end in ends if end >= index)
        for moved, share in enumerate((0.55, 0.36, 0.09)):
            if index + moved <= end:
                after[index + moved] += share * probability
            elif cyclic and first:
                after[end] += 0.5 * share * probability
                for other in first:
                    after[other] += 0.5 * share * probability / len(first)
            else:
                after[end] += share * probability
    bins = [min(int(phase * 40), 39) for phase in phases]
    changed = []
    for index in range(count):
        alike = [other for other in range(count) if bins[other] == bins[index]]
        mean = sum(after[other] for other in alike) / len(alike)
        changed.append((1 - 0.01 - 1e-5) * after[index] + 0.01 * mean + 1e-5 * beginning[index])
    return changed


def weighed(
    belief: Sequence[float], vectors: NDArray[np.float64], live: NDArray[np.float64], sharpness: float
) -> list[float]:
    """Weigh every moment by how alike the live body is, and let the probabilities sum to one."""
    logs = [-0.5 * sharpness / len(live) * float(((vector - live) ** 2).sum()) for vector in vectors]
    most = max(logs)
    products = [each * math.exp(log - most) for each, log in zip(belief, logs, strict=True)]
    return [each / math.fsum(products) for each in products]


def median_phase(belief: Sequence[float], phases: Sequence[float]) -> float:
    """Give the least phase up to which half the probability lies."""
    total = 0.0
    for phase, probability in sorted(zip(phases, belief, strict=True)):
        total += probability
        if total >= 0.5:
            return phase
    return max(phases)
