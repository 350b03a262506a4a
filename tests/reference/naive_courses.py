"""Courses and plausibility by definition: one step, one joint, one pair of directions at a time."""

import math
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from operator import itemgetter
from statistics import fmean, median, pstdev

import numpy as np
from numpy.typing import NDArray

#: The definition's constants: points, the blur, the least product, how much longer one way may be, and alike tilts.
POINTS, BLUR, LEAST, LONGER, ALIKE = 12, 0.8, 0.01, 1 / 0.6, 0.9


def mean_of_last(rows: list[np.ndarray], place: int, count: int) -> np.ndarray:
    """Average a row with those before it; before the first the body stood as in it."""
    return sum((rows[max(each, 0)] for each in range(place - count + 1, place + 1)), np.zeros_like(rows[0])) / count


def own_points_of(body: np.ndarray, corners: tuple[int, int, int, int]) -> np.ndarray:
    """Give how far each joint lies to the left of, above and in front of the hips, and these axes, by steps."""
    one, other, left_hip, right_hip = corners
    lefts = [frame[one] - frame[other] + frame[left_hip] - frame[right_hip] for frame in body]
    ups = [frame[one] + frame[other] - frame[left_hip] - frame[right_hip] for frame in body]
    size = sum(math.sqrt(up @ up) / 2 for up in ups) / len(ups)
    points, axes = [], []
    for place, frame in enumerate(body):
        up = mean_of_last(ups, place, 15)
        up = up / math.sqrt(up @ up)
        left = mean_of_last(lefts, place, 15)
        left = left - (left @ up) * up
        left = left / math.sqrt(left @ left)
        front, middle = np.cross(left, up), (frame[left_hip] + frame[right_hip]) / 2
        points.append(np.concatenate([[(joint - middle) @ axis for axis in (left, up, front)] for joint in frame]))
        axes.append([0.001 * size * axis[place] for place in range(3) for axis in (left, up, front)])
    return np.array([[*mean_of_last(points, place, 5), *each] for place, each in enumerate(axes)])


def at_equal_way_of(path: np.ndarray) -> np.ndarray:
    """Walk along a path, and stop at so many points."""
    walked = np.array([way_of(path[:count]) for count in range(1, len(path) + 1)])
    stops = np.linspace(0.0, walked[-1], POINTS)
    return np.array([np.interp(stops, walked, coordinate) for coordinate in path.T]).T


def course_of(points: np.ndarray, whitening: np.ndarray | None = None) -> np.ndarray:
    """Give the unit directions, weighed by a matrix, each averaged with its neighbours, together of length 1."""
    directions = []
    for before, after in pairwise(points[:, :-9]):
        step = after - before
        direction = step / max(float(np.linalg.norm(step)), 1e-9)
        directions.append(direction if whitening is None else direction @ whitening)
    blurred = [
        sum(math.exp(-0.5 * ((place - other) / BLUR) ** 2) * each for other, each in enumerate(directions))
        for place in range(len(directions))
    ]
    course = np.concatenate(blurred)
    return course / np.linalg.norm(course)


def cost_of(one: np.ndarray, other: np.ndarray) -> float:
    """Give the cost of one piece at equal way by another."""
    product, joints = float(course_of(one) @ course_of(other)), (one[:, :-9], other[:, :-9])
    ways = [sum(abs(after - before) for before, after in pairwise(each)) for each in joints]
    widths = [each.max(axis=0) - each.min(axis=0) for each in joints]
    shared = [max(float(a @ b / np.linalg.norm(a) / np.linalg.norm(b)), LEAST) for a, b in (ways, widths)]
    return (1 - product) / (shared[0] * shared[1] * alike_of(tilt_of(one) @ tilt_of(other)))


def tilt_of(points: np.ndarray) -> np.ndarray:
    """Give where the trunk pointed at first, as the body sees it at each point, together of length 1."""
    frames = [point[-9:].reshape(3, 3) for point in points]
    seen = [frames[0][:, 1] @ (frame / np.linalg.norm(frame, axis=0)) for frame in frames]
    return np.concatenate([each / np.linalg.norm(each) for each in seen]) / math.sqrt(len(seen))


def alike_of(product: float) -> float:
    """Say how alike two tilts are."""
    return max(min(product / ALIKE, 1.0), LEAST) ** 3


def way_of(points: np.ndarray) -> float:
    """Give how far a path goes."""
    return sum(float(np.linalg.norm(after - before)) for before, after in pairwise(points))


def scatter_of(courses: Sequence[tuple[str, str, np.ndarray]]) -> np.ndarray:
    """Say how people differ in one motion, by the class, the person and the directions of each, mean diagonal 1."""
    scatter = np.zeros((courses[0][2].shape[1],) * 2)
    for one, person in sorted({(name, actor) for name, actor, _ in courses}):
        theirs = [each for name, actor, each in courses if (name, actor) == (one, person)]
        people = {actor for name, actor, _ in courses if name == one}
        differ = []
        for name, actor, each in courses:
            if name == one and actor != person:
                nearest = max(theirs, key=lambda their, each=each: float((their * each).sum()))
                differ += [*(each - nearest)]
        scatter += sum(np.outer(row, row) for row in differ) / len(differ) / len(people)
    return scatter * len(scatter) / np.trace(scatter)


