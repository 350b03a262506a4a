"""The slow twin of plausibility: lengths, steps and frozen joints, one joint and one frame at a time."""

import math
from collections.abc import Sequence

Place = Sequence[float]
Posture = Sequence[Place]


def length(one: Place, other: Place) -> float:
    """Say how far two places are apart, metres."""
    return math.sqrt(sum((a - b) ** 2 for a, b in zip(one, other, strict=True)))


def segment_lengths(posture: Posture, parents: Sequence[int]) -> list[float]:
    """Measure each joint's distance from its parent, in the order of the joints that have one."""
    return [length(posture[joint], posture[parent]) for joint, parent in enumerate(parents) if parent >= 0]


def steps_between(before: Posture, after: Posture) -> list[list[float]]:
    """Give each joint's step on each axis, metres."""
    return [[b - a for a, b in zip(*pair, strict=True)] for pair in zip(before, after, strict=True)]


def squares_about_mean(steps: Posture) -> float:
    """Add up the squares of the steps about their mean, m²."""
    mean = [sum(step[axis] for step in steps) / len(steps) for axis in range(3)]
    return sum(length(step, mean) ** 2 for step in steps)


def build_and_stretch(postures: Sequence[Posture], parents: Sequence[int]) -> tuple[list[float], float]:
    """Average the logarithm of each segment's length over postures; and the segments' standard deviations."""
    logs = [[math.log(max(each, 0.01)) for each in segment_lengths(posture, parents)] for posture in postures]
    of_segments = list(zip(*logs, strict=True))
    means = [sum(each) / len(each) for each in of_segments]
    squares = [sum((log - mean) ** 2 for log in each) for each, mean in zip(of_segments, means, strict=True)]
    return means, sum(math.sqrt(each / len(logs)) for each in squares) / len(squares)


def unlike(build: Sequence[float], other: Sequence[float]) -> float:
    """Compare two builds, segments weighed by the other's lengths cubed, after the sizes are made equal."""
    weights = [math.exp(each) ** 3 for each in other]
    by = [one - log for one, log in zip(build, other, strict=True)]
    mean = sum(w * each for w, each in zip(weights, by, strict=True)) / sum(weights)
    return math.sqrt(sum(w * (each - mean) ** 2 for w, each in zip(weights, by, strict=True)) / sum(weights))


def step_length(before: Posture, after: Posture, jumping: int) -> float:
    """Give how far the so-many-th farthest joint steps, the body's own step, the middle one on each axis, apart."""
    steps = steps_between(before, after)
    own = [_median([step[axis] for step in steps]) for axis in range(3)]
    return sorted((length(step, own) for step in steps), reverse=True)[jumping - 1]


def keeps_its_place(places: Sequence[Place], within: float) -> bool:
    """Say whether a joint stays within some metres on each axis."""
    return all(max(p[axis] for p in places) - min(p[axis] for p in places) < within for axis in range(3))


def _median(numbers: Sequence[float]) -> float:
    ordered, middle = sorted(numbers), len(numbers) // 2
    return ordered[middle] if len(numbers) % 2 else (ordered[middle - 1] + ordered[middle]) / 2
