"""The slow twin of a library opened for recognition: brute force over all windows and people; see `naive_windows`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from naive import distance_rows
from naive_windows import KEPT, NEAREST, NaiveBody, leading, nearest, over

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kinespace.library.clip import Clip
    from kinespace.library.skeleton import Skeleton

    Matrix = np.ndarray


def body_of(skeleton: Skeleton) -> NaiveBody:
    """Give the twin of a skeleton's body."""
    return NaiveBody([(int(a), int(b)) for a, b in skeleton.pairs], skeleton.parents)


def window(clip: Clip, end: int, seconds: float) -> tuple[Matrix, Matrix]:
    """Give the times and distances of the window that ends before a frame, cut off where the clip starts."""
    frames = [frame for frame in range(end) if (end - 1 - frame) / clip.frame_rate < seconds - 1e-6]
    pairs = [(int(a), int(b)) for a, b in clip.skeleton.pairs]
    return clip.times[frames], distance_rows(clip.positions[frames], pairs)


def rank_k_product(first: Matrix, second: Matrix) -> float:
    """Multiply the matrices Σ√λ u uᵀ of two covariances, both divided by their length."""
    matrices = []
    for covariance in (first, second):
        values, vectors = leading(covariance, KEPT)
        matrix = sum(math.sqrt(max(a, 0.0)) * np.outer(u, u) for a, u in zip(values, vectors, strict=True))
        matrices.append(over(matrix, math.sqrt(float(np.sum(matrix**2)))))
    return float(np.sum(matrices[0] * matrices[1]))


def squared_distance(first: Matrix, second: Matrix) -> float:
    """Take |a − b|² of two vectors; of scaled eigenvectors (k, directions) that of their matrices.

    The first matrix is of length 1, the second but for its rounding; a matrix without movement counts as if it were.
    """
    if first.ndim == 1:
        return float(np.sum((first - second) ** 2))
    one, other = first.T @ first, second.T @ second
    return 1.0 + (float(np.sum(other**2)) or 1.0) - 2.0 * float(np.sum(one * other))


def log_distances(
    asked: Sequence[Matrix],
    windows: Sequence[Sequence[Matrix]],
    views: Sequence[Sequence[float]],
    whose: Sequence[tuple[str, str]],
) -> Matrix:
    """Compare one window's group vectors with every window's: (views, classes), mean of the two nearest people."""
    classes, people = zip(*whose, strict=True)
    logs = [
        [math.log(max(squared_distance(a, b), 0.0) + NEAREST) for a, b in zip(asked, each, strict=True)]
        for each in windows
    ]
    weighed = [[sum(w * log for w, log in zip(view, each, strict=True)) for each in logs] for view in views]
    return np.array([list(nearest(each, classes, people).values()) for each in weighed])


def best_products(asked: Matrix, eigenvectors: Matrix, classes: Sequence[str]) -> Mapping[str, float]:
    """Give each class's largest |inner product| with a vector."""
    best: dict[str, float] = {}
    for vector, class_name in zip(eigenvectors.tolist(), classes, strict=True):
        product = abs(sum(a * b for a, b in zip(vector, asked.tolist(), strict=True)))
        best[class_name] = max(product, best.get(class_name, 0.0))
    return dict(sorted(best.items()))


def logit(  # noqa: PLR0913 - all that a judgement knows
    weights: Sequence[float],
    compared: Sequence[float],
    typical: Sequence[float],
    noise: float,
    *,
    offset: float,
    bias: float = 0.0,
    slope: float = 0.0,
) -> float:
    """Weigh evidence: distances and leads relative to typical ones, noise, and the mean lead by the guess's slope."""
    relative = [number - usual for number, usual in zip(compared, typical, strict=True)]
    leads = relative[len(relative) // 2 :]
    numbers = [*relative, math.log(1 + noise / 0.01)]
    weighed = sum(weight * number for weight, number in zip(weights, numbers, strict=True))
    return weighed + offset + bias + slope * sum(leads) / len(leads)


def evidence(groups: Matrix, guess: int) -> tuple[list[float], list[float]]:
    """Give distance and lead of a guess by each group, from log distances (groups, classes)."""
    leads = [min((row[c] for c in range(len(row)) if c != guess), default=math.inf) - row[guess] for row in groups]
    return [float(row[guess]) for row in groups], [min(max(float(lead), -2.0), 2.0) for lead in leads]
