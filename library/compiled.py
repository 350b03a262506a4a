"""The inner loops of a hop, compiled (`compiled.c`): there if a compiler was when kinespace was installed.

Without them numpy does the same, at three times the cost. `KINESPACE_COMPILED=0` in the environment leaves them aside.

They are in C because what else compiles loops costs every start time, and memory more than all the rest takes: what was
measured of numba stands in tests/TRIED.md.
"""

from __future__ import annotations

import importlib
import os
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

Numbers = NDArray[np.float64]
Halves = NDArray[np.float16]
Floats = NDArray[np.float32]
#: How a measure becomes part of a vector: origin, axes, how much counts what lies outside them, weight.
Part = tuple[Floats, Floats, float, float]


class Table(Protocol):
    """A library's windows, laid out for a live one to be compared with all of them."""

    def compared(self, *arrays: Numbers) -> None:
        """Compare the measures of a window, in the groups' order, and write log distances to the last, (classes,)."""

    def squares(self, *arrays: Numbers | Floats) -> None:
        """Compare likewise, and write squared distances to the last, (groups, windows), float32."""


class Look(Protocol):
    """What a first look along a few directions knows of a library's axes."""

    def products(self, axis: Floats, products: Floats, best: NDArray[np.intp], /) -> None:
        """Write an axis's (directions,) products with all others, (motions,), and each class's best, (classes,)."""

    def listed(self, products: Floats, least: Floats, outside: float, listed: NDArray[np.intp], /) -> int:
        """Write which motions may score the least of their class, or more; say how many they are.

        Parameters
        ----------
        products
            As found, (motions,).
        least
            Of each class, (classes,).
        outside
            Length of the axis outside the directions.
        listed
            Room for their indices, (motions,).
        """


class Loops(Protocol):
    """What is compiled; each raises ValueError where an array is of another shape or type than it works on.

    Attributes
    ----------
    MOST_JOINTS, MOST_DIRECTIONS, MOST_AXES
        More than these are left to numpy.
    TOGETHER
        Frames, or vectors, that are dealt with side by side.
    """

    MOST_JOINTS: int
    MOST_DIRECTIONS: int
    MOST_AXES: int
    TOGETHER: int

    def kind(self) -> str:
        """Say for which processors the loops in use are: avx512, avx2, or any."""

    def use(self, kind: str, /) -> None:
        """Use those of another kind, so that they can be tested."""

    def measure_distances(self, positions: Numbers, pairs: NDArray[np.intp], rows: Numbers, /) -> None:
        """Write the distances of frames (frames, joints, 3) between pairs (pairs, 2) to rows (frames, pairs)."""

    def follow(self, sums: Numbers, entered: Numbers, left: Numbers, /) -> tuple[float, float]:
        """Add rows to a window's sums (3, width), and take rows away.

        The first of the three is what the sums are relative to. Gives the largest sum of squares, and the sum there.
        """

    def read_spread(  # noqa: PLR0913, PLR0917 - a call from Python costs by its arguments' names
        self, sums: Numbers, count: float, sizing: Numbers, floor: float, level: float, numbers: Numbers, /
    ) -> float:
        """Write the spread of a window of so many rows with these sums, (width,); give its movement."""

    def read_shape(self, courses: Numbers, floor: float, no_movement: float, numbers: Numbers, /) -> None:
        """Write the shape of a window of courses (frames, n), (n (n + 1) / 2,)."""

    def turn_shape(self, shape: Numbers, directions: Numbers, floor: float, numbers: Numbers, /) -> None:
        """Write the shape in other directions, (n, fewer), of what has this shape in its own."""

    def add_frames(  # noqa: PLR0913, PLR0917 - as above
        self,
        rows: Numbers,
        fresh: int,
        reference: Numbers,
        relative: Numbers,
        square: Numbers,
        of_each: Numbers,
        /,
    ) -> None:
        """Write the inner products of a window's newest rows with all of them, relative to a reference.

        Parameters
        ----------
        rows
            The window's, (rows, width).
        fresh
            How many of them are new.
        reference
            Shape (width,).
        relative
            Room to work in, (`TOGETHER`, width).
        square
            Where to, (rows, rows); what is there of the others stays.
        of_each
            Where to write each fresh row's products with itself and with the reference, (2, rows).
        """

    def times_centred(self, vectors: Numbers, square: Numbers, images: Numbers, /) -> None:
        """Write vectors (`TOGETHER`, n) times a symmetric matrix (n, n), each less its mean."""

    def orthonormal(self, vectors: Numbers, basis: Numbers, /) -> bool:
        """Write an orthonormal basis of what vectors (k, n) span; False where they are too near to each other."""

    def add_products(self, rows: Floats, vector: Floats, listed: NDArray[np.intp], sums: Floats, /) -> None:
        """Add to sums, one for each of the rows listed, the rows' products with a vector."""

    def Table(  # noqa: N802, PLR0913, PLR0917 - a class behind a border that has no names
        self,
        groups: tuple[tuple[tuple[tuple[Floats, Halves, float, float], ...], Halves, Floats], ...],
        windows: int,
        block_starts: NDArray[np.intp],
        class_starts: NDArray[np.intp],
        nearest: float,
        farthest: float,
        /,
    ) -> Table:
        """Lay out a library's windows, as `laid_out` does."""

    def Look(  # noqa: N802 - likewise
        self, within: Halves, outside: Floats, doubt: Floats, class_starts: NDArray[np.intp], /
    ) -> Look:
        """Lay out axes: within the directions (motions, directions), their lengths outside, and of what was rounded."""


