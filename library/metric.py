"""How window measures are compared: a metric per measure, learned once from several people doing the same motions.

What differs between a window and the nearest window of the same class by another person says nothing about the class.
The metric divides by the scatter of those differences (shrunk towards equal scatter), and keeps the leading axes of
what is left: the measures of a window become one short vector, compared by inner products.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Matrix = NDArray[np.float64]

#: Rounds of finding the nearest windows in the metric and learning the metric from them.
_ROUNDS = 2
#: Variance below which half precision keeps nothing.
_LEAST_SPARE = 1e-5
#: Share of the most that vectors vary below which what is left of it is rounding.
_LEAST_VARYING = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Metric:
    """A linear map into a short vector whose squared length is the squared distance.

    Attributes
    ----------
    origin
        Mean measure, shape (numbers,).
    axes
        Shape (numbers, kept), float32.
    outside
        How much a squared difference weighs that lies outside the kept axes: 0 when it is dropped.
    together
        How vectors vary together with measures, where it was learned, shape (kept, numbers), float32; else (0, 0).
    spare
        Variance of each number of a measure that its vector does not tell, shape (numbers,), float32; else (0,).
    """

    origin: NDArray[np.float32] = field(repr=False)
    axes: NDArray[np.float32] = field(repr=False)
    outside: float
    together: NDArray[np.float32] = field(repr=False)
    spare: NDArray[np.float32] = field(repr=False)

    def embedded(self, measures: NDArray[np.float64]) -> NDArray[np.float32]:
        """Map measures (..., numbers) to vectors (..., kept)."""
        vectors: NDArray[np.float32] = (measures - self.origin).astype(np.float32) @ self.axes
        return vectors

    def restricted_to(self, numbers: NDArray[np.intp], level_removed: float) -> Metric:
        """Find the same vectors from fewer numbers, as the measures that were learned from have them together.

        The vector z of a measure x with prior covariance Z, where x is z D and independent noise of variance S, is
        estimated from the numbers seen as (Dₛ Sₛ⁻¹ Dₛᵀ + Z⁻¹)⁻¹ Dₛ Sₛ⁻¹ (x - origin)ₛ: the linear estimate of least
        mean square error.

        Parameters
        ----------
        numbers
            Which are seen, shape (fewer,).
        level_removed
            How much of their mean measures have been freed from; of fewer numbers the mean is another.

        Raises
        ------
        ValueError
            It was not learned how vectors and measures vary together.
        """
        origin, _, axes = self._estimate(numbers, level_removed)
        lift = level_removed / (1 - level_removed)
        # What follows takes the mean of the fewer numbers back in: x + lift * mean(x).
        mean = lift / (1 + lift) * origin.mean()
        return Metric(
            origin=halved(origin - mean),
            axes=halved(axes + lift * axes.mean(axis=0)),
            outside=0.0,
            together=np.zeros((0, 0), dtype=np.float32),
            spare=np.zeros(0, dtype=np.float32),
        )

    def shown_by(
        self, vectors: NDArray[np.floating], numbers: NDArray[np.intp], level_removed: float
    ) -> NDArray[np.float64]:
        """Give what `restricted_to` finds in the mean of measures with these vectors, (n, kept): of the same shape.

        A difference that the fewer numbers do not tell is none there, one that they tell half is half.
        """
        _, decoder, axes = self._estimate(numbers, level_removed)
        shown: NDArray[np.float64] = vectors @ (decoder @ axes)
        return shown

    def _estimate(self, numbers: NDArray[np.intp], level_removed: float) -> tuple[Matrix, Matrix, Matrix]:
        """Give origin, decoder (kept, fewer) and axes (fewer, kept) for numbers that have all of their mean."""
        if not self.together.size:
            raise ValueError("metric: expected one learned with what varies together, got one without")
        together, lift = self.together.astype(np.float64), level_removed / (1 - level_removed)
        prior = together @ self.axes
        prior = (prior + prior.T) / 2
        # A measure may have numbers that never vary, and axes along them: a segment's posture is always 1.
        decoder = np.linalg.pinv(prior, rcond=_LEAST_VARYING, hermitian=True) @ together
        decoder += lift * decoder.mean(axis=1, keepdims=True)
        origin = (self.origin + lift * self.origin.mean())[numbers]
        told = decoder[:, numbers]
        seen = told / self.spare[numbers]
        axes = np.asarray(np.linalg.solve(np.eye(len(prior)) + prior @ seen @ told.T, prior @ seen).T, dtype=np.float64)
        return origin, told, axes

    def place(self, measure: NDArray[np.float64], vector: NDArray[np.float32]) -> float:
        """Map one measure, (numbers,), and write its vector, (kept,); give its squared distance from the origin.

        That is the vector's squared length and, where it counts, what lies outside the kept axes.
        """
        difference = np.subtract(measure, self.origin, dtype=np.float32)
        np.dot(difference, self.axes, out=vector)
        square = float(vector @ vector)
        return max(self.outside * float(difference @ difference), square) if self.outside else square

    def placed_each(self, measures: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Do the same for several measures at once, (hops, numbers): vectors, (hops, kept), and distances, (hops,)."""
        differences = np.subtract(measures, self.origin, dtype=np.float32)
        vectors: NDArray[np.float32] = differences @ self.axes
        squares = squared_lengths(vectors)
        if self.outside:
            np.maximum(squares, self.outside * squared_lengths(differences), out=squares)
        return vectors, squares


