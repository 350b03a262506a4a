"""Other well-known methods: each names a class at every hop from the last moments.

All of them get distances by our own function, and templates prepared beforehand, for free.
"""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, Protocol

import numpy as np

from kinespace.library.distances import distance_rows

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kinespace.library import MotionLibrary
    from kinespace.library.skeleton import Skeleton
    from kinespace.stream.frame import Frame

#: Seconds of the feed whose leading eigenvectors are compared.
WINDOW = 0.5
#: Seconds between two windows of a motion.
_EVERY = 0.25


class Alternative(Protocol):
    """Another way of comparing the last moments with a library."""

    def push(self, positions: NDArray[np.floating]) -> None:
        """Take in a frame, (joints, 3), metres."""

    def read(self) -> NDArray[np.floating]:
        """Compare the last moments: give a score for each class, higher is nearer, shape (classes,)."""

    def clear(self) -> None:
        """Forget the frames, as after a gap."""


class LeadingAxis:
    """The paper's comparison: |inner product| of leading eigenvectors of windows of half a second.

    Parameters
    ----------
    library
        The library whose classes are named.
    axis
        Gives the leading eigenvector of distance rows (frames, pairs).
    frame_rate
        Frames per second of the feed.
    """

    def __init__(
        self, library: MotionLibrary, axis: Callable[[NDArray[np.float64]], NDArray[np.float64]], frame_rate: float
    ) -> None:
        self._skeleton = library.skeleton
        self._axis = axis
        self._rows: deque[NDArray[np.float64]] = deque(maxlen=round(WINDOW * frame_rate))
        axes, names = [], []
        for motion in library.motions:
            rows = distance_rows(motion.positions, motion.skeleton)
            length, step = (round(seconds * motion.frame_rate) for seconds in (WINDOW, _EVERY))
            for end in range(max(min(length, len(rows)), 2), len(rows) + 1, step):
                axes.append(by_svd(rows[max(end - length, 0) : end]))
                names.append(motion.class_name)
        self._axes = np.array(axes, dtype=np.float32)
        self._starts = np.unique(names, return_index=True)[1]

    def push(self, positions: NDArray[np.floating]) -> None:
        """Append the frame's distances."""
        self._rows.append(distance_rows(positions[None], self._skeleton)[0])

    def read(self) -> NDArray[np.floating]:
        """Compare the window's leading eigenvector with the eigenvectors of all windows of the library."""
        products = np.abs(self._axes @ self._axis(np.array(self._rows)).astype(np.float32))
        best: NDArray[np.floating] = np.maximum.reduceat(products, self._starts)
        return best

    def clear(self) -> None:
        """Forget the rows."""
        self._rows.clear()


