"""The paper's way: the leading eigenvector of one window, by inner products with those of whole motions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from library.signature import Signature, signature_of
from stream.covariance import RollingCovariance
from stream.matcher import Reading
from stream.recognition import Outcome
from stream.window import MOST_PENDING, SlidingWindow

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from library.eigen import LeadingAxis
    from library.motionlibrary import MotionLibrary

#: Frames taken into the covariance at once when hops are further apart.
_BATCH = MOST_PENDING // 4


class EigenvectorMatcher:
    """Compares the leading eigenvector of the last seconds with every motion's.

    Parameters
    ----------
    library
        The motions.
    window
        Length of the window, seconds; there is no reading before the feed has been followed for that long.
    stillness, smallest_gap
        As `stream.recognizer.Settings` has them.
    """

    def __init__(self, library: MotionLibrary, *, window: float, stillness: float, smallest_gap: float) -> None:
        self._library = library
        self._stillness = stillness
        self._smallest_gap = smallest_gap
        width = len(library.skeleton.pairs)
        self._window = SlidingWindow(window, width)
        self._covariance = RollingCovariance(width)
        self._axis: LeadingAxis | None = None

    def clear(self) -> None:
        """Forget all rows."""
        self._window.clear()
        self._covariance.clear()
        self._axis = None

    def push(self, time: float, row: NDArray[np.float64]) -> None:
        """Take in one distance row."""
        self._window.push(time, row)
        if self._window.pending >= _BATCH:
            self._settle()

    def _settle(self) -> None:
        if self._window.pending:
            self._covariance.update(*self._window.take_change(), self._window.rows)

    @property
    def ready(self) -> bool:
        """Whether rows have come for the window's whole length."""
        return self._window.full

    def read(self) -> Reading:
        """Compare the window that ends with the newest row."""
        self._settle()
        signature = signature_of(self._covariance.moments(), self._axis)
        self._axis = signature.axis
        scores = self._library.match(signature).class_scores
        return Reading(
            outcome=self._outcome(signature),
            scores=scores,
            best=int(np.argmax(scores)),
            movement=signature.movement,
            axis=signature.axis,
        )

    def _outcome(self, signature: Signature) -> Outcome:
        if signature.movement < self._stillness:
            return Outcome.STILL
        if signature.axis.gap < self._smallest_gap:
            return Outcome.AMBIGUOUS
        return Outcome.NAMED
