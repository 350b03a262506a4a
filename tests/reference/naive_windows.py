"""The slow twin of windows: their moments, their parts, and the comparison of two windows; see also `naive`.

Nothing here calls the product. Everything is computed from all rows of a window, part by part, window by window.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Skeleton

Matrix = NDArray[np.float64]
Row = Sequence[float]
#: A kind, and seconds.
Part = tuple[str, float]

#: A marker's noise, relative to the body's size.
NOISE = 1 / 60
#: Eigenvectors that make the eigen part.
KEPT = 4
#: Squared distance below which two windows are as good as the same.
NEAREST = 0.01


# --- the body ----------------------------------------------------------------------------------------------------


def segments(parents: Sequence[int]) -> list[tuple[int, int]]:
    """List the pairs of a joint and its parent, the lower index first."""
    return [(min(pair), max(pair)) for pair in enumerate(parents) if pair[1] >= 0]


def path_between(first: int, second: int, parents: Sequence[int]) -> list[tuple[int, int]]:
    """Walk from one joint to another along segments."""
    walks = []
    for joint in (first, second):
        steps, at = list[tuple[int, int]](), joint
        while parents[at] >= 0:
            steps.append((min(at, parents[at]), max(at, parents[at])))
            at = parents[at]
        walks.append(steps)
    # The part of the way to the root that both share does not lie between them.
    return [step for walk in walks for step in walk if (step in walks[0]) != (step in walks[1])]


class NaiveBody:
    """Which pairs of joints are segments, and which segments lie between the joints of each pair."""

    def __init__(self, pairs: Sequence[tuple[int, int]], parents: Sequence[int]) -> None:
        places = {(int(a), int(b)): index for index, (a, b) in enumerate(pairs)}
        self.known = bool(parents)
        self.segments = [places[each] for each in segments(parents)] if parents else list(range(len(pairs)))
        self.paths = [[places[each] for each in path_between(a, b, parents)] for a, b in pairs] if parents else []

    def size(self, distances: Matrix) -> float:
        """Give the mean length of the segments, of all pairs where no segments are known."""
        return sum(distances[self.segments].tolist()) / len(self.segments)

    def lengths(self, distances: Matrix) -> Matrix:
        """Add up the segments between the joints of each pair; the body's size where no segments are known."""
        if not self.known:
            return np.full(len(distances), self.size(distances))
        return np.array([math.fsum(distances[path]) for path in self.paths])


# --- the parts of a window --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class NaiveMoments:
    """Of each distance the mean, the standard deviation, and the covariance with time over the times' deviation."""

    mean: Matrix
    deviation: Matrix
    trend: Matrix


def moments(times: Matrix, rows: Matrix) -> NaiveMoments:
    """Take the moments of a window's rows, all of which count alike."""
    mean, late = rows.mean(axis=0), times - times.mean()
    swing = math.sqrt(float(np.mean(late**2)))
    along = np.mean(late[:, None] * (rows - mean), axis=0)
    return NaiveMoments(mean, np.sqrt(np.mean((rows - mean) ** 2, axis=0)), along / swing if swing else 0.0 * mean)


def covariance(points: Matrix) -> Matrix:
    """Take the covariance of points, all of which count alike; 0 for a swing of less than a millionth of the mean."""
    matrix = np.cov(points, rowvar=False, bias=True)
    still = float(np.trace(matrix)) <= 1e-12 * float(np.sum(points.mean(axis=0) ** 2))
    return 0.0 * matrix if still else matrix


def leading(matrix: Matrix, kept: int = KEPT) -> tuple[Matrix, Matrix]:
    """Solve the whole eigenproblem and keep the largest: eigenvalues, and eigenvectors as rows."""
    values, vectors = np.linalg.eigh(matrix)
    return values[::-1][:kept], vectors.T[::-1][:kept]


def moved(of: NaiveMoments) -> float:
    """Give the root mean square deviation of a distance over the root mean square distance; 0 for no body at all."""
    length = math.sqrt(float(np.mean(of.mean**2)))
    return math.sqrt(float(np.mean(of.deviation**2))) / length if length else 0.0


def spread(of: NaiveMoments, body: NaiveBody) -> Matrix:
    """Take the logarithms of the deviations over the body's size, less half of their mean."""
    logs = np.log(over(of.deviation, body.size(of.mean)) + NOISE)
    return logs - np.mean(logs) / 2


def posture(of: NaiveMoments, body: NaiveBody) -> Matrix:
    """Divide each mean distance by the length of the segments between its joints."""
    return np.array([over(a, b) for a, b in zip(of.mean, body.lengths(of.mean), strict=True)])