def by_svd(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the leading eigenvector of rows (frames, pairs): the first right singular vector of the centred rows."""
    axis: NDArray[np.float64] = np.linalg.svd(rows - rows.mean(axis=0), full_matrices=False)[2][0]
    return axis


def by_eigh(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the leading eigenvector of rows (frames, pairs) by `np.cov` and `np.linalg.eigh`."""
    axis: NDArray[np.float64] = np.linalg.eigh(np.cov(rows, rowvar=False))[1][:, -1]
    return axis


class TimeWarping:
    """Dynamic time warping of the last second with any part of each motion: begin and end are open.

    Poses in the body's own frame, thirty a second. A frame of the feed is matched with the motion's frame of the
    previous match, with the next frame, or with the one after that: the asymmetric steps of Sakoe and Chiba (1978),
    which matching with an open begin needs (Tormene et al. 2009). A class's score is the score of the nearest part of a
    motion.

    Parameters
    ----------
    library
        The library whose classes are named, of HDM05's joints.
    frame_rate
        Frames per second of the feed.
    """

    RATE = 30.0
    SECONDS = 1.0

    def __init__(self, library: MotionLibrary, frame_rate: float) -> None:
        self._skeleton = library.skeleton
        self._every = round(frame_rate / self.RATE)
        poses = [
            poses_in_body_frame(motion.positions[:: round(motion.frame_rate / self.RATE)], motion.skeleton)
            for motion in library.motions
        ]
        self._poses = np.concatenate(poses).astype(np.float32)
        self._squares = np.square(self._poses).sum(axis=1)
        firsts = np.cumsum([0, *map(len, poses[:-1])])
        # No path goes from one motion into the next.
        self._first, self._second = (np.isin(np.arange(len(self._poses)), firsts + place) for place in (0, 1))
        names = [motion.class_name for motion in library.motions]
        self._starts = firsts[np.unique(names, return_index=True)[1]]
        self._costs: deque[NDArray[np.float32]] = deque(maxlen=round(self.SECONDS * self.RATE))
        self._pushed = 0

    def push(self, positions: NDArray[np.floating]) -> None:
        """Compare every fourth frame of 120 a second with all poses of the library."""
        self._pushed += 1
        if (self._pushed - 1) % self._every == 0:
            pose = poses_in_body_frame(positions[None], self._skeleton)[0].astype(np.float32)
            squared = self._squares - 2 * (self._poses @ pose) + pose @ pose
            self._costs.append(np.sqrt(np.maximum(squared, 0)))

    def read(self) -> NDArray[np.floating]:
        """Find the cheapest path through each class's motions."""
        costs = iter(self._costs)
        paths = next(costs)
        for cost in costs:
            by_one, by_two = np.roll(paths, 1), np.roll(paths, 2)
            by_one[self._first] = by_two[self._first] = by_two[self._second] = np.inf
            paths = cost + np.minimum(np.minimum(paths, by_one), by_two)
        return 1 / (1 + np.minimum.reduceat(paths, self._starts) / len(self._costs))

    def clear(self) -> None:
        """Forget the costs."""
        self._costs.clear()
        self._pushed = 0


def poses_in_body_frame(positions: NDArray[np.floating], skeleton: Skeleton) -> NDArray[np.float64]:
    """Put the root at the origin and turn the hips to face one way about the vertical (y) axis.

    Parameters
    ----------
    positions
        Shape (frames, joints, 3), metres.
    skeleton
        HDM05's skeleton.

    Returns
    -------
    Shape (frames, 3 · joints), metres.
    """
    left, right = (skeleton.joints.index(name) for name in ("lhipjoint", "rhipjoint"))
    centred = np.asarray(positions, dtype=np.float64) - positions[:, :1]
    across = centred[:, right] - centred[:, left]
    length = np.maximum(np.hypot(across[:, 0], across[:, 2]), 1e-9)
    cosine, sine = (across[:, axis, None] / length[:, None] for axis in (0, 2))
    x, y, z = np.moveaxis(centred, -1, 0)
    turned = np.stack([cosine * x + sine * z, y, cosine * z - sine * x], axis=-1)
    return np.ascontiguousarray(turned.reshape(len(turned), -1))


def makers(library: MotionLibrary, frame_rate: float) -> dict[str, Callable[[], Alternative]]:
    """Give, by name, the constructor of each alternative for a feed of so many frames per second."""
    return {
        "SVD of the window": lambda: LeadingAxis(library, by_svd, frame_rate),
        "np.cov + eigh": lambda: LeadingAxis(library, by_eigh, frame_rate),
        "DTW": lambda: TimeWarping(library, frame_rate),
    }


class Hopping:
    """Asks an alternative for the class with the best score at every hop, and starts it anew after a gap.

    Parameters
    ----------
    alternative
        The alternative that is asked.
    classes
        The library's class names.
    first, hop
        Frames before the first answer, and between two answers.
    """

    #: Seconds without a frame after which the alternative starts anew.
    GAP = 0.5

    def __init__(self, alternative: Alternative, classes: Sequence[str], *, first: int, hop: int) -> None:
        self._alternative = alternative
        self._classes = classes
        self._first = first
        self._hop = hop
        self._frames = 0
        self._last = math.inf

    def push(self, frame: Frame) -> str | None:
        """Take in a frame; give the name of a class when an answer is due."""
        if frame.time - self._last > self.GAP:
            self._alternative.clear()
            self._frames = 0
        self._last = frame.time
        self._alternative.push(frame.positions)
        self._frames += 1
        if self._frames < self._first or (self._frames - self._first) % self._hop:
            return None
        return self._classes[int(np.argmax(self._alternative.read()))]
