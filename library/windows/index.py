"""A library opened for recognition: its motions' windows, as vectors with which a live window is compared."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from kinespace.library.clip import Clip
from kinespace.library.library_file import for_other_motions
from kinespace.library.memory import give_back_memory
from kinespace.library.motion_library import NOTHING, MotionLibrary
from kinespace.library.phases import PhaseTable
from kinespace.library.signature.basis import Basis
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import Signature
from kinespace.library.windows.comparer import Comparer, Distances, Head, Likelihood
from kinespace.library.windows.comparison import Comparison, Weighing
from kinespace.library.windows.courses import Courses
from kinespace.library.windows.cutting import Measured, Placed, every_in
from kinespace.library.windows.rejection import Rejection, rejection_of
from kinespace.library.windows.remembered import remembered
from kinespace.library.windows.segments import Segments
from kinespace.library.windows.taught import taught_by, teacher_of, usual_weighing

#: Threads of linear algebra: the matrices are small, and threads take the cores from each other. On two busy cores,
#: opening takes 2 to 7 seconds by numpy's own choice of threads, and .7 by one.
_THREADS = 1
#: Views by fewer joints that an index keeps.
MAX_VIEWS = 8


# Without slots: what an index computes at first use stays with it.
@dataclass(frozen=True, eq=False)
class WindowIndex:
    """The windows of a library's motions, by class and person.

    Attributes
    ----------
    library
        The motions.
    body, basis, comparison
        How windows are computed and compared.
    vectors
        For each group the windows' vectors, shape (windows, axes), or (windows, eigenvectors, directions).
    eigenvectors
        The leading eigenvector of each window over two seconds, in the basis, shape (windows, directions), float32.
    motions
        Index of each window's motion, shape (windows,); the windows of a
        class lie together, and in it the windows of a person.
    head
        What helps to name the classes that taught it, within one laboratory; else None.
    judged_by
        The rejection of unknown motions; None when it is learned from the motions at first use.
    origin
        The index that this one was derived from, and how; None for the index of a library.
    """

    library: MotionLibrary
    body: Body
    basis: Basis
    comparison: Comparison
    vectors: tuple[NDArray[np.float16], ...] = field(repr=False)
    eigenvectors: NDArray[np.float32] = field(repr=False)
    motions: NDArray[np.intp] = field(repr=False)
    head: Head | None = field(default=None, repr=False)
    judged_by: Rejection | None = field(default=None, repr=False)
    origin: Origin | None = field(default=None, repr=False)
    _views: dict[tuple[str, ...], WindowIndex] = field(default_factory=dict, init=False, repr=False)

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
        itself, body = library is teacher, Body.of(teacher.skeleton)
        measured = Measured.of(library, every_in(library), weighing.first)
        taught = taught_by(teacher, weighing, names=itself)
        comparison = taught.comparison.of_taught_classes() if itself else taught.comparison
        # Windows that taught are not cut again where all of the library's own did.
        if itself and taught.windows and len(taught.windows.leading) == len(measured.motions):
            placed = Placed.of(comparison, taught.windows)
        else:
            placed = measured.placed(comparison, body, taught.basis)
        return cls(library, body, taught.basis, comparison, *placed, measured.motions, taught.head)

    def __len__(self) -> int:
        return len(self.motions)

    @cached_property
    def classes(self) -> tuple[str, ...]:
        """The class names of all windows, sorted; `nothing` among them when the library holds such motions."""
        return tuple(sorted({class_name for class_name, _ in self._whose}))

    @cached_property
    def _whose(self) -> list[tuple[str, str]]:
        """The class and the person of each window."""
        compared = self.library.motions
        return [(compared[place].class_name, compared[place].actor) for place in self.motions.tolist()]

    @cached_property
    def _windows(self) -> Comparer:
        """The windows as they are compared."""
        whose = np.array([np.unique(each, return_inverse=True)[1] for each in zip(*self._whose, strict=True)]).T
        return Comparer.of(self.comparison, self.vectors, self.eigenvectors, whose)

    @cached_property
    def comparer(self) -> Comparer:
        """The windows as a live window is compared with them."""
        # What judges a guess where the library cannot learn what is unknown.
        judged = self.comparison.weighing.judges and self.rejection.by_likelihood
        likelihood = Likelihood.of(self.vectors, self._windows.classes) if judged else None
        return self._windows._replace(likelihood=likelihood, head=self.head and self.head.of_classes(self.classes))

    def distances(self, signatures: Sequence[Signature]) -> list[Distances]:
        """Compare some windows with all windows, together."""
        return self.comparer.distances(signatures)

    @cached_property
    def rejection(self) -> Rejection:
        """The rejection of unknown motions; learned from the motions at first use."""
        return self.judged_by or rejection_of(self)

    @cached_property
    def phases(self) -> PhaseTable:
        """The moments of the motions with their phases, by which progress is followed."""
        named = [motion for motion in self.framed.motions if motion.class_name != NOTHING]
        known = self.origin.source.__dict__.get("phases") if self.origin else None
        return PhaseTable.of(named, self.body, self.basis, known)

    @cached_property
    def courses(self) -> Courses:
        """The courses of the motions that have windows here, by which motions are found that begin and are done."""
        framed = self.framed.motions
        return Courses.of([framed[place] for place in np.unique(self.motions)])

    @cached_property
    def since(self) -> NDArray[np.float64]:
        """Seconds from a motion's beginning to the end of each of its windows; of an index that is not derived."""
        measured = Measured.of(self.library, every_in(self.library), self.comparison.weighing.first)
        return np.concatenate(
            [ends / clip.frame_rate for ends, clip in zip(measured.ends, measured.clips, strict=True)]
        )

    @cached_property
    def segments(self) -> Segments:
        """The segments of the motions' bodies."""
        return Segments.of(self.framed)

    @cached_property
    def framed(self) -> MotionLibrary:
        """The motions with all their frames: a view by fewer joints keeps none."""
        joints = self.origin.joints if self.origin else ()
        return self.origin.source.framed.restricted_to(joints) if self.origin and joints else self.library

    def by_joints(self, joints: Sequence[str]) -> WindowIndex:
        """Give the windows as a body of some of the joints shows them; takes a second where the library is large.

        The view's motions keep no frames, only their classes and persons. The last `MAX_VIEWS` views are kept.

        Raises
        ------
        ValueError
            No motion is long enough for a window.
        SkeletonMismatchError
            Fewer than five of the joints are the library's.
        """
        key = tuple(joints)
        view = self._views.get(key)
        if view is None:
            while len(self._views) >= MAX_VIEWS:
                self._views.pop(next(iter(self._views)), None)
            with threadpool_limits(_THREADS):
                view = self._views[key] = self._viewed_by(key)
            give_back_memory()
        return view

    def has_view(self, joints: tuple[str, ...]) -> bool:
        """Whether `by_joints` has these windows open."""
        return joints in self._views

    def _viewed_by(self, joints: tuple[str, ...]) -> WindowIndex:
        origin = self.origin
        if origin and origin.joints:
            return origin.source.by_joints(joints)
        if origin and origin.added:
            fewer = [clip.restricted_to(joints) for clip in origin.added]
            view = origin.source.by_joints(joints).with_motions(fewer, origin.every)
        elif origin and origin.kept:
            view = origin.source.by_joints(joints).of_some(origin.kept, learns=origin.learns)
        else:
            bare = _bare(self.library).restricted_to(joints)
            return _remembered(self.library, self.comparison.weighing, Origin(self, joints=joints), bare)
        return replace(view, library=_bare(view.library), origin=Origin(self, joints=joints)).prepared()

    def with_motions(self, clips: Iterable[Clip], every: float | None = None) -> WindowIndex:
        """Add clips to the library, each as one motion, and cut their windows.

        Basis, metrics and rejection stay the same; `of` learns them again. So adding clips is quick, and, after
        `prepared`, a feed goes on without a pause (`stream.recognizer.Recognizer.exchange`).

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
        clips = tuple(clips)
        library = self.library.with_motions(clips)
        known = {id(motion) for motion in self.library.motions}
        # The motions that were there before keep their order.
        is_new = np.array([id(motion) not in known for motion in library.motions])
        before, added = np.flatnonzero(~is_new), np.flatnonzero(is_new)
        taught = replace(library, motions=tuple(library.motions[place] for place in added))
        measured = Measured.of(taught, every or every_in(library), self.comparison.weighing.first)
        placed = measured.placed(self.comparison, self.body, self.basis)
        # Motions that are added one after another are all added to the first index, so that no chain grows.
        origin = self.origin if self.origin and self.origin.added and self.origin.every == every else None
        index = replace(
            self,
            library=library,
            motions=before[self.motions],
            judged_by=self.rejection if self.comparison.weighing.judges else None,
            origin=Origin(origin.source, (*origin.added, *clips), every) if origin else Origin(self, clips, every),
        )
        return index.joined_by(placed, added[measured.motions])

    def joined_by(self, placed: Placed, motions: NDArray[np.intp]) -> Self:
        """Add windows of some of the compared motions, and put all in order."""
        clips, motions = self.library.motions, np.concatenate([self.motions, motions])
        whose = [(clip.class_name, clip.actor) for clip in clips]
        ranks = {each: rank for rank, each in enumerate(sorted(set(whose)))}
        order = np.argsort(np.array([ranks[each] for each in whose])[motions], kind="stable")
        return replace(
            self,
            vectors=tuple(np.concatenate(each)[order] for each in zip(self.vectors, placed.vectors, strict=True)),
            eigenvectors=np.concatenate([self.eigenvectors, placed.eigenvectors])[order],
            motions=motions[order],
        )

    def without(self, motions: Sequence[int]) -> WindowIndex:
        """Give the index without the windows of some motions; the metrics stay the same."""
        return self._kept(~np.isin(self.motions, motions))

    def of_some(self, motions: Sequence[int], *, learns: bool = False) -> WindowIndex:
        """Give the index of some motions alone, in this order, with the numbers of the library that hold for them.

        Parameters
        ----------
        motions
            Indices of the motions.
        learns
            Whether these motions teach what is unknown; else the rejection stays the same.
        """
        places = np.unique(motions)
        some = tuple(self.library.motions[place] for place in places.tolist())
        kept = self._kept(np.isin(self.motions, places))
        library = replace(self.library, motions=some, learned=for_other_motions(self.library.learned))
        return replace(
            kept,
            library=library,
            motions=np.searchsorted(places, kept.motions),
            judged_by=None if learns else self.judged_by,
            origin=Origin(self, kept=tuple(places.tolist()), learns=learns),
        )

    def _kept(self, kept: NDArray[np.bool_]) -> WindowIndex:
        return replace(
            self,
            vectors=tuple(each[kept] for each in self.vectors),
            eigenvectors=self.eigenvectors[kept],
            motions=self.motions[kept],
        )

    def prepared(self) -> Self:
        """Compute now what is otherwise computed at first use, so that the first hop need not wait; give itself."""
        _ = self.comparer, self.segments, self.courses
        return self

    def asked_by(self, window: int, left_out: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Compare one of the library's own windows with the others, without some of them.

        Parameters
        ----------
        window
            The index of the window that asks.
        left_out
            Flags of the windows that are not compared, shape (windows,).

        Returns
        -------
        For each of the weighing's `weights` the log distance of each class, shape (weights, classes); infinite for a
        class without windows left.
        """
        asked = [each[window : window + 1].astype(np.float32, order="C") for each in self.vectors]
        return self._windows.logs(asked, left_out)[:, 0]


