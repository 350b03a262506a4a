"""The last seconds of one performer: distance rows, averaged where a feed trembles, and what some spans of them show.

A span's sums follow the rows: those that enter are added, those that leave are subtracted. Sums of values of a metre
that move by a millimetre lose digits, as when a performer stands still right after moving. Two habits keep them exact.
Values are taken relative to a reference row near the span's mean, so that they are as small as the movement. And a
bound of the rounding grows with every row; when it is no longer small against the variance that is left, the sums are
computed afresh.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.compiled import by_numpy, compiled
from kinespace.library.signature import parts
from kinespace.library.signature.basis import leading_eigenvectors
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import Kind, Moments, Part, Signature
from kinespace.library.windows.comparer import Distances
from kinespace.library.windows.comparison import FIRST_WINDOW
from kinespace.library.windows.index import WindowIndex

Numbers = NDArray[np.float64]

#: Seconds within which two spans count as equal. A feed's times are multiples of a frame with rounding, a quarter of a
#: microsecond for times since 1970; so ties are decided alike at every rate.
TIE = 1e-6

# --- a trembling feed -------------------------------------------------------------------------------------------------

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
        self._segments, self._width = segments if len(segments) else np.arange(width), width
        self.clear()

    def clear(self) -> None:
        """Forget all rows, and the noise."""
        # Of a quiet feed only the segments' lengths are kept: whole rows would cost more than the estimate.
        self._times, self._rows = np.empty(0), np.empty((0, self._width))
        self._lengths = np.empty((0, len(self._segments)))
        self._waiting = 0
        self._variance = np.zeros(len(self._segments))
        self._known = 0.0
        self.noise = 0.0

    def smooth(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Average rows (frames, pairs), metres, in place, each with a noisy feed's rows of the tenth second before."""
        self._times = np.concatenate([self._times, times])[-_MAX_ROWS:]
        self._lengths = np.concatenate([self._lengths, rows.take(self._segments, axis=1)])[-_MAX_ROWS:]
        self._waiting += len(times)
        first = max(len(self._times) - self._waiting, 0)
        if self._waiting >= _MAX_WAITING or times[-1] - self._times.item(first) >= _EVERY - TIE:
            self._estimate(max(first - 2, 0))
            self._waiting = 0
        if self.noise < NOISY:
            self._rows = self._rows[:0]
            return
        self._rows = np.concatenate([self._rows, rows])[-_MAX_ROWS:]
        kept, before = len(self._rows), len(self._rows) - len(rows)
        too_old = np.asarray(times) - (_AVERAGED - TIE)
        starts = np.searchsorted(self._times[len(self._times) - kept :], too_old, side="right")
        for index, start in enumerate(starts.tolist()):
            np.mean(self._rows[start : before + index + 1], axis=0, out=rows[index])
        # Rows that are too old now are too old for all that come.
        self._rows = self._rows[starts.item(-1) :]

    def _estimate(self, first: int) -> None:
        """Update the estimate by the second differences from one kept row on."""
        raw = self._lengths[first:]
        if len(raw) < 3:
            return
        bends = raw[2:] - raw[1:-1]
        bends -= raw[1:-1]
        bends += raw[:-2]
        bends *= bends
        square = np.add.reduce(bends)
        seconds = self._times.item(-1) - self._times.item(first + 1)
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


# --- the window -------------------------------------------------------------------------------------------------------

#: Frames per second up to which a window holds all its seconds. A faster feed shortens the window.
MAX_FEED_RATE = 500.0
#: Frames that a window needs at least.
_MIN_FRAMES = 3
#: Rows for which there is room at first.
_ROOM = 64
#: Rounding, relative to the total variance, from which on sums are computed afresh: well inside the promised 1e-9.
_DRIFT = 1e-11
#: Movement, relative to the distance, that is none.
_NO_MOVEMENT = 1e-6
#: Eigenpairs that are followed from hop to hop.
NEAR = 8
#: While no distance of a still body moves by more than so many standard deviations of its noise, what was found stands:
#: of some thousands of distances the farthest moves so far by noise alone.
_AT_REST = 6.0
#: The share of the movement below which a window is still, above which neither a window nor a distance is at rest.
_RESTS = 0.5
#: Movement of a distance that is none, relative to the root mean square distance.
_NO_STEP = 1e-6
_EPSILON = float(np.finfo(np.float64).eps)
#: Where the parts stand that are read off distances together.
_PLACES = {Kind.SPREAD: 0, Kind.POSTURE: 1, Kind.TREND: 2}


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


