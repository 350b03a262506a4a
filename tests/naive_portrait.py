"""The slow twin of portraits and of positions found for distances; see `naive` for the rest.

Nothing here calls the product: axes come from a covariance, harmonics from sums of sines and cosines, frame by frame.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.linalg
from naive import covariance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Matrix = NDArray[np.float64]


class Swing(NamedTuple):
    """One axis times its amplitude, how often it swings in a cycle, and by which part of a turn it is ahead."""

    axis: list[float]
    harmonic: float
    phase: float


def swings(rows: Matrix, *, axes: int, harmonics: int) -> list[Swing]:
    """Find the leading principal axes of some rows, and along each the strongest of the first harmonics."""
    values, vectors = scipy.linalg.eigh(covariance(rows))
    order = sorted(range(len(values)), key=lambda index: -values[index])[:axes]
    length = max(len(rows), 2 * harmonics)
    found = []
    for index in order:
        along = [math.fsum(row * vectors[:, index]) for row in rows - rows.mean(axis=0)]
        strongest = (0.0, 0.0, 0)
        for harmonic in range(1, harmonics + 1):
            angles = [2 * math.pi * harmonic * frame / length for frame in range(len(rows))]
            even = math.fsum(far * math.cos(angle) for far, angle in zip(along, angles, strict=True))
            odd = math.fsum(far * math.sin(angle) for far, angle in zip(along, angles, strict=True))
            if math.hypot(even, odd) > strongest[0]:
                strongest = (math.hypot(even, odd), math.atan2(-odd, even) / (2 * math.pi), harmonic)
        # Over whole turns a sine of amplitude a has the variance a² / 2.
        amplitude = math.sqrt(2 * max(values[index], 0.0))
        found.append(Swing((amplitude * vectors[:, index]).tolist(), strongest[2], strongest[1]))
    return found


def swinging(mean: Sequence[float], moving: Sequence[Swing], cycles: Sequence[float]) -> Matrix:
    """Add up the swings around the mean row, distance by distance; none is below 0."""
    rows = np.empty((len(cycles), len(mean)))
    for frame, cycle in enumerate(cycles):
        for pair, middle in enumerate(mean):
            far = middle
            for swing in moving:
                far += swing.axis[pair] * math.cos(2 * math.pi * (swing.harmonic * cycle + swing.phase))
            rows[frame, pair] = max(far, 0.0)
    return rows


def distances_in_space(rows: Matrix, joints: int) -> Matrix:
    """Find what distances become in three dimensions: those of the three leading axes of the doubly centred squares."""
    pairs = [(a, b) for a in range(joints) for b in range(a + 1, joints)]
    found = np.empty_like(rows)
    for frame, row in enumerate(rows.tolist()):
        squares = np.zeros((joints, joints))
        for (a, b), far in zip(pairs, row, strict=True):
            squares[a, b] = squares[b, a] = far * far
        inner = np.empty((joints, joints))
        for a in range(joints):
            for b in range(joints):
                inner[a, b] = -(squares[a, b] - squares[a].mean() - squares[b].mean() + squares.mean()) / 2
        values, vectors = scipy.linalg.eigh(inner)
        places = [vectors[:, k] * math.sqrt(max(values[k], 0.0)) for k in range(joints - 3, joints)]
        found[frame] = [math.sqrt(math.fsum((place[a] - place[b]) ** 2 for place in places)) for a, b in pairs]
    return found