# --- plausibility: lengths, steps and frozen joints, one joint and one frame at a time --------------------------------


Place = Sequence[float]
Posture = Sequence[Place]


def segment_lengths(posture: Posture, parents: Sequence[int]) -> list[float]:
    """Measure each joint's distance from its parent, in the order of the joints that have one."""
    return [math.dist(posture[joint], posture[parent]) for joint, parent in enumerate(parents) if parent >= 0]


def steps_between(before: Posture, after: Posture) -> list[list[float]]:
    """Give each joint's step on each axis, metres."""
    return [[b - a for a, b in zip(*pair, strict=True)] for pair in zip(before, after, strict=True)]


def squares_about_mean(steps: Posture) -> float:
    """Add up the squares of the steps about their mean, m²."""
    mean = [fmean(step[axis] for step in steps) for axis in range(3)]
    return sum(math.dist(step, mean) ** 2 for step in steps)


def build_and_stretch(postures: Sequence[Posture], parents: Sequence[int]) -> tuple[list[float], float]:
    """Average the logarithm of each segment's length over postures; and the segments' standard deviations."""
    logs = [[math.log(max(each, 0.01)) for each in segment_lengths(posture, parents)] for posture in postures]
    of_segments = list(zip(*logs, strict=True))
    return [*map(fmean, of_segments)], fmean(map(pstdev, of_segments))


def unlike(build: Sequence[float], other: Sequence[float]) -> float:
    """Compare two builds, segments weighed by the other's lengths cubed, after the sizes are made equal."""
    weights = [math.exp(each) ** 3 for each in other]
    by = [one - log for one, log in zip(build, other, strict=True)]
    mean = fmean(by, weights)
    return math.sqrt(fmean([(each - mean) ** 2 for each in by], weights))


def step_length(before: Posture, after: Posture, jumping: int) -> float:
    """Give how far the so-many-th farthest joint steps, the body's own step, the middle one on each axis, apart."""
    steps = steps_between(before, after)
    own = [median(step[axis] for step in steps) for axis in range(3)]
    return sorted((math.dist(step, own) for step in steps), reverse=True)[jumping - 1]


def keeps_its_place(places: Sequence[Place], within: float) -> bool:
    """Say whether a joint stays within some metres on each axis."""
    return all(max(p[axis] for p in places) - min(p[axis] for p in places) < within for axis in range(3))


# --- progress: time warping by its recursion, the forward filter a moment at a time -----------------------------------


def warped_phase(first: NDArray[np.float64], second: NDArray[np.float64]) -> list[float]:
    """Warp one recording onto another: the mean relative time of the frames that each of its frames is matched with."""

    def cost(i: int, j: int) -> float:
        return float(np.linalg.norm(first[i] - second[j]))

    @cache
    def cheapest(i: int, j: int) -> tuple[float, tuple[tuple[int, int], ...]]:
        if i == j == 0:
            return cost(0, 0), ((0, 0),)
        ways = []
        for one, other, weight in ((1, 1, 1.4), (1, 0, 1.0), (0, 1, 1.0)):
            if i >= one and j >= other:
                total, path = cheapest(i - one, j - other)
                ways.append((total + weight * cost(i, j), (*path, (i, j))))
        return min(ways, key=itemgetter(0))

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
    logs = np.array([[-0.5 * sharpness * float(((vector - live) ** 2).sum()) for vector in each] for each in vectors])
    products = np.array(belief) * np.exp(logs - logs.max())
    return (products / products.sum()).tolist()


def median_of(belief: list[list[float]]) -> float:
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

    def push(self, past: Sequence[np.ndarray], moving: np.ndarray, expected: tuple[float, float], usual: float) -> None:
        """Take in a step: all points so far, the newest velocity, the squared speeds and the log swing expected."""
        span = max(2, round(30 / min(max(self.speed, 0.5), 1.5)))
        last = np.array(past[-span:])
        swing = 0.5 * math.log(sum(float(np.mean((each - each.mean()) ** 2)) for each in last.T) + 1e-6)
        self._seen.append((float(np.sum(moving**2)), *expected, swing - usual))
        live, one, other = (self._faded(which, 0.15) / self._faded(None, 0.15) + self._floor for which in range(3))
        self.speed = math.sqrt(live / math.sqrt(one * other))
        self.amplitude = math.exp(self._faded(3, 0.4) / self._faded(None, 0.4))

    def _faded(self, which: int | None, seconds: float) -> float:
        return math.fsum(
            math.exp(-age / 30 / seconds) * (1.0 if which is None else each[which])
            for age, each in enumerate(reversed(self._seen))
        )