class Window:
    """The distance rows of the last seconds, ending with the newest frame, and what some spans of them show.

    A row at time t is in a span while the newest time is less than t + seconds; the newest row always is. Rows lie one
    after another in time order, so that every read is a slice. When there is no room left they move back to the front.
    A span reaches back as far as the feed has been followed.

    Parameters
    ----------
    index
        The library's windows: they say which parts are read, in which basis.
    threshold
        Evidence, as a logit, from which a guess by this window is known.

    Raises
    ------
    MemoryError
        There is no room for so many seconds.

    Attributes
    ----------
    index, threshold
        As given.
    seconds
        Length of the longest span.
    signature
        What was read last with this library; None before.
    distances
        How far the signature is from each class; None until it is compared.
    noise
        Standard deviation of a distance's noise when it was read, metres.
    """

    def __init__(self, index: WindowIndex, threshold: float = -math.inf) -> None:
        self.threshold, self.noise = threshold, 0.0
        self._compare_with(index)
        self._make_room()

    def _compare_with(self, index: WindowIndex) -> None:
        """Compare at the next hop, whether the body moves or not, with an index."""
        self.index, weighing = index, index.comparison.weighing
        self._parts, self._eigenvectors = weighing.parts, weighing.eigenvectors
        self.signature: Signature | None = None
        self.distances: Distances | None = None
        #: The time since which the body is at rest, NaN while it moves; and of a body at rest the row that was read
        #: last, how far its distances may move, metres, and how many frames have been looked at.
        self._still_since, self._rest, self._room, self._looked_at = math.nan, np.empty(0), 0.0, 0

    def _make_room(self) -> None:
        """Make room for the rows, and for the sums over the spans, that the index asks for; there are no rows yet."""
        (of_distances, in_basis), (pairs, width) = parts.lengths_of(self._parts), self.index.basis.directions.shape
        # The movement is read off distances, also where no part is.
        self._moments = {each: _Sums(each, (pairs,)) for each in of_distances or in_basis[-1:]}
        self._products = {each: _Sums(each, (width, width)) for each in in_basis}
        self._sums = (*self._moments.values(), *self._products.values())
        self.seconds = max(*self._moments, *self._products)
        self._most = _most(self.seconds)
        # A window that memory can never hold is refused at once: the system commits only pages that are used.
        np.empty((self._most, pairs))
        self._times, self._rows, self._points = np.empty(_ROOM), np.empty((_ROOM, pairs)), np.empty((_ROOM, width))
        self.clear()

    def clear(self) -> None:
        """Forget all rows."""
        self._begin = self._end = self._frames = 0
        self._since = self._now = math.nan
        for each in self._sums:
            each.clear()
        self._compare_with(self.index)

    def exchange(self, index: WindowIndex, threshold: float = -math.inf) -> None:
        """Compare the same rows with another library of the same joints, as in the constructor, from now on."""
        same = np.array_equal(index.basis.directions, self.index.basis.directions)
        same = same and parts.lengths_of(index.comparison.weighing.parts) == parts.lengths_of(self._parts)
        (times, rows), followed = self.recent(), (self._frames, self._since)
        self.threshold = threshold
        self._compare_with(index)
        if not same:
            self._make_room()
            self.push(times.tolist(), rows)
            self._frames, self._since = followed

    def push(self, times: Sequence[float], rows: Numbers) -> None:
        """Take in rows (frames, pairs), metres, at their times, later than the rows before."""
        if not len(times):
            return
        begin, self._end = self._end, self._end + len(times)
        if self._end > len(self._times):
            begin = self._move_back(len(times))
        some, self._now = slice(begin, self._end), times[-1]
        self._times[some], self._rows[some] = times, rows
        self._points[some] = rows @ self.index.basis.directions
        self._begin = _begun(self._times, self._begin, self._end, self.seconds, self._most)
        if not self._frames:
            self._since = times[0]
        self._frames += len(times)

    def _move_back(self, new: int) -> int:
        """Move the rows to the front, of more room where they fill half of it; give where the new rows begin."""
        first, count = self._begin, self._end - new - self._begin
        room = max(len(self._times), 2 * (count + new))
        self._times, self._rows, self._points = (
            _moved_back(each, first, count, room) for each in (self._times, self._rows, self._points)
        )
        self._begin, self._end = 0, count + new
        for sums in self._sums:
            # Sums whose rows are gone begin again.
            sums.begin, sums.end = (sums.begin - first, sums.end - first) if sums.begin >= first else (0, 0)
        return count

    def recent(self) -> tuple[Numbers, Numbers]:
        """Give times (rows,), seconds, and rows (rows, pairs) of the longest span; views, valid until the next push."""
        return self._times[self._begin : self._end], self._rows[self._begin : self._end]

    def place(self) -> Numbers:
        """Give the newest row's point in the basis, relative to the body's size, shape (directions,); needs a row."""
        last = self._end - 1
        point: Numbers = self._points[last] / self.index.body.size(self._rows[last])
        return point

    # --- what it shows ------------------------------------------------------------------------------------------------

    def read(self, stillness: float = 0.0, noise: float = 0.0) -> Signature | None:
        """Read the spans that end with the newest row; None while there is too little to compare.

        Parameters
        ----------
        stillness
            Movement below which a window is still. What was read of a body that has been still in all spans stands
            until a distance moves by more than its noise.
        noise
            Standard deviation of a distance's noise, metres.
        """
        self.noise = noise
        if self._frames < _MIN_FRAMES or self._now - self._since < FIRST_WINDOW - TIE:
            return None
        if self.signature and self._now - self._still_since >= self.seconds and self._rests():
            return self.signature
        self.signature, self.distances = read, _ = self.shown(), None
        if not read.movement < _RESTS * stillness:
            self._still_since = math.nan
            return read
        self._rest, self._looked_at = self._rows[self._end - 1].copy(), self._frames
        length = math.sqrt(float(np.vdot(self._rest, self._rest)) / len(self._rest))
        self._room = max(min(_AT_REST * noise, _RESTS * stillness * length), _NO_STEP * length)
        self._still_since = self._now if math.isnan(self._still_since) else self._still_since
        return read

    def _rests(self) -> bool:
        """Whether no distance has moved since the spans were read; earlier hops looked at the rows before theirs."""
        rows, self._looked_at = self.recent()[1][self._looked_at - self._frames :], self._frames
        return float(np.abs(rows - self._rest).max()) <= self._room

    def shown(self) -> Signature:
        """Read the parts of the signature off the spans that end now, however short they are; needs a row."""
        body, points, distances = self.index.body, {}, {}
        for longest, sums in self._products.items():
            sums.follow(self._times, self._points, self._end)
            known = *sums.sums[1:], sums.floor, sums.near, self._eigenvectors
            points[longest] = read_points(*known) or by_numpy["read_points"](*known)
            sums.near = points[longest][1]
        for seconds, sums in self._moments.items():
            sums.follow(self._times, self._rows, self._end)
            distances[seconds] = read_distances(
                *sums.sums, body.sizing, body.segments, body.between, parts.NOISE_FLOOR, parts.LEVEL_REMOVED
            )

        def numbers_of(part: Part) -> Numbers:
            if part.kind is Kind.EIGEN:
                return points[part.seconds][2]
            if part.kind in _PLACES:
                numbers: Numbers = distances[part.seconds][0][_PLACES[part.kind]]
            else:
                # A kind that is not read together with the others.
                numbers = parts.FORMULAS[part.kind](self.moments(part.seconds), body)[0]
            return numbers

        # The longest span comes last.
        values, vectors, _, trace = points[longest]
        first, second = [*values[:2].tolist(), 0.0][:2]
        moves = trace > 0 and first > 0
        return Signature(
            parts={part: numbers_of(part) for part in self._parts},
            leading=vectors[0],
            movement=distances[seconds][1],
            share=min(first / trace, 1.0) if moves else 0.0,
            gap=(first - max(second, 0.0)) / first if moves else 0.0,
        )

    def moments(self, seconds: float) -> Moments:
        """Give the moments of the distances over a span, of one window."""
        sums = self._moments[seconds]
        sums.follow(self._times, self._rows, self._end)
        return moments_of(*sums.sums)

    def covariance(self) -> Covariance:
        """Give the covariance over the longest span in the basis, and what was read off it last; ValueError before."""
        if self.signature is None:
            raise ValueError("covariance: expected an answer before, got none yet")
        longest = self._products[max(self._products)]
        longest.follow(self._times, self._points, self._end)
        matrix = covariance_of(*longest.sums[1:], longest.floor)
        return Covariance(longest.end - longest.begin, self.index.basis.directions, matrix, self.signature.leading)

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


