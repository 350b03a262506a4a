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


def gone_on(belief: list[list[float]], beginning: Sequence[float], *, cyclic: bool) -> list[list[float]]:
    """Move the probability of every moment of every recording on by one step."""
    count, recordings = len(beginning), len(belief)
    after = [[0.0] * count for _ in belief]
    for recording, probabilities in enumerate(belief):
        for moment, probability in enumerate(probabilities):
            for moved, share in enumerate((0.55, 0.36, 0.09)):
                if moment + moved < count:
                    after[recording][moment + moved] += share * probability
                else:
                    again = (0.5 if cyclic else 0.02) * share * probability
                    after[recording][count - 1] += share * probability - again
                    for other in after:
                        other[0] += again / recordings
    changes, begins = 0.1, 1e-6
    mean = [math.fsum(each) / recordings for each in zip(*after, strict=True)]
    return [
        [
            (1 - changes - begins) * own + changes * usual + begins * begun / recordings
            for own, usual, begun in zip(each, mean, beginning, strict=True)
        ]
        for each in after
    ]


def beginning_of(count: int) -> list[float]:
    """Give how probable each moment of any recording is before the body is seen."""
    phases = [moment / (count - 1) for moment in range(count)]
    first = sum(phase < 0.12 for phase in phases)
    later = sum((1 - phase) ** 4 for phase in phases if phase >= 0.12)
    return [0.9 / first if phase < 0.12 else 0.1 * (1 - phase) ** 4 / later for phase in phases]


def weighed(
    belief: list[list[float]], vectors: NDArray[np.floating], live: NDArray[np.float64], sharpness: float
) -> list[list[float]]:
    """Weigh every moment by how alike the live body is, and let the probabilities sum to one."""
    logs = [[-0.5 * sharpness * float(((vector - live) ** 2).sum()) for vector in each] for each in vectors]
    most = max(map(max, logs))
    products = [
        [each * math.exp(log - most) for each, log in zip(*pair, strict=True)]
        for pair in zip(belief, logs, strict=True)
    ]
    total = math.fsum(map(math.fsum, products))
    return [[each / total for each in own] for own in products]


def median(belief: list[list[float]]) -> float:
    """Give the phase below which half the probability lies; of a moment's a share that is its phase lies behind it."""
    count, below, before = len(belief[0]), 0.0, (0.0, 0.0)
    for moment in range(count):
        own = math.fsum(each[moment] for each in belief)
        phase = moment / (count - 1)
        middle = below + own * (1 - phase)
        if middle >= 0.5:
            start, least = before if moment else (phase, middle)
            return phase if middle == least else start + (phase - start) * (0.5 - least) / (middle - least)
        below, before = below + own, (phase, middle)
    return 1.0


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
