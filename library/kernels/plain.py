"""The kernels in numpy: here one reads what each computes. A function takes a kernel's arguments and gives the call.

The arguments are described in `kernels.table`; they are checked before they come here.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.kernels.table import LANE
from kinespace.library.signature import parts
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import Eigenpairs, Moments

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Numbers = NDArray[np.float64]
    Floats = NDArray[np.float32]
    Halves = NDArray[np.float16]
    Indices = NDArray[np.intp]
    Call = Callable[..., float]

#: Rounding of a number, relative to it.
EPSILON = float(np.finfo(np.float64).eps)
#: Frames whose distances are measured at once: more would not fit into the processor's cache.
_FRAMES = 8


# --- distances ---------------------------------------------------------------------------------------------------


def distances(positions: Numbers, pairs: Indices, rows: Numbers) -> Call:
    """Write the distances of the first frames (frames, joints, 3) between pairs (pairs, 2) to rows (frames, pairs)."""
    first, second = pairs.T.copy()

    def call(frames: float) -> float:
        for begin in range(0, int(frames), _FRAMES):
            some = slice(begin, min(begin + _FRAMES, int(frames)))
            # Joint by joint, because whole axes are copied at once: (3, joints, frames).
            axes = np.ascontiguousarray(positions[some].transpose(2, 1, 0))
            x, y, z = np.square(axes.take(first, axis=1) - axes.take(second, axis=1))
            rows[some] = np.sqrt(x + y + z).T
        return 0.0

    return call


# --- sums that follow the rows of a window -----------------------------------------------------------------------


def follow(  # noqa: PLR0913, PLR0917 - a kernel's arguments
    rows: Numbers, times: Numbers, places: Indices, drift: Numbers, sums: Numbers, clock: Numbers, *limits: float
) -> Call:
    """Let sums follow a window's rows; give whether they were computed afresh.

    `sums` are the reference row, and of the rows relative to it the sum, the products with time, and the squares;
    `clock` is the reference time, and of the times relative to it the sum and the squares. `limits` are the seconds and
    the rows that are followed, the tolerance, and the movement that does not matter.
    """

    def begin(some: slice) -> None:
        sums[1:] = clock[:] = 0.0
        np.mean(rows[some], axis=0, out=sums[0])
        clock[0] = times[some.stop - 1]
        drift[1] = (limits[3] * float(sums[0].mean())) ** 2

    def add(entered: slice, left: slice) -> None:
        relative, weights = _weighed(rows, entered, left)
        relative -= sums[0]
        since = np.concatenate([times[entered], times[left]]) - clock[0]
        factors = np.array([weights, weights * since])
        sums[1:3] += factors @ relative
        relative *= relative
        sums[3] += weights @ relative
        clock[1:] += factors @ since if len(since) else 0.0

    def bounds(count: int) -> tuple[float, float]:
        # The largest sum and its own scatter: a distance that stood still while others moved must not be lost.
        place = int(sums[3].argmax())
        squares, total = sums.item(3, place), sums.item(1, place)
        return squares, max(squares - total * total / count, count * drift.item(1))

    return _following(times, places, drift, limits, begin, add, bounds)


def follow_products(  # noqa: PLR0913, PLR0917 - a kernel's arguments
    points: Numbers, times: Numbers, places: Indices, drift: Numbers, sums: Numbers, products: Numbers, *limits: float
) -> Call:
    """Let the sum and the products of points relative to a reference follow a window; else as `follow`."""
    reference, total = sums

    def begin(some: slice) -> None:
        np.mean(points[some], axis=0, out=reference)
        drift[1] = limits[3] ** 2 * float(reference @ reference)
        total[:] = 0.0
        products[:] = 0.0

    def add(entered: slice, left: slice) -> None:
        relative, weights = _weighed(points, entered, left)
        relative -= reference
        total[...] += weights @ relative
        products[...] += (relative.T * weights) @ relative

    def bounds(count: int) -> tuple[float, float]:
        trace = float(products.trace())
        return trace, max(trace - float(total @ total) / count, count * drift.item(1))

    return _following(times, places, drift, limits, begin, add, bounds)


def _following(  # noqa: PLR0913, PLR0917 - the pieces of one call
    times: Numbers,
    places: Indices,
    drift: Numbers,
    limits: tuple[float, ...],
    begin: Callable[[slice], None],
    add: Callable[[slice, slice], None],
    bounds: Callable[[int], tuple[float, float]],
) -> Call:
    """Follow the last seconds of a window: `places` say where they begin and end, as if no row had moved back."""
    seconds, most, tolerance, _ = limits

    def afresh(rows: slice) -> float:
        begin(rows)
        add(rows, slice(0, 0))
        count = rows.stop - rows.start
        drift[0] = EPSILON * count * bounds(count)[0]
        return 1.0

    def call(now: float, moved_back: float) -> float:
        end, moved = int(now), int(moved_back)
        if not end:
            return 0.0
        left, entered = (max(place - moved, 0) for place in places.tolist())
        start, too_old = left, times.item(end - 1) - seconds
        while start < end - 1 and (times.item(start) <= too_old or end - 1 - start >= most):
            start += 1
        places[:] = start + moved, end + moved
        gone, entered = max(min(start, entered), left), max(entered, start)
        new, count = end - entered, end - start
        if not new:
            return 0.0
        if new == count:
            drift[0] = 0.0
            return afresh(slice(start, end))
        add(slice(entered, end), slice(left, gone))
        largest, scatter = bounds(count)
        drift[0] += EPSILON * (new + gone - left) * largest
        return afresh(slice(start, end)) if drift[0] > tolerance * scatter else 0.0

    return call


def _weighed(rows: Numbers, entered: slice, left: slice) -> tuple[Numbers, Numbers]:
    """Copy the rows that entered and left to one array, and give their signs, 1 and -1."""
    signs = np.repeat((1.0, -1.0), (entered.stop - entered.start, left.stop - left.start))
    return np.concatenate([rows[entered], rows[left]]), signs


# --- parts of a signature ----------------------------------------------------------------------------------------


def read_parts(  # noqa: PLR0913, PLR0917 - a kernel's arguments
    sums: Numbers,
    clock: Numbers,
    places: Indices,
    sizing: Numbers,
    segments: Indices,
    above: Numbers,
    ends: NDArray[np.uint16],
    spread: Numbers,
    posture: Numbers,
    trend: Numbers,
    *_: float,
) -> Call:
    """Write spread, posture and trend of a window, the last two if there is room; give its movement."""
    body = Body(sizing, segments, above, ends)
    wanted = [
        (compute, numbers)
        for compute, numbers in ((parts.spread, spread), (parts.posture, posture), (parts.trend, trend))
        if len(numbers)
    ]

    def call() -> float:
        moments = _moments(sums, clock, int(places[1] - places[0]))
        for compute, numbers in wanted:
            numbers[:] = compute(moments, body)[0]
        return float(parts.movement(moments)[0])

    return call


def _moments(sums: Numbers, clock: Numbers, count: int) -> Moments:
    middle = clock[1] / count
    swing = clock[2] / count - middle * middle
    relative = sums[1:] / count
    mean, trend, variance = relative
    trend -= mean * middle
    trend /= np.sqrt(swing if swing > 0 else np.inf)
    variance -= mean * mean
    np.maximum(variance, 0.0, out=variance)
    mean += sums[0]
    return Moments(mean[None], np.sqrt(variance, out=variance)[None], trend[None])


def read_eigen(  # noqa: PLR0913, PLR0917 - a kernel's arguments
    sums: Numbers,
    products: Numbers,
    places: Indices,
    drift: Numbers,
    values: Numbers,
    vectors: Numbers,
    scaled: Numbers,
    block: Numbers,  # noqa: ARG001 - only the compiled kernel begins where the last one ended
) -> Call:
    """Write a window's leading eigenpairs and its part `eigen`; give the trace of its covariance."""
    covariance = np.empty((1, *products.shape))
    found = eigenpairs(covariance, values[None], vectors[None])

    def call() -> float:
        count = int(places[1] - places[0])
        mean = sums[1] / count
        np.divide(products, count, out=covariance[0])
        covariance[0] -= mean[:, None] * mean
        if covariance[0].trace() <= drift[1]:
            covariance[:] = 0.0
        if not found():
            return math.nan
        scaled[:] = parts.eigen(Eigenpairs(values[None], vectors[None]))[0]
        return float(covariance[0].trace())

    return call