def _moved_back(kept: Numbers, first: int, count: int, room: int) -> Numbers:
    moved = np.empty((room, *kept.shape[1:]))
    moved[:count] = kept[first : first + count]
    return moved


def _most(seconds: float) -> int:
    """Give how many rows a span has at most."""
    return max(2, math.ceil(seconds * MAX_FEED_RATE))


def _begun(times: Numbers, begin: int, end: int, seconds: float, most: int) -> int:
    """Give where a span of so many seconds, and rows at most, begins that reaches up to before `end`."""
    # Times in other units may be so large that even the newest time is not above this.
    left = int(times[begin : end - 1].searchsorted(times.item(end - 1) - (seconds - TIE), side="right"))
    return max(begin + left, end - most)


class _Sums:
    """The sums over a span: the rows of some last seconds, from `begin` to before `end`.

    Attributes
    ----------
    reference
        The row that all rows are relative to, shape (width,).
    clock
        The time that all times are relative to; the number of rows, the sum of their times, and of their squares.
    first
        The sum of the rows, and of the rows times their times, shape (2, width).
    second
        The sum of the squares, shape (width,), or of the products, shape (width, width).
    sums
        All of them.
    floor
        Variance that counts as none.
    near
        The leading eigenvectors that were read last, or some others, shape (NEAR, width).
    """

    def __init__(self, seconds: float, shape: tuple[int, ...]) -> None:
        self._seconds, self._most = seconds, _most(seconds)
        self.reference, self.clock = np.zeros(shape[-1]), np.zeros(4)
        self.first, self.second = np.zeros((2, shape[-1])), np.zeros(shape)
        self.sums = self.reference, self.clock, self.first, self.second
        self.floor = self._drift = 0.0
        self.clear()

    def clear(self) -> None:
        """Forget all rows."""
        self.begin = self.end = 0
        self.near = np.eye(NEAR, len(self.reference))

    def follow(self, times: Numbers, rows: Numbers, end: int) -> None:
        """Follow the rows up to before one of them."""
        begun, ended = self.begin, self.end
        self.begin, self.end = _begun(times, begun, end, self._seconds, self._most), end
        if ended > self.begin:
            if ended == end:
                return
            squares, scatter = slide(*self.sums, times, rows, ended, end, begun, self.begin)
            self._drift += _EPSILON * (end - ended + self.begin - begun) * squares
            if self._drift <= _DRIFT * max(scatter, (end - self.begin) * self.floor):
                return
        np.mean(rows[self.begin : end], axis=0, out=self.reference)
        self.floor = _NO_MOVEMENT**2 * float(self.reference @ self.reference)
        self.first[:], self.second[:], self.clock[:] = 0.0, 0.0, (times[end - 1], 0.0, 0.0, 0.0)
        squares, _ = slide(*self.sums, times, rows, self.begin, end, 0, 0)
        self._drift = _EPSILON * (end - self.begin) * squares


