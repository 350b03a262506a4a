"""A library opened for recognition: its motions' windows, as vectors with which a live window is compared."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import groupby
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from kinespace.library.clip import Clip
from kinespace.library.distances import distance_rows
from kinespace.library.memory import give_back_memory
from kinespace.library.motion_library import NOTHING, MotionLibrary
from kinespace.library.progress.phase_table import PhaseTable
from kinespace.library.signature.basis import Basis
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import Signature
from kinespace.library.windows.comparer import Comparer, Distances, Head, Likelihood
from kinespace.library.windows.comparison import ACROSS_LABORATORIES, WITHIN_LABORATORY, Comparison, Lessons, Weighing
from kinespace.library.windows.courses import Courses
from kinespace.library.windows.cutting import FIRST_WINDOW, CutWindows, window_ends
from kinespace.library.windows.kept import WEIGHINGS, Kept, kept_of, with_kept
from kinespace.library.windows.rejection import Rejection, learned_rejection, most_of_few, typical_evidence
from kinespace.library.windows.remembered import remembered
from kinespace.library.windows.segments import Segments

#: Seconds between two windows that are kept of a motion in a library of one person.
_EVERY_ONE = 0.1
#: The same in a library of several persons.
_EVERY_SEVERAL = 0.4
#: Frames per second of the motions when their windows are computed.
_MEASURED_AT = 30.0
#: Frames per second at which the basis is learned.
_BASIS_AT = 10.0
#: Windows from which metrics are learned, at most.
_MAX_LESSONS = 10_000
#: Windows whose numbers are in memory at once, about.
_PIECE = 4_000
#: Seconds of another motion before a motion, as long as the longest window, where a head is taught.
_BEHIND = 2.0
#: Windows behind other motions that teach a head, at most: they take some tenths of a second.
_MAX_BEHIND = 1000
#: Motions of each class that teach a head, at least: by six, lying down and getting up were told apart 70 % of the time
#: in place of 80.
_LEAST_OF_CLASS = 8
#: Threads of linear algebra: the matrices are small, and threads take the cores from each other. On two busy cores,
#: opening takes 2 to 7 seconds by numpy's own choice of threads, and .7 by one.
_THREADS = 1
#: Views by fewer joints that an index keeps.
MAX_VIEWS = 8
#: Persons needed to learn metrics: with fewer, metrics are learned from the built-in library's persons.
_TEACHERS = 3


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
        body, kept, cut, head = Body.of(teacher.skeleton), kept_of(teacher, weighing), None, None
        measured = Measured.of(library, _every(library), weighing.first)
        if kept is None:
            lessons = Measured.of(teacher, _EVERY_SEVERAL, weighing.first).thinned(_MAX_LESSONS)
            basis = learned_basis(teacher, weighted=not weighing.by_products)
            cut = CutWindows(lessons.clips, lessons.ends, body, basis, weighing.parts, weighing.eigenvectors)
            kept = Kept(basis, Comparison.learned(weighing, cut.numbers, _lessons(teacher, lessons.motions)))
            # Only where all parts have one metric is the library's laboratory that of the feed.
            if library is teacher and _has_head(library) and None not in kept.comparison.groups:
                head = _learned_head(library, kept, lessons, cut)
        comparison = kept.comparison.of_taught_classes() if library is teacher else kept.comparison
        # Windows that taught are not cut again where all of the library's own did.
        if cut and library is teacher and len(lessons.motions) == len(measured.motions):
            placed = Placed.of(comparison, cut)
        else:
            placed = measured.placed(comparison, body, kept.basis)
        return cls(library, body, kept.basis, comparison, *placed, measured.motions, head)

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

    def distances(self, signature: Signature) -> Distances:
        """Compare a window with all windows."""
        return self.comparer.distances(signature)

    @cached_property
    def rejection(self) -> Rejection:
        """The rejection of unknown motions; learned from the motions at first use."""
        if self.judged_by:
            return self.judged_by
        learned, weighing = self.library.learned, self.comparison.weighing
        # Strangers' motions taught numbers for all groups: without some parts the library's own motions teach.
        if learned is None or not self.library.judged_by_strangers or weighing != usual_weighing(self.library):
            return learned_rejection(self)
        few = _is_few(self.library)
        rejection = Rejection.of_kept(learned, len(weighing.groups), few=few)
        fewer = len(self.library.skeleton.joints) < rejection.joints
        return replace(rejection, typical=typical_evidence(self)) if few or fewer else rejection

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
        measured = Measured.of(self.library, _every(self.library), self.comparison.weighing.first)
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
        measured = Measured.of(taught, every or _every(library), self.comparison.weighing.first)
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
        learned = self.library.learned
        some = tuple(self.library.motions[place] for place in places.tolist())
        kept = self._kept(np.isin(self.motions, places))
        library = replace(self.library, motions=some, learned=learned and learned.for_other_motions())
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
        return self._windows.logs([each[window].astype(np.float32, order="C") for each in self.vectors], left_out)


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


def usual_weighing(library: MotionLibrary) -> Weighing:
    """Choose the weighing: between laboratories for numbers learned from another laboratory, else within one."""
    return ACROSS_LABORATORIES if library.judged_by_strangers else WITHIN_LABORATORY


def teacher_of(library: MotionLibrary) -> MotionLibrary:
    """Choose the library from whose persons the metrics are learned.

    A library teaches itself when three or more of its persons share classes. Otherwise the built-in library teaches, if
    it has all joints; if it lacks some, the library teaches itself as well as it can.
    """
    if teaches_itself(library):
        return library
    builtin = MotionLibrary.builtin()
    if set(library.skeleton.joints) <= set(builtin.skeleton.joints):
        taught, skeleton = builtin.restricted_to(library.skeleton.joints), library.skeleton
        if taught.skeleton.joints == skeleton.joints:
            return taught
        motions = tuple(clip.as_of(skeleton) for clip in taught.motions)
        return replace(taught, skeleton=skeleton, motions=motions)
    return library


def teaches_itself(library: MotionLibrary) -> bool:
    """Whether so many persons of a library share classes that its metrics are learned from them."""
    performed = {(clip.class_name, clip.actor) for clip in library.motions if clip.actor}
    people = {actor for _, actor in performed}
    return len(people) >= _TEACHERS and len(performed) > len({class_name for class_name, _ in performed})


def learned_basis(library: MotionLibrary, *, weighted: bool = True) -> Basis:
    """Learn the basis from a library's motions."""
    by_class = groupby(library.motions, key=lambda clip: clip.class_name)
    rows = ((thinned(clip, _BASIS_AT) for clip in clips) for _, clips in by_class)
    measured = ((distance_rows(clip.positions, clip.skeleton) for clip in clips) for clips in rows)
    return Basis.learned(measured, Body.of(library.skeleton), weighted=weighted)


