"""Whose windows are whose: how near a class is by its people."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: The second nearest person is the one who must agree, where two perform a class.
_PEOPLE = 2


@dataclass(frozen=True, slots=True, eq=False)
class People:
    """Which windows are whose, of which class: windows of one person in one class stand together.

    Attributes
    ----------
    starts
        Where the windows of each person in each class start, shape (blocks,).
    classes, actors
        Of each block, shape (blocks,).
    places
        For each class its blocks, filled up with a block that is not there, shape (classes, most people).
    """

    starts: NDArray[np.intp]
    classes: NDArray[np.intp]
    actors: NDArray[np.str_]
    places: NDArray[np.intp]

    @classmethod
    def of(cls, classes: NDArray[np.intp], actors: NDArray[np.str_]) -> People:
        """Find the blocks of windows that stand by class and, within a class, by actor."""
        begins = np.append(True, (classes[1:] != classes[:-1]) | (actors[1:] != actors[:-1]))
        starts = np.flatnonzero(begins)
        counts = np.unique(classes[starts], return_counts=True)[1]
        places = np.full((len(counts), counts.max()), len(starts))
        places[np.arange(counts.max()) < counts[:, None]] = np.arange(len(starts))
        return cls(starts, classes[starts], actors[starts], places)

    def nearest(self, distances: NDArray[np.float32]) -> NDArray[np.float32]:
        """Take the least of each block's distances, (..., windows) to (..., blocks)."""
        nearest: NDArray[np.float32] = np.minimum.reduceat(distances, self.starts, axis=-1)
        return nearest

    def agreed(self, logs: NDArray[np.floating]) -> NDArray[np.float64]:
        """Take the mean of the two least of each class's blocks, (..., blocks) to (..., classes).

        NaN is a block that is not to be counted, and a class that has none.
        """
        padded = np.empty((*logs.shape[:-1], logs.shape[-1] + 1))
        padded[..., :-1] = logs
        padded[..., -1] = np.nan
        by_person = padded.take(self.places, axis=-1)
        # NaN comes last, and of it and a number fmax takes the number.
        by_person.sort(axis=-1)
        first, last = by_person[..., 0], by_person[..., min(_PEOPLE, by_person.shape[-1]) - 1]
        agreed: NDArray[np.float64] = np.fmax(first, last)
        agreed += first
        agreed /= 2
        return agreed
