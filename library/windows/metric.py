"""Metrics: they map the numbers of windows to vectors whose distances distinguish motions, but not people.

Differences between people who perform the same are learned from windows of known classes: the scatter of the
differences between a window and the nearest window of its class by another person. The metric divides by this scatter
(within-class covariance normalisation, Hatch, Kajarekar and Stolcke 2006), shrunk towards equal scatter everywhere
(Ledoit and Wolf 2004), and keeps the directions in which the windows then vary most.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from kinespace.library.signature.leading import leading_eigenvectors

_Number = TypeVar("_Number", np.float32, np.float64)
_Name = TypeVar("_Name")

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


def placed(
    numbers: Mapping[_Name, NDArray[np.floating]], metrics: Mapping[_Name, Metric]
) -> dict[_Name, NDArray[np.float32]]:
    """Map numbers by the metrics of their names."""
    return {name: metric.place(numbers[name]) for name, metric in metrics.items()}


class Lessons(NamedTuple):
    """The classes and persons of the windows from which a metric is learned.

    Attributes
    ----------
    classes, people
        Index of the class and of the person of each window, both of shape (windows,).
    """

    classes: NDArray[np.intp]
    people: NDArray[np.intp]

    @property
    def shared(self) -> list[NDArray[np.intp]]:
        """The windows of each class that at least two persons perform."""
        each = [np.flatnonzero(self.classes == index) for index in np.unique(self.classes)]
        return [own for own in each if len(np.unique(self.people[own])) > 1]


def learned_metric(
    numbers: NDArray[np.float64], lessons: Lessons, *, shrinkage: float, kept: int, apart: float = 1.0
) -> Metric:
    """Learn a metric from windows of several people.

    Parameters
    ----------
    numbers
        Shape (windows, numbers).
    lessons
        Their classes and persons. When no two persons share a class, the axes are principal axes.
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
    shared = lessons.shared
    differences = _differences(reduced @ axes, reduced, lessons, shared) if shared else reduced
    # Persons whose recordings are the same, number for number, teach nothing.
    if shrinkage < 1 and shared and differences.any():
        for _ in range(_ROUNDS):
            axes = _whitened_axes(differences, reduced, shrinkage, kept)
            differences = _differences(reduced @ axes, reduced, lessons, shared)
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


def _whitened_axes(
    differences: NDArray[np.float64], centred: NDArray[np.float64], shrinkage: float, kept: int
) -> NDArray[np.float64]:
    """Whiten the differences, then take the principal axes of the windows; shape (numbers, kept)."""
    scatter = differences.T @ differences
    scatter /= np.trace(scatter) / len(scatter)
    values, vectors = np.linalg.eigh(scatter)
    whitening = vectors / np.sqrt((1 - shrinkage) * np.maximum(values, 0.0) + shrinkage)
    axes: NDArray[np.float64] = whitening @ _principal(centred @ whitening, kept)
    return axes


def _differences(
    vectors: NDArray[np.float64],
    numbers: NDArray[np.float64],
    lessons: Lessons,
    shared: list[NDArray[np.intp]],
) -> NDArray[np.float64]:
    """Take each window's difference to the nearest of its class by another person; classes weigh the same."""
    count = sum(map(len, shared)) / len(shared)
    differences: list[NDArray[np.float64]] = []
    for own in shared:
        for some in np.split(own, range(_AT_ONCE, len(own), _AT_ONCE)):
            squared = squared_distances(vectors[some], vectors[own])
            squared[lessons.people[some][:, None] == lessons.people[own]] = np.inf
            nearest = own[squared.argmin(axis=1)]
            differences.append((numbers[some] - numbers[nearest]) * np.sqrt(count / len(own)))
    return np.concatenate(differences)


def squared_distances(first: NDArray[np.floating], second: NDArray[np.floating]) -> NDArray[np.floating]:
    """Take |a − b|² as |a|² + |b|² − 2 a·b for all rows of two matrices: shape (n, m), never below 0."""
    lengths = np.square(first).sum(axis=1)[:, None] + np.square(second).sum(axis=1)
    squared: NDArray[np.floating] = np.maximum(lengths - 2 * first @ second.T, 0.0)
    return squared
