"""The recogniser of one performer: frames go in with their time, recognitions come out.

No socket, clock, thread or print in here. A frame's way: distance row, into the window, out of the window, covariance;
at a hop: leading eigenvector, match, recognition.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from library.distances import distance_rows
from library.signature import Signature, signature_of
from stream.covariance import RollingCovariance
from stream.recognition import Outcome, Recognition
from stream.window import FASTEST_FEED, SlidingWindow

if TYPE_CHECKING:
    from library.eigen import LeadingAxis
    from library.motionlibrary import MotionLibrary
    from stream.frame import Frame

#: Frames taken into the covariance at once when hops are further apart.
_BATCH = 16


@dataclass(frozen=True, slots=True)
class Settings:
    """How a live feed is recognised.

    Attributes
    ----------
    window
        Length of the sliding window, seconds. It ends with the newest frame: an answer speaks of the last `window`
        seconds, and the first one comes when the feed has been followed for that long.
    hop
        Seconds between answers; 0 answers every frame.
    longest_gap
        Seconds without a frame after which the window starts anew, because what happened in between is not known. A
        gap as long as the window always does: nothing would be left in it.
    stillness
        Movement, relative to the body's size, below which a window is still. The default, 1 %, is about 8 mm for an
        adult: a tenth of the quietest motion of the built-in library, twenty times a markers' noise.
    smallest_gap
        (λ₁ − λ₂) / λ₁ below which the leading eigenvector is too arbitrary to be compared.
    patience
        How many frames in a row may be older than the newest before the sender is taken to have started anew. One
        older than the whole window says so at once.

    Raises
    ------
    ValueError
        A value is not finite, window or longest_gap not positive, another negative.
    """

    window: float = 1.0
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
        for name in ("hop", "stillness", "smallest_gap", "patience"):
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
    """

    def __init__(self, library: MotionLibrary, settings: Settings | None = None) -> None:
        self.library = library
        self.settings = settings or Settings()
        self.counts = RecognizerCounts()
        width = len(library.skeleton.pairs)
        self._window = SlidingWindow(self.settings.window, width, FASTEST_FEED)
        self._covariance = RollingCovariance(width)
        self._axis: LeadingAxis | None = None
        self._newest = -math.inf
        self._due = -math.inf
        self._late_in_a_row = 0

    def reset(self) -> None:
        """Forget the window, as when the feed begins; the counts stay."""
        self._window.clear()
        self._covariance.clear()
        self._axis = None
        self._newest = self._due = -math.inf
        self._late_in_a_row = 0

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
        row = distance_rows(frame.positions, self.library.skeleton)
        if not self._in_time(frame.time):
            return None
        self._window.push(frame.time, row)
        self._newest = frame.time
        self.counts.frames += 1
        due = self._window.full and self._is_due(frame.time)
        if due or self._window.pending >= _BATCH:
            self._covariance.update(*self._window.take_change(), self._window.rows)
        return self._recognize(frame) if due else None

    def _in_time(self, time: float) -> bool:
        """Sort out frames that come late; start anew after a gap or when the sender's clock began again."""
        behind = self._newest - time
        if behind < -min(self.settings.longest_gap, self.settings.window) and math.isfinite(self._newest):
            self._restart()
        elif behind >= 0:
            self._late_in_a_row += 1
            if behind <= self.settings.window and self._late_in_a_row <= self.settings.patience:
                self.counts.out_of_order += 1
                return False
            self._restart()
        self._late_in_a_row = 0
        return True

    def _restart(self) -> None:
        self.reset()
        self.counts.restarts += 1

    def _is_due(self, time: float) -> bool:
        """Keep hops on a grid, so that their mean distance is the hop whatever the frame rate."""
        hop = self.settings.hop
        # A frame's time rounds; a thousandth of a hop early is on time.
        if time < self._due - 1e-3 * hop:
            return False
        self._due = self._due + hop if self._due + hop > time else time + hop
        return True

    def _recognize(self, frame: Frame) -> Recognition:
        signature = signature_of(self._covariance.moments(), self._axis)
        axis = self._axis = signature.axis
        self.counts.hops += 1
        self.counts.exact += axis.exact
        return Recognition(
            performer=frame.performer,
            time=frame.time,
            outcome=self._outcome(signature),
            classes=self.library.classes,
            scores=self.library.match(signature).class_scores,
            movement=signature.movement,
            share=axis.share,
            gap=axis.gap,
            residual=axis.residual,
        )

    def _outcome(self, signature: Signature) -> Outcome:
        if signature.movement < self.settings.stillness:
            return Outcome.STILL
        if signature.axis.gap < self.settings.smallest_gap:
            return Outcome.AMBIGUOUS
        return Outcome.NAMED
