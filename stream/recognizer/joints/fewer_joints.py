"""The joints that senders have: their names, the joints assumed without names, and the library restricted to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

from kinespace.library.kernels.aligned import give_back_memory
from kinespace.library.motion_library import MotionLibrary
from kinespace.library.naming import Naming
from kinespace.library.windows.index import WindowIndex

#: Libraries of fewer joints that stay open at once, for all performers.
MAX_RESTRICTED = 8

#: Restricts a library to some of its joints, opened or not; None while the restricted library is not ready. Raises
#: ValueError where nothing can be compared by these joints.
Restricter = Callable[[MotionLibrary, tuple[str, ...]], MotionLibrary | WindowIndex | None]
#: Gives a library's windows as a body of some of its joints shows them; None while they are not ready.
Opener = Callable[[MotionLibrary, tuple[str, ...]], WindowIndex | None]


@lru_cache(maxsize=MAX_RESTRICTED)
def restricted(library: MotionLibrary, joints: tuple[str, ...]) -> MotionLibrary:
    """Restrict a library to some of its joints; several recognisers share the restricted library."""
    return library.restricted_to(joints)


def opened_anew(library: MotionLibrary, joints: tuple[str, ...]) -> WindowIndex:
    """Open a library as a body of some of its joints shows it; takes a second where the library is large.

    Its motions have no frames any more, only their classes and persons.

    Raises
    ------
    ValueError
        No motion of the library is long enough for a window.
    """
    index = WindowIndex.of(library.restricted_to(joints))
    index = replace(index, library=_without_frames(index.library))
    # Both are otherwise done at the first use, and a frame must not wait for that.
    _ = index.rejection
    index.prepare()
    give_back_memory()
    return index


def _without_frames(library: MotionLibrary) -> MotionLibrary:
    """Give a library with the shortest motions there may be: its windows are cut, and frames take most of its room."""
    motions = (replace(motion, positions=motion.positions[:2].copy()) for motion in library.motions)
    return replace(library, motions=tuple(motions))


opened_restricted = lru_cache(maxsize=MAX_RESTRICTED)(opened_anew)


@dataclass(frozen=True, slots=True)
class SentJoints:
    """The joints that senders have, as far as we know them.

    Attributes
    ----------
    assumed
        The joints of frames whose sender has named none, in the frames' order, by the library's names; empty for the
        library's joints.
    naming
        How announced joint names are read: as HDM05's names, found by their convention unless one is given.
    restricter
        Restricts the library to the joints that a sender has.
    """

    assumed: tuple[str, ...] = ()
    naming: Naming = field(default_factory=Naming)
    restricter: Restricter = restricted