def trend(of: NaiveMoments, body: NaiveBody) -> Matrix:
    """Take the correlation of each distance with time, small where it moves as little as noise does."""
    noise = NOISE * body.size(of.mean)
    return np.array([over(a, b + noise) for a, b in zip(of.trend, of.deviation, strict=True)])


def over(numbers: Matrix, by: float) -> Matrix:
    """Divide; division by zero gives zero."""
    return numbers / by if by > 0 else 0.0 * numbers


def eigen_matrix(values: Matrix, vectors: Matrix) -> Matrix:
    """Add up √λ u uᵀ, and divide by the length of the sum; zero where nothing moves."""
    values = np.maximum(values, 0.0)
    matrix = sum(math.sqrt(value) * np.outer(vector, vector) for value, vector in zip(values, vectors, strict=True))
    return over(matrix, math.sqrt(float(np.sum(matrix**2))))


def as_vector(matrix: Matrix) -> Matrix:
    """Write a symmetric matrix as a vector, so that products of vectors are products of matrices."""
    return np.array(
        [matrix[i, j] * (1.0 if i == j else math.sqrt(2.0)) for i in range(len(matrix)) for j in range(i, len(matrix))]
    )


# --- windows -----------------------------------------------------------------------------------------------------


def numbers_of(  # noqa: PLR0913, PLR0917 - a window, and the body it is of
    parts: Sequence[Part], ends: float, times: Matrix, rows: Matrix, directions: Matrix, body: NaiveBody
) -> dict[Part, Matrix]:
    """Read each part, a kind and seconds, off the rows of its last seconds; eigen parts as matrices."""
    numbers = {}
    for kind, seconds in parts:
        inside = [index for index, time in enumerate(times) if time <= ends < time + seconds - 1e-6]
        if kind == "eigen":
            values, vectors = leading(covariance(rows[inside] @ directions))
            numbers[kind, seconds] = eigen_matrix(values, vectors)
        else:
            of = moments(times[inside], rows[inside])
            numbers[kind, seconds] = {"spread": spread, "posture": posture, "trend": trend}[kind](of, body)
    return numbers


# --- comparing ---------------------------------------------------------------------------------------------------


#: An origin, and axes along which vectors are seen from it; none where numbers stay as they are.
Metric = tuple[Matrix, Matrix] | None
Numbers = Mapping[Part, Matrix]


def seen_by(metric: Metric, numbers: Matrix) -> Matrix:
    """Move to the origin and look along each axis."""
    return numbers if metric is None else (numbers - metric[0]) @ metric[1]


def as_vectors(numbers: Numbers, metrics: Mapping[Part, Metric]) -> dict[Part, Matrix]:
    """See each part by its metric, the matrices of eigen parts as vectors."""
    return {
        part: seen_by(metric, as_vector(numbers[part]) if part[0] == "eigen" else numbers[part])
        for part, metric in metrics.items()
    }


def placed(
    numbers: Numbers, groups: Sequence[Sequence[Part]], metrics: Mapping[Part, Metric], joint: Sequence[Metric]
) -> list[Matrix]:
    """Give the vector of each group, by its metric if it has several parts; an eigen part alone stays a matrix."""
    vectors = as_vectors(numbers, metrics)
    return [
        numbers[group[0]]
        if metric is None and group[0][0] == "eigen"
        else seen_by(metric, np.concatenate([vectors[part] for part in group]))
        for group, metric in zip(groups, joint, strict=True)
    ]


def log_distances(asked: Sequence[Matrix], windows: Sequence[Matrix], weights: Sequence[Sequence[float]]) -> Matrix:
    """Compare a window's groups with those of all windows: for each blend the weighted mean of log distances.

    Parameters
    ----------
    asked
        The vector of each group, or its matrix.
    windows
        Of each group all windows' vectors (windows, axes), or matrices (windows, directions, directions).
    weights
        For each blend the weight of each group.
    """
    squared = [
        _squared_between(one, others) if one.ndim == 2 else np.sum((others - one) ** 2, axis=1)
        for one, others in zip(asked, windows, strict=True)
    ]
    logs = np.log(np.maximum(squared, 0.0) + NEAREST)
    return np.array([sum(weight * log for weight, log in zip(blend, logs, strict=True)) for blend in weights])


def _squared_between(one: Matrix, others: Matrix) -> Matrix:
    """Give |A − B|² as |A|² + |B|² − 2 ⟨A, B⟩ for a matrix and many; a window that does not move counts as length 1."""
    lengths = np.sum(others**2, axis=(1, 2))
    return 1 + np.where(lengths > 0, lengths, 1.0) - 2 * np.sum(one * others, axis=(1, 2))


