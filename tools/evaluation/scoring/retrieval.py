"""The paper's experiment: whether every motion's nearest other motion is of the same class.

Three spaces are compared (Le Naour et al. 2012, section 3 and figure 2): joint-to-joint distances, joint positions as
recorded, and joint rotations as recorded (the AMC's angles, with the root's). In each space a motion's signature is the
first principal axis of its numbers, read in two ways: centred, or as they are (`signature_of`).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from enum import StrEnum
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Clip, distance_rows, signature_of
from kinespace.tools.evaluation.scoring.bootstrap import Ratio


class Space(StrEnum):
    """The numbers that describe a frame."""

    DISTANCES = "distances"
    POSITIONS = "positions"
    ROTATIONS = "rotations"


class SignatureKind(StrEnum):
    """The paper's signature, in its two readings: motions are compared by the absolute inner product."""

    #: The leading eigenvector of the covariance: the numbers are centred.
    EIGENVECTOR = "eigenvector"
    #: The first singular vector of the numbers as they are.
    RAW = "raw"


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
    found
        Indices of the nearest and the second nearest motion of each, shape (asking, 2).
    products
        Their similarity, shape (asking, 2).
    right
        Whether the nearest, and whether one of the two nearest, is of their class, shape (asking, 2).
    """

    asking: NDArray[np.intp]
    found: NDArray[np.intp]
    products: NDArray[np.floating]
    right: NDArray[np.bool_]

    @property
    def shares(self) -> dict[str, Ratio]:
        """The shares of the motions that asked whose nearest, or one of whose two nearest, is of their class.

        The latter is the paper's 2-nearest-neighbour rate.
        """
        one, both = [1.0] * len(self.right), zip(("nearest", "two_nearest"), self.right.T.tolist(), strict=True)
        return {name: Ratio(right, one) for name, right in both}

    @property
    def nearest(self) -> float:
        """The first of the shares, 0 to 1."""
        return float(self.right[:, 0].mean())

    def confusion(self, labels: Labels) -> tuple[list[str], NDArray[np.float64]]:
        """Give the classes that asked or were found, and the paper's figure 2 of them, shape (classes, classes).

        In row i and column j stands the share of the motions of class i whose nearest motion is of class j; a row of
        zeros is of a class of which no motion asked.
        """
        classes, codes = np.unique(labels.classes, return_inverse=True)
        counts = np.zeros((len(classes), len(classes)))
        np.add.at(counts, (codes[self.asking], codes[self.found[:, 0]]), 1.0)
        return classes.tolist(), counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)


def signatures_of(clips: Sequence[Clip], space: Space, kind: SignatureKind) -> NDArray[np.float64]:
    """Compute each clip's signature in one space, shape (clips, numbers of a frame).

    Raises
    ------
    ValueError
        A clip has no rotations, and rotations are asked for.
    """
    return np.array([signature_of(_rows(clip, space), centred=kind is SignatureKind.EIGENVECTOR) for clip in clips])


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


def retrieve(products: NDArray[np.floating], labels: Labels, allowed: NDArray[np.bool_]) -> Retrieval:
    """Find the two nearest motions of each, and whether they are of the asking motion's class.

    Parameters
    ----------
    products
        Of every motion with every other, shape (motions, motions), from `similarity`.
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
    nearest = np.where(allowed, products, -np.inf)[asking]
    found = np.argsort(-nearest, axis=1, kind="stable")[:, :2]
    right = np.logical_or.accumulate(labels.classes[found] == labels.classes[asking][:, None], axis=1)
    return Retrieval(asking, found, np.take_along_axis(nearest, found, axis=1), right)
