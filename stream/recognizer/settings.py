"""How a live feed is recognised: the settings of one recogniser, checked once, and what they mean for a library."""

import math
from dataclasses import dataclass, fields
from enum import StrEnum
from numbers import Real
from typing import Literal

from kinespace.library import MotionLibrary, WindowIndex, opened
from kinespace.library.windows.paper import by_paper
from kinespace.stream.recognizer.fitting import kinds_of

#: Share of unknown time that may be named where strangers' motions taught the library unknown motion.
SENSITIVITY_LEARNED = 0.05
#: The same where the library's own classes did.
SENSITIVITY_OWN = 0.2
#: The same where several people taught them before cameras: other movement looks more like theirs than their own other
#: classes do (tests/TRIED.md).
SENSITIVITY_CAMERA = 0.025
#: The same where each class has a single motion: share of everyday movement.
SENSITIVITY_ONE = 0.07
#: Lead that a class needs before a start event.
LEAD_USUAL = 3.0
#: The same in a library of one person that learned what is unknown from its own classes: one example of each shows less
#: surely what is unknown.
LEAD_ONE = 3.6
#: Motions an hour that may be found to be done though they were not.
FALSE_ALARMS = 6.0
#: Seconds between answers, at most.
MAX_HOP = 60.0
#: Seconds of the paper's window, and of a gap, at most: every machine has memory for them.
MAX_WINDOW = 60.0
#: Seconds between two answers, at least, unless every frame is answered (0).
MIN_HOP = 1e-3


class LiveSignature(StrEnum):
    """The signature by which live windows are compared with the library's windows."""

    #: All parts read off the covariance, over several lengths of time (`library.signature.parts`).
    WINDOWS = "windows"
    #: The leading eigenvector of one window, unweighted, by |inner products| (Le Naour et al. 2012).
    PAPER = "paper"


@dataclass(frozen=True, slots=True)
class Settings:
    """How a live feed is recognised.

    Attributes
    ----------
    signature
        The signature that is compared; also as its text, "windows" or "paper".
    window
        Length of the paper's window, seconds; None is 0.5. PAPER only: WINDOWS has lengths of its own, from a quarter
        of a second to two.
    sensitivity
        Share of the time of unknown motions that may be answered with a class. The library estimates it from the
        motions that taught it what is unknown; None is 0.05 where strangers' motions did (`kinespace learn`), and 0.2
        where its own classes did, each left out in turn, which are harder to distinguish; 0.07 where each has
        a single motion, 0.025 where they are of several persons before cameras. A larger share answers more, of known
        and of unknown motions. WINDOWS only.
    hop
        Seconds between answers, at most 60; 0 answers every frame.
    lead
        How clear a lead, added up over time, a class needs before a start event (`stream.recognizer.decision`): a
        larger lead makes events later and surer. None is 3, and 3.6 in a library of one person that learned what is
        unknown from its own classes.
    longest_gap
        Seconds without a frame after which the window starts again, because the movement in between is unknown. The
        longest window is an upper limit: after that time nothing is left in it.
    stillness
        Movement, relative to the body's size, below which a window is still. The default, 1 %, is about 8 mm for an
        adult: a tenth of the quietest motion of the built-in library, twenty times a marker's noise.
    progress
        Whether to say with each answer how far in its motion the performer is, how fast and how large. WINDOWS only.
    false_alarms
        Motions an hour that may be found to be done though they were not (`stream.recognizer.done`): a limit learned
        from strangers' movement. 0 looks for none. WINDOWS only; with the paper's signature none is looked for.
    plausibility
        Whether joints that cannot be believed are left out, and windows begin again after a jump of the body
        (`stream.recognizer.joints`). Without it every joint of every frame is believed.

    Raises
    ------
    ValueError
        A value is of another type or not finite, window or longest_gap is not above 0 and at most 60, another value is
        negative, sensitivity is above 1, hop neither 0 nor from 0.001 to 60, or a value is given that does not apply to
        the signature.
    """

    signature: LiveSignature | Literal["windows", "paper"] = LiveSignature.WINDOWS
    window: float | None = None
    sensitivity: float | None = None
    lead: float | None = None
    hop: float = 1 / 30
    longest_gap: float = 0.5
    stillness: float = 0.01
    progress: bool = False
    false_alarms: float = FALSE_ALARMS
    plausibility: bool = True

    def __post_init__(self) -> None:
        self._check_types()
        needed, names = LiveSignature.PAPER, ["window"]
        if self.signature is LiveSignature.PAPER:
            needed, names = LiveSignature.WINDOWS, ["sensitivity", "progress"]
        for name in names:
            if getattr(self, name) is not None and getattr(self, name) is not False:
                raise ValueError(f"{name}: expected the signature {needed} with it, got {self.signature}")
        for name in ("window", "longest_gap"):
            value = getattr(self, name)
            if value is not None and not 0 < value <= MAX_WINDOW:
                raise ValueError(f"{name}: expected more than 0 and at most {MAX_WINDOW:g} seconds, got {value}")
        for name in ("sensitivity", "lead", "hop", "stillness", "false_alarms"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name}: expected a number not below 0, got {value}")
        if self.sensitivity is not None and self.sensitivity > 1:
            raise ValueError(f"sensitivity: expected a share from 0 to 1, got {self.sensitivity}")
        if self.hop and not MIN_HOP <= self.hop <= MAX_HOP:
            raise ValueError(f"hop: expected 0, or {MIN_HOP:g} to {MAX_HOP:g} seconds, got {self.hop}")

    @property
    def promised(self) -> float:
        """False alarms an hour that are promised of motions that were done; 0 where none is looked for."""
        return self.false_alarms if self.signature is LiveSignature.WINDOWS else 0.0

    def _check_types(self) -> None:
        if self.signature not in tuple(LiveSignature):
            raise ValueError(f"signature: expected {' or '.join(LiveSignature)}, got {self.signature!r}")
        object.__setattr__(self, "signature", LiveSignature(self.signature))
        for each in fields(self)[1:]:
            value, kind = getattr(self, each.name), type(each.default)
            number = isinstance(value, Real) and not isinstance(value, bool)
            if not (isinstance(value, bool) if kind is bool else number or (value is None and each.default is None)):
                expected = "True or False" if kind is bool else "a number"
                raise ValueError(f"{each.name}: expected {expected}, got {value!r}")


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


def sensitivity_for(library: MotionLibrary, settings: Settings) -> float:
    """Give the sensitivity for a library: as set, else as what taught it demands."""
    if settings.sensitivity is not None:
        return settings.sensitivity
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

    By the paper's signature every guess is known: −inf.
    """
    if index.comparison.weighing.as_in_paper:
        return -math.inf
    return index.rejection.threshold_at(sensitivity_for(index.library, settings) * (_FEWER if of_fewer else 1.0))