@compiled
def slide(  # noqa: PLR0913, PLR0917 - sums, and the rows that they follow
    reference: Numbers,
    clock: Numbers,
    first: Numbers,
    second: Numbers,
    times: Numbers,
    rows: Numbers,
    entered: int,
    end: int,
    left: int,
    begin: int,
) -> tuple[float, float]:
    """Add the rows from `entered` to before `end` to the sums of `_Sums`, subtract those from `left` to before `begin`.

    Returns
    -------
    The sum of all squares, which bounds the rounding; and what is left of it relative to the rows' mean.
    """
    some = slice(entered, end), slice(left, begin)
    relative = np.concatenate([rows[each] for each in some])
    relative -= reference
    since = np.concatenate([times[each] for each in some]) - clock[0]
    signs = np.repeat((1.0, -1.0), (end - entered, begin - left))
    factors = np.array([signs, signs * since])
    first += factors @ relative
    clock[1:3] += factors.sum(axis=1)
    clock[3] += factors[1] @ since
    if second.ndim == 1:
        relative *= relative
        second += signs @ relative
        squares = float(second.sum())
    else:
        second += (relative.T * signs) @ relative
        squares = float(second.trace())
    return squares, squares - float(first[0] @ first[0]) / clock.item(1)


def moments_of(reference: Numbers, clock: Numbers, first: Numbers, second: Numbers) -> Moments:
    """Give the moments of distances whose sums are `_Sums`, of one window."""
    _, count, since, square = clock.tolist()
    mean, trend = first / count
    variance = second / count
    variance -= mean * mean
    np.maximum(variance, 0.0, out=variance)
    swing = square / count - (since / count) ** 2
    trend -= mean * (since / count)
    trend /= math.sqrt(swing) if swing > 0 else math.inf
    mean += reference
    return Moments(mean[None], np.sqrt(variance, out=variance)[None], trend[None])


