"""The evidence that a motion was done, by definition: one window, one motion, one number at a time."""

from __future__ import annotations

import math

import numpy as np

#: The definition's constants: cosines, added to squared distances, and the weights in this order.
ORDERS, COURSE, SPREAD, NOISE, SLOWEST = range(1, 8), 0.02, 0.5, 1 / 60, 1.6


def course_of(points: np.ndarray) -> np.ndarray:
    """Give the cosine coefficients of each direction, together of length 1."""
    count = len(points)
    numbers = [
        sum(math.sqrt(2) * math.cos(math.pi * order * (k + 0.5) / count) * points[k] for k in range(count)) / count
        for order in ORDERS
    ]
    course = np.concatenate(numbers)
    return course / np.linalg.norm(course)


def spread_of(points: np.ndarray) -> np.ndarray:
    """Give the logarithm of each direction's standard deviation, less half of their mean."""
    logs = np.array([math.log(float(np.std(direction)) + NOISE) for direction in points.T])
    return logs - 0.5 * logs.mean()


def size_of(points: np.ndarray) -> float:
    """Give the logarithm of the swing."""
    return 0.5 * math.log(sum(float(np.var(direction)) for direction in points.T) + 1e-6)


def fits(window: int, motion: float) -> bool:
    """Say whether a window of so many points and a motion, logarithm of seconds, are about as long."""
    return abs(math.log((window - 1) / 15) - motion) < math.log(SLOWEST)
