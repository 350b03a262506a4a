"""The best score of each class in a large library, without comparing with every motion.

Motions of bodies fill few of their many dimensions: 32 directions hold 99.6 % of HDM05's leading eigenvectors. Split
along such directions, an inner product is that of the parts within plus that of the parts outside, and the latter is no
larger than the two lengths multiplied (Cauchy and Schwarz). A product with the short parts alone therefore says how
large each score may be. The motion of each class that it puts first is compared in full, and of the others only those
that may still be better than that one: after two more looks, along more directions each, they are few. The scores are
those of the whole comparison, none is missed; only the time is another.

Kept indices of vectors were tried in its place: one for each class, for the best of each is wanted, asked for an axis
and for its opposite. With 200,000 motions in 11 classes, where this takes some 3 ms and compiled half of that, faiss
1.15 (HNSW) took 1 to 3.5 ms and usearch 2.26 1.7 to 5.5 ms, and they found a third to a half of the classes' best;
faiss with inverted lists found 94 % in 3 ms and all in 10 ms.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from library import compiled

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

#: Motions from which a short list is quicker than comparing with every motion: measured, the two are equal at 1,700,
#: compiled at 1,200; at 20,000 the short list takes 20 %, compiled 13 %, of the other's time.
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
        self._classes = np.repeat(np.arange(len(class_starts)), np.diff(class_starts, append=len(axes)))
        sample = axes[:: -(-len(axes) // _SAMPLE)]
        _, vectors = np.linalg.eigh((sample.T @ sample).astype(np.float64))
        strongest = vectors[:, ::-1].astype(np.float32)
        self._looks = [_Look(strongest[:, a:b]) for a, b in pairwise((0, *DIRECTIONS))]
        within = [look.of(axes) for look in self._looks]
        self._outside = _lengths_outside(axes, within)
        loops = compiled.loops
        self._first: _FirstLook | _CompiledFirstLook = (
            _CompiledFirstLook(loops, within[0], self._outside[0], class_starts)
            if loops
            else _FirstLook(within[0], self._outside[0], class_starts)
        )
        self._later = within[1:]

    def __reduce__(self) -> tuple[type[Shortlist], tuple[NDArray[np.float32], NDArray[np.intp]]]:
        """Say how to make another: a copy, or one in another process, looks at memory of its own."""
        return Shortlist, (self._axes, self._starts)

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
        return np.array(
            [
                self._best(axis, products, [each[hop] for each in within], [each[hop] for each in outside])
                for hop, (axis, products) in enumerate(zip(axes, self._first.products(within[0]), strict=True))
            ]
        )

    def _best(
        self,
        axis: NDArray[np.float32],
        products: NDArray[np.float32],
        within: Sequence[NDArray[np.float32]],
        outside: Sequence[np.float32],
    ) -> NDArray[np.float32]:
        """Give the best score of each class for one axis, of which the first look's products are known."""
        best: NDArray[np.float32] = np.abs(self._axes[self._first.likely(products)] @ axis)
        least = best - np.float32(_ROUNDING)
        listed = self._first.listed(products, least, outside[0])
        seen, rounded = products[listed], self._first.rounded[listed]
        looks = zip(self._later, within[1:], self._outside[1:], outside[1:], strict=True)
        for theirs, ours, theirs_outside, ours_outside in looks:
            _add_products(theirs, ours, listed, seen)
            doubt = theirs_outside[listed] * ours_outside + rounded
            may_be = np.abs(seen) + doubt >= least[self._classes[listed]]
            listed, seen, rounded = listed[may_be], seen[may_be], rounded[may_be]
        if len(listed) > _TOO_MANY * len(products):
            return np.maximum.reduceat(np.abs(self._axes @ axis), self._starts)
        scores = np.zeros(len(listed), dtype=np.float32)
        _add_products(self._axes, axis, listed, scores)
        np.maximum.at(best, self._classes[listed], np.abs(scores))
        return best


def _add_products(
    rows: NDArray[np.float32], vector: NDArray[np.float32], listed: NDArray[np.intp], sums: NDArray[np.float32]
) -> None:
    """Add to sums, (listed,), the products of a vector with some rows."""
    if compiled.loops:
        compiled.loops.add_products(rows, vector, listed, sums)
    else:
        sums += rows[listed] @ vector


class _FirstLook:
    """The look at all motions.

    Parameters
    ----------
    within, outside
        What of their axes lies along its directions, (motions, directions), and the length of the rest, (motions,).
    class_starts
        Index of each class's first motion.

    Attributes
    ----------
    rounded
        How much a product may be off by rounding, (motions,).
    """

    def __init__(
        self, within: NDArray[np.float32], outside: NDArray[np.float32], class_starts: NDArray[np.intp]
    ) -> None:
        # All of the numbers are read: direction by direction in half the time.
        self._within = np.ascontiguousarray(within.T)
        self._outside = outside
        self._starts = class_starts
        self._counts = np.diff(class_starts, append=len(within))
        self.rounded: NDArray[np.float32] = np.broadcast_to(np.float32(0), len(within))

    def products(self, within: NDArray[np.float32]) -> Iterable[NDArray[np.float32]]:
        """Give the products of axes, (hops, directions), with all motions': each (motions,), good until the next."""
        products: NDArray[np.float32] = within @ self._within
        return products

    def likely(self, products: NDArray[np.float32]) -> NDArray[np.intp]:
        """Give the motion of each class with the largest of these products, (classes,)."""
        scores = np.abs(products)
        likely = np.flatnonzero(scores == np.repeat(np.maximum.reduceat(scores, self._starts), self._counts))
        # Of equals one will do.
        return likely[np.searchsorted(likely, self._starts)]

    def listed(
        self, products: NDArray[np.float32], least: NDArray[np.float32], outside: np.float32
    ) -> NDArray[np.intp]:
        """List the motions that may score the least of their class, (classes,), or more; good until the next."""
        scores = np.abs(products)
        scores += self._outside * outside
        return np.flatnonzero(scores >= np.repeat(least, self._counts))


class _CompiledFirstLook:
    """The same, compiled, from numbers in half precision: half as much to read."""

    def __init__(
        self,
        loops: compiled.Loops,
        within: NDArray[np.float32],
        outside: NDArray[np.float32],
        class_starts: NDArray[np.intp],
    ) -> None:
        halves = within.astype(np.float16)
        # The axis asked for is of unit length, so that this is the most by which a product may be off.
        self.rounded = np.sqrt(np.square(within - halves).sum(axis=1))
        self._look = loops.Look(halves, outside, self.rounded, class_starts)
        self._products = np.empty(len(within), dtype=np.float32)
        self._likely = np.empty(len(class_starts), dtype=np.intp)
        self._listed = np.empty(len(within), dtype=np.intp)

    def products(self, within: NDArray[np.float32]) -> Iterable[NDArray[np.float32]]:
        """Give the products, as `_FirstLook` does."""
        for axis in within:
            self._look.products(axis, self._products, self._likely)
            yield self._products

    def likely(self, products: NDArray[np.float32]) -> NDArray[np.intp]:  # noqa: ARG002 - found with the products
        """Give the motion of each class with the largest of the last products."""
        return self._likely

    def listed(
        self, products: NDArray[np.float32], least: NDArray[np.float32], outside: np.float32
    ) -> NDArray[np.intp]:
        """List the motions, as `_FirstLook` does."""
        return self._listed[: self._look.listed(products, least, float(outside), self._listed)]


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