def eigenpairs(covariances: Numbers, values: Numbers, vectors: Numbers) -> Call:
    """Write the largest eigenvalues of each symmetric matrix and their eigenvectors; give whether all were found."""
    from scipy.linalg.lapack import dsyevr  # noqa: PLC0415 - slow to load, and the compiled kernels do not need it

    size, found = covariances.shape[-1], values.shape[-1]

    def call() -> float:
        if not np.isfinite(covariances).all():
            return 0.0
        for matrix, own_values, own_vectors in zip(covariances, values, vectors, strict=True):
            few, columns, *_ = dsyevr(matrix, range="I", il=size - found + 1, iu=size, lower=1)
            own_values[:], own_vectors[:] = few[found - 1 :: -1], columns.T[::-1]
        return 1.0

    return call


# --- windows compared --------------------------------------------------------------------------------------------


def place(numbers: Numbers, origin: Floats, axes: Halves, vector: Numbers) -> Call:
    """Map numbers by a metric, (numbers − origin) axes."""
    whole = axes[:, : len(vector)].astype(np.float32)

    def call() -> float:
        vector[:] = np.subtract(numbers, origin, dtype=np.float32) @ whole
        return 0.0

    return call


def compare(  # noqa: PLR0913, PLR0917 - a kernel's arguments
    groups: Indices,
    windows: Halves,
    lengths: Floats,
    weights: Floats,
    blocks: Indices,
    classes: Indices,
    vectors: Numbers,
    products: Floats,  # noqa: ARG001 - only the compiled kernel needs room
    logs: Numbers,
    named: Numbers,
    nearest: float,
    by_products: float,
    naming: float,
) -> Call:
    """Compare a live window with all windows of a library: log distances of each class, by each row of weights."""
    weigh = weighing(groups, windows, lengths[:, : blocks[-1]], weights, vectors, nearest, by_products=by_products > 0)
    agreed = agreeing(blocks, classes)

    def call() -> float:
        logs[:] = agreed(weigh())
        named[:] = logs[: int(naming)].min(axis=0)
        return 0.0

    return call


