"""One frame of a live feed, validated once at the border."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinespace.library.clip import MAX_DISTANCE, as_numbers

#: The longest performer's name; a longer one is a sender's mistake and would make every answer's address long.
MAX_PERFORMER_LENGTH = 64
#: Characters in a joint's name, at most.
MAX_JOINT_LENGTH = 400
_MAX_DISTANCE_SQUARE = MAX_DISTANCE**2
_FLOATS = np.dtype(np.float32), np.dtype(np.float64)


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
        Joint positions, shape (joints, 3), metres. A joint with a NaN among its three numbers is lost. Arrays of floats
        and of doubles are kept as they are, others and lists are copied.

    Raises
    ------
    ValueError
        The performer is no text, empty or too long, the time is not a finite number, all joints are lost, a joint is
        farther than `MAX_DISTANCE`, or the shape is another or not of numbers.
    """

    performer: str
    time: float
    positions: NDArray[np.floating] = field(repr=False)

    if TYPE_CHECKING:

        def __init__(self, performer: str, time: float, positions: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        # Local names, because a hundred performers make 20,000 frames a second.
        performer, positions = self.performer, self.positions
        if not (isinstance(performer, str) and 0 < len(performer) <= MAX_PERFORMER_LENGTH):
            raise _misnamed(performer)
        kind: object
        try:
            finite, kind = math.isfinite(self.time), positions.dtype
        except (AttributeError, TypeError):
            finite, kind = isinstance(self.time, Real) and math.isfinite(self.time), np.dtype(object)
        if not finite:
            raise ValueError(f"time: expected finite seconds, got {self.time!r}")
        if kind not in _FLOATS:
            positions = as_numbers(positions)
            object.__setattr__(self, "positions", positions)
        shape = positions.shape
        if len(shape) != 2 or shape[1] != 3:
            raise ValueError(f"positions: expected (joints, 3), got {shape}")
        # One sum of squares shows any NaN, infinity or absurd number, and is quicker than checking each number. vdot is
        # used because numpy turns the processor's flags into warnings after dot.
        if not np.vdot(positions, positions) < _MAX_DISTANCE_SQUARE:
            self._require_some_joints()

    def _require_some_joints(self) -> None:
        """Refuse positions that are more than a few lost joints."""
        there = self.positions[~np.isnan(self.positions).any(axis=1)]
        if not len(there):
            raise ValueError("positions: expected some joints, got NaN for all")
        if not np.vdot(there, there) < _MAX_DISTANCE_SQUARE:
            raise ValueError(f"positions: expected finite metres on a stage, got {_odd_joint(self.positions)}")


def _misnamed(performer: object) -> ValueError:
    got = len(performer) if isinstance(performer, str) else repr(performer)
    return ValueError(f"performer: expected 1 to {MAX_PERFORMER_LENGTH} characters, got {got}")


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
        The performer is empty or too long, a joint name is so or appears twice, or the joints are one text.
    """

    performer: str
    joints: tuple[str, ...]

    if TYPE_CHECKING:

        def __init__(self, performer: str, joints: Sequence[str]) -> None: ...

    def __post_init__(self) -> None:
        if not (isinstance(self.performer, str) and 0 < len(self.performer) <= MAX_PERFORMER_LENGTH):
            raise _misnamed(self.performer)
        if isinstance(self.joints, str):
            raise ValueError(f"joints: expected several names, got the text {self.joints!r}")  # noqa: TRY004
        object.__setattr__(self, "joints", tuple(self.joints))
        if not self.joints or not all(self.joints) or len(set(self.joints)) != len(self.joints):
            raise ValueError("joints: expected distinct, non-empty names")
        # Names are compared with those of other programs, which takes the square of their length.
        if max(map(len, self.joints)) > MAX_JOINT_LENGTH:
            raise ValueError(f"joints: expected names of at most {MAX_JOINT_LENGTH} characters")


@dataclass(frozen=True, slots=True)
class NewSender:
    """From now on another sender sends a performer's frames: the joints that the former sender announced are void."""

    performer: str


#: The output of a decoder: frames, and announcements of their joints.
Input = Frame | Announcement
#: The input of the recognisers: the same, and changes of a performer's sender.
Admitted = Input | NewSender
