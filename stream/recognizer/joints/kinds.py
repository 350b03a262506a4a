"""What kind of feed taught a library, and whether another kind asks: measured by the bodies, so nothing is kept."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from kinespace.library import MotionLibrary
from kinespace.library.signature.landmark_body import are_of_landmarks

#: Joints guessed from one camera's pictures, or measured by a suit, markers or a depth sensor.
Kind = Literal["guessed", "measured"]
TITLES: dict[Kind, str] = {"guessed": "one camera", "measured": "measured bodies"}
#: What is said of a performer when its kind did not teach the library.
NOTES: dict[Kind, str] = {
    "guessed": "one camera's body, and measured ones taught the library: expect few right names, teach your own "
    "(--teach)",
    "measured": "a measured body, and one camera's taught the library: its names are less sure",
}
#: Where in each motion a body is looked at: a quick limb between two pictures is too short.
_LOOKS = (0.25, 0.5, 0.75)


def kind_of(joints: Sequence[str], positions: NDArray[np.floating]) -> Kind:
    """Give the kind of a feed by some of its bodies, shape (bodies, joints, 3), metres."""
    return "guessed" if 2 * np.count_nonzero(are_of_landmarks(joints, positions)) > len(positions) else "measured"


def kinds_of(library: MotionLibrary) -> frozenset[Kind]:
    """Give the kinds of feed that taught a library's motions."""
    bodies = [each.positions[int(each.frames * look)] for each in library.motions for look in _LOOKS]
    found = are_of_landmarks(library.skeleton.joints, np.array(bodies)).reshape(-1, len(_LOOKS))
    return frozenset("guessed" if each.any() else "measured" for each in found)
