"""A live window compared with all windows of a library, by kernels that are bound to their memory once."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from kinespace.library.kernels import bind
from kinespace.library.kernels.table import LANE
from kinespace.library.signature.parts import Kind, upper_triangle

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from kinespace.library.signature.parts import Part
    from kinespace.library.windows.comparison import Comparison, Group
    from kinespace.library.windows.head import Head
    from kinespace.library.windows.likelihood import Likelihood
    from kinespace.library.windows.metric import Metric

    Numbers = NDArray[np.float64]


class Laid(NamedTuple):
    """A library's windows in lanes of `LANE`, as the kernels read them; several comparers share them.

    Attributes
    ----------
    groups
        For each group its axes, its eigenvectors (0 for a vector), where its vector begins among all, and where its
        windows begin, shape (groups, 4).
    windows, lengths
        All vectors, lane by lane; and their squared lengths plus `nearest`, shape (groups, windows of all lanes).
    weights
        The weight of each group in each view, shape (views, groups).
    blocks, classes
        Where the windows of each person in each class start, and where each class's blocks start, with the ends.
    eigenvectors, starts
        The leading eigenvectors, shape (lanes, directions, LANE), and where each class's windows start, with the end.
    metrics
        Origin and axes of the metric of each part, and of each group of several parts.
    """

    groups: NDArray[np.intp]
    windows: NDArray[np.float16]
    lengths: NDArray[np.float32]
    weights: NDArray[np.float32]
    blocks: NDArray[np.intp]
    classes: NDArray[np.intp]
    eigenvectors: NDArray[np.float32]
    starts: NDArray[np.intp]
    metrics: Mapping[Part | Group, tuple[NDArray[np.float32], NDArray[np.float16]]]

    @classmethod
    def of(
        cls,
        comparison: Comparison,
        vectors: Sequence[NDArray[np.float16]],
        eigenvectors: NDArray[np.float32],
        whose: Sequence[tuple[str, str]],
    ) -> Self:
        """Lay windows out.

        Parameters
        ----------
        comparison
            How they are compared.
        vectors, eigenvectors
            As in `WindowIndex`.
        whose
            The class and the person of each window; the windows of a class lie together.
        """
        weighing = comparison.weighing
        groups, laid, begin, first = list[tuple[int, ...]](), [], 0, 0
        for each in vectors:
            groups.append((each.shape[-1], each.shape[1] if each.ndim == 3 else 0, begin, first))
            laid.append(_in_lanes(each.reshape(len(each), -1)).ravel())
            begin, first = begin + each[0].size, first + laid[-1].size
        lanes = _in_lanes(eigenvectors)
        lengths = np.zeros((len(vectors), len(lanes) * LANE), dtype=np.float32)
        for own, each in zip(lengths, vectors, strict=True):
            own[: len(each)] = _squares(each.astype(np.float32)) + np.float32(weighing.nearest)
        blocks, starts = _starts(whose), _starts([class_name for class_name, _ in whose])
        metrics: dict[Part | Group, Metric] = dict(comparison.parts.items())
        metrics |= {group: each for group, each in zip(weighing.groups, comparison.groups, strict=True) if each}
        return cls(
            groups=np.array(groups, dtype=np.intp),
            windows=np.concatenate(laid),
            lengths=lengths,
            weights=np.array(weighing.weights, dtype=np.float32),
            blocks=blocks,
            classes=np.searchsorted(blocks, starts),
            eigenvectors=lanes,
            starts=starts,
            metrics={of: _padded(metric) for of, metric in metrics.items()},
        )


def _in_lanes(rows: NDArray[np.floating]) -> NDArray[np.floating]:
    """Lay windows (windows, numbers) out as (lanes, numbers, LANE)."""
    lanes = -(-len(rows) // LANE)
    padded = np.zeros((lanes * LANE, rows.shape[1]), dtype=rows.dtype)
    padded[: len(rows)] = rows
    return np.ascontiguousarray(padded.reshape(lanes, LANE, -1).transpose(0, 2, 1))


def _starts(names: Sequence[object]) -> NDArray[np.intp]:
    """Say where each run of equal names starts, and where the last one ends."""
    begins = [place for place, name in enumerate(names) if not place or names[place - 1] != name]
    return np.array([*begins, len(names)], dtype=np.intp)


def _squares(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Give the squared lengths of windows' vectors, or of their matrices.

    Matrices have length 1 but for rounding; the matrix of a window without movement has length 0, which counts as 1, so
    that such a window is at the greatest distance from all others.
    """
    if vectors.ndim == 2:
        lengths: NDArray[np.float32] = np.square(vectors).sum(axis=1)
        return lengths
    squares = np.square(np.matmul(vectors, vectors.transpose(0, 2, 1))).sum(axis=(1, 2))
    counted: NDArray[np.float32] = np.where(squares > 0, squares, np.float32(1))
    return counted


def _padded(metric: Metric) -> tuple[NDArray[np.float32], NDArray[np.float16]]:
    """Give a metric's origin, and its axes with room up to a whole lane."""
    room = -metric.axes.shape[1] % LANE
    return np.ascontiguousarray(metric.origin), np.pad(metric.axes.astype(np.float16), ((0, 0), (0, room)))


