"""What happens inside a hop, step by step: the only file that knows how the matchers do it.

`stream.eigenmatcher` and `stream.windowmatcher` are followed here with their own public parts, so that each step can be
timed by itself. When they change, this file changes with them, and no other of the bench.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from stream.eigenmatcher import EigenvectorMatcher
from stream.leading import RollingAxis
from stream.measuring import WindowMeasurer
from stream.recognizer import LiveSignature
from stream.window import MOST_PENDING, SlidingWindow

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from library import MotionLibrary
    from library.eigen import LeadingAxis
    from library.measures import Measure
    from stream.recognizer import Recognizer, Settings


class EigenvectorSteps:
    """The paper's way in steps: rows into the window; at a hop their products, eigenvector, match.

    Attributes
    ----------
    steps
        What is done at a hop, in this order, by name.
    axis
        Of the last hop; None before the first.
    """

    def __init__(self, library: MotionLibrary, settings: Settings) -> None:
        width = len(library.skeleton.pairs)
        self._library = library
        self._window = SlidingWindow(settings.window, width)
        self._rolling = RollingAxis(width)
        self.axis: LeadingAxis | None = None
        self.steps: dict[str, Callable[[], object]] = {
            "covariance": self._update,
            "eigenvector": self._solve,
            "match": self._match,
        }

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows."""
        if self._window.pending + len(times) > MOST_PENDING:
            self._update()
        self._window.push(times, rows)

    @property
    def ready(self) -> bool:
        """Whether there is a window to look at."""
        return self._window.full

    def _update(self) -> None:
        self._rolling.update(*self._window.take_change(), self._window.rows)

    def _solve(self) -> None:
        self.axis = self._rolling.leading(self._window.rows).axis

    def _match(self) -> None:
        if self.axis is not None:
            self._library.class_scores(self.axis.vector)


class WindowSteps:
    """Several windows in steps: rows into them, projected; at a hop covariance and variances, match.

    Attributes
    ----------
    steps
        What is done at a hop, in this order, by name.
    distances
        Log distance to each class at the last hop, (classes,); None before the first.
    """

    def __init__(self, library: MotionLibrary) -> None:
        if library.windows is None:
            raise ValueError("library: expected one with windows, got one of whole motions only")
        self._table = library.windows
        self._measurer = WindowMeasurer(self._table.measures, self._table.comparison.body, self._table.comparison.basis)
        self._measures: dict[Measure, NDArray[np.float64]] = {}
        self.distances: NDArray[np.float64] | None = None
        self.steps: dict[str, Callable[[], object]] = {"covariance": self._measure, "match": self._match}

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows."""
        self._measurer.push(times, rows)

    @property
    def ready(self) -> bool:
        """Whether there is a window to look at."""
        return self._measurer.ready

    def _measure(self) -> None:
        self._measures = self._measurer.read().numbers

    def _match(self) -> None:
        self.distances = self._table.log_distances(self._measures)


def steps_of(library: MotionLibrary, settings: Settings) -> EigenvectorSteps | WindowSteps:
    """Give the steps of a matcher for some settings."""
    if settings.signature is LiveSignature.EIGENVECTOR or library.windows is None:
        return EigenvectorSteps(library, settings)
    return WindowSteps(library)


def last_axis(recognizer: Recognizer) -> LeadingAxis | None:
    """Give the leading axis of the last hop's window; None when there is none.

    Answers carry no vector; whoever checks one needs the very state that has run all day.
    """
    matcher = recognizer.matcher
    return matcher.read().axis if isinstance(matcher, EigenvectorMatcher) else None
