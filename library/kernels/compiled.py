"""The inner loops of a hop, compiled from `compiled.c` if a compiler was there when kinespace was installed.

Without them numpy computes the same, more slowly. `KINESPACE_COMPILED=0` in the environment disables them.

They are in C because other compilers of loops (numba) cost start time and memory; tests/TRIED.md has the measurements.
"""

from __future__ import annotations

import importlib
import os
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

Numbers = NDArray[np.float64]
Indices = NDArray[np.intp]
Halves = NDArray[np.float16]
Floats = NDArray[np.float32]


class Table(Protocol):
    """A library's windows, laid out so that a live window is compared with all of them."""

    def add_part(self, eigenvectors: int, directions: int, origin: Floats, axes: Halves, /) -> None:
        """Describe how the next part's numbers become a vector: (numbers − origin) @ axes.

        Parameters
        ----------
        eigenvectors, directions
            Shape of a part of scaled eigenvectors; 0 for a part of distances.
        origin, axes
            Shape (numbers,) and (numbers, kept); both empty for eigenvectors that are compared as they are.
        """

    def add_group(self, parts: Indices, origin: Floats, axes: Halves, windows: Halves, lengths: Floats, /) -> None:
        """Describe how the next group is compared.

        Parameters
        ----------
        parts
            The parts that the group joins.
        origin, axes
            A metric of the joined vector; both empty where there is no metric.
        windows
            The windows' vectors, (windows, kept); for eigenvectors four vectors one after another, (windows, 4
            directions).
        lengths
            Squared lengths, (windows,).
        """

    def compared(self, *arrays: Numbers) -> None:
        """Compare the numbers of a window's parts, and write log distances to the last array, (views, classes)."""

    def scores(self, eigenvector: Numbers, scores: Numbers, /) -> None:
        """Write each class's best |inner product| with a leading eigenvector (directions,) to scores (classes,)."""


class Bound(Protocol):
    """A function of the loops with its arguments, whose arrays are checked once.

    Attributes
    ----------
    run
        Calls the function; numbers stand for the last of its arguments.
    """

    run: Callable[..., Any]


