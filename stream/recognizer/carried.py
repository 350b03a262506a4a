"""The joint pairs and joints that carry a decision: most of the variance along the leading eigenvector is theirs."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Joint pairs that are given, at most.
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


def carried_by(
    given: NDArray[np.floating], pairs: NDArray[np.intp], order: NDArray[np.intp] | None, joints: int
) -> Carried | None:
    """Sum the pairs' shares by joint; negative shares count as 0.

    Parameters
    ----------
    given
        The share of each joint pair (`Recognizer.pair_contributions`), shape (pairs,).
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
    foremost = np.argsort(-given)[:MAX_PAIRS]
    return Carried(
        tuple((shares / (2 * total)).round(_DIGITS).tolist()),
        tuple((first, second) for first, second in ends[foremost].tolist()),
    )