def nearest(distances: Sequence[float], classes: Sequence[str], people: Sequence[str]) -> dict[str, float]:
    """Give for each class the mean of its two nearest people's nearest windows, of one where only one performs it."""
    by_person: dict[str, dict[str, float]] = {}
    for distance, class_name, person in zip(distances, classes, people, strict=True):
        known = by_person.setdefault(class_name, {})
        known[person] = min(distance, known.get(person, math.inf))
    two = {class_name: sorted(known.values())[:2] for class_name, known in by_person.items()}
    return {class_name: sum(least) / len(least) for class_name, least in sorted(two.items())}


# --- labels ------------------------------------------------------------------------------------------------------


def frames_within(frames: int, frame_rate: float, start: float, end: float) -> list[int]:
    """Say which frames' middles lie within a stretch of time."""
    return [frame for frame in range(frames) if start <= (frame + 0.5) / frame_rate < end]


# --- a library's windows -----------------------------------------------------------------------------------------


def body_of(skeleton: Skeleton) -> NaiveBody:
    """Give the twin of a skeleton's body."""
    return NaiveBody([(int(a), int(b)) for a, b in skeleton.pairs], skeleton.parents)


def logit(  # noqa: PLR0913 - all that a judgement knows
    weights: Row, compared: Row, typical: Row, noise: float, *, offset: float, bias: float = 0.0, slope: float = 0.0
) -> float:
    """Weigh evidence: distances and leads relative to typical ones, noise, and the mean lead by the guess's slope."""
    relative = [number - usual for number, usual in zip(compared, typical, strict=True)]
    leads = relative[len(relative) // 2 :]
    numbers = [*relative, math.log(1 + noise / 0.01)]
    weighed = sum(weight * number for weight, number in zip(weights, numbers, strict=True))
    return weighed + offset + bias + slope * sum(leads) / len(leads)


def ratio(one: Sequence[float], other: Sequence[float]) -> float:
    """Say how much likelier two vectors are the same motion by two people than any two movements, as a logarithm.

    By the densities themselves. Along each axis two windows of any two movements vary by t each, and independently;
    two of the same motion share t − w of it.
    """
    total = 0.0
    for place, both in enumerate(zip(one, other, strict=True), start=1):
        pair = np.array(both)
        for sign, (inverse, log_volume) in zip((1, -1), _laws(place), strict=True):
            total -= sign * float(pair @ inverse @ pair + log_volume) / 2
    return total


@cache
def _laws(place: int) -> list[tuple[Matrix, float]]:
    """Give for an axis, counted from 1, the inverse and the log determinant of both covariances: same, and any two."""
    whole = 0.05 / math.sqrt(place)
    shared = whole - min(1 / 128, 0.8 * whole)
    same, apart = np.array([[whole, shared], [shared, whole]]), np.diag([whole, whole])
    return [(np.linalg.inv(each), math.log(np.linalg.det(each))) for each in (same, apart)]


def unlikely(one: Matrix, windows: Matrix, names: Sequence[str]) -> dict[str, float]:
    """Give for each class the negative log probability of a vector, by what known windows of the classes teach.

    By the densities themselves: the classes are equally likely, each spreads as all do in the mean, and a tenth of this
    spread is equal in all directions.
    """
    own = {name: windows[[each == name for each in names]] for name in sorted(set(names))}
    spreads = [np.mean([np.outer(each, each) for each in some - some.mean(axis=0)], axis=0) for some in own.values()]
    spread, axes = np.mean(spreads, axis=0), len(one)
    inverse = np.linalg.inv(0.9 * spread + 0.1 * np.trace(spread) / axes * np.eye(axes))
    logs = {name: -(one - some.mean(axis=0)) @ inverse @ (one - some.mean(axis=0)) / 2 for name, some in own.items()}
    most = max(logs.values())
    whole = most + math.log(sum(math.exp(log - most) for log in logs.values()))
    return {name: float(whole - log) for name, log in logs.items()}


def evidence(groups: Matrix, guess: int) -> tuple[list[float], list[float]]:
    """Give distance and lead of a guess by each group, from log distances (groups, classes)."""
    leads = [min((row[c] for c in range(len(row)) if c != guess), default=math.inf) - row[guess] for row in groups]
    return [float(row[guess]) for row in groups], [min(max(float(lead), -2.0), 2.0) for lead in leads]
