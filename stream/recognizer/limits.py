"""What the settings mean for a library: its windows, its sensitivity, and what a movement needs to be named."""

from __future__ import annotations

import math

from kinespace.library.motion_library import MotionLibrary
from kinespace.library.windows.comparison import by_paper
from kinespace.library.windows.index import WindowIndex, opened
from kinespace.stream.recognizer.joints.kinds import kinds_of
from kinespace.stream.recognizer.settings import (
    LEAD_ONE,
    LEAD_USUAL,
    SENSITIVITY_CAMERA,
    SENSITIVITY_LEARNED,
    SENSITIVITY_ONE,
    SENSITIVITY_OWN,
    LiveSignature,
    Settings,
)

#: Seconds of the paper's window.
_PAPER_WINDOW = 0.5
#: The share of the sensitivity that is left when joints are done without. Strangers' takes with a frozen arm are then
#: named no more often than without a fault (`kinespace evaluate faults`, 726 s of 9 persons).
_FEWER = 0.6


def index_for(library: MotionLibrary | WindowIndex, settings: Settings) -> WindowIndex:
    """Give a library's windows as the settings compare them; opened here if they are not, which takes long.

    Raises
    ------
    ValueError
        The library is of another type, or no motion is long enough for a window.
    """
    if not isinstance(library, MotionLibrary | WindowIndex):
        raise ValueError(f"library: expected a MotionLibrary or its windows, got {type(library).__name__}")  # noqa: TRY004
    if settings.signature is LiveSignature.PAPER:
        weighing = by_paper(_PAPER_WINDOW if settings.window is None else settings.window)
        if isinstance(library, WindowIndex) and library.comparison.weighing == weighing:
            return library
        return opened(library.framed if isinstance(library, WindowIndex) else library, weighing)
    return library if isinstance(library, WindowIndex) else opened(library)


def usual_sensitivity(library: MotionLibrary) -> float:
    """Give the sensitivity for a library when none is set."""
    if library.judged_by_strangers:
        return SENSITIVITY_LEARNED
    if len(library.motions) == len({motion.class_name for motion in library.motions}):
        return SENSITIVITY_ONE
    several = not _is_one_persons(library)
    return SENSITIVITY_CAMERA if several and kinds_of(library) == {"guessed"} else SENSITIVITY_OWN


def needed_lead(library: MotionLibrary, settings: Settings) -> float:
    """Give the lead that a class of a library needs before a start event."""
    if settings.lead is not None:
        return settings.lead
    one = settings.signature is LiveSignature.WINDOWS and _is_one_persons(library)
    return LEAD_ONE if one else LEAD_USUAL


def _is_one_persons(library: MotionLibrary) -> bool:
    """Whether one person's own motions teach a library what is unknown."""
    return not library.judged_by_strangers and len(library.actors) <= 1


def threshold_for(index: WindowIndex, settings: Settings, *, of_fewer: bool = False) -> float:
    """Give the evidence, as a logit, from which a guess is known; less is named where joints are left out (`of_fewer`).

    Of no effect where the comparison does not judge.
    """
    if not index.comparison.weighing.judges:
        return -math.inf
    sensitivity = usual_sensitivity(index.library) if settings.sensitivity is None else settings.sensitivity
    return index.rejection.threshold_at(sensitivity * (_FEWER if of_fewer else 1.0))
