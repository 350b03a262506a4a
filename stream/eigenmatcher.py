"""The paper's way: the leading eigenvector of one window, by inner products with those of whole motions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np

from library.signature import movement_of
from stream.leading import RollingAxis
from stream.matcher import Reading
from stream.recognition import Outcome
from stream.window import SlidingWindow

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from library.eigen import LeadingAxis
    from library.motionlibrary import MotionLibrary


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
        self.longest = window
        width = len(library.skeleton.pairs)
        self._window = SlidingWindow(window, width)
        self._axis = RollingAxis(width)

    def clear(self) -> None:
        """Forget all rows."""
        self._window.clear()
        self._axis.clear()

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows."""
        self._window.push(times, rows)
        self._axis.update(*self._window.take_change(), self._window.rows)

    @property
    def ready(self) -> bool:
        """Whether rows have come for the window's whole length."""
        return self._window.full

    def read(self) -> Reading:
        """Compare the window that ends with the newest row."""
        body_size, axis = self.leading()
        return self.judged(body_size, axis, self._library.class_scores(axis.vector))

    def read_with(self, others: Sequence[Self]) -> list[Reading]:
        """Compare the windows of several performers: one's own first, then the others'."""
        if not others:
            return [self.read()]
        everybody = (self, *others)
        leading = [each.leading() for each in everybody]
        scores = self._library.class_scores(np.array([axis.vector for _, axis in leading]))
        return [each.judged(*lead, own) for each, lead, own in zip(everybody, leading, scores, strict=True)]

    def leading(self) -> tuple[float, LeadingAxis]:
        """Give the body's size, metres, and the window's leading axis; once per hop, since it starts at the last."""
        return self._axis.leading(self._window.rows)

    def judged(self, body_size: float, axis: LeadingAxis, scores: NDArray[np.float32]) -> Reading:
        """Make a reading of the window's axis and each class's score, (classes,)."""
        movement = movement_of(body_size, axis.total, len(axis.vector))
        return Reading(
            outcome=self._outcome(movement, axis.gap),
            scores=scores,
            best=int(scores.argmax()),
            movement=movement,
            axis=axis,
        )

    def _outcome(self, movement: float, gap: float) -> Outcome:
        if movement < self._stillness:
            return Outcome.STILL
        if gap < self._smallest_gap:
            return Outcome.AMBIGUOUS
        return Outcome.NAMED
