"""The paper's experiment: whether every motion's nearest other motion is of the same class.

Three spaces are compared (Le Naour et al. 2012, section 3 and figure 2): joint-to-joint distances, joint positions as
recorded, and joint rotations as recorded (the AMC's angles, with the root's). In each space a motion's signature is the
first principal axis of its centred numbers.

The spread is another signature: the logarithms of the distances' standard deviations, relative to the body's size and
centred, say which joints move against each other, and by which factor more than others; they have no sign, and a motion
done larger changes all of them alike. Its metric is learned from the motions that may be found: it divides by the
scatter within classes (within-class covariance normalisation, Hatch, Kajarekar and Stolcke 2006), shrunk towards equal
scatter everywhere (Ledoit and Wolf 2004), since there are fewer motions than distances.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from enum import StrEnum
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.distances import distance_rows
from kinespace.library.signature.leading import signature_of, similarity
from kinespace.library.windows.metric import squared_distances
from kinespace.tools.evaluation.scoring.bootstrap import Ratio

#: Added to each standard deviation before the logarithm, relative to the body's size: about a millimetre, a marker's
#: noise. Without it a distance that does not change at all would outweigh all others.
_FLOOR = 0.0015
#: Share of equal scatter in the metric of the spread.
_SHRINKAGE = 0.1
#: Scatter below this share of the largest scatter is only rounding.
_NOTHING = 1e-12


class Space(StrEnum):
    """The numbers that describe a frame."""

    DISTANCES = "distances"
    POSITIONS = "positions"
    ROTATIONS = "rotations"


class SignatureKind(StrEnum):
    """The signature by which two motions are compared."""

    #: The paper's signature: the absolute inner product of the leading eigenvectors.
    EIGENVECTOR = "eigenvector"
    #: The centred log standard deviations, in a metric learned from the motions that may be found.
    SPREAD = "spread"


class Protocol(StrEnum):
    """The motions with which a motion may be compared."""

    LEAVE_ONE_OUT = "leave-one-out"
    ACTOR_HELD_OUT = "actor-held-out"
    SPLIT = "split"


#: The actors of the split in the literature: their motions make the library, the other actors' motions ask.
SPLIT_LIBRARY_ACTORS = ("bd", "bk", "dg")
#: HDM05's actors.
_ACTORS = 5


class Labels(NamedTuple):
    """Class and actor of each motion, each of shape (motions,)."""

    classes: NDArray[np.str_]
    actors: NDArray[np.str_]

    @classmethod
    def of_clips(cls, clips: Sequence[Clip]) -> Labels:
        """Take the labels of some clips."""
        return cls(np.array([clip.class_name for clip in clips]), np.array([clip.actor for clip in clips]))


class Retrieval(NamedTuple):
    """The outcome of one protocol in one space.

    Attributes
    ----------
    asking
        Indices of the motions that asked, shape (asking,).
    right
        Whether the nearest, and whether one of the two nearest, is of their class, shape (asking, 2).
    """

    asking: NDArray[np.intp]
    right: NDArray[np.bool_]

    @property
    def shares(self) -> dict[str, Ratio]:
        """The shares of the motions that asked whose nearest, or one of whose two nearest, is of their class.

        The latter is the paper's 2-nearest-neighbour rate.
        """
        one = [1.0] * len(self.right)
        return {
            name: Ratio(self.right[:, place].tolist(), one) for place, name in enumerate(("nearest", "two_nearest"))
        }

    @property
    def nearest(self) -> float:
        """The first of the shares, 0 to 1."""
        return float(self.right[:, 0].mean())


def signatures_of(clips: Sequence[Clip], space: Space, kind: SignatureKind) -> NDArray[np.float64]:
    """Compute each clip's signature in one space, shape (clips, numbers of a frame).

    Raises
    ------
    ValueError
        A clip has no rotations, and rotations are asked for.
    """
    signature = signature_of if kind is SignatureKind.EIGENVECTOR else spread_of
    return np.array([signature(_rows(clip, space)) for clip in clips])


def spread_of(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the centred log standard deviations of a motion's distances, shape (pairs,); no unit.

    Parameters
    ----------
    rows
        Distance rows, shape (frames, pairs), metres, at least two. The body's size is the root mean square of the mean
        distances.
    """
    size = np.sqrt(np.mean(np.square(rows.mean(axis=0))))
    logs = np.log(rows.std(axis=0, ddof=1) / size + _FLOOR)
    centred: NDArray[np.float64] = logs - logs.mean()
    return centred


def _rows(clip: Clip, space: Space) -> NDArray[np.float64]:
    if space is Space.DISTANCES:
        return distance_rows(clip.positions, clip.skeleton)
    if space is Space.POSITIONS:
        return clip.positions.reshape(clip.frames, -1).astype(np.float64)
    if not clip.rotations.shape[1]:
        raise ValueError(f"space: clip {clip.name!r} has no rotations")
    return clip.rotations