def _built() -> Loops | None:
    if os.environ.get("KINESPACE_COMPILED") == "0":
        return None
    try:
        built = importlib.import_module("library._compiled")
    except ImportError:
        return None
    # What was built from older sources may lack something: until it is built anew numpy does it all.
    wanted = {name for name in (*vars(Loops), *Loops.__annotations__) if not name.startswith("_")}
    return cast("Loops", built) if wanted <= set(dir(built)) else None


#: The compiled loops; None where there are none.
loops: Loops | None = _built()


def laid_out(  # noqa: PLR0913 - windows, how they were made, and whose they are
    groups: Sequence[Sequence[Part]],
    vectors: Sequence[Floats],
    block_starts: NDArray[np.intp],
    class_starts: NDArray[np.intp],
    *,
    nearest: float,
    farthest: float,
) -> Table | None:
    """Lay a library's windows out for the compiled loops.

    Parameters
    ----------
    groups
        The parts of each group's vectors.
    vectors
        For each group the windows', shape (windows, axes).
    block_starts, class_starts
        Where the windows of each person in each class start, and where among those the people of each class do.
    nearest, farthest
        What is added to squared distances, and beyond which all are as far.

    Returns
    -------
    None where there are no such loops, a number is finer than half precision, as those in files are not, or there are
    more axes than the loops have room for.
    """
    if loops is None or max(each.shape[1] for each in vectors) > loops.MOST_AXES:
        return None
    axes = [_halves(part[1]) for group in groups for part in group]
    windows = [_halves(each) for each in vectors]
    if any(each is None for each in (*axes, *windows)):
        return None
    rest = iter(axes)
    taken = tuple(
        (
            tuple((np.ascontiguousarray(origin), next(rest), outside, weight) for origin, _, outside, weight in group),
            halves,
            np.square(each).sum(axis=1, dtype=np.float32),
        )
        for group, halves, each in zip(groups, windows, vectors, strict=True)
    )
    return loops.Table(taken, len(vectors[0]), block_starts, class_starts, nearest, farthest)  # type: ignore[arg-type]  # no None is left


def _halves(numbers: Floats) -> Halves | None:
    """Give numbers in half precision, side by side; None where some are finer."""
    with np.errstate(over="ignore"):
        halves = np.ascontiguousarray(numbers, dtype=np.float16)
    return halves if np.array_equal(halves, numbers) else None


@contextmanager
def left_aside() -> Iterator[None]:
    """Leave the compiled loops aside for a while: a recogniser made meanwhile is for meanwhile."""
    global loops  # noqa: PLW0603 - one for the process, as modules are
    before, loops = loops, None
    try:
        yield
    finally:
        loops = before


def kind() -> str:
    """Say in a few words what does the arithmetic."""
    return f"compiled loops ({loops.kind()})" if loops else "numpy"
