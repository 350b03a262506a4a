"""The recogniser of one performer: frames go in with their time, recognitions come out.

No socket, clock, thread or print in here. It sorts out frames that come late, starts anew after gaps, and keeps the
hops; what is made of the windows is the matcher's: the paper's leading eigenvector, or several measures at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from library.distances import DistanceMeasurer
from stream.eigenmatcher import EigenvectorMatcher
from stream.events import EventDetector
from stream.recognition import Recognition
from stream.windowmatcher import WindowMatcher

if TYPE_CHECKING:
    from collections.abc import Sequence

    from library.motionlibrary import MotionLibrary
    from stream.frame import Frame
    from stream.matcher import Matcher, Reading
    from stream.recognition import Event


#: Frames that wait for the next hop to be measured together, at most.
_MOST_WAITING = 16
#: A frame's time rounds; so much of a hop early is on time.
_EARLY = 1e-3


class LiveSignature(StrEnum):
    """By what a live window is compared with the library."""

    #: Spread, shape and posture of several windows, by the nearest windows of the library's motions.
    WINDOWS = "windows"
    #: The paper's: the leading eigenvector of one window, by inner products with those of whole motions.
    EIGENVECTOR = "eigenvector"


@dataclass(frozen=True, slots=True)
class Settings:
    """How a live feed is recognised.

    Attributes
    ----------
    signature
        By what windows are compared. WINDOWS needs a library that keeps them; None is WINDOWS with such a library,
        else EIGENVECTOR.
    window
        Length of the eigenvector's sliding window, seconds. It ends with the newest frame: an answer speaks of the
        last `window` seconds, and the first one comes when the feed has been followed for that long. WINDOWS has
        lengths of its own, from an eighth of a second to two.
    sensitivity
        Share of the time of motions the library does not know that may be answered with a class, as far as its own
        classes, each left out in turn, can tell. More answers more, of known and of unknown motions. WINDOWS only.
    hop
        Seconds between answers; 0 answers every frame.
    lead
        How clear a lead, added up over time, a class needs before a start event: more is later and surer.
    longest_gap
        Seconds without a frame after which the window starts anew, because what happened in between is not known.
        With a gap as long as the longest window it always does: nothing would be left in it.
    stillness
        Movement, relative to the body's size, below which a window is still. The default, 1 %, is about 8 mm for an
        adult: a tenth of the quietest motion of the built-in library, twenty times a markers' noise.
    smallest_gap
        (λ₁ − λ₂) / λ₁ below which the leading eigenvector is too arbitrary to be compared.
    patience
        How many frames in a row may be older than the newest before the sender is taken to have started anew. One
        older than the longest window says so at once.

    Raises
    ------
    ValueError
        A value is not finite, window or longest_gap not positive, another negative.
    """

    signature: LiveSignature | None = None
    window: float = 1.0
    sensitivity: float = 0.22
    lead: float = 3.0
    hop: float = 1 / 30
    longest_gap: float = 0.5
    stillness: float = 0.01
    smallest_gap: float = 0.02
    patience: int = 10

    def __post_init__(self) -> None:
        for name in ("window", "longest_gap"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name}: expected a positive number of seconds, got {value}")
        for name in ("sensitivity", "lead", "hop", "stillness", "smallest_gap", "patience"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name}: expected a number not below 0, got {value}")


@dataclass(slots=True)
class RecognizerCounts:
    """What a recogniser did with the frames it was given."""

    #: Frames taken into the window.
    frames: int = 0
    #: Frames refused because they were not newer than the newest.
    out_of_order: int = 0
    #: Times the window was started anew: after a gap, or a sender that began again.
    restarts: int = 0
    #: Windows answered.
    hops: int = 0
    #: Hops for which the exact eigensolver was needed.
    exact: int = 0


class Recognizer:
    """Names the motion in the last seconds of one performer's feed.

    Parameters
    ----------
    library
        The motions to compare with.
    settings
        How to; the defaults suit feeds of 20 to 500 frames per second.

    Attributes
    ----------
    counts
        What became of the frames.
    matcher
        What compares this performer's windows with the library.
    """

    def __init__(self, library: MotionLibrary, settings: Settings | None = None) -> None:
        self.library = library
        self.settings = settings or Settings()
        self.counts = RecognizerCounts()
        self.matcher: Matcher = _matcher(library, self.settings)
        self._detector = EventDetector(self.settings.lead)
        self._shape = (len(library.skeleton.joints), 3)
        self._positions = np.empty((_MOST_WAITING, *self._shape))
        self._rows = np.empty((_MOST_WAITING, len(library.skeleton.pairs)))
        self._measurer = DistanceMeasurer(library.skeleton, _MOST_WAITING)
        self._times: list[float] = []
        self._longest_gap = min(self.settings.longest_gap, self.matcher.longest)
        self._early = _EARLY * self.settings.hop
        # Of no frame at all none is older, and none comes after a gap: nothing compares with a NaN.
        self._newest = math.nan
        self._last = -math.inf
        self._due = -math.inf
        self._late_in_a_row = 0
        self._unanswered: Frame | None = None

    def reset(self) -> None:
        """Forget the window, as when the feed begins; the counts stay, and what is going on till something ends it."""
        self.matcher.clear()
        self._times.clear()
        self._newest, self._due = math.nan, -math.inf
        self._late_in_a_row = 0
        self._unanswered = None

    def push(self, frame: Frame) -> Recognition | None:
        """Take in a frame.

        Parameters
        ----------
        frame
            Positions in the order of the library's skeleton, (joints, 3), metres. The performer is passed on.

        Returns
        -------
        A recognition when one is due, else None: between hops, while the first window fills, or when the frame was
        refused because it was not newer than the newest (counted).

        Raises
        ------
        ValueError
            The frame has another number of joints than the library's skeleton.
        """
        return self.answer_with(())[0] if self.take(frame) else None

    def take(self, frame: Frame) -> bool:
        """Take in a frame as `push` does, but leave the answer to `answer_with`.

        Returns
        -------
        Whether an answer is due. It must be asked for before the next frame is taken in.

        Raises
        ------
        ValueError
            The frame has another number of joints than the library's skeleton, or the answer to the one before was not
            asked for.
        """
        positions, time = frame.positions, frame.time
        if positions.shape != self._shape:
            raise ValueError(f"positions: expected {self._shape}, got {positions.shape}")
        if self._unanswered is not None:
            raise ValueError(f"frame: expected after the answer to that of {self._unanswered.time} s was asked for")
        if not self._in_time(time):
            return False
        self._positions[len(self._times)] = positions
        self._times.append(time)
        self._newest = self._last = time
        self.counts.frames += 1
        due = time >= self._due - self._early
        if due or len(self._times) == _MOST_WAITING:
            self._measure()
        if not (due and self.matcher.ready):
            return False
        self._set_due(time)
        self._unanswered = frame
        return True

    def answer_with(self, others: Sequence[Recognizer]) -> list[Recognition]:
        """Answer the frames last taken in of several performers: their windows are measured and compared in one go.

        Parameters
        ----------
        others
            Other performers' recognisers, with the same library and settings.

        Returns
        -------
        One's own answer first, then the others': but for rounding what each alone would answer.

        Raises
        ------
        ValueError
            For one of them no answer is due.
        """
        everybody = (self, *others)
        if any(each.unanswered is None for each in everybody):
            raise ValueError("others: expected recognisers for which an answer is due")
        readings = self.matcher.read_with([each.matcher for each in others])
        return [each.recognized(reading) for each, reading in zip(everybody, readings, strict=True)]

    def _measure(self) -> None:
        """Measure the frames that came since the last hop, all in one go: that halves their cost."""
        count = len(self._times)
        rows = self._rows[:count]
        self._measurer.measure(self._positions[:count], rows)
        self.matcher.push(self._times, rows)
        self._times.clear()

    def _in_time(self, time: float) -> bool:
        """Sort out frames that come late; start anew after a gap or when the sender's clock began again."""
        behind = self._newest - time
        if behind < -self._longest_gap:
            self._restart()
        elif behind >= 0:
            self._late_in_a_row += 1
            if behind <= self.matcher.longest and self._late_in_a_row <= self.settings.patience:
                self.counts.out_of_order += 1
                return False
            self._restart()
        self._late_in_a_row = 0
        return True

    def _restart(self) -> None:
        self.reset()
        self.counts.restarts += 1

    def _set_due(self, time: float) -> None:
        """Keep hops on a grid, so that their mean distance is the hop whatever the frame rate."""
        hop = self.settings.hop
        self._due = self._due + hop if self._due + hop > time else time + hop

    @property
    def unanswered(self) -> Frame | None:
        """The frame that was taken in and for which an answer is due; None when none is."""
        return self._unanswered

    def recognized(self, reading: Reading) -> Recognition:
        """Make the answer to the frame last taken in of what was read; `answer_with` does it for all.

        Raises
        ------
        ValueError
            No answer is due.
        """
        frame, self._unanswered = self._unanswered, None
        if frame is None:
            raise ValueError("reading: expected when an answer is due")
        axis = reading.axis
        self.counts.hops += 1
        self.counts.exact += bool(axis and axis.exact)
        recognition = Recognition(
            performer=frame.performer,
            time=frame.time,
            outcome=reading.outcome,
            classes=self.library.classes,
            scores=reading.scores,
            guess=reading.best,
            movement=reading.movement,
            share=axis.share if axis else None,
            gap=axis.gap if axis else None,
            residual=axis.residual if axis else None,
        )
        events = self._detector.push(recognition)
        return replace(recognition, events=events) if events else recognition

    def end(self) -> Event | None:
        """End the motion that is going on, because nothing more will come; None when none is."""
        return self._detector.end(self._last)


def _matcher(library: MotionLibrary, settings: Settings) -> Matcher:
    if library.windows is None and settings.signature is LiveSignature.WINDOWS:
        raise ValueError("signature: expected a library with windows for it, got one of whole motions only")
    if library.windows is None or settings.signature is LiveSignature.EIGENVECTOR:
        return EigenvectorMatcher(
            library,
            window=settings.window,
            stillness=settings.stillness,
            smallest_gap=settings.smallest_gap,
        )
    return WindowMatcher(
        library.windows,
        stillness=settings.stillness,
        sensitivity=settings.sensitivity,
    )
