"""A library opened for recognition: its motions' windows, as vectors with which a live window is compared."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.library_file import for_other_motions
from kinespace.library.motion_library import NOTHING, MotionLibrary
from kinespace.library.phases import PhaseTable
from kinespace.library.signature.basis import Basis
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import Signature
from kinespace.library.windows.comparer import Comparer, Distances, Head, Likelihood
from kinespace.library.windows.comparison import Comparison, Weighing
from kinespace.library.windows.courses import Courses
from kinespace.library.windows.cutting import Cut, Measured, every_in, placed
from kinespace.library.windows.paper import PaperComparer
from kinespace.library.windows.rejection import Rejection, rejection_of
from kinespace.library.windows.segments import Segments
from kinespace.library.windows.taught import taught_by, teacher_of, usual_weighing


@dataclass(eq=False)
class WindowIndex:
    """The windows of a library's motions, by class and person.

    The properties are computed at first use, and stay.

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
        Index of each window's motion, shape (windows,), ascending: the windows of a class lie together, and in it the
        windows of a person.
    head
        What helps to name the classes that taught it, within one laboratory; else None.
    base, every
        The index of a library from which this one was derived, by other motions; None for itself. And the seconds
        between two windows of the motions that were added.
    whole, views
        The index of all joints that this is a view of, by fewer; None for itself. And its own views
        (`library.windows.opening`).
    """

    library: MotionLibrary
    body: Body
    basis: Basis
    comparison: Comparison
    vectors: tuple[NDArray[np.float16], ...] = field(repr=False)
    eigenvectors: NDArray[np.float32] = field(repr=False)
    motions: NDArray[np.intp] = field(repr=False)
    head: Head | None = field(default=None, repr=False)
    base: WindowIndex | None = field(default=None, repr=False)
    every: float | None = None
    whole: WindowIndex | None = field(default=None, repr=False)
    views: dict[tuple[str, ...], WindowIndex] = field(default_factory=dict, init=False, repr=False)

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
        weighing, teacher = weighing or usual_weighing(library), teacher or teacher_of(library)
        measured, body = Measured.of(library, every_in(library), weighing.first), Body.of(teacher.skeleton)
        basis, comparison, head, taught = taught_by(teacher, weighing, names=library is teacher)
        windows: Iterable[Cut] = measured.cut(weighing, body, basis)
        if library is teacher:
            comparison = comparison.of_taught_classes()
            # Windows that taught are not cut again where all of the library's own did.
            if taught and len(taught[1]) == len(measured.motions):
                windows = [taught]
        return cls(library, body, basis, comparison, *placed(comparison, windows), measured.motions, head)

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

    # --- distances ---------------------------------------------------------------------------------------------------

    @cached_property
    def _windows(self) -> Comparer:
        """The windows as they are compared."""
        whose = np.array([np.unique(each, return_inverse=True)[1] for each in zip(*self._whose, strict=True)]).T
        return Comparer.of(self.comparison.weighing, self.vectors, self.eigenvectors, whose)

    @cached_property
    def comparer(self) -> Comparer:
        """The windows as a live window is compared with them."""
        # What judges a guess where the library cannot learn what is unknown.
        likelihood = Likelihood.of(self.vectors) if self.rejection.by_likelihood else None
        return self._windows._replace(likelihood=likelihood, head=self.head and self.head.of_classes(self.classes))

    def distances(self, signatures: Sequence[Signature]) -> list[Distances]:
        """Compare some windows with all windows, together: then the library's come from memory once."""
        leading = np.array([each.leading for each in signatures], dtype=np.float32)
        if self.comparison.weighing.as_in_paper:
            return PaperComparer(self._windows).distances(leading)
        numbers = {part: np.array([each.parts[part] for each in signatures]) for part in signatures[0].parts}
        placed = self.comparison.placed(numbers)
        return self.comparer.distances(leading, placed.values(), self.comparison.joined(numbers, placed))

    def asked_by(self, window: int, left_out: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Compare one of the library's own windows with the others, without some of them.

        It is given by its index; flags, (windows,), leave some out. For each of the weighing's `weights` gives the log
        distance of each class, shape (weights, classes); infinite for a class without windows left.
        """
        asked = [each[window : window + 1].astype(np.float32, order="C") for each in self.vectors]
        return self._windows.logs(asked, np.where(left_out, np.inf, 0.0))[:, 0]

    # --- learned from the motions -------------------------------------------------------------------------------------

    @cached_property
    def rejection(self) -> Rejection:
        """The rejection of unknown motions."""
        return rejection_of(self)

    @cached_property
    def segments(self) -> Segments:
        """The segments of the motions' bodies."""
        return Segments.of(self.framed)

    @cached_property
    def courses(self) -> Courses:
        """The courses of the motions that have windows here, by which motions are found that begin and are done."""
        framed = self.framed.motions
        return Courses.of([framed[place] for place in np.unique(self.motions)])

    @cached_property
    def phases(self) -> PhaseTable:
        """The moments of the motions with their phases, by which progress is followed."""
        named = [motion for motion in self.framed.motions if motion.class_name != NOTHING]
        return PhaseTable.of(named, self.body, self.basis)

    @cached_property
    def seconds_into(self) -> NDArray[np.float64]:
        """The seconds from a motion's beginning to the end of each window, (windows,); of an index that is no view."""
        measured = Measured.of(self.library, every_in(self.library), self.comparison.weighing.first)
        of_motions = zip(measured.ends, measured.clips, strict=True)
        return np.concatenate([ends / clip.frame_rate for ends, clip in of_motions])

    @property
    def framed(self) -> MotionLibrary:
        """The motions with all their frames: a view keeps none."""
        return self.whole.library.restricted_to(self.library.skeleton.joints) if self.whole else self.library

    def prepared(self) -> Self:
        """Compute now what is otherwise computed at first use, so that the first hop need not wait; give itself."""
        _ = self.comparer, self.segments, self.courses
        return self

    # --- derived ------------------------------------------------------------------------------------------------------

    def with_motions(self, clips: Iterable[Clip], every: float | None = None) -> WindowIndex:
        """Add clips to the library, each as one motion, and cut their windows.

        Basis, metrics and rejection stay the same; `of` learns them again. So adding clips is quick, and, after
        `prepared`, a feed goes on without a pause (`stream.recognizer.Recognizer.exchange`).

        Parameters
        ----------
        clips
            At least one.
        every
            Seconds between two of their windows; as for motions that were added before, or the library's own, when not
            given.

        Raises
        ------
        ValueError
            A clip has no class name, too few frames, no movement, or joints more than a kilometre away; or no clip is
            long enough for a window.
        SkeletonMismatchError
            A clip has other joints than the library.
        """
        added = list(clips)
        if not added:
            raise ValueError("motions: expected at least one, got none")
        index = self.of_library(self.library.with_motions(added), every)
        index.rejection = self.rejection
        return index

    def of_some(self, motions: Sequence[int]) -> WindowIndex:
        """Give the index of some motions alone, by their indices, with the numbers of the library that hold for them.

        Basis and metrics stay the same; what is unknown is learned from these motions.
        """
        some = tuple(self.library.motions[place] for place in np.unique(motions).tolist())
        return self.of_library(replace(self.library, motions=some, learned=for_other_motions(self.library.learned)))

    def of_library(self, library: MotionLibrary, every: float | None = None) -> WindowIndex:
        """Give the windows of a library's motions: those of motions that are here are kept, the others are cut."""
        every = every or self.every or every_in(library)
        places = dict[int, list[int]]()
        for place, motion in enumerate(library.motions):
            places.setdefault(id(motion), []).append(place)
        kept = (places.get(id(motion)) or [-1] for motion in self.library.motions)
        now = np.array([each.pop(0) for each in kept], dtype=np.intp)
        vectors, eigenvectors, motions = self.vectors, self.eigenvectors, now[self.motions]
        if new := sorted(place for each in places.values() for place in each):
            added = replace(library, motions=tuple(library.motions[place] for place in new))
            measured = Measured.of(added, every, self.comparison.weighing.first)
            windows = measured.cut(self.comparison.weighing, self.body, self.basis)
            more, leading = placed(self.comparison, windows)
            vectors = tuple(map(np.concatenate, zip(vectors, more, strict=True)))
            eigenvectors = np.concatenate([eigenvectors, leading])
            motions = np.concatenate([motions, np.array(new)[measured.motions]])
        # Windows of motions that are gone come first.
        order = motions.argsort(kind="stable")[np.count_nonzero(motions < 0) :]
        # A view cuts what its base does not have, all at the same distance.
        base = self.base if self.base and every == self.every else self
        index = replace(self, library=library, base=base, every=every, whole=None, motions=motions[order])
        return replace(index, vectors=tuple(each[order] for each in vectors), eigenvectors=eigenvectors[order])
