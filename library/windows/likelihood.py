"""How much likelier two windows are the same motion by two people than any two movements: a log-likelihood ratio.

Along each axis of a metric windows vary by t among all movement, and by w between two people in the same motion, so the
same motion shares b = t − w (the two-covariance model of speaker verification: Prince and Elder 2007; Brümmer and de
Villiers 2010). With c = b / (t² − b²) and a = t / (t² − b²) − 1 / t, two windows q and l have the log-likelihood ratio

    Σ c q l − ½ Σ a (q² + l²) − ½ Σ log((t² − b²) / t²).

So a match near the middle of all movement says little, and one far from it much, even where one example is all that is
known of a motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from kinespace.library.windows.comparison import MAX_AXES

Numbers = NDArray[np.float64]

#: Variance of everyday movement along a metric's first axis; along the k-th it is √k times less. Metrics are scaled
#: alike, and order their axes: CMU's everyday movement varies so, whatever taught them (tests/TRIED.md).
_EVERYDAY = 0.05
#: Between two people in the same motion windows vary by 1 over `MAX_AXES`, as metrics are scaled, but along none by
#: more than this share of all variance.
_MOST_WITHIN = 0.8
#: The ratio is counted in units of so many, so that a lead counts up to `rejection.MAX_LEAD`.
UNIT = 5.0


class Likelihood(NamedTuple):
    """A library's windows, ready for the ratio: in units, the mean over the groups that have a metric, and negative.

    Attributes
    ----------
    products
        What is multiplied with a live window's vectors, shape (windows, axes of all groups).
    squares
        What is multiplied with their squares, shape (axes of all groups,).
    constants
        What is added for each window, shape (windows,).
    starts
        Where each class's windows start, shape (classes,).
    """

    products: NDArray[np.float32]
    squares: NDArray[np.float32]
    constants: NDArray[np.float32]
    starts: NDArray[np.intp]

    @classmethod
    def of(cls, vectors: Sequence[NDArray[np.floating]], starts: NDArray[np.intp]) -> Self:
        """Prepare windows.

        Parameters
        ----------
        vectors
            For each group the windows' vectors, as in `WindowIndex`.
        starts
            Where each class's windows start.
        """
        # Scaled eigenvectors have no metric.
        count = UNIT * max(sum(each.ndim == 2 for each in vectors), 1)
        products, squares, constants = list["Numbers"](), list["Numbers"](), np.zeros(len(vectors[0]))
        for each in vectors:
            if each.ndim == 2:
                shared, own, constant = factors(each.shape[1])
                wide = each.astype(np.float64)
                products.append(wide * -shared / count)
                squares.append(own / (2 * count))
                constants += np.square(wide) @ squares[-1] + constant / count
            else:
                products.append(np.zeros((len(each), each[0].size)))
                squares.append(np.zeros(each[0].size))
        joined = np.concatenate(products, axis=1, dtype=np.float32), np.concatenate(squares, dtype=np.float32)
        return cls(*joined, constants.astype(np.float32), starts)

    def of_window(self, vectors: Sequence[NDArray[np.float32]]) -> Numbers:
        """Compare a window's vectors of all groups with each class, shape (classes,)."""
        asked = np.concatenate([each.ravel() for each in vectors])
        ratios = self.products @ asked
        ratios += self.constants
        found: Numbers = np.minimum.reduceat(ratios, self.starts).astype(np.float64)
        return found + float(self.squares @ np.square(asked))


def factors(axes: int) -> tuple[Numbers, Numbers, float]:
    """Give c and a along each of so many axes, and ½ Σ log((t² − b²) / t²)."""
    whole = _EVERYDAY / np.sqrt(np.arange(1, axes + 1))
    shared = whole - np.minimum(1 / MAX_AXES, _MOST_WITHIN * whole)
    left = np.square(whole) - np.square(shared)
    return shared / left, whole / left - 1 / whole, 0.5 * float(np.log(left / np.square(whole)).sum())
