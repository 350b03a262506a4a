"""What carries a decision: the joints, and the joint pairs, that weigh most in the leading eigenvector."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Joint pairs that are told, at most.
MAX_PAIRS = 6
_DIGITS = 4


class Carried(NamedTuple):
    """The weight of joints and joint pairs in a leading eigenvector.

    Attributes
    ----------
    joints
        Share of each joint, 0 to 1, sum 1: half of the squared weights of its pairs.
    pairs
        Indices of the joints of the pairs that weigh most, the heaviest first.
    """

    joints: tuple[float, ...]
    pairs: tuple[tuple[int, int], ...]


def carried_by(
    weights: NDArray[np.floating], pairs: NDArray[np.intp], order: NDArray[np.intp] | None, joints: int
) -> Carried | None:
    """Sum up an eigenvector's weights by joint.

    Parameters
    ----------
    weights
        The eigenvector's number of each joint pair, shape (pairs,).
    pairs
        The joints of each pair in the library's skeleton, shape (pairs, 2).
    order
        Index of each of the library's joints among the frame's; None: they are the same.
    joints
        The number of joints in a frame.

    Returns
    -------
    Shares and pairs in the frame's own order; None when all weights are 0.
    """
    squares = np.square(weights)
    total = float(squares.sum())
    if not total > 0:
        return None
    ends = pairs if order is None else order[pairs]
    shares = np.bincount(ends[:, 0], squares, joints) + np.bincount(ends[:, 1], squares, joints)
    most = min(MAX_PAIRS, len(squares))
    heaviest = np.argpartition(squares, -most)[-most:]
    heaviest = heaviest[np.argsort(-squares[heaviest])]
    return Carried(
        tuple((shares / (2 * total)).round(_DIGITS).tolist()),
        tuple((first, second) for first, second in ends[heaviest].tolist()),
    )
