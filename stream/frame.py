"""One frame of a live feed, validated once at the border."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: The longest performer's name; a longer one is a sender's mistake and would make every answer's address long.
MAX_PERFORMER_LENGTH = 64
#: Metres from the origin beyond which a joint is a sender's mistake; squares of smaller numbers never overflow.
MAX_DISTANCE = 1e8
_MAX_DISTANCE_SQUARE = MAX_DISTANCE**2


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """The positions of one performer's joints at one moment.

    Attributes
    ----------
    performer
        The performer's name; any text of 1 to 64 characters.
    time
        Seconds on the sender's clock or ours; only differences matter.
    positions
        Joint positions, shape (joints, 3), metres. A joint with a NaN among its three numbers is lost.

    Raises
    ------
    ValueError
        The performer is empty or too long, the time is not finite, all joints are lost, a joint is farther than
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
        # One sum of squares shows any NaN, infinity or absurd number, and is quicker than checking each number. vdot is
        # used because numpy turns the processor's flags into warnings after dot.
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
    """Describe the joint whose position is impossible; lost joints, NaN throughout, are ignored."""
    for number, joint in enumerate(positions.tolist()):
        if not any(map(math.isnan, joint)) and not math.hypot(*joint) < MAX_DISTANCE:
            return f"joint {number + 1} of {len(positions)} at {', '.join(f'{each:.3g}' for each in joint)}"
    return "joints so far away together"


@dataclass(frozen=True, slots=True)
class Announcement:
    """A sender's list of the joints that its frames hold, in their order.

    Raises
    ------
    ValueError
        The performer is empty or too long, or a joint name is empty or appears twice.
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
    """From now on another sender sends a performer's frames: the joints that the former sender announced are void."""

    performer: str


#: The output of a decoder: frames, and announcements of their joints.
Input = Frame | Announcement
#: The input of the recognisers: the same, and changes of a performer's sender.
Admitted = Input | NewSender
