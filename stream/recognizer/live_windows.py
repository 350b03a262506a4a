"""One performer's windows compared with a library's, at each hop."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.signature.parts import Signature, lengths_of
from kinespace.library.windows.comparer import Distances
from kinespace.library.windows.comparison import FIRST_WINDOW
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.recognizer.window import TIE, Window, signature

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
    """Averages the distance rows of a noisy feed over a moment, looking back only; a clean feed's stay.

    The noise is estimated from the second differences of successive rows. For white noise of variance σ² their variance
    is 6 σ², while a motion hardly bends between three frames; the lengths of segments do not change at all.

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


#: Frames that a window needs at least.
_MIN_FRAMES = 3
#: While no distance of a still body moves by more than so many standard deviations of its noise, what was found stands:
#: of some thousands of distances the farthest moves so far by noise alone.
_AT_REST = 6.0
#: The share of the movement below which a window is still, above which neither a window nor a distance is at rest.
_RESTS = 0.5
#: Movement of a distance that is none, relative to the root mean square distance.
_NO_STEP = 1e-6


class Compared(NamedTuple):
    """What the windows that end now show, and how far that is from each class."""

    signature: Signature
    distances: Distances


class Covariance(NamedTuple):
    """The distances' covariance over the longest window that the last answer rests on.

    Attributes
    ----------
    frames
        The number of frames in the window.
    directions
        A distance row times these is a point in the basis, shape (pairs, directions).
    matrix
        The covariance of the frames' points, shape (directions, directions), square metres.
    eigenvector
        The matrix's leading eigenvector, shape (directions,).
    """

    frames: int
    directions: NDArray[np.float64]
    matrix: NDArray[np.float64]
    eigenvector: NDArray[np.float64]


class LiveWindows:
    """Follows the windows of one performer, and compares them with a library's.

    A window reaches back as far as the feed has been followed, at most its length.

    Parameters
    ----------
    index
        The library's windows: they say which parts are read, in which basis.
    threshold
        Evidence, as a logit, from which a guess by these windows is known.

    Attributes
    ----------
    index, threshold
        As given.
    signature
        What was read last with this library; None before.
    seen
        What the comparison by `compare` gave last.
    """

    def __init__(self, index: WindowIndex, threshold: float = -math.inf) -> None:
        self.index, self.threshold = index, threshold
        self._window = window_of(index)
        self.clear()

    def clear(self) -> None:
        """Forget all rows."""
        self._window.clear()
        self._frames, self._since, self._now = 0, math.nan, math.nan
        self._forget_seen()

    def _forget_seen(self) -> None:
        """Compare at the next hop, whether the body moves or not, with the index."""
        weighing = self.index.comparison.weighing
        self._parts, self._eigenvectors = weighing.parts, weighing.eigenvectors
        self.signature: Signature | None = None
        self.seen: Compared | None = None
        #: The time since which the body is at rest, NaN while it moves; and of a body at rest the row that was read
        #: last, how far its distances may move, metres, and how many frames have been looked at.
        self._still_since, self._rest, self._room, self._looked_at = math.nan, np.empty(0), 0.0, 0

    @property
    def longest(self) -> float:
        """Length of the longest window, seconds."""
        return self._window.seconds

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows, shape (frames, pairs), metres, later than the rows before."""
        if not len(times):
            return
        if not self._frames:
            self._since = times[0]
        self._frames += len(times)
        self._now = times[-1]
        self._window.push(times, rows)

    def exchange(self, index: WindowIndex) -> None:
        """Compare the same rows with another library of the same joints from now on."""
        before, window = self._window, window_of(index)
        same = np.array_equal(index.basis.directions, self.index.basis.directions)
        self.index = index
        self._forget_seen()
        if not same or (window.of_distances, window.in_basis) != (before.of_distances, before.in_basis):
            self._window = window
            window.push(before.times.tolist(), before.recent()[0])

    def place(self) -> NDArray[np.float64]:
        """Give the newest row's point in the basis, relative to the body's size, shape (directions,); needs a row."""
        rows, points = self._window.recent()
        point: NDArray[np.float64] = points[-1] / self.index.body.size(rows[-1])
        return point

    def recent(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give the times and the distance rows of the longest window; views, valid until the next push."""
        return self._window.times, self._window.recent()[0]

    def read(self, stillness: float = 0.0, noise: float = 0.0) -> Signature | None:
        """Read the windows that end with the newest row; None while there is too little to compare.

        Parameters
        ----------
        stillness
            Movement below which a window is still. What was read of a body that has been still in all windows stands
            until a distance moves by more than its noise.
        noise
            Standard deviation of a distance's noise, metres.
        """
        if self._frames < _MIN_FRAMES or self._now - self._since < FIRST_WINDOW - TIE:
            return None
        if self.signature and self._now - self._still_since >= self.longest and self._rests():
            return self.signature
        self.signature = read = signature(self._window, self._parts, self.index.body, self._eigenvectors)
        if not read.movement < _RESTS * stillness:
            self._still_since = math.nan
            return read
        self._rest, self._looked_at = self.recent()[1][-1].copy(), self._frames
        length = math.sqrt(float(np.vdot(self._rest, self._rest)) / len(self._rest))
        self._room = max(min(_AT_REST * noise, _RESTS * stillness * length), _NO_STEP * length)
        self._still_since = self._now if math.isnan(self._still_since) else self._still_since
        return read

    def _rests(self) -> bool:
        """Whether no distance has moved since the windows were read; earlier hops looked at the rows before theirs."""
        rows, self._looked_at = self.recent()[1][self._looked_at - self._frames :], self._frames
        return float(np.abs(rows - self._rest).max()) <= self._room

    def covariance(self) -> Covariance:
        """Give the covariance over the longest span, and what was read off it last; ValueError before."""
        window, longest = self._window, self._window.in_basis[-1]
        if self.signature is None:
            raise ValueError("covariance: expected an answer before, got none yet")
        matrix = window.covariance(longest)
        return Covariance(window.rows_in(longest), self.index.basis.directions, matrix, self.signature.leading)

    def contributions(self) -> NDArray[np.float64] | None:
        """Give each joint pair's share of the variance along the leading eigenvector, shape (pairs,); None before.

        The variance along w is the sum over the distances of w times their covariance with the rows along w. A distance
        that works against the others gives less than nothing. The shares add up to (frames − 1) times the variance.
        """
        if self.signature is None:
            return None
        weights, (_, rows) = self.index.basis.directions @ self.signature.leading, self.recent()
        centred = rows - rows.mean(axis=0)
        given: NDArray[np.float64] = weights * ((centred @ weights) @ centred)
        return given


def compare(read: Sequence[LiveWindows]) -> list[Compared]:
    """Compare what windows read last, those of one library together; what rests stands as it was compared before."""
    new = [each for each in read if each.seen is None or each.seen.signature is not each.signature]
    for index in {each.index for each in new}:
        some = [(each, each.signature) for each in new if each.index is index and each.signature]
        found = index.distances([own for _, own in some])
        for (each, own), distances in zip(some, found, strict=True):
            each.seen = Compared(own, distances)
    return [each.seen for each in read if each.seen]


def window_of(index: WindowIndex) -> Window:
    """Make an empty window of the lengths and in the basis of a library's windows."""
    of_distances, in_basis = lengths_of(index.comparison.weighing.parts)
    # The movement is read off distances, also where no part is.
    return Window(of_distances or in_basis[-1:], in_basis, index.basis.directions)