def covariance_of(clock: Numbers, first: Numbers, second: Numbers, floor: float) -> Numbers:
    """Give the covariance of points whose sums are `_Sums`; 0 where its trace is not above a floor."""
    count = clock.item(1)
    mean = first[0] / count
    covariance: Numbers = second / count
    covariance -= mean[:, None] * mean
    return covariance if floor < float(covariance.trace()) < math.inf else np.zeros_like(covariance)


@compiled
def read_distances(  # noqa: PLR0913, PLR0917 - sums, a body and constants
    reference: Numbers,
    clock: Numbers,
    first: Numbers,
    second: Numbers,
    sizing: Numbers,
    segments: NDArray[np.intp],
    between: Numbers,
    floor: float,  # noqa: ARG001 - `parts` knows it
    level: float,  # noqa: ARG001
) -> tuple[Numbers, float]:
    """Give spread, posture and trend of distances whose sums are `_Sums`, shape (3, pairs), and their movement."""
    moments, body = moments_of(reference, clock, first, second), Body(sizing, segments, between)
    return np.concatenate([parts.FORMULAS[kind](moments, body) for kind in _PLACES]), float(parts.movement(moments)[0])


@compiled
def read_points(  # noqa: PLR0913, PLR0917 - sums, and the last eigenvectors
    clock: Numbers,
    first: Numbers,
    second: Numbers,
    floor: float,
    near: Numbers,  # noqa: ARG001 - only the compiled function begins where the last one ended
    eigenvectors: int,
) -> tuple[Numbers, Numbers, Numbers, float]:
    """Give the leading eigenpairs of points whose sums are `_Sums`, (NEAR,) and (NEAR, directions), fewer if there are.

    Behind them come the eigen part with so many of them, (eigenvectors, directions), and the covariance's trace. `near`
    are the eigenvectors of a covariance much like it, or any others.
    """
    covariance = covariance_of(clock, first, second, floor)
    values, columns = leading_eigenvectors(covariance, NEAR)
    vectors = np.ascontiguousarray(columns.T)
    scaled = parts.eigen(values[None, :eigenvectors], vectors[None, :eigenvectors])[0]
    return values, vectors, scaled, float(covariance.trace())
