"""Matchers: they compare a performer's windows with the library, by the default signature or by the paper's."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from kinespace.library.motion_library import NOTHING, MotionLibrary
from kinespace.library.progress.phase_table import phase_table
from kinespace.library.windows.cutting import FIRST_WINDOW
from kinespace.library.windows.index import opened
from kinespace.library.windows.paper import opened_by_paper
from kinespace.stream.recognition import Outcome
from kinespace.stream.recognizer.decision import FIRST_HOP, Decision, followed, places_in, usual_sensitivity
from kinespace.stream.recognizer.hysteresis import LEAD, Hysteresis
from kinespace.stream.recognizer.progress import ProgressFollower
from kinespace.stream.recognizer.windows.live_windows import LiveWindows, PaperWindow

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kinespace.library.windows.index import WindowIndex
    from kinespace.library.windows.paper import PaperIndex
    from kinespace.library.windows.rejection import Evidence
    from kinespace.stream.recognition import Progress

#: Frames that a window needs at least.
_MIN_FRAMES = 3
#: Seconds within which two spans count as equal, because frame times are rounded
#: (`stream.recognizer.windows.sliding_window`).
_TIE = 1e-6
#: The share of the sensitivity that is left when joints are done without. Strangers' takes with a frozen arm are then
#: named no more often than without a fault (`kinespace evaluate faults`, 726 s of 9 persons).
_FEWER = 0.6
#: Added to 1 − |inner product|² before the logarithm.
_NEAREST = 1e-3


class Reading(NamedTuple):
    """A matcher's view of the windows that end now.

    Attributes
    ----------
    outcome
        Whether the guess is named, else why not.
    distances
        Log distance of each class of the library, shape (classes,).
    guess
        Index of the best guess among these classes.
    lead
        Log distance by which the guess is ahead of all other classes, below 0 while it is held.
    movement, eigenvector_class, eigenvector_score, share, gap, evidence
        The same as for `stream.recognition.Recognition`.
    """

    outcome: Outcome
    distances: NDArray[np.float64]
    guess: int
    lead: float
    movement: float
    eigenvector_class: int
    eigenvector_score: float
    share: float
    gap: float
    evidence: Evidence | None = None


class Matcher(Protocol):
    """Keeps one performer's last seconds and compares them with a library.

    Attributes
    ----------
    longest
        Length of its longest window, seconds: older frames do not change a reading.
    classes
        The class names of its library that have windows, sorted; a reading's indices count in them.
    """

    longest: float
    classes: tuple[str, ...]

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows (frames, pairs), metres, at their times, seconds, all later than those before."""

    def clear(self) -> None:
        """Forget all rows."""

    def read(self, noise: float = 0.0) -> Reading | None:
        """Compare the windows that end with the newest row, once a hop; None while there is too little to compare.

        Parameters
        ----------
        noise
            Standard deviation of a distance's noise, metres.
        """

    def follow(self, time: float, class_name: str | None) -> Progress | None:
        """Say how far the body is in the motion of a class, at the newest row; None unless progress was asked for."""

    def exchange(self, library: MotionLibrary | WindowIndex) -> None:
        """Compare the same windows with another library of the same joints from now on."""

    def pair_contributions(self) -> NDArray[np.float64] | None:
        """Give each joint pair's share of the variance along the leading eigenvector read last; None before."""


def library_of(library: MotionLibrary | WindowIndex) -> MotionLibrary:
    """Give the motions of a library, opened or not; ValueError for anything else."""
    motions: object = library if isinstance(library, MotionLibrary) else getattr(library, "library", None)
    if not isinstance(motions, MotionLibrary):
        raise ValueError(f"library: expected a MotionLibrary or its windows, got {type(library).__name__}")  # noqa: TRY004
    return motions


def index_of(library: MotionLibrary | WindowIndex) -> WindowIndex:
    """Give the windows of a library, opened or not."""
    return opened(library) if isinstance(library, MotionLibrary) else library


