"""The paper's experiment: whether every motion's nearest other motion is of the same class.

Three spaces are compared (Le Naour et al. 2012, section 3 and figure 2): joint-to-joint distances, joint positions as
recorded, and joint rotations as recorded (the AMC's angles, with the root's). In each space a motion's signature is the
first principal axis of its centred numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library.distances import distance_rows
from kinespace.library.windows.signature import signature_of, similarity
from kinespace.tools.evaluation.retrieval.spread import SpreadMetric, spread_of

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from kinespace.library.clip import Clip


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
#: The number of these among HDM05's five actors.
_ACTORS, _LIBRARY_ACTORS = 5, 3


class Labels(NamedTuple):
    """Class and actor of each motion, each of shape (motions,)."""

    classes: NDArray[np.str_]
    actors: NDArray[np.str_]

    @classmethod
    def of_clips(cls, clips: Sequence[Clip]) -> Labels:
        """Take the labels of some clips."""
        return cls(np.array([clip.class_name for clip in clips]), np.array([clip.actor for clip in clips]))


@dataclass(frozen=True, slots=True, eq=False)
class Retrieval:
    """The outcome of one protocol in one space.

    Attributes
    ----------
    motions
        How many motions asked.
    nearest
        Share of the asking motions whose nearest neighbour is of their class, 0 to 1.
    two_nearest
        Share of the asking motions with one of the two nearest of their class: the paper's 2-nearest-neighbour rate.
    classes
        Class names, sorted.
    confusion
        Shape (classes, classes): entry (i, j) is the share of class i's motions whose nearest is of class j; rows of
        classes that never asked are zero.
    asking
        Indices of the motions that asked, shape (asking,).
    right
        Whether the nearest, and whether one of the two nearest, is of their class, shape (asking, 2).
    """

    motions: int
    nearest: float
    two_nearest: float
    classes: tuple[str, ...]
    confusion: NDArray[np.float64] = field(repr=False)
    asking: NDArray[np.intp] = field(repr=False)
    right: NDArray[np.bool_] = field(repr=False)


def motion_axes(clips: Sequence[Clip], space: Space) -> NDArray[np.float64]:
    """Find the first principal axis of each clip in one space, shape (clips, numbers of a frame).

    Raises
    ------
    ValueError
        A clip has no rotations, and rotations are asked for.
    """
    return np.array([signature_of(_rows(clip, space)) for clip in clips])


def motion_spreads(clips: Sequence[Clip]) -> NDArray[np.float64]:
    """Find the spread of each clip's distances, shape (clips, pairs)."""
    return np.array([spread_of(_rows(clip, Space.DISTANCES)) for clip in clips])


def _rows(clip: Clip, space: Space) -> NDArray[np.float64]:
    match space:
        case Space.DISTANCES:
            return distance_rows(clip.positions, clip.skeleton)
        case Space.POSITIONS:
            return clip.positions.reshape(clip.frames, -1)
        case Space.ROTATIONS:
            if not clip.rotations.shape[1]:
                raise ValueError(f"space: clip {clip.name!r} has no rotations")
            return clip.rotations


def turned(clip: Clip, generator: np.random.Generator) -> Clip:
    """Turn a motion to a random heading (about the vertical, y) and move it to a random place within a metre or so."""
    angle = generator.uniform(0, 2 * np.pi)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    shift = generator.normal(size=3) * [1, 0, 1]
    return clip.moved_to(clip.positions @ turn.T + shift)


def splits(actors: Collection[str]) -> list[tuple[str, ...]]:
    """List all libraries of three of five actors, which the other two actors ask; empty for other numbers of actors."""
    return list(combinations(sorted(actors), _LIBRARY_ACTORS)) if len(actors) == _ACTORS else []


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
    different = ~np.eye(len(labels.actors), dtype=bool)
    match protocol:
        case Protocol.LEAVE_ONE_OUT:
            return different
        case Protocol.ACTOR_HELD_OUT:
            return np.not_equal.outer(labels.actors, labels.actors)
        case Protocol.SPLIT:
            in_library = np.isin(labels.actors, library_actors)
            return ~in_library[:, None] & in_library[None, :]


def retrieve(
    scores: NDArray[np.floating],
    labels: Labels,
    protocol: Protocol,
    library_actors: Sequence[str] = SPLIT_LIBRARY_ACTORS,
) -> Retrieval:
    """Count how often the nearest motions are of the asking motion's class.

    Parameters
    ----------
    scores
        Similarity of every motion with every other, shape (motions, motions); more is nearer.
    labels, protocol, library_actors
        The protocol, as `candidates` takes it.

    Raises
    ------
    ValueError
        A motion has no other to be compared with (with one actor alone, for instance), or scores and labels do not fit.
    """
    count = len(labels.classes)
    if scores.shape != (count, count):
        raise ValueError(f"scores: expected ({count}, {count}), got {scores.shape}")
    allowed = candidates(labels, protocol, library_actors)
    asking = np.flatnonzero(allowed.sum(axis=1) >= 2)
    if not asking.size:
        raise ValueError(f"protocol: {protocol} leaves no motion two others to be compared with")
    order = np.argsort(-np.where(allowed, scores, -np.inf)[asking], axis=1, kind="stable")
    found, own = labels.classes[order[:, :2]], labels.classes[asking]
    right = np.logical_or.accumulate(found == own[:, None], axis=1)
    classes = np.unique(labels.classes)
    confusion = np.zeros((len(classes), len(classes)))
    np.add.at(confusion, (np.searchsorted(classes, own), np.searchsorted(classes, found[:, 0])), 1.0)
    totals = confusion.sum(axis=1, keepdims=True)
    return Retrieval(
        motions=len(asking),
        nearest=float(right[:, 0].mean()),
        two_nearest=float(right[:, 1].mean()),
        classes=tuple(classes.tolist()),
        confusion=np.divide(confusion, totals, out=confusion, where=totals > 0),
        asking=asking,
        right=right,
    )


def compare(axes: NDArray[np.float64]) -> NDArray[np.floating]:
    """Score every motion against every other by the absolute inner product, shape (motions, motions)."""
    return similarity(axes, axes.T)


def compare_spreads(
    spreads: NDArray[np.float64],
    labels: Labels,
    protocol: Protocol,
    library_actors: Sequence[str] = SPLIT_LIBRARY_ACTORS,
) -> NDArray[np.float64]:
    """Score every motion against every other by the spread.

    For each motion the metric is learned only from the motions that the protocol lets it find, never from the motion
    itself.

    Parameters
    ----------
    spreads
        Shape (motions, pairs).
    labels, protocol, library_actors
        The protocol, as `candidates` takes it.

    Returns
    -------
    Minus the squared distance, shape (motions, motions): more is nearer.
    """
    allowed = candidates(labels, protocol, library_actors)
    scores = np.full(allowed.shape, -np.inf)
    known, fold = np.unique(allowed, axis=0, return_inverse=True)
    for index, found in enumerate(known):
        asking = np.flatnonzero(fold.ravel() == index)
        if found.any():
            metric = SpreadMetric.learned(spreads[found], labels.classes[found])
            scores[np.ix_(asking, found)] = -metric.squared_distances(spreads[asking], spreads[found])
    return scores
