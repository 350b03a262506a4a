"""A step of the filter that follows a body through the moments of a class, and the numbers by which it weighs them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Floats = NDArray[np.float32]
Indices = NDArray[np.intp]
Moving = Callable[[int, int, int], None]


def follow_phase(  # noqa: PLR0913, PLR0917 - the arrays of a class
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
    found: Numbers,
) -> Callable[[], None]:
    """Give a function that takes a step of the filter, and writes what it found.

    Parameters
    ----------
    course, indices
        For each moment its phase, the probabilities of beginning there and of a next round, and one over the moments in
        its bin, shape (4, moments); and its bin, and the moments by their phase, shape (2, moments).
    starts
        Where each recording begins, shape (recordings,).
    vectors, lengths
        The moments' vectors, shape (axes, moments), and their squared lengths, shape (moments,).
    expected
        Numbers of each moment whose means are wanted, shape (numbers, moments).
    constants
        How probable a step by 0, 1 and 2 is, a change, a beginning and a next round; the weight of a squared distance;
        and which phases are near.
    live, belief, after
        The live body's vector, shape (axes,), as it is written before a step; the probability of each moment, and room.
    found
        The phase below which half the probability lies, the probability near it, and the means of the numbers.
    """
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

    def call() -> None:
        squares = lengths - 2 * (live @ vectors)
        weights = np.exp(-0.5 * sharpness * (squares - squares.min()))
        go_on()
        after[:] *= weights
        total = float(after.sum())
        belief[:] = after / total if total > 0 else beginning
        middle = int(np.searchsorted(np.cumsum(belief[order[:-1]]), 0.5))
        phase = phases[order[middle]]
        found[:] = phase, belief[np.abs(phases - phase) <= near].sum(), *(expected @ belief)

    return call


def moving(points: Numbers, whitening: Numbers, live: Floats, found: Numbers, factor: float) -> Moving:
    """Give a function that whitens the newest point and its velocity, to `live`.

    To `found` go the squared length of the velocity and the summed variance of the points. The function takes where the
    points (points, directions) begin and end, and how many points before the newest the velocity begins.
    """

    def call(begin: int, end: int, back: int) -> None:
        some = points[begin:end]
        if len(some):
            velocity = factor * (some[-1] - some[max(len(some) - 1 - back, 0)])
            live[:] = np.concatenate([some[-1], velocity]) @ whitening
            found[:] = float(velocity @ velocity), float(some.var(axis=0).sum())

    return call