class _Feed:
    """How long a feed has been followed, and how long ago it was last read."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        self._frames = 0
        self._since = self._now = self._read_at = math.nan

    def push(self, times: Sequence[float]) -> None:
        if not self._frames:
            self._since = times[0]
        self._frames += len(times)
        self._now = times[-1]

    @property
    def ready(self) -> bool:
        return self._frames >= _MIN_FRAMES and self._now - self._since >= FIRST_WINDOW - _TIE

    def elapsed(self) -> float:
        """Give the seconds since the last call."""
        elapsed = FIRST_HOP if math.isnan(self._read_at) else self._now - self._read_at
        self._read_at = self._now
        return elapsed


class WindowMatcher:
    """Compares a performer's signature, all its parts, with the windows of the library.

    Parameters
    ----------
    index
        The library's windows.
    stillness, sensitivity, progress
        The same as for `stream.recognizer.settings.Settings`.
    """

    def __init__(
        self, index: WindowIndex, *, stillness: float, sensitivity: float | None, progress: bool = False
    ) -> None:
        self._windows = LiveWindows(index.body, index.basis, index.comparison.weighing.parts)
        self.longest = self._windows.longest
        self._stillness, self._sensitivity = stillness, sensitivity
        self._decision = Decision(index, stillness=stillness, sensitivity=sensitivity)
        self._feed = _Feed()
        self._progress = ProgressFollower(phase_table(index)) if progress else None
        self._index, self.classes = index, index.classes
        self._leading: NDArray[np.float64] | None = None

    def set_sensitivity(self, share: float) -> None:
        """Judge by another sensitivity from the next reading on."""
        self._sensitivity = share
        self._decision.set_sensitivity(share, self._index)

    def pair_contributions(self) -> NDArray[np.float64] | None:
        """Say what each joint pair gives to the variance along the leading eigenvector read last."""
        return None if self._leading is None else self._windows.contributions(self._leading)

    def exchange(self, library: MotionLibrary | WindowIndex) -> None:
        """Compare the same windows with another library of the same joints from now on."""
        index = index_of(library)
        self._windows.exchange(index.body, index.basis, index.comparison.weighing.parts)
        self._decision.exchange(index)
        if self._progress:
            self._progress.exchange(phase_table(index))
        self._index, self.classes, self._leading = index, index.classes, None

    def clear(self) -> None:
        """Forget all rows."""
        self._windows.clear()
        self._decision.clear()
        self._feed.clear()
        if self._progress:
            self._progress.clear()

    def follow(self, time: float, class_name: str | None) -> Progress | None:
        """Say how far the body is in the motion of a class, at the newest row; None unless progress was asked for."""
        return self._progress.push(time, self._windows.place(), class_name) if self._progress else None

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows."""
        if len(times):
            self._feed.push(times)
            self._windows.push(times, rows)

    def over(self, index: WindowIndex) -> WindowMatcher:
        """Give a matcher that compares with windows of fewer joints, and names less."""
        sensitivity = usual_sensitivity(index.library) if self._sensitivity is None else self._sensitivity
        return WindowMatcher(index, stillness=self._stillness, sensitivity=_FEWER * sensitivity)

    def recent(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give times (frames,) and rows (frames, pairs) in the longest window; valid until the next push."""
        return self._windows.recent()

    def read(self, noise: float = 0.0) -> Reading | None:
        """Compare the windows that end with the newest row."""
        if not self._feed.ready:
            return None
        signature = self._windows.read()
        self._leading = signature.eigenvector
        logs = self._index.log_distances(signature.numbers)
        movement, share, gap = signature.movement, signature.share, signature.gap
        outcome, distances, guess, lead, evidence = self._decision.push(logs, movement, noise, self._feed.elapsed())
        scores = self._index.eigenvector_scores(signature.eigenvector)
        best = int(scores.argmax())
        # By place, because a call costs by its arguments' names.
        return Reading(outcome, distances, guess, lead, movement, best, scores.item(best), share, gap, evidence)


class PaperMatcher:
    """Compares as Le Naour et al. (2012) do: the leading eigenvector of one window, by |inner products|.

    Parameters
    ----------
    index
        The leading eigenvectors of the library's windows.
    stillness, smallest_gap
        The same as for `stream.recognizer.settings.Settings`.
    """

    def __init__(self, index: PaperIndex, *, stillness: float, smallest_gap: float) -> None:
        self._window = PaperWindow(index.basis, index.seconds)
        self.longest = index.seconds
        self._stillness, self._smallest_gap = stillness, smallest_gap
        self._hysteresis = Hysteresis(LEAD)
        self._feed = _Feed()
        self._compare_with(index)

    def _compare_with(self, index: PaperIndex) -> None:
        self._index, self.classes = index, index.classes
        self._leading: NDArray[np.float64] | None = None
        self._nothing = index.classes.index(NOTHING) if NOTHING in index.classes else -1

    def pair_contributions(self) -> NDArray[np.float64] | None:
        """Say what each joint pair gives to the variance along the leading eigenvector read last."""
        return None if self._leading is None else self._window.contributions(self._leading)

    def exchange(self, library: MotionLibrary | WindowIndex) -> None:
        """Compare the same window with another library of the same joints from now on."""
        index = opened_by_paper(library_of(library), self.longest)
        self._window.exchange(index.basis)
        self._hysteresis.exchange(places_in(self.classes, index.classes))
        self._compare_with(index)

    def clear(self) -> None:
        """Forget all rows."""
        self._window.clear()
        self._hysteresis.clear()
        self._feed.clear()

    def follow(self, time: float, class_name: str | None) -> Progress | None:  # noqa: ARG002 - no progress
        """Give None: the paper's signature has no order in time."""
        return None

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows."""
        if len(times):
            self._feed.push(times)
            self._window.push(times, rows)

    def read(self, noise: float = 0.0) -> Reading | None:  # noqa: ARG002 - the paper ignores noise
        """Compare the window that ends with the newest row."""
        if not self._feed.ready:
            return None
        leading, moved = self._window.read()
        self._leading = leading.eigenvector
        scores = self._index.scores(leading.eigenvector)
        distances = np.log1p(_NEAREST - np.square(np.minimum(scores, 1.0)))
        guess, lead = followed(self._hysteresis, distances, self._feed.elapsed())
        outcome = Outcome.UNKNOWN if guess == self._nothing else Outcome.NAMED
        if leading.gap < self._smallest_gap:
            outcome = Outcome.AMBIGUOUS
        if moved < self._stillness:
            outcome = Outcome.STILL
        best = int(scores.argmax())
        return Reading(
            outcome=outcome,
            distances=distances,
            guess=guess,
            lead=lead,
            movement=moved,
            eigenvector_class=best,
            eigenvector_score=scores.item(best),
            share=leading.share,
            gap=leading.gap,
        )
