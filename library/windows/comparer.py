"""A window compared with all windows of a library: how far it is from each class."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from kinespace.library.compiled import compiled
from kinespace.library.signature.parts import Signature
from kinespace.library.windows.comparison import Comparison
from kinespace.library.windows.head import Head
from kinespace.library.windows.likelihood import Likelihood

Numbers = NDArray[np.float64]
Floats = NDArray[np.float32]
Indices = NDArray[np.intp]

#: Windows are compared so many at a time, so a library is filled up to a multiple of it,
LANE = 64
#: with windows at this squared distance.
_FAR = 1e30


class Distances(NamedTuple):
    """How far a window is from each class.

    Attributes
    ----------
    logs
        For each of the weighing's `weights` the log distance of the nearest window, as the mean over the two nearest
        persons, shape (weights, classes).
    named
        The log distance of each class for naming, shape (classes,).
    judged
        The numbers by which a guess is judged: the log distances by each group alone, shape (groups, classes), or by
        `Likelihood`, shape (1, classes).
    scores
        Each class's best |inner product| of leading eigenvectors (Le Naour et al. 2012, section 3), 0 to 1, shape
        (classes,).
    """

    logs: Numbers
    named: Numbers
    judged: Numbers
    scores: Numbers


class Comparer(NamedTuple):
    """A library's windows as they are compared.

    Attributes
    ----------
    comparison
        How they are compared.
    windows
        For each group the windows' vectors, axes first, shape (axes, windows), or (directions, eigenvectors × windows).
    lengths
        Their squared lengths plus `Weighing.nearest`, shape (groups, windows).
    weights
        The weight of each group in each view, shape (views, groups).
    starts
        Where the windows of each person in each class start, and where the last ones end, shape (starts + 1,).
    persons
        For each class the places of its persons among `starts`, filled up with the last, shape (classes, persons).
    eigenvectors, classes
        The leading eigenvectors, shape (directions, windows), and where each class's windows start, shape (classes,).
    likelihood
        What judges a guess in place of the distances by each group; None for nothing.
    head
        What helps to name; None for nothing.
    """

    comparison: Comparison
    windows: tuple[Floats, ...]
    lengths: Floats
    weights: Floats
    starts: Indices
    persons: Indices
    eigenvectors: Floats
    classes: Indices
    likelihood: Likelihood | None = None
    head: Head | None = None

    @classmethod
    def of(
        cls, comparison: Comparison, vectors: Sequence[NDArray[np.float16]], eigenvectors: Floats, whose: Indices
    ) -> Self:
        """Lay windows out.

        Parameters
        ----------
        comparison
            How they are compared.
        vectors, eigenvectors
            As in `WindowIndex`.
        whose
            The class and the person of each window, as numbers, shape (windows, 2); the windows of a class lie
            together.
        """
        count, weighing = len(whose), comparison.weighing
        room = -(-count // LANE) * LANE
        lengths = np.full((len(vectors), room), _FAR, dtype=np.float32)
        windows = []
        for own, each in zip(lengths, vectors, strict=True):
            wide = np.zeros((room, *each.shape[1:]), dtype=np.float32)
            wide[:count] = each
            own[:count] = _squares(wide[:count]) + np.float32(weighing.nearest)
            windows.append(np.ascontiguousarray(wide.T.reshape(each.shape[-1], -1)))
        new = np.any(whose[1:] != whose[:-1], axis=1)
        starts = np.concatenate([[0], np.flatnonzero(new) + 1, [count]])
        of_class = whose[starts[:-1], 0]
        most = max(np.bincount(of_class).max(), 2)
        persons = np.full((of_class.max() + 1, most), len(starts) - 1)
        for place, row in enumerate(persons):
            places = np.flatnonzero(of_class == place)
            row[: len(places)] = places
        return cls(
            comparison,
            tuple(windows),
            lengths,
            np.array(weighing.weights, dtype=np.float32),
            starts,
            persons,
            np.ascontiguousarray(eigenvectors.T),
            starts[persons[:, 0]],
        )

    def distances(self, signature: Signature) -> Distances:
        """Compare a window."""
        weighing, products = self.comparison.weighing, np.abs(signature.leading.astype(np.float32) @ self.eigenvectors)
        scores = np.maximum.reduceat(products, self.classes).astype(np.float64)
        if weighing.by_products:
            logs = agreed(-products[None], self.starts, self.persons)
            return Distances(logs, weighing.named(logs), weighing.alone(logs), scores)
        placed, vectors = self.comparison.placed_and_joined(signature.parts)
        logs, views = self.logs(vectors), len(weighing.views)
        named = np.minimum.reduce(logs[:views])
        if self.head:
            named += self.head.added(placed.values())
        judged = self.likelihood.of_window(vectors)[None] if self.likelihood else logs[views:]
        return Distances(logs, named, judged, scores)

    def logs(self, vectors: Sequence[Floats], left_out: NDArray[np.bool_] | None = None) -> Numbers:
        """Give the log distances of a window's vectors, as in `Distances`; perhaps with some windows left out."""
        windows = (self.windows, self.lengths, self.weights, self.starts, self.persons)
        none = np.zeros(0, dtype=np.bool_)
        return compare(vectors, *windows, self.comparison.weighing.nearest, none if left_out is None else left_out)


