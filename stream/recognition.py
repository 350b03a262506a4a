"""The answer: what a performer was doing in one window, how sure that is, what made it none, what began or ended."""

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
    #: The nearest class is not near enough: the movement is probably none of the library's.
    UNKNOWN = "unknown"
    #: The two leading eigenvalues are as good as equal: the axis is any direction between two.
    AMBIGUOUS = "ambiguous"


class EventKind(StrEnum):
    """What happened."""

    START = "start"
    END = "end"


@dataclass(frozen=True, slots=True)
class Event:
    """A motion has started or ended.

    Attributes
    ----------
    performer
        Whose.
    kind
        Start or end.
    label, index
        Class name and index.
    score
        Of that class when it was decided.
    time
        When it was decided, seconds, on the clock of the frames.
    """

    performer: str
    kind: EventKind
    label: str
    index: int
    score: float
    time: float


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
        Score of each class, 0 to 1, shape (classes,), by its nearest motion or window: the absolute inner product of
        leading eigenvectors, or 1 / (1 + d²) of the distance between windows. Raw, not normalised: an unknown
        movement scores low everywhere. Given even when the outcome is none.
    movement
        Root mean square deviation of a distance in the window, relative to the body's size.
    share
        Share of the window's variance along its leading eigenvector; None where that was not asked for.
    gap
        (λ₁ − λ₂) / λ₁ of the window's two leading eigenvalues; None likewise.
    residual
        ‖Cv − λv‖ / λ of the leading eigenvector, at most 1e-6; None likewise.
    guess
        Index of the class that is the best guess, whatever the outcome. Usually the one with the highest score; at a
        change of motion the one before, until the new one has led for long enough. None: the highest score's.
    events
        What this recognition made happen: a motion's end, a motion's start, or nothing.
    """

    performer: str
    time: float
    outcome: Outcome
    classes: tuple[str, ...] = field(repr=False)
    scores: NDArray[np.floating] = field(repr=False)
    movement: float
    share: float | None = None
    gap: float | None = None
    residual: float | None = None
    guess: int | None = None
    events: tuple[Event, ...] = ()

    @property
    def best(self) -> int:
        """Index of the best guess: `guess`, or the class with the highest score."""
        return int(np.argmax(self.scores)) if self.guess is None else self.guess

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
    def guess_index(self) -> int:
        """Index of the best guess, also of one held back as unknown; -1 where there is nothing to guess from."""
        return self.best if self.outcome in (Outcome.NAMED, Outcome.UNKNOWN) else -1

    @property
    def score(self) -> float:
        """Score of the best guess."""
        return float(self.scores[self.best])

    @property
    def second_index(self) -> int:
        """Index of the class with the highest score but the best guess's; -1 in a library of one class."""
        if len(self.scores) < 2:
            return -1
        others = self.scores.copy()
        others[self.best] = -np.inf
        return int(others.argmax())

    @property
    def runner_up(self) -> str | None:
        """The class with the highest score but the best guess's; None in a library of one class."""
        second = self.second_index
        return self.classes[second] if second >= 0 else None

    @property
    def margin(self) -> float:
        """How far the best guess's score is above the runner-up's; the score itself in a library of one class.

        Below zero while a guess is held at a change of motion.
        """
        second = self.second_index
        return self.score - float(self.scores[second]) if second >= 0 else self.score
