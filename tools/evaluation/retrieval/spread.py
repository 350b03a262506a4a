"""The spread: how much each distance varies, and a metric that weighs differences by how much people differ.

The standard deviations of the distances are the square roots of the covariance's diagonal. Their logarithms, relative
to the body's size and centred, say which joints move against each other, and by which factor more than others; they
have no sign, and a motion done larger changes all of them alike. Two people who perform the same class differ more in
some of these numbers than in others. The metric learns this from motions of known classes: it divides by the scatter
within classes (within-class covariance normalisation, Hatch, Kajarekar and Stolcke 2006), shrunk towards equal
scatter everywhere (Ledoit and Wolf 2004), since there are fewer motions than distances.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Added to each standard deviation before the logarithm, relative to the body's size: about a millimetre, a marker's
#: noise. Without it a distance that does not change at all would outweigh all others.
FLOOR = 0.0015
#: Share of equal scatter in the metric.
SHRINKAGE = 0.1
#: Scatter below this share of the largest scatter is only rounding.
_NOTHING = 1e-12


def spread_of(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the centred log standard deviations of a motion's distances, shape (pairs,); no unit.

    Parameters
    ----------
    rows
        Distance rows, shape (frames, pairs), metres, at least two. The body's size is the root mean square of the mean
        distances.
    """
    size = np.sqrt(np.mean(np.square(rows.mean(axis=0))))
    logs = np.log(rows.std(axis=0, ddof=1) / size + FLOOR)
    centred: NDArray[np.float64] = logs - logs.mean()
    return centred


@dataclass(frozen=True, slots=True, eq=False)
class SpreadMetric:
    """Squared distances between spreads, in units of the scatter within classes.

    The within-class scatter S of m motions has rank below m, so (1 - s) S + s t I, with t the mean of S's diagonal and
    s the shrinkage, is applied through its m eigenvectors and one number for everything else.

    Attributes
    ----------
    directions
        Eigenvectors of the scatter, shape (directions, pairs).
    excess
        How much less a difference weighs along each direction than elsewhere, shape (directions,): its square root.
    weight
        Weight of a squared difference in all other directions.
    """

    directions: NDArray[np.float64] = field(repr=False)
    excess: NDArray[np.float64] = field(repr=False)
    weight: float

    @classmethod
    def learned(
        cls, spreads: NDArray[np.float64], classes: NDArray[np.str_], shrinkage: float = SHRINKAGE
    ) -> SpreadMetric:
        """Learn from motions of known classes, each class weighing the same.

        Parameters
        ----------
        spreads
            Shape (motions, pairs).
        classes
            Class of each motion, shape (motions,).
        shrinkage
            0 trusts the scatter entirely (with few motions most directions have none), 1 not at all.

        Raises
        ------
        ValueError
            Shapes do not fit, the shrinkage is not above 0 and at most 1, or no class has two motions that differ.
        """
        if spreads.ndim != 2 or classes.shape != spreads.shape[:1]:
            raise ValueError(f"classes: expected one for each of {spreads.shape[:1]} motions, got {classes.shape}")
        if not 0 < shrinkage <= 1:
            raise ValueError(f"shrinkage: expected above 0 and at most 1, got {shrinkage}")
        names = np.unique(classes)
        within = np.concatenate(
            [_about_mean(spreads[classes == name]) / np.sqrt((classes == name).sum() * len(names)) for name in names]
        )
        # The matrix of motions by motions is smaller. Directions whose scatter is only rounding count as none.
        scatter, vectors = np.linalg.eigh(within @ within.T)
        equal = shrinkage * np.square(within).sum() / spreads.shape[1]
        if not equal > 0:
            raise ValueError("spreads: expected a class with two motions that differ, got none")
        there = scatter > _NOTHING * scatter[-1]
        scatter = scatter[there]
        directions = vectors.T[there] @ within / np.sqrt(scatter)[:, None]
        excess = 1 / equal - 1 / ((1 - shrinkage) * scatter + equal)
        return cls(directions, np.sqrt(np.maximum(excess, 0.0)), float(1 / equal))

    def squared_distances(self, first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compare spreads, shapes (n, pairs) and (m, pairs); the result has shape (n, m) and is never below 0."""
        plain = self.weight * _squared_distances(first, second)
        along = (self.directions.T * self.excess).astype(np.float64)
        return np.maximum(plain - _squared_distances(first @ along, second @ along), 0.0)


def _about_mean(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    centred: NDArray[np.float64] = rows - rows.mean(axis=0)
    return centred


def _squared_distances(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Take |a - b|² as |a|² + |b|² - 2 a·b: one product for all pairs of rows."""
    lengths = np.square(first).sum(axis=1)[:, None] + np.square(second).sum(axis=1)
    squared: NDArray[np.float64] = lengths - 2 * first @ second.T
    return squared
