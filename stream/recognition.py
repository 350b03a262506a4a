"""The answer: what a performer was doing in one window, how sure that is, and what made it none."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Outcome(StrEnum):
    """Why a recognition names a class, or none."""

    NAMED = "named"
    #: Nothing moves more than the body's size allows for: there is no axis to compare.
    STILL = "still"
    #: The two leading eigenvalues are as good as equal: the axis is any direction between two.
    AMBIGUOUS = "ambiguous"


@dataclass(frozen=True, slots=True, eq=False)
class Recognition:
    """What one window of one performer was recognised as.

    Attributes
    ----------
    performer
        Who.
    time
        Time of the window's last frame, seconds, on the clock of the frames.
    outcome
        Whether a class is named, else what made it none.
    classes
        The library's class names, sorted; an index into them is an index into `scores`.
    scores
        Score of each class, 0 to 1, shape (classes,): the best absolute inner product with one of its motions.
        Raw, not normalised: an unknown movement scores low everywhere. Given even when the outcome is none.
    movement
        Root mean square deviation of a distance in the window, relative to the body's size.
    share
        Share of the window's variance along its leading eigenvector.
    gap
        (λ₁ − λ₂) / λ₁ of the window's two leading eigenvalues.
    residual
        ‖Cv − λv‖ / λ of the leading eigenvector; at most 1e-6.
    """

    performer: str
    time: float
    outcome: Outcome
    classes: tuple[str, ...] = field(repr=False)
    scores: NDArray[np.floating] = field(repr=False)
    movement: float
    share: float
    gap: float
    residual: float

    @property
    def best(self) -> int:
        """Index of the class with the highest score, whatever the outcome."""
        return int(np.argmax(self.scores))

    @property
    def class_index(self) -> int:
        """Index of the named class, -1 for none."""
        return self.best if self.outcome is Outcome.NAMED else -1

    @property
    def class_name(self) -> str | None:
        """The named class, or None."""
        return self.classes[self.best] if self.outcome is Outcome.NAMED else None

    @property
    def label(self) -> str:
        """The named class, or in its place the word for the outcome: never empty, so it can be shown as it is."""
        return self.class_name or str(self.outcome)

    @property
    def score(self) -> float:
        """The highest class score."""
        return float(self.scores[self.best])

    @property
    def runner_up(self) -> str | None:
        """The class with the second highest score; None in a library of one class."""
        # Stable, as argmax is: among equals the first is the best, the next the runner-up.
        return self.classes[int(np.argsort(-self.scores, kind="stable")[1])] if len(self.scores) > 1 else None

    @property
    def margin(self) -> float:
        """How far the highest score is above the second; the score itself in a library of one class."""
        top = np.sort(self.scores)
        return float(top[-1] - top[-2]) if len(top) > 1 else float(top[-1])
