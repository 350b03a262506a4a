"""Motions that repeat in recordings without labels: cut where the course of movement changes, and grouped.

Takes are cut at stillnesses (`library.teaching.movement`). What lies between is cut where its windows change: the cut
of least squared deviation from each piece's mean, with a penalty for each piece, by dynamic programming (optimal
partitioning, Jackson et al. 2005). Then every piece is one window, however long it lasts: its leading eigenvectors, its
spread, posture and trend over its whole length are compared as a library's windows are. Pieces are grouped by complete
linkage: all pieces of a group are near all others.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library.motion_library import MotionLibrary
from kinespace.library.signature.parts import PARTS, Kind, Part
from kinespace.library.teaching.movement import moved_in
from kinespace.library.windows.comparison import NEAREST, WITHIN_LABORATORY
from kinespace.library.windows.cutting import CutWindows
from kinespace.library.windows.index import WindowIndex, thinned
from kinespace.library.windows.metric import squared_distances

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from numpy.typing import NDArray

    from kinespace.library.clip import Clip
    from kinespace.library.teaching.movement import Stretch

#: Frames per second at which takes are looked at, for movement alone, and seconds between two of their windows.
_MEASURED_AT, _MOVED_AT, _EVERY = 30.0, 15.0, 0.1
#: Seconds over which positions are averaged.
_STEADIED = 0.15
#: Seconds over which windows are averaged, so that a round of a cyclic motion is no change; and by which a window
#: shows a change too late.
_AVERAGED, _LATE = 2.0, 0.5
#: What a further piece costs, in squared distances (`library.windows.metric`): with less, rounds of one motion are cut.
_PENALTY = 12.0
#: Seconds of a piece: at least, and at most where nothing changes.
_SHORTEST, _LONGEST = 0.8, 12.0
#: The seconds of a window that is as long as its piece.
_WHOLE = 1e6
#: Pieces that are compared each with each; further ones join the groups that these make.
MAX_COMPARED = 4000
#: Two pieces are alike up to this log distance, of one person and of several: on average two persons in one motion are
#: at 0 (`library.windows.metric`), and in a group all must be near all.
ALIKE, ALIKE_SEVERAL = -0.15, 1.2
#: Windows whose numbers are in memory at once.
_TOGETHER = 2000


class Piece(NamedTuple):
    """A part of a take in which one thing is done.

    Attributes
    ----------
    take
        Index of the take.
    start, end
        Seconds from the take's beginning.
    """

    take: int
    start: float
    end: float

    @property
    def seconds(self) -> float:
        """Its length."""
        return self.end - self.start


class Pieces:
    """Cuts takes into pieces and measures them.

    Parameters
    ----------
    joints
        The joints of all takes; those that the built-in library has are compared.

    Attributes
    ----------
    takes
        The number of takes cut so far.
    pieces
        The pieces found so far.
    clips
        What is performed in each, at 30 frames per second, over the takes' joints.

    Raises
    ------
    SkeletonMismatchError
        Fewer than five joints are the built-in library's.
    """

    def __init__(self, joints: Collection[str]) -> None:
        builtin = MotionLibrary.builtin().restricted_to(joints)
        # As if another library had taught, all axes are kept: unknown motions may differ in any.
        index = WindowIndex.of(builtin, teacher=replace(builtin), weighing=WITHIN_LABORATORY)
        self._skeleton, self._body, self._basis = builtin.skeleton, index.body, index.basis
        self._place = index.comparison.place
        self.takes = 0
        self.pieces: list[Piece] = []
        self.clips: list[Clip] = []
        self._vectors: list[tuple[NDArray[np.float32], ...]] = []

    def add(self, take: Clip) -> int:
        """Cut the next take; give the number of its pieces. Of the take nothing but the pieces is kept."""
        before = len(self.pieces)
        thin = thinned(take, _MEASURED_AT)
        known = _steadied(thin.restricted_to(self._skeleton.joints).as_of(self._skeleton))
        for stretch in moved_in(thinned(known, _MOVED_AT)):
            for start, end in self._cut(known, stretch):
                first, last = round(start * thin.frame_rate), round(end * thin.frame_rate)
                clip = replace(thin, positions=thin.positions[first:last].astype(np.float32), gaps=(), filled=0)
                self.pieces.append(Piece(self.takes, start, end))
                self.clips.append(clip)
                self._vectors.append(self._measured(known.moved_to(known.positions[first:last])))
        self.takes += 1
        return len(self.pieces) - before

    def _cut(self, take: Clip, stretch: Stretch) -> Iterator[tuple[float, float]]:
        """Cut a stretch of movement where its windows change."""
        if stretch.duration < _SHORTEST / 2:
            return
        edges = list[float]()
        if stretch.duration >= 2 * _SHORTEST:
            ends, vectors = self._windows(take, stretch)
            cuts = changes(_averaged(vectors, round(_AVERAGED / _EVERY)), _PENALTY)
            edges = [float(ends[cut]) - _LATE for cut in cuts]
        first, last = stretch.start + _SHORTEST / 2, stretch.end - _SHORTEST / 2
        yield from pairwise((stretch.start, *(edge for edge in edges if first <= edge <= last), stretch.end))

    def _windows(self, take: Clip, stretch: Stretch) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give the ends of a stretch's windows, seconds, and their vectors, all groups in one row."""
        rate, longest = take.frame_rate, max(part.seconds for part in PARTS)
        ends = np.arange(max(round(stretch.start * rate), 2), take.frames + 1, max(round(_EVERY * rate), 1))
        ends = ends[ends <= (stretch.end + _LATE) * rate]
        vectors: list[NDArray[np.float32]] = []
        for some in np.array_split(ends, max(-(-len(ends) // _TOGETHER), 1)):
            begin = max(int(some[0]) - round(longest * rate), 0)
            near = take.moved_to(take.positions[begin : some[-1]])
            cut = CutWindows([near], [some - begin], self._body, self._basis)
            vectors.append(np.concatenate(self._place(cut.numbers), axis=1))
        return ends / rate, np.concatenate(vectors, dtype=np.float64)

    def _measured(self, piece: Clip) -> tuple[NDArray[np.float32], ...]:
        """Give a piece's vectors: its parts over its whole length stand for the parts of all lengths."""
        whole = {kind: Part(kind, _WHOLE) for kind in Kind}
        cut = CutWindows([piece], [np.array([piece.frames])], self._body, self._basis, tuple(whole.values()))
        return tuple(each[0] for each in self._place({part: cut.numbers[whole[part.kind]] for part in PARTS}))

    def of_takes(self, takes: Collection[int]) -> Pieces:
        """Give the pieces of some takes alone; the takes keep their numbers."""
        some, kept = copy(self), [place for place, piece in enumerate(self.pieces) if piece.take in takes]
        some.pieces, some.clips = [self.pieces[place] for place in kept], [self.clips[place] for place in kept]
        some._vectors = [self._vectors[place] for place in kept]  # noqa: SLF001 - of our own class
        return some

    def vectors(self) -> list[NDArray[np.float32]]:
        """Give for each group of parts the pieces' vectors, shape (pieces, axes)."""
        return [np.array(each) for each in zip(*self._vectors, strict=True)]


def changes(vectors: NDArray[np.floating], penalty: float) -> list[int]:
    """Find where rows change: the cuts of least squared deviation from the pieces' means, plus a penalty a piece.

    Parameters
    ----------
    vectors
        Shape (windows, axes), one each `_EVERY` seconds.
    penalty
        What a further piece costs.

    Returns
    -------
    Indices of the first windows of all pieces but the first.
    """
    shortest, longest = round(_SHORTEST / _EVERY), round(_LONGEST / _EVERY)
    count, centred = len(vectors), vectors - vectors.mean(axis=0)
    sums = np.vstack([np.zeros(centred.shape[1]), np.cumsum(centred, axis=0, dtype=np.float64)])
    squares = np.concatenate([[0.0], np.cumsum(np.square(centred).sum(axis=1, dtype=np.float64))])
    costs, before = np.full(count + 1, np.inf), np.zeros(count + 1, dtype=np.intp)
    costs[0] = 0.0
    for end in range(1, count + 1):
        starts = np.arange(max(end - longest, 0), max(end - shortest, 0) + 1)
        means = np.square(sums[end] - sums[starts]).sum(axis=1) / (end - starts)
        every = costs[starts] + squares[end] - squares[starts] - means + penalty
        place = int(every.argmin())
        costs[end], before[end] = every[place], starts[place]
    cuts, place = [], int(before[count])
    while place > 0:
        cuts.append(place)
        place = int(before[place])
    return cuts[::-1]


def log_distances(vectors: Sequence[NDArray[np.float32]], others: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Give the log distances of some pieces to others, (pieces, others); the groups of parts weigh as in a library."""
    weights, logs = WITHIN_LABORATORY.views[0], np.zeros((len(vectors[0]), len(others[0])), dtype=np.float32)
    for weight, one, other in zip(weights, vectors, others, strict=True):
        logs += weight * np.log(squared_distances(one, other) + NEAREST)
    return logs


def grouped(vectors: Sequence[NDArray[np.float32]], alike: float) -> NDArray[np.intp]:
    """Group pieces; all of a group are alike, as far as they are compared each with each.

    Parameters
    ----------
    vectors
        As `Pieces.vectors`.
    alike
        The log distance up to which two pieces are alike.

    Returns
    -------
    The group of each piece, shape (pieces,), above 0.
    """
    from scipy.cluster.hierarchy import fcluster, linkage  # noqa: PLC0415 - slow to load, and a live feed needs it not
    from scipy.spatial.distance import squareform  # noqa: PLC0415 - as above

    count = len(vectors[0])
    compared = np.linspace(0, count - 1, min(count, MAX_COMPARED)).round().astype(np.intp)
    some = [each[compared] for each in vectors]
    # From 0 on, because linkage takes no distances below it.
    logs = log_distances(some, some) - np.float32(np.log(NEAREST))
    np.fill_diagonal(logs, 0.0)
    if len(compared) < 2:
        return np.ones(count, dtype=np.intp)
    tree = linkage(squareform(np.maximum(logs, 0.0), checks=False), "complete")
    labels = np.zeros(count, dtype=np.intp)
    labels[compared] = fcluster(tree, alike - np.log(NEAREST), "distance")
    left = np.setdiff1d(np.arange(count), compared)
    for further in np.array_split(left, max(len(left) // _TOGETHER, 1)) if len(left) else ():
        near = log_distances([each[further] for each in vectors], some)
        own = near.min(axis=1) <= alike
        labels[further[own]] = labels[compared[near[own].argmin(axis=1)]]
    labels[labels == 0] = labels.max() + 1 + np.arange(int((labels == 0).sum()))
    return labels


def middle(vectors: Sequence[NDArray[np.float32]], members: NDArray[np.intp]) -> NDArray[np.intp]:
    """Sort the members of a group, the one nearest to all others first."""
    some = [each[members] for each in vectors]
    order: NDArray[np.intp] = members[log_distances(some, some).sum(axis=1).argsort(kind="stable")]
    return order


def _steadied(take: Clip) -> Clip:
    """Average each frame with those around it: a depth sensor's joints tremble."""
    frames = take.frames
    over = min(2 * round(_STEADIED * take.frame_rate / 2) + 1, frames - 1 + frames % 2)
    rows = take.positions.reshape(frames, -1)
    return take.moved_to(_averaged(rows, over).reshape(take.positions.shape))


def _averaged(vectors: NDArray[np.floating], over: int) -> NDArray[np.float64]:
    """Average each row with those around it."""
    from scipy.ndimage import uniform_filter1d  # noqa: PLC0415 - as in `grouped`

    averaged: NDArray[np.float64] = uniform_filter1d(
        vectors, min(over, len(vectors)), axis=0, output=np.float64, mode="nearest"
    )
    return averaged
