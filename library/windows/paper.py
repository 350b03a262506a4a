"""The paper's signature, to be read beside the article: Le Naour, Courty and Gibet (2012), sections 2 and 3.

A posture is all distances between joints (equation 1: `library.distances`). A motion is the leading eigenvector of
their covariance over time, and two motions are as alike as the inner product of these vectors.

Live, a window is compared in place of a whole motion, by the leading eigenvector of its covariance in the basis
(`Settings.signature`). Where several persons perform a class, the mean of the two nearest counts.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.signature.basis import leading_eigenvectors
from kinespace.library.signature.parts import Kind, Part
from kinespace.library.windows.comparer import Comparer, Distances, agreed
from kinespace.library.windows.comparison import FIRST_WINDOW, Weighing

#: Added to 1 − product² before the logarithm.
_SAME = 1e-3


def signature_of(rows: NDArray[np.float64], *, centred: bool = True) -> NDArray[np.float64]:
    """Find the leading eigenvector of the rows' covariance (Le Naour et al. 2012, section 3).

    The paper says PCA, which centres the rows, and "the first eigen vector extracted through a singular value
    decomposition applied to" the rows, which does not: then it is the first right singular vector of the rows as they
    are, and says mostly how the body stands.

    Parameters
    ----------
    rows
        Distance rows of a motion, shape (frames, pairs), at least two frames; other numbers of each frame work as well.
    centred
        Whether the rows' mean is taken off first.

    Returns
    -------
    Unit vector, shape (pairs,). Its sign is arbitrary; `similarity` ignores signs. Where nothing moves, any unit
    vector.

    Raises
    ------
    ValueError
        The rows are not a matrix of at least two frames.
    """
    if rows.ndim != 2 or len(rows) < 2:
        raise ValueError(f"rows: expected (frames, pairs) with at least two frames, got {rows.shape}")
    about = rows - rows.mean(axis=0) if centred else rows
    frames, pairs = about.shape
    if pairs <= frames:
        return leading_eigenvectors(about.T @ about, 1)[1][:, 0]
    # X = UΣVᵀ: the leading row of Vᵀ is uᵀX up to its length. u is the leading eigenvector of X Xᵀ, the smaller matrix.
    axis: NDArray[np.float64] = leading_eigenvectors(about @ about.T, 1)[1][:, 0] @ about
    length = float(np.linalg.norm(axis))
    return axis / length if length > 0 else np.full(pairs, pairs**-0.5)


def similarity(axes: NDArray[np.floating], axis: NDArray[np.floating]) -> NDArray[np.floating]:
    """Compare unit eigenvectors by the inner product (Le Naour et al. 2012, section 3), as its absolute value.

    The sign of an eigenvector is arbitrary, so the sign of the product says nothing.

    Parameters
    ----------
    axes
        Shape (motions, pairs).
    axis
        Shape (pairs,), or (pairs, windows) for several at once.

    Returns
    -------
    0 (unlike) to 1 (the same axis), shape (motions,) or (motions, windows).
    """
    product: NDArray[np.floating] = np.abs(axes @ axis)
    return product


def by_paper(seconds: float) -> Weighing:
    """Compare windows of so many seconds by the leading eigenvector alone."""
    group = (Part(Kind.EIGEN, seconds),)
    return Weighing((group,), blends=((1.0,),), first=FIRST_WINDOW, eigenvectors=1, as_in_paper=True)


class PaperComparer(NamedTuple):
    """A library's windows as the paper compares them.

    Attributes
    ----------
    windows
        The library's windows; only their leading eigenvectors, classes and persons are used.
    """

    windows: Comparer

    def distances(self, leading: NDArray[np.float32]) -> list[Distances]:
        """Compare some windows by their leading eigenvectors, (asked, directions).

        Matrices of one eigenvector each have the squared distance 2 (1 − product²). So a class's log distance is the
        logarithm of 1 − product², where product is the mean of its two nearest persons'.
        """
        windows = self.windows
        products = similarity(leading, windows.eigenvectors)
        scores = np.maximum.reduceat(products, windows.classes, axis=1).astype(np.float64)
        agreeing = np.maximum(agreed(-products, windows.starts, windows.persons), -1.0)
        named = np.log1p(_SAME - np.square(agreeing))
        # Nothing judges a guess: the paper knows no unknown motion.
        none = np.empty((0, named.shape[1]))
        return [Distances(each[None], own, none, best) for each, own, best in zip(agreeing, named, scores, strict=True)]
