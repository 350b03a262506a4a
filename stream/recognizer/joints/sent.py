"""The joints that senders have: their names, and the joints assumed without names."""

from __future__ import annotations

from dataclasses import dataclass, field

from kinespace.library.naming import Naming


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
    """

    assumed: tuple[str, ...] = ()
    naming: Naming = field(default_factory=Naming)
