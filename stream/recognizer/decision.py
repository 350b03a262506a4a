"""The decision of a hop: which class the guess is and whether it is known, from the distances to the library."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from kinespace.library.motion_library import NOTHING
from kinespace.library.windows.rejection import Evidence
from kinespace.stream.recognition import Outcome
from kinespace.stream.recognizer.hysteresis import LEAD, Hysteresis, Judgement
from kinespace.stream.recognizer.settings import (
    LEAD_ONE,
    LEAD_USUAL,
    SENSITIVITY_LEARNED,
    SENSITIVITY_ONE,
    SENSITIVITY_OWN,
    LiveSignature,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.recognizer.settings import Settings

#: Seconds that the first hop counts for.
FIRST_HOP = 1 / 30
#: A larger lead counts as this much: the only class of a library leads infinitely.
_MAX_PACE = 3.0


class Decided(NamedTuple):
    """The decision; the fields are as in `stream.recognizer.matcher.Reading`."""

    outcome: Outcome
    distances: NDArray[np.float64]
    guess: int
    lead: float
    evidence: Evidence


class Decision:
    """Follows one performer's guess, and whether it is known.

    Parameters
    ----------
    index
        The library's windows.
    stillness, sensitivity
        The same as for `stream.recognizer.settings.Settings`.
    """

    def __init__(self, index: WindowIndex, *, stillness: float, sensitivity: float | None) -> None:
        self._stillness, self._sensitivity = stillness, sensitivity
        self._judgement = Judgement(self._threshold(index))
        self._hysteresis = Hysteresis(LEAD)
        self._compare_with(index)

    def _threshold(self, index: WindowIndex) -> float:
        usual = usual_sensitivity(index.library)
        return index.rejection.threshold_at(usual if self._sensitivity is None else self._sensitivity)

    def _compare_with(self, index: WindowIndex) -> None:
        self._classes, self._weighing = index.classes, index.comparison.weighing
        # Kept here, because the cache behind the index may be full of other libraries.
        self._rejection = index.rejection
        self._nothing = index.classes.index(NOTHING) if NOTHING in index.classes else -1

    def exchange(self, index: WindowIndex) -> None:
        """Go on with the windows of another library."""
        self._hysteresis.exchange(places_in(self._classes, index.classes))
        self._judgement.exchange(self._threshold(index))
        self._compare_with(index)

    def set_sensitivity(self, share: float, index: WindowIndex) -> None:
        """Go on with another sensitivity and the windows of the same library."""
        self._sensitivity = share
        self._judgement.exchange(self._threshold(index))

    def clear(self) -> None:
        """Forget everything, as at the start."""
        self._hysteresis.clear()
        self._judgement.clear()

    def push(self, logs: NDArray[np.float64], movement: float, noise: float, elapsed: float) -> Decided:
        """Decide for the windows that end now.

        Parameters
        ----------
        logs
            `library.windows.index.WindowIndex.log_distances` of the windows.
        movement, noise
            The movement in the longest window, and the standard deviation of a distance's noise, metres.
        elapsed
            Seconds since the hop before; `FIRST_HOP` for the first.
        """
        distances = self._weighing.named(logs)
        guess, lead = followed(self._hysteresis, distances, elapsed)
        evidence = Evidence.of(self._weighing.alone(logs), guess, noise)
        known = self._judgement.push(self._rejection.logit(evidence, self._classes[guess]), elapsed)
        outcome = Outcome.NAMED if known and guess != self._nothing else Outcome.UNKNOWN
        return Decided(Outcome.STILL if movement < self._stillness else outcome, distances, guess, lead, evidence)


def usual_sensitivity(library: MotionLibrary) -> float:
    """Give the sensitivity for a library when none is set."""
    if library.judged_by_strangers:
        return SENSITIVITY_LEARNED
    return SENSITIVITY_ONE if _is_one_persons(library) else SENSITIVITY_OWN


def needed_lead(library: MotionLibrary, settings: Settings) -> float:
    """Give the lead that a class of a library needs before a start event."""
    if settings.lead is not None:
        return settings.lead
    one = settings.signature is LiveSignature.WINDOWS and _is_one_persons(library)
    return LEAD_ONE if one else LEAD_USUAL


def _is_one_persons(library: MotionLibrary) -> bool:
    """Whether one person's own motions teach a library what is unknown."""
    return not library.judged_by_strangers and len(library.actors) <= 1


def followed(hysteresis: Hysteresis, distances: NDArray[np.float64], elapsed: float) -> tuple[int, float]:
    """Let the guess follow the nearest class; give the guess and its lead over all other classes."""
    # For some ten numbers Python finds the least two before numpy has begun.
    listed = distances.tolist()
    nearest, second = sorted([*listed, math.inf])[:2]
    leader, ahead = listed.index(nearest), second - nearest
    hysteresis.push(leader, min(ahead, _MAX_PACE), elapsed)
    if hysteresis.current is None:
        hysteresis.current = leader
    guess = hysteresis.current
    return guess, ahead if guess == leader else nearest - listed[guess]


def places_in(before: Sequence[str], after: Sequence[str]) -> dict[int, int]:
    """Say at which index of another list each class stands, if it is there."""
    return {place: after.index(name) for place, name in enumerate(before) if name in after}