def splits(actors: Collection[str]) -> list[tuple[str, ...]]:
    """List all libraries of three of five actors, which the other two actors ask; empty for other numbers of actors."""
    return list(combinations(sorted(actors), len(SPLIT_LIBRARY_ACTORS))) if len(actors) == _ACTORS else []


def candidates(
    labels: Labels, protocol: Protocol, library_actors: Sequence[str] = SPLIT_LIBRARY_ACTORS
) -> NDArray[np.bool_]:
    """Say which motions (columns) each motion (rows) may find, shape (motions, motions); an empty row does not ask.

    Parameters
    ----------
    labels
        Class and actor of each.
    protocol
        Which motions may be compared with which.
    library_actors
        The actors whose motions make the library of `Protocol.SPLIT`.
    """
    if protocol is Protocol.LEAVE_ONE_OUT:
        return ~np.eye(len(labels.actors), dtype=bool)
    if protocol is Protocol.ACTOR_HELD_OUT:
        return np.not_equal.outer(labels.actors, labels.actors)
    in_library = np.isin(labels.actors, library_actors)
    return ~in_library[:, None] & in_library[None, :]


def retrieve(scores: NDArray[np.floating], labels: Labels, allowed: NDArray[np.bool_]) -> Retrieval:
    """Count how often the nearest motions are of the asking motion's class.

    Parameters
    ----------
    scores
        Similarity of every motion with every other, shape (motions, motions); more is nearer.
    labels
        Class and actor of each.
    allowed
        Which motions each may find, from `candidates`.

    Raises
    ------
    ValueError
        No motion has two others to be compared with (with one actor alone, for instance).
    """
    asking = np.flatnonzero(allowed.sum(axis=1) >= 2)
    if not asking.size:
        raise ValueError("--protocol: expected a motion that may be compared with two others, got none")
    order = np.argsort(-np.where(allowed, scores, -np.inf)[asking], axis=1, kind="stable")
    found, own = labels.classes[order[:, :2]], labels.classes[asking]
    right = np.logical_or.accumulate(found == own[:, None], axis=1)
    return Retrieval(asking, right)


def compare(
    signatures: NDArray[np.float64], kind: SignatureKind, labels: Labels, allowed: NDArray[np.bool_]
) -> NDArray[np.floating]:
    """Score every motion against every other, shape (motions, motions); more is nearer.

    Axes are compared by the absolute inner product, spreads by minus the squared distance. For each motion the spread's
    metric is learned only from the motions that it may find, never from the motion itself.

    Parameters
    ----------
    signatures, kind
        From `signatures_of`.
    labels, allowed
        As for `retrieve`.
    """
    if kind is SignatureKind.EIGENVECTOR:
        return similarity(signatures, signatures.T)
    scores = np.full(allowed.shape, -np.inf)
    known, fold = np.unique(allowed, axis=0, return_inverse=True)
    for index, found in enumerate(known):
        asking = np.flatnonzero(fold.ravel() == index)
        if found.any():
            measured = spread_distances(signatures[asking], signatures[found], labels.classes[found])
            scores[np.ix_(asking, found)] = -measured
    return scores


def spread_distances(
    asking: NDArray[np.float64], found: NDArray[np.float64], classes: NDArray[np.str_]
) -> NDArray[np.float64]:
    """Compare spreads in units of the scatter within classes, each class weighing the same.

    The scatter S of m motions has rank below m, so (1 - s) S + s t I, with t the mean of S's diagonal and s the
    shrinkage, is applied through its m eigenvectors and one number for everything else.

    Parameters
    ----------
    asking, found
        Spreads, shapes (n, pairs) and (m, pairs).
    classes
        The classes of those that are found, shape (m,): they teach the scatter.

    Returns
    -------
    Squared distances, shape (n, m), never below 0.

    Raises
    ------
    ValueError
        No class has two motions that differ.
    """
    names, class_of, sizes = np.unique(classes, return_inverse=True, return_counts=True)
    means = np.array([found[class_of == index].mean(axis=0) for index in range(len(names))])
    within = (found - means[class_of]) / np.sqrt(sizes[class_of] * len(names))[:, None]
    equal = _SHRINKAGE * np.square(within).sum() / within.shape[1]
    if not equal > 0:
        raise ValueError("spreads: expected a class with two motions that differ, got none")
    # The matrix of motions by motions is smaller. Directions whose scatter is only rounding count as none.
    scatter, vectors = np.linalg.eigh(within @ within.T)
    there = scatter > _NOTHING * scatter[-1]
    directions = vectors.T[there] @ within / np.sqrt(scatter[there])[:, None]
    along = directions.T * np.sqrt(1 / equal - 1 / ((1 - _SHRINKAGE) * scatter[there] + equal))
    squared = squared_distances(asking, found) / equal - squared_distances(asking @ along, found @ along)
    return np.asarray(np.maximum(squared, 0.0), dtype=np.float64)
