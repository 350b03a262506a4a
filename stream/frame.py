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
        Joint positions, shape (joints, 3), metres.

    Raises
    ------
    ValueError
        The performer is empty or too long, the time or a position is not finite, a joint is farther than
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
            raise ValueError("positions: expected finite metres, got NaN, infinity or a joint beyond any stage")


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


#: What a decoder gives: frames, and what their joints are.
Input = Frame | Announcement
