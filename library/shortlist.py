"""The best score of each class in a large library, without comparing with every motion.

Motions of bodies fill few of their many dimensions: 32 directions hold 99.6 % of HDM05's leading eigenvectors. Split
along such directions, an inner product is that of the parts within plus that of the parts outside, and the latter is no
larger than the two lengths multiplied (Cauchy and Schwarz). A product with the short parts alone therefore says how
large each score may be. The motion of each class that it puts first is compared in full, and of the others only those
that may still be better than that one: after two more looks, along more directions each, they are few. The scores are
those of the whole comparison, none is missed; only the time is another.

Kept indices of vectors were tried in its place: one for each class, for the best of each is wanted, asked for an axis
and for its opposite. With 200,000 motions in 11 classes, where this takes some 3 ms, faiss 1.15 (HNSW) took 1 to 3.5 ms
and usearch 2.26 1.7 to 5.5 ms, and they found a third to a half of the classes' best; faiss with inverted lists found
94 % in 3 ms and all in 10 ms.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

#: Motions from which a short list is quicker than comparing with every motion: measured, the two are equal at 1,700; at
#: 2,300 the short list takes 70 %, at 20,000 20 %, at 200,000 10 % of the other's time.
FEWEST_MOTIONS = 2000
#: Directions of the first look, of the first two, and so on: with fewer too many motions have to be looked at again, or
#: compared in full, with more the looks themselves take longer.
DIRECTIONS = (24, 64, 192)
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
        self._looks = [_Look(strongest[:, a:b]) for a, b in pairwise((0, *DIRECTIONS))]
        within = [look.of(axes) for look in self._looks]
        self._outside = _lengths_outside(axes, within)
        # The first look reads all of its numbers: direction by direction in half the time.
        self._first, *self._later = np.ascontiguousarray(within[0].T), *within[1:]

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
        within = [look.of(axes) for look in self._looks]
        outside = _lengths_outside(axes, within)
        firsts = within[0] @ self._first
        return np.array(
            [
                self._best(axis, first, [each[hop] for each in within], [each[hop] for each in outside])
                for hop, (axis, first) in enumerate(zip(axes, firsts, strict=True))
            ]
        )

    def _best(
        self,
        axis: NDArray[np.float32],
        first: NDArray[np.float32],
        within: Sequence[NDArray[np.float32]],
        outside: Sequence[np.float32],
    ) -> NDArray[np.float32]:
        """Give the best score of each class for one axis, of which the first look is known."""
        scores = np.abs(first)
        likely = np.flatnonzero(scores == np.repeat(np.maximum.reduceat(scores, self._starts), self._counts))
        # Of equals one will do.
        likely = likely[np.searchsorted(likely, self._starts)]
        best: NDArray[np.float32] = np.abs(self._axes[likely] @ axis)
        least = best - np.float32(_ROUNDING)
        scores += self._outside[0] * outside[0]
        listed = np.flatnonzero(scores >= np.repeat(least, self._counts))
        seen = first[listed]
        looks = zip(self._later, within[1:], self._outside[1:], outside[1:], strict=True)
        for theirs, ours, theirs_outside, ours_outside in looks:
            seen += theirs[listed] @ ours
            doubt = theirs_outside[listed] * ours_outside
            may_be = np.abs(seen) + doubt >= least[self._classes[listed]]
            listed, seen = listed[may_be], seen[may_be]
        if len(listed) > _TOO_MANY * len(first):
            return np.maximum.reduceat(np.abs(self._axes @ axis), self._starts)
        np.maximum.at(best, self._classes[listed], np.abs(self._axes[listed] @ axis))
        return best


class _Look:
    """Some directions, along which axes are looked at."""

    def __init__(self, directions: NDArray[np.float32]) -> None:
        self._directions = np.ascontiguousarray(directions)

    def of(self, axes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Give what of axes, (n, pairs), lies along the directions, (n, directions)."""
        within: NDArray[np.float32] = axes @ self._directions
        return within


def _lengths_outside(axes: NDArray[np.float32], within: Sequence[NDArray[np.float32]]) -> list[NDArray[np.float32]]:
    """Length of what each look and those before it leave of each vector, never too short for rounding."""
    left, *squares = (np.einsum("ij,ij->i", each, each, dtype=np.float64) for each in (axes, *within))
    lengths = []
    for square in squares:
        left = left - square
        lengths.append(np.sqrt(np.maximum(left, 0.0) + 1e-7).astype(np.float32))
    return lengths
