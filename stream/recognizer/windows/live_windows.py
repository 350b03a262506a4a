"""The signature of a live window: the moments of one performer's last seconds, and every part computed from them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library.kernels import compiled
from kinespace.library.windows.cutting import OF_DISTANCES, eigenpairs_of
from kinespace.library.windows.parts import (
    BASIS_LENGTHS,
    DISTANCE_LENGTHS,
    EIGENVECTORS,
    LEVEL_REMOVED,
    NOISE_FLOOR,
    PARTS,
    Kind,
    Part,
    eigen,
    movement,
)
from kinespace.stream.recognizer.joints.carried import contributions
from kinespace.stream.recognizer.windows.rolling import RollingCovariance, RollingMoments, moments_of
from kinespace.stream.recognizer.windows.sliding_window import MAX_PENDING, SlidingWindow

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from kinespace.library.windows.basis import Basis
    from kinespace.library.windows.body import Body
    from kinespace.stream.recognizer.windows.rolling import Rolling


#: Vectors that the compiled loops take over from one hop to the next.
_BLOCK = 8


class LiveSignature(NamedTuple):
    """The numbers of the windows that end now.

    Attributes
    ----------
    numbers
        The numbers of each part, (numbers,).
    movement
        Movement (`library.windows.parts.movement`) over the longest window of distances.
    eigenvector
        The leading eigenvector over the longest window in the basis, unit length, shape (directions,).
    share
        Share of the variance along it, 0 to 1.
    gap
        (λ₁ − λ₂) / λ₁ of the two leading eigenvalues, 0 to 1.
    """

    numbers: Mapping[Part, NDArray[np.float64]]
    movement: float
    eigenvector: NDArray[np.float64]
    share: float
    gap: float


class _RowsAndPoints:
    """Distance rows of the last seconds, and their points in a basis, followed by sums."""

    _window: SlidingWindow
    _directions: NDArray[np.float64]
    _rolling: tuple[Rolling, ...]

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in distance rows, shape (frames, pairs), metres; `MAX_PENDING` at most, later than the rows before."""
        if self._window.pending + len(times) > MAX_PENDING:
            self._settle()
        self._window.push(times, rows, rows @ self._directions)

    def _settle(self) -> None:
        """Let moments and covariances follow the rows that were pushed."""
        for each in self._rolling:
            each.update()
        self._window.pass_over()

    def clear(self) -> None:
        """Forget all rows."""
        self._window.clear()
        for each in self._rolling:
            each.clear()

    def _push_all(self, window: SlidingWindow) -> None:
        """Take in the rows of another window, as many at a time as may be pushed."""
        for begin in range(0, len(window), MAX_PENDING):
            some = slice(begin, begin + MAX_PENDING)
            self.push(window.times[some].tolist(), window.rows[some])

    def contributions(self, eigenvector: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give each joint pair's share of the variance along an eigenvector of the longest window in the basis."""
        return contributions(self._window.rows, self._directions @ eigenvector)


class LiveWindows(_RowsAndPoints):
    """Follows the windows of one performer.

    A window reaches back as far as the feed has been followed, at most its length.

    Parameters
    ----------
    body, basis
        The body and the basis of the library.
    parts
        The parts that are read; more cost more.

    Attributes
    ----------
    longest
        Length of the longest window, seconds.
    """

    longest = max(*DISTANCE_LENGTHS, *BASIS_LENGTHS)

    def __init__(self, body: Body, basis: Basis, parts: Sequence[Part] = PARTS) -> None:
        self._set_body(body, parts)
        self._set_basis(basis)

    def _set_body(self, body: Body, parts: Sequence[Part]) -> None:
        self._body, self._read_parts = body, tuple(parts)

    def _set_basis(self, basis: Basis) -> None:
        self._directions = basis.directions
        pairs, directions = basis.directions.shape
        self._window = SlidingWindow(self.longest, pairs, beside=directions)
        self._moments = tuple(RollingMoments(self._window, seconds) for seconds in DISTANCE_LENGTHS)
        self._covariances = tuple(RollingCovariance(self._window, seconds) for seconds in BASIS_LENGTHS)
        self._rolling = (*self._moments, *self._covariances)
        self._lay_out()

    def _lay_out(self) -> None:
        """Make room for the numbers that the compiled loops write, and bind their arguments, once for all hops."""
        loops, body, unwanted = compiled.loops, self._body, np.empty(0)
        pairs, directions = self._directions.shape
        found = min(EIGENVECTORS, directions)
        self._blocks = np.zeros((len(BASIS_LENGTHS), directions, _BLOCK))
        self._reads: tuple[tuple[Callable[[], tuple[float, float]], ...], tuple[Callable[[], float], ...]] | None = None
        if loops is None or directions > loops.MAX_DIRECTIONS or body.above.shape[1] > loops.MAX_JOINTS:
            return
        self._numbers: dict[Part, NDArray[np.float64]] = {
            part: np.empty((found, directions)) if part.kind is Kind.EIGEN else np.empty(pairs)
            for part in self._read_parts
        }
        numbers, of_body = self._numbers, (body.sizing, body.segments, body.above, body.ends)
        self._values: NDArray[np.float64] = np.empty(found)
        self._leading: NDArray[np.float64] = np.empty((found, directions))
        self._reads = (
            tuple(
                loops.Bound(
                    "read_parts",
                    *(each.sums, each.clock, each.span.places, *of_body, NOISE_FLOOR, LEVEL_REMOVED),
                    numbers.get(Part(Kind.SPREAD, seconds), np.empty(pairs)),
                    numbers.get(Part(Kind.POSTURE, seconds), unwanted),
                    numbers.get(Part(Kind.TREND, seconds), unwanted),
                ).run
                for each, seconds in zip(self._moments, DISTANCE_LENGTHS, strict=True)
            ),
            tuple(
                loops.Bound(
                    "read_eigen",
                    *(each.total, each.products, each.span.places, each.drift, self._values, self._leading),
                    numbers.get(Part(Kind.EIGEN, seconds), np.empty((found, directions))),
                    block,
                ).run
                for each, seconds, block in zip(self._covariances, BASIS_LENGTHS, self._blocks, strict=True)
            ),
        )

    def clear(self) -> None:
        """Forget all rows."""
        super().clear()
        self._blocks[:] = 0.0

    def exchange(self, body: Body, basis: Basis, parts: Sequence[Part] = PARTS) -> None:
        """Follow the same rows, in another basis of the same distances and with another body's measures and parts."""
        self._set_body(body, parts)
        if np.array_equal(basis.directions, self._directions):
            self._lay_out()
            return
        before = self._window
        self._set_basis(basis)
        self._push_all(before)

    def place(self) -> NDArray[np.float64]:
        """Give the newest row's point in the basis, relative to the body's size, shape (directions,); needs a row."""
        point: NDArray[np.float64] = self._window.points[-1] / self._body.size(self._window.rows[-1])
        return point

    def recent(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give the times and the distance rows of the longest window; views, valid until the next push."""
        return self._window.times, self._window.rows

    def read(self) -> LiveSignature:
        """Read the signature of the windows that end with the newest row; needs a row. Valid until the next call."""
        self._settle()
        if self._reads:
            moved = total = 0.0
            for read_parts in self._reads[0]:
                moved, _ = read_parts()
            for read_eigen in self._reads[1]:
                total = read_eigen()
            return LiveSignature(self._numbers, moved, *Leading.of(total, self._values, self._leading[0]))
        covariances = np.array([each.read() for each in self._covariances])
        pairs = eigenpairs_of(covariances)
        scaled = eigen(pairs)
        moments = moments_of(self._moments)
        kinds = {part.kind for part in self._read_parts} & OF_DISTANCES.keys()
        distances = {kind: OF_DISTANCES[kind](moments, self._body) for kind in kinds}
        numbers = {
            part: scaled[BASIS_LENGTHS.index(part.seconds)]
            if part.kind is Kind.EIGEN
            else distances[part.kind][DISTANCE_LENGTHS.index(part.seconds)]
            for part in self._read_parts
        }
        leading = Leading.of(float(np.trace(covariances[-1])), pairs.values[-1], pairs.vectors[-1, 0])
        return LiveSignature(numbers, float(movement(moments)[-1]), *leading)


class Leading(NamedTuple):
    """The leading eigenvector of one window; the fields are as in `LiveSignature`."""

    eigenvector: NDArray[np.float64]
    share: float
    gap: float

    @classmethod
    def of(cls, total: float, values: NDArray[np.float64], eigenvector: NDArray[np.float64]) -> Leading:
        """Compute it from a covariance's trace, leading eigenvalues and leading eigenvector."""
        listed: list[float] = values.tolist()
        first, second = (listed[0], listed[1]) if len(listed) > 1 else (listed[0], 0.0)
        if total <= 0 or first <= 0:
            return cls(eigenvector, 0.0, 0.0)
        return cls(eigenvector, min(first / total, 1.0), (first - max(second, 0.0)) / first)


class PaperWindow(_RowsAndPoints):
    """Follows the one window of the paper's signature.

    Parameters
    ----------
    basis
        The library's basis, without weights.
    seconds
        Length of the window.
    """

    def __init__(self, basis: Basis, seconds: float) -> None:
        self._seconds = seconds
        self._set_basis(basis)

    def _set_basis(self, basis: Basis) -> None:
        self._directions = basis.directions
        pairs, directions = basis.directions.shape
        self._window = SlidingWindow(self._seconds, pairs, beside=directions)
        self._moments, self._covariance = RollingMoments(self._window), RollingCovariance(self._window)
        self._rolling = (self._moments, self._covariance)

    def exchange(self, basis: Basis) -> None:
        """Follow the same rows in another basis of the same distances."""
        before = self._window
        self._set_basis(basis)
        self._push_all(before)

    def read(self) -> tuple[Leading, float]:
        """Read the leading eigenvector of the window that ends with the newest row, and the window's movement."""
        self._settle()
        covariance = self._covariance.read()
        pairs = eigenpairs_of(covariance[None])
        leading = Leading.of(float(covariance.trace()), pairs.values[0], pairs.vectors[0, 0])
        return leading, float(movement(self._moments.read())[0])
