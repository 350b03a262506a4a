"""A recorded motion: joint positions over time, with its class, actor and source."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from numbers import Real

import numpy as np
from numpy.typing import NDArray

from kinespace.library.skeleton import Skeleton, SkeletonMismatchError

#: Metres from the origin beyond which a joint is a mistake; squares of smaller numbers never overflow.
MAX_DISTANCE = 1e8


def as_numbers(positions: object) -> NDArray[np.float64]:
    """Give positions in lists or in an array of any real numbers as doubles; ValueError for others."""
    try:
        found = np.asarray(positions)
    except ValueError as error:
        raise ValueError("positions: expected numbers, got lists of several lengths") from error
    if found.dtype.kind not in "fiu":
        raise ValueError(f"positions: expected numbers, got {type(positions).__name__} of {found.dtype}")
    return found.astype(np.float64)


def is_near(positions: NDArray[np.floating]) -> bool:
    """Whether all numbers are finite, and of joints that are no mistake; takes no memory of a recording's size."""
    return bool(positions.min(initial=0.0) > -MAX_DISTANCE and positions.max(initial=0.0) < MAX_DISTANCE)


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Clip:
    """One recording of one performer.

    Attributes
    ----------
    skeleton
        The skeleton whose joints the positions belong to.
    positions
        Joint positions, shape (frames, joints, 3), metres; lists of numbers become an array.
    frame_rate
        Frames per second.
    name
        The clip's name, usually its file's name without the ending.
    class_name, actor, take
        The movement it shows, the person who performs it, and which repetition it is; empty if the source is silent.
    source, licence, attribution
        The file or database that the clip comes from, the terms under which it may be passed on, and the authors to
        name; empty where they are not known.
    rotations
        Joint rotations as recorded, shape (frames, angles), radians; (frames, 0) when the source has none. Only the
        comparison of spaces (`kinespace evaluate retrieval`) uses them.
    naming
        The convention by which the recording named its joints, as a person asks for it (`library.naming`); empty where
        the names were not changed.
    filled
        How many of the frames × joints positions were missing in the source and were interpolated linearly.
    gaps
        Times between which nothing was seen for longer than straight lines may last, seconds from the clip's start. The
        body stays there where it was last seen, and motions are not cut across these times.
    notes
        Remarks of the reader on the file, a line each, whose kind stands before a colon: markers that were left out,
        times that differ from the header's.

    Raises
    ------
    ValueError
        Positions of another shape than (frames >= 1, joints, 3) or not of numbers, a value that is not finite, a frame
        rate that is not positive, or a parameter of another type.
    """

    skeleton: Skeleton
    positions: NDArray[np.floating] = field(repr=False)
    frame_rate: float
    name: str = ""
    class_name: str = ""
    actor: str = ""
    take: str = ""
    source: str = ""
    licence: str = ""
    attribution: str = ""
    rotations: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    naming: str = ""
    filled: int = 0
    gaps: tuple[tuple[float, float], ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.skeleton, Skeleton):
            raise ValueError(f"skeleton: expected a Skeleton, got {type(self.skeleton).__name__}")  # noqa: TRY004
        if not isinstance(self.positions, np.ndarray) or self.positions.dtype.char not in "fd":
            object.__setattr__(self, "positions", as_numbers(self.positions))
        joints = len(self.skeleton.joints)
        if self.positions.ndim != 3 or self.positions.shape[1:] != (joints, 3) or not len(self.positions):
            raise ValueError(f"positions: expected (frames, {joints}, 3), got {self.positions.shape}")
        if not is_near(self.positions):
            raise ValueError(f"clip {self.name!r}: positions: expected metres below {MAX_DISTANCE:g}, got NaN or more")
        rate = self.frame_rate
        if not (isinstance(rate, Real) and np.isfinite(rate) and rate > 0):
            raise ValueError(f"frame_rate: expected a positive number of frames per second, got {rate!r}")

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the end of the last."""
        return self.frames / self.frame_rate

    @property
    def times(self) -> NDArray[np.float64]:
        """Time of each frame from the clip's start, shape (frames,), seconds."""
        return np.arange(self.frames) / self.frame_rate

    def moved_to(self, positions: NDArray[np.floating]) -> "Clip":
        """Give the same clip with other positions, shape (frames, joints, 3), metres."""
        return replace(self, positions=positions)

    def as_of(self, skeleton: Skeleton) -> "Clip":
        """Give the same clip on another skeleton that has the same joints in any order.

        Raises
        ------
        SkeletonMismatchError
            One of the two has a joint that the other lacks.
        """
        if further := [name for name in self.skeleton.joints if name not in skeleton.joints]:
            raise SkeletonMismatchError(
                f"clip {self.name!r}: expected the other recordings' {len(skeleton.joints)} joints, "
                f"got {', '.join(further[:5])}{' ...' if len(further) > 5 else ''} as well"
            )
        return self.over(skeleton)

    def over(self, skeleton: Skeleton) -> "Clip":
        """Give the same clip on a skeleton of some of its joints, in any order.

        Raises
        ------
        SkeletonMismatchError
            The skeleton has a joint that this one lacks.
        """
        joints = self.skeleton.joints
        if joints == skeleton.joints:
            return self if self.skeleton == skeleton else replace(self, skeleton=skeleton)
        return replace(self, skeleton=skeleton, positions=self.positions[:, skeleton.order_from(joints)])

    def restricted_to(self, joints: Collection[str]) -> "Clip":
        """Give the clip with some of its joints, in this skeleton's order, without rotations.

        Raises
        ------
        SkeletonMismatchError
            Fewer than two of the joints are this skeleton's.
        """
        kept = [index for index, name in enumerate(self.skeleton.joints) if name in joints]
        if len(kept) < 2:
            raise SkeletonMismatchError(f"clip {self.name!r}: expected at least 2 of the joints, got {len(kept)}")
        return replace(self.over(self.skeleton.restricted_to(kept)), rotations=np.zeros((self.frames, 0)))
