"""One performer's windows compared with a library's, at each hop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.signature.parts import Signature, lengths_of
from kinespace.library.windows.comparer import Distances
from kinespace.library.windows.cutting import FIRST_WINDOW
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.recognizer.windows.window import TIE, Window, signature

#: Frames that a window needs at least.
_MIN_FRAMES = 3
#: While no distance of a still body moves by more than so many standard deviations of its noise, what was found stands:
#: of some thousands of distances the farthest moves so far by noise alone.
_AT_REST = 6.0
#: The share of the movement below which a window is still, above which neither a window nor a distance is at rest.
_RESTS = 0.5
#: Movement of a distance that is none, relative to the root mean square distance.
_NO_STEP = 1e-6


class Seen(NamedTuple):
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
    seen
        What was read last with this library; None before.
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
        self.seen: Seen | None = None
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

    def read(self, stillness: float = 0.0, noise: float = 0.0) -> Seen | None:
        """Compare the windows that end with the newest row; None while there is too little to compare.

        Parameters
        ----------
        stillness
            Movement below which a window is still. What was found for a body that has been still in all windows stands
            until a distance moves by more than its noise.
        noise
            Standard deviation of a distance's noise, metres.
        """
        if self._frames < _MIN_FRAMES or self._now - self._since < FIRST_WINDOW - TIE:
            return None
        if self.seen and self._now - self._still_since >= self.longest and self._rests():
            return self.seen
        self.seen = seen = self._read()
        if not seen.signature.movement < _RESTS * stillness:
            self._still_since = math.nan
            return seen
        self._rest, self._looked_at = self.recent()[1][-1].copy(), self._frames
        length = math.sqrt(float(np.vdot(self._rest, self._rest)) / len(self._rest))
        self._room = max(min(_AT_REST * noise, _RESTS * stillness * length), _NO_STEP * length)
        self._still_since = self._now if math.isnan(self._still_since) else self._still_since
        return seen

    def _rests(self) -> bool:
        """Whether no distance has moved since the windows were read; earlier hops looked at the rows before theirs."""
        rows, self._looked_at = self.recent()[1][self._looked_at - self._frames :], self._frames
        return float(np.abs(rows - self._rest).max()) <= self._room

    def _read(self) -> Seen:
        found = signature(self._window, self._parts, self.index.body, self._eigenvectors)
        return Seen(found, self.index.distances(found))

    def covariance(self) -> Covariance:
        """Give the covariance over the longest span, and what was read off it last; ValueError before."""
        window, longest = self._window, self._window.in_basis[-1]
        if self.seen is None:
            raise ValueError("covariance: expected an answer before, got none yet")
        matrix = window.covariance(longest)
        return Covariance(window.rows_in(longest), self.index.basis.directions, matrix, self.seen.signature.leading)

    def contributions(self) -> NDArray[np.float64] | None:
        """Give each joint pair's share of the variance along the leading eigenvector, shape (pairs,); None before.

        The variance along w is the sum over the distances of w times their covariance with the rows along w. A distance
        that works against the others gives less than nothing. The shares add up to (frames − 1) times the variance.
        """
        if self.seen is None:
            return None
        weights, (_, rows) = self.index.basis.directions @ self.seen.signature.leading, self.recent()
        centred = rows - rows.mean(axis=0)
        given: NDArray[np.float64] = weights * ((centred @ weights) @ centred)
        return given


def window_of(index: WindowIndex) -> Window:
    """Make an empty window of the lengths and in the basis of a library's windows."""
    of_distances, in_basis = lengths_of(index.comparison.weighing.parts)
    # The movement is read off distances, also where no part is.
    return Window(of_distances or in_basis[-1:], in_basis, index.basis.directions)
