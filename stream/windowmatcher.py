"""Beyond the paper: spread, shape and posture of several windows at once, by their nearest windows in the library.

The class with the nearest window changes back and forth at a change of motion. The guess therefore stays with a class
until another has led without a break for long enough: the lead, in the logarithm of the distance, is added up hop by
hop. A clear lead changes the guess at once, a doubtful one takes a moment; no time is lost to a fixed delay.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from stream.matcher import Reading
from stream.measuring import WindowMeasurer
from stream.recognition import Outcome

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from library.skeleton import Skeleton
    from library.windowtable import WindowTable

#: Seconds after which a feed is answered, even if the shortest window is longer.
_FIRST_ANSWER = 0.5
#: Lead, in log distance times thirtieths of a second, after which the guess changes.
_LEAD = 0.6
#: Seconds over which the distance is averaged that says whether a motion is known.
_KNOWN_OVER = 0.3
_SECONDS_PER_LEAD = 1 / 30
#: Log distance by which a motion that is named may fall behind its threshold before it is unknown: without it a
#: motion at the threshold flickers.
_HELD = 0.3


class WindowMatcher:
    """Compares several windows of the last seconds with the library's windows.

    Parameters
    ----------
    skeleton
        The library's.
    table
        Its windows.
    stillness, sensitivity
        As `stream.recognizer.Settings` has them.
    """

    def __init__(self, skeleton: Skeleton, table: WindowTable, *, stillness: float, sensitivity: float) -> None:
        self._table = table
        self._thresholds = table.thresholds_at(sensitivity)
        self._measurer = WindowMeasurer(skeleton, table.measures, table.comparison.basis)
        # Whoever moves steadily swings the less the shorter one looks.
        self._stillness = stillness * min(1.0, self._measurer.longest)
        self._first_answer = min(_FIRST_ANSWER, *(measure.seconds for measure in table.measures))
        self.clear()

    def clear(self) -> None:
        """Forget all rows."""
        self._measurer.clear()
        self._since = self._now = self._read_at = math.nan
        self._guess = self._leader = -1
        self._lead = 0.0
        self._known = False
        self._averaged: NDArray[np.float64] | None = None

    def push(self, time: float, row: NDArray[np.float64]) -> None:
        """Take in one distance row."""
        if math.isnan(self._since):
            self._since = time
        self._now = time
        self._measurer.push(time, row)

    @property
    def ready(self) -> bool:
        """Whether enough has been seen to measure the shortest window, or half a second."""
        return self._measurer.ready and self._now - self._since >= self._first_answer

    def read(self) -> Reading:
        """Compare the windows that end with the newest row."""
        distances = self._table.log_distances(self._measurer.measures())
        elapsed = _SECONDS_PER_LEAD if math.isnan(self._read_at) else self._now - self._read_at
        self._read_at = self._now
        self._follow(distances, elapsed)
        averaged = self._average(distances, elapsed)
        beyond = float(averaged[self._guess] - self._thresholds[self._guess])
        self._known = beyond <= (_HELD if self._known else 0.0)
        movement = self._measurer.movement
        outcome = Outcome.NAMED if self._known else Outcome.UNKNOWN
        if movement < self._stillness:
            outcome = Outcome.STILL
        return Reading(outcome, 1 / (1 + np.exp(distances)), self._guess, movement)

    def _follow(self, distances: NDArray[np.float64], elapsed: float) -> None:
        """Let the guess go over to a class that has led for long enough."""
        leader = int(distances.argmin())
        if leader != self._leader:
            self._leader, self._lead = leader, 0.0
        if len(distances) > 1:
            self._lead += float(np.partition(distances, 1)[1] - distances[leader]) * elapsed / _SECONDS_PER_LEAD
        if self._guess < 0 or self._lead >= _LEAD:
            self._guess = leader

    def _average(self, distances: NDArray[np.float64], elapsed: float) -> NDArray[np.float64]:
        """Average log distances over the last moments, exponentially."""
        if self._averaged is None:
            self._averaged = distances.copy()
        self._averaged += -math.expm1(-elapsed / _KNOWN_OVER) * (distances - self._averaged)
        return self._averaged
