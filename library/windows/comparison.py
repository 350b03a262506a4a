"""How windows are compared: the parts that make one vector, and the weight of each vector.

A group of parts is one vector: the parts' vectors one after another, mapped by a metric of their own where the group
has several parts. The distance of two windows is a weighted mean of the logarithms of the groups' squared distances.
Several blends weigh the groups differently; a class's distance is its least over the blends. One has all parts, the
other the short parts: right after a change of motion only the short windows have left the motion before.

A metric maps numbers to vectors whose distances distinguish motions, but not people. Differences between people who
perform the same are learned from windows of known classes: the scatter of the differences between a window and the
nearest window of its class by another person. The metric divides by this scatter (within-class covariance
normalisation, Hatch, Kajarekar and Stolcke 2006), shrunk towards equal scatter everywhere (Ledoit and Wolf 2004), and
keeps the directions in which the windows then vary most.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from kinespace.library.signature.basis import leading_eigenvectors
from kinespace.library.signature.parts import (
    EIGEN_LONG,
    EIGEN_SHORT,
    EIGENVECTORS,
    PARTS,
    POSTURE,
    SHORT_PARTS,
    SPREAD_LONG,
    SPREAD_SHORT,
    Kind,
    Part,
    flattened,
)

_Number = TypeVar("_Number", np.float32, np.float64)

#: Principal axes in which metrics are learned: the other numbers are mostly noise.
_LEARNED_IN = 160
#: How often the nearest windows are searched for again, in the metric learned so far.
_ROUNDS = 2
#: Windows that ask at once for the nearest of their class: some ten thousand of `nothing` would take gigabytes.
_AT_ONCE = 2048
#: Length of an axis, relative to the longest, below which it is rounding.
_FLAT = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Metric:
    """A linear map: vectors are (numbers − origin) @ axes, compared by squared distances.

    Attributes
    ----------
    origin
        Shape (numbers,).
    axes
        Shape (numbers, kept).
    """

    origin: NDArray[np.float32] = field(repr=False)
    axes: NDArray[np.float32] = field(repr=False)

    def place(self, numbers: NDArray[np.floating]) -> NDArray[np.float32]:
        """Map windows' numbers to vectors, (..., numbers) to (..., kept)."""
        placed: NDArray[np.float32] = np.subtract(numbers, self.origin, dtype=np.float32) @ self.axes
        return placed


def learned_metric(
    numbers: NDArray[np.float64], whose: NDArray[np.intp], *, shrinkage: float, kept: int, apart: float = 1.0
) -> Metric:
    """Learn a metric from windows of several people.

    Parameters
    ----------
    numbers
        Shape (windows, numbers).
    whose
        The class and the person of each, shape (windows, 2). When no two persons share a class, the axes are principal
        axes.
    shrinkage
        0 to 1; at 1 the scatter is not used.
    kept
        How many axes to keep at most.
    apart
        The mean squared distance of windows from their middle where no two persons share a class.

    Returns
    -------
    The metric, scaled so that windows of one class by two persons are at a mean squared distance of 1.
    """
    origin = numbers.mean(axis=0)
    reduced, back = _reduced(numbers - origin)
    axes = _principal(reduced, kept)
    classes = [np.flatnonzero(whose[:, 0] == each) for each in np.unique(whose[:, 0])]
    shared = [own for own in classes if len(np.unique(whose[own, 1])) > 1]
    differences = _differences(reduced @ axes, reduced, whose[:, 1], shared) if shared else reduced
    # Persons whose recordings are the same, number for number, teach nothing.
    if shrinkage < 1 and shared and differences.any():
        for _ in range(_ROUNDS):
            axes = _whitened_axes(differences, reduced, shrinkage, kept)
            differences = _differences(reduced @ axes, reduced, whose[:, 1], shared)
    square = float(np.square(differences @ axes).sum(axis=1).mean())
    axes = axes * np.sqrt((1.0 if shared else apart) / square) if square > 0 else axes
    # Axes of half precision, as a library's file keeps them.
    return Metric(origin.astype(np.float32), (back @ axes).astype(np.float16).astype(np.float32))


