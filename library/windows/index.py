"""A library opened for recognition: its motions' windows, as vectors with which a live window is compared."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from kinespace.library.distances import distance_rows
from kinespace.library.kernels.aligned import give_back_memory
from kinespace.library.motion_library import MotionLibrary
from kinespace.library.windows.basis import Basis
from kinespace.library.windows.body import Body
from kinespace.library.windows.comparison import ACROSS_LABORATORIES, WITHIN_LABORATORY, Comparison, Weighing
from kinespace.library.windows.cutting import FIRST_WINDOW, CutWindows, window_ends
from kinespace.library.windows.kept import WEIGHINGS, kept_of, with_kept
from kinespace.library.windows.laid import Windows
from kinespace.library.windows.metric import Lessons, rounded
from kinespace.library.windows.parts import EIGEN_LONG
from kinespace.library.windows.rejection import Rejection, learned_rejection, typical_evidence

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from kinespace.library.clip import Clip
    from kinespace.library.skeleton import Skeleton
    from kinespace.library.windows.parts import Part

#: Seconds between two windows that are kept of a motion: in a library of one person, and of several persons.
_EVERY_ONE, _EVERY_SEVERAL = 0.1, 0.4
#: Frames per second of the motions when their windows are computed.
_MEASURED_AT = 30.0
#: Frames per second at which the basis is learned.
_BASIS_AT = 10.0
#: Windows from which metrics are learned, at most, and windows whose numbers are in memory at once, about.
_MAX_LESSONS, _PIECE = 10_000, 4_000
#: Persons needed to learn metrics: with fewer, metrics are learned from the built-in library's persons.
_TEACHERS = 3


@dataclass(frozen=True, slots=True, eq=False)
class WindowIndex:
    """The windows of a library's motions, by class and person.

    Attributes
    ----------
    library
        The motions.
    body, basis, comparison
        How windows are computed and compared.
    vectors
        For each group the windows' vectors, shape (windows, axes), float32, rounded to half precision.
    eigenvectors
        The leading eigenvector of each window over two seconds, in the basis, shape (windows, directions), float32.
    motions
        Index of each window's motion, ascending, shape (windows,).
    judged_by
        The rejection of unknown motions; None when it is learned from the motions at first use.
    classes
        The class names of all windows, sorted; `nothing` among them when the library holds such motions.
    """

    library: MotionLibrary
    body: Body
    basis: Basis
    comparison: Comparison
    vectors: tuple[NDArray[np.float32], ...] = field(repr=False)
    eigenvectors: NDArray[np.float32] = field(repr=False)
    motions: NDArray[np.intp] = field(repr=False)
    judged_by: Rejection | None = field(default=None, repr=False)
    classes: tuple[str, ...] = field(init=False)
    blocks: Blocks = field(init=False, repr=False)
    _windows: Windows = field(init=False, repr=False)

    def __post_init__(self) -> None:
        names = [self.library.motions[index].class_name for index in self.motions]
        classes = sorted(set(names))
        object.__setattr__(self, "classes", tuple(classes))
        people = [self.library.motions[index].actor for index in self.motions]
        object.__setattr__(self, "blocks", Blocks.of(np.searchsorted(classes, names), people))
        windows = Windows(self.comparison, self.vectors, self.eigenvectors, self.blocks)
        object.__setattr__(self, "_windows", windows)

    @property
    def rejection(self) -> Rejection:
        """The rejection of unknown motions; learned from the motions at first use."""
        return self.judged_by or _rejection(self)

    @classmethod
    def of(cls, library: MotionLibrary, teacher: MotionLibrary | None = None, weighing: Weighing | None = None) -> Self:
        """Compute the windows of a library's motions and their vectors.

        Parameters
        ----------
        library
            Motions, of which at least one is long enough for a window.
        teacher
            The library from whose persons the metrics are learned; `teacher_of` when not given.
        weighing
            The groups of parts that are compared; `usual_weighing` when not given.

        Raises
        ------
        ValueError
            No motion is long enough for a window.
        """
        weighing = weighing or usual_weighing(library)
        teacher = teacher or teacher_of(library)
        body, kept = Body.of(teacher.skeleton), kept_of(teacher, weighing)
        if kept:
            comparison = kept.comparison.of_taught_classes() if library is teacher else kept.comparison
            measured = _Measured.of(library, _every(library), weighing.first)
            placed = measured.placed(comparison, body, kept.basis)
            return cls(library, body, kept.basis, comparison, placed.vectors, placed.eigenvectors, measured.motions)
        basis = learned_basis(teacher)
        taught = _Measured.of(teacher, _EVERY_SEVERAL, weighing.first)
        lessons = taught.thinned(_MAX_LESSONS)
        cut = CutWindows(lessons.clips, lessons.ends, body, basis)
        numbers = cut.numbers(weighing.parts)
        comparison = Comparison.learned(weighing, numbers, _lessons(teacher, lessons.motions))
        comparison = comparison.of_taught_classes() if library is teacher else comparison
        again = library is teacher and _every(library) == _EVERY_SEVERAL
        if again and lessons is taught:
            placed = Placed.of(comparison, cut, numbers)
        else:
            taught = taught if again else _Measured.of(library, _every(library), weighing.first)
            placed = taught.placed(comparison, body, basis)
        return cls(library, body, basis, comparison, placed.vectors, placed.eigenvectors, taught.motions)

    def __len__(self) -> int:
        return len(self.motions)

    def with_motions(self, clips: Iterable[Clip], every: float | None = None) -> WindowIndex:
        """Add clips to the library, each as one motion, and cut their windows.

        Basis, metrics and rejection stay the same; `of` learns them anew. So adding clips is quick, and a feed goes on
        without a pause (`stream.recognizer.Recognizer.exchange`).

        Parameters
        ----------
        clips
            At least one.
        every
            Seconds between two of their windows; the library's own when not given.

        Raises
        ------
        ValueError
            A clip has no class name, too few frames, no movement, or joints more than a kilometre away; or no clip is
            long enough for a window.
        SkeletonMismatchError
            A clip has other joints than the library.
        """
        library = self.library.with_motions(clips)
        known = {id(motion) for motion in self.library.motions}
        # The motions that were there before keep their order.
        is_new = np.array([id(motion) not in known for motion in library.motions])
        before, added = np.flatnonzero(~is_new), np.flatnonzero(is_new)
        taught = replace(library, motions=tuple(library.motions[place] for place in added))
        measured = _Measured.of(taught, every or _every(library), self.comparison.weighing.first)
        placed = measured.placed(self.comparison, self.body, self.basis)
        motions = np.concatenate([before[self.motions], added[measured.motions]])
        order = np.argsort(motions, kind="stable")
        index = replace(
            self,
            library=library,
            vectors=tuple(np.concatenate(each)[order] for each in zip(self.vectors, placed.vectors, strict=True)),
            eigenvectors=np.concatenate([self.eigenvectors, placed.eigenvectors])[order],
            motions=motions[order],
            judged_by=self.rejection,
        )
        index.prepare()
        return index

    def without(self, motions: Sequence[int]) -> WindowIndex:
        """Give the index without the windows of some motions; the metrics stay the same."""
        return self._kept(~np.isin(self.motions, motions))

    def of_some(self, motions: Sequence[int]) -> WindowIndex:
        """Give the index of some motions alone, in this order, with the numbers of the library that hold for them."""
        places = np.unique(motions)
        kept = self._kept(np.isin(self.motions, places))
        learned = self.library.learned
        some = tuple(self.library.motions[place] for place in places.tolist())
        library = replace(self.library, motions=some, learned=learned and learned.for_other_motions())
        return replace(kept, library=library, motions=np.searchsorted(places, kept.motions))

    def _kept(self, kept: NDArray[np.bool_]) -> WindowIndex:
        return replace(
            self,
            vectors=tuple(each[kept] for each in self.vectors),
            eigenvectors=self.eigenvectors[kept],
            motions=self.motions[kept],
        )

    def log_distances(self, numbers: Mapping[Part, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Compare one live window with every window of the library.

        Parameters
        ----------
        numbers
            The numbers of each part, (numbers,).

        Returns
        -------
        For each of the weighing's `weights` and each class the log distance of the nearest window, as the mean over the
        two nearest persons: shape (weights, classes).
        """
        return self._windows.compared(numbers)

    def distances_of(self, vectors: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
        """Do the same as `log_distances` for a window that is placed already, by the vector of each group."""
        return self.blocks.agreed(self.blocks.nearest(self._windows.weighed(vectors)))

    def prepare(self) -> None:
        """Prepare now, so that the first comparison need not wait."""
        self._windows.prepare()

    def own_distances(self, window: int, left_out: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Compare one of the library's own windows with the others, without some of them.

        Parameters
        ----------
        window
            Index of the window that asks.
        left_out
            The windows that are not compared, as flags, shape (windows,).

        Returns
        -------
        For each of the weighing's `weights` the log distance of each class, shape (weights, classes); infinite for a
        class without windows left.
        """
        views = self._windows.weighed([each[window] for each in self.vectors])
        views[:, left_out] = np.inf
        return self.blocks.agreed(self.blocks.nearest(views))

    def eigenvector_scores(self, eigenvector: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compare a leading eigenvector alone: each class's best |inner product| (Le Naour et al. 2012, section 3).

        Parameters
        ----------
        eigenvector
            Unit length, in the basis, shape (directions,).

        Returns
        -------
        Shape (classes,), 0 to 1.
        """
        return self._windows.scores(eigenvector)


@lru_cache(maxsize=8)
def _rejection(index: WindowIndex) -> Rejection:
    learned, weighing = index.library.learned, index.comparison.weighing
    # Strangers' motions taught numbers for all groups: without some parts the library's own motions teach.
    if learned is None or not index.library.judged_by_strangers or weighing != usual_weighing(index.library):
        return learned_rejection(index)
    rejection = Rejection.of_kept(learned, len(weighing.groups))
    fewer = len(index.library.skeleton.joints) < rejection.joints
    return rejection.moved_to(typical_evidence(index)) if fewer else rejection


def keeping_lessons(library: MotionLibrary) -> MotionLibrary:
    """Give a library that keeps the basis and the metrics that its own motions teach, so that it opens sooner."""
    # As if another library had taught: all axes are kept.
    indices = {
        name: WindowIndex.of(library, teacher=replace(library), weighing=weighing)
        for name, weighing in WEIGHINGS.items()
    }
    bases = [index.basis for index in indices.values()]
    return with_kept(library, bases[0], {name: index.comparison for name, index in indices.items()})


@lru_cache(maxsize=4)
def opened(library: MotionLibrary) -> WindowIndex:
    """Give a library's windows; several recognisers of one library share them."""
    index = WindowIndex.of(library)
    index.prepare()
    give_back_memory()
    return index


def usual_weighing(library: MotionLibrary) -> Weighing:
    """Choose the weighing: between laboratories for numbers learned from another laboratory, else within one."""
    return ACROSS_LABORATORIES if library.judged_by_strangers else WITHIN_LABORATORY


def teacher_of(library: MotionLibrary) -> MotionLibrary:
    """Choose the library from whose persons the metrics are learned.

    A library teaches itself when three or more of its persons share classes. Otherwise the built-in library teaches, if
    it has all joints; if it lacks some, the library teaches itself as well as it can.
    """
    performed = {(clip.class_name, clip.actor) for clip in library.motions if clip.actor}
    people = {actor for _, actor in performed}
    if len(people) >= _TEACHERS and len(performed) > len({class_name for class_name, _ in performed}):
        return library
    builtin = _builtin()
    if set(library.skeleton.joints) <= set(builtin.skeleton.joints):
        taught = builtin.restricted_to(library.skeleton.joints)
        return _in_order(taught, library.skeleton)
    return library


@lru_cache(maxsize=1)
def _builtin() -> MotionLibrary:
    return MotionLibrary.builtin()


def _in_order(library: MotionLibrary, skeleton: Skeleton) -> MotionLibrary:
    """Put a library's joints in the order of a skeleton."""
    if library.skeleton.joints == skeleton.joints:
        return library
    return replace(library, skeleton=skeleton, motions=tuple(clip.as_of(skeleton) for clip in library.motions))


def learned_basis(library: MotionLibrary, *, weighted: bool = True) -> Basis:
    """Learn the basis from a library's motions."""
    by_class = groupby(library.motions, key=lambda clip: clip.class_name)
    rows = ((_thinned(clip, _BASIS_AT) for clip in clips) for _, clips in by_class)
    measured = ((distance_rows(clip.positions, clip.skeleton) for clip in clips) for clips in rows)
    return Basis.learned(measured, Body.of(library.skeleton), weighted=weighted)


def measured_clips(
    library: MotionLibrary, every: float | None = None, first: float = FIRST_WINDOW
) -> tuple[list[Clip], list[NDArray[np.intp]], NDArray[np.intp]]:
    """Cut a library's motions into windows.

    Parameters
    ----------
    library
        The motions.
    every, first
        Seconds between two windows, and from a motion's start to the end of its first window. By default windows lie
        closer in a library of one person.

    Returns
    -------
    The motions at the frame rate of the computation, for each motion the frames before which its windows end, and for
    each window the index of its motion.

    Raises
    ------
    ValueError
        No motion is long enough for a window.
    """
    every = every or _every(library)
    clips = [_thinned(clip, _MEASURED_AT) for clip in library.motions]
    ends = [window_ends(clip, every, first) for clip in clips]
    motions = np.repeat(np.arange(len(clips)), [len(each) for each in ends])
    if not len(motions):
        raise ValueError("library: expected a motion long enough for a window, got none")
    return clips, ends, motions


def _every(library: MotionLibrary) -> float:
    """Give the seconds between two windows that are kept of a motion."""
    return _EVERY_SEVERAL if len(library.actors) > 1 else _EVERY_ONE


class Placed(NamedTuple):
    """Windows in the form an index keeps; the fields are as in `WindowIndex`."""

    vectors: tuple[NDArray[np.float32], ...]
    eigenvectors: NDArray[np.float32]

    @classmethod
    def of(cls, comparison: Comparison, cut: CutWindows, numbers: Mapping[Part, NDArray[np.float64]]) -> Placed:
        """Map windows with these numbers to vectors."""
        vectors = tuple(rounded(each) for each in comparison.place(numbers))
        return cls(vectors, cut.eigenpairs[EIGEN_LONG.seconds].vectors[:, 0].astype(np.float32))


class _Measured(NamedTuple):
    """The motions of a library and the ends of their windows, as `measured_clips` gives them."""

    clips: list[Clip]
    ends: list[NDArray[np.intp]]
    motions: NDArray[np.intp]

    @classmethod
    def of(cls, library: MotionLibrary, every: float, first: float) -> _Measured:
        return cls(*measured_clips(library, every, first))

    def thinned(self, most: int) -> _Measured:
        """Keep at most so many windows, evenly spread."""
        step = -(-len(self.motions) // most)
        if step == 1:
            return self
        begins = np.cumsum([0, *map(len, self.ends)])
        ends = [each[-int(begin) % step :: step] for begin, each in zip(begins, self.ends, strict=False)]
        return _Measured(self.clips, ends, self.motions[::step])

    def placed(self, comparison: Comparison, body: Body, basis: Basis) -> Placed:
        """Compute the windows' vectors, some motions at a time, because their numbers take much more memory."""
        pieces, begin = list[Placed](), 0
        pieces_of = np.cumsum([0, *map(len, self.ends)]) // _PIECE
        # With the last motion a piece may be full.
        for end in sorted({*(np.flatnonzero(np.diff(pieces_of)) + 1), len(self.clips)}):
            cut = CutWindows(self.clips[begin:end], self.ends[begin:end], body, basis)
            pieces.append(Placed.of(comparison, cut, cut.numbers(comparison.weighing.parts)))
            begin = end
        vectors = zip(*(piece.vectors for piece in pieces), strict=True)
        return Placed(
            tuple(np.concatenate(each) for each in vectors), np.concatenate([piece.eigenvectors for piece in pieces])
        )


def _thinned(clip: Clip, frame_rate: float) -> Clip:
    step = max(1, round(clip.frame_rate / frame_rate))
    return replace(clip, positions=clip.positions[::step], frame_rate=clip.frame_rate / step)


def _lessons(library: MotionLibrary, motions: NDArray[np.intp]) -> Lessons:
    """Give each window's class and person; each motion without a named person counts as a person of its own."""
    _, classes = np.unique([clip.class_name for clip in library.motions], return_inverse=True)
    _, people = np.unique([clip.actor for clip in library.motions], return_inverse=True)
    return Lessons(classes[motions], people[motions])


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """The order of the windows: all windows of one person in one class are next to each other.

    Attributes
    ----------
    starts
        Where the windows of each person in each class start, shape (blocks,).
    class_starts
        Where the windows of each class start, shape (classes,).
    places
        For each class its blocks, filled up with the index of an absent block, shape (classes, most persons).
    """

    starts: NDArray[np.intp]
    class_starts: NDArray[np.intp]
    places: NDArray[np.intp]

    @classmethod
    def of(cls, classes: NDArray[np.intp], people: Sequence[str]) -> Blocks:
        """Find the blocks of windows that are sorted by class and, within a class, by person."""
        actors = np.asarray(people)
        begins = np.append(True, (classes[1:] != classes[:-1]) | (actors[1:] != actors[:-1]))
        starts = np.flatnonzero(begins)
        counts = np.unique(classes[starts], return_counts=True)[1]
        places = np.full((len(counts), counts.max()), len(starts))
        places[np.arange(counts.max()) < counts[:, None]] = np.arange(len(starts))
        return cls(starts, np.flatnonzero(np.diff(classes, prepend=-1)), places)

    def nearest(self, distances: NDArray[np.float32]) -> NDArray[np.float32]:
        """Take the least of each block's distances, (..., windows) to (..., blocks)."""
        nearest: NDArray[np.float32] = np.minimum.reduceat(distances, self.starts, axis=-1)
        return nearest

    def agreed(self, logs: NDArray[np.floating]) -> NDArray[np.float64]:
        """Take the mean of the two least of each class's blocks, (..., blocks) to (..., classes).

        Where several persons perform a class, the second nearest must agree: one person's way may resemble another
        motion.
        """
        padded = np.full((*logs.shape[:-1], logs.shape[-1] + 1), np.inf)
        padded[..., :-1] = logs
        by_person = np.sort(padded.take(self.places, axis=-1), axis=-1)
        first = by_person[..., 0]
        if by_person.shape[-1] == 1:
            return first
        second = by_person[..., 1]
        return (first + np.where(np.isfinite(second), second, first)) / 2
