"""How far in a motion, the slow way: time warping by its recursion, the forward filter a moment at a time."""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
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
            else:
                again = (0.5 if cyclic else 0.02) * share * probability
                after[end] += share * probability - again
                for other in first:
                    after[other] += again / len(first)
    bins = [min(int(phase * 40), 39) for phase in phases]
    changes, begins = 0.1, 1e-6
    changed = []
    for index in range(count):
        alike = [other for other in range(count) if bins[other] == bins[index]]
        mean = sum(after[other] for other in alike) / len(alike)
        changed.append((1 - changes - begins) * after[index] + changes * mean + begins * beginning[index])
    return changed


def beginning_of(phases: Sequence[float]) -> list[float]:
    """Give how probable each moment is before the body is seen."""
    first = sum(phase < 0.12 for phase in phases)
    later = sum((1 - phase) ** 4 for phase in phases if phase >= 0.12)
    return [0.9 / first if phase < 0.12 else 0.1 * (1 - phase) ** 4 / later for phase in phases]


def weighed(
    belief: Sequence[float], vectors: NDArray[np.float64], live: NDArray[np.float64], sharpness: float
) -> list[float]:
    """Weigh every moment by how alike the live body is, and let the probabilities sum to one."""
    logs = [-0.5 * sharpness * float(((vector - live) ** 2).sum()) for vector in vectors]
    most = max(logs)
    products = [each * math.exp(log - most) for each, log in zip(belief, logs, strict=True)]
    return [each / math.fsum(products) for each in products]


def below(belief: Sequence[float], phases: Sequence[float], phase: float) -> float:
    """Give how probable the phases below one are."""
    return math.fsum(each for each, other in zip(belief, phases, strict=True) if other < phase)


class Pace:
    """How fast and how large a body moves, by sums over all that was seen, each step counting less than the next."""

    def __init__(self, mean_speed: float) -> None:
        self._floor = 0.1 * mean_speed
        self._seen: list[tuple[float, float, float, float]] = []
        self.speed = 1.0

    def push(
        self,
        past: Sequence[NDArray[np.float64]],
        velocity: NDArray[np.float64],
        expected: tuple[float, float],
        usual_swing: float,
    ) -> None:
        """Take in a step: all points so far, the newest velocity, the squared speeds and the log swing expected."""
        span = max(2, round(30 / min(max(self.speed, 0.5), 1.5)))
        last = np.array(past[-span:])
        swing = 0.5 * math.log(sum(float(np.mean((each - each.mean()) ** 2)) for each in last.T) + 1e-6)
        self._seen.append((float(np.sum(velocity**2)), *expected, swing - usual_swing))
        live, one, other = (self._faded(which, 0.15) / self._faded(None, 0.15) + self._floor for which in range(3))
        self.speed = math.sqrt(live / math.sqrt(one * other))
        self.amplitude = math.exp(self._faded(3, 0.4) / self._faded(None, 0.4))

    def _faded(self, which: int | None, seconds: float) -> float:
        return math.fsum(
            math.exp(-age / 30 / seconds) * (1.0 if which is None else each[which])
            for age, each in enumerate(reversed(self._seen))
        )
