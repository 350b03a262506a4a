"""Other well-known methods: each names a class at every hop from the last moments.

All of them get distances by our own function, and templates prepared beforehand, for free.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.distances import distance_rows
from kinespace.stream.recognizer import Settings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.library import MotionLibrary
    from kinespace.library.skeleton import Skeleton
    from kinespace.stream.frame import Frame

#: Seconds of the feed whose leading eigenvectors are compared.
WINDOW = 0.5
#: Seconds between two windows of a motion.
_EVERY = 0.25
#: Frames per second of poses that are warped.
_WARPED_RATE = 30.0
#: Seconds that are warped.
_WARPED_SECONDS = 1.0
#: Seconds before the first answer.
FIRST = 0.5


class Alternative(ABC):
    """Another way of comparing the last moments of a motion with a library.

    Parameters
    ----------
    library
        The library whose classes are named.
    frame_rate
        Frames per second of the feed.
    most
        The entries that are compared: the last ones that `entry` gave.
    """

    def __init__(self, library: MotionLibrary, frame_rate: float, most: int) -> None:
        self._classes, self._skeleton = library.classes, library.skeleton
        self._first, self._hop = round(FIRST * frame_rate), round(Settings().hop * frame_rate)
        self._entries: deque[NDArray[np.floating]] = deque(maxlen=most)
        self.begin()

    def begin(self) -> None:
        """Forget what was seen: another motion begins."""
        self._entries.clear()
        self._frames = 0

    def push(self, frame: Frame) -> str | None:
        """Take in a frame; give the class with the best score when an answer is due."""
        entry = self.entry(frame.positions, self._frames)
        if entry is not None:
            self._entries.append(entry)
        self._frames += 1
        if self._frames < self._first or (self._frames - self._first) % self._hop:
            return None
        return self._classes[int(np.argmax(self.scores()))]

    @abstractmethod
    def entry(self, positions: NDArray[np.floating], number: int) -> NDArray[np.floating] | None:
        """Give what is compared of a frame's positions, (joints, 3), metres, by its number; None to pass it over."""

    @abstractmethod
    def scores(self) -> NDArray[np.floating]:
        """Compare the entries: give a score for each class, higher is nearer, shape (classes,)."""


class LeadingAxis(Alternative):
    """The paper's comparison: |inner product| of leading eigenvectors, by SVD, of windows of half a second.

    Parameters
    ----------
    library, frame_rate
        As `Alternative`.
    """

    def __init__(self, library: MotionLibrary, frame_rate: float) -> None:
        super().__init__(library, frame_rate, round(WINDOW * frame_rate))
        axes, names = [], []
        for motion in library.motions:
            rows = distance_rows(motion.positions, motion.skeleton)
            length, step = (round(seconds * motion.frame_rate) for seconds in (WINDOW, _EVERY))
            for end in range(max(min(length, len(rows)), 2), len(rows) + 1, step):
                axes.append(by_svd(rows[max(end - length, 0) : end]))
                names.append(motion.class_name)
        self._axes = np.array(axes, dtype=np.float32)
        self._starts = np.unique(names, return_index=True)[1]

    def entry(self, positions: NDArray[np.floating], number: int) -> NDArray[np.floating]:  # noqa: ARG002 - all count
        """Give the frame's distances."""
        row: NDArray[np.floating] = distance_rows(positions[None], self._skeleton)[0]
        return row

    def scores(self) -> NDArray[np.floating]:
        """Compare the window's leading eigenvector with the eigenvectors of all windows of the library."""
        products = np.abs(self._axes @ by_svd(np.array(self._entries)).astype(np.float32))
        best: NDArray[np.floating] = np.maximum.reduceat(products, self._starts)
        return best


def by_svd(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the leading eigenvector of rows (frames, pairs): the first right singular vector of the centred rows."""
    axis: NDArray[np.float64] = np.linalg.svd(rows - rows.mean(axis=0), full_matrices=False)[2][0]
    return axis


class TimeWarping(Alternative):
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

    def __init__(self, library: MotionLibrary, frame_rate: float) -> None:
        super().__init__(library, frame_rate, round(_WARPED_SECONDS * _WARPED_RATE))
        self._every = round(frame_rate / _WARPED_RATE)
        poses = [
            poses_in_body_frame(motion.positions[:: round(motion.frame_rate / _WARPED_RATE)], motion.skeleton)
            for motion in library.motions
        ]
        self._poses = np.concatenate(poses).astype(np.float32)
        self._squares = np.square(self._poses).sum(axis=1)
        firsts = np.cumsum([0, *map(len, poses[:-1])])
        # No path goes from one motion into the next.
        self._begins, self._seconds = (np.isin(np.arange(len(self._poses)), firsts + place) for place in (0, 1))
        names = [motion.class_name for motion in library.motions]
        self._starts = firsts[np.unique(names, return_index=True)[1]]

    def entry(self, positions: NDArray[np.floating], number: int) -> NDArray[np.floating] | None:
        """Compare every fourth frame of 120 a second with all poses of the library."""
        if number % self._every:
            return None
        pose = poses_in_body_frame(positions[None], self._skeleton)[0].astype(np.float32)
        squared = self._squares - 2 * (self._poses @ pose) + pose @ pose
        costs: NDArray[np.floating] = np.sqrt(np.maximum(squared, 0))
        return costs

    def scores(self) -> NDArray[np.floating]:
        """Find the cheapest path through each class's motions."""
        costs = iter(self._entries)
        paths = next(costs)
        for cost in costs:
            by_one, by_two = np.roll(paths, 1), np.roll(paths, 2)
            by_one[self._begins] = by_two[self._begins] = by_two[self._seconds] = np.inf
            paths = cost + np.minimum(np.minimum(paths, by_one), by_two)
        return 1 / (1 + np.minimum.reduceat(paths, self._starts) / len(self._entries))


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
