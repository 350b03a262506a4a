"""Beyond the paper: spread, shape and posture of several windows at once, by their nearest windows in the library.

The class with the nearest window changes back and forth at a change of motion. Distances are therefore averaged over
a tenth of a second, and the guess stays with a class until another has led without a break for long enough: the lead,
in the logarithm of the distance, is added up hop by hop. A clear lead changes the guess at once, a doubtful one takes
a moment.

With fewer joints than the library's a motion is named by one distance and known by another. Scores then rank classes
by the first, and the guess's score is that of the second.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Self

import numpy as np

from library import compiled
from stream.matcher import Reading
from stream.measuring import WindowMeasurer
from stream.recognition import Outcome

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from library.windowtable import WindowTable

#: Seconds after which a feed is answered, even if the shortest window is longer.
_FIRST_ANSWER = 0.5
#: Lead, in log distance times thirtieths of a second, after which the guess changes.
_LEAD = 0.6
#: Seconds over which distances are averaged, those that are compared and those that say whether a motion is known.
_COMPARED_OVER = 0.1
_KNOWN_OVER = 0.3
_SECONDS_PER_LEAD = 1 / 30
#: Log distance by which a motion that is named may fall behind its threshold before it is unknown: without it a
#: motion at the threshold flickers.
_HELD = 0.3

#: Log distance below the threshold at which a motion need not be near for long to be known.
_CLEAR = 0.1


class WindowMatcher:
    """Compares several windows of the last seconds with the library's windows.

    Parameters
    ----------
    table
        The library's windows.
    stillness, sensitivity
        As `stream.recognizer.Settings` has them.

    Attributes
    ----------
    measurer
        Of this performer's windows.
    """

    def __init__(self, table: WindowTable, *, stillness: float, sensitivity: float) -> None:
        self._table = table
        self._threshold = table.threshold_at(sensitivity)
        self.measurer = WindowMeasurer(table.measures, table.comparison.body, table.comparison.basis)
        self.longest = max(measure.seconds for measure in table.measures)
        # Whoever moves steadily swings the less the shorter one looks.
        self._stillness = stillness * min(1.0, self.measurer.longest)
        self._first_answer = min(_FIRST_ANSWER, *(measure.seconds for measure in table.measures))
        self.clear()

    def clear(self) -> None:
        """Forget all rows."""
        self.measurer.clear()
        self._since = self._now = self._read_at = math.nan
        self._guess = self._leader = -1
        self._lead = 0.0
        self._known = False
        self._compared = _Average(_COMPARED_OVER)
        self._judged = _Average(_KNOWN_OVER)

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows."""
        if not len(times):
            return
        if math.isnan(self._since):
            self._since = times[0]
        self._now = times[-1]
        self.measurer.push(times, rows)

    @property
    def ready(self) -> bool:
        """Whether enough has been seen to measure the shortest window, or half a second."""
        return self.measurer.ready and self._now - self._since >= self._first_answer

    def read(self) -> Reading:
        """Compare the windows that end with the newest row."""
        measured = self.measurer.read()
        return self.judged(self._table.compared(measured.numbers), measured.movement)

    def read_with(self, others: Sequence[Self]) -> list[Reading]:
        """Compare the windows of several performers: one's own first, then the others'."""
        # What is compiled is as quick one by one.
        if not others or compiled.loops:
            return [each.read() for each in (self, *others)]
        numbers, movements = self.measurer.read_with([each.measurer for each in others])
        distances = self._table.compared(numbers)
        each = zip((self, *others), distances, movements, strict=True)
        return [matcher.judged(newest, movement) for matcher, newest, movement in each]

    def judged(self, newest: NDArray[np.float64], movement: float) -> Reading:
        """Judge the newest windows' log distances, as the table compared them, by those before; once per hop."""
        elapsed = _SECONDS_PER_LEAD if math.isnan(self._read_at) else self._now - self._read_at
        self._read_at = self._now
        compared = self._compared.after(newest, elapsed)
        distances, known = compared[0], compared[-1]
        self._follow(distances, elapsed)
        judged = self._judged.after(known, elapsed)
        self._known = self._is_known(float(judged[self._guess]), float(known[self._guess]))
        outcome = Outcome.NAMED if self._known else Outcome.UNKNOWN
        if movement < self._stillness:
            outcome = Outcome.STILL
        if len(compared) > 1:
            # With fewer joints: ranked as they are named, as near as the guess is known.
            distances = distances + (known[self._guess] - distances[self._guess])
        scores = np.exp(distances)
        scores += 1.0
        return Reading(outcome, np.reciprocal(scores, out=scores), self._guess, movement)

    def _is_known(self, judged: float, newest: float) -> bool:
        """Judge by the longer average, unless the newest distance is clearly near: then a motion is known at once."""
        beyond = judged - self._threshold
        return beyond <= (_HELD if self._known else 0.0) or newest <= self._threshold - _CLEAR

    def _follow(self, distances: NDArray[np.float64], elapsed: float) -> None:
        """Let the guess go over to a class that has led for long enough."""
        # Of some ten numbers Python finds the two least in a third of the time that numpy takes to begin.
        others = distances.tolist()
        least = min(others)
        leader = others.index(least)
        if leader != self._leader:
            self._leader, self._lead = leader, 0.0
        if len(others) > 1:
            others[leader] = math.inf
            self._lead += (min(others) - least) * elapsed / _SECONDS_PER_LEAD
        if self._guess < 0 or self._lead >= _LEAD:
            self._guess = leader


class _Average:
    """An exponential average over so many seconds, beginning with the first values."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._values: NDArray[np.float64] | None = None

    def after(self, values: NDArray[np.float64], elapsed: float) -> NDArray[np.float64]:
        """Take in values that came so many seconds after the last; the average is the caller's to keep."""
        if self._values is None:
            self._values = values
        else:
            self._values = self._values - math.expm1(-elapsed / self._seconds) * (values - self._values)
        return self._values
