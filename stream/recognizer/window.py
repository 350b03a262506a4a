"""The window: the distance rows of the last seconds, and their moments over some spans that end now.

A span's sums follow the rows: those that enter are added, those that leave are subtracted. Sums of values of a metre
that move by a millimetre lose digits, as when a performer stands still right after moving. Two habits keep them exact.
Values are taken relative to a reference row near the span's mean, so that they are as small as the movement. And a
bound of the rounding grows with every row; when it is no longer small against the variance that is left, the sums are
computed afresh.
"""

import math
from collections.abc import Collection, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from kinespace.library.compiled import compiled
from kinespace.library.signature.basis import leading_eigenvectors
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import (
    FORMULAS,
    LEVEL_REMOVED,
    NOISE_FLOOR,
    Kind,
    Moments,
    Part,
    Signature,
    eigen,
    movement,
)

Numbers = NDArray[np.float64]

#: Frames per second up to which a window holds all its seconds. A faster feed shortens the window.
MAX_FEED_RATE = 500.0
#: Seconds within which two spans count as equal. A feed's times are multiples of a frame with rounding, a quarter of a
#: microsecond for times since 1970; so ties are decided alike at every rate.
TIE = 1e-6
#: Rows for which there is room at first.
_ROOM = 64
#: Rounding, relative to the total variance, from which on sums are computed afresh: well inside the promised 1e-9.
_DRIFT = 1e-11
#: Movement, relative to the distance, that is none.
_NO_MOVEMENT = 1e-6
#: Eigenpairs that are followed from hop to hop.
NEAR = 8
_EPSILON = float(np.finfo(np.float64).eps)
#: Where the parts stand that are read off distances together.
_PLACES = {Kind.SPREAD: 0, Kind.POSTURE: 1, Kind.TREND: 2}