class Loops(Protocol):
    """The compiled module; each function raises ValueError for an array of another shape or type.

    Attributes
    ----------
    MAX_JOINTS, MAX_DIRECTIONS
        Bodies and bases with more are left to numpy.
    """

    MAX_JOINTS: int
    MAX_DIRECTIONS: int

    def kind(self) -> str:
        """Give the kind of the loops in use: avx512, avx2, or any."""

    def use(self, kind: str, /) -> None:
        """Use loops of another kind, for tests."""

    def measure_distances(self, positions: Numbers, pairs: Indices, rows: Numbers, /) -> None:
        """Write the distances of frames (frames, joints, 3) between pairs (pairs, 2) to rows (frames, pairs)."""

    def Bound(  # noqa: N802 - a class of the C module
        self, name: str, /, *arguments: Numbers | Indices | NDArray[np.uint8 | np.uint16] | float
    ) -> Bound:
        """Bind the arguments of a loop that runs at every hop.

        follow(rows, times, places, drift, sums, clock, seconds, most, end, moved)
            Lets a window's sums (4, width) and clock (3,) follow its rows; gives whether they were computed afresh.
            Names are as in `SlidingWindow`, `Span` and `RollingMoments`.
        follow_products(points, times, places, drift, reference, total, products, seconds, most, end, moved)
            Does the same for the sums of `RollingCovariance`.
        read_parts(sums, clock, places, sizing, segments, above, ends, floor, level, spread, posture, trend)
            Writes spread, posture and trend, (width,); the last two are empty where they are not wanted. Gives the
            window's movement, and the size of the body. Names are as in `RollingMoments` and `Body`; floor and level
            are `NOISE_FLOOR` and `LEVEL_REMOVED`.
        read_eigen(total, products, places, drift, values, vectors, scaled, block)
            Writes the leading eigenpairs of a covariance, (k,) and (k, width), four at most, and the part `eigen`, (k,
            width); gives the covariance's trace. The block, (width, 8), at first 0, takes eigenvectors over to the next
            call, which finds those of a similar covariance sooner.
        """

    def eigenpairs(self, covariances: Numbers, values: Numbers, vectors: Numbers, /) -> bool:
        """Write the largest eigenvalues of each matrix, (n, k), and their eigenvectors, (n, k, size): four at most.

        Return False where a matrix holds NaN or infinity.
        """

    def follow_phase(  # noqa: PLR0913, PLR0917 - as above
        self,
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
        room: Floats,
        told: Numbers,
        /,
    ) -> None:
        """Take one step of the filter that follows a body through the moments of a class.

        Parameters
        ----------
        course
            Of each moment its phase, how probable it is at the beginning and where a next round begins, and one over
            how many moments are in its bin, (4, moments).
        indices
            Of each moment its bin; and the moments by their phase, (2, moments).
        starts
            Where each recording begins.
        vectors, lengths
            The moments, (axes, moments), and their squared lengths.
        expected
            Rows whose mean is wanted, (rows, moments).
        constants
            How probable a step by 0, 1 and 2 is, a change of the recording, a beginning, and a next round; how much a
            squared distance counts; which phases are near.
        live
            The live body, (axes,).
        belief
            How probable each moment is: read and written.
        after, room
            Room for so many numbers, and for so many and a register more.
        told
            Where to write the phase, how probable the phases near it are, and the means, (2 + rows,).
        """

    def moving(
        self, points: Numbers, back: int, factor: float, whitening: Numbers, live: Floats, /
    ) -> tuple[float, float]:
        """Write the newest point and its velocity, whitened; give the velocity's squared length, the points' variance.

        Parameters
        ----------
        points
            (points, directions), the newest last.
        back, factor
            How many points before the newest the velocity begins, and the factor on it.
        whitening
            (2 directions, axes).
        live
            Where to write, (axes,).
        """

    def steps(self, positions: Numbers, last: Numbers, steps: Numbers, /) -> float:
        """Write the steps of joints from frame to frame, (frames, joints, 3), the first from `last`, (joints, 3).

        Return the largest sum of squares of a frame's steps about their mean; NaN when there is one.
        """

    def extremes(self, looks: Numbers, ends: Indices, lengths: Numbers, moved: Numbers, /) -> None:
        """Write how segments and joints change in some frames; NaN counts only where there is nothing else.

        Parameters
        ----------
        looks
            The frames, (frames, joints, 3).
        ends
            The joints at the ends of each segment, (segments, 2).
        lengths
            Where to write the mean of the least and greatest length, and their difference, (2, segments).
        moved
            Where to write how far each joint moves along an axis at most, (joints,).
        """

    def Table(  # noqa: N802 - a class of the C module
        self, windows: Floats, block_starts: Indices, class_starts: Indices, weights: Floats, nearest: float, /
    ) -> Table:
        """Begin a table.

        Parameters
        ----------
        windows
            The leading eigenvector of each window, (windows, directions).
        block_starts, class_starts
            Where the windows of each person in each class start, and where each class's persons start among them.
        weights
            Of each group in each view, (views, groups).
        nearest
            A lower bound for squared distances.
        """


def _built() -> Loops | None:
    if os.environ.get("KINESPACE_COMPILED") == "0":
        return None
    try:
        built = importlib.import_module("kinespace.library.kernels._compiled")
    except ImportError:
        return None
    # A module built from older sources may lack a function: until it is built anew, numpy does everything.
    wanted = {name for name in (*vars(Loops), *Loops.__annotations__) if not name.startswith("_")}
    return cast("Loops", built) if wanted <= set(dir(built)) else None


#: The compiled loops; None where there are none.
loops: Loops | None = _built()


@contextmanager
def left_aside() -> Iterator[None]:
    """Disable the compiled loops inside this block. A recogniser is created and used inside it, or outside."""
    global loops  # noqa: PLW0603 - one for the process, as modules are
    before, loops = loops, None
    try:
        yield
    finally:
        loops = before


def kind() -> str:
    """Name the arithmetic in use, in a few words."""
    return f"compiled loops ({loops.kind()})" if loops else "numpy"
