"""Smoothing of a noisy feed: the distances of a trembling sensor are averaged over a moment, a clean feed's are not.

The noise is estimated from the second differences of successive rows. For white noise of variance σ² their variance is
6 σ², while a motion hardly bends between three frames; the lengths of segments do not change at all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinespace.stream.recognizer.windows.window import TIE

#: Standard deviation of a distance's noise from which rows are averaged, metres: 8 mm on every coordinate.
NOISY = 0.0113
#: Seconds over which the rows of a noisy feed are averaged.
_AVERAGED = 0.1
#: Seconds over which the noise is estimated.
_ESTIMATED = 1.0
#: Seconds of rows after which the noise is estimated again.
_EVERY = 0.1
#: Rows after which it is, at the latest.
_MAX_WAITING = 30
#: The variance of second differences of white noise, relative to the noise's variance.
_SECOND_DIFFERENCE = 6.0
#: Rows that are kept to average over.
_MAX_ROWS = 64


class RowSmoother:
    """Averages the distance rows of a noisy feed, looking back only.

    Parameters
    ----------
    segments
        The pairs that are segments, shape (segments,); when there are none, the noise is estimated from all pairs.
    width
        Pairs in a row.

    Attributes
    ----------
    noise
        Estimated standard deviation of a distance's noise, metres.
    """

    def __init__(self, segments: NDArray[np.intp], width: int) -> None:
        self._segments = segments if len(segments) else np.arange(width)
        # Twice the rows that are kept: they move back when there is no room left, not at every hop. Of a quiet feed
        # only the segments' lengths are kept: whole rows, at every hop, would cost more than the estimate.
        self._lengths = np.empty((2 * _MAX_ROWS, len(self._segments)))
        self._rows = np.empty((2 * _MAX_ROWS, width))
        self._times = np.empty(2 * _MAX_ROWS)
        self.clear()

    def clear(self) -> None:
        """Forget all rows, and the noise."""
        self._end = self._waiting = self._trembles_from = 0
        self._variance = np.zeros(len(self._segments))
        self._known = 0.0
        self.noise = 0.0

    def smooth(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Average rows (frames, pairs), metres, in place, each with a noisy feed's rows of the tenth second before."""
        begin = self._begin(len(times))
        self._end = begin + len(times)
        rows.take(self._segments, axis=1, out=self._lengths[begin : self._end], mode="clip")
        self._times[begin : self._end] = times
        self._waiting += len(times)
        first = max(self._end - self._waiting, 0)
        if self._waiting >= _MAX_WAITING or times[-1] - self._times.item(first) >= _EVERY - TIE:
            self._estimate(max(first - 2, 0))
            self._waiting = 0
        if self.noise < NOISY:
            self._trembles_from = self._end
            return
        self._rows[begin : self._end] = rows
        first = max(self._end - _MAX_ROWS, self._trembles_from)
        too_old = np.asarray(times) - (_AVERAGED - TIE)
        starts = np.searchsorted(self._times[first : self._end], too_old, side="right") + first
        for index, start in enumerate(starts.tolist()):
            np.mean(self._rows[start : begin + index + 1], axis=0, out=rows[index])

    def _begin(self, new: int) -> int:
        """Say where new rows begin; move back the rows before them when there is no room."""
        if self._end + new <= len(self._rows):
            return self._end
        kept = _MAX_ROWS - new
        shift = self._end - kept
        for each in (self._rows, self._lengths, self._times):
            each[:kept] = each[shift : self._end]
        self._trembles_from = max(self._trembles_from - shift, 0)
        return kept

    def _estimate(self, first: int) -> None:
        """Update the estimate by the second differences from one kept row on."""
        if self._end - first < 3:
            return
        raw = self._lengths[first : self._end]
        bends = raw[2:] - raw[1:-1]
        bends -= raw[1:-1]
        bends += raw[:-2]
        bends *= bends
        square = np.add.reduce(bends)
        seconds = self._times.item(self._end - 1) - self._times.item(first + 1)
        # The first second is averaged evenly, so that one row does not decide.
        self._known = min(self._known + seconds, _ESTIMATED)
        newest = min(seconds / self._known, 1.0)
        square *= newest / (len(bends) * _SECOND_DIFFERENCE)
        self._variance *= 1 - newest
        self._variance += square
        quarter = len(square) // 4
        ordered = self._variance.copy()
        ordered.partition(quarter)
        self.noise = math.sqrt(ordered.item(quarter))
