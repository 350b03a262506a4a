"""The joint pairs and joints that carry a decision: most of the variance along the leading eigenvector is theirs."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Joint pairs that are told, at most.
MAX_PAIRS = 6
_DIGITS = 4


class Carried(NamedTuple):
    """The shares of joints and joint pairs in the variance along a leading eigenvector.

    Attributes
    ----------
    joints
        Share of each joint, 0 to 1, sum 1: half of the shares of its pairs.
    pairs
        Indices of the joints of the pairs that give most, the foremost first.
    """

    joints: tuple[float, ...]
    pairs: tuple[tuple[int, int], ...]


def contributions(rows: NDArray[np.floating], weights: NDArray[np.floating]) -> NDArray[np.float64]:
    """Give the share of each distance in the variance of rows along weights.

    The variance along w is the sum over the distances of w times their covariance with the rows along w. A distance
    that works against the others gives less than nothing.

    Parameters
    ----------
    rows
        Distance rows of a window, shape (frames, pairs).
    weights
        Number of each distance, shape (pairs,).

    Returns
    -------
    Shape (pairs,); their sum is (frames - 1) times the variance.
    """
    centred = rows - rows.mean(axis=0)
    given: NDArray[np.float64] = weights * ((centred @ weights) @ centred)
    return given


def carried_by(
    given: NDArray[np.floating], pairs: NDArray[np.intp], order: NDArray[np.intp] | None, joints: int
) -> Carried | None:
    """Sum the pairs' shares by joint; negative shares count as 0.

    Parameters
    ----------
    given
        The share of each joint pair (`contributions`), shape (pairs,).
    pairs
        The joints of each pair in the library's skeleton, shape (pairs, 2).
    order
        Index of each of the library's joints among the frame's; None: they are the same.
    joints
        The number of joints in a frame.

    Returns
    -------
    Shares and pairs in the frame's own order; None when no pair gives anything.
    """
    given = np.maximum(given, 0.0)
    total = float(given.sum())
    if not total > 0:
        return None
    ends = pairs if order is None else order[pairs]
    shares = np.bincount(ends[:, 0], given, joints) + np.bincount(ends[:, 1], given, joints)
    most = min(MAX_PAIRS, len(given))
    foremost = np.argpartition(given, -most)[-most:]
    foremost = foremost[np.argsort(-given[foremost])]
    return Carried(
        tuple((shares / (2 * total)).round(_DIGITS).tolist()),
        tuple((first, second) for first, second in ends[foremost].tolist()),
    )
