"""Smoothing of a noisy feed: distances of a sensor that trembles are averaged over a moment, a clean feed's are not.

The noise is read off the second differences of successive rows. For white noise of variance σ² their variance is 6 σ²,
while a motion hardly bends between three frames; segments between a joint and its parent do not change at all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

#: Standard deviation of a distance's noise from which rows are averaged, metres: 8 mm on every coordinate.
NOISY = 0.0113
#: Seconds over which the rows of a noisy feed are averaged, and over which the noise is estimated.
_AVERAGED, _ESTIMATED = 0.1, 1.0
#: The variance of second differences of white noise, over the noise's.
_SECOND_DIFFERENCE = 6.0
#: Seconds within which two spans are as long: frame times are rounded (`stream.recognizer.sliding_window`).
_TIE = 1e-6
#: Rows kept to average over.
_MAX_ROWS = 64


class RowSmoother:
    """Averages the distance rows of a noisy feed, looking back only.

    Parameters
    ----------
    segments
        The pairs that are segments, shape (segments,); when there are none, all pairs tell the noise.
    width
        Pairs in a row.

    Attributes
    ----------
    noise
        Estimated standard deviation of a distance's noise, metres.
    """

    def __init__(self, segments: NDArray[np.intp], width: int) -> None:
        self._segments = segments if len(segments) else np.arange(width)
        self._rows = np.empty((_MAX_ROWS, width))
        self._times = np.empty(_MAX_ROWS)
        self.clear()

    def clear(self) -> None:
        """Forget all rows, and the noise."""
        self._count = 0
        self._variance = np.zeros(len(self._segments))
        self._known = 0.0
        self.noise = 0.0

    def smooth(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Average rows (frames, pairs), metres, in place, with the rows of the tenth of a second before each."""
        new = len(times)
        kept = min(self._count, _MAX_ROWS - new)
        self._rows[:kept] = self._rows[self._count - kept : self._count]
        self._times[:kept] = self._times[self._count - kept : self._count]
        self._count = kept + new
        self._rows[kept : self._count] = rows
        self._times[kept : self._count] = times
        self._estimate(max(kept - 2, 0))
        if self.noise < NOISY:
            return
        starts = np.searchsorted(self._times[: self._count], np.asarray(times) - (_AVERAGED - _TIE), side="right")
        for index, start in enumerate(starts.tolist()):
            np.mean(self._rows[start : kept + index + 1], axis=0, out=rows[index])

    def _estimate(self, first: int) -> None:
        """Let the estimate follow the second differences from one kept row on."""
        if self._count - first < 3:
            return
        raw = self._rows[first : self._count].take(self._segments, axis=1)
        bends = raw[2:] - raw[1:-1]
        bends -= raw[1:-1]
        bends += raw[:-2]
        seconds = float(self._times[self._count - 1] - self._times[first + 1])
        # The first second is averaged evenly, so that one row does not decide.
        self._known = min(self._known + seconds, _ESTIMATED)
        square = np.einsum("ij,ij->j", bends, bends) / (len(bends) * _SECOND_DIFFERENCE)
        self._variance += min(seconds / self._known, 1.0) * (square - self._variance)
        self.noise = float(np.sqrt(np.partition(self._variance, len(square) // 4)[len(square) // 4]))
