"""One performer's windows compared with a library's: the sums of the last seconds, and the parts read off them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library.kernels import bind
from kinespace.library.kernels.table import BLOCK
from kinespace.library.signature.parts import LEVEL_REMOVED, NOISE_FLOOR, Kind, Part, lengths_of
from kinespace.library.windows.cutting import FIRST_WINDOW
from kinespace.stream.recognizer.windows.sliding_window import MAX_PENDING, TIE, SlidingWindow
from kinespace.stream.recognizer.windows.sums import MomentSums, ProductSums

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kinespace.library.windows.index import WindowIndex

    #: From the places of frames to the body's sizes there, metres.
    Sizes = Callable[[NDArray[np.intp]], NDArray[np.float64]]


#: Frames that a window needs at least.
_MIN_FRAMES = 3
#: While no distance of a still body moves by more than so many standard deviations of its noise, what was found stands:
#: of some thousands of distances the farthest moves so far by noise alone.
_AT_REST = 6.0
#: The share of the movement below which a window is still, above which neither a window nor a distance is at rest.
_RESTS = 0.5
#: Movement of a distance that is none, relative to the root mean square distance.
_NO_STEP = 1e-6


class Leading(NamedTuple):
    """What the windows that end now show, apart from the parts that are compared.

    Attributes
    ----------
    movement
        Movement (`library.signature.parts.movement`) over the longest window of distances.
    share
        Share of the variance of the longest window in the basis along its leading eigenvector, 0 to 1.
    gap
        (λ₁ − λ₂) / λ₁ of its two leading eigenvalues, 0 to 1.
    """

    movement: float
    share: float
    gap: float


class LiveWindows:
    """Follows the windows of one performer, and compares them with a library's.

    A window reaches back as far as the feed has been followed, at most its length.

    Parameters
    ----------
    index
        The library's windows: they say which parts are read, in which basis.

    Attributes
    ----------
    index
        As given.
    longest
        Length of the longest window, seconds.
    comparer
        Compares what `read` has read: the distances are in there.
    has_read
        Whether a window was compared with the present library.
    threshold
        Evidence, as a logit, from which a guess by these windows is known.
    """

    def __init__(self, index: WindowIndex, threshold: float = -math.inf) -> None:
        self.threshold = threshold
        self._compare_with(index)
        self._begin_again()

    def _begin_again(self) -> None:
        self._frames, self._since, self._now, self.has_read = 0, math.nan, math.nan, False
        self._forget_rest()

    def _forget_rest(self) -> None:
        """Compare at the next hop, whether the body moves or not."""
        #: What was read last; the time since which the body is at rest, NaN while it moves; and of a body at rest the
        #: row that was read last, how far its distances may move, metres, and how many frames have been looked at.
        self._seen, self._still_since = Leading(math.inf, 0.0, 0.0), math.nan
        self._rest, self._room, self._seen_at = np.empty(0), 0.0, 0

    def _compare_with(self, index: WindowIndex) -> None:
        of_distances, in_basis = lengths_of(index.comparison.weighing.parts)
        # The movement is read off distances, also where no part is.
        self._of_distances, self._in_basis = of_distances or in_basis[-1:], in_basis
        self.longest = max(*self._of_distances, *in_basis)
        self._directions = index.basis.directions
        pairs, directions = self._directions.shape
        self._window = SlidingWindow(self.longest, pairs, point_width=directions)
        self._moments = tuple(MomentSums(self._window, seconds) for seconds in self._of_distances)
        self._products = tuple(ProductSums(self._window, seconds) for seconds in in_basis)
        self._sums = (*self._moments, *self._products)
        self._lay_out(index)

    def _lay_out(self, index: WindowIndex) -> None:
        """Bind the kernels that read the sums to the memory from which a comparer compares them."""
        self.index, self._body, self.comparer, self.has_read = index, index.body, index.comparer(), False
        self._forget_rest()
        pairs, directions = self._directions.shape
        body, numbers, vectors = index.body, self.comparer.numbers, self.comparer.eigenvectors
        of_body = body.sizing, body.segments, body.above, body.ends
        self._values = np.empty(len(vectors))
        self._blocks = [np.zeros((directions, BLOCK)) for _ in self._products]
        self._read_parts = [
            bind(
                "read_parts",
                *(each.sums, each.clock, each.places, *of_body),
                numbers.get(Part(Kind.SPREAD, seconds), np.empty(pairs)),
                numbers.get(Part(Kind.POSTURE, seconds), np.empty(0)),
                numbers.get(Part(Kind.TREND, seconds), np.empty(0)),
                *(NOISE_FLOOR, LEVEL_REMOVED),
            )
            for each, seconds in zip(self._moments, self._of_distances, strict=True)
        ]
        self._read_eigen = [
            bind(
                "read_eigen",
                *(each.sums, each.products, each.places, each.drift, self._values, vectors),
                numbers.get(Part(Kind.EIGEN, seconds), np.empty(vectors.shape)),
                block,
            )
            for each, seconds, block in zip(self._products, self._in_basis, self._blocks, strict=True)
        ]
        if len(vectors) == 1 < directions:
            # One eigenvector is compared, but the gap needs the second eigenvalue.
            longest, two, self._values = self._products[-1], np.empty((2, directions)), np.empty(2)
            sums = longest.sums, longest.products, longest.places, longest.drift
            again = bind("read_eigen", *sums, self._values, two, two.copy(), np.zeros((directions, BLOCK)))
            self._read_eigen.append(again)

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows, shape (frames, pairs), metres; `MAX_PENDING` at most, later than the rows before."""
        if not len(times):
            return
        if not self._frames:
            self._since = times[0]
        self._frames += len(times)
        self._now = times[-1]
        if self._window.pending + len(times) > MAX_PENDING:
            self._settle()
        self._window.push(times, rows, rows @ self._directions)

    def _settle(self) -> None:
        """Let all sums follow the rows that were pushed."""
        window = self._window
        for each in self._sums:
            each.follow(window.end, window.moved)
        window.pass_over()

    def clear(self) -> None:
        """Forget all rows."""
        self._begin_again()
        self._window.clear()
        for each in self._sums:
            each.clear()
        for block in self._blocks:
            block[:] = 0.0

    def exchange(self, index: WindowIndex) -> None:
        """Compare the same rows with another library of the same joints from now on."""
        same = np.array_equal(index.basis.directions, self._directions)
        if same and lengths_of(index.comparison.weighing.parts)[1] == self._in_basis:
            self._lay_out(index)
            return
        before, frames = self._window, self._frames
        self._compare_with(index)
        self.push_all(before.times, before.rows)
        self._frames = frames

    def push_all(self, times: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
        """Take in any number of rows."""
        for begin in range(0, len(times), MAX_PENDING):
            some = slice(begin, begin + MAX_PENDING)
            self.push(times[some].tolist(), rows[some])

    def place(self) -> NDArray[np.float64]:
        """Give the newest row's point in the basis, relative to the body's size, shape (directions,); needs a row."""
        point: NDArray[np.float64] = self._window.points[-1] / self._body.size(self._window.rows[-1])
        return point

    def path(self, since: float) -> tuple[NDArray[np.float64], NDArray[np.float64], Sizes]:
        """Give times from a time on, of all rows for NaN, points in the basis, and what gives sizes at places."""
        times = self._window.times
        first = 0 if math.isnan(since) else int(np.searchsorted(times, since, side="right")) - 1
        some = slice(max(first, 0), None)
        rows = self._window.rows[some]
        return times[some], self._window.points[some], lambda places: self._body.size(rows[places])

    def recent(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give the times and the distance rows of the longest window; views, valid until the next push."""
        return self._window.times, self._window.rows

    def read(self, stillness: float = 0.0, noise: float = 0.0) -> Leading | None:
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
        if self._now - self._still_since >= self.longest and self._rests():
            return self._seen
        self._seen = seen = self._read()
        if not seen.movement < _RESTS * stillness:
            self._still_since = math.nan
            return seen
        self._rest, self._seen_at = self._window.rows[-1].copy(), self._frames
        length = math.sqrt(float(np.vdot(self._rest, self._rest)) / len(self._rest))
        self._room = max(min(_AT_REST * noise, _RESTS * stillness * length), _NO_STEP * length)
        self._still_since = self._now if math.isnan(self._still_since) else self._still_since
        return seen

    def _rests(self) -> bool:
        """Whether no distance has moved since the windows were read; earlier hops looked at the rows before theirs."""
        rows, self._seen_at = self._window.rows[self._seen_at - self._frames :], self._frames
        return float(np.abs(rows - self._rest).max()) <= self._room

    def _read(self) -> Leading:
        self._settle()
        movement = total = 0.0
        for read in self._read_parts:
            movement = read()
        for read in self._read_eigen:
            total = read()
        self.comparer.compare()
        self.has_read = True
        first, second = [*self._values[:2].tolist(), 0.0][:2]
        if total <= 0 or first <= 0:
            return Leading(movement, 0.0, 0.0)
        return Leading(movement, min(first / total, 1.0), (first - max(second, 0.0)) / first)

    def contributions(self) -> NDArray[np.float64]:
        """Give each joint pair's share of the variance along the leading eigenvector read last, shape (pairs,).

        The variance along w is the sum over the distances of w times their covariance with the rows along w. A distance
        that works against the others gives less than nothing. The shares add up to (frames − 1) times the variance.
        """
        weights, rows = self._directions @ self.comparer.eigenvectors[0], self._window.rows
        centred = rows - rows.mean(axis=0)
        given: NDArray[np.float64] = weights * ((centred @ weights) @ centred)
        return given