def _is_few(library: MotionLibrary) -> bool:
    """Whether a library has so few joints that numbers of their own tell unknown motion from known."""
    return len(library.skeleton.joints) <= most_of_few(library.learned)


def _every(library: MotionLibrary) -> float:
    """Give the seconds between two windows that are kept of a motion."""
    return _EVERY_SEVERAL if len(library.actors) > 1 else _EVERY_ONE


class Placed(NamedTuple):
    """Windows in the form an index keeps; the fields are as in `WindowIndex`."""

    vectors: tuple[NDArray[np.float16], ...]
    eigenvectors: NDArray[np.float32]

    @classmethod
    def of(cls, comparison: Comparison, cut: CutWindows) -> Placed:
        """Map windows to vectors."""
        vectors = tuple(each.astype(np.float16, order="C") for each in comparison.place(cut.numbers))
        return cls(vectors, cut.leading.astype(np.float32))


class Measured(NamedTuple):
    """The motions of a library, cut into windows.

    Attributes
    ----------
    clips
        The motions at the frame rate of the computation.
    ends
        For each motion the frames before which its windows end.
    motions
        The index of each window's motion.
    """

    clips: list[Clip]
    ends: list[NDArray[np.intp]]
    motions: NDArray[np.intp]

    @classmethod
    def of(cls, library: MotionLibrary, every: float, first: float = FIRST_WINDOW) -> Measured:
        """Cut a library's motions into windows.

        Parameters
        ----------
        library
            The motions.
        every, first
            Seconds between two windows, and from a motion's start to the end of its first window.

        Raises
        ------
        ValueError
            No motion is long enough for a window.
        """
        clips = [thinned(clip, _MEASURED_AT) for clip in library.motions]
        ends = [window_ends(clip, every, first) for clip in clips]
        motions = np.repeat(np.arange(len(clips)), [len(each) for each in ends])
        if not len(motions):
            raise ValueError("library: expected a motion long enough for a window, got none")
        return cls(clips, ends, motions)

    def thinned(self, most: int) -> Measured:
        """Keep at most so many windows, evenly spread."""
        step = -(-len(self.motions) // most)
        if step == 1:
            return self
        kept = np.arange(len(self.motions)) % step == 0
        of_motions = np.split(kept, np.searchsorted(self.motions, np.arange(1, len(self.clips))))
        ends = [each[some] for each, some in zip(self.ends, of_motions, strict=True)]
        return Measured(self.clips, ends, self.motions[kept])

    def behind_others(self) -> Measured:
        """Give the same windows as if each motion was played right behind another motion of the same person."""
        clips, ends, before = [*self.clips], [*self.ends], dict[tuple[str, float], "NDArray[np.floating]"]()
        for place in np.random.default_rng(0).permutation(len(clips)).tolist():
            clip, own = self.clips[place], self.ends[place]
            most, key = round(_BEHIND * clip.frame_rate), (clip.actor, clip.frame_rate)
            # Distances are cut, so the body may stand elsewhere.
            last = before.get(key, clip.positions)[-most:]
            clips[place] = replace(clip, positions=np.concatenate([last, clip.positions]))
            # Later windows hold nothing of the other motion.
            ends[place] = own[own <= most] + len(last)
            before[key] = clip.positions
        return Measured(clips, ends, np.repeat(np.arange(len(clips)), [len(each) for each in ends]))

    def placed(self, comparison: Comparison, body: Body, basis: Basis) -> Placed:
        """Compute the windows' vectors."""
        pieces = [Placed.of(comparison, cut) for cut in self.cut(comparison.weighing, body, basis)]
        vectors, eigenvectors = zip(*pieces, strict=True)
        return Placed(tuple(map(np.concatenate, zip(*vectors, strict=True))), np.concatenate(eigenvectors))

    def cut(self, weighing: Weighing, body: Body, basis: Basis) -> Iterator[CutWindows]:
        """Compute the windows' numbers, some motions at a time, because they take much memory."""
        begin = 0
        pieces_of = np.cumsum([0, *map(len, self.ends)]) // _PIECE
        # With the last motion a piece may be full.
        for end in sorted({*(np.flatnonzero(np.diff(pieces_of)) + 1), len(self.clips)}):
            some = self.clips[begin:end], self.ends[begin:end]
            yield CutWindows(*some, body, basis, weighing.parts, weighing.eigenvectors)
            begin = end


def thinned(clip: Clip, frame_rate: float) -> Clip:
    """Give a clip with every so many frames alone, that it has about so many a second."""
    step = max(1, round(clip.frame_rate / frame_rate))
    return replace(clip, positions=clip.positions[::step], frame_rate=clip.frame_rate / step)


def _lessons(library: MotionLibrary, motions: NDArray[np.intp]) -> Lessons:
    """Give each window's class and person; each motion without a named person counts as a person of its own."""
    _, classes = np.unique([clip.class_name for clip in library.motions], return_inverse=True)
    _, people = np.unique([clip.actor for clip in library.motions], return_inverse=True)
    return Lessons(classes[motions], people[motions])


def _has_head(library: MotionLibrary) -> bool:
    """Say whether a library of several persons has motions enough for a head: it knows a few by heart, and errs."""
    classes = Counter(motion.class_name for motion in library.motions)
    return teaches_itself(library) and min(classes.values()) >= _LEAST_OF_CLASS


def _learned_head(library: MotionLibrary, kept: Kept, lessons: Measured, cut: CutWindows) -> Head:
    """Learn a head from the windows that taught the metrics, and from the same behind other motions."""
    behind, weighing = lessons.behind_others().thinned(_MAX_BEHIND), kept.comparison.weighing
    windows = (cut, *behind.cut(weighing, Body.of(library.skeleton), kept.basis))
    vectors = [np.concatenate([*kept.comparison.placed(each.numbers).values()], axis=1) for each in windows]
    motions = np.concatenate([lessons.motions, behind.motions]).tolist()
    return Head.learned(np.concatenate(vectors), [library.motions[place].class_name for place in motions])