class Comparer:
    """Compares the windows of one performer with a library's.

    Parameters
    ----------
    comparison, laid
        How windows are compared, and the library's windows.
    pairs, directions
        Numbers of a distance row, and directions of the basis.
    likelihood
        What judges the guess in place of the distances by each group; None for nothing.

    Attributes
    ----------
    numbers
        For each part the memory of its numbers, (numbers,) or (eigenvectors, directions): live windows write them.
    eigenvectors
        The memory of the leading eigenvectors of the longest window in the basis, (eigenvectors, directions).
    logs
        The result: for each of the weighing's `weights` and each class the log distance of the nearest window, as the
        mean over the two nearest persons, shape (weights, classes).
    named, judged
        The log distance of each class for naming (`Weighing.named`), shape (classes,); and the numbers by which a guess
        is judged: the log distances by each group alone, a view of `logs`, shape (groups, classes), or by `likelihood`,
        shape (1, classes).
    scores
        The result for the leading eigenvector alone: each class's best |inner product| (Le Naour et al. 2012, section
        3), 0 to 1, shape (classes,); where persons agree by products, the mean over the two nearest.
    """

    def __init__(  # noqa: PLR0913, PLR0917 - windows, and what judges and names by them
        self,
        comparison: Comparison,
        laid: Laid,
        pairs: int,
        directions: int,
        likelihood: Likelihood | None = None,
        head: Head | None = None,
    ) -> None:
        weighing, classes, room = comparison.weighing, len(laid.starts) - 1, laid.lengths.shape[1]
        found = min(weighing.eigenvectors, directions)
        self.eigenvectors = np.zeros((found, directions))
        self.logs, self.scores = np.zeros((len(laid.weights), classes)), np.zeros(classes)
        self.named, self.judged = np.zeros(classes), weighing.alone(self.logs)
        sizes = laid.groups[:, 0] * np.maximum(laid.groups[:, 1], 1)
        vectors = np.zeros(int(sizes.sum()))
        of_groups = dict(zip(weighing.groups, np.split(vectors, np.cumsum(sizes)[:-1]), strict=True))
        self.numbers = {
            part: np.zeros(pairs) if part.kind is not Kind.EIGEN else np.zeros((found, directions))
            for part in weighing.parts
        }
        self.numbers |= {
            group[0]: vector.reshape(found, directions)
            for group, vector in of_groups.items()
            if group[0] not in comparison.parts
        }
        # Where a group is a part alone, the part's vector is the group's.
        placed = {part: np.zeros(metric.axes.shape[1]) for part, metric in comparison.parts.items()}
        placed |= {group[0]: vector for group, vector in of_groups.items() if len(group) == 1}
        self._steps: list[Callable[[], object]] = [
            step for part in comparison.parts for step in self._placing(part, laid.metrics[part], placed[part])
        ]
        for group, metric in zip(weighing.groups, comparison.groups, strict=True):
            if metric is not None:
                joined = np.zeros(len(metric.origin))
                self._steps.append(partial(np.concatenate, [placed[part] for part in group], out=joined))
                self._steps.append(bind("place", joined, *laid.metrics[group], of_groups[group]))
        products = np.zeros((len(laid.weights), room), dtype=np.float32)
        how = weighing.nearest, weighing.by_products, len(weighing.views)
        self._steps.append(bind("compare", *laid[:6], vectors, products, self.logs, self.named, *how))
        if head:
            self._steps.append(head.bound(list(placed.values()), self.named))
        if likelihood:
            self.judged = np.zeros((1, classes))
            self._steps.append(likelihood.bound(vectors, self.judged[0]))
        leading = self.eigenvectors[0]
        if weighing.by_products:
            self._steps.append(lambda: np.copyto(self.named, weighing.named(self.logs)))
            self._steps.append(partial(np.negative, self.logs[0], out=self.scores))
        else:
            self._steps.append(bind("scores", laid.eigenvectors, products[0], laid.starts, leading, self.scores))

    def _placing(
        self, part: Part, metric: tuple[NDArray[np.float32], NDArray[np.float16]], vector: Numbers
    ) -> list[Callable[[], object]]:
        """Map a part's numbers by its metric to its vector."""
        numbers = self.numbers[part]
        if part.kind is not Kind.EIGEN:
            return [bind("place", numbers, *metric, vector)]
        # As `flattened`, without new memory.
        size = len(numbers.T)
        places, factors = upper_triangle(size)
        matrix, flat = np.zeros((size, size)), np.zeros(len(places))
        return [
            partial(np.dot, numbers.T, numbers, out=matrix),
            partial(matrix.reshape(-1).take, places, out=flat, mode="clip"),
            partial(np.multiply, flat, factors, out=flat),
            bind("place", flat, *metric, vector),
        ]

    def compare(self) -> None:
        """Compare the windows whose numbers and eigenvectors were written: gives `logs`, `named` and `scores`."""
        for step in self._steps:
            step()
