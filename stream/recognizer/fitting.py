"""Whether a performer's body and kind of feed are the library's: said once some seconds of movement show it."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from kinespace.library import MotionLibrary, WindowIndex
from kinespace.library.signature.landmark_body import are_of_landmarks
from kinespace.library.windows.segments import FLAT, is_flat, logs_of

#: Joints guessed from one camera's pictures, or measured by a suit, markers or a depth sensor.
FeedKind = Literal["guessed", "measured"]
TITLES: dict[FeedKind, str] = {"guessed": "one camera", "measured": "measured bodies"}
#: What is said of a performer when its kind did not teach the library.
NOTES: dict[FeedKind, str] = {
    "guessed": "one camera's body, and measured ones taught the library: expect few right names, teach your own "
    "(--teach)",
    "measured": "a measured body, and one camera's taught the library: its names are less sure",
}
#: What is said of a performer whose body is unlike the library's.
_UNLIKE_NOTE = "these joints move unlike the library's: expect few right names, teach your own (--teach)"
#: Where in each motion a body is looked at: a quick limb between two pictures is too short.
_IN_MOTIONS = (0.25, 0.5, 0.75)


def kind_of(joints: Sequence[str], positions: NDArray[np.floating]) -> FeedKind:
    """Give the kind of a feed by some of its bodies, shape (bodies, joints, 3), metres."""
    return "guessed" if 2 * np.count_nonzero(are_of_landmarks(joints, positions)) > len(positions) else "measured"


@lru_cache(maxsize=16)
def kinds_of(library: MotionLibrary) -> frozenset[FeedKind]:
    """Give the kinds of feed that taught a library's motions."""
    bodies = [each.positions[int(each.frames * look)] for each in library.motions for look in _IN_MOTIONS]
    found = are_of_landmarks(library.skeleton.joints, np.array(bodies)).reshape(-1, len(_IN_MOTIONS))
    return frozenset("guessed" if each.any() else "measured" for each in found)


#: From here on a body is unlike the library's (`Segments.unlike`): between the bodies by whose joints the built-in
#: library names motions (HDM05's, CMU's, UI-PRMD's by markers and by Kinect 2) and those by whose joints it does not
#: (Kinder-Gator's and UTKinect's by Kinect 1, films'). With each set left out in turn, the others choose .198 to .206.
UNLIKE = 0.205
#: Looks at a moving body that decide.
_LOOKS = 15
#: Seconds between two of them.
_APART = 1 / 6


class Fitting:
    """Measures one performer's segments until it is decided whether the body is like the library's.

    Parameters
    ----------
    index
        The windows of the library.

    Attributes
    ----------
    unlike
        Whether the body is unlike the library's; None until that is decided.
    note
        What is odd about the body, in words: it lies in a plane, its kind of feed did not teach the library, or it is
        unlike the library's; empty for nothing, and until that is decided.
    due
        When to look next, seconds on the feed's clock; never once it is decided.
    """

    def __init__(self, index: WindowIndex) -> None:
        self._body, self._library = index.segments, index.library
        self._bodies: list[NDArray[np.float64]] = []
        self.unlike: bool | None = None
        self.note = ""
        self.due = -math.inf

    def begin_again(self) -> None:
        """Go on with a clock that began again; looks count as before."""
        self.due = -math.inf if self.unlike is None else math.inf

    def look(self, time: float, positions: NDArray[np.float64]) -> None:
        """Look at a frame (joints, 3) of a moving body."""
        self.due = time + _APART
        self._bodies.append(positions.copy())
        if len(self._bodies) == _LOOKS:
            bodies = np.array(self._bodies)
            logs = logs_of(self._body.lengths(bodies))
            stretch = float(logs.std(axis=0).mean()) if logs.size else 0.0
            self.unlike, self.due = self._body.unlike(logs.mean(axis=0), stretch) > UNLIKE, math.inf
            kind = kind_of(self._library.skeleton.joints, bodies)
            usual = _UNLIKE_NOTE if self.unlike else ""
            self.note = FLAT if is_flat(bodies) else usual if kind in kinds_of(self._library) else NOTES[kind]
