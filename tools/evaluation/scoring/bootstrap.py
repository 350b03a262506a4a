"""Figures and their uncertainty: how they vary when other segments of the same kind are drawn.

A figure is computed from units: segments, takes or clips. Units are drawn with replacement, as many as there are, a
thousand times; the middle 95 % of the figures of these draws is the interval (Efron 1979). All counts of one unit are
drawn together, because they are not independent.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

#: The number of draws, and their seeds: the same figures have the same interval.
RESAMPLES = 1000
_SEED, _OTHER_SEED = 2012, 2013
_LEVEL = 95.0

#: Lower and upper end.
Interval = tuple[float, float]


class Figure(Protocol):
    """A figure computed from units."""

    def value(self) -> float | None:
        """Give the figure of all units; None when there are no units for it."""

    def interval(self) -> Interval | None:
        """Give the ends of its 95 % interval; None when there is none."""


@dataclass(frozen=True, slots=True)
class Ratio:
    """One sum over units divided by another: a share, or a rate.

    Attributes
    ----------
    counted, among
        The numbers of each unit.
    scale
        A factor on the quotient.
    """

    counted: Sequence[float]
    among: Sequence[float]
    scale: float = 1.0

    def value(self) -> float | None:
        """Give the figure of all units; None when the second sum is 0."""
        among = sum(self.among)
        return self.scale * sum(self.counted) / among if among > 0 else None

    def interval(self) -> Interval | None:
        """Give the ends of its 95 % interval; None when there is none."""
        drawn = _draws(len(self.among))
        return _middle(self.scale * _quotient(drawn @ _array(self.counted), drawn @ _array(self.among)))


@dataclass(frozen=True, slots=True)
class Percentile:
    """A percentile of values; each unit has none, one or several values."""

    values: Sequence[Sequence[float]]
    percent: float

    def value(self) -> float | None:
        """Give the percentile of all values; None when there are none."""
        values = _array([value for each in self.values for value in each])
        return float(np.percentile(values, self.percent)) if values.size else None

    def interval(self) -> Interval | None:
        """Give the ends of its 95 % interval; None when there is none."""
        values = _array([value for each in self.values for value in each])
        unit = np.repeat(np.arange(len(self.values)), [len(each) for each in self.values])
        found = [
            np.percentile(np.repeat(values, counts), self.percent)
            for counts in _draws(len(self.values)).astype(np.intp)[:, unit]
            if counts.any()
        ]
        return _middle(_array(found))


@dataclass(frozen=True, slots=True)
class RocArea:
    """The probability that a value of the first units is above one of the second, ties counting half (Mann-Whitney).

    Attributes
    ----------
    higher, lower
        The values of each unit, finite, any number of them.
    """

    higher: Sequence[NDArray[np.float64]]
    lower: Sequence[NDArray[np.float64]]

    def value(self) -> float | None:
        """Give the area; None without values of both kinds."""
        pairs = self._sizes(self.higher).sum() * self._sizes(self.lower).sum()
        return float(self._wins().sum() / pairs) if pairs else None

    def interval(self) -> Interval | None:
        """Give the ends of its 95 % interval; None when there is none."""
        if self.value() is None:
            return None
        first, second = _draws(len(self.higher)), _draws(len(self.lower), _OTHER_SEED)
        pairs = (first @ self._sizes(self.higher)) * (second @ self._sizes(self.lower))
        return _middle(_quotient(((first @ self._wins()) * second).sum(axis=1), pairs))

    @staticmethod
    def _sizes(units: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        return _array([len(each) for each in units])

    def _wins(self) -> NDArray[np.float64]:
        """Count for each two units in how many pairs of their values the first is above, shape (higher, lower)."""
        edges = np.concatenate([[0], np.cumsum([len(each) for each in self.higher])]).astype(np.intp)
        together = np.concatenate(self.higher)
        wins = np.zeros((len(self.higher), len(self.lower)))
        for index, each in enumerate(map(np.sort, self.lower)):
            below = np.searchsorted(each, together, side="left") + np.searchsorted(each, together, side="right")
            wins[:, index] = np.diff(np.concatenate([[0.0], np.cumsum(below / 2)])[edges])
        return wins


def _draws(units: int, seed: int = _SEED) -> NDArray[np.float64]:
    """Draw units with replacement, many times; give how often each was drawn, shape (RESAMPLES, units)."""
    if not units:
        return np.zeros((0, 0))
    return np.random.default_rng(seed).multinomial(units, np.full(units, 1 / units), size=RESAMPLES).astype(np.float64)


def _middle(values: NDArray[np.float64]) -> Interval | None:
    """Give the middle 95 % of a figure's draws; draws without a figure (NaN) are left out."""
    there = values[np.isfinite(values)]
    if not there.size:
        return None
    low, high = np.percentile(there, [(100 - _LEVEL) / 2, (100 + _LEVEL) / 2]).tolist()
    return low, high


def _quotient(above: NDArray[np.float64], below: NDArray[np.float64]) -> NDArray[np.float64]:
    quotient: NDArray[np.float64] = np.divide(above, below, out=np.full(below.shape, np.nan), where=below > 0)
    return quotient


def _array(values: Sequence[float]) -> NDArray[np.float64]:
    return np.asarray(values, dtype=np.float64)