@compiled
def compare(  # noqa: PLR0913, PLR0917 - a window, and a library's windows
    vectors: Sequence[Floats],
    windows: Sequence[Floats],
    lengths: Floats,
    weights: Floats,
    starts: Indices,
    persons: Indices,
    nearest: float,
    left_out: NDArray[np.bool_],
) -> Numbers:
    """Give the log distances of each class from a window, (weights, classes), by `Comparer`'s arrays.

    `vectors` are the window's; `nearest` is the least squared distance; `left_out` says which windows are not compared,
    shape (windows,), or (0,) for none.
    """
    squared = np.empty_like(lengths)
    for place, (vector, each) in enumerate(zip(vectors, windows, strict=True)):
        alike = vector @ each
        if vector.ndim == 1:
            squared[place] = vector @ vector - 2 * alike
        else:
            # The squared distance of two matrices of length 1: 1 + 1 − 2 Σᵢⱼ ⟨sᵢ, tⱼ⟩².
            np.square(alike, out=alike)
            squared[place] = 1 - 2 * np.add.reduce(alike.reshape(-1, lengths.shape[1]))
    squared += lengths
    np.maximum(squared, np.float32(nearest), out=squared)
    weighed = (weights @ np.log(squared, out=squared))[:, : starts[-1]]
    if len(left_out):
        weighed[:, left_out] = np.inf
    return agreed(weighed, starts, persons)


def agreed(numbers: NDArray[np.floating], starts: Indices, persons: Indices) -> Numbers:
    """Take the mean of the two persons' least of each class, from (..., windows) to (..., classes).

    Where several persons perform a class, the second nearest must agree: one person's way may resemble another motion.
    """
    least = np.full((*numbers.shape[:-1], len(starts)), np.inf)
    np.minimum.reduceat(numbers, starts[:-1], axis=-1, out=least[..., :-1])
    by_person = least.take(persons, axis=-1)
    by_person.partition(1, axis=-1)
    first, second = by_person[..., 0], by_person[..., 1]
    return (first + np.where(np.isfinite(second), second, first)) / 2


def _squares(vectors: Floats) -> Floats:
    """Give the squared lengths of windows' vectors, or of their matrices.

    Matrices have length 1 but for rounding; the matrix of a window without movement has length 0, which counts as 1, so
    that such a window is at the greatest distance from all others.
    """
    if vectors.ndim == 2:
        lengths: Floats = np.square(vectors).sum(axis=1)
        return lengths
    squares = np.square(np.matmul(vectors, vectors.transpose(0, 2, 1))).sum(axis=(1, 2))
    counted: Floats = np.where(squares > 0, squares, np.float32(1))
    return counted
