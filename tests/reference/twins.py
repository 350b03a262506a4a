"""A library's windows for the slow twins: learned numbers are taken over, and the comparison is computed again."""

import math
from collections.abc import Iterable, Mapping

import numpy as np
from naive_windows import Matrix, as_vectors, body_of, log_distances, nearest, numbers_of, placed, ratio

from kinespace.library import WindowIndex
from kinespace.library.signature.parts import Part
from kinespace.library.windows.comparison import Metric


def _known(metric: Metric | None) -> tuple[Matrix, Matrix] | None:
    return metric and (metric.origin.astype(np.float64), metric.axes.astype(np.float64))


def _named(parts: Iterable[Part]) -> list[tuple[str, float]]:
    return [(str(part.kind), part.seconds) for part in parts]


class Twin:
    """An opened library, and the twin's answer to a live window.

    Attributes
    ----------
    windows
        Of each group the vectors of all windows; scaled eigenvectors become their matrix.
    labels
        Class and person of each window.
    """

    def __init__(self, index: WindowIndex) -> None:
        self.index, self.body, comparison = index, body_of(index.library.skeleton), index.comparison
        self.groups, self.joint = [*map(_named, comparison.weighing.groups)], [*map(_known, comparison.groups)]
        self.metrics = dict(zip(_named(comparison.parts), map(_known, comparison.parts.values()), strict=True))
        vectors = [each.astype(np.float64) for each in index.vectors]
        self.windows = [np.array([one.T @ one for one in each]) if each.ndim == 3 else each for each in vectors]
        motions = [index.library.motions[place] for place in index.motions]
        self.labels = [each.class_name for each in motions], [each.actor for each in motions]

    def numbers(self, ends: float, times: Matrix, rows: Matrix) -> dict[tuple[str, float], Matrix]:
        """Read all parts off the rows up to a time."""
        parts = _named(self.index.comparison.weighing.parts)
        return numbers_of(parts, ends, times, rows, self.index.basis.directions, self.body)

    def unlikelihoods(self, numbers: Mapping[tuple[str, float], Matrix]) -> Matrix:
        """Give for each class its least negative ratio, the mean over the groups and in fives: (1, classes)."""
        asked, best = placed(numbers, self.groups, self.metrics, self.joint), dict[str, float]()
        for window, name in enumerate(self.labels[0]):
            ratios = [ratio(one, others[window]) for one, others in zip(asked, self.windows, strict=True)]
            best[name] = max(sum(ratios) / len(ratios), best.get(name, -math.inf))
        return np.array([[-best[name] / 5 for name in sorted(best)]])

    def named(self, numbers: Mapping[tuple[str, float], Matrix], logs: Matrix) -> Matrix:
        """Give each class's log distance for naming: the least of the blends, and what a taught head adds."""
        logs = logs[: len(self.index.comparison.weighing.blends)]
        head = self.index.head
        if head is None:
            return logs.min(axis=0)
        vectors = [*as_vectors(numbers, self.metrics).values()]
        places = [head.classes.index(name) for name in sorted(set(self.labels[0]))]
        likely = (np.concatenate(vectors) @ head.factors + head.offsets)[places]
        return logs.min(axis=0) + 0.06 * (np.logaddexp.reduce(likely) - likely)

    def log_distances(self, numbers: Mapping[tuple[str, float], Matrix]) -> Matrix:
        """Compare with every window, one at a time: (weights, classes)."""
        asked = placed(numbers, self.groups, self.metrics, self.joint)
        by_weights = log_distances(asked, self.windows, self.index.comparison.weighing.weights)
        return np.array([list(nearest(logs, *self.labels).values()) for logs in by_weights])
