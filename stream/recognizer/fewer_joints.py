"""The joints that senders have: what they are called, which are assumed, and the library restricted to them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import Naming

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary

#: Sets of joints that a library is restricted to at most: each has windows of its own, which take room and time.
MAX_SETS = 3


class FewerJoints(Protocol):
    """Gives a library restricted to some of its joints."""

    def __call__(self, joints: frozenset[str]) -> MotionLibrary | None:
        """Give it, or None where it is not ready yet.

        Raises
        ------
        ValueError
            There are too few of the library's joints, or too many sets of them already.
        """

    def exchange(self, library: MotionLibrary) -> None:
        """Restrict another library of the same joints from now on."""


@dataclass(frozen=True, slots=True)
class SentJoints:
    """What is known of senders' joints.

    Attributes
    ----------
    assumed
        What frames hold whose sender has not said so, in their order, by the library's names; the library's joints when
        there are none.
    naming
        How announced joint names are read: ours are found for them when nothing else is said.
    fewer
        Gives the library restricted to the joints that a sender has; while the caller waits, when it is None.
    """

    assumed: tuple[str, ...] = ()
    naming: Naming = field(default_factory=Naming)
    fewer: FewerJoints | None = None


class RestrictedAtOnce:
    """Restricts a library while the caller waits; a set of joints that was asked for before costs nothing.

    Parameters
    ----------
    library
        The library.
    """

    def __init__(self, library: MotionLibrary) -> None:
        self._library = library
        self._known: dict[frozenset[str], MotionLibrary] = {}

    def __call__(self, joints: frozenset[str]) -> MotionLibrary | None:
        """Give the library restricted to these joints; as `FewerJoints`."""
        if joints not in self._known:
            require_room(self._library, joints, len(self._known))
            self._known[joints] = self._library.restricted_to(joints)
        return self._known[joints]

    def exchange(self, library: MotionLibrary) -> None:
        """Restrict another library of the same joints from now on."""
        self._library, self._known = library, {}


def require_room(library: MotionLibrary, joints: frozenset[str], known: int) -> None:
    """Refuse too few joints, and more sets of them than `MAX_SETS`.

    Raises
    ------
    ValueError
        It is one of the two.
    """
    if len(joints) < MIN_JOINTS:
        compared = len(library.skeleton.joints)
        raise ValueError(f"{len(joints)} of them among the {compared} compared, expected {MIN_JOINTS} at least")
    if known >= MAX_SETS:
        raise ValueError(f"{MAX_SETS} performers send other sets of joints already")