def weighing(  # noqa: PLR0913, PLR0917 - as `compare`
    groups: Indices,
    windows: Halves,
    lengths: Floats,
    weights: Floats,
    vectors: Numbers,
    nearest: float,
    *,
    by_products: bool = False,
) -> Callable[[], Floats]:
    """Give a function that weighs the log distances from a window's vectors to all windows, (rows of weights, windows).

    Parameters
    ----------
    groups, windows, weights, vectors, nearest, by_products
        As in `compare`; by products, what is weighed is the negative |inner product| of two eigenvectors.
    lengths
        Squared lengths of the windows' vectors, shape (groups, windows).
    """
    count = lengths.shape[1]
    all_of = []
    for axes, eigenvectors, begin, first in groups.tolist():
        width = axes * max(eigenvectors, 1)
        lanes = -(-count // LANE)
        in_lanes = windows[first : first + lanes * LANE * width].reshape(lanes, width, LANE)
        # Axes come first, because products with few rows are faster from the left.
        laid = in_lanes.transpose(1, 0, 2).reshape(width, -1)[:, :count].astype(np.float32)
        if eigenvectors:
            laid = laid.reshape(eigenvectors, axes, count).transpose(1, 0, 2).reshape(axes, -1)
        all_of.append((slice(begin, begin + width), eigenvectors, np.ascontiguousarray(laid)))
    squared = np.empty((len(groups), count), dtype=np.float32)
    minus_two = np.full(LANE, -2, dtype=np.float32)

    def call() -> Floats:
        live = vectors.astype(np.float32)
        for place, (some, eigenvectors, laid) in enumerate(all_of):
            vector = live[some]
            if eigenvectors:
                alike = vector.reshape(eigenvectors, -1) @ laid
                np.square(alike, out=alike)
                np.dot(minus_two[: eigenvectors**2], alike.reshape(-1, count), out=squared[place])
                squared[place] += np.float32(1)
            else:
                np.dot(vector * np.float32(-2), laid, out=squared[place])
                squared[place] += vector @ vector
            squared[place] += lengths[place]
        np.maximum(squared, np.float32(nearest), out=squared)
        if by_products:
            np.negative(np.sqrt(np.maximum(1 - squared / 2, 0.0, out=squared), out=squared), out=squared)
        else:
            np.log(squared, out=squared)
        weighed: Floats = weights @ squared
        return weighed

    return call


def agreeing(blocks: Indices, classes: Indices) -> Callable[[NDArray[np.floating]], Numbers]:
    """Give a function that takes the mean of the two least of each class, from (..., windows) to (..., classes).

    Where several persons perform a class, the second nearest must agree: one person's way may resemble another motion.

    Parameters
    ----------
    blocks
        Where the windows of each person in each class start, and where the last ones end, shape (blocks + 1,).
    classes
        Where the blocks of each class start, and where the last ones end, shape (classes + 1,).
    """
    counts = np.diff(classes)
    # For each class its blocks, filled up with the index of an absent block.
    places = np.full((len(counts), counts.max()), len(blocks) - 1)
    places[np.arange(counts.max()) < counts[:, None]] = np.arange(len(blocks) - 1)

    def agreed(numbers: NDArray[np.floating]) -> Numbers:
        nearest = np.minimum.reduceat(numbers, blocks[:-1], axis=-1)
        padded = np.full((*nearest.shape[:-1], nearest.shape[-1] + 1), np.inf)
        padded[..., :-1] = nearest
        by_person = np.sort(padded.take(places, axis=-1), axis=-1)
        first: Numbers = by_person[..., 0]
        if by_person.shape[-1] == 1:
            return first
        second = by_person[..., 1]
        return (first + np.where(np.isfinite(second), second, first)) / 2

    return agreed


def scores(windows: Floats, products: Floats, starts: Indices, eigenvector: Numbers, found: Numbers) -> Call:
    """Write each class's best |inner product| of its windows' leading eigenvectors with another."""
    directions = windows.shape[1]
    laid = windows.transpose(1, 0, 2).reshape(directions, -1)[:, : starts[-1]].copy()
    part = products[: starts[-1]]

    def call() -> float:
        np.dot(eigenvector.astype(np.float32), laid, out=part)
        np.abs(part, out=part)
        found[:] = np.maximum.reduceat(part, starts[:-1])
        return 0.0

    return call


# --- how far a motion is -----------------------------------------------------------------------------------------


def follow_phase(  # noqa: PLR0913, PLR0917 - a kernel's arguments
    course: Numbers,
    indices: Indices,
    starts: Indices,
    vectors: Floats,
    lengths: Floats,
    expected: Numbers,
    constants: Numbers,
    live: Floats,
    belief: Numbers,
    after: Numbers,
    room: Floats,  # noqa: ARG001 - only the compiled kernel needs room
    found: Numbers,
) -> Call:
    """Take one step of the filter that follows a body through the moments of a class."""
    phases, beginning, rounds, alike = course
    bins, order = indices
    ends = np.append(starts[1:], len(phases)) - 1
    stay, one, two, changes, begins, again, _, near = constants.tolist()
    # In double precision, which a number of numpy's own asks for.
    sharpness = constants[6]

    def go_on() -> None:
        """Move every probability on by a step."""
        by_one, by_two = belief.copy(), belief.copy()
        # A recording's last moments must not go on to the next recording.
        by_one[ends] = by_two[ends] = by_two[ends - 1] = 0.0
        after[:] = stay * belief
        after[1:] += one * by_one[:-1]
        after[2:] += two * by_two[:-2]
        beyond = (one + two) * belief[ends] + two * belief[ends - 1] * (ends > starts)
        after[ends] += (1 - again) * beyond
        after[:] += again * beyond.sum() * rounds
        mass = np.bincount(bins, weights=after)
        after[:] = (1 - changes - begins) * after + changes * alike * mass[bins] + begins * beginning

    def call() -> float:
        squares = lengths - 2 * (live @ vectors)
        weights = np.exp(-0.5 * sharpness * (squares - squares.min()))
        go_on()
        after[:] *= weights
        total = float(after.sum())
        belief[:] = after / total if total > 0 else beginning
        middle = int(np.searchsorted(np.cumsum(belief[order[:-1]]), 0.5))
        phase = phases[order[middle]]
        found[:] = phase, belief[np.abs(phases - phase) <= near].sum(), *(expected @ belief)
        return 0.0

    return call


def moving(points: Numbers, whitening: Numbers, live: Floats, found: Numbers, factor: float) -> Call:
    """Whiten the newest point and its velocity; find the velocity's squared length and the variance of the points."""

    def call(begin: float, end: float, back: float) -> float:
        some = points[int(begin) : int(end)]
        if len(some):
            velocity = factor * (some[-1] - some[max(len(some) - 1 - int(back), 0)])
            live[:] = np.concatenate([some[-1], velocity]) @ whitening
            found[:] = float(velocity @ velocity), float(some.var(axis=0).sum())
        return 0.0

    return call


# --- which joints can be believed --------------------------------------------------------------------------------


def steps(positions: Numbers, last: Numbers, found: Numbers, farthest: Numbers) -> Call:
    """Write the steps of joints from frame to frame, and the largest squared sum of a frame's steps.

    Gives the largest sum of squares of a frame's steps about their mean.
    """

    def call(frames: float) -> float:
        count, farthest[0] = int(frames), 0.0
        if not count:
            return 0.0
        some = found[:count]
        np.subtract(positions[0], last, out=some[0])
        np.subtract(positions[1:count], positions[: count - 1], out=some[1:])
        middles = some.mean(axis=1, keepdims=True)
        own = some - middles
        farthest[0] = some.shape[1] ** 2 * float(np.square(middles).sum(axis=2).max())
        return float(np.einsum("fjc,fjc->f", own, own).max())

    return call
