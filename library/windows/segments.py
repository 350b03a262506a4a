"""The segments of a library's bodies: how long they are, which joints they join, and which joints have another side."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.motion_library import MotionLibrary

#: The joints are in another order if the mean segment is as long as this share of the distances between all joints, and
#: this factor longer than in any motion of the library. No frame of 22,000 of eight honest sets has such segments; 99 %
#: of random orders of their joints have.
DISORDER = 0.65
BEYOND_LIBRARY = 1.1
#: A segment counts by its length to this power where bodies are compared: a long segment moves all that hangs on it,
#: and sensors and marker sets put the ends of short ones, in hands, feet and neck, where they like.
_BY_LENGTH = 3
#: Metres, at least: the logarithm of a segment without length.
_MIN_LENGTH = 0.01
#: One in so many of the library's frames is measured for lengths.
_EVERY = 4


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """The segments of the bodies in a library: their lengths, and the joints on the two sides.

    Attributes
    ----------
    parents
        The parent of each joint, as in `Skeleton`; empty when parents are not known: then segments are not judged.
    children
        The joint at the lower end of each segment, shape (segments,).
    ends
        The joints at the ends of each segment, the child first; after them the same parents, each with the child of the
        other side, for the segments in `crossing`, shape (segments + crossings, 2).
    crossing, partner
        Index of each segment whose two joints have others on the other side, and where among these segments the one
        between the others is, shape (crossings,).
    mean, tolerance
        Length of each segment in metres: mean, and the greatest change in one motion.
    builds, stretches
        Of each person the mean logarithm of each segment's length, shape (persons, segments), and by how much the
        logarithms vary within a motion: the mean over segments of their standard deviation, shape (persons,).
    disorder
        The share from which segments are too long for joints that are in order (`shares_of_size`).
    """

    parents: NDArray[np.intp]
    children: NDArray[np.intp]
    ends: NDArray[np.intp] = field(repr=False)
    crossing: NDArray[np.intp] = field(repr=False)
    partner: NDArray[np.intp] = field(repr=False)
    mean: NDArray[np.float64] = field(repr=False)
    tolerance: NDArray[np.float64] = field(repr=False)
    builds: NDArray[np.float64] = field(repr=False)
    stretches: NDArray[np.float64] = field(repr=False)
    disorder: float

    @classmethod
    def of(cls, library: MotionLibrary) -> Self:
        """Measure the segments of a library's motions."""
        skeleton = library.skeleton
        parents = np.array(skeleton.parents, dtype=np.intp)
        children = np.flatnonzero(parents >= 0)
        other_side = mirrored_places(skeleton.joints)
        ends = np.column_stack([children, parents[children]]) if len(children) else np.empty((0, 2), dtype=np.intp)
        others = ends if other_side is None else other_side[ends]
        crossed = (others != ends).all(axis=1) & (parents[others[:, 0]] == others[:, 1])
        crossing = np.flatnonzero(crossed)
        some = [motion.positions[::_EVERY] for motion in library.motions]
        lengths = [_lengths(each, ends) for each in some]
        builds, stretches = _by_person([motion.actor for motion in library.motions], list(map(logs_of, lengths)))
        largest = max(float(shares_of_size(each, ends).max()) for each in some) if len(ends) else 0.0
        return cls(
            parents=parents,
            children=children,
            ends=np.concatenate([ends, np.column_stack([others[crossing, 0], ends[crossing, 1]])]),
            crossing=crossing,
            partner=np.searchsorted(children[crossing], others[crossing, 0]),
            mean=np.concatenate(lengths).mean(axis=0),
            tolerance=np.array([np.ptp(each, axis=0) for each in lengths]).max(axis=0),
            builds=builds,
            stretches=stretches,
            disorder=max(DISORDER, BEYOND_LIBRARY * largest),
        )

    @property
    def segments(self) -> NDArray[np.intp]:
        """The joints at the ends of each segment alone, shape (segments, 2)."""
        return self.ends[: len(self.children)]

    def lengths(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Measure the segments in frames (frames, joints, 3): shape (frames, segments)."""
        return _lengths(positions, self.segments)

    def unlike(self, build: NDArray[np.float64], stretch: float) -> float:
        """Say how unlike the library's bodies another body is, whatever its size.

        Parameters
        ----------
        build, stretch
            Of the other body, as `builds` and `stretches`.

        Returns
        -------
        The root mean square by which the logarithms of the lengths differ, weighed by the library's lengths cubed, and
        by how much more the segments stretch: the sum for the person nearest; 0 without segments.
        """
        if not len(self.children):
            return 0.0
        differences = build - self.builds
        weights = np.exp(_BY_LENGTH * self.builds)
        weights /= weights.sum(axis=1, keepdims=True)
        differences -= (weights * differences).sum(axis=1, keepdims=True)
        built = np.sqrt((weights * differences**2).sum(axis=1))
        return float((built + np.maximum(stretch - self.stretches, 0.0)).min())


def _lengths(positions: NDArray[np.floating], ends: NDArray[np.intp]) -> NDArray[np.float64]:
    along = np.subtract(positions[:, ends[:, 0]], positions[:, ends[:, 1]], dtype=np.float64)
    lengths: NDArray[np.float64] = np.sqrt(np.einsum("fsc,fsc->fs", along, along))
    return lengths


def logs_of(lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the logarithms of lengths in metres, of a centimetre at least."""
    return np.log(np.maximum(lengths, _MIN_LENGTH))


def _by_person(
    persons: Sequence[str], logs: Sequence[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Average the logarithms of motions, each (frames, segments), and their variation over each person's motions."""
    means, varied = (np.array([of(each, axis=0) for each in logs]) for of in (np.mean, np.std))
    own = [np.array(persons) == person for person in sorted(set(persons))]
    builds, varying = (np.array([numbers[each].mean(axis=0) for each in own]) for numbers in (means, varied))
    return builds, varying.sum(axis=1) / max(varying.shape[1], 1)


def shares_of_size(positions: NDArray[np.floating], segments: NDArray[np.intp]) -> NDArray[np.float64]:
    """Compare the mean length of the segments with the root mean square of the distances between all joints.

    Parameters
    ----------
    positions
        Shape (frames, joints, 3), without NaN.
    segments
        The joints at the ends of each segment, shape (segments, 2).

    Returns
    -------
    For each frame the share, shape (frames,): some .2 to .4 for a body, some .9 for joints in another order, and 0 for
    joints that are all in one place.
    """
    own = positions - positions.mean(axis=1, keepdims=True, dtype=np.float64)
    # The mean square of all distances is twice the variance of the positions, by n / (n - 1).
    squares = np.einsum("fjc,fjc->f", own, own) * (2 / (positions.shape[1] - 1))
    shares: NDArray[np.float64] = _lengths(positions, segments).mean(axis=1) / np.sqrt(
        np.where(squares > 0, squares, np.inf)
    )
    return shares


#: A word for a side, and for the other; and where it stands in a name, the surest place first.
_OTHER = {"left": "right", "Left": "Right", "LEFT": "RIGHT", "l": "r", "L": "R"}
_OTHER |= {other: word for word, other in _OTHER.items()}
_SIDES = [re.compile(each) for each in ("[Ll]eft|[Rr]ight|LEFT|RIGHT", r"(?<![^\W_])[lrLR](?![^\W_])", "^[lrLR]")]


def mirrored_places(joints: Sequence[str]) -> NDArray[np.intp] | None:
    """Find each joint's place on the other side: of `lwrist` that of `rwrist`, `LeftHand`, `RightHand`, `hand.L`.

    A joint in the middle has its own; None where no name has a side.
    """
    places, others = {name: place for place, name in enumerate(joints)}, np.arange(len(joints))
    for name, place in places.items():
        renamed = (each.sub(lambda found: _OTHER[found[0]], name) for each in _SIDES)
        others[place] = next((places[other] for other in renamed if other != name and other in places), place)
    return others if (others != np.arange(len(joints))).any() else None


def mirrored(clip: Clip) -> Clip:
    """Give a motion as the other side does it: left and right joints are exchanged, and x is negated.

    Raises
    ------
    ValueError
        No name of a joint has another side.
    """
    places = mirrored_places(clip.skeleton.joints)
    if places is None:
        raise ValueError(f"either side: expected joints of two sides, got {', '.join(clip.skeleton.joints)}")
    positions = clip.positions[:, places] * (-1.0, 1.0, 1.0)
    return replace(
        clip,
        positions=positions,
        rotations=np.zeros((len(positions), 0)),
        take=f"{clip.take} mirrored".strip(),
        name=f"{clip.name} mirrored".strip(),
    )


#: The remark on a body without depth.
FLAT = "flat: all joints lie in one plane: 2-D landmarks, lifted to 3-D by zeros? Their distances are no body's"
#: A frame is flat when it is thinner than this share of its length. In each of 170 takes of seven sets, by markers,
#: Kinects and a camera, some frame has .07 or more.
_THIN = 1e-3


def is_flat(positions: NDArray[np.floating]) -> bool:
    """Say whether every frame (frames, joints, 3) of a body lies in a plane."""
    if positions.shape[1] < 4:
        return False
    own = positions - positions.mean(axis=1, keepdims=True)
    lengths = np.linalg.eigvalsh(np.einsum("fja,fjb->fab", own, own))
    return bool((lengths[:, 0] <= _THIN**2 * lengths[:, 2]).all())


def in_disorder(count: int, joints: int) -> str:
    """Say in words that the joints are where no body has them."""
    return f"joints: {count} of {joints} where no body has them: in another order, or angles for positions?"
