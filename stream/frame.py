"""One frame of a live feed, validated once at the border."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Longer performer ids are a sender's mistake, and would bloat every answer's address.
MAX_PERFORMER_LENGTH = 64
#: Metres from the origin beyond which a joint is a sender's mistake; squares of what is below never overflow.
MAX_DISTANCE = 1e8
_MAX_DISTANCE_SQUARE = MAX_DISTANCE**2


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """Where the joints of one performer are at one moment.

    Attributes
    ----------
    performer
        Who; any text of 1 to 64 characters.
    time
        When, in seconds on the sender's clock or ours; only differences matter.
    positions
        Joint positions, shape (joints, 3), metres. A joint with a NaN among its three numbers is lost.

    Raises
    ------
    ValueError
        The performer is empty or too long, the time is not finite, all joints are lost, one is farther than
        `MAX_DISTANCE`, or the shape is another.
    """

    performer: str
    time: float
    positions: NDArray[np.floating] = field(repr=False)

    def __post_init__(self) -> None:
        if not 0 < len(self.performer) <= MAX_PERFORMER_LENGTH:
            raise ValueError(f"performer: expected 1 to {MAX_PERFORMER_LENGTH} characters, got {len(self.performer)}")
        if not math.isfinite(self.time):
            raise ValueError(f"time: expected finite seconds, got {self.time}")
        shape = self.positions.shape
        if len(shape) != 2 or shape[1] != 3:
            raise ValueError(f"positions: expected (joints, 3), got {shape}")
        # One sum of squares meets every NaN, infinity and absurdity at a fifth of the price of asking each number, and
        # of vdot, unlike of dot, numpy does not turn the processor's flags into warnings.
        if not np.vdot(self.positions, self.positions) < _MAX_DISTANCE_SQUARE:
            self._require_some_joints()

    def _require_some_joints(self) -> None:
        """Refuse positions that are more than a few lost joints."""
        there = self.positions[~np.isnan(self.positions).any(axis=1)]
        if not len(there):
            raise ValueError("positions: expected some joints, got NaN for all")
        if not np.vdot(there, there) < _MAX_DISTANCE_SQUARE:
            raise ValueError(f"positions: expected finite metres on a stage, got {_odd_joint(self.positions)}")


def _odd_joint(positions: NDArray[np.floating]) -> str:
    """Say which joint cannot be where it is told to be; a lost one, NaN throughout, is passed over."""
    for number, joint in enumerate(positions.tolist()):
        if not any(map(math.isnan, joint)) and not math.hypot(*joint) < MAX_DISTANCE:
            return f"joint {number + 1} of {len(positions)} at {', '.join(f'{each:.3g}' for each in joint)}"
    return "joints so far away together"


@dataclass(frozen=True, slots=True)
class Announcement:
    """A sender says which joints its frames hold, in which order.

    Raises
    ------
    ValueError
        The performer is empty or too long, or a joint name is empty or stands twice.
    """

    performer: str
    joints: tuple[str, ...]

    def __post_init__(self) -> None:
        if not 0 < len(self.performer) <= MAX_PERFORMER_LENGTH:
            raise ValueError(f"performer: expected 1 to {MAX_PERFORMER_LENGTH} characters, got {len(self.performer)}")
        if not self.joints or not all(self.joints) or len(set(self.joints)) != len(self.joints):
            raise ValueError("joints: expected distinct, non-empty names")


@dataclass(frozen=True, slots=True)
class NewSender:
    """Another sender than before sends a performer's frames from now on: what the former said of joints is void."""

    performer: str


#: What a decoder gives: frames, and what their joints are.
Input = Frame | Announcement
#: What reaches the recognisers: that, and that a performer's sender is another.
Admitted = Input | NewSender
