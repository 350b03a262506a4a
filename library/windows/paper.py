"""The paper's signature for windows: the leading eigenvector of the unweighted covariance, by |inner products|."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Self

import numpy as np

from kinespace.library.windows.index import Blocks, learned_basis, measured_clips, teacher_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.basis import Basis

from kinespace.library.distances import distance_rows
from kinespace.library.windows.cutting import eigenpairs_of, window_covariances


@dataclass(frozen=True, slots=True, eq=False)
class PaperIndex:
    """The leading eigenvectors of a library's windows of one length (Le Naour et al. 2012, section 3).

    Attributes
    ----------
    seconds
        Length of the windows.
    basis
        An orthonormal basis of distance space without weights: it holds `basis.share` of the variance.
    eigenvectors
        Unit length, in the basis, shape (windows, directions), float32.
    classes
        Class names, sorted.
    """

    seconds: float
    basis: Basis
    eigenvectors: NDArray[np.float32] = field(repr=False)
    classes: tuple[str, ...]
    blocks: Blocks = field(repr=False)

    @classmethod
    def of(cls, library: MotionLibrary, seconds: float) -> Self:
        """Cut a library's motions into windows and take the leading eigenvector of each.

        Raises
        ------
        ValueError
            No motion is long enough for a window.
        """
        basis = learned_basis(teacher_of(library), weighted=False)
        clips, ends, motions = measured_clips(library)
        covariances = np.concatenate(
            [
                window_covariances(distance_rows(clip.positions, clip.skeleton) @ basis.directions, clip, end, seconds)
                for clip, end in zip(clips, ends, strict=True)
            ]
        )
        names = [library.motions[each].class_name for each in motions]
        classes = tuple(sorted(set(names)))
        people = [library.motions[each].actor for each in motions]
        vectors = eigenpairs_of(covariances).vectors[:, 0].astype(np.float32)
        return cls(seconds, basis, vectors, classes, Blocks.of(np.searchsorted(classes, names), people))

    def scores(self, eigenvector: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give each class's best |inner product|, the mean over its two best persons; shape (classes,), 0 to 1."""
        products = -np.abs(self.eigenvectors @ eigenvector.astype(np.float32))
        return -self.blocks.agreed(self.blocks.nearest(products))


@lru_cache(maxsize=4)
def opened_by_paper(library: MotionLibrary, seconds: float) -> PaperIndex:
    """Give the eigenvectors of a library's windows; several recognisers of one library share them."""
    return PaperIndex.of(library, seconds)