def learned_metric(  # noqa: PLR0913 - windows, who made them, and how they are learned from
    measures: NDArray[np.float64],
    classes: NDArray[np.intp],
    actors: NDArray[np.str_],
    *,
    shrinkage: float,
    kept: int,
    together: bool,
) -> Metric:
    """Learn a metric from windows of several people.

    Parameters
    ----------
    measures
        Shape (windows, numbers).
    classes, actors
        Of each window, shape (windows,).
    shrinkage
        0 to 1; at 1 nothing is divided by: the axes are the measures' own principal axes.
    kept
        How many axes to keep.
    together
        Whether to learn as well how vectors and measures vary together.

    Returns
    -------
    The metric, scaled so that the differences it was learned from have mean squared length 1.

    Raises
    ------
    ValueError
        No class is performed by two people.
    """
    origin = measures.mean(axis=0)
    differences = measures - origin
    axes = _axes(measures, origin, differences, 1.0, kept)
    for _ in range(_ROUNDS):
        differences = _between_people((measures - origin) @ axes, measures, classes, actors)
        axes = _axes(measures, origin, differences, shrinkage, kept)
    scale = 1 / np.sqrt(np.square(differences @ axes).sum(axis=1).mean())
    outside = float(scale**2) if shrinkage == 1 else 0.0
    vectors = (measures - origin) @ axes * scale
    varying = vectors.T @ (measures - origin) / len(measures) if together else np.zeros((0, 0))
    spare = _spare(measures - origin, vectors) if together else np.zeros(0)
    return Metric(halved(origin), halved(axes * scale), outside, halved(varying), halved(spare))


def principal_metric(measures: NDArray[np.float64], weight: float, kept: int) -> Metric:
    """Compare measures by their plain differences, along their principal axes.

    Parameters
    ----------
    measures
        Shape (windows, numbers).
    weight
        Of a squared difference, inside the kept axes and outside.
    kept
        How many axes to keep, at most.
    """
    origin = measures.mean(axis=0)
    _, principal = np.linalg.eigh((measures - origin).T @ (measures - origin))
    return Metric(
        origin=halved(origin),
        axes=halved(principal[:, ::-1][:, :kept] * np.sqrt(weight)),
        outside=weight,
        together=np.zeros((0, 0), dtype=np.float32),
        spare=np.zeros(0, dtype=np.float32),
    )


def _spare(measures: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance of each number that no linear map of the vectors tells, (numbers,); never 0 once rounded."""
    told = vectors @ np.linalg.lstsq(vectors, measures, rcond=None)[0]
    spare: NDArray[np.float64] = np.maximum(np.square(measures - told).mean(axis=0), _LEAST_SPARE)
    return spare


def _axes(
    measures: NDArray[np.float64],
    origin: NDArray[np.float64],
    differences: NDArray[np.float64],
    shrinkage: float,
    kept: int,
) -> NDArray[np.float64]:
    """Whiten the differences, then take the principal axes of the measures; shape (numbers, kept)."""
    scatter = differences.T @ differences
    scatter /= np.trace(scatter) / len(scatter)
    values, vectors = np.linalg.eigh(scatter)
    whitening = vectors / np.sqrt((1 - shrinkage) * np.maximum(values, 0.0) + shrinkage)
    white = (measures - origin) @ whitening
    _, principal = np.linalg.eigh(white.T @ white)
    axes: NDArray[np.float64] = whitening @ principal[:, ::-1][:, :kept]
    return axes


def _between_people(
    vectors: NDArray[np.float64],
    measures: NDArray[np.float64],
    classes: NDArray[np.intp],
    actors: NDArray[np.str_],
) -> NDArray[np.float64]:
    """Take each window's difference to the nearest of its class by somebody else, each class weighing the same."""
    shared = [own for own in _by_class(classes) if len(np.unique(actors[own])) > 1]
    if not shared:
        raise ValueError("actors: expected a class performed by two people, got none")
    count = sum(map(len, shared))
    differences: list[NDArray[np.float64]] = []
    for own in shared:
        squared = squared_distances(vectors[own], vectors[own])
        squared[actors[own][:, None] == actors[own]] = np.inf
        nearest = own[squared.argmin(axis=1)]
        differences.append((measures[own] - measures[nearest]) * np.sqrt(count / len(own)))
    between: NDArray[np.float64] = np.concatenate(differences) / np.sqrt(len(differences))
    return between


def _by_class(classes: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    return [np.flatnonzero(classes == index) for index in np.unique(classes)]


def halved(numbers: NDArray[np.floating]) -> NDArray[np.float32]:
    """Round to half precision, as files keep these numbers, so that saving and loading changes nothing."""
    rounded: NDArray[np.float32] = numbers.astype(np.float16).astype(np.float32)
    return rounded


def squared_lengths(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Take |a|² of all rows of a matrix, (n, numbers): shape (n,)."""
    lengths: NDArray[np.float32] = np.square(vectors).sum(axis=1)
    return lengths


def squared_distances(first: NDArray[np.floating], second: NDArray[np.floating]) -> NDArray[np.floating]:
    """Take |a - b|² as |a|² + |b|² - 2 a·b for all rows of two matrices: shape (n, m), never below 0."""
    lengths = np.square(first).sum(axis=1)[:, None] + np.square(second).sum(axis=1)
    squared: NDArray[np.floating] = np.maximum(lengths - 2 * first @ second.T, 0.0)
    return squared