class Origin(NamedTuple):
    """How an index was derived from another: with motions added, with some of its motions, or by fewer joints.

    Attributes
    ----------
    source
        The other index.
    added, every
        The clips that were added, and the seconds between their windows.
    kept, learns
        Indices of the motions that were kept, and whether these teach what is unknown.
    joints
        The joints that were kept.
    """

    source: WindowIndex
    added: tuple[Clip, ...] = ()
    every: float | None = None
    kept: tuple[int, ...] = ()
    learns: bool = False
    joints: tuple[str, ...] = ()


@lru_cache(maxsize=4)
def opened(library: MotionLibrary, weighing: Weighing | None = None) -> WindowIndex:
    """Give a library's windows; several recognisers of one library share them."""
    with threadpool_limits(_THREADS):
        index = _remembered(library, weighing or usual_weighing(library))
    give_back_memory()
    return index


def _remembered(
    library: MotionLibrary, weighing: Weighing, origin: Origin | None = None, bare: MotionLibrary | None = None
) -> WindowIndex:
    """Open a library's windows by its joints, or by an origin's, with all that need not be computed again.

    Their motions are then those of `bare`, where it is given.
    """
    joints = origin.joints if origin else ()

    def compute() -> tuple[Any, ...]:
        index = WindowIndex.of(library.restricted_to(joints) if joints else library, weighing=weighing)
        rejection = index.rejection if weighing.judges else None
        placed = (index.vectors, index.eigenvectors, index.motions, index.head, index.judged_by, rejection)
        return (index.body, index.basis, index.comparison, *placed, index.segments, index.courses)

    *fields, rejection, segments, courses = remembered(library, weighing, joints, compute)
    index = replace(WindowIndex(bare or library, *fields), origin=origin)
    # In place of what the index would compute at first use.
    index.__dict__.update(segments=segments, courses=courses, **({"rejection": rejection} if rejection else {}))
    return index.prepared()


def _bare(library: MotionLibrary) -> MotionLibrary:
    """Give a library whose motions keep two frames each."""
    return replace(
        library, motions=tuple(replace(clip, positions=clip.positions[:2].copy()) for clip in library.motions)
    )