class Window:
    """The distance rows of the last seconds, ending with the newest frame, and their points in a basis.

    A row at time t is in a span while the newest time is less than t + seconds; the newest row always is. Rows lie one
    after another in time order, so that every read is a slice. When there is no room left they move back to the front.

    Parameters
    ----------
    of_distances, in_basis
        The seconds of the spans whose `moments` and whose `covariance` are asked for.
    directions
        A row times these is a point in the basis, shape (pairs, directions).

    Raises
    ------
    MemoryError
        There is no room for so many seconds.

    Attributes
    ----------
    seconds
        Length of the longest span.
    of_distances, in_basis
        As given, the longest last.
    """

    def __init__(
        self,
        of_distances: Collection[float],
        in_basis: Collection[float],
        directions: Numbers,
    ) -> None:
        self.of_distances, self.in_basis, self._directions = tuple(of_distances), tuple(in_basis), directions
        self.seconds = max(*of_distances, *in_basis)
        pairs, width = directions.shape
        self._times, self._rows, self._points = np.empty(_ROOM), np.empty((_ROOM, pairs)), np.empty((_ROOM, width))
        self._most = _most(self.seconds)
        # A window that memory can never hold is refused at once: the system commits only pages that are used.
        np.empty((self._most, pairs))
        self._moments = {each: _Sums(each, (pairs,)) for each in of_distances}
        self._products = {each: _Sums(each, (width, width)) for each in in_basis}
        self._sums = (*self._moments.values(), *self._products.values())
        self.clear()

    def clear(self) -> None:
        """Forget all rows."""
        self._begin = self._end = 0
        self._near = {each: np.zeros((NEAR, self._directions.shape[1])) for each in self.in_basis}
        for each in self._sums:
            each.begin = each.end = 0

    def push(self, times: Sequence[float], rows: Numbers) -> None:
        """Take in rows (frames, pairs), metres, at their times, later than the rows before."""
        begin, self._end = self._end, self._end + len(times)
        if self._end > len(self._times):
            begin = self._move_back(len(times))
        some = slice(begin, self._end)
        self._times[some], self._rows[some], self._points[some] = times, rows, rows @ self._directions
        self._begin = _begun(self._times, self._begin, self._end, self.seconds, self._most)

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

    @property
    def times(self) -> Numbers:
        """The times of the rows of the longest span, shape (rows,), seconds; a view, valid until the next push."""
        return self._times[self._begin : self._end]

    def recent(self) -> tuple[Numbers, Numbers]:
        """Give the rows of the longest span, (rows, pairs), and their points, (rows, directions); as `times`."""
        some = slice(self._begin, self._end)
        return self._rows[some], self._points[some]

    def moments(self, seconds: float) -> Moments:
        """Give the moments of the distances over a span, of one window."""
        return moments_of(*self._followed(self._moments[seconds]).sums)

    def covariance(self, seconds: float) -> Numbers:
        """Give the covariance of the points over a span, shape (directions, directions); 0 where hardly any is left."""
        sums = self._followed(self._products[seconds])
        return covariance_of(*sums.sums[1:], sums.floor)

    def rows_in(self, seconds: float) -> int:
        """Give the number of rows over a span whose `covariance` can be asked for."""
        return self._products[seconds].end - self._products[seconds].begin

    def read_distances(self, seconds: float, body: Body) -> tuple[Numbers, float]:
        """Give spread, posture and trend over a span, shape (3, pairs), and the movement."""
        sums = self._followed(self._moments[seconds]).sums
        return read_distances(*sums, body.sizing, body.segments, body.between, NOISE_FLOOR, LEVEL_REMOVED)

    def read_points(self, seconds: float, eigenvectors: int) -> tuple[Numbers, Numbers, Numbers, float]:
        """Give the leading eigenpairs of a span, the eigen part with so many of them, and the trace."""
        sums, near = self._followed(self._products[seconds]), self._near[seconds]
        values, vectors, scaled, trace = read_points(*sums.sums[1:], sums.floor, near, eigenvectors)
        self._near[seconds] = vectors
        return values, vectors, scaled, trace

    def _followed(self, sums: "_Sums") -> "_Sums":
        sums.follow(self._times, self._points if sums.second.ndim == 2 else self._rows, self._end)
        return sums


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
    """

    def __init__(self, seconds: float, shape: tuple[int, ...]) -> None:
        self._seconds, self._most = seconds, _most(seconds)
        self.begin = self.end = 0
        self.reference, self.clock = np.zeros(shape[-1]), np.zeros(4)
        self.first, self.second = np.zeros((2, shape[-1])), np.zeros(shape)
        self.sums = self.reference, self.clock, self.first, self.second
        self.floor = self._drift = 0.0

    def follow(self, times: Numbers, rows: Numbers, end: int) -> None:
        """Follow the rows up to before one of them."""
        begun, ended = self.begin, self.end
        self.begin, self.end = _begun(times, begun, end, self._seconds, self._most), end
        if ended > self.begin:
            if ended == end:
                return
            squares, scatter = self._slide(times, rows, (ended, end), (begun, self.begin))
            self._drift += _EPSILON * (end - ended + self.begin - begun) * squares
            if self._drift <= _DRIFT * max(scatter, (end - self.begin) * self.floor):
                return
        np.mean(rows[self.begin : end], axis=0, out=self.reference)
        self.floor = _NO_MOVEMENT**2 * float(self.reference @ self.reference)
        self.first[:], self.second[:], self.clock[:] = 0.0, 0.0, (times[end - 1], 0.0, 0.0, 0.0)
        squares, _ = self._slide(times, rows, (self.begin, end), (0, 0))
        self._drift = _EPSILON * (end - self.begin) * squares

    def _slide(
        self, times: Numbers, rows: Numbers, entered: tuple[int, int], left: tuple[int, int]
    ) -> tuple[float, float]:
        return slide(*self.sums, times, rows, *entered, *left)


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
    return np.concatenate([FORMULAS[kind](moments, body) for kind in _PLACES]), float(movement(moments)[0])


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
    are the eigenvectors of a covariance much like it, or zeros.
    """
    covariance = covariance_of(clock, first, second, floor)
    values, columns = leading_eigenvectors(covariance, NEAR)
    vectors = np.ascontiguousarray(columns.T)
    scaled = eigen(values[None, :eigenvectors], vectors[None, :eigenvectors])[0]
    return values, vectors, scaled, float(covariance.trace())


def signature(window: Window, parts: Iterable[Part], body: Body, eigenvectors: int) -> Signature:
    """Read the parts of the signature, with so many eigenvectors, off the spans that end now."""
    points = {each: window.read_points(each, eigenvectors) for each in window.in_basis}
    distances = {each: window.read_distances(each, body) for each in window.of_distances}

    def numbers_of(part: Part) -> Numbers:
        if part.kind is Kind.EIGEN:
            return points[part.seconds][2]
        if part.kind in _PLACES:
            numbers: Numbers = distances[part.seconds][0][_PLACES[part.kind]]
        else:
            # A kind that is not read together with the others.
            numbers = FORMULAS[part.kind](window.moments(part.seconds), body)[0]
        return numbers

    values, vectors, _, trace = points[window.in_basis[-1]]
    first, second = [*values[:2].tolist(), 0.0][:2]
    moves = trace > 0 and first > 0
    return Signature(
        parts={part: numbers_of(part) for part in parts},
        leading=vectors[0],
        movement=distances[window.of_distances[-1]][1],
        share=min(first / trace, 1.0) if moves else 0.0,
        gap=(first - max(second, 0.0)) / first if moves else 0.0,
    )
