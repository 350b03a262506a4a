"""What a recogniser asks of its windows: one way to compare them with the library, exchangeable for another."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, Self

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from library.eigen import LeadingAxis
    from stream.recognition import Outcome


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """What the windows that end now say; the fields are `Recognition`'s."""

    outcome: Outcome
    scores: NDArray[np.floating] = field(repr=False)
    best: int
    movement: float
    axis: LeadingAxis | None = None


class Matcher(Protocol):
    """Keeps one performer's last seconds and compares them with a library.

    Attributes
    ----------
    longest
        Length of its longest window, seconds: of what is older a reading says nothing.
    """

    longest: float

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows, as if one by one.

        Parameters
        ----------
        times
            When each was, seconds; every one later than the one before.
        rows
            Shape (frames, pairs), metres; `stream.window.MOST_PENDING` frames at most.
        """

    def clear(self) -> None:
        """Forget all rows."""

    @property
    def ready(self) -> bool:
        """Whether enough has been seen for a reading."""

    def read(self) -> Reading:
        """Compare the windows that end with the newest row; once per hop, since a reading may build on the last."""

    def read_with(self, others: Sequence[Self]) -> list[Reading]:
        """Do that for several performers at once: one's own reading first, then the others'.

        Parameters
        ----------
        others
            Other performers' matchers, with the same library and settings.
        """
