"""The best score of each class in a large library, without comparing with every motion.

Motions of bodies fill few of their many dimensions: 32 directions hold 99.6 % of HDM05's leading eigenvectors. Split
along such directions, an inner product is that of the parts within plus that of the parts outside, and the latter is no
larger than the two lengths multiplied (Cauchy and Schwarz). A product with the short parts alone therefore says how
large each score may be. The motion of each class that it puts first is compared in full, and of the others only those
that may still be better than that one: after a second look, along more directions, they are few. The scores are those
of the whole comparison, none is missed; only the time is another.

Kept indices of vectors were tried in its place: one for each class, for the best of each is wanted, asked for an axis
and for its opposite. With 200,000 motions in 11 classes, where this takes some 3 ms, faiss 1.15 (HNSW) took 1 to 3.5 ms
and usearch 2.26 1.7 to 5.5 ms, and they found a third to a half of the classes' best; faiss with inverted lists found
94 % in 3 ms and all in 10 ms.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Motions from which a short list is quicker than comparing with every motion: measured, the two are equal at 1,700; at
#: 2,300 the short list takes 70 %, at 20,000 25 %, at 200,000 12 % of the other's time.
FEWEST_MOTIONS = 2000
#: Directions of the first look, and of both: with fewer too many motions have to be looked at again, or compared in
#: full, with more the looks themselves take longer.
DIRECTIONS = 48
_BOTH = 192
#: Motions, evenly spread over the library, that the directions are taken from.
_SAMPLE = 20_000
#: Rounding of a product of short parts in single precision, with room to spare.
_ROUNDING = 1e-5
#: Share of the motions from which a comparison in full costs less than picking them out.
_TOO_MANY = 0.2


class Shortlist:
    """Finds the best score of each class.

    Parameters
    ----------
    axes
        Unit vectors of the motions, shape (motions, pairs), float32, those of a class side by side; kept as they are.
    class_starts
        Index of each class's first motion, ascending from 0.
    """

    def __init__(self, axes: NDArray[np.float32], class_starts: NDArray[np.intp]) -> None:
        self._axes = axes
        self._starts = class_starts
        self._counts = np.diff(class_starts, append=len(axes))
        self._classes = np.repeat(np.arange(len(class_starts)), self._counts)
        sample = axes[:: -(-len(axes) // _SAMPLE)]
        _, vectors = np.linalg.eigh((sample.T @ sample).astype(np.float64))
        strongest = vectors[:, ::-1].astype(np.float32)
        self._first = _Part(axes, strongest[:, :DIRECTIONS])
        self._second = _Part(axes, strongest[:, DIRECTIONS:_BOTH])
        self._outside = _lengths_outside(axes, self._first.within)
        self._outside_both = _lengths_outside(axes, self._first.within, self._second.within)

    def class_scores(self, axes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Give the best score of each class: the largest absolute inner product with its axes.

        Parameters
        ----------
        axes
            Unit vectors, shape (hops, pairs). Several cost less than one by one: the first look is bound by the memory
            that it reads.

        Returns
        -------
        Shape (hops, classes).
        """
        first, second = axes @ self._first.directions, axes @ self._second.directions
        outside, outside_both = _lengths_outside(axes, first), _lengths_outside(axes, first, second)
        looks = first @ self._first.within.T
        each = zip(axes, looks, second, outside.tolist(), outside_both.tolist(), strict=True)
        return np.array([self._best(*one) for one in each])

    def _best(
        self,
        axis: NDArray[np.float32],
        look: NDArray[np.float32],
        second: NDArray[np.float32],
        outside: float,
        outside_both: float,
    ) -> NDArray[np.float32]:
        scores = np.abs(look)
        firsts = np.flatnonzero(scores == np.repeat(np.maximum.reduceat(scores, self._starts), self._counts))
        # Of equals one will do.
        firsts = firsts[np.searchsorted(firsts, self._starts)]
        best: NDArray[np.float32] = np.abs(self._axes[firsts] @ axis)
        least = best - np.float32(_ROUNDING)
        scores += self._outside * np.float32(outside)
        listed = np.flatnonzero(scores >= np.repeat(least, self._counts))
        if len(listed) <= _TOO_MANY * len(scores):
            scores = np.abs(look[listed] + self._second.within[listed] @ second)
            scores += self._outside_both[listed] * np.float32(outside_both)
            listed = listed[scores >= least[self._classes[listed]]]
        if len(listed) > _TOO_MANY * len(look):
            return np.maximum.reduceat(np.abs(self._axes @ axis), self._starts)
        np.maximum.at(best, self._classes[listed], np.abs(self._axes[listed] @ axis))
        return best


class _Part:
    """Some directions, and what of each motion's axis lies along them."""

    def __init__(self, axes: NDArray[np.float32], directions: NDArray[np.float32]) -> None:
        self.directions = np.ascontiguousarray(directions)
        self.within = axes @ self.directions


def _lengths_outside(axes: NDArray[np.float32], *within: NDArray[np.float32]) -> NDArray[np.float32]:
    """Length of what the directions leave of each vector, never too short for rounding."""
    all_squares, *squares_within = (np.einsum("ij,ij->i", each, each, dtype=np.float64) for each in (axes, *within))
    lengths: NDArray[np.float32] = np.sqrt(np.maximum(all_squares - sum(squares_within), 0.0) + 1e-7).astype(np.float32)
    return lengths
