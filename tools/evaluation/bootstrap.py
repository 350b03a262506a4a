"""Figures and their uncertainty: how they vary when other segments of the same kind are drawn.

A figure is computed from units: segments, takes or clips. Units are drawn with replacement, as many as there are, a
thousand times; the middle 95 % of the figures of these draws is the interval (Efron 1979). All counts of one unit are
drawn together, because they are not independent. Nor are the segments of one person: to say how the figure varies with
other persons, persons are drawn in place of units, each with all that is theirs.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

#: Says how often each of some units was drawn, shape (draws, units). The second number is the kind of
#: the units: two kinds are drawn independently.
Draw = Callable[[int, int], NDArray[np.float64]]

#: The number of draws.
RESAMPLES = 1000
#: The seed of the first kind of units: the same figures have the same interval.
_SEED = 2012
_ENDS = (2.5, 97.5)

#: Lower and upper end.
Interval = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure(ABC):
    """A figure computed from units.

    Attributes
    ----------
    persons
        For each kind of units the person of each unit; empty where persons do not matter.
    """

    persons: Sequence[Sequence[str]] = ()

    @abstractmethod
    def of(self, draw: Draw) -> NDArray[np.float64]:
        """Give the figure of each draw, shape (draws,); NaN for a draw without units for it."""

    def value(self) -> float | None:
        """Give the figure of all units; None when there are no units for it."""
        value = self.of(lambda units, _: np.ones((1, units))).item()
        return None if np.isnan(value) else value

    def interval(self, *, by_person: bool = False) -> Interval | None:
        """Give the ends of its 95 % interval, None when there is none; persons may be drawn in place of units."""
        drawn = self.of(partial(_drawn_by_person, self.persons) if by_person else _drawn)
        there = drawn[np.isfinite(drawn)]
        if not there.size:
            return None
        low, high = np.percentile(there, _ENDS).tolist()
        return low, high


@dataclass(frozen=True, slots=True)
class Ratio(Figure):
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

    def of(self, draw: Draw) -> NDArray[np.float64]:
        """Divide the sums over each draw."""
        drawn = draw(len(self.among), 0)
        counted, among = (drawn @ np.asarray(each, dtype=np.float64) for each in (self.counted, self.among))
        return self.scale * _quotient(counted, among)


@dataclass(frozen=True, slots=True)
class Percentile(Figure):
    """A percentile of values; each unit has none, one or several values."""

    values: Sequence[Sequence[float]]
    percent: float

    def of(self, draw: Draw) -> NDArray[np.float64]:
        """Take the percentile of the values of each draw."""
        values = np.array([value for each in self.values for value in each], dtype=np.float64)
        unit = np.repeat(np.arange(len(self.values)), [len(each) for each in self.values])
        counts = draw(len(self.values), 0).astype(np.intp)[:, unit]
        return np.array([np.percentile(np.repeat(values, n), self.percent) if n.any() else np.nan for n in counts])


@dataclass(frozen=True, slots=True)
class RocArea(Figure):
    """The probability that a value of the first units is above one of the second, ties counting half (Mann-Whitney).

    Attributes
    ----------
    higher, lower
        The values of each unit, finite, any number of them.
    """

    higher: Sequence[NDArray[np.float64]]
    lower: Sequence[NDArray[np.float64]]

    def of(self, draw: Draw) -> NDArray[np.float64]:
        """Compare the values of each draw, both kinds drawn by themselves."""
        first, second = draw(len(self.higher), 0), draw(len(self.lower), 1)
        pairs = (first @ [*map(len, self.higher)]) * (second @ [*map(len, self.lower)])
        return _quotient(((first @ self._wins()) * second).sum(axis=1), pairs)

    def _wins(self) -> NDArray[np.float64]:
        """Count for each two units in how many pairs of their values the first is above, shape (higher, lower)."""
        edges = np.cumsum([0, *map(len, self.higher)])
        together = np.concatenate([np.zeros(0), *self.higher])
        wins = np.zeros((len(self.higher), len(self.lower)))
        for column, each in zip(wins.T, map(np.sort, self.lower), strict=True):
            below = np.searchsorted(each, together, side="left") + np.searchsorted(each, together, side="right")
            column[:] = np.diff(np.append(0.0, np.cumsum(below / 2))[edges])
        return wins


def _drawn(units: int, kind: int) -> NDArray[np.float64]:
    if not units:
        return np.zeros((RESAMPLES, 0))
    generator = np.random.default_rng(_SEED + kind)
    return generator.multinomial(units, np.full(units, 1 / units), size=RESAMPLES).astype(np.float64)


def _drawn_by_person(persons: Sequence[Sequence[str]], _: int, kind: int) -> NDArray[np.float64]:
    """Draw persons, for all kinds of units the same."""
    places = {person: place for place, person in enumerate(sorted({each for kind in persons for each in kind}))}
    return _drawn(len(places), 0)[:, [places[person] for person in persons[kind]]]


def _quotient(above: NDArray[np.float64], below: NDArray[np.float64]) -> NDArray[np.float64]:
    quotient: NDArray[np.float64] = np.divide(above, below, out=np.full(below.shape, np.nan), where=below > 0)
    return quotient


def values_of(figures: Mapping[str, Figure]) -> dict[str, float | None]:
    """Give the value of each figure."""
    return {name: figure.value() for name, figure in figures.items()}


def intervals_of(figures: Mapping[str, Figure], *, by_person: bool = False) -> dict[str, Interval | None]:
    """Give the interval of each figure."""
    return {name: figure.interval(by_person=by_person) for name, figure in figures.items()}