def _reduced(centred: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Map windows to their principal axes, and give the axes, (numbers, `_LEARNED_IN`)."""
    # The learned metric does not depend on how exact these axes are.
    back = _principal(centred.astype(np.float32), _LEARNED_IN).astype(np.float64)
    return centred @ back, back


def _principal(centred: NDArray[_Number], kept: int) -> NDArray[_Number]:
    """Give the principal axes of windows, (numbers, axes): `kept` at most, and fewer than there are windows."""
    windows, numbers = centred.shape
    if windows > numbers:
        return leading_eigenvectors(centred.T @ centred, kept)[1]
    # Few windows span few axes: the same axes follow from the windows' inner products, which are fewer numbers.
    values, vectors = leading_eigenvectors(centred @ centred.T, max(min(kept, windows - 1), 1))
    lengths = np.sqrt(np.maximum(values, 0.0))
    there = lengths > _FLAT * lengths[0]
    axes: NDArray[_Number] = centred.T @ (vectors[:, there] / lengths[there]) if there.any() else centred.T[:, :1]
    return axes


def whitened(scatter: NDArray[np.float64], shrinkage: float) -> NDArray[np.float64]:
    """Give the matrix that makes all directions of a scatter alike, (numbers, numbers).

    The scatter is scaled to a mean of 1 along its diagonal, and shrunk by a share towards equal scatter.
    """
    values, vectors = np.linalg.eigh(scatter * (len(scatter) / (float(np.trace(scatter)) or 1.0)))
    matrix: NDArray[np.float64] = vectors / np.sqrt((1 - shrinkage) * np.maximum(values, 0.0) + shrinkage)
    return matrix


def _whitened_axes(
    differences: NDArray[np.float64], centred: NDArray[np.float64], shrinkage: float, kept: int
) -> NDArray[np.float64]:
    """Whiten the differences, then take the principal axes of the windows; shape (numbers, kept)."""
    whitening = whitened(differences.T @ differences, shrinkage)
    axes: NDArray[np.float64] = whitening @ _principal(centred @ whitening, kept)
    return axes


def _differences(
    vectors: NDArray[np.float64], numbers: NDArray[np.float64], people: NDArray[np.intp], shared: list[NDArray[np.intp]]
) -> NDArray[np.float64]:
    """Take each window's difference to the nearest of its class by another person; classes weigh the same."""
    count = sum(map(len, shared)) / len(shared)
    differences: list[NDArray[np.float64]] = []
    for own in shared:
        for some in np.split(own, range(_AT_ONCE, len(own), _AT_ONCE)):
            squared = squared_distances(vectors[some], vectors[own])
            squared[people[some][:, None] == people[own]] = np.inf
            nearest = own[squared.argmin(axis=1)]
            differences.append((numbers[some] - numbers[nearest]) * np.sqrt(count / len(own)))
    return np.concatenate(differences)


def squared_distances(first: NDArray[np.floating], second: NDArray[np.floating]) -> NDArray[np.floating]:
    """Take |a − b|² as |a|² + |b|² − 2 a·b for all rows of two matrices: shape (n, m), never below 0."""
    lengths = np.square(first).sum(axis=1)[:, None] + np.square(second).sum(axis=1)
    squared: NDArray[np.floating] = np.maximum(lengths - 2 * first @ second.T, 0.0)
    return squared


Group = tuple[Part, ...]

#: Seconds after which a feed is first answered, and at which a motion's first window ends.
FIRST_WINDOW = 0.15
#: Added to squared distances before the logarithm: two windows at a smaller distance count as the same.
NEAREST = 0.01
#: Axes that are kept of each part.
_PART_AXES = 64
#: Axes that are kept of a group of several parts.
MAX_AXES = 128
#: Axes of such a group that distinguish the very classes that taught them: the other axes differ between people.
#: Classes that taught nothing may differ in any axis.
_TAUGHT_AXES = 32
#: The share of the learned scatter that is replaced by equal scatter. The eigen part is compared by plain inner
#: products.
_EIGEN_SHRINKAGE, _PART_SHRINKAGE, _GROUP_SHRINKAGE = 1.0, 0.3, 0.2
#: Mean squared distance of HDM05's windows from their middle, where two people in the same motion are at 1.
_APART = 3.0


@dataclass(frozen=True, slots=True)
class Weighing:
    """The groups of parts that are compared, and their weights.

    Attributes
    ----------
    groups
        The parts of each vector.
    blends
        For each blend the weight of each group; a blend's weights add up to 1.
    first
        Seconds from a motion's start to the end of its first window in the library.
    eigenvectors
        Eigenvectors of an eigen part.
    as_in_paper
        Whether windows are compared as in the paper (`library.windows.paper`). Then each pair weighs as much in the
        basis as it varies, else every moving pair alike; and unknown motion is not recognised as such: a guess is named
        unless its eigenvector is arbitrary.

    Raises
    ------
    ValueError
        A blend has another number of weights than there are groups, or its weights do not add up to 1.
    """

    groups: tuple[Group, ...]
    blends: tuple[tuple[float, ...], ...]
    first: float
    eigenvectors: int = EIGENVECTORS
    as_in_paper: bool = False

    def __post_init__(self) -> None:
        for blend in self.blends:
            if len(blend) != len(self.groups) or not np.isclose(sum(blend), 1.0):
                raise ValueError(f"blends: expected {len(self.groups)} weights that add up to 1, got {blend}")

    def without(self, kind: Kind) -> "Weighing":
        """Leave out the parts of one kind, to measure their worth; the other weights keep their proportions.

        Raises
        ------
        ValueError
            No part is left to name a class by.
        """
        groups = [tuple(part for part in group if part.kind is not kind) for group in self.groups]
        left = [place for place, group in enumerate(groups) if group]
        blends = [tuple(blend[place] for place in left) for blend in self.blends]
        scaled = tuple(tuple(weight / sum(blend) for weight in blend) for blend in blends if sum(blend) > 0)
        if not scaled:
            raise ValueError(f"kind: expected some parts other than {kind}, got none")
        return replace(self, groups=tuple(groups[place] for place in left), blends=scaled)

    @property
    def measured(self) -> tuple[Part, ...]:
        """The parts that have a metric of their own: all but eigenvectors that are compared by plain inner products."""
        return tuple(dict.fromkeys(part for group in self.groups if not _is_eigen(group) for part in group))

    @property
    def weights(self) -> tuple[tuple[float, ...], ...]:
        """The weight of each group in all distances that are computed: the blends, and below them each group alone."""
        alone = np.eye(len(self.groups)).tolist()
        return (*self.blends, *map(tuple, alone))

    @property
    def parts(self) -> tuple[Part, ...]:
        """All parts that are compared, each once."""
        return tuple(dict.fromkeys(part for group in self.groups for part in group))


#: Between laboratories each part counts alone, so that a part that a laboratory's bodies shift does not outweigh the
#: others. Trend and the joint metric fit one laboratory and mislead in another (tests/TRIED.md).
ACROSS_LABORATORIES = Weighing(
    groups=((EIGEN_LONG,), (EIGEN_SHORT,), (SPREAD_LONG,), (SPREAD_SHORT,), (POSTURE,)),
    blends=((2 / 9, 2 / 9, 2 / 9, 2 / 9, 1 / 9), (0.0, 1 / 3, 0.0, 1 / 3, 1 / 3)),
    first=0.5,
)
#: Within a laboratory one metric over all parts also learns how parts vary together between people.
WITHIN_LABORATORY = Weighing(groups=(PARTS, SHORT_PARTS), blends=((0.5, 0.5),), first=FIRST_WINDOW)


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Maps the numbers of a window's parts to the vectors of the groups.

    Attributes
    ----------
    weighing
        Groups and weights.
    parts
        The metric of each part.
    groups
        For each group of several parts the metric of their joined vectors; None for a single part.
    """

    weighing: Weighing
    parts: Mapping[Part, Metric] = field(repr=False)
    groups: tuple[Metric | None, ...] = field(repr=False)

    def of_taught_classes(self) -> "Comparison":
        """Give the comparison for the classes that taught it."""
        groups = tuple(metric and Metric(metric.origin, metric.axes[:, :_TAUGHT_AXES]) for metric in self.groups)
        return replace(self, groups=groups)

    @classmethod
    def learned(
        cls, weighing: Weighing, numbers: Mapping[Part, NDArray[np.float64]], whose: NDArray[np.intp]
    ) -> "Comparison":
        """Learn the metrics from windows of known classes and people.

        Parameters
        ----------
        weighing
            The groups and their weights.
        numbers
            The numbers of each part, (windows, numbers).
        whose
            The class and the person of each window, as numbers, shape (windows, 2).
        """
        parts = {
            part: learned_metric(
                _as_vectors(part, numbers),
                whose,
                shrinkage=_EIGEN_SHRINKAGE if part.kind is Kind.EIGEN else _PART_SHRINKAGE,
                kept=_PART_AXES,
            )
            for part in weighing.measured
        }
        vectors = cls(weighing, parts, ()).placed(numbers)
        groups: list[Metric | None] = []
        for group in weighing.groups:
            if len(group) == 1:
                groups.append(None)
                continue
            joined = np.concatenate([vectors[part] for part in group], axis=-1, dtype=np.float64)
            metric = learned_metric(joined, whose, shrinkage=_GROUP_SHRINKAGE, kept=MAX_AXES, apart=_APART)
            groups.append(metric)
        return cls(weighing, parts, tuple(groups))

    def placed(self, numbers: Mapping[Part, NDArray[np.float64]]) -> dict[Part, NDArray[np.float32]]:
        """Give the vector of each part that has a metric, of windows (windows, numbers) or of one window (numbers,)."""
        return {part: metric.place(_as_vectors(part, numbers)) for part, metric in self.parts.items()}

    def joined(
        self, numbers: Mapping[Part, NDArray[np.float64]], placed: Mapping[Part, NDArray[np.float32]]
    ) -> list[NDArray[np.float32]]:
        """Give the vector of each group, from the numbers of windows and what `placed` gives of them.

        Returns
        -------
        For each group an array of shape (..., axes); for a group of an eigen part alone its scaled eigenvectors, (...,
        k, directions).
        """
        vectors: list[NDArray[np.float32]] = []
        for group, metric in zip(self.weighing.groups, self.groups, strict=True):
            if metric:
                vectors.append(metric.place(np.concatenate([placed[part] for part in group], axis=-1)))
            else:
                is_eigen = group[0].kind is Kind.EIGEN
                vectors.append(numbers[group[0]].astype(np.float32) if is_eigen else placed[group[0]])
        return vectors


def _is_eigen(group: Group) -> bool:
    """Whether a group is one eigen part alone, which is compared by plain inner products of eigenvectors."""
    return len(group) == 1 and group[0].kind is Kind.EIGEN


def _as_vectors(part: Part, numbers: Mapping[Part, NDArray[np.float64]]) -> NDArray[np.float64]:
    return flattened(numbers[part]) if part.kind is Kind.EIGEN else numbers[part]
